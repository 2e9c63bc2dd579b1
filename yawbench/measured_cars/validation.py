"""Validation: whether measurements of a car lie within a band around the cross plots of a simulated run.

A cross plot shows a signal y over another x, the lateral acceleration in steady state. Both have a tolerance,
eps = offset + gain |value|. The distance of a measured point from the simulated cross plot is the smallest
factor of the tolerances with which the ellipse around one of its points, with the semi-axes eps_x and eps_y,
holds it:

    d = min over the cross plot of sqrt(((x_m - x) / eps_x)^2 + ((y_m - y) / eps_y)^2)

The band that is drawn is all of d <= 1, with round ends. Angles of velocities are compared while the cars
move (`motion`).

A signal passes if no measured point is further than 1 from its cross plot. A run that turns to one side is
compared with tests to the other side by its mirror image.

Source: the VVUQ framework of TUMFTM, which states the boundaries of this band along a cross plot after ISO
19364; the standard itself was not read. Tolerances are data, in files with a source of their own
(`load_bands`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field, WithJsonSchema

from yawbench.figures.display import shown_unit
from yawbench.figures.style import CHANGED, frame, line_style, new_figure
from yawbench.foundation.errors import Diagnostic, ResultsError, ScenarioError, code_of, warnings_in
from yawbench.foundation.messages import counted, hint, resolved
from yawbench.foundation.safe_files import reads
from yawbench.measurements.measurement import Measurement
from yawbench.measurements.segment import Segment
from yawbench.metrics.measures import words
from yawbench.metrics.verdict import Verdict, apart, compare, not_judged, worded, worst
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.scenario import catalogue, yaml_lines
from yawbench.orchestrator.scenario.quantities import convert
from yawbench.orchestrator.scenario.schema_validation import StrictModel, validated
from yawbench.orchestrator.scenario.yaml_lines import Document
from yawbench.proving_ground.trace import Trace, trace_of
from yawbench.vehicles.motion import standing
from yawbench.vocabulary.motion import ANGLES, LEAST_SPEED
from yawbench.vocabulary.signals import SIGNALS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BANDS = "steady_state"
"""Name of the bands of steady-state tests."""
LEAST_TESTS = 3
"""Tests below which a warning is given: ISO 19364 has the car tested at least three times, as cited there."""
SPACING = 0.05
"""Distance of points on a cross plot over the tolerance; chosen: distances are exact to 0.1 %."""
LONGEST = 20_000
"""Most points of a cross plot; chosen: some seconds for an hour of measurement."""
POINTS = 2000
"""Points drawn of each test; those outside are all drawn. Chosen: dense on the page."""
CELLS = 10
"""Points of the grid, on which the band's boundary is found, within a tolerance; chosen: exact to 1 %, and to
5 % in corners between stretches."""
MOST_CELLS = 2000
"""Most points of that grid along an axis; chosen: a page has no more pixels."""
REACH = 0.5
"""Distance beyond the band up to which the grid has distances, over the tolerance; chosen: some points."""
BAND = "#DCE9F5"
MEASURED = "#111111"
MIRRORED = ("steering_wheel_angle", "steer_angle", "yaw_rate", "acceleration_y", "velocity_y", "sideslip",
            "roll_angle", "roll_rate")  # fmt: skip
"""Signals that change their sign in a mirror; others are not compared with tests to the other side."""


def _known(name: str) -> str:
    if name not in SIGNALS:
        raise ValueError(f"unknown signal {name!r}{hint(name, SIGNALS, lead='known')}")
    return name


SignalText = Annotated[
    str, AfterValidator(_known), WithJsonSchema({"type": "string", "enum": sorted(SIGNALS)})
]


class ToleranceSpec(StrictModel):
    """The tolerance of a signal."""

    offset: float | str = Field(description="With a unit, such as 5 deg")
    gain: float | str = Field(description="Part of the value, such as 3 %")


class BandsSpec(StrictModel):
    """A file of bands."""

    title: str = Field(min_length=1)
    source: str = Field(min_length=1, description="Where the tolerances come from; shown with every verdict")
    over: SignalText = Field("acceleration_y", description="Signal over which the others are plotted")
    bands: dict[SignalText, ToleranceSpec] = Field(min_length=2, description="Signal -> tolerance")


@dataclass(frozen=True)
class Tolerance:
    """A tolerance, in SI: offset + gain |value|."""

    offset: float
    gain: float

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Return the tolerance at some values."""
        tolerance: np.ndarray = self.offset + self.gain * np.abs(values)
        return tolerance


@dataclass(frozen=True)
class Bands:
    """Tolerances of signals that are plotted over one of them."""

    title: str
    source: str
    over: str
    tolerances: Mapping[str, Tolerance]

    @property
    def judged(self) -> list[str]:
        """The signals that are plotted over `over`."""
        return [name for name in self.tolerances if name != self.over]


@reads("file of bands", ScenarioError)
def load_bands(name: str | Path) -> Bands:
    """Read bands by their name in `scenarios/bands`, or from a file.

    Raises:
        ScenarioError: there is no such file, or it is invalid; lists all errors.
    """
    path = catalogue.find(name, "a file of bands")
    document = yaml_lines.read(path, what="file of bands")
    spec = validated(BandsSpec, document)
    tolerances = {name: _tolerance(document, name, tolerance) for name, tolerance in spec.bands.items()}
    if spec.over not in tolerances:
        document.report(("over",), f"{spec.over} has no tolerance; add it to 'bands'", "key-missing")
    document.raise_errors()
    return Bands(spec.title, spec.source, spec.over, tolerances)


def _tolerance(document: Document, signal: str, spec: ToleranceSpec) -> Tolerance:
    """Return a tolerance in SI; report its errors."""

    def si(key: str, value: float | str, unit: str) -> float:
        try:
            if not isinstance(value, str) and unit != "1":
                raise ValueError(f"must be text with a unit, such as {unit} (got {value:g})")
            number = float(convert(value, unit)) if isinstance(value, str) else value
            if not (number > 0.0 if key == "offset" else number >= 0.0):
                raise ValueError(f"must be {'above 0' if key == 'offset' else 'at least 0'} (got {value})")
        except ValueError as error:
            document.report(("bands", signal, key), str(error), code_of(error))
            return math.nan
        return number

    return Tolerance(si("offset", spec.offset, SIGNALS[signal].unit), si("gain", spec.gain, "1"))


@dataclass(frozen=True)
class ComparedTest:
    """A test of the car in a cross plot.

    Attributes:
        name: of the segment; says so if it is mirrored.
        time: of the measured points [s], shape (points,).
        over, values: of these points, to the side of the run.
        distance: of each of them, over the tolerance.
    """

    name: str
    time: np.ndarray
    over: np.ndarray
    values: np.ndarray
    distance: np.ndarray


@dataclass(frozen=True)
class CrossPlot:
    """The cross plot of a signal.

    Attributes:
        signal: its name.
        time: of the run [s], shape (points,).
        over, values: of the run, of the same shape.
        of_over, of_values: their tolerances, of the same shape.
        tests: of the car.
    """

    signal: str
    time: np.ndarray
    over: np.ndarray
    values: np.ndarray
    of_over: np.ndarray
    of_values: np.ndarray
    tests: Sequence[ComparedTest]

    @cached_property
    def outline(self) -> tuple[np.ndarray, np.ndarray]:
        """The boundary of the band, where the distance is 1: (over, values); NaN between closed lines."""
        from contourpy import contour_generator

        x, y = _spread(self.over, self.of_over), _spread(self.values, self.of_values)
        squared = np.full((y.size, x.size), (1.0 + REACH) ** 2)
        for at_x, at_y, eps_x, eps_y in zip(
            self.over, self.values, self.of_over, self.of_values, strict=True
        ):
            across, up = (
                slice(*np.searchsorted(axis, (centre - (1.0 + REACH) * eps, centre + (1.0 + REACH) * eps)))
                for axis, centre, eps in ((x, at_x, eps_x), (y, at_y, eps_y))
            )
            part = squared[up, across]
            aside, above = (x[across] - at_x) / eps_x, (y[up] - at_y) / eps_y
            np.minimum(part, (aside * aside)[None, :] + (above * above)[:, None], out=part)
        lines = [np.asarray(line) for line in contour_generator(x, y, np.sqrt(squared)).lines(1.0)]
        gap = np.full((1, 2), np.nan)
        joined = np.concatenate([part for line in lines for part in (line, gap)][:-1] or [gap])
        return joined[:, 0], joined[:, 1]


def _spread(values: np.ndarray, tolerances: np.ndarray) -> np.ndarray:
    """Return coordinates around values, so dense that `CELLS` of them lie within a tolerance."""
    order = np.argsort(values)
    values, tolerances = values[order], tolerances[order]
    room = 1.0 + 2.0 * REACH
    ends = values[0] - room * tolerances[0], values[-1] + room * tolerances[-1]
    values, tolerances = np.concatenate([ends[:1], values, ends[1:]]), np.pad(tolerances, 1, "edge")
    within = np.append(0.0, np.cumsum(np.diff(values) / np.minimum(tolerances[1:], tolerances[:-1])))
    count = min(MOST_CELLS, math.ceil(CELLS * float(within[-1])))
    return np.unique(np.interp(np.linspace(0.0, within[-1], count), within, values))


@dataclass(frozen=True)
class Validation:
    """A run compared with measurements; made by `validate`.

        >>> yb.validate(run, "measured.yaml").holds  # doctest: +SKIP
        True

    Attributes:
        title: of the run.
        measured: car and date of the measurement; `origin`: its source and licence.
        bands: their title; `source`: where their tolerances come from.
        verdicts: signal -> verdict; its number is the largest distance over the tolerance, its bound 1.
        conditions: name -> verdict on what such a comparison asks for: tests of the car, their range.
        diagnostics: warnings where they are not met.
    """

    title: str
    measured: str
    origin: str
    bands: str
    source: str
    verdicts: Mapping[str, Verdict]
    conditions: Mapping[str, Verdict]
    diagnostics: tuple[Diagnostic, ...]
    plots: Sequence[CrossPlot]
    horizontal: str

    @property
    def verdict(self) -> Verdict | None:
        """The worst verdict."""
        return worst(self.verdicts.values())

    @property
    def holds(self) -> bool | None:
        """Whether all signals that could be judged passed; None if there is none."""
        judged = [verdict.holds for verdict in self.verdicts.values() if verdict.holds is not None]
        return all(judged) if judged else None

    def plot(self) -> Figure:
        """Return the cross plots with their bands as a figure."""
        return _draw(self)

    def as_data(self) -> dict[str, Any]:
        """Return the comparison as plain data for files, in SI units."""
        return {
            "run": self.title, "measured": self.measured, "origin": self.origin, "bands": self.bands,
            "source": self.source, "over": self.horizontal, "holds": self.holds,
            "signals": {name: verdict.as_data() for name, verdict in self.verdicts.items()},
            "conditions": {name: verdict.as_data() for name, verdict in self.conditions.items()},
            "warnings": [str(diagnostic) for diagnostic in self.diagnostics],
        }  # fmt: skip

    def __repr__(self) -> str:
        verdicts = "; ".join(f"{name} {verdict}" for name, verdict in self.verdicts.items())
        noted = "".join(f"; {text}" for text in warnings_in(self.diagnostics))
        return f"<Validation of {self.title!r}: {verdicts}{noted}>"


@np.errstate(all="ignore")
def compare_run(results: Results, measurement: Measurement, bands: Bands) -> Validation:
    """Compare a run with all segments of a measurement.

    The low pass of the measurement acts on the run, too.

    Raises:
        ResultsError: the signal over which the others are plotted was not recorded, or not measured.
    """
    trace = trace_of(results)
    moving = (
        np.interp(trace.even.time, trace.time, trace.standing) == 0.0
        if measurement.filter
        else ~trace.standing
    )
    if measurement.filter:
        low_pass, even = measurement.filter, trace.even
        signals = {name: low_pass(even[name], even.rate) for name in bands.tolerances if name in even}
        trace = Trace(trace.label, even.time, signals, title=trace.title)
    over = trace[bands.over]
    tests = [
        segment.sampled([bands.over]) for segment in measurement.segments if bands.over in segment.signals
    ]
    if not tests:
        raise ResultsError(f"{measurement.path}: {bands.over} is not measured", code="signal-unknown")
    verdicts, plots = {}, []
    for name in bands.judged:
        sampled = [segment.sampled((bands.over, name)) for segment in tests if name in segment.signals]
        own = [segment for segment in sampled if segment.time.size]
        if name not in trace or not own:
            verdicts[name] = not_judged("not measured" if name in trace else "not recorded in the run")
            continue
        rows = moving if name in ANGLES else np.ones_like(moving)
        own = [_while_moving(segment) for segment in own] if name in ANGLES else own
        own = [segment for segment in own if segment.time.size]
        if not (np.any(rows) and own):
            verdicts[name] = not_judged(f"the car is not faster than {3.6 * LEAST_SPEED:.0f} km/h")
            continue
        line = trace.time[rows], over[rows], trace[name][rows]
        band = _Band(*line, bands.tolerances[bands.over], bands.tolerances[name])
        sides = [band.side_of(segment.signals[bands.over], (bands.over, name)) for segment in own]
        compared = [
            band.test(segment, side, (bands.over, name)) for segment, side in zip(own, sides, strict=True)
        ]
        verdicts[name] = _verdict(bands.over, compared)
        plots.append(CrossPlot(name, band.time, *band.points, *band.tolerances, compared))
    conditions = dict(_conditions(bands, over, [segment.signals[bands.over] for segment in tests]))
    notes = [verdict.why for verdict in conditions.values() if not verdict.holds]
    return Validation(
        trace.title, measurement.title, measurement.origin, bands.title, bands.source, verdicts, conditions,
        (
            *(note for note in measurement.notes if note.code == "measurement-gap"),
            *(Diagnostic("validation-conditions", note, "warning") for note in notes),
        ),
        plots, bands.over,
    )  # fmt: skip


def _while_moving(segment: Segment) -> Segment:
    """Return the rows of a segment in which the car moves."""
    stands = standing(segment.signals)
    return segment if stands is None else segment.rows(~stands)


def _verdict(over: str, tests: Sequence[ComparedTest]) -> Verdict:
    """Return the verdict on a signal: its measured point with the largest distance."""
    furthest = max(tests, key=lambda test: float(test.distance.max()))
    k = int(furthest.distance.argmax())
    distance = float(furthest.distance[k])
    where = f"at {furthest.over[k]:.3g} {SIGNALS[over].unit} of {over}, {furthest.name}"
    return compare(
        distance, "at_most", 1.0, why=f"{apart(distance, 1.0, decimals=2)} of the tolerance {where}"
    )


def _conditions(bands: Bands, over: np.ndarray, tests: Sequence[np.ndarray]) -> Iterator[tuple[str, Verdict]]:
    """Yield name and verdict of what the comparison asks for; tests with the same samples are one."""
    number = len({test.tobytes() for test in tests})
    again = f" ({len(tests)} segments, some the same)" if number < len(tests) else ""
    tested = f"{counted(number, 'test')} of the car{again}"
    few = f"{tested}; ISO 19364, as cited, asks for {LEAST_TESTS} or more"
    yield "tests of the car", compare(float(number), "at_least", float(LEAST_TESTS), why=few)
    wanted = float(np.abs(over).max())
    reached = max(float(np.abs(test).max()) for test in tests)
    tolerance = float(bands.tolerances[bands.over](np.array(wanted)))
    unit = SIGNALS[bands.over].unit
    ends = [f"{x:.3g}" for x in (reached, wanted)]
    its, own = ends if ends[0] != ends[1] else resolved(reached, wanted)
    short = (
        f"the measurement ends at {its} {unit} of {bands.over}, the run at {own} {unit}; "
        "the rest is not judged"
    )
    yield f"largest {bands.over}", compare(reached, "at_least", wanted - tolerance, unit, why=short)


class _Band:
    """The band around the cross plot of a run.

    Args:
        time, over, values: of the run, shape (rows,).
        of_over, of_values: tolerances of over and values.
    """

    def __init__(
        self,
        time: np.ndarray,
        over: np.ndarray,
        values: np.ndarray,
        of_over: Tolerance,
        of_values: Tolerance,
    ) -> None:
        steps = np.hypot(np.diff(over) / of_over(over[1:]), np.diff(values) / of_values(values[1:]))
        length = np.concatenate([[0.0], np.cumsum(steps)])
        count = min(LONGEST, 2 + math.ceil(length[-1] / SPACING))
        places = np.linspace(0.0, length[-1], count)
        self.time = np.interp(places, length, time)
        self.points = np.interp(places, length, over), np.interp(places, length, values)
        self.tolerances = of_over(self.points[0]), of_values(self.points[1])

    def side_of(self, over: np.ndarray, names: tuple[str, str]) -> float:
        """Return -1 if a test goes to the side to which the run does not, else 1."""
        low, high = float(self.points[0].min()), float(self.points[0].max())
        eps = float(self.tolerances[0].min())
        both = low < -eps and high > eps
        against = float(over[np.abs(over).argmax()]) * (low + high) < 0.0
        return -1.0 if against and not both and all(name in MIRRORED for name in names) else 1.0

    def test(self, segment: Segment, side: float, names: tuple[str, str]) -> ComparedTest:
        """Return a test, mirrored if `side` is -1, with the distances of its points."""
        (x, y), (eps_x, eps_y) = self.points, self.tolerances
        over, values = (side * segment.signals[name] for name in names)
        distance = np.empty(over.size)
        rows = max(1, 2_000_000 // x.size)
        for first in range(0, over.size, rows):
            some = slice(first, first + rows)
            aside = (over[some, None] - x) / eps_x
            up = (values[some, None] - y) / eps_y
            distance[some] = np.sqrt((aside * aside + up * up).min(axis=1))
        name = f"{segment.name}, mirrored" if side < 0.0 else segment.name
        return ComparedTest(name, segment.time, over, values, distance)


def _draw(validation: Validation) -> Figure:
    """Return the cross plots of a validation."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch, PathPatch
    from matplotlib.path import Path as Line

    unit_x, factor_x = shown_unit(SIGNALS[validation.horizontal].unit)
    with new_figure() as figure:
        panels = figure.subplots(1, max(1, len(validation.plots)), squeeze=False)[0]
        for axes, plot in zip(panels, validation.plots, strict=False):
            unit, factor = shown_unit(SIGNALS[plot.signal].unit)
            edges = np.column_stack([factor_x * plot.outline[0], factor * plot.outline[1]])
            parts = [part for part in np.split(edges, np.flatnonzero(np.isnan(edges[:, 0]))) if len(part) > 2]
            loops = [Line(part[~np.isnan(part[:, 0])], closed=True) for part in parts]
            axes.add_patch(
                PathPatch(Line.make_compound_path(*loops), facecolor=BAND, edgecolor="none", zorder=0)
            )
            axes.plot(factor_x * plot.over, factor * plot.values, **line_style(0))
            for test in plot.tests:
                beyond = test.distance > 1.0
                some = np.zeros(beyond.size, dtype=bool)
                some[:: max(1, beyond.size // POINTS)] = True
                for chosen, colour, layer in ((some & ~beyond, MEASURED, 3), (beyond, CHANGED, 4)):
                    x, y = factor_x * test.over[chosen], factor * test.values[chosen]
                    axes.plot(x, y, ".", color=colour, markersize=1.5, zorder=layer)
            axes.margins(0.03, 0.1)
            axes.set_title(f"{words(plot.signal)} [{unit}]")
            axes.set_xlabel(f"{words(validation.horizontal)} [{unit_x}]")
        dot: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 7}
        handles: list[Any] = [
            Line2D([], [], label=validation.title, **line_style(0)),
            Patch(color=BAND, label="tolerance"),
            Line2D([], [], label=validation.measured, color=MEASURED, **dot),
        ]
        if any((test.distance > 1.0).any() for plot in validation.plots for test in plot.tests):
            handles.append(Line2D([], [], label="outside", color=CHANGED, **dot))
        verdicts = ", ".join(f"{words(name)} {worded(v.status)}" for name, v in validation.verdicts.items())
        tests = counted(len(validation.plots[0].tests), "test") if validation.plots else "no test"
        note = " · ".join(filter(None, [
            f"{validation.bands}: {validation.source}", tests, validation.origin,
            *(f"{words(name)}: {verdict.why}" for name, verdict in validation.verdicts.items()),
        ]))  # fmt: skip
        frame(figure, 4.2, handles, f"Validation: {verdicts}", note)
    return figure

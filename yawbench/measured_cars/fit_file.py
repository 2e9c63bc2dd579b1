"""Fit files: a scenario, the measurement that it is fitted to, its windows, and what is free.

    title: A saloon fitted to two sine sweeps
    scenario: sweep.yaml                 # with `inputs: {steer_angle: {file: measured.yaml}}`
    measured: measured.yaml
    training:                            # stretches, cut into windows that are simulated one by one
      - {segment: 1, begin: 0, end: 30 s, window: 10 s}
    held_out:                            # likewise; never the same seconds
      - {segment: 2, begin: 0, end: 30 s, window: 10 s}
    compared: {yaw_rate: 0.1 deg/s, acceleration_y: 0.05 m/s2}      # signal -> expected difference
    free:                                # targets as of --set, and of the measurement
      vehicle.yaw_inertia: {low: 1000, high: 4000, start: 2000, prior: {mean: 2100, deviation: 300}}
      measured.yaw_rate.offset: {low: -1 deg/s, high: 1 deg/s}
      measured.steer_angle.delay: {low: -50 ms, high: 50 ms}

`measured.SIGNAL.delay` and `.offset` belong to the recording: at time t it shows what the car had at
t - delay, plus the offset. Those of an input change the runs, those of a compared signal need none.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from yawbench.fmus.fmu import Value
from yawbench.foundation.errors import ScenarioError, code_of
from yawbench.foundation.messages import hint, span
from yawbench.foundation.safe_files import reads
from yawbench.measurements.measurement import Measurement, load_measurement
from yawbench.measurements.segment import Segment
from yawbench.orchestrator.recordings.gaps import by_signals
from yawbench.orchestrator.scenario import yaml_lines
from yawbench.orchestrator.scenario.quantities import convert
from yawbench.orchestrator.scenario.schema import Scalar
from yawbench.orchestrator.scenario.schema_validation import Instant, StrictModel, Time, validated
from yawbench.orchestrator.scenario.yaml_lines import Document
from yawbench.vehicles.motion import standing
from yawbench.vocabulary.motion import ANGLES, LEAST_SPEED
from yawbench.vocabulary.signals import SIGNALS

from .least_squares import Window

MEASURED = "measured"
"""Prefix of the free parameters of a measurement."""
LARGEST = 1e9
"""Largest measured value over its expected difference. Chosen: sums of their squares keep some digits."""


class PriorSpec(StrictModel):
    """Prior of a parameter."""

    mean: Scalar
    deviation: Scalar = Field(description="Standard deviation; weighs as much as one sample at its error")


class FreeSpec(StrictModel):
    """A free parameter; numbers in SI or with a unit."""

    low: Scalar = Field(description="Lower bound")
    high: Scalar = Field(description="Upper bound")
    start: Scalar | None = Field(None, description="Default: the scenario's value; of the measurement: 0")
    prior: PriorSpec | None = None


class StretchSpec(StrictModel):
    """A stretch of a segment, cut into windows."""

    segment: int | None = Field(None, description="Number of the segment, from 1; default: the only one")
    begin: Instant = Field(description="s, in the segment's time")
    end: Time = Field(description="s")
    window: Time | None = Field(None, description="s, longest duration of a window; default: all of it")


class FitSpec(StrictModel):
    """A fit file."""

    title: str = Field(min_length=1)
    source: str = Field("", description="Where the choices of this file come from")
    scenario: str = Field(min_length=1, description="Relative to this file")
    measured: str = Field(min_length=1, description="Measurement file, relative to this file")
    training: list[StretchSpec] = Field(min_length=1, description="What parameters are fitted to")
    held_out: list[StretchSpec] = Field([], description="What the fitted models are judged by")
    compared: dict[str, Scalar] = Field(
        min_length=1, description="Signal of the plant -> expected difference"
    )
    free: dict[str, FreeSpec] = Field(min_length=1, description="Free parameters: target -> range")
    settling: Time = Field(Fraction(1, 2), description="s, not compared at the start of each window")
    most_sets: int = Field(300, ge=2, description="Sets of values after which the search stops")


Part = Literal["training", "held_out"]
PARTS: tuple[Part, ...] = ("training", "held_out")


@dataclass(frozen=True)
class FitWindow:
    """A window, and the segment that it is cut from: filtered for comparison, unfiltered for inputs."""

    window: Window
    filtered: Segment
    raw: Segment


@dataclass(frozen=True)
class LoadedFit:
    """A fit file with its measurement."""

    path: Path
    spec: FitSpec
    measurement: Measurement
    errors: Mapping[str, float]  # compared signal -> expected difference, in SI
    training: Sequence[FitWindow]
    held_out: Sequence[FitWindow]

    @property
    def scenario(self) -> Path:
        """The scenario file."""
        return self.path.parent / self.spec.scenario

    @property
    def parts(self) -> dict[str, Sequence[FitWindow]]:
        """Part -> its windows."""
        return {"training": self.training, "held_out": self.held_out}

    @property
    def deciding(self) -> str:
        """The part that decides which model is better."""
        return "held_out" if self.held_out else "training"

    @property
    def settling(self) -> float:
        """Time that is not compared at the start of a window [s]."""
        return float(self.spec.settling)


@reads("fit file", ScenarioError)
def load_fit(path: Path | str) -> LoadedFit:
    """Load a fit file and its measurement.

    Raises:
        ScenarioError: one of them is invalid; lists all errors.
    """
    path = Path(path)
    document = yaml_lines.read(path, what="fit file")
    spec = validated(FitSpec, document)
    file = path.parent / spec.measured
    filtered = load_measurement(file)
    raw = load_measurement(file, filtered=False) if filtered.filter else filtered
    errors = {}
    for name, value in spec.compared.items():
        key = ("compared", name)
        if name not in SIGNALS or any(name not in segment.signals for segment in filtered.segments):
            known = filtered.segments[0].signals
            document.report(key, f"is not measured{hint(name, known, lead='measured are')}", "signal-unknown")
            continue
        try:
            errors[name] = number_in(value, SIGNALS[name].unit)
            if not errors[name] > 0.0:
                raise ValueError(f"must be above 0 (got {value})")
        except ValueError as error:
            document.report(key, str(error), code_of(error))
    parts = {}
    if not document.errors:
        for part in PARTS:
            parts[part] = list(_windows(document, part, spec, filtered, raw, errors))
    _refuse_overlaps(document, spec)
    document.raise_errors()
    return LoadedFit(path, spec, filtered, errors, parts["training"], parts["held_out"])


def number_in(value: Value, unit: str | None, *, relative: bool = False) -> float:
    """Return a number in SI; text has a unit, whose offset does not apply if the number is `relative`.

    Raises:
        ValueError: it is not a number, or its unit does not fit.
    """
    if isinstance(value, str):
        return float(convert(value, unit, relative=relative))
    if isinstance(value, bool):
        raise ValueError(f"must be a number (got {value})")
    return float(value)


def _windows(
    document: Document,
    name: Part,
    spec: FitSpec,
    filtered: Measurement,
    raw: Measurement,
    compared: Mapping[str, float],
) -> Iterator[FitWindow]:
    for number, stretch in enumerate(getattr(spec, name)):
        try:
            segment, unfiltered = filtered.segment(stretch.segment), raw.segment(stretch.segment)
        except ValueError as error:
            document.report((name, number), str(error), "segment-unknown")
            continue
        try:
            for window in _cut(segment, stretch, float(spec.settling), compared):
                yield FitWindow(window, segment, unfiltered)
        except ValueError as error:
            document.report((name, number), str(error), code_of(error, "fit-window"))


def _cut(
    segment: Segment, stretch: StretchSpec, settling: float, compared: Mapping[str, float]
) -> Iterator[Window]:
    """Yield the windows of a stretch.

    Raises:
        ValueError: it is not within the segment, or a window cannot be compared.
    """
    begin, end = float(stretch.begin), float(stretch.end)
    first, last = float(segment.time[0]), float(segment.time[-1])
    if not first - 1e-6 <= begin < end <= last + 1e-6:
        raise ValueError(f"{span(begin, end)} s is not within {segment.name}, {span(first, last)} s")
    longest = float(stretch.window or end - begin)
    for k in range(max(1, math.ceil((end - begin) / longest - 1e-9))):
        start = begin + k * longest
        stop = min(start + longest, end)
        gaps = by_signals(segment.gaps, segment.signals)
        if lost := next((lost for lost in gaps if lost[1].overlaps(start, stop)), None):
            of = f" of {lost[0]}" if lost[0] else ""
            raise ValueError(
                f"{segment.name} has no samples{of} from {lost[1]}: leave that out, with two stretches"
            )
        part = segment.between(start, stop).even()
        if np.count_nonzero(part.time >= part.time[0] + settling - 1e-9) < 3:
            raise ValueError(f"a window has less than three samples after 'settling', {settling:g} s")
        label = f"{segment.name}, {span(part.time[0], part.time[-1])} s"
        measured = {signal: part.signals[signal] for signal in compared}
        if (angle := next((signal for signal in compared if signal in ANGLES), None)) and (
            standing(part.signals) is not None
        ):
            raise ValueError(
                f"{label}: there the car is slower than {3.6 * LEAST_SPEED:.0f} km/h, and {angle} means "
                "nothing; end the window before, or leave that signal out of 'compared'"
            )
        if large := [name for name, x in measured.items() if np.abs(x / compared[name]).max() > LARGEST]:
            raise ValueError(
                f"{large[0]} reaches more than {LARGEST:g} times the difference expected in 'compared'; "
                "check its unit and that"
            )
        yield Window(label, part.time, measured)


def _refuse_overlaps(document: Document, spec: FitSpec) -> None:
    for number, held in enumerate(spec.held_out):
        for stretch in spec.training:
            if stretch.segment == held.segment and stretch.begin < held.end and held.begin < stretch.end:
                words = f"{span(float(held.begin), float(held.end))} s shares seconds with 'training'"
                document.report(("held_out", number), words, "fit-window")

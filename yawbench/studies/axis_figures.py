"""Figures over axes: metrics as curves or maps, grids as lines or markers, limits as lines with a band.

`Drawing` has what they share: the runs of a panel, labels of axes and levels, line styles. Map colours
increase in lightness, and lines differ in colour, dash and marker, so both survive grey print and
colour blindness. A limit is drawn through the last values that hold; the band reaches to the first
that do not.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from yawbench.figures.display import shown, shown_unit
from yawbench.figures.style import QUIET, line_style, literal
from yawbench.foundation.errors import ResultsError
from yawbench.metrics.expressions import MetricValue, metric
from yawbench.metrics.measures import variable_of, words
from yawbench.orchestrator.signal_names import Target

from .axes import RUN, Level, names_of
from .claim_schema import si_number, text_of
from .derived import cells
from .experiment import Case
from .experiment_result import ExperimentResult
from .limits import limits_of
from .schema import FigureSpec

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


MARKERS = "os^Dv<>"
FAILED: dict[str, Any] = {
    "marker": "x",
    "markersize": 6,
    "linestyle": "",
    "color": "#111111",
    "label": "no number: failed, not made, or never",
}
"""Style of a run without a number: a cross, because a gap would be overlooked."""
GUIDE: dict[str, Any] = {"color": QUIET, "linewidth": 0.9, "linestyle": (0, (4, 2))}


class Drawing:
    """Base of figures over axes: `fill` draws a panel, `finish` sets what the panels share.

    Artists with a label appear in the legend.
    """

    what = ""
    """Title of the drawn quantity, without its unit."""
    upwards = ""
    """Label of the y axes."""
    across = ""
    """Label of the x axes of a drawing that has no axis there."""

    def __init__(self, findings: ExperimentResult, spec: FigureSpec) -> None:
        self.findings = findings
        self.spec = spec
        self.axes = findings.spec.axes
        self.names = list(self.axes)
        only = {axis: set(map(text_of, values)) for axis, values in spec.only.items()}
        self.runs = [
            run
            for run in findings.experiment.first_cases
            if all(self._is_of(run, axis, values) for axis, values in only.items())
        ]

    def fill(self, axes: Axes, runs: Sequence[Case]) -> None:
        """Draw the runs of a panel."""
        raise NotImplementedError

    def finish(self, figure: Figure, drawn: Sequence[Axes]) -> None:
        """Set the ranges that all panels share."""

    def panels(self) -> list[tuple[str, list[Case]]]:
        """Return the heading and the runs of each panel."""
        axis = self.spec.panel_axis
        if not axis:
            return [("", self.runs)]
        return [
            (self.name_of(axis, level), [run for run in self.runs if self.at(run, axis) == level])
            for level in self.levels(axis)
        ]

    def lines(self) -> Iterator[tuple[Level | None, dict[str, Any]]]:
        """Yield the levels that have a line each, with its look; None for a single line."""
        levels = self.levels(self.spec.lines) if self.spec.lines else []
        for number, level in enumerate(levels):
            yield level, {**style_of(number), "label": self.name_of(self.spec.lines, level)}
        if not levels:
            yield None, style_of(0)

    def _is_of(self, run: Case, axis: str, chosen: set[str]) -> bool:
        level = self.at(run, axis)
        names = names_of(self.axes[axis], level) if axis in self.axes else (text_of(level.value),)
        return not chosen.isdisjoint(names)

    def at(self, run: Case, axis: str) -> Level:
        """Return the level of a run on an axis; the axis "run" has the run names as levels."""
        if axis == RUN:
            return Level(run.run.name, run.run.label)
        return run.point[self.names.index(axis)]

    def levels(self, axis: str) -> list[Level]:
        """Return the levels of an axis that occur among the runs, in order."""
        return list(dict.fromkeys(self.at(run, axis) for run in self.runs))

    def coordinate(self, level: Level, axis: str) -> float:
        """Return the coordinate of a level: its number, or for names 0, 1, 2, ..."""
        if self.numeric(axis):
            return float(level.value)
        return float(self.levels(axis).index(level))

    def numeric(self, axis: str) -> bool:
        """Return whether an axis is numeric."""
        return axis != RUN and self.axes[axis].numeric

    def label(self, axis: str) -> str:
        """Return the label of an axis, with its unit."""
        if axis == RUN:
            return "Run"
        spec = self.axes[axis]
        text = spec.says or (_in_words(spec.vary[0]) if spec.vary else axis)
        unit = self.unit_of(axis)
        return f"{text.strip()} in {unit}" if unit else text.strip()

    def unit_of(self, axis: str) -> str:
        """Return the display unit of an axis."""
        assert self.findings.planned is not None  # experiments with axes are always planned
        return self.findings.planned.axis_unit(axis).strip(" []").replace(".", "·")

    def name_of(self, axis: str, level: Level) -> str:
        """Return the label of a level."""
        if not self.numeric(axis):
            return level.words
        return f"{self.axes[axis].says or axis} {level.words} {self.unit_of(axis)}".strip()

    def scale_x(self, axes: Axes) -> None:
        """Set the scale of x, or for an axis of names its ticks."""
        if self.numeric(self.spec.x):
            set_scale(axes, "x", self.axes[self.spec.x].spacing)
        else:
            name_ticks(axes, [level.words for level in self.levels(self.spec.x)])


def _in_words(target: Target) -> str:
    """Return an override target in words."""
    of_signal = target.kind in ("input", "faults")
    name = variable_of(target.variable) if of_signal else target.variable or str(target)
    return words(name.replace("*", ""))


def set_scale(axes: Axes, which: Literal["x", "y"], scale: str) -> None:
    """Set the scale of an axis; logarithmic axes get plain numbers instead of powers of ten."""
    if scale == "log":
        axes.set(**{f"{which}scale": "log"})
        getattr(axes, f"{which}axis").set_major_formatter("{x:g}")


BESIDE = 10
"""Most names beside each other. Chosen: so many of 14 characters are as wide as a page."""


def name_ticks(axes: Axes, names: Sequence[str]) -> None:
    """Make x an axis of names, with ticks at 0, 1, 2, ...; many names are written upwards."""
    upwards: dict[str, Any] = {"rotation": 90, "fontsize": 7} if len(names) > BESIDE else {}
    texts = [literal(name.replace("\n", " ") if upwards else name) for name in names]
    axes.set_xticks(range(len(names)), texts, **upwards)
    axes.set_xlim(-0.5, len(names) - 0.5)


def style_of(number: int) -> dict[str, Any]:
    """Return colour, dash and marker of a line."""
    return {**line_style(number), "marker": MARKERS[number % len(MARKERS)], "markersize": 4.5}


COLOURS = "cividis"
"""Safe for colour blindness (Nuñez, Anderton, Renslow, PLOS ONE 13 (2018) e0199239)."""


class ValueDrawing(Drawing):
    """Base of drawings of numbers: display unit, lines with confidence intervals, a marked value."""

    def show_in(self, unit: str) -> None:
        """Set the unit of the numbers, and with it the display unit and the marked value."""
        self.quantity = unit
        self.unit, self.factor = shown_unit(unit)
        self.measured = f"{self.what} in {self.unit}" if self.unit else self.what
        marked = self.spec.mark
        self.mark = None if marked is None else self.number(marked)
        self.mark_text = "" if marked is None else shown(si_number(marked, unit), unit)

    def number(self, value: float | str) -> float:
        """Convert a number of the experiment file to the display unit."""
        return self.factor * si_number(value, self.quantity)

    def shown(self, value: MetricValue | None) -> tuple[float, float]:
        """Return a number and its confidence half width in the display unit; NaN if missing."""
        if value is None or not math.isfinite(value.number):
            return math.nan, 0.0
        return self.factor * value.number, self.factor * value.half

    def draw_line(
        self, axes: Axes, line: Iterable[tuple[float, MetricValue | None]], style: dict[str, Any]
    ) -> None:
        """Draw a line through (x, value) with confidence intervals, and a cross where a number is missing."""
        points = sorted((x, *self.shown(value)) for x, value in line)
        axes.plot([x for x, *_ in points], [y for _, y, _ in points], **style)
        for x, y, half in points:
            if half:
                axes.vlines(x, y - half, y + half, color=style["color"], linewidth=1.2)
            if math.isnan(y):
                axes.plot([x], [0.0], transform=axes.get_xaxis_transform(), clip_on=False, **FAILED)

    def show_metric(self) -> None:
        """Show the figure's metric: its title and its unit."""
        chosen = self.findings.spec.metrics[self.spec.metric]
        self.what = chosen.heading or metric(chosen.metric).title
        self.show_in(self.findings.unit(self.spec.metric))

    def draw_mark(self, axes: Axes) -> None:
        """Draw the marked value, if there is one."""
        if self.mark is not None:
            axes.axhline(self.mark, label=self.mark_text, **GUIDE)


class MetricDrawing(ValueDrawing):
    """Base of curves and maps: the metric and its range."""

    def __init__(self, findings: ExperimentResult, spec: FigureSpec) -> None:
        super().__init__(findings, spec)
        self.show_metric()
        self.upwards = self.label(spec.y) if spec.y else self.measured
        numbers = [self.shown(self.value(run))[0] for run in self.runs]
        drawn = [x for x in numbers if not math.isnan(x) and (x > 0 or spec.scale != "log")]
        if not drawn:
            raise ResultsError(
                "nothing to draw: no run gives this metric a number that can be drawn.",
                code="nothing-to-draw",
            )
        self.low, self.high = min(drawn), max(drawn)
        if spec.largest is not None:
            self.high = self.number(spec.largest)
            self.low = min(self.low, self.high)

    def value(self, run: Case) -> MetricValue | None:
        """Return the metric of a run."""
        return self.findings.mean(run, self.spec.metric)


class CurveDrawing(MetricDrawing):
    """A metric over an axis: a line, or for a sample points, for each level of `lines`."""

    def fill(self, axes: Axes, runs: Sequence[Case]) -> None:
        for level, style in self.lines():
            mine = [run for run in runs if level is None or self.at(run, self.spec.lines) == level]
            if self.findings.spec.sampled:
                style["linestyle"] = ""
            self.draw_line(
                axes,
                ((self.coordinate(self.at(run, self.spec.x), self.spec.x), self.value(run)) for run in mine),
                style,
            )
        self.draw_mark(axes)
        self.scale_x(axes)

    def finish(self, figure: Figure, drawn: Sequence[Axes]) -> None:
        set_scale(drawn[0], "y", self.spec.scale)
        if self.spec.largest is not None:
            drawn[0].set_ylim(self.low if self.spec.scale == "log" else min(self.low, 0.0), self.high)
        elif self.spec.scale == "linear" and self.low >= 0:
            drawn[0].set_ylim(bottom=0.0)


class GridDrawing(ValueDrawing):
    """The columns of a grid over its rows: as lines where these are steps in order, or else as markers."""

    def __init__(self, findings: ExperimentResult, spec: FigureSpec) -> None:
        super().__init__(findings, spec)
        grid = findings.spec.grids[spec.grid]
        values = findings.values_of_grids
        self.cells = [(cell, values.get(cell.key)) for cell in cells(grid) if cell.column]
        units = {value.shown_in for _, value in self.cells if value}
        if not units:
            raise ResultsError("nothing to draw: no cell of the grid has a number.", code="nothing-to-draw")
        self.what = grid.title
        self.show_in(min(units))
        self.upwards = self.measured

    def fill(self, axes: Axes, runs: Sequence[Case]) -> None:
        rows = list(dict.fromkeys(cell.row for cell, _ in self.cells))
        columns = list(dict.fromkeys(cell.column for cell, _ in self.cells))
        joined = {} if self.findings.spec.grids[self.spec.grid].holds else {"linestyle": "none"}
        for number, column in enumerate(columns):
            shift = 0.03 * (number - (len(columns) - 1) / 2)  # keep overlapping points visible
            mine = ((rows.index(c.row) + shift, value) for c, value in self.cells if c.column == column)
            self.draw_line(axes, mine, {**style_of(number), **joined, "label": column})
        self.draw_mark(axes)
        name_ticks(axes, ["\n".join(textwrap.wrap(row, 14)) for row in rows])

    def finish(self, figure: Figure, drawn: Sequence[Axes]) -> None:
        set_scale(drawn[0], "y", self.spec.scale)


class MapDrawing(MetricDrawing):
    """A metric over two axes: coloured cells for a grid, coloured points for other designs."""

    def fill(self, axes: Axes, runs: Sequence[Case]) -> None:
        x = [float(self.at(run, self.spec.x).value) for run in runs]
        y = [float(self.at(run, self.spec.y).value) for run in runs]
        values = [self.shown(self.value(run))[0] for run in runs]
        if self.findings.spec.design == "grid":
            self._cells(axes, x, y, values)
        else:
            axes.scatter(x, y, c=values, s=60, edgecolors="#444444", linewidths=0.4, **self._scale())
        self.scale_x(axes)
        set_scale(axes, "y", self.axes[self.spec.y].spacing)
        for a, b, value in zip(x, y, values, strict=True):
            if math.isnan(value):
                axes.plot([a], [b], **FAILED)
        axes.grid(False)

    def _cells(self, axes: Axes, x: list[float], y: list[float], values: list[float]) -> None:
        columns, rows = sorted(set(x)), sorted(set(y))
        table = np.full((len(rows), len(columns)), math.nan)
        for a, b, value in zip(x, y, values, strict=True):
            table[rows.index(b), columns.index(a)] = value
        right = edges(columns, log=self.axes[self.spec.x].spacing == "log")
        up = edges(rows, log=self.axes[self.spec.y].spacing == "log")
        axes.pcolormesh(right, up, table, edgecolors="face", linewidth=0.1, **self._scale())
        if self.mark is not None:
            ends = boundary(table > self.mark, right, up)
            says = f"beyond this line more than {self.mark_text}"
            for colour, width, label in (("white", 3.4, ""), ("#111111", 1.6, says)):
                for line in ends:
                    axes.plot(*line, color=colour, linewidth=width, solid_capstyle="round", label=label)

    def _scale(self) -> dict[str, Any]:
        from matplotlib.colors import LogNorm, Normalize

        kind = LogNorm if self.spec.scale == "log" else Normalize
        low = self.low if self.spec.scale == "log" else min(self.low, max(0.0, self.low))
        return {"cmap": COLOURS, "norm": kind(low, self.high if self.high > low else low + 1.0)}

    def finish(self, figure: Figure, drawn: Sequence[Axes]) -> None:
        beyond = "max" if self.spec.largest is not None else "neither"
        bar = figure.colorbar(drawn[0].collections[0], ax=list(drawn), pad=0.02, fraction=0.05, extend=beyond)
        bar.set_label(literal(self.measured))


def edges(values: Sequence[float], *, log: bool) -> np.ndarray:
    """Return the edges of cells around sorted values: halfway between neighbours."""
    centres = np.log(values) if log else np.array(values, dtype=float)
    if len(centres) == 1:
        borders = np.array([centres[0] - 0.5, centres[0] + 0.5])
    else:
        middle = (centres[1:] + centres[:-1]) / 2
        borders = np.concatenate([[2 * centres[0] - middle[0]], middle, [2 * centres[-1] - middle[-1]]])
    return np.exp(borders) if log else borders


def boundary(
    beyond: np.ndarray, right: np.ndarray, up: np.ndarray
) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Return the edges ((x0, x1), (y0, y1)) between cells where `beyond` is true and others."""
    upright = [((right[j + 1],) * 2, (up[i], up[i + 1])) for i, j in np.argwhere(np.diff(beyond, axis=1))]
    level = [((right[j], right[j + 1]), (up[i + 1],) * 2) for i, j in np.argwhere(np.diff(beyond, axis=0))]
    return upright + level


HATCHES = ("", "///", "...", "\\\\\\", "xxx")
"""Hatches of the bands, which tell them apart in grey print."""
END: dict[str, Any] = {"mfc": "white", "markersize": 8, "linestyle": ""}
"""Marker where all tried values hold, or none does."""


class LimitDrawing(Drawing):
    """A limit over an axis, with a band up to the first value that fails."""

    def __init__(self, findings: ExperimentResult, spec: FigureSpec) -> None:
        super().__init__(findings, spec)
        limit = findings.spec.limits[spec.limit]
        self.what, self.upwards = limit.says, self.label(limit.of)
        self._found = limits_of(findings, limit)
        tried = [float(level.value) for level in self.levels(limit.of)]
        self._smallest, self._largest = min(tried), max(tried)

    def fill(self, axes: Axes, runs: Sequence[Case]) -> None:
        settings = [{axis: self.at(run, axis) for axis in self._found[0].others} for run in runs]
        limits = [limit for limit in self._found if limit.others in settings]
        ends = []
        for (level, style), hatch in zip(self.lines(), cycle(HATCHES), strict=False):
            mine = [limit for limit in limits if level is None or limit.others[self.spec.lines] == level]
            at_coordinate = {self.coordinate(limit.others[self.spec.x], self.spec.x): limit for limit in mine}
            x = sorted(at_coordinate)
            low = [self._smallest if (last := at_coordinate[at].largest) is None else last for at in x]
            high = [self._largest if (first := at_coordinate[at].beyond) is None else first for at in x]
            axes.fill_between(x, low, high, color=style["color"], alpha=0.16, linewidth=0.0, hatch=hatch)
            axes.plot(x, low, **style)
            for at, end in zip(x, low, strict=True):
                if at_coordinate[at].beyond is None:
                    ends.append((at, end, "^", style["color"], "all values tried hold"))
                if at_coordinate[at].largest is None:
                    ends.append((at, end, "v", style["color"], "none holds"))
        axes.fill_between(
            [], [], color=QUIET, alpha=0.25, linewidth=0.0, label="up to the first value that fails"
        )
        for at, end, marker, colour, says in sorted(ends, key=lambda end: end[2]):
            axes.plot([at], [end], marker, color=colour, **END)
            axes.plot([], [], marker, color=QUIET, label=says, **END)
        self.scale_x(axes)

    def finish(self, figure: Figure, drawn: Sequence[Axes]) -> None:
        border = 0.06 * (self._largest - self._smallest) or 1.0
        drawn[0].set_ylim(self._smallest - border, self._largest + border)

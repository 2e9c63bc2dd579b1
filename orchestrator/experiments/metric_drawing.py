"""A metric as curves over an axis, or as a map over two.

The colours of maps get lighter all the way, lines differ in colour, dash and marker: both survive
grey print and every eye.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ResultsError
from ..figures.display import shown, shown_unit
from ..figures.style import literal
from ..metrics.run_metrics import Value, metric
from .drawing import FAILED, GUIDE, Drawing, name_ticks, set_scale, style_of
from .experiment import Case
from .findings import Findings
from .grids import cells
from .numbers import si_number
from .schema import FigureSpec

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = "cividis"
"""From dark to light for every eye (Nuñez, Anderton, Renslow, PLOS ONE 13 (2018) e0199239)."""


class ValueDrawing(Drawing):
    """What all drawings of numbers share: the unit in which they are shown, lines, a value to mark."""

    def show_in(self, unit: str) -> None:
        """Show numbers of a unit as people read them, that to mark, too."""
        self.quantity = unit
        self.unit, self.factor = shown_unit(unit)
        self.measured = f"{self.what} in {self.unit}" if self.unit else self.what
        marked = self.spec.mark
        self.mark = None if marked is None else self.number(marked)
        self.mark_text = "" if marked is None else shown(si_number(marked, unit), unit)

    def number(self, given: float | str) -> float:
        """Return a number of the file in the unit shown."""
        return self.factor * si_number(given, self.quantity)

    def shown(self, value: Value | None) -> tuple[float, float]:
        """Return a number and half the width of its confidence interval as shown; NaN: nothing to draw."""
        if value is None or not math.isfinite(value.number):
            return math.nan, 0.0
        return self.factor * value.number, self.factor * value.half

    def draw_line(
        self, axes: Axes, line: Iterable[tuple[float, Value | None]], style: dict[str, Any]
    ) -> None:
        """Draw a line through (x, value) with confidence, and a cross where there is no number."""
        points = sorted((x, *self.shown(value)) for x, value in line)
        axes.plot([x for x, *_ in points], [y for _, y, _ in points], **style)
        for x, y, half in points:
            if half:
                axes.vlines(x, y - half, y + half, color=style["color"], linewidth=1.2)
            if math.isnan(y):
                axes.plot([x], [0.0], transform=axes.get_xaxis_transform(), clip_on=False, **FAILED)

    def draw_mark(self, axes: Axes) -> None:
        """Draw the value to mark, if there is one."""
        if self.mark is not None:
            axes.axhline(self.mark, label=self.mark_text, **GUIDE)


class MetricDrawing(ValueDrawing):
    """What curves and maps share: the metric and its range."""

    def __init__(self, findings: Findings, spec: FigureSpec) -> None:
        super().__init__(findings, spec)
        chosen = findings.spec.metrics[spec.metric]
        self.what = chosen.heading or metric(chosen.metric).title
        self.show_in(findings.unit(spec.metric))
        self.upwards = self.label(spec.y) if spec.y else self.measured
        numbers = [self.shown(self.value(run))[0] for run in self.runs]
        drawn = [x for x in numbers if not math.isnan(x) and (x > 0 or spec.scale != "log")]
        if not drawn:
            raise ResultsError("nothing to draw: no run gives this metric a number that can be drawn.")
        self.low, self.high = min(drawn), max(drawn)
        if spec.largest is not None:
            self.high = self.number(spec.largest)
            self.low = min(self.low, self.high)

    def value(self, run: Case) -> Value | None:
        """Return the metric of a run."""
        return self.findings.mean(run, self.spec.metric)


class Curves(MetricDrawing):
    """A line, or for a Latin hypercube points, for each level of `lines`."""

    def fill(self, axes: Axes, runs: Sequence[Case]) -> None:
        for level, style in self.lines():
            mine = [run for run in runs if level is None or self.at(run, self.spec.lines) == level]
            if self.findings.spec.design == "latin_hypercube":
                style["linestyle"] = ""
            self.draw_line(
                axes,
                ((self.place(self.at(run, self.spec.x), self.spec.x), self.value(run)) for run in mine),
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


class GridLines(ValueDrawing):
    """The columns of a grid as lines over its rows."""

    def __init__(self, findings: Findings, spec: FigureSpec) -> None:
        super().__init__(findings, spec)
        grid = findings.spec.grids[spec.grid]
        values = findings.values_of_grids
        self.cells = [(cell, values.get(cell.key)) for cell in cells(grid) if cell.column]
        units = {value.unit for _, value in self.cells if value}
        if not units:
            raise ResultsError("nothing to draw: no cell of the grid has a number.")
        self.what = grid.title
        self.show_in(min(units))
        self.upwards = self.measured

    def fill(self, axes: Axes, runs: Sequence[Case]) -> None:
        rows = list(dict.fromkeys(cell.row for cell, _ in self.cells))
        columns = list(dict.fromkeys(cell.column for cell, _ in self.cells))
        for number, column in enumerate(columns):
            shift = 0.03 * (number - (len(columns) - 1) / 2)  # so that none hides another
            mine = ((rows.index(c.row) + shift, value) for c, value in self.cells if c.column == column)
            self.draw_line(axes, mine, {**style_of(number), "label": column})
        self.draw_mark(axes)
        name_ticks(axes, ["\n".join(textwrap.wrap(row, 14)) for row in rows])

    def finish(self, figure: Figure, drawn: Sequence[Axes]) -> None:
        set_scale(drawn[0], "y", self.spec.scale)


class Map(MetricDrawing):
    """A grid as coloured cells, other designs as coloured points."""

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
        found = np.array([centres[0] - 0.5, centres[0] + 0.5])
    else:
        middle = (centres[1:] + centres[:-1]) / 2
        found = np.concatenate([[2 * centres[0] - middle[0]], middle, [2 * centres[-1] - middle[-1]]])
    return np.exp(found) if log else found


def boundary(
    beyond: np.ndarray, right: np.ndarray, up: np.ndarray
) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Return the edges, ((x0, x1), (y0, y1)) each, between cells that are beyond and cells that are not."""
    upright = [((right[j + 1],) * 2, (up[i], up[i + 1])) for i, j in np.argwhere(np.diff(beyond, axis=1))]
    level = [((right[j], right[j + 1]), (up[i + 1],) * 2) for i, j in np.argwhere(np.diff(beyond, axis=0))]
    return upright + level

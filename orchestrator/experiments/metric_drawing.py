"""A metric as curves over an axis, or as a map over two.

The colours of maps get lighter all the way, lines differ in colour, dash and marker: both survive
grey print and every eye.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ResultsError
from ..figures.display import shown, shown_unit
from ..figures.style import line_style, literal
from ..metrics.run_metrics import metric
from .drawing import FAILED, GUIDE, PLAIN, Drawing
from .experiment import Case
from .findings import Findings
from .grids import cells
from .numbers import si_number
from .schema import FigureSpec

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKERS = "os^Dv<>"
COLOURS = "cividis"
"""From dark to light for every eye (Nuñez, Anderton, Renslow, PLOS ONE 13 (2018) e0199239)."""


class MetricDrawing(Drawing):
    """What curves and maps share: the metric, its scale, a value to mark."""

    def __init__(self, findings: Findings, spec: FigureSpec) -> None:
        super().__init__(findings, spec)
        chosen = findings.spec.metrics[spec.metric]
        self.what = chosen.heading or metric(chosen.metric).title
        self.unit, self.factor = shown_unit(findings.unit(spec.metric))
        numbers = [number for run in self.runs if math.isfinite(number := self.number(run))]
        if spec.scale == "log":
            numbers = [number for number in numbers if number > 0]
        if not numbers:
            raise ResultsError("nothing to draw: no run gives this metric a number that can be drawn.")
        self.low, self.high = min(numbers), max(numbers)
        if spec.largest is not None:
            self.high = self.factor * si_number(spec.largest, findings.unit(spec.metric))
            self.low = min(self.low, self.high)
        self.mark = None
        if spec.mark is not None:
            self.mark = self.factor * si_number(spec.mark, findings.unit(spec.metric))

    def number(self, run: Case) -> float:
        """Return the metric of a run in the unit shown, NaN if there is none that can be drawn."""
        value = self.findings.mean(run, self.spec.metric)
        if value is None or not math.isfinite(value.number):
            return math.nan
        return self.factor * value.number

    def half(self, run: Case) -> float:
        """Return half the width of the confidence interval of `number`, 0 without repeats."""
        value = self.findings.mean(run, self.spec.metric)
        return 0.0 if value is None else self.factor * value.half

    @property
    def measured(self) -> str:
        """The metric in words, with its unit."""
        return f"{self.what} in {self.unit}" if self.unit else self.what

    def mark_text(self) -> str:
        """Return the marked value as people read it."""
        assert self.spec.mark is not None
        unit = self.findings.unit(self.spec.metric)
        return shown(si_number(self.spec.mark, unit), unit)


class Curves(MetricDrawing):
    """A line, or for a Latin hypercube points, for each level of `lines`."""

    def fill(self, axes: Axes, runs: Sequence[Case]) -> None:
        for number, level in enumerate(self.levels(self.spec.lines) if self.spec.lines else [None]):
            mine = [run for run in runs if level is None or self.at(run, self.spec.lines) == level]
            points = sorted(
                (self.place(self.at(run, self.spec.x), self.spec.x), self.number(run), self.half(run))
                for run in mine
            )
            lost = [x for x, y, _ in points if math.isnan(y)]
            style = self._style(number)
            axes.plot([x for x, *_ in points], [y for _, y, _ in points], **style)
            draw_confidence(axes, points, style["color"])
            if lost:
                self.failed = True
                axes.plot(
                    lost, [0.0] * len(lost), transform=axes.get_xaxis_transform(), clip_on=False, **FAILED
                )
        if self.mark is not None:
            axes.axhline(self.mark, **GUIDE)
        self.scale_x(axes)

    def _style(self, number: int) -> dict[str, Any]:
        style = style_of(number)
        return {**style, "linestyle": ""} if self.findings.spec.design == "latin_hypercube" else style

    def finish(self, figure: Figure, drawn: Sequence[Axes], left: Sequence[Axes]) -> None:
        self.name_y(left, self.measured)
        drawn[0].set_yscale(self.spec.scale)
        if self.spec.scale == "log":
            drawn[0].yaxis.set_major_formatter(PLAIN)
        if self.spec.largest is not None:
            drawn[0].set_ylim(self.low if self.spec.scale == "log" else min(self.low, 0.0), self.high)
        elif self.spec.scale == "linear" and self.low >= 0:
            drawn[0].set_ylim(bottom=0.0)

    def handles(self) -> list[Artist]:
        from matplotlib.lines import Line2D

        levels = self.levels(self.spec.lines) if self.spec.lines else []
        found: list[Artist] = [
            Line2D([], [], label=self.name_of(self.spec.lines, level), **self._style(number))
            for number, level in enumerate(levels)
        ]
        if self.mark is not None:
            found.append(Line2D([], [], label=self.mark_text(), **GUIDE))
        return found + super().handles()


class GridLines(Drawing):
    """The columns of a grid as lines over its rows."""

    def __init__(self, findings: Findings, spec: FigureSpec) -> None:
        super().__init__(findings, spec)
        self.grid = findings.spec.grids[spec.grid]
        values = {**findings.values, **{("", key): value for key, value in findings.derived.items()}}
        self.cells = [(cell, values.get(cell.key)) for cell in cells(self.grid) if cell.column]
        units = {value.unit for _, value in self.cells if value}
        if not units:
            raise ResultsError("nothing to draw: no cell of the grid has a number.")
        self.quantity = min(units)
        self.unit, self.factor = shown_unit(self.quantity)
        self.what = self.grid.title
        self.rows = list(dict.fromkeys(cell.row for cell, _ in self.cells))
        self.columns = list(dict.fromkeys(cell.column for cell, _ in self.cells))

    def panels(self) -> list[tuple[str, list[Case]]]:
        return [("", [])]

    def fill(self, axes: Axes, runs: Sequence[Case]) -> None:
        for number, column in enumerate(self.columns):
            mine = [(self.rows.index(cell.row), value) for cell, value in self.cells if cell.column == column]
            style = style_of(number)
            shift = 0.03 * (number - (len(self.columns) - 1) / 2)  # so that none hides another
            known = [(x + shift, value) for x, value in mine if value and math.isfinite(value.number)]
            axes.plot([x for x, _ in known], [self.factor * v.number for _, v in known], **style)
            draw_confidence(
                axes, [(x, self.factor * v.number, self.factor * v.half) for x, v in known], style["color"]
            )
            lost = [x for x, value in mine if value is None]
            if lost:
                self.failed = True
                axes.plot(
                    lost, [0.0] * len(lost), transform=axes.get_xaxis_transform(), clip_on=False, **FAILED
                )
        if self.spec.mark is not None:
            axes.axhline(self.factor * si_number(self.spec.mark, self.quantity), **GUIDE)
        axes.set_xticks(range(len(self.rows)), ["\n".join(textwrap.wrap(literal(r), 14)) for r in self.rows])
        axes.set_xlim(-0.4, len(self.rows) - 0.6)

    def finish(self, figure: Figure, drawn: Sequence[Axes], left: Sequence[Axes]) -> None:
        self.name_y(left, f"{self.what} in {self.unit}" if self.unit else self.what)
        drawn[0].set_xlabel("")
        drawn[0].set_yscale(self.spec.scale)
        if self.spec.scale == "log":
            drawn[0].yaxis.set_major_formatter(PLAIN)

    def handles(self) -> list[Artist]:
        from matplotlib.lines import Line2D

        found: list[Artist] = [
            Line2D([], [], label=column, **style_of(number)) for number, column in enumerate(self.columns)
        ]
        if self.spec.mark is not None:
            label = shown(si_number(self.spec.mark, self.quantity), self.quantity)
            found.append(Line2D([], [], label=label, **GUIDE))
        return found + super().handles()


def style_of(number: int) -> dict[str, Any]:
    """Return colour, dash and marker of a line."""
    return {**line_style(number), "marker": MARKERS[number % len(MARKERS)], "markersize": 4.5}


def draw_confidence(axes: Axes, points: Iterable[tuple[float, float, float]], colour: str) -> None:
    """Draw the confidence intervals of points (x, mean, half the width), those that have one."""
    for x, y, half in points:
        if half:
            axes.vlines(x, y - half, y + half, color=colour, linewidth=1.2)


class Map(MetricDrawing):
    """A grid as coloured cells, other designs as coloured points."""

    def fill(self, axes: Axes, runs: Sequence[Case]) -> None:
        x = [float(self.at(run, self.spec.x).value) for run in runs]
        y = [float(self.at(run, self.spec.y).value) for run in runs]
        values = [self.number(run) for run in runs]
        if self.findings.spec.design == "grid":
            self._cells(axes, x, y, values)
        else:
            axes.scatter(x, y, c=values, s=60, edgecolors="#444444", linewidths=0.4, **self._scale())
        self.scale_x(axes)
        if self.axes[self.spec.y].spacing == "log":
            axes.set_yscale("log")
            axes.yaxis.set_major_formatter(PLAIN)
        lost = [(a, b) for a, b, value in zip(x, y, values, strict=True) if math.isnan(value)]
        if lost:
            self.failed = True
            axes.plot([a for a, _ in lost], [b for _, b in lost], **FAILED)
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
            for ends in boundary(table > self.mark, right, up):
                axes.plot(*ends, color="white", linewidth=3.4, solid_capstyle="round")
            for ends in boundary(table > self.mark, right, up):
                axes.plot(*ends, color="#111111", linewidth=1.6, solid_capstyle="round")

    def _scale(self) -> dict[str, Any]:
        from matplotlib.colors import LogNorm, Normalize

        kind = LogNorm if self.spec.scale == "log" else Normalize
        low = self.low if self.spec.scale == "log" else min(self.low, max(0.0, self.low))
        return {"cmap": COLOURS, "norm": kind(low, self.high if self.high > low else low + 1.0)}

    def finish(self, figure: Figure, drawn: Sequence[Axes], left: Sequence[Axes]) -> None:
        self.name_y(left, self.label(self.spec.y))
        beyond = "max" if self.spec.largest is not None else "neither"
        bar = figure.colorbar(drawn[0].collections[0], ax=list(drawn), pad=0.02, fraction=0.05, extend=beyond)
        bar.set_label(literal(self.measured))

    def handles(self) -> list[Artist]:
        from matplotlib.lines import Line2D

        label = f"beyond this line more than {self.mark_text()}" if self.mark is not None else ""
        found: list[Artist] = [Line2D([], [], color="#111111", linewidth=1.6, label=label)] if label else []
        return found + super().handles()


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
    rows, columns = beyond.shape
    found = []
    for i in range(rows):
        for j, (a, b) in enumerate(pairwise(beyond[i])):
            if a != b:
                found.append(((right[j + 1], right[j + 1]), (up[i], up[i + 1])))
    for j in range(columns):
        for i, (a, b) in enumerate(pairwise(beyond[:, j])):
            if a != b:
                found.append(((right[j], right[j + 1]), (up[i + 1], up[i + 1])))
    return found

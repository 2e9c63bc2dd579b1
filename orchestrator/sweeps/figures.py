"""Figures of a sweep: curves, maps, and how far an axis may go.

Lines differ in colour, dash and marker; the colours of maps get lighter all the way, so both survive
grey print and every eye. A run that failed is a cross, never a gap that could be mistaken for none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ResultsError
from ..figures.display import shown, shown_unit, variable_of, words
from ..figures.style import QUIET, RC, ROW, frame, line_style
from ..metrics.run_metrics import metric
from ..studies.study import heading
from .design import Level
from .limits import Limit, limits_of
from .planning import PlannedRun
from .schema import FigureSpec
from .table import Swept, axis_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

MARKERS = "os^Dv<>"
COLOURS = "cividis"
"""From dark to light for every eye (Nuñez, Anderton, Renslow, PLOS ONE 13 (2018) e0199239)."""
PANELS_IN_A_ROW = 3
FAILED: dict[str, Any] = {"marker": "x", "color": "#111111", "linestyle": "", "markersize": 6}


def draw(swept: Swept, spec: FigureSpec) -> Figure:
    """Return a figure of a sweep.

    Raises:
        ResultsError: there is nothing to draw.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    drawing = _Drawing(swept, spec)
    panels = drawing.panels()
    columns = min(len(panels), PANELS_IN_A_ROW)
    rows = math.ceil(len(panels) / columns)
    height = rows * (1.6 * ROW if columns == 1 else 1.3 * ROW)
    with matplotlib.rc_context(RC):
        figure = Figure(layout="constrained")
        FigureCanvasAgg(figure)
        all_axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        for axes in all_axes.flat[len(panels) :]:
            axes.set_visible(False)
        for axes, (level, runs) in zip(all_axes.flat, panels, strict=False):
            drawing.fill(axes, runs)
            axes.set_title("" if level is None else drawing.name_of(spec.panels, level))
        for axes in all_axes[-1]:
            axes.set_xlabel(drawing.label(spec.x))
        drawing.finish(figure, [axes for axes in all_axes.flat if axes.get_visible()], all_axes[:, 0])
        frame(figure, height, drawing.handles(), spec.title or drawing.what, _provenance(swept))
    return figure


class _Drawing:
    """One figure: its runs sorted into panels and lines, its scales."""

    def __init__(self, swept: Swept, spec: FigureSpec) -> None:
        self.swept = swept
        self.spec = spec
        self.sweep = swept.planned.sweep.spec
        self.axes = list(self.sweep.axes)
        self.levels: list[Level] = []  # of the lines
        self._failed = False
        self._open = False
        if spec.kind == "limit":
            self.limit = self.sweep.limits[spec.limit]
            self.found = limits_of(swept, self.limit)
            self.what = f"{self.limit.says}{axis_unit(swept.planned, self.limit.of)}"
            return
        chosen = self.sweep.metrics[spec.metric]
        self.unit, self.factor = shown_unit(swept.unit(spec.metric))
        of = f" [{self.unit}]" if self.unit else ""
        self.what = f"{metric(chosen.metric).title if not chosen.heading else heading(chosen)}{of}"
        numbers = [self.number(run) for run in swept.planned.runs]
        finite = [number for number in numbers if number is not None and math.isfinite(number)]
        if not finite:
            raise ResultsError("nothing to draw: no run gives this metric.")
        self.low, self.high = min(finite), max(finite)
        if spec.largest is not None:
            self.high = self.factor * swept.bound(spec.metric, spec.largest)
            self.low = min(self.low, self.high)
        if spec.scale == "log":
            positive = [number for number in finite if number > 0]
            if not positive:
                raise ResultsError("nothing to draw on a logarithmic scale: no value is above 0.")
            self.low = min(positive)
        self.mark = None if spec.mark is None else self.factor * swept.bound(spec.metric, spec.mark)

    def number(self, run: PlannedRun) -> float | None:
        """Return the metric of a run in the unit shown."""
        value = self.swept.value(run, self.spec.metric)
        return None if value is None else self.factor * value.number

    def at(self, run: PlannedRun, axis: str) -> Level:
        """Return where a run stands on an axis."""
        return run.point[self.axes.index(axis)]

    def place(self, level: Level, axis: str) -> float:
        """Return where a level stands on an axis that is drawn: names count 0, 1, 2."""
        if self.sweep.axes[axis].numeric:
            return float(level.value)
        return float(self._all(axis).index(level))

    def _all(self, axis: str) -> list[Level]:
        return list(dict.fromkeys(self.at(run, axis) for run in self.swept.planned.runs))

    def label(self, axis: str) -> str:
        """Return an axis in words, with its unit."""
        spec = self.sweep.axes[axis]
        said = spec.says or words(variable_of(spec.vary[0]).replace("*", ""))
        return f"{said.strip()}{axis_unit(self.swept.planned, axis)}".replace("[", "in ").replace("]", "")

    def name_of(self, axis: str, level: Level) -> str:
        """Return a level of an axis in words."""
        spec = self.sweep.axes[axis]
        if not spec.numeric:
            return level.words
        unit = axis_unit(self.swept.planned, axis).strip(" []")
        return f"{spec.says or axis} {level.words} {unit}".strip()

    def panels(self) -> list[tuple[Level | None, list[PlannedRun]]]:
        """Return the runs of each panel."""
        runs = self.swept.planned.runs
        if not self.spec.panels:
            return [(None, runs)]
        return [
            (level, [run for run in runs if self.at(run, self.spec.panels) == level])
            for level in self._all(self.spec.panels)
        ]

    def fill(self, axes: Axes, runs: Sequence[PlannedRun]) -> None:
        """Draw the runs of a panel."""
        if self.spec.kind == "map":
            self._map(axes, runs)
            return
        self.levels = self._all(self.spec.lines) if self.spec.lines else []
        for number, level in enumerate(self.levels or [None]):  # type: ignore[list-item]
            mine = [run for run in runs if level is None or self.at(run, self.spec.lines) == level]
            style = {**line_style(number), "marker": MARKERS[number % len(MARKERS)], "markersize": 4.5}
            if self.spec.kind == "limit":
                self._limit(axes, mine, style)
            else:
                self._curve(axes, mine, style)
        if not self.sweep.axes[self.spec.x].numeric:
            every = self._all(self.spec.x)
            axes.set_xticks(range(len(every)), [level.words for level in every])
        elif self.sweep.axes[self.spec.x].spacing == "log":
            axes.set_xscale("log")

    def _curve(self, axes: Axes, runs: Sequence[PlannedRun], style: dict[str, Any]) -> None:
        if self.sweep.design == "latin_hypercube":
            style["linestyle"] = ""
        found = sorted((self.place(self.at(run, self.spec.x), self.spec.x), self.number(run)) for run in runs
                       if self.number(run) is not None)  # fmt: skip
        y = [min(number, 1e300) if number is not None else math.nan for _, number in found]
        axes.plot([x for x, _ in found], y, **style)
        lost = [run for run in runs if self.number(run) is None]
        if lost:
            self._failed = True
            x = [self.place(self.at(run, self.spec.x), self.spec.x) for run in lost]
            axes.plot(x, [0.0] * len(x), transform=axes.get_xaxis_transform(), clip_on=False, **FAILED)

    def _limit(self, axes: Axes, runs: Sequence[PlannedRun], style: dict[str, Any]) -> None:
        """Draw a limit: up to here all is well, at the end of the whisker it is not any more."""
        points = {tuple(level for level in run.point) for run in runs}
        of = self.axes.index(self.limit.of)
        settings = {point[:of] + point[of + 1 :] for point in points}
        mine = [limit for limit in self.found if tuple(limit.others.values()) in settings]
        levels = sorted(float(level.value) for level in self._all(self.limit.of))
        x = np.array([self.place(limit.others[self.spec.x], self.spec.x) for limit in mine])
        order = np.argsort(x)
        up_to = [self._end(mine[i], levels) for i in order]
        axes.plot(x[order], up_to, **style)
        for i in order:
            self._whisker(axes, float(x[i]), mine[i], levels, style)

    def _end(self, limit: Limit, levels: list[float]) -> float:
        return levels[0] if limit.largest is None else limit.largest

    def _whisker(
        self, axes: Axes, x: float, limit: Limit, levels: list[float], style: dict[str, Any]
    ) -> None:
        color = style["color"]
        if limit.largest is None:
            axes.plot([x], [levels[0]], marker="v", color=color, mfc="white", markersize=8, linestyle="")
            self._open = True
        elif limit.beyond is None:
            axes.plot([x], [limit.largest], marker="^", color=color, mfc="white", markersize=8, linestyle="")
            self._open = True
        else:
            axes.plot([x, x], [limit.largest, limit.beyond], color=color, linewidth=0.9)
            axes.plot([x], [limit.beyond], marker="_", color=color, markersize=7, linestyle="")

    def _map(self, axes: Axes, runs: Sequence[PlannedRun]) -> None:
        """Draw a grid as coloured cells, other designs as coloured points."""
        x = [float(self.at(run, self.spec.x).value) for run in runs]
        y = [float(self.at(run, self.spec.y).value) for run in runs]
        values = [math.nan if (n := self.number(run)) is None else n for run in runs]
        lost = [(a, b) for a, b, value in zip(x, y, values, strict=True) if math.isnan(value)]
        if self.sweep.design == "grid":
            self._cells(axes, x, y, values)
        else:
            axes.scatter(x, y, c=values, s=60, edgecolors="#444444", linewidths=0.4, **self._scale())
        for axis, which in ((self.spec.x, "x"), (self.spec.y, "y")):
            if self.sweep.axes[axis].spacing == "log":
                axes.set(**{f"{which}scale": "log"})  # type: ignore[arg-type]
        if lost:
            self._failed = True
            axes.plot([a for a, _ in lost], [b for _, b in lost], **FAILED)
        axes.grid(False)

    def _cells(self, axes: Axes, x: list[float], y: list[float], values: list[float]) -> None:
        columns, rows = sorted(set(x)), sorted(set(y))
        table = np.full((len(rows), len(columns)), math.nan)
        for a, b, value in zip(x, y, values, strict=True):
            table[rows.index(b), columns.index(a)] = value
        logs = [self.sweep.axes[axis].spacing == "log" for axis in (self.spec.x, self.spec.y)]
        axes.pcolormesh(_edges(columns, logs[0]), _edges(rows, logs[1]), table, **self._scale())
        if self.mark is not None and np.nanmin(table) < self.mark < np.nanmax(table):
            with np.errstate(invalid="ignore"):
                bounded = np.where(np.isfinite(table), table, math.nan)
            axes.contour(columns, rows, bounded, levels=[self.mark], colors="white", linewidths=2.6)
            axes.contour(columns, rows, bounded, levels=[self.mark], colors="#111111", linewidths=1.3)

    def _scale(self) -> dict[str, Any]:
        from matplotlib.colors import LogNorm, Normalize

        kind = LogNorm if self.spec.scale == "log" else Normalize
        high = self.high if self.high > self.low else self.low + 1.0
        return {"cmap": COLOURS, "norm": kind(self.low, high)}

    def finish(self, figure: Figure, drawn: list[Axes], left: Sequence[Axes]) -> None:
        """Set what all panels share: the metric's axis, or the bar of colours."""
        if self.spec.kind == "map":
            for axes in left:
                axes.set_ylabel(self.label(self.spec.y))
            mappable = drawn[0].collections[0]
            beyond = "max" if self.spec.largest is not None else "neither"
            bar = figure.colorbar(mappable, ax=drawn, pad=0.02, fraction=0.05, extend=beyond)
            bar.set_label(self.what)
            if self.mark is not None:
                for colour, width in (("white", 2.6), ("#111111", 1.3)):
                    bar.ax.axhline(self.mark, color=colour, linewidth=width)
            return
        for axes in left:
            axes.set_ylabel(self.what.replace("[", "in ").replace("]", ""))
        if self.spec.kind == "limit":
            return
        for axes in drawn:
            axes.set_yscale(self.spec.scale)
            if self.mark is not None:
                axes.axhline(self.mark, color=QUIET, linewidth=0.9, linestyle=(0, (4, 2)))
        if self.spec.largest is not None:
            low = self.low if self.spec.scale == "log" else min(self.low, 0.0)
            drawn[0].set_ylim(low, self.high)

    def handles(self) -> list[Line2D]:
        """Return what the legend explains."""
        from matplotlib.lines import Line2D

        found = [
            Line2D([], [], label=self.name_of(self.spec.lines, level), marker=MARKERS[k % len(MARKERS)],
                   markersize=4.5, **line_style(k))
            for k, level in enumerate(self.levels)
        ]  # fmt: skip
        if self.spec.kind == "limit":
            found.append(Line2D([], [], color=QUIET, marker="_", label="the next value tried, which fails"))
            if self._open:
                open_: dict[str, Any] = {"color": QUIET, "mfc": "white", "markersize": 8, "linestyle": ""}
                found.append(Line2D([], [], marker="^", label="no end within the values tried", **open_))
        elif self.mark is not None:
            text = shown(
                self.swept.bound(self.spec.metric, self.spec.mark or 0), self.swept.unit(self.spec.metric)
            )
            style = (
                {"color": "#111111"}
                if self.spec.kind == "map"
                else {"color": QUIET, "linestyle": (0, (4, 2))}
            )
            found.append(Line2D([], [], label=text, linewidth=1.3, **style))  # type: ignore[arg-type]
        if self._failed:
            found.append(Line2D([], [], label="no number: the run failed", **FAILED))
        return found


def _edges(values: list[float], log: bool) -> np.ndarray:
    """Return the edges of cells around sorted values: halfway between neighbours."""
    centres = np.log(values) if log else np.array(values)
    if len(centres) == 1:
        half = 0.5
        edges = np.array([centres[0] - half, centres[0] + half])
    else:
        middle = (centres[1:] + centres[:-1]) / 2
        edges = np.concatenate([[2 * centres[0] - middle[0]], middle, [2 * centres[-1] - middle[-1]]])
    return np.exp(edges) if log else edges


def _provenance(swept: Swept) -> str:
    planned = swept.planned
    fmus = sorted({f"{fmu.name} {digest[:8]}" for digest, fmu in planned.fmus.items()})
    sources = [planned.sweep.spec.source] if planned.sweep.spec.source else []
    parts = [
        *sources,
        f"{len(planned.runs)} runs of {planned.sweep.spec.scenario}",
        f"FMUs: {', '.join(fmus)}",
    ]
    return " · ".join(parts)

"""What all figures over axes share: which runs a panel holds, what axes and levels are called, their look."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Literal

from ..figures.style import QUIET, line_style, literal
from ..metrics.symbols import variable_of, words
from .design import RUN, Level
from .experiment import Case
from .findings import Findings
from .numbers import text_of
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
"""A run that gives no number: a cross, never a gap that could pass for nothing."""
GUIDE: dict[str, Any] = {"color": QUIET, "linewidth": 0.9, "linestyle": (0, (4, 2))}


class Drawing:
    """A figure over axes: `fill` draws a panel, `finish` what panels share; what has a label is explained."""

    what = ""
    """What is drawn, without its unit."""
    upwards = ""
    """What stands beside the panels on the left."""

    def __init__(self, findings: Findings, spec: FigureSpec) -> None:
        self.findings = findings
        self.spec = spec
        self.axes = findings.spec.axes
        self.names = list(self.axes)
        only = {axis: set(map(text_of, values)) for axis, values in spec.only.items()}
        self.runs = [
            run
            for run in findings.experiment.first_cases
            if all(text_of(self.at(run, axis).value) in values for axis, values in only.items())
        ]

    def fill(self, axes: Axes, runs: Sequence[Case]) -> None:
        """Draw the runs of a panel."""
        raise NotImplementedError

    def finish(self, figure: Figure, drawn: Sequence[Axes]) -> None:
        """Set what all panels share."""

    def panels(self) -> list[tuple[str, list[Case]]]:
        """Return the heading and the runs of each panel."""
        runs = self.findings.experiment.first_cases
        if not self.spec.panel_axis:
            return [("", runs)]
        return [
            (
                self.name_of(self.spec.panel_axis, level),
                [r for r in runs if self.at(r, self.spec.panel_axis) == level],
            )
            for level in self.levels(self.spec.panel_axis)
        ]

    def lines(self) -> Iterator[tuple[Level | None, dict[str, Any]]]:
        """Yield the levels that have a line each, with its look; None for a single line."""
        levels = self.levels(self.spec.lines) if self.spec.lines else []
        for number, level in enumerate(levels):
            yield level, {**style_of(number), "label": self.name_of(self.spec.lines, level)}
        if not levels:
            yield None, style_of(0)

    def at(self, run: Case, axis: str) -> Level:
        """Return where a run stands on an axis; "run" is that of its names."""
        if axis == RUN:
            return Level(run.run.name, run.run.label)
        return run.point[self.names.index(axis)]

    def levels(self, axis: str) -> list[Level]:
        """Return the levels of an axis that runs have, in their order."""
        return list(dict.fromkeys(self.at(run, axis) for run in self.runs))

    def place(self, level: Level, axis: str) -> float:
        """Return where a level is drawn: numbers as they are, names at 0, 1, 2."""
        if self.numeric(axis):
            return float(level.value)
        return float(self.levels(axis).index(level))

    def numeric(self, axis: str) -> bool:
        """Return whether an axis is one of numbers."""
        return axis != RUN and self.axes[axis].numeric

    def label(self, axis: str) -> str:
        """Return an axis in words, with its unit."""
        if axis == RUN:
            return "Run"
        spec = self.axes[axis]
        said = spec.says or (words(variable_of(spec.vary[0]).replace("*", "")) if spec.vary else axis)
        unit = self.unit_of(axis)
        return f"{said.strip()} in {unit}" if unit else said.strip()

    def unit_of(self, axis: str) -> str:
        """Return the unit that an axis counts in, as people write it."""
        assert self.findings.planned is not None  # as of every experiment along axes
        return self.findings.planned.axis_unit(axis).strip(" []").replace(".", "·")

    def name_of(self, axis: str, level: Level) -> str:
        """Return a level of an axis in words."""
        if not self.numeric(axis):
            return level.words
        return f"{self.axes[axis].says or axis} {level.words} {self.unit_of(axis)}".strip()

    def scale_x(self, axes: Axes) -> None:
        """Set the scale and, for an axis of names, the ticks of x."""
        if self.numeric(self.spec.x):
            set_scale(axes, "x", self.axes[self.spec.x].spacing)
        else:
            name_ticks(axes, [level.words for level in self.levels(self.spec.x)])


def set_scale(axes: Axes, which: Literal["x", "y"], scale: str) -> None:
    """Set the scale of an axis; a logarithmic one has plain numbers, too."""
    if scale == "log":
        axes.set(**{f"{which}scale": "log"})  # type: ignore[arg-type]
        getattr(axes, f"{which}axis").set_major_formatter("{x:g}")


def name_ticks(axes: Axes, names: Sequence[str]) -> None:
    """Make x an axis of names, at 0, 1, 2."""
    axes.set_xticks(range(len(names)), [literal(name) for name in names])
    axes.set_xlim(-0.5, len(names) - 0.5)


def style_of(number: int) -> dict[str, Any]:
    """Return colour, dash and marker of a line."""
    return {**line_style(number), "marker": MARKERS[number % len(MARKERS)], "markersize": 4.5}

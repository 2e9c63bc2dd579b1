"""What all figures over axes share: which runs a panel holds, what axes and levels are called."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..figures.style import QUIET, literal
from ..metrics.symbols import variable_of, words
from .design import Level
from .experiment import RUN, Case
from .findings import Findings
from .numbers import text_of
from .schema import FigureSpec

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FAILED: dict[str, Any] = {"marker": "x", "color": "#111111", "linestyle": "", "markersize": 6}
"""A run that gives no number: a cross, never a gap that could pass for nothing."""
PLAIN = "{x:g}"
"""How numbers stand at an axis, logarithmic ones too."""
GUIDE: dict[str, Any] = {"color": QUIET, "linewidth": 0.9, "linestyle": (0, (4, 2))}


class Drawing:
    """A figure over axes: `fill` draws a panel, `finish` what panels share, `handles` explain."""

    def __init__(self, findings: Findings, spec: FigureSpec) -> None:
        self.findings = findings
        self.spec = spec
        assert findings.planned is not None
        self.planned = findings.planned
        self.axes = findings.spec.axes
        self.names = list(self.axes)
        only = {axis: set(map(text_of, values)) for axis, values in spec.only.items()}
        self.runs = [
            run
            for run in findings.experiment.first_cases
            if all(text_of(self.at(run, axis).value) in values for axis, values in only.items())
        ]
        self.what = ""  # what is drawn, without its unit
        self.failed = False  # whether a cross has been drawn

    def fill(self, axes: Axes, runs: Sequence[Case]) -> None:
        """Draw the runs of a panel."""
        raise NotImplementedError

    def finish(self, figure: Figure, drawn: Sequence[Axes], left: Sequence[Axes]) -> None:
        """Set what all panels share; `left` are those with a scale of their own."""
        raise NotImplementedError

    def handles(self) -> list[Artist]:
        """Return what the legend explains."""
        from matplotlib.lines import Line2D

        return [Line2D([], [], label="no number: failed, or never", **FAILED)] if self.failed else []

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
        return self.planned.axis_unit(axis).strip(" []").replace(".", "·")

    def name_of(self, axis: str, level: Level) -> str:
        """Return a level of an axis in words."""
        if not self.numeric(axis):
            return level.words
        return f"{self.axes[axis].says or axis} {level.words} {self.unit_of(axis)}".strip()

    def name_y(self, left: Sequence[Axes], text: str) -> None:
        """Write what stands upwards beside the panels on the left, broken to their height."""
        for axes in left:
            axes.set_ylabel(literal("\n".join(textwrap.wrap(text, 34))))

    def scale_x(self, axes: Axes) -> None:
        """Set the scale and, for an axis of names, the ticks of x."""
        if not self.numeric(self.spec.x):
            every = self.levels(self.spec.x)
            axes.set_xticks(range(len(every)), [literal(level.words) for level in every])
            axes.set_xlim(-0.5, len(every) - 0.5)
        elif self.axes[self.spec.x].spacing == "log":
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter(PLAIN)

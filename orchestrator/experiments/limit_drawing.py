"""How far an axis may go, over another: a line through the last values that hold, and a band up to the
first that do not."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any

from ..figures.style import QUIET
from .drawing import Drawing
from .experiment import Case
from .findings import Findings
from .limits import limits_of
from .schema import FigureSpec

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HATCHES = ("", "///", "...", "\\\\\\", "xxx")
"""Of the bands, so that they differ in grey print."""
END: dict[str, Any] = {"mfc": "white", "markersize": 8, "linestyle": ""}
"""The mark of a line where all values tried hold, or none."""


class Limits(Drawing):
    """A limit over an axis."""

    def __init__(self, findings: Findings, spec: FigureSpec) -> None:
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
            mine = [one for one in limits if level is None or one.others[self.spec.lines] == level]
            placed = {self.place(one.others[self.spec.x], self.spec.x): one for one in mine}
            x = sorted(placed)
            low = [self._smallest if (last := placed[at].largest) is None else last for at in x]
            high = [self._largest if (first := placed[at].beyond) is None else first for at in x]
            axes.fill_between(x, low, high, color=style["color"], alpha=0.16, linewidth=0.0, hatch=hatch)
            axes.plot(x, low, **style)
            for at, end in zip(x, low, strict=True):
                if placed[at].beyond is None:
                    ends.append((at, end, "^", style["color"], "all values tried hold"))
                if placed[at].largest is None:
                    ends.append((at, end, "v", style["color"], "none holds"))
        axes.fill_between(
            [], [], color=QUIET, alpha=0.25, linewidth=0.0, label="up to the first value that fails"
        )
        for at, end, marker, colour, says in sorted(ends, key=lambda end: end[2]):
            axes.plot([at], [end], marker, color=colour, **END)
            axes.plot([], [], marker, color=QUIET, label=says, **END)
        self.scale_x(axes)

    def finish(self, figure: Figure, drawn: Sequence[Axes]) -> None:
        margin = 0.06 * (self._largest - self._smallest) or 1.0
        drawn[0].set_ylim(self._smallest - margin, self._largest + margin)

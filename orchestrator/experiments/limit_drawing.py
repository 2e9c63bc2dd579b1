"""How far an axis may go, over another: a line through the last values that hold, and a band up to the
first that do not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..figures.style import QUIET, line_style
from .drawing import Drawing
from .experiment import Case
from .findings import Findings
from .limits import Limit, limits_of
from .metric_drawing import MARKERS
from .schema import FigureSpec

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HATCHES = ("", "///", "...", "\\\\\\", "xxx")
"""Of the bands, so that they differ in grey print."""
NONE_HOLDS: dict[str, Any] = {"marker": "v", "mfc": "white", "markersize": 8, "linestyle": ""}
ALL_HOLD: dict[str, Any] = {"marker": "^", "mfc": "white", "markersize": 8, "linestyle": ""}


class Limits(Drawing):
    """A limit over an axis."""

    def __init__(self, findings: Findings, spec: FigureSpec) -> None:
        super().__init__(findings, spec)
        self.limit = findings.spec.limits[spec.limit]
        self.what = self.limit.says
        self._found = limits_of(findings, self.limit)
        self._others = list(self._found[0].others)
        tried = [float(level.value) for level in self.levels(self.limit.of)]
        self._smallest, self._largest = min(tried), max(tried)
        self._none = self._all = False  # whether such marks have been drawn

    def fill(self, axes: Axes, runs: Sequence[Case]) -> None:
        settings = [{axis: self.at(run, axis) for axis in self._others} for run in runs]
        mine = [limit for limit in self._found if limit.others in settings]
        for number, level in enumerate(self.levels(self.spec.lines) if self.spec.lines else [None]):
            self._line(
                axes, [one for one in mine if level is None or one.others[self.spec.lines] == level], number
            )
        self.scale_x(axes)

    def _line(self, axes: Axes, limits: Sequence[Limit], number: int) -> None:
        placed = sorted(
            ((self.place(one.others[self.spec.x], self.spec.x), one) for one in limits), key=lambda p: p[0]
        )
        x = np.array([place for place, _ in placed])
        low = np.array([self._smallest if one.largest is None else one.largest for _, one in placed])
        high = np.array([self._largest if one.beyond is None else one.beyond for _, one in placed])
        style = self._style(number)
        band = {
            "color": style["color"],
            "alpha": 0.16,
            "linewidth": 0.0,
            "hatch": HATCHES[number % len(HATCHES)],
        }
        axes.fill_between(x, low, high, **band)
        axes.plot(x, low, **style)
        none, every = (np.array([end is None for end in ends]) for ends in (
            [one.largest for _, one in placed], [one.beyond for _, one in placed],
        ))  # fmt: skip
        self._none, self._all = self._none or bool(none.any()), self._all or bool(every.any())
        for mark, chosen in ((NONE_HOLDS, none), (ALL_HOLD, every)):
            axes.plot(x[chosen], low[chosen], color=style["color"], **mark)

    def _style(self, number: int) -> dict[str, Any]:
        return {**line_style(number), "marker": MARKERS[number % len(MARKERS)], "markersize": 4.5}

    def finish(self, figure: Figure, drawn: Sequence[Axes], left: Sequence[Axes]) -> None:
        self.name_y(left, self.label(self.limit.of))
        margin = 0.06 * (self._largest - self._smallest) or 1.0
        drawn[0].set_ylim(self._smallest - margin, self._largest + margin)

    def handles(self) -> list[Artist]:
        from matplotlib.lines import Line2D
        from matplotlib.patches import Patch

        levels = self.levels(self.spec.lines) if self.spec.lines else []
        found: list[Artist] = [
            Line2D([], [], label=self.name_of(self.spec.lines, level), **self._style(number))
            for number, level in enumerate(levels)
        ]
        found.append(Patch(color=QUIET, alpha=0.25, linewidth=0.0, label="up to the first value that fails"))
        if self._all:
            found.append(Line2D([], [], color=QUIET, label="all values tried hold", **ALL_HOLD))
        if self._none:
            found.append(Line2D([], [], color=QUIET, label="none holds", **NONE_HOLDS))
        return found

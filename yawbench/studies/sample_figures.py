"""Figures of samples: distribution functions with their bands, and what a metric depends on."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from yawbench.figures.style import literal
from yawbench.foundation.errors import ResultsError

from .axes import Level
from .axis_figures import GUIDE, ValueDrawing
from .experiment import Case
from .experiment_result import ExperimentResult
from .schema import FigureSpec
from .uncertainty import Estimate, Group, band, groups_of, independent, numbers_of, sensitivities, subtracted

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

APART = 0.8
"""Share of the room of an axis that its lines take; chosen: the rest tells axes apart."""


class SampleDrawing(ValueDrawing):
    """Base of drawings of groups of a sample."""

    def __init__(self, findings: ExperimentResult, spec: FigureSpec) -> None:
        super().__init__(findings, spec)
        self.show_metric()
        self.groups = groups_of(findings)

    def grouped(self, runs: Sequence[Case]) -> Iterator[tuple[Group, Level | None, dict[str, Any]]]:
        """Yield the groups of a panel's runs, each with the level of `lines` that it is, and its look."""
        numbers = {run.number for run in runs}
        mine = [group for group in self.groups if group.cases[0].number in numbers]
        for level, style in self.lines():
            for group in mine:
                if level is None or self.at(group.cases[0], self.spec.lines) == level:
                    yield group, level, style


class DistributionDrawing(SampleDrawing):
    """The share of points up to a value, for each level of `lines`; the band holds the whole function.

    With `against`, of the differences from one level at the same points.
    """

    def __init__(self, findings: ExperimentResult, spec: FigureSpec) -> None:
        super().__init__(findings, spec)
        self.upwards = "Share of all points"
        self.across = f"{self.measured}, less that of {spec.against}" if spec.against else self.measured
        self._drawn = 0

    def _baseline(self, of: Group) -> Group:
        """Return the group that a group's differences are from, which may be that itself."""
        others = {pair for pair in of.levels if pair[0] != self.spec.lines}
        alike = (group for group in self.groups if group.run is of.run and others <= {*group.levels})
        return next(g for g in alike if self._is_of(g.cases[0], self.spec.lines, {self.spec.against}))

    def fill(self, axes: Axes, runs: Sequence[Case]) -> None:
        for group, _, style in self.grouped(runs):
            if self.spec.against:
                if (other := self._baseline(group)) is group:
                    continue
                numbers = subtracted(self.findings, group, other, self.spec.metric)
            else:
                every = independent(self.findings, numbers_of(self.findings, group, self.spec.metric))
                numbers = every[np.isfinite(every)]
            if not len(numbers):
                continue
            self._drawn += 1
            x = self.factor * np.sort(numbers)
            share, half = np.arange(1, len(x) + 1) / len(x), band(len(x))
            look = {key: style[key] for key in ("color", "linestyle", "linewidth", "dashes") if key in style}
            axes.step(x, share, where="post", label=style.get("label"), **look)
            low, high = np.clip(share - half, 0.0, 1.0), np.clip(share + half, 0.0, 1.0)
            axes.fill_between(x, low, high, step="post", color=style["color"], alpha=0.14, linewidth=0.0)
        if self.mark is not None:
            axes.axvline(self.mark, label=self.mark_text, **GUIDE)
        if self.spec.against:
            axes.axvline(0.0, **GUIDE)

    def finish(self, figure: Figure, drawn: Sequence[Axes]) -> None:
        if not self._drawn:
            raise ResultsError("nothing to draw: no run gives this metric a number.", code="nothing-to-draw")
        drawn[0].set_ylim(0.0, 1.0)
        if self.spec.scale == "log":
            drawn[0].set_xscale("log")
        if self.spec.largest is not None:
            drawn[0].set_xlim(right=self.number(self.spec.largest))


class SensitivityDrawing(SampleDrawing):
    """What a metric depends on: of each drawn axis the Sobol indices, or else the rank correlation."""

    def __init__(self, findings: ExperimentResult, spec: FigureSpec) -> None:
        super().__init__(findings, spec)
        self.whole = findings.spec.design == "saltelli"
        self.across = "Sobol index: alone (filled), with others (open)" if self.whole else "Rank correlation"
        self._drawn = 0

    def fill(self, axes: Axes, runs: Sequence[Case]) -> None:
        drawn, lines = self.findings.spec.drawn, [*self.lines()]
        places = {level: k for k, (level, _) in enumerate(lines)}
        for group, level, style in self.grouped(runs):
            shift = APART * ((places[level] + 0.5) / len(lines) - 0.5)
            found = sensitivities(self.findings, group, self.spec.metric)
            for row, name in enumerate(drawn):
                rank, indices = found[name]
                estimates = (*(indices or (None, None)),) if self.whole else (rank,)
                for number, estimate in enumerate(estimates):
                    if estimate is not None:
                        self._point(axes, estimate, row + shift + 0.06 * number, style, filled=number == 0)
            axes.plot([], [], label=style.get("label"), color=style["color"], marker=style["marker"], ls="")
        axes.axvline(0.0, **GUIDE)
        axes.set_yticks(range(len(drawn)), [literal(self.axes[name].says or name) for name in drawn])
        axes.set_ylim(len(drawn) - 0.5, -0.5)

    def _point(
        self, axes: Axes, estimate: Estimate, at: float, style: dict[str, Any], *, filled: bool
    ) -> None:
        number, low, high = estimate
        if low is None or high is None or not math.isfinite(number):
            return
        self._drawn += 1
        axes.hlines(at, low, high, color=style["color"], linewidth=1.2)
        face = style["color"] if filled else "white"
        axes.plot([number], [at], style["marker"], color=style["color"], markersize=4.5, mfc=face)

    def finish(self, figure: Figure, drawn: Sequence[Axes]) -> None:
        if not self._drawn:
            raise ResultsError(
                "nothing to draw: the metric or what is drawn does not vary.", code="nothing-to-draw"
            )

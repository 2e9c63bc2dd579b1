"""Verdicts on a claim over a region of open values: along each of them, and over all of them together.

Where a bound is 0, margins are relative to the number at the chosen point (see `metrics.verdict`).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

from yawbench.figures.display import digits_of
from yawbench.metrics.verdict import Verdict

from .confidence import Bounds, Decision, SequentialTest

ONE_IN = 10
"""A verdict is robust if it flips in less than one tenth of a region. Chosen: fewer are exceptions that can
be named."""
TIMES = "× as chosen"
"""Unit of an open value that is a factor, where the runs have different chosen values."""


@dataclass(frozen=True)
class LevelVerdict:
    """Verdict at a level of one open value, with all others as chosen."""

    words: str
    number: float | None  # in the unit of the scan; None: not numeric
    verdict: Verdict


@dataclass(frozen=True)
class Flip:
    """The level of one open value at which a verdict changes."""

    open_value: str
    says: str  # label of the open value
    words: str  # the level of the flip, with its unit
    number: float | None  # interpolated linearly by margins; None: not numeric
    distance: float  # from the chosen value, relative to the range
    chosen: str = ""  # the chosen value with its unit; "" if the runs differ in it


@dataclass(frozen=True)
class OpenValueScan:
    """Verdicts along one open value, from end to end of its range."""

    open_value: str
    says: str
    unit: str  # unit of the numbers; "" if they have none
    factor: float  # of a level's number to the displayed one
    chosen: LevelVerdict
    levels: tuple[LevelVerdict, ...]  # without the chosen one

    @property
    def margins(self) -> tuple[float, float] | None:
        """The smallest and the largest margin of the scan, including the chosen point."""
        every = [level.verdict.margin for level in (self.chosen, *self.levels)]
        known = [margin for margin in every if margin is not None]
        return (min(known), max(known)) if known else None

    @property
    def flip(self) -> Flip | None:
        """The flip nearest to the chosen value; levels without a result are ignored."""
        chosen = self.chosen.verdict.holds
        known = [level for level in self.levels if level.verdict.holds is not None]
        others = [level for level in known if level.verdict.holds != chosen]
        if not others or chosen is None:
            return None
        if self.chosen.number is None:
            return Flip(self.open_value, self.says, others[0].words, None, 1.0)
        start = self.chosen.number
        ascending = sorted((self.chosen, *known), key=lambda level: level.number or 0.0)
        flips = []
        for pair in itertools.pairwise(ascending):
            near, far = sorted(pair, key=lambda level: abs((level.number or 0.0) - start))
            if near.verdict.holds != far.verdict.holds:
                flips.append(_between(near, far))
        nearest = min(flips, key=lambda flip: abs(flip - start))
        numbers = [level.number or 0.0 for level in ascending]
        distance = abs(nearest - start) / (max(numbers) - min(numbers))
        words = "" if self.unit == TIMES else self.words(start)
        return Flip(self.open_value, self.says, self.words(nearest), nearest, distance, words)

    def words(self, number: float) -> str:
        """Return a number of the scan as text, in the display unit."""
        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        return f"{digits_of(number * self.factor)}{unit}"


def _between(a: LevelVerdict, b: LevelVerdict) -> float:
    """Return where the margin is zero between two levels, by linear interpolation."""
    assert a.number is not None
    assert b.number is not None
    first, last = a.verdict.margin, b.verdict.margin
    if first is None or last is None or not math.isfinite(first - last) or first == last:
        return b.number
    return a.number + (b.number - a.number) * min(max(first / (first - last), 0.0), 1.0)


@dataclass(frozen=True)
class Region:
    """Verdicts on one claim over a region of open values."""

    chosen: Verdict
    points: tuple[Verdict, ...]  # of a Latin hypercube over all open values together
    lines: tuple[OpenValueScan, ...]  # of one open value each
    test: SequentialTest  # of the share of points with another verdict

    @property
    def holding(self) -> int:
        """The number of points at which the claim holds."""
        return sum(point.holds is True for point in self.points)

    @property
    def without_result(self) -> int:
        """The number of points without a verdict because a run failed; they count as changed verdicts."""
        return sum(point.holds is None for point in self.points)

    @property
    def agreeing(self) -> float:
        """The share of points with the same verdict as the chosen point."""
        return 1.0 - self.flipping / len(self.points)

    @property
    def spread(self) -> float | None:
        """Decrease of the margin in the worst tenth of the points [1].

        The distance from the margin at the chosen point to the best one of that tenth: infinite if runs
        failed there, 0 if it is larger than at the chosen point.
        """
        if self.chosen.margin is None or self.chosen.holds is None:
            return None
        sign = 1.0 if self.chosen.holds else -1.0
        margins = sorted(-math.inf if at.margin is None else sign * at.margin for at in self.points)
        worst_tenth = margins[(len(margins) - 1) // ONE_IN]
        return max(sign * self.chosen.margin - worst_tenth, 0.0)

    @property
    def flipping(self) -> int:
        """The number of points with another verdict than the chosen point."""
        return sum(point.holds != self.chosen.holds for point in self.points)

    @property
    def flip_bounds(self) -> Bounds:
        """The confidence interval of the share of the region with another verdict."""
        return self.test.bounds(self.flipping, len(self.points))

    @property
    def robust(self) -> bool:
        """Whether it is known that less than one tenth of the region flips the verdict."""
        return self.decision is Decision.BELOW

    @property
    def decision(self) -> Decision:
        """Whether the share of the region that flips the verdict is known to be below or above a tenth."""
        return self.test.decision(self.flipping, len(self.points))

    @property
    def flip(self) -> Flip | None:
        """The flip nearest to the chosen point, by distance relative to each range."""
        flips = [flip for line in self.lines if (flip := line.flip)]
        return min(flips, key=lambda flip: flip.distance, default=None)

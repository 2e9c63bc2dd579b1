"""How far a verdict carries: margins, their spread over a region of open values, the nearest flip.

A condition compares a number x with a threshold b. Its margin is how far x lies beyond b on the side on which
the condition is true, as a share of |b|; negative on the other side. Where the threshold is another run's
metric, b is what that comes to at the same point. Where b is 0, the margin is a share of |x| at the chosen
point. The margin of a claim, all of whose conditions must be true, is the smallest of them all: it is
positive where the claim holds, and goes through zero where the verdict flips.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

ONE_IN = 10
"""A verdict is undecided if it is another at one in so many points of a region, or at more. Chosen: less is
an exception that can be named."""


TIMES = "× as chosen"
"""Unit of an open value that is a factor on what each run has, where that is not one number for all."""


@dataclass(frozen=True)
class Gap:
    """A number and the threshold that it is compared with, in one unit."""

    number: float
    bound: float
    upwards: bool  # whether the condition asks for more than the threshold
    half: float = 0.0  # what both may be off by, as means over repeats

    @property
    def beyond(self) -> float:
        """How far the number lies beyond the threshold; negative where the condition is not true."""
        if self.number == self.bound:
            return 0.0
        return self.number - self.bound if self.upwards else self.bound - self.number


def margin(gaps: Sequence[Gap | None], chosen: Sequence[Gap | None] | None = None) -> float | None:
    """Return the margin of all conditions together [1], see above; None where a number is missing.

    Args:
        gaps: of every condition, of every run it names.
        chosen: the same at the chosen point; left out: this is the chosen point.
    """
    shares = []
    for gap, at in zip(gaps, chosen or gaps, strict=True):
        if gap is None:
            return None
        scale = abs(gap.bound) or abs(at.number if at else 0.0)
        if math.isinf(scale):
            shares.append(math.copysign(1.0, gap.beyond) if gap.beyond else 0.0)
        elif scale == 0.0:
            shares.append(math.copysign(math.inf, gap.beyond) if gap.beyond else 0.0)
        else:
            shares.append(gap.beyond / scale)
    return min(shares, default=None)


@dataclass(frozen=True)
class PointVerdict:
    """The verdict and the margin at one point."""

    holds: bool | None
    margin: float | None


@dataclass(frozen=True)
class LevelVerdict:
    """A level of one open value, all others as chosen."""

    words: str
    place: float | None  # the number, in the unit of the line; None: it is none
    spot: PointVerdict


@dataclass(frozen=True)
class Flip:
    """Where a verdict becomes another when one open value leaves its chosen value."""

    open_value: str
    says: str  # what it is called
    words: str  # the level at which the verdict is another, with its unit
    place: float | None  # between two levels by the margins there (linearly); None: the values are no numbers
    distance: float  # from the chosen value, as a share of the range
    chosen: str = ""  # the chosen value with its unit; "" if there is none to tell


@dataclass(frozen=True)
class OpenValueScan:
    """One open value from end to end of its range."""

    open_value: str
    says: str
    unit: str  # of the numbers; "" if they have none
    factor: float  # of a place to the number that is shown
    chosen: LevelVerdict
    stops: tuple[LevelVerdict, ...]  # without the chosen one

    @property
    def margins(self) -> tuple[float, float] | None:
        """The smallest and the largest margin along the line, the chosen point's too."""
        every = [one.spot.margin for one in (self.chosen, *self.stops) if one.spot.margin is not None]
        return (min(every), max(every)) if every else None

    @property
    def flip(self) -> Flip | None:
        """The flip that is nearest to the chosen value; levels without a result tell nothing."""
        known = [one for one in self.stops if one.spot.holds is not None]
        others = [one for one in known if one.spot.holds != self.chosen.spot.holds]
        if not others or self.chosen.spot.holds is None:
            return None
        if self.chosen.place is None:
            return Flip(self.open_value, self.says, others[0].words, None, 1.0)
        start = self.chosen.place
        way = sorted((self.chosen, *known), key=lambda one: one.place or 0.0)
        flips = []
        for pair in pairwise(way):
            near, far = sorted(pair, key=lambda one: abs((one.place or 0.0) - start))
            if near.spot.holds != far.spot.holds:
                flips.append(_between(near, far))
        place = min(flips, key=lambda one: abs(one - start))
        places = [one.place or 0.0 for one in way]
        distance = abs(place - start) / (max(places) - min(places))
        chosen = "" if self.unit == TIMES else self.words(start)
        return Flip(self.open_value, self.says, self.words(place), place, distance, chosen)

    def words(self, place: float) -> str:
        """Return a place as people read it."""
        from ..figures.style import digits_of

        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        return f"{digits_of(place * self.factor)}{unit}"


def _between(a: LevelVerdict, b: LevelVerdict) -> float:
    """Return where the margin goes through zero between two stops, by a straight line."""
    assert a.place is not None
    assert b.place is not None
    first, last = a.spot.margin, b.spot.margin
    if first is None or last is None or not math.isfinite(first - last) or first == last:
        return b.place
    return a.place + (b.place - a.place) * min(max(first / (first - last), 0.0), 1.0)


@dataclass(frozen=True)
class Region:
    """What becomes of a verdict when the open values are others than those chosen."""

    chosen: PointVerdict
    points: tuple[PointVerdict, ...]  # of a Latin hypercube over all open values together
    lines: tuple[OpenValueScan, ...]  # of one open value each

    @property
    def holding(self) -> int:
        """At how many points the claim holds."""
        return sum(one.holds is True for one in self.points)

    @property
    def without_result(self) -> int:
        """At how many points a run failed, so that there is no verdict; it counts as another."""
        return sum(one.holds is None for one in self.points)

    @property
    def agreeing(self) -> float:
        """The share of the points whose verdict is that of the chosen point."""
        return sum(one.holds == self.chosen.holds for one in self.points) / len(self.points)

    @property
    def spread(self) -> float | None:
        """How far the margin comes towards zero, or beyond, in the worst tenth of the points [1].

        The distance from the margin at the chosen point to the best one of that tenth; infinite if there is
        none because runs failed; 0 if even there it is larger than at the chosen point.
        """
        if self.chosen.margin is None or self.chosen.holds is None:
            return None
        sign = 1.0 if self.chosen.holds else -1.0
        margins = sorted(-math.inf if one.margin is None else sign * one.margin for one in self.points)
        worst = margins[(len(margins) - 1) // ONE_IN]
        return max(sign * self.chosen.margin - worst, 0.0)

    @property
    def decided(self) -> bool:
        """Whether the verdict is the chosen point's in more than nine tenths of the points.

        It is the same as to say that the margin is larger than its spread.
        """
        others = sum(one.holds != self.chosen.holds for one in self.points)
        return ONE_IN * others < len(self.points)

    @property
    def flip(self) -> Flip | None:
        """The flip nearest to the chosen point, as a share of each range."""
        flips = [flip for line in self.lines if (flip := line.flip)]
        return min(flips, key=lambda one: one.distance, default=None)

    @property
    def robust(self) -> bool:
        """Whether nothing flips: not at any point, not along any line."""
        return self.agreeing == 1.0 and self.flip is None

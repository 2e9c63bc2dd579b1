"""Verdicts on claims, checks and limits: their margins, spread over a region of open values, nearest flip.

A condition compares a number x with a bound b. Its margin is how far x lies beyond b on the side where the
condition is true, relative to |b|; it is negative on the other side. Where the bound is another run's metric,
b is the value of that metric at the same point. Where b is 0, the margin is relative to |x| at the chosen
point. The margin of a claim is the smallest of its conditions' margins, since all of them must be true: it is
positive where the claim holds, and zero where the verdict flips.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import pairwise
from typing import Any

from ..errors import ScenarioError
from ..figures.style import DIGITS, digits_apart, shown
from ..metrics.run_metrics import MetricValue
from .judged_schema import Assertion, Condition, MetricReference, si_number

ONE_IN = 10
"""A verdict is undecided if it differs at one in ten points of a region, or at more. Chosen: fewer are
exceptions that can be named."""


TIMES = "× as chosen"
"""Unit of an open value that is a factor, where the runs have different chosen values."""


@dataclass(frozen=True)
class Gap:
    """A number and the bound it is compared with, in the same unit."""

    number: float
    bound: float
    upwards: bool  # whether the condition asks for more than the bound
    half: float = 0.0  # half width of their confidence, as means over repeats

    @property
    def beyond(self) -> float:
        """How far the number lies beyond the bound; negative where the condition is false."""
        if self.number == self.bound:
            return 0.0
        return self.number - self.bound if self.upwards else self.bound - self.number


def margin(gaps: Sequence[Gap | None], chosen: Sequence[Gap | None] | None = None) -> float | None:
    """Return the smallest margin of all conditions [1], as defined above; None if a number is missing.

    Args:
        gaps: one per condition and run.
        chosen: the same at the chosen point; None: `gaps` are at the chosen point.
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
    """Verdict and margin at one point."""

    holds: bool | None
    margin: float | None


@dataclass(frozen=True)
class LevelVerdict:
    """Verdict at a level of one open value, with all others as chosen."""

    words: str
    place: float | None  # the number, in the unit of the scan; None: not numeric
    spot: PointVerdict


@dataclass(frozen=True)
class Flip:
    """The level of one open value at which a verdict changes."""

    open_value: str
    says: str  # label of the open value
    words: str  # the level of the flip, with its unit
    place: float | None  # interpolated linearly by margins; None: not numeric
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
    stops: tuple[LevelVerdict, ...]  # without the chosen one

    @property
    def margins(self) -> tuple[float, float] | None:
        """The smallest and the largest margin of the scan, including the chosen point."""
        every = [one.spot.margin for one in (self.chosen, *self.stops) if one.spot.margin is not None]
        return (min(every), max(every)) if every else None

    @property
    def flip(self) -> Flip | None:
        """The flip nearest to the chosen value; levels without a result are ignored."""
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
        """Return a number of the scan as text, in the display unit."""
        from ..figures.style import digits_of

        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        return f"{digits_of(place * self.factor)}{unit}"


def _between(a: LevelVerdict, b: LevelVerdict) -> float:
    """Return where the margin is zero between two levels, by linear interpolation."""
    assert a.place is not None
    assert b.place is not None
    first, last = a.spot.margin, b.spot.margin
    if first is None or last is None or not math.isfinite(first - last) or first == last:
        return b.place
    return a.place + (b.place - a.place) * min(max(first / (first - last), 0.0), 1.0)


@dataclass(frozen=True)
class Region:
    """Verdicts on one claim over a region of open values."""

    chosen: PointVerdict
    points: tuple[PointVerdict, ...]  # of a Latin hypercube over all open values together
    lines: tuple[OpenValueScan, ...]  # of one open value each

    @property
    def holding(self) -> int:
        """The number of points at which the claim holds."""
        return sum(one.holds is True for one in self.points)

    @property
    def without_result(self) -> int:
        """The number of points without a verdict because a run failed; they count as changed verdicts."""
        return sum(one.holds is None for one in self.points)

    @property
    def agreeing(self) -> float:
        """The share of points with the same verdict as the chosen point."""
        return sum(one.holds == self.chosen.holds for one in self.points) / len(self.points)

    @property
    def spread(self) -> float | None:
        """How much the margin shrinks in the worst tenth of the points [1].

        The distance from the margin at the chosen point to the best one of that tenth: infinite if runs
        failed there, 0 if it is larger than at the chosen point.
        """
        if self.chosen.margin is None or self.chosen.holds is None:
            return None
        sign = 1.0 if self.chosen.holds else -1.0
        margins = sorted(-math.inf if one.margin is None else sign * one.margin for one in self.points)
        worst = margins[(len(margins) - 1) // ONE_IN]
        return max(sign * self.chosen.margin - worst, 0.0)

    @property
    def decided(self) -> bool:
        """Whether more than nine tenths of the points have the verdict of the chosen point.

        Equivalently: the margin exceeds its spread.
        """
        others = sum(one.holds != self.chosen.holds for one in self.points)
        return ONE_IN * others < len(self.points)

    @property
    def flip(self) -> Flip | None:
        """The flip nearest to the chosen point, by distance relative to each range."""
        flips = [flip for line in self.lines if (flip := line.flip)]
        return min(flips, key=lambda one: one.distance, default=None)

    @property
    def robust(self) -> bool:
        """Whether the verdict flips neither at a point nor along any open value."""
        return self.agreeing == 1.0 and self.flip is None


MetricTable = Mapping[tuple[str, str], MetricValue]
"""(run, metric key) -> value, where there is one."""

_COMPARE = {
    "above": operator.gt,
    "at_least": operator.ge,
    "below": operator.lt,
    "at_most": operator.le,
}
_UPWARDS = ("above", "at_least")


@dataclass(frozen=True)
class ClaimResult:
    """Result of judging a claim: whether it holds (None: a run is missing), and what was measured."""

    said: Any  # a claim, or anything else with conditions
    holds: bool | None
    measured: tuple[str, ...]
    gaps: tuple[Gap | None, ...] = ()  # one per condition and run; None: no result
    region: Region | None = None
    group: str = "claims"  # `claims` of a paper, or our own `checks`

    @property
    def sure(self) -> bool:
        """Whether the verdict is beyond chance: no deciding bound lies within the confidence interval."""
        gaps = [gap for gap in self.gaps if gap is not None]
        if self.holds is None or not any(gap.half for gap in gaps):
            return True
        if self.holds:
            return all(gap.beyond >= gap.half for gap in gaps)
        return any(gap.beyond <= -gap.half for gap in gaps)

    @property
    def margin(self) -> float | None:
        """Distance of the claim from the opposite verdict, relative to its bound, as defined above."""
        return margin(self.gaps)

    def margin_from(self, chosen: ClaimResult) -> float | None:
        """Return the margin, with the scale of the result at the chosen point."""
        return margin(self.gaps, chosen.gaps)


def judge(
    said: Assertion,
    values: MetricTable,
    runs: Mapping[str, str],
    derived: Mapping[str, MetricValue] | None = None,
) -> ClaimResult:
    """Judge a claim, check or limit by the metrics of runs.

    Args:
        said: the claim; all its conditions must be true for every run they name.
        values: metrics of the runs.
        runs: name -> label of all runs, including those without values.
        derived: key -> derived number, where there is one.

    Raises:
        ScenarioError: a bound has a unit that does not fit its metric.
    """
    found = [_compare(condition, values, runs, derived or {}) for condition in said.holds_if]
    verdicts = [holds for holds, _, _ in found]
    holds = None if None in verdicts else all(verdicts)
    texts = dict.fromkeys(text for _, text, _ in found)
    return ClaimResult(said, holds, tuple(texts), tuple(gap for _, _, gaps in found for gap in gaps))


def _compare(
    condition: Condition, values: MetricTable, runs: Mapping[str, str], derived: Mapping[str, MetricValue]
) -> tuple[bool | None, str, list[Gap | None]]:
    """Return whether a condition is true for all runs it names, their values as text, and the gaps."""
    bound = condition.bound
    if condition.derived:
        named, measured = [""], [("", derived.get(condition.derived))]
    else:
        named = [run for run in runs if fnmatchcase(run, condition.run or "*")]
        measured = [(runs[run], values.get((run, condition.metric))) for run in named]
    known = sorted(((v, run) for run, v in measured if v is not None), key=lambda one: one[0].number)
    missing = len(known) < len(measured)
    limit: float | None
    if isinstance(bound, MetricReference):
        other = values.get((bound.run, bound.metric))
        limit = None if other is None else bound.times * other.number
        off = 0.0 if other is None else abs(bound.times) * other.half
    else:
        limit, off = _number(bound, known[0][0].unit) if known else None, 0.0
    near = [(value.number, limit) for value, _ in known] if limit is not None else []
    digits = digits_apart(near, known[0][0].unit) if known else DIGITS
    text = _range(known, missing, digits)
    if isinstance(bound, MetricReference):
        times = f"{bound.times:g} × " if other and bound.times != 1.0 else ""
        text += (
            f" against {times}{_range([(other, runs[bound.run])] if other else [], other is None, digits)}"
        )
    itself = (bound.run, bound.metric) if isinstance(bound, MetricReference) else None
    gaps = [
        None
        if value is None or limit is None
        else Gap(value.number, limit, condition.operator in _UPWARDS, value.half + off)
        for run, (_, value) in zip(named, measured, strict=True)
        if (run, condition.metric) != itself  # the gap to itself tells nothing
    ]
    if missing or limit is None:
        return None, text, gaps
    compare = _COMPARE[condition.operator]
    return all(compare(value.number, limit) for value, _ in known), text, gaps


def _range(known: Sequence[tuple[MetricValue, str]], missing: bool, digits: int) -> str:
    """Return the value as text, or the smallest and largest with their runs where they read differently."""
    ends: dict[str, str] = {}
    for value, run in (*known[:1], *known[-1:]):
        ends.setdefault(shown(value.number, value.unit, digits=digits, half=value.half), run)
    text = " to ".join(f"{number} ({run})" if run else number for number, run in ends.items())
    return " and ".join(filter(None, [text, "no result" if missing else ""]))


def _number(bound: float | str, unit: str) -> float:
    try:
        return si_number(bound, unit)
    except ValueError as error:
        raise ScenarioError(f"a condition's bound: {error}", code="unit-mismatch") from None

"""Claims, checks and limits judged by the metrics of runs, and over a region of open values.

The verdict on a claim is that of the condition that decides it: all conditions must be true, so its margin is
the smallest of theirs. Where the bound is another run's metric, it is the value of that metric at the same
point; where a bound is 0, margins over a region are relative to the number at the chosen point.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

from yawbench.figures.display import digits_of
from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import counted
from yawbench.metrics.expressions import MetricValue
from yawbench.metrics.verdict import Judged, Status, Verdict, all_of, compare, worst

from .claim_schema import Assertion, Claim, Condition, MetricReference, si_number
from .confidence import Bounds
from .derived import MetricTable
from .sequential_test import Decision, SequentialTest


@dataclass(frozen=True)
class RunValue:
    """The value of a metric in a run, or of a derived number: None if there is none."""

    run: str  # "" for a derived number
    label: str
    value: MetricValue | None


@dataclass(frozen=True)
class Comparison:
    """A condition with the numbers of all runs that it names, and its bound."""

    condition: Condition
    measured: tuple[RunValue, ...]
    bound: float | None  # in SI; None: the run that it is taken from has no value
    taken_from: RunValue | None = None  # the run whose metric is the bound

    @property
    def unit(self) -> str:
        """The unit in which the numbers are shown; "" if there are none."""
        return next((one.value.shown_in for one in self.measured if one.value), "")

    @property
    def verdicts(self) -> list[Verdict]:
        """A verdict per run."""
        condition, verdicts = self.condition, []
        itself = (condition.bound.run, condition.bound.metric) if self.taken_from else None
        other = self.taken_from.value if self.taken_from else None
        half = abs(condition.bound.times) * other.half if other else 0.0
        for one in self.measured:
            number, spread = (one.value.number, half + one.value.half) if one.value else (None, half)
            verdict = compare(number, condition.relation, self.bound, self.unit, half=spread)
            if (one.run, condition.metric) == itself and verdict.holds is not None:
                verdict = Verdict(verdict.status)  # its distance to itself says nothing
            verdicts.append(verdict)
        return verdicts or [Verdict(Status.NOT_JUDGED)] * (self.bound is None)


def comparisons(
    assertion: Assertion,
    values: MetricTable,
    runs: Mapping[str, str],
    derived: Mapping[str, MetricValue] | None = None,
) -> tuple[Comparison, ...]:
    """Compare the metrics of runs with the bounds of a claim, check or limit, a comparison per condition.

    Args:
        assertion: all its conditions must be true for every run they name.
        values: metrics of the runs.
        runs: name -> label of all runs, including those without values.
        derived: key -> derived number, where there is one.

    Raises:
        ScenarioError: a bound has a unit that does not fit its metric.
    """
    return tuple(_compared(condition, values, runs, derived or {}) for condition in assertion.holds_if)


def judge(
    assertion: Assertion,
    values: MetricTable,
    runs: Mapping[str, str],
    derived: Mapping[str, MetricValue] | None = None,
) -> Verdict:
    """Judge a claim, check or limit; for arguments and errors see `comparisons`."""
    return verdict_of(comparisons(assertion, values, runs, derived))


def verdict_of(compared: Sequence[Comparison]) -> Verdict:
    """Return the verdict on conditions that must all be true."""
    return all_of([verdict for comparison in compared for verdict in comparison.verdicts])


def _compared(
    condition: Condition, values: MetricTable, runs: Mapping[str, str], derived: Mapping[str, MetricValue]
) -> Comparison:
    named = [run for run in runs if fnmatchcase(run, condition.run or "*")]
    measured = tuple(RunValue(run, runs[run], values.get((run, condition.metric))) for run in named)
    if condition.derived:
        measured = (RunValue("", "", derived.get(condition.derived)),)
    bound = condition.bound
    if isinstance(bound, MetricReference):
        other = RunValue(bound.run, runs.get(bound.run, bound.run), values.get((bound.run, bound.metric)))
        limit = bound.times * other.value.number if other.value else None
        return Comparison(condition, measured, limit, other)
    unit = next((one.value.shown_in for one in measured if one.value), None)
    try:
        return Comparison(condition, measured, None if unit is None else si_number(bound, unit))
    except ValueError as error:
        raise ScenarioError(f"a condition's bound: {error}", code="unit-mismatch") from None


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


@dataclass(frozen=True, kw_only=True)
class ClaimResult:
    """A claim or check with its verdict at the chosen point and over the region."""

    claim: Claim
    group: Judged  # `claims` of a paper, or our own `checks`
    verdict: Verdict  # at the chosen point; along axes the worst of all settings
    compared: tuple[Comparison, ...] = ()  # a comparison per condition; along axes none
    region: Region | None = None

    @classmethod
    def of(
        cls, claim: Claim, group: Judged, settings: Sequence[tuple[Comparison, ...]], region: Region | None
    ) -> ClaimResult:
        """Return a claim with its verdict, from the comparisons at every setting of the axes."""
        verdicts = [*map(verdict_of, settings)]
        if len(verdicts) == 1:
            return cls(claim=claim, group=group, verdict=verdicts[0], compared=settings[0], region=region)
        holding = sum(verdict.holds is True for verdict in verdicts)
        why = f"holds at {holding} of {counted(len(verdicts), 'point')}"
        overall = replace(worst(verdicts) or Verdict(Status.PASSED), margin=None, half=0.0, parts=(), why=why)
        return cls(claim=claim, group=group, verdict=overall, region=region)

    @property
    def status(self) -> Status:
        """Status of the verdict, as far as chance and the region of open values let it stand."""
        if self.verdict.holds is None:
            return self.verdict.status
        if not self.verdict.certain:
            return Status.UNDECIDED
        if self.region is None or self.region.robust:
            return self.verdict.status
        return Status.SENSITIVE if self.region.decision is Decision.ABOVE else Status.UNDECIDED

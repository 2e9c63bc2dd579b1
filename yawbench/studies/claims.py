"""Claims, checks and limits judged by the metrics of runs.

The verdict on a claim is that of the condition that decides it: all conditions must be true, so its margin is
the smallest of theirs. Where the bound is another run's metric, it is the value of that metric at the same
point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

from yawbench.foundation.errors import ScenarioError
from yawbench.metrics.expressions import MetricValue
from yawbench.metrics.verdict import Judged, Status, Verdict, all_of, compare, worst

from .claim_schema import Assertion, Claim, Condition, MetricReference, si_number
from .confidence import Decision
from .derived import MetricTable
from .region_verdicts import Region


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


@dataclass(frozen=True, kw_only=True)
class ClaimResult:
    """A claim or check with its verdict at the chosen point and over the region."""

    claim: Claim
    group: Judged  # `claims` of a paper, or our own `checks`
    verdict: Verdict  # at the chosen point; along axes the worst of all settings
    compared: tuple[Comparison, ...] = ()  # a comparison per condition; along axes none
    held_at: tuple[int, int] | None = None  # along axes the number of settings where it holds, and of all
    region: Region | None = None

    @classmethod
    def of(
        cls, claim: Claim, group: Judged, settings: Sequence[tuple[Comparison, ...]], region: Region | None
    ) -> ClaimResult:
        """Return a claim with its verdict, from the comparisons at every setting of the axes."""
        verdicts = [*map(verdict_of, settings)]
        if len(verdicts) == 1:
            return cls(claim=claim, group=group, verdict=verdicts[0], compared=settings[0], region=region)
        overall = replace(worst(verdicts) or Verdict(Status.PASSED), margin=None, half=0.0, parts=())
        held_at = sum(verdict.holds is True for verdict in verdicts), len(verdicts)
        return cls(claim=claim, group=group, verdict=overall, held_at=held_at, region=region)

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

"""Whether claims, checks and limits hold, judged by the metrics of runs.

Confidence in a mean over repeats: how far chance, such as the noise of a sensor, may have moved it.

The one place that says how sure a mean over several runs is: axes that `repeats` a run, tables, verdicts and
whatever else takes seeds.

    mean ± t s / √n         s: standard deviation of the sample, n: repeats,
                            t: quantile of Student's distribution with n - 1 degrees of freedom

Where repeats are alike in everything but their seed, their numbers are independent; that they are normally
distributed is an assumption, harmless to a mean of ten unless single runs lie far off. Such a mean says
little, and its interval is wide.

Source: Student (W. S. Gosset), The probable error of a mean, Biometrika 6 (1908) 1-25.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from typing import Any, NamedTuple

from ..errors import ScenarioError
from ..figures.style import DIGITS, digits_apart, shown
from ..metrics.run_metrics import MetricValue
from .judged_schema import Assertion, Condition, MetricReference, si_number
from .margins import Gap, Region, margin

MetricTable = Mapping[tuple[str, str], MetricValue]
"""(run, key of the metric) -> value, of those that exist."""

_COMPARE = {
    "above": operator.gt,
    "at_least": operator.ge,
    "below": operator.lt,
    "at_most": operator.le,
}
_UPWARDS = ("above", "at_least")


@dataclass(frozen=True)
class ClaimResult:
    """What was said, whether it holds (None: a run is missing), and what was measured in which runs."""

    said: Any  # a claim, or what else has conditions
    holds: bool | None
    measured: tuple[str, ...]
    gaps: tuple[Gap | None, ...] = ()  # of every condition, of every run it names; None: no result
    region: Region | None = None
    group: str = "claims"  # of a paper, or `checks`: our own

    @property
    def sure(self) -> bool:
        """Whether chance leaves the verdict as it is: no threshold that decides lies within confidence."""
        gaps = [gap for gap in self.gaps if gap is not None]
        if self.holds is None or not any(gap.half for gap in gaps):
            return True
        if self.holds:
            return all(gap.beyond >= gap.half for gap in gaps)
        return any(gap.beyond <= -gap.half for gap in gaps)

    @property
    def margin(self) -> float | None:
        """How far the claim is from the other verdict, as a share of its threshold (see `margins`)."""
        return margin(self.gaps)

    def margin_from(self, chosen: ClaimResult) -> float | None:
        """Return the margin of this judgement of what is judged at the chosen point, too."""
        return margin(self.gaps, chosen.gaps)


def judge(
    said: Assertion,
    values: MetricTable,
    runs: Mapping[str, str],
    derived: Mapping[str, MetricValue] | None = None,
) -> ClaimResult:
    """Judge what is said by the values of metrics.

    Args:
        said: its conditions must all be true, of every run that they name.
        values: what the runs came to.
        runs: name -> words for it, of all runs, those without values too.
        derived: key -> number derived from several runs, of those that exist.

    Raises:
        ScenarioError: a bound is given in a unit that its metric does not have.
    """
    found = [_compare(condition, values, runs, derived or {}) for condition in said.holds_if]
    verdicts = [holds for holds, _, _ in found]
    holds = None if None in verdicts else all(verdicts)
    texts = dict.fromkeys(text for _, text, _ in found)
    return ClaimResult(said, holds, tuple(texts), tuple(gap for _, _, gaps in found for gap in gaps))


def _compare(
    condition: Condition, values: MetricTable, runs: Mapping[str, str], derived: Mapping[str, MetricValue]
) -> tuple[bool | None, str, list[Gap | None]]:
    """Return whether a condition is true of all runs it names, their values as text, and the gaps."""
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
        if (run, condition.metric) != itself  # which tells nothing
    ]
    if missing or limit is None:
        return None, text, gaps
    compare = _COMPARE[condition.operator]
    return all(compare(value.number, limit) for value, _ in known), text, gaps


def _range(known: Sequence[tuple[MetricValue, str]], missing: bool, digits: int) -> str:
    """Return the value, or the smallest and the largest where they read differently, with their runs."""
    ends: dict[str, str] = {}
    for value, run in (*known[:1], *known[-1:]):
        ends.setdefault(shown(value.number, value.unit, digits=digits, half=value.half), run)
    text = " to ".join(f"{number} ({run})" if run else number for number, run in ends.items())
    return " and ".join(filter(None, [text, "no result" if missing else ""]))


def _number(bound: float | str, unit: str) -> float:
    try:
        return si_number(bound, unit)
    except ValueError as error:
        raise ScenarioError(f"a condition's bound: {error}") from None


LEVEL = 0.95
"""Share of such intervals that hold the true mean; chosen: what is usual."""


class ConfidenceInterval(NamedTuple):
    """The mean over repeats, and half the width of its confidence interval, in the unit of the numbers."""

    mean: float
    half: float


def interval(numbers: Sequence[float], level: float = LEVEL) -> ConfidenceInterval | None:
    """Return the mean of the numbers of several repeats with its confidence interval.

    Equal numbers, and a single one, have no chance in them that could be seen: their interval has no width.
    Nor have those of which one is infinite, as their mean is then. None for no numbers, or if one is none.
    """
    if not numbers or any(map(math.isnan, numbers)):
        return None
    n = len(numbers)
    if n == 1 or min(numbers) == max(numbers):
        return ConfidenceInterval(float(numbers[0]), 0.0)
    mean = math.fsum(numbers) / n if all(map(math.isfinite, numbers)) else sum(numbers)
    if not math.isfinite(mean):
        return None if math.isnan(mean) else ConfidenceInterval(mean, 0.0)
    spread = math.sqrt(math.fsum((x - mean) ** 2 for x in numbers) / (n - 1))
    return ConfidenceInterval(mean, _quantile(n - 1, level) * spread / math.sqrt(n))


@cache
def _quantile(degrees: int, level: float) -> float:
    """Return the quantile of Student's distribution that leaves out (1 - level) / 2 at each end."""
    from scipy.special import stdtrit  # as scipy.stats.t does, which takes long to import

    return float(stdtrit(degrees, 0.5 + level / 2))

"""Verdicts on claims, checks and limits from the metrics of runs."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

from ..errors import ScenarioError
from ..figures.style import DIGITS, digits_apart, shown
from ..metrics.run_metrics import MetricValue
from .judged_schema import Assertion, Condition, MetricReference, si_number
from .margins import Gap, Region, margin

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
        """Distance of the claim from the opposite verdict, relative to its bound (see `margins`)."""
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

"""Whether a claim holds, judged by the metrics of runs."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from ..errors import ScenarioError
from ..figures.display import shown
from ..metrics.run_metrics import Value
from .study_schema import Claim, Condition, Reference, si_number

Values = Mapping[tuple[str, str], Value]
"""(run, key of the metric) -> value, of those that exist."""

_COMPARE = {
    "above": operator.gt,
    "at_least": operator.ge,
    "below": operator.lt,
    "at_most": operator.le,
}
_SIGNS = {"above": ">", "at_least": "≥", "below": "<", "at_most": "≤"}


@dataclass(frozen=True)
class Judgement:
    """A claim, whether it holds (None: a run is missing), and what was measured."""

    claim: Claim
    holds: bool | None
    measured: tuple[str, ...]


def judge(
    claim: Claim, values: Values, runs: Sequence[str], derived: Mapping[str, Value] | None = None
) -> Judgement:
    """Judge a claim by the values of metrics.

    Args:
        claim: its conditions must all be true, of every run that they name.
        values: what the runs came to.
        runs: names of all runs, those without values too.
        derived: key -> number derived from several runs, of those that exist.

    Raises:
        ScenarioError: a bound is given in a unit that its metric does not have.
    """
    found = [_compare(condition, values, runs, derived or {}) for condition in claim.holds_if]
    verdicts = [holds for holds, _ in found]
    holds = None if None in verdicts else all(verdicts)
    return Judgement(claim, holds, tuple(dict.fromkeys(text for _, text in found)))


def _compare(
    condition: Condition, values: Values, runs: Sequence[str], derived: Mapping[str, Value]
) -> tuple[bool | None, str]:
    """Return whether a condition is true of all runs it names, and their values as text."""
    if condition.derived:
        measured = [derived.get(condition.derived)]
    else:
        named = [run for run in runs if fnmatchcase(run, condition.run)]
        measured = [values.get((run, condition.metric)) for run in named]
    known = sorted((value for value in measured if value is not None), key=lambda value: value.number)
    missing = len(known) < len(measured)
    text = _range(known, missing)
    bound = condition.bound
    limit: float | None
    if isinstance(bound, Reference):
        other = values.get((bound.run, bound.metric))
        limit = None if other is None else bound.times * other.number
        text = f"{text} against {_range([other] if other else [], other is None)}"
    else:
        limit = _number(bound, known[0].unit) if known else None
    if missing or limit is None:
        return None, text
    compare = _COMPARE[condition.operator]
    return all(compare(value.number, limit) for value in known), text


def _range(known: Sequence[Value], missing: bool) -> str:
    """Return the value, or the smallest and the largest where they read differently."""
    ends = dict.fromkeys(shown(value.number, value.unit) for value in (*known[:1], *known[-1:]))
    text = " to ".join(ends)
    return " and ".join(filter(None, [text, "no result" if missing else ""]))


def _number(bound: float | str, unit: str) -> float:
    try:
        return si_number(bound, unit)
    except ValueError as error:
        raise ScenarioError(f"a condition's bound: {error}") from None


def condition_text(condition: Condition) -> str:
    """Return a condition as a reader checks it: `25mps/fnn: error ≤ 5 %`."""
    bound = condition.bound
    if isinstance(bound, Reference):
        factor = "" if bound.times == 1 else f"{bound.times:g} × "
        other = bound.run if bound.metric == condition.metric else f"{bound.metric} of {bound.run}"
        limit = f"{factor}{other}"
    else:
        limit = str(bound)
    of = condition.derived or f"{condition.run}: {condition.metric}"
    return f"{of} {_SIGNS[condition.operator]} {limit}"

"""Whether claims, checks and limits hold, judged by the metrics of runs."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

from ..errors import ScenarioError
from ..figures.display import shown
from ..metrics.run_metrics import Value
from .judged_schema import Condition, Judged, Reference
from .numbers import si_number

Values = Mapping[tuple[str, str], Value]
"""(run, key of the metric) -> value, of those that exist."""

_COMPARE = {
    "above": operator.gt,
    "at_least": operator.ge,
    "below": operator.lt,
    "at_most": operator.le,
}


@dataclass(frozen=True)
class Judgement:
    """What was said, whether it holds (None: a run is missing), and what was measured in which runs."""

    said: Any  # a claim, or what else has conditions
    holds: bool | None
    measured: tuple[str, ...]


def judge(
    said: Judged, values: Values, runs: Mapping[str, str], derived: Mapping[str, Value] | None = None
) -> Judgement:
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
    verdicts = [holds for holds, _ in found]
    holds = None if None in verdicts else all(verdicts)
    return Judgement(said, holds, tuple(dict.fromkeys(text for _, text in found)))


def _compare(
    condition: Condition, values: Values, runs: Mapping[str, str], derived: Mapping[str, Value]
) -> tuple[bool | None, str]:
    """Return whether a condition is true of all runs it names, and their values as text."""
    if condition.derived:
        measured = [("", derived.get(condition.derived))]
    else:
        named = [run for run in runs if fnmatchcase(run, condition.run or "*")]
        measured = [(runs[run], values.get((run, condition.metric))) for run in named]
    known = sorted(((v, run) for run, v in measured if v is not None), key=lambda one: one[0].number)
    missing = len(known) < len(measured)
    text = _range(known, missing)
    bound = condition.bound
    limit: float | None
    if isinstance(bound, Reference):
        other = values.get((bound.run, bound.metric))
        limit = None if other is None else bound.times * other.number
        text = f"{text} against {_range([(other, runs[bound.run])] if other else [], other is None)}"
    else:
        limit = _number(bound, known[0][0].unit) if known else None
    if missing or limit is None:
        return None, text
    compare = _COMPARE[condition.operator]
    return all(compare(value.number, limit) for value, _ in known), text


def _range(known: Sequence[tuple[Value, str]], missing: bool) -> str:
    """Return the value, or the smallest and the largest where they read differently, with their runs."""
    ends: dict[str, str] = {}
    for value, run in (*known[:1], *known[-1:]):
        ends.setdefault(shown(value.number, value.unit), run)
    text = " to ".join(f"{number} ({run})" if run else number for number, run in ends.items())
    return " and ".join(filter(None, [text, "no result" if missing else ""]))


def _number(bound: float | str, unit: str) -> float:
    try:
        return si_number(bound, unit)
    except ValueError as error:
        raise ScenarioError(f"a condition's bound: {error}") from None

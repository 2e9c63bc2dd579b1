"""Whether a claim holds, judged by the metrics of runs."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from dataclasses import dataclass

from .display import shown
from .errors import ScenarioError
from .metrics import Value
from .quantities import convert
from .study_schema import Claim, Condition, Reference

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
    measured: str


def judge(claim: Claim, values: Values) -> Judgement:
    """Judge a claim by the values of metrics.

    Raises:
        ScenarioError: a bound is given in a unit that its metric does not have.
    """
    found = [_compare(condition, values) for condition in claim.holds_if]
    verdicts = [holds for holds, _ in found]
    holds = None if None in verdicts else all(verdicts)
    return Judgement(claim, holds, "; ".join(dict.fromkeys(text for _, text in found)))


def _compare(condition: Condition, values: Values) -> tuple[bool | None, str]:
    measured = values.get((condition.run, condition.metric))
    bound = condition.bound
    if isinstance(bound, Reference):
        other = values.get((bound.run, bound.metric))
        if measured is None or other is None:
            return None, f"{_text(measured)} against {_text(other)}"
        limit = bound.times * other.number
        text = f"{_text(measured)} against {_text(other)}"
    else:
        if measured is None:
            return None, _text(measured)
        limit = _number(bound, measured.unit)
        text = _text(measured)
    return _COMPARE[condition.operator](measured.number, limit), text


def _text(value: Value | None) -> str:
    return "no result" if value is None else shown(value.number, value.unit)


def _number(bound: float | str, unit: str) -> float:
    if not isinstance(bound, str):
        return float(bound)
    try:
        return float(convert(bound, "1" if unit == "%" else unit))
    except ValueError as error:
        raise ScenarioError(f"a condition's bound: {error}") from None


def condition_text(condition: Condition) -> str:
    """Return a condition as a reader checks it: `25mps/fnn: error ≤ 5 %`."""
    bound = condition.bound
    if isinstance(bound, Reference):
        factor = "" if bound.times == 1 else f"{bound.times:g} × "
        other = f"{bound.metric} of {bound.run}" if bound.metric != condition.metric else bound.run
        limit = f"{factor}{other}"
    else:
        limit = str(bound)
    return f"{condition.run}: {condition.metric} {_SIGNS[condition.operator]} {limit}"

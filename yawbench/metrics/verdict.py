"""Verdicts: numbers compared with bounds, and how far from the opposite verdict.

A claim, a criterion of a standard test, a validation and a limit all come to a `Verdict`: the number x, its
bound b, and whether x is on the side of b where it should be. The margin is how far x lies beyond b on that
side, relative to |b|, or to |x| where b is 0; it is negative on the other side, and zero where the verdict
flips. The verdict on several conditions has theirs as its parts (`all_of`). People read it in the words of
`worded`.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, Literal, NamedTuple

Relation = Literal["above", "at_least", "below", "at_most"]
"""Relation that a number has to have to its bound."""


class RelationKind(NamedTuple):
    """A relation: its symbol, when it holds, and on which side of the bound the number should be."""

    symbol: str
    holds: Callable[[float, float], bool]  # of number and bound
    upwards: bool  # whether the number should be the larger one


RELATIONS: dict[str, RelationKind] = {
    "above": RelationKind(">", operator.gt, upwards=True),
    "at_least": RelationKind("≥", operator.ge, upwards=True),
    "below": RelationKind("<", operator.lt, upwards=False),
    "at_most": RelationKind("≤", operator.le, upwards=False),
}
"""To add a relation, add it here and to `Relation`, and a field to `studies.claim_schema.Condition`."""
SYMBOLS = {name: kind.symbol for name, kind in RELATIONS.items()}
"""Relation -> its symbol."""
ROUNDING, MOST_DECIMALS = 1e-9, 12
"""Relative difference up to which numbers count as equal, and decimals at most."""


class Status(str, Enum):
    """Status of a verdict."""

    PASSED = "passed"
    FAILED = "failed"
    SENSITIVE = "depends on open values"  # it changes in at least a tenth of their region
    UNDECIDED = "undecided"  # chance may change it, or whether it is sensitive is not known
    NOT_JUDGED = "not judged"


Judged = Literal["claims", "checks", "criteria", "cars"]
"""What is judged: claims of a paper, our own checks, criteria of tests, validations and limits, or of cars
whether they were lost."""
_WORDS = {
    ("claims", Status.PASSED): "holds",
    ("claims", Status.FAILED): "does not reproduce",
    ("checks", Status.PASSED): "holds",
    ("checks", Status.FAILED): "does not hold",
    ("cars", Status.PASSED): "held",
    ("cars", Status.FAILED): "lost",
}
"""Words other than the status's own."""


class VerdictText(str):
    """The words of a verdict, with the status that they tell: pages add its sign."""

    status: Status


def worded(status: Status, of: Judged = "criteria") -> VerdictText:
    """Return a status in the words for what is judged."""
    text = VerdictText(_WORDS.get((of, status), status.value))
    text.status = status
    return text


WORST_FIRST = (Status.FAILED, Status.NOT_JUDGED, Status.SENSITIVE, Status.UNDECIDED, Status.PASSED)
PERCENT = "%"
"""Unit that says how a ratio is shown: its number and its unit stay those of a ratio, 1."""


class WithUnit:
    """Base of numbers with a unit, in SI: a ratio has the unit "1", even where it is shown in per cent.

    Created with the unit "%", it is the ratio, to be shown in per cent.
    """

    unit: str
    percent: bool

    def __post_init__(self) -> None:
        if self.unit == PERCENT:
            object.__setattr__(self, "unit", "1")
            object.__setattr__(self, "percent", True)

    @property
    def shown_in(self) -> str:
        """The unit for `figures.display.shown`: "%" for a ratio in per cent."""
        return PERCENT if self.percent else self.unit


@dataclass(frozen=True)
class Verdict(WithUnit):
    """The verdict on a claim, criterion or limit, with the number and the bound that decide it.

    >>> run.evaluate("sine-with-dwell").criteria["stability"].holds is None  # not this manoeuvre
    True
    """

    status: Status
    value: float | None = None  # in SI; None: judged by more than a number, or not judged
    bound: float | None = None
    relation: Relation | None = None  # in which the value has to be to the bound
    unit: str = ""  # of both; "1" for ratios
    margin: float | None = None  # [1], as defined above
    half: float = 0.0  # half width of the confidence interval of value - bound, as means over repeats
    why: str = ""  # the reason in words
    percent: bool = field(default=False, kw_only=True, repr=False)  # whether tables show a ratio in per cent
    parts: tuple[Verdict, ...] = field(default=(), kw_only=True, repr=False)  # one per condition and run

    @property
    def holds(self) -> bool | None:
        """Whether it passed; None unless it passed or failed."""
        return {Status.PASSED: True, Status.FAILED: False}.get(self.status)

    @property
    def beyond(self) -> float | None:
        """Distance of the value beyond its bound, on the side where it should be, in its unit."""
        if self.value is None or self.bound is None:
            return None
        upwards = self.relation is not None and RELATIONS[self.relation].upwards
        return _beyond(self.value, self.bound, upwards)

    @property
    def certain(self) -> bool:
        """Whether the verdict is beyond chance: no deciding bound lies within the interval of its value."""
        if self.parts:
            deciding = [part.certain for part in self.parts if part.holds is self.holds]
            return self.holds is None or (all(deciding) if self.holds else any(deciding))
        beyond = self.beyond
        return beyond is None or not abs(beyond) < self.half

    def scaled(self, chosen: Verdict) -> Verdict:
        """Return the verdict with margins relative to |x| of `chosen` where the bound is 0."""
        if self.parts:
            pairs = zip(self.parts, chosen.parts, strict=True)
            return all_of([part.scaled(at) for part, at in pairs])
        beyond = self.beyond
        if beyond is None or self.margin is None or self.bound:
            return self
        return replace(self, margin=_relative(beyond, abs(chosen.value or 0.0)))

    def as_data(self) -> dict[str, Any]:
        """Return the verdict as plain data for files, in SI units; numbers that are not finite as text."""
        numbers = {"value": self.value, "bound": self.bound, "margin": self.margin}
        data = {key: x if x is None or math.isfinite(x) else str(x) for key, x in numbers.items()}
        own = {"relation": self.relation, "unit": self.unit or None}
        return {"verdict": self.status, "why": self.why, **data, **own}

    def __str__(self) -> str:
        return f"{worded(self.status)}. {self.why}"


def compare(
    value: float | None,
    relation: Relation,
    bound: float | None,
    unit: str = "1",
    *,
    half: float = 0.0,
    why: str = "",
) -> Verdict:
    """Compare a number with a bound in the same unit; not judged if either is missing."""
    if value is None or bound is None:
        return Verdict(Status.NOT_JUDGED, value, bound, relation, unit, why=why)
    kind = RELATIONS[relation]
    status = Status.PASSED if kind.holds(value, bound) else Status.FAILED
    margin = _relative(_beyond(value, bound, kind.upwards), abs(bound) or abs(value))
    return Verdict(status, value, bound, relation, unit, margin, half, why)


def apart(value: float, *bounds: float, decimals: int) -> str:
    """Return a number with some decimals, or as many more as make it read differently from its bounds.

    >>> apart(34.8, 35.0, decimals=1), apart(35.02, 35.0, decimals=1), apart(35.0, 35.0, decimals=1)
    ('34.8', '35.02', '35.0')
    """
    near = [bound for bound in bounds if not math.isclose(value, bound, rel_tol=ROUNDING)]
    while decimals < MOST_DECIMALS and any(round(value, decimals) == round(b, decimals) for b in near):
        decimals += 1
    return f"{round(value, decimals) + 0.0:.{decimals}f}"  # never "-0.0"


class NotJudged(Exception):
    """Raised when a run cannot be judged; the message is the reason."""


def not_judged(why: str) -> Verdict:
    """Return a verdict that could not be reached, with the reason."""
    return Verdict(Status.NOT_JUDGED, why=why)


def worst(verdicts: Iterable[Verdict]) -> Verdict | None:
    """Return the worst verdict: failed, not judged, undecided, passed; then by margin. None without any."""

    def badness(verdict: Verdict) -> tuple[int, float]:
        return WORST_FIRST.index(verdict.status), math.inf if verdict.margin is None else verdict.margin

    return min(verdicts, key=badness, default=None)


def all_of(parts: Sequence[Verdict]) -> Verdict:
    """Return the verdict on conditions that must all be true; not judged if a number is missing."""
    missing = next((part for part in parts if part.status is Status.NOT_JUDGED), None)
    margins = [part.margin for part in parts if part.margin is not None]
    deciding = missing or worst(parts) or Verdict(Status.PASSED)
    return replace(deciding, margin=None if missing else min(margins, default=None), parts=tuple(parts))


def _beyond(value: float, bound: float, upwards: bool) -> float:
    if value == bound:
        return 0.0
    return value - bound if upwards else bound - value


def _relative(beyond: float, scale: float) -> float:
    """Return a distance relative to a scale; ±1 if that is infinite, ±infinite if it is 0."""
    if math.isinf(scale) or scale == 0.0:
        return math.copysign(1.0 if scale else math.inf, beyond) if beyond else 0.0
    return beyond / scale

"""Results of standard tests: quantities and verdicts of a run and of a series of runs.

A verdict is passed, failed or not judged, and has a reason. A quantity that does not exist in a run is listed
without a number, and a criterion that needs it is not judged, never passed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import Enum
from functools import wraps
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, Protocol

from ..metrics.measures import si

if TYPE_CHECKING:
    from ..plan import Value
    from .trace import Trace

P = ParamSpec("P")


class Verdict(str, Enum):
    """The verdict on a criterion."""

    PASSED = "passed"
    FAILED = "failed"
    NOT_JUDGED = "not judged"


@dataclass(frozen=True)
class TestQuantity:
    """A quantity of a run, in SI; `unit` "%" marks a ratio that is shown in per cent."""

    name: str
    value: float | None  # None: not defined for this run
    unit: str
    reading: str = ""  # our reading of the standard


@dataclass(frozen=True)
class CriterionResult:
    """The verdict on a criterion, and the reason."""

    verdict: Verdict
    why: str

    def __str__(self) -> str:
        return f"{self.verdict.value}. {self.why}"


class NotJudged(Exception):
    """Raised when a run cannot be judged; the message is the reason."""


@dataclass
class Evaluation:
    """The evaluation of one run: its quantities and criteria."""

    label: str
    quantities: dict[str, TestQuantity] = field(default_factory=dict)  # key -> quantity
    rulings: dict[str, CriterionResult] = field(default_factory=dict)  # by criterion
    notes: list[str] = field(default_factory=list)

    def add(self, key: str, name: str, value: float | None, unit: str, reading: str = "") -> None:
        """Add a quantity."""
        self.quantities[key] = TestQuantity(name, None if value is None else float(value), unit, reading)

    def rule(self, criterion: str, holds: bool | None, why: str) -> None:
        """Add the verdict on a criterion; `holds` None: not judged."""
        verdict = Verdict.NOT_JUDGED if holds is None else Verdict.PASSED if holds else Verdict.FAILED
        self.rulings[criterion] = CriterionResult(verdict, why)

    def __getitem__(self, key: str) -> float | None:
        found = self.quantities.get(key)
        return found.value if found else None

    @property
    def verdict(self) -> Verdict | None:
        """The verdict over all criteria, None if the test has none."""
        return overall(ruling.verdict for ruling in self.rulings.values())

    @property
    def judges_nothing(self) -> bool:
        """Whether no criterion is judged or, in a test without criteria, no quantity has a value."""
        if self.rulings:
            return all(one.verdict is Verdict.NOT_JUDGED for one in self.rulings.values())
        return all(one.value is None for one in self.quantities.values())

    def as_data(self) -> dict[str, Any]:
        """Return the evaluation as plain data for files, in SI units."""
        return {
            "label": self.label,
            "verdict": self.verdict,
            "quantities": {key: asdict(one) | {"unit": si(one.unit)} for key, one in self.quantities.items()},
            "criteria": {name: asdict(one) for name, one in self.rulings.items()},
            "notes": self.notes,
        }


def evaluation(
    fill: Callable[Concatenate[Evaluation, Trace, P], None],
) -> Callable[Concatenate[Trace, P], Evaluation]:
    """Make a function that fills in an `Evaluation` create and return it; NotJudged becomes a note.

    All such functions raise ResultsError if the trace lacks a signal that the test needs.
    """

    @wraps(fill)
    def evaluate(trace: Trace, /, *args: P.args, **kwargs: P.kwargs) -> Evaluation:
        judged = Evaluation(trace.label)
        try:
            fill(judged, trace, *args, **kwargs)
        except NotJudged as why:
            judged.notes.append(str(why))
        return judged

    return evaluate


@dataclass
class TestSeries:
    """The evaluation of all runs of a test together."""

    runs: list[Evaluation]  # in their order
    summary: str  # in a sentence
    found: dict[str, Any]  # plain data, for files
    rulings: dict[str, CriterionResult] = field(default_factory=dict)


@dataclass(frozen=True)
class SeriesRun:
    """A run that a standard test asks for: a variation of its scenario."""

    folder: str  # below that of the series
    label: str
    values: Mapping[str, Value]  # target of an override -> value
    origin: str  # of these overrides, for records
    partly: bool = True  # whether it is judged, as far as it goes, if it fails


class SeriesDriver(Protocol):
    """What the series of a standard test is driven with."""

    angle: float | None  # A [rad], of tests that need it
    judged: list[Evaluation]  # of all runs so far

    @property
    def speed(self) -> float:
        """Speed of the scenario [m/s], above 0."""

    @property
    def duration(self) -> float:
        """Duration of the scenario [s]."""

    def make(self, runs: Sequence[SeriesRun]) -> list[Evaluation]:
        """Make runs that have no results yet; return the evaluations of those that can be judged."""

    def search_highest(
        self,
        passes: Callable[[float], bool],
        *,
        first: float,
        step: float,
        resolution: float,
        least: float,
        most: float,
    ) -> None:
        """Search the highest value that passes: from `first` in steps, then by bisection."""  # fmt: skip


def overall(verdicts: Iterable[Verdict]) -> Verdict | None:
    """Return the worst verdict: failed, then not judged, then passed; None if there are none."""
    found = set(verdicts)
    for verdict in (Verdict.FAILED, Verdict.NOT_JUDGED, Verdict.PASSED):
        if verdict in found:
            return verdict
    return None

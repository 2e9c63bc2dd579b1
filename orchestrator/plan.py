"""A run as plain data (`Plan`): the result of wiring and the input of the master."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Final, Generic, Literal, TypeVar

if TYPE_CHECKING:
    import numpy as np

from yawbench.fmus.fmu import Causality, Fmu, Value
from yawbench.foundation.errors import Diagnostic, Location
from yawbench.foundation.messages import cut
from yawbench.vocabulary.roles import role_of

from .fault_kinds import FaultList, FaultySignal
from .scenario.quantities import number_and_unit
from .signal_names import SignalName, Target

OverrideOrigin = Literal[
    "--set", "--swap", "--fault", "--vehicle", "--controller", "set", "swap", "fault",
    "study", "sweep", "ranking", "region", "fit", "converge", "second-opinion", "standard test",
]  # fmt: skip
"""Maker of an override: an option, a method of the library, a file of many runs, a command or a test."""
OriginKind = Literal["default", "vehicle", "derived", "scenario", "file"] | OverrideOrigin
"""Kind of a value's origin: its FMU, the vehicle file, a formula, the scenario, a file, or an override."""
OF_FILES: tuple[OriginKind, ...] = "default", "vehicle", "derived", "scenario", "file"
"""Kinds of origins that are not overrides."""
SourceKind = Literal["paper", "literature", "chosen", "erratum", "varied", "neutral"]
"""Kind of a source: "varied" is an override, "neutral" has no source of its own."""
PARAMETERS: tuple[Causality, ...] = "parameter", "structuralParameter"
"""Causalities of what a scenario lists under `parameters`."""
SENSING = {"sensor": "measurement", "estimator": "estimate"}
"""Role of an instance -> kind of values that its outputs are, as opposed to the truth."""


@dataclass(frozen=True, eq=False)
class InputSeries:
    """Values of an input over time, from a file."""

    file: str  # as the scenario names it
    column: str
    sha256: str  # of the file
    held: bool  # each value holds until the next; else interpolated linearly
    times: np.ndarray  # shape (n,) [s], increasing
    values: np.ndarray  # shape (n,), in the input's unit

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return the values at some times [s]; the first and the last value extend beyond the ends."""
        import numpy as np

        if not self.held:
            values: np.ndarray = np.interp(times, self.times, self.values)
            return values
        indices = np.searchsorted(self.times, times, side="right") - 1
        return self.values[np.clip(indices, 0, None)]

    def first(self, time: float) -> Value:
        """Return the value at the start time [s] of a run."""
        import numpy as np

        value: Value = self.at(np.array([time])).tolist()[0]
        return value


PAPER: Final = "paper"
LITERATURE: Final = "literature"
CHOSEN: Final = "chosen"
ERRATUM: Final = "erratum"
VARIED: Final = "varied"
NEUTRAL: Final = "neutral"
STATED: tuple[SourceKind, ...] = PAPER, ERRATUM, CHOSEN
"""Kinds that a source in words begins with."""


@dataclass(frozen=True)
class ValueSource:
    """The source of a value: its kind, the source in words, and the file and line that give the value."""

    kind: SourceKind
    says: str = ""
    file: str = ""
    line: int = 0

    @classmethod
    def parse(cls, text: str, otherwise: SourceKind | None = None) -> ValueSource:
        """Return the source with this text, whose first word may be the kind, which else is `otherwise`."""
        return cls(_first_word(text) or otherwise or (LITERATURE if text else NEUTRAL), text)

    @classmethod
    def of_comment(cls, comment: str, file_source: str) -> ValueSource:
        """Return the source in a comment, "its unit, remarks; source", in a file with a source."""
        parts = comment.split("; ")
        begin = next((i for i, part in enumerate(parts) if _first_word(part)), 0)
        return cls.parse("; ".join(parts[begin:]), _first_word(file_source) or NEUTRAL)


def _first_word(source: str) -> SourceKind | None:
    word = re.match(r"[a-z]*", source)
    return next((kind for kind in STATED if word and word[0] == kind), None)


@dataclass(frozen=True)
class ValueOrigin:
    """Origin of the value of a parameter or constant."""

    kind: OriginKind
    detail: str = ""  # the formula of a derived value, the name of a file
    source: ValueSource | None = field(default=None, compare=False)  # None: the FMU's default

    @classmethod
    def derived(cls, formula: str) -> ValueOrigin:
        """Return the origin of a value that follows from others."""
        return cls("derived", formula, ValueSource(NEUTRAL, f"derived: {formula}"))

    def __str__(self) -> str:
        if self.kind == "file":
            return self.detail
        return f"{self.kind}: {self.detail}" if self.detail else self.kind


DEFAULT = ValueOrigin("default")
NOWHERE = Location()
T = TypeVar("T", covariant=True)


@dataclass(frozen=True)
class Given(Generic[T]):
    """A value as it was given: in a file, by an override, or by an FMU.

    It is made where the value is read, once, and goes from there to the plan.
    """

    value: T
    """As written: a number in SI, text that may name a unit ("90 km/h"), or the name of a file with it."""
    origin: ValueOrigin = DEFAULT
    where: Location = NOWHERE
    """For messages about it."""
    replaces: Given[T] | None = None
    """The value of the file that an override replaces; of a vehicle file like another one, that of the
    latter, with the value None if it gives none."""

    @property
    def unit(self) -> str:
        """The unit that the value names, "" if it is a plain number or not a quantity."""
        written = number_and_unit(self.value) if isinstance(self.value, str) else None
        return written[1] if written else ""

    @property
    def changed(self) -> bool:
        """Whether an override gave it."""
        return self.origin.kind not in OF_FILES


@dataclass(frozen=True)
class Instance:
    """One instance of an FMU in a scenario."""

    name: str
    fmu: Fmu
    period: int  # in communication steps
    parameters: dict[str, Value]
    constants: dict[str, Value]  # inputs that no wire drives; of those with a series, the first value
    given: dict[str, Given[Any]] = field(default_factory=dict)
    """Parameter or constant -> its value as it was given, with its origin."""
    tolerance: float | None = None
    """Relative tolerance of the FMU's solver; None: that of its default experiment, if it has one."""
    series: dict[str, InputSeries] = field(default_factory=dict)
    """Input -> the time series that it follows."""

    @property
    def role(self) -> str:
        """Role of the instance: "driver", "controller", "plant", ... (see `vocabulary.roles`)."""
        return role_of(self.name, self.fmu.name, self.fmu.role)

    def parameter(self, name: str) -> Value | None:
        """Return the value of a parameter, by default the FMU's start value; None if there is none."""
        variable = self.fmu.variables.get(name)
        return None if variable is None else self.parameters.get(name, variable.start)

    def origin(self, name: str) -> ValueOrigin:
        """Return where the value of a parameter or constant comes from."""
        return self.given[name].origin if name in self.given else DEFAULT


@dataclass(frozen=True)
class Wire:
    """A scalar connection from an output to an input."""

    source: str  # instance
    output: str  # variable
    target: str  # instance
    input: str  # variable
    gain: float = 1.0  # the input is gain * output + offset
    offset: float = 0.0
    delayed: bool = False  # by one communication step

    @property
    def converts(self) -> bool:
        """Whether the wire changes the number."""
        return (self.gain, self.offset) != (1.0, 0.0)


@dataclass(frozen=True)
class Override:
    """A value that replaces one of the scenario file.

    >>> [(str(one.target), one.value, one.origin) for one in base.set({"stop_time": 2}).changes]
    [('stop_time', 2, 'set')]
    """

    target: Target
    value: Value | FaultList
    origin: OverrideOrigin

    @classmethod
    def of(cls, target: str, value: Value | FaultList, origin: OverrideOrigin) -> Override:
        """Return the override of a target in text form.

        Raises:
            ValueError: the text is not a target.
        """
        return cls(Target.parse(target), value, origin)

    @property
    def plain(self) -> Value:
        """The value as in names and records, with faults as text."""
        return str(self.value) if isinstance(self.value, FaultList) else self.value

    @property
    def record(self) -> dict[str, Value]:
        """The override as in records of runs."""
        return {"place": str(self.target), "value": self.plain, "origin": self.origin}

    @property
    def faults(self) -> FaultList:
        """The faults that it sets, none if its target is something else."""
        return self.value if isinstance(self.value, FaultList) else FaultList()

    @property
    def swaps(self) -> bool:
        """Whether it replaces the FMU of an instance."""
        return self.target.kind == "fmu"

    @property
    def faulty(self) -> str | None:
        """The location whose faults it sets, None if its target is something else."""
        return self.target.variable if self.target.kind == "faults" else None

    def __str__(self) -> str:
        value = str(self.value).lower() if isinstance(self.value, bool) else str(self.value)
        if self.faulty:
            return f"{self.origin} {cut(self.faulty)}: {cut(value)}"
        return f"{self.origin} {cut(str(self.target))}={cut(value)}"


@dataclass(frozen=True)
class Plan:
    """A run to be executed: instances in evaluation order, wires, and the time grid in integers.

    >>> plan = base.plan()
    >>> float(plan.step), plan.n_steps, plan.instances[0].name
    (0.001, 2500, 'driver')
    """

    instances: tuple[Instance, ...]
    wires: tuple[Wire, ...]
    record: tuple[SignalName, ...]  # in column order
    step: Fraction  # communication step size [s]
    n_steps: int
    algorithm: str  # of `coupling_algorithms.ALGORITHMS`
    start: Fraction = Fraction(0)  # time of communication point 0 [s]
    title: str = ""
    scenario: dict[str, Any] = field(default_factory=dict)  # as run, for run.json
    changes: tuple[Override, ...] = ()  # of the scenario file
    diagnostics: tuple[Diagnostic, ...] = ()  # what was left out or assumed, and warnings about values
    faults: tuple[FaultySignal, ...] = ()  # those of one variable in the order in which they act

    def time(self, k: int) -> float:
        """Return the time [s] of communication point `k`, correctly rounded."""
        return float(self.start + k * self.step)

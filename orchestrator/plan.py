"""A run as plain data (`Plan`): the result of wiring and the input of the master."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

if TYPE_CHECKING:
    import numpy as np

from vocabulary.roles import role_of

from .errors import Diagnostic
from .fault_kinds import FaultList, FaultySignal
from .messages import cut
from .signal_names import SignalName, Target

Causality = Literal[
    "parameter", "input", "output", "local", "independent", "calculatedParameter", "structuralParameter"
]
"""Causality of a variable, as in FMI 2.0 and 3.0: parameter, input, output, ..."""
Variability = Literal["constant", "fixed", "tunable", "discrete", "continuous"]
"""Variability of a variable, as in FMI 2.0 and 3.0: the times at which its value may change."""
VariableType = Literal["Real", "Integer", "Boolean", "String", "Enumeration"]
"""Type of a variable, as in FMI 2.0; `Variable.encoding` has that of FMI 3.0."""
OverrideOrigin = Literal[
    "--set", "--swap", "--fault", "--vehicle", "--controller", "set", "swap", "fault",
    "study", "sweep", "ranking", "region", "fit", "converge", "second-opinion", "standard test",
]  # fmt: skip
"""Maker of an override: an option, a method of the library, a file of many runs, a command or a test."""
OriginKind = Literal["default", "vehicle", "derived", "scenario", "file"] | OverrideOrigin
"""Kind of a value's origin: its FMU, the vehicle file, a formula, the scenario, a file, or an override."""
SourceKind = Literal["paper", "literature", "chosen", "erratum", "varied", "neutral"]
"""Kind of a source: "varied" is an override, "neutral" has no source of its own."""
Value = float | int | bool | str
"""Value of a variable, a parameter or an override."""
SENSING = {"sensor": "measurement", "estimator": "estimate"}
"""Role of an instance -> kind of values that its outputs are, as opposed to the truth."""


def integer_limits(kind: str) -> tuple[int, int]:
    """Return the smallest and the largest number of an integer type of FMI 3.0, such as "UInt8"."""
    bits = int(kind.partition("Int")[2])
    return (0, 2**bits - 1) if kind.startswith("U") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


class ValueRef(NamedTuple):
    """Reference to a scalar value in an FMU."""

    type: str  # as in the names of the FMI functions that set and get it: "Real", "Float64", ...
    reference: int
    element: int = 0  # of an array, counted row by row
    elements: int = 1  # of the whole array


@dataclass(frozen=True)
class UnitDefinition:
    """An FMU's definition of a unit of measurement: `factor * value + offset` in base units."""

    powers: tuple[int, ...]  # of kg, m, s, A, K, mol, cd, rad
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Variable:
    """A scalar variable of an FMU, from its model description."""

    name: str
    reference: int
    type: VariableType
    causality: Causality
    variability: Variability
    unit: str | None
    start: Value | None
    minimum: float | None
    maximum: float | None
    description: str
    depends_on: tuple[str, ...] | None = None  # of an output: inputs with feedthrough; None: not declared
    choices: tuple[str, ...] | None = None  # of a String: allowed values, if the description lists them
    items: dict[str, int] | None = None  # of an Enumeration: name -> value
    optional: bool = False  # of an input: its start value may be used if nothing drives it
    source: str = ""  # of a parameter: where its start value comes from, if the FMU says so
    definition: UnitDefinition | None = None  # of `unit`, if the description gives one
    encoding: str | None = None  # FMI 3.0: the type in the FMU, such as "Float32"
    element: int = 0  # of an array, counted row by row
    elements: int = 1  # of the whole array
    alias_of: str | None = None  # of an input: the input of which this is another name (FMI 3.0)
    relative: bool = False  # a difference (`relativeQuantity`): offsets of units do not apply to it

    @cached_property
    def ref(self) -> ValueRef:
        """Its reference in the FMU. The functions of FMI 2.0 treat an enumeration as an Integer."""
        kind = self.encoding or {"Enumeration": "Integer"}.get(self.type, self.type)
        return ValueRef(kind, self.reference, self.element, self.elements)

    @property
    def discrete(self) -> bool:
        """Whether the value is constant between two communication points."""
        return self.type != "Real" or self.variability != "continuous"

    def follows(self, input_name: str) -> bool:
        """Return whether this output may depend on the input at the same instant (direct feedthrough)."""
        return self.depends_on is None or input_name in self.depends_on


@dataclass(frozen=True)
class BuildInfo:
    """Build of an FMU by this program."""

    source: str  # path: of a component from the folder above components/, else from the FMU's folder
    key: str  # hash of the sources and of everything else that determines the FMU's bytes
    tool: str
    current: bool  # whether building it now would give the same FMU


@dataclass(frozen=True)
class RunsAs:
    """Execution of a component in Python: as native code or not, and the reason if it is not."""

    why: str = ""  # it runs in Python; "" if native
    untried: tuple[str, ...] = ()  # files and lines of branches that were never compared with Python

    @property
    def note(self) -> str:
        """A sentence on the branches that were never compared with Python, "" if there are none."""
        lines: dict[str, list[str]] = {}
        for place in self.untried:
            file, _, line = place.rpartition(":")
            lines.setdefault(file, []).append(line)
        places = ", ".join(f"{file}:{', '.join(sorted(some, key=int))}" for file, some in lines.items())
        text = "natively it ends with an error in branches that were never compared with Python"
        return f"{text} ({places})" if places else ""

    @property
    def native(self) -> bool:
        """Whether it was translated to native code, which runs here."""
        return not self.why

    def __str__(self) -> str:
        return f"Python: {self.why}" if self.why else "native"


@dataclass(frozen=True)
class Fmu:
    """An FMU unpacked in the cache."""

    name: str
    path: Path  # the archive
    directory: Path  # the unpacked archive
    sha256: str  # of the archive
    guid: str
    model_identifier: str
    generation_tool: str
    variables: dict[str, Variable]
    description: str = ""
    role: str = ""  # if the model description declares it, as FMUs built by this program do
    once_per_process: bool = False
    fmi: int = 2  # major version of the standard
    host_packages: tuple[str, ...] = ()  # Python packages that the host process must have
    built: BuildInfo | None = None  # None: built elsewhere, or not examined
    python_modules: dict[str, str] = field(default_factory=dict)
    """Modules of a PythonFMU: top-level module in resources/ -> hash of its content."""
    refused: dict[str, str] = field(default_factory=dict)
    """Variable that cannot be used -> reason."""
    violations: tuple[Diagnostic, ...] = ()
    """Violations of the standard in the model description, as warnings."""
    lacking: tuple[str, ...] = ()
    """Functions of the standard that the library does not export."""
    tolerance: float | None = None
    """Relative tolerance of the default experiment."""
    fixed_step: float | None = None
    """Step that it declares to be made for [s], None if it takes any."""
    takes_multiples: bool = False
    """Whether it takes multiples of `fixed_step` too, as its internal step."""
    runs_as: RunsAs | None = None
    """Execution of plain Python, which has no archive that says it."""
    needs_tool: bool = False
    """Whether it needs the tool that exported it (`needsExecutionTool`)."""

    @property
    def compiled(self) -> bool:
        """Whether the FMU is not written in Python, so that fewer checks and messages are possible."""
        return not self.python_modules

    def of(self, causality: str) -> list[Variable]:
        """Return the variables of a causality, in the order of the FMU, without aliases of inputs."""
        return self._by_causality.get(causality, [])

    @cached_property
    def _by_causality(self) -> dict[str, list[Variable]]:
        variables: dict[str, list[Variable]] = {}
        for variable in self.variables.values():
            if variable.alias_of is None:
                variables.setdefault(variable.causality, []).append(variable)
        return variables

    def aliases(self) -> dict[str, str]:
        """Return other name -> name of the inputs that have several."""
        return {v.name: v.alias_of for v in self.variables.values() if v.alias_of is not None}


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


@dataclass(frozen=True)
class Instance:
    """One instance of an FMU in a scenario."""

    name: str
    fmu: Fmu
    period: int  # in communication steps
    parameters: dict[str, Value]
    constants: dict[str, Value]  # inputs that no wire drives; of those with a series, the first value
    origins: dict[str, ValueOrigin] = field(default_factory=dict)
    """Parameter or constant -> where its value comes from."""
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


Override.__module__ = "yawbench"  # where users import it from


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


Plan.__module__ = "yawbench"  # where users import it from

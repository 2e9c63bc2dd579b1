"""The run as plain data: what wiring hands to the master."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

if TYPE_CHECKING:
    import numpy as np

from .messages import cut

Value = float | int | bool | str
OF_RUN = ("start_time", "stop_time", "step_size", "algorithm")
"""What a change gives without naming a unit."""
FACTS = ("friction", "speed")
"""What one change tells all units that have to know it (see `wiring.shared_facts`)."""
TYRES = "tyres"
"""What names the tyre property files, of both axles or as `tyres.front`, `tyres.rear` of one."""
FAULTS = "faults"
"""What a change of the faults at a place begins with: `faults.sensor.yaw_rate`."""
FAULT_WORDS = ("share", "every", "seed", "from", "until")
"""What stands in the line of a fault with its name before it."""
NO_FAULTS = "none"
"""The line for a place that is to have no faults."""
SENSING = {"sensor": "measurement", "estimator": "estimate"}
"""Role of a unit -> what its outputs are, of what the car does."""
Algorithm = Literal["jacobi", "gauss_seidel", "extrapolated"]


class ValueRef(NamedTuple):
    """Where an FMU keeps a scalar value."""

    type: str  # in the names of the functions that set and get it: "Real", "Float64", ...
    reference: int
    element: int = 0  # of an array, counted row by row
    elements: int = 1  # of the whole array


@dataclass(frozen=True)
class UnitDefinition:
    """What an FMU says that a unit of measurement is: `factor * value + offset` in base units."""

    powers: tuple[int, ...]  # of kg, m, s, A, K, mol, cd, rad
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Variable:
    """A scalar variable of an FMU, from its model description."""

    name: str
    reference: int
    type: str  # "Real", "Integer", "Boolean", "String" or "Enumeration"
    causality: str
    variability: str
    unit: str | None
    start: Value | None
    minimum: float | None
    maximum: float | None
    description: str
    depends_on: tuple[str, ...] | None = None  # of an output: inputs it follows directly; None: not said
    choices: tuple[str, ...] | None = None  # of a String: allowed values, if the description lists them
    items: dict[str, int] | None = None  # of an Enumeration: name -> value
    optional: bool = False  # of an input: its start value is meant for when nothing drives it
    source: str = ""  # of a parameter: where its start value comes from, if the FMU says so
    definition: UnitDefinition | None = None  # of `unit`, if the description gives one
    encoding: str | None = None  # FMI 3.0: the type that the FMU keeps it in, such as "Float32"
    element: int = 0  # of an array, counted row by row
    elements: int = 1  # of the whole array

    @property
    def place(self) -> ValueRef:
        """Where the FMU keeps it. To the functions of FMI 2.0 an enumeration is an Integer."""
        kind = self.encoding or {"Enumeration": "Integer"}.get(self.type, self.type)
        return ValueRef(kind, self.reference, self.element, self.elements)

    @property
    def discrete(self) -> bool:
        """True for a value that holds between two communication points."""
        return self.type != "Real" or self.variability != "continuous"

    def follows(self, input_name: str) -> bool:
        """Return whether this output may follow the input at the same instant."""
        return self.depends_on is None or input_name in self.depends_on


@dataclass(frozen=True)
class BuildInfo:
    """What an FMU was built from here."""

    source: str  # of a component: from the folder above components/; else: from the FMU's folder
    key: str  # of the sources and of all else that decided what the FMU's bytes are
    tool: str
    current: bool  # whether it would come out the same if it were built now


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
    once_per_process: bool = False
    fmi: int = 2  # major version of the standard
    host_packages: tuple[str, ...] = ()  # what the Python that runs it must have
    built: BuildInfo | None = None  # None: elsewhere, or nobody has looked
    python_modules: dict[str, str] = field(default_factory=dict)
    """Of a PythonFMU unit: top-level module in resources/ -> hash of its content."""
    refused: dict[str, str] = field(default_factory=dict)
    """Variable that cannot be used -> why."""
    flaws: tuple[str, ...] = ()
    """What is formally wrong with the model description."""
    lacking: tuple[str, ...] = ()
    """Functions of the standard that the library does not have."""
    tolerance: float | None = None
    """Relative tolerance of the default experiment."""
    needs_tool: bool = False
    """Whether it needs the tool that made it."""

    @property
    def compiled(self) -> bool:
        """True for an FMU that is not written in Python, where the bench has less to say."""
        return not self.python_modules

    def doubts(self) -> list[str]:
        """Return a sentence for everything that is formally wrong with the model description."""
        return [f"the model description is not valid FMI {self.fmi}.0: {flaw}" for flaw in self.flaws]

    def of(self, causality: str) -> list[Variable]:
        """Return the variables of one causality, in the order of the model description."""
        return [v for v in self.variables.values() if v.causality == causality]


@dataclass(frozen=True, eq=False)
class InputSeries:
    """Values of an input over time, from a file."""

    file: str  # as the scenario names it
    column: str
    sha256: str  # of the file
    held: bool  # each value holds until the next; else they are joined by straight lines
    times: np.ndarray  # shape (n,) [s], increasing
    values: np.ndarray  # shape (n,), in the input's unit

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return the values at some times [s]; before the first and after the last, these hold."""
        import numpy as np

        if not self.held:
            return np.interp(times, self.times, self.values)
        found = np.searchsorted(self.times, times, side="right") - 1
        return self.values[np.clip(found, 0, None)]

    def first(self, time: float) -> Value:
        """Return the value at the time [s] at which a run begins."""
        import numpy as np

        return self.at(np.array([time])).tolist()[0]


class ValueOrigin(NamedTuple):
    """Where the value of a parameter or constant comes from."""

    kind: (
        str  # "default" (of the FMU), "vehicle", "derived", "scenario", "file", or that of a change: "--set"
    )
    detail: str = ""  # of what is derived from the vehicle file its formula, of a file its name

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
    constants: dict[str, Value]  # inputs that no unit drives; of those with a series, the first value
    origins: dict[str, ValueOrigin] = field(default_factory=dict)
    """Parameter or constant -> where its value comes from."""
    tolerance: float | None = None
    """Relative, of the FMU's own solver; None: that of its default experiment, if it has one."""
    series: dict[str, InputSeries] = field(default_factory=dict)
    """Inputs that follow a time series."""

    def parameter(self, name: str) -> Value | None:
        """Return the value of a parameter, as given or the FMU's own; None without one of the name."""
        variable = self.fmu.variables.get(name)
        return None if variable is None else self.parameters.get(name, variable.start)


@dataclass(frozen=True)
class Wire:
    """One scalar connection."""

    source: str  # unit
    output: str  # variable
    target: str  # unit
    input: str  # variable
    gain: float = 1.0  # the input is gain * output + offset
    offset: float = 0.0

    @property
    def converts(self) -> bool:
        """True if the input's number is not that of the output."""
        return (self.gain, self.offset) != (1.0, 0.0)


@dataclass(frozen=True)
class Fault:
    """What goes wrong with a signal: with an output for all who take it, or with an input alone."""

    instance: str
    variable: str
    of_output: bool
    kind: str  # see `scenario.fault_schema.KINDS`
    value: float | None = None  # in the variable's unit, or as the kind has it
    begin: float = -math.inf  # [s]
    end: float = math.inf  # [s], no longer faulty then
    share: float = 0.0  # of the messages
    every: float = 0.0  # time from one message to the next [s]
    stream: int = 0  # of random numbers, below 2**64
    place: str = ""  # as written: "plant.yaw_rate -> sensor"
    says: str = ""  # likewise: "freeze from 2 s"


class FaultList(tuple[Mapping[str, Value], ...]):
    """What goes wrong at one place, one after the other: each as a file has it, without the place."""

    __slots__ = ()

    def __str__(self) -> str:
        """In one line, as `--fault` takes it behind the place."""
        return "; ".join(map(fault_line, self)) or NO_FAULTS


def fault_line(fault: Mapping[str, Value]) -> str:
    """Return a fault as a file has it in one line: kind, value, then what stands with its name before it."""
    named = [f"{name} {_said(fault[name], name)}" for name in FAULT_WORDS if name in fault]
    return " ".join([str(fault["kind"]), *([_said(fault["value"])] if "value" in fault else []), *named])


def _said(value: Value, name: str = "") -> str:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return str(value)
    return f"{value:.10g}" + (" s" if name in ("every", "from", "until") else "")


@dataclass(frozen=True)
class Override:
    """One thing that is other than in the scenario file."""

    place: str  # as in --set: "plant.mass", "inputs.friction*", "stop_time"; a unit or "vehicle" for its file
    value: Value | FaultList
    origin: str  # "--set", "--swap", "study", "sweep", ...

    @property
    def plain(self) -> Value:
        """The value as names and records have it: faults in a line."""
        return str(self.value) if isinstance(self.value, FaultList) else self.value

    @property
    def names_file(self) -> bool:
        """Whether the value is a file."""
        return self.swaps or self.place.partition(".")[0] == TYRES or self.place == "vehicle"

    @property
    def swaps(self) -> bool:
        """Whether the FMU of a unit was replaced."""
        return "." not in self.place and self.place not in (*OF_RUN, "vehicle", TYRES, *FACTS)

    @property
    def faulty(self) -> str | None:
        """Where it puts faults, None if it changes something else."""
        holder, _, place = self.place.partition(".")
        return place if holder == FAULTS and place else None

    def __str__(self) -> str:
        value = str(self.value).lower() if isinstance(self.value, bool) else str(self.value)
        if self.faulty:
            return f"{self.origin} {cut(self.faulty)}: {cut(value)}"
        return f"{self.origin} {cut(self.place)}={cut(value)}"


@dataclass(frozen=True)
class Finding:
    """A remark, as data, on what is no mistake but hardly meant: on given values, or on a run's course."""

    kind: str  # "spin", "two values", ...
    place: str | None = None  # unit.variable
    value: float | None = None  # the value furthest off
    time: float | None = None  # when it began [s]; None: before the run
    says: str = ""  # in a sentence


@dataclass(frozen=True)
class Plan:
    """Units in evaluation order, wires, and the time grid in integers."""

    instances: tuple[Instance, ...]
    wires: tuple[Wire, ...]
    record: tuple[tuple[str, str], ...]  # (unit, output) in column order
    step: Fraction  # communication step size [s]
    n_steps: int
    algorithm: Algorithm
    start: Fraction = Fraction(0)  # time of communication point 0 [s]
    title: str = ""
    scenario: dict = field(default_factory=dict)  # as run, for run.json
    notes: tuple[str, ...] = ()  # worth telling the user, but no error
    changes: tuple[Override, ...] = ()  # against the scenario file
    findings: tuple[Finding, ...] = ()  # on given values
    faults: tuple[Fault, ...] = ()  # those of one variable in the order in which they act

    def time(self, k: int) -> float:
        """Return the time [s] of communication point `k`, correctly rounded."""
        return float(self.start + k * self.step)

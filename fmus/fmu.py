"""An FMU as plain data: its variables and units of measurement, who built it, how it runs."""

from __future__ import annotations

import itertools
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Literal, NamedTuple

from yawbench.foundation.errors import Diagnostic
from yawbench.foundation.sent_once import SentOnce

Causality = Literal[
    "parameter", "input", "output", "local", "independent", "calculatedParameter", "structuralParameter"
]
"""Causality of a variable, as in FMI 2.0 and 3.0: parameter, input, output, ..."""
Variability = Literal["constant", "fixed", "tunable", "discrete", "continuous"]
"""Variability of a variable, as in FMI 2.0 and 3.0: the times at which its value may change."""
VariableType = Literal["Real", "Integer", "Boolean", "String", "Enumeration"]
"""Type of a variable, as in FMI 2.0; `Variable.encoding` has that of FMI 3.0."""
Value = float | int | bool | str
"""Value of a variable, a parameter or an override."""


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
    items: dict[str, int] | None = (
        None  # of an Enumeration, and of a text that is one in the FMU: name -> value
    )
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
        kind = self.encoding or ("Integer" if self.items is not None else self.type)
        return ValueRef(kind, self.reference, self.element, self.elements)

    @property
    def array(self) -> str:
        """Name of the array of which it is an element; of a scalar, its own."""
        return self.name.rpartition("[")[0] if self.elements > 1 else self.name

    @property
    def fmi_type(self) -> str:
        """Its type in the FMU, by the names of FMI 2.0: choices of this project's units are Enumerations."""
        return "Enumeration" if self.items is not None else self.type

    def encoded(self, value: Value) -> Value:
        """Return a value as the FMU's functions take it."""
        return self.items[value] if isinstance(value, str) and self.items is not None else value

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
        text = "its native code has branches that were never compared with Python"
        return f"{text} ({places})" if places else ""

    @property
    def native(self) -> bool:
        """Whether it was translated to native code, which runs here."""
        return not self.why

    def __str__(self) -> str:
        return f"Python: {self.why}" if self.why else "native"


@dataclass(frozen=True)
class Fmu(SentOnce):
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

    def elements_of(self, name: str, causality: str) -> list[Variable]:
        """Return the elements of an array of a causality, row by row; none if there is no such array."""
        if name in self.variables:
            return []
        found = (v for v in self.variables.values() if v.array == name and v.causality == causality)
        return [self.variables[v.alias_of or v.name] for v in found]

    def driven(self, names: Collection[str]) -> Fmu:
        """Return the FMU with these parameters as inputs, since they change during a run."""
        variables = {
            name: replace(v, causality="input") if name in names else v for name, v in self.variables.items()
        }
        return replace(self, variables=variables)

    def aliases(self) -> dict[str, str]:
        """Return other name -> name of the inputs that have several."""
        return {v.name: v.alias_of for v in self.variables.values() if v.alias_of is not None}


def is_path(fmu: str) -> bool:
    """Return whether `fmu` is the path of an archive rather than a name in the folder of FMUs."""
    return fmu.lower().endswith(".fmu") or "/" in fmu or "\\" in fmu


def element_names(name: str, shape: tuple[int, ...]) -> list[str]:
    """Return the names of an array's elements, row by row and counted from 1; for a scalar, its name."""
    if not shape:
        return [name]
    indices = itertools.product(*(range(1, n + 1) for n in shape))
    return [f"{name}[{','.join(map(str, index))}]" for index in indices]

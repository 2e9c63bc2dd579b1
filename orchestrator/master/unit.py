"""One FMU instance: loaded through fmpy, stepped without it.

fmpy loads the library, declares its functions and frees it again. Of its wrappers the stepping
loop uses nothing: a call is the raw C function with arguments that were made into C objects once
(0.26 us instead of 0.64 us with fmpy's declared types, more with its logging wrappers), on buffers
that belong to the master. Values are never copied in between.
"""

from __future__ import annotations

import ctypes
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

from ..errors import ModelDescriptionError, SimulationError
from ..fmu.binary import CORE, binary_problem
from ..plan import Place, Unit, Value
from ..wording import listed
from .log import ERROR, FATAL, OK, STATUS, WARNING, Log, known, unlisten
from .slave import Buffers, Calls, Experiment, Status


class FmuSlave(ABC):
    """What instances of all versions of FMI share. A `slave.Slave`."""

    prefix: ClassVar[str]
    """Of the names of the functions."""
    library: ClassVar[type]
    """fmpy's class that loads the library."""
    version: ClassVar[int]
    """Of FMI, the major one."""
    real: ClassVar[str]
    """The type in the names of the functions that exchange most values of a step."""
    c_types: ClassVar[dict[str, Any]]
    """Type in the names of the functions that set and get values -> C type."""

    def __init__(self, unit: Unit, log: Log, corrupted: set[Path]) -> None:
        """Load the library and instantiate.

        Args:
            corrupted: shared by all instances of a run: the FMUs of which one has returned Fatal.

        Raises:
            ModelDescriptionError: the FMU has no loadable library for this platform.
            SimulationError: the FMU refuses to be instantiated.
        """
        self.name = unit.name
        self._directory = unit.fmu.directory
        self._corrupted = corrupted
        self._component: int | None = None
        self._may_terminate = False
        self._freed = False
        self._worst = OK
        self._log = log
        self._listener = 0
        self._fmu = self._load(unit)
        self._library = self._fmu.dll
        if missing := [name for name in CORE[self.version] if not self._has(name)]:
            functions = listed(f"{self.prefix}{name}" for name in missing)
            self._fmu.freeLibrary()
            raise ModelDescriptionError(f"{unit.name}: {unit.fmu.path}: its library lacks {functions}")
        self._component = self._instantiate(unit)
        if self._component is None:
            self.free()
            said = log.errors(unit.name)
            reason = said[0].text if said else "it gave no reason"
            if unit.fmu.needs_tool:
                reason += f" (it says that it needs its tool: {unit.fmu.generation_tool or 'not named'})"
            raise SimulationError(
                f"{unit.name}: {unit.fmu.path} cannot be instantiated: {reason}", unit=unit.name, time=0.0
            )

    def _load(self, unit: Unit) -> Any:
        """Return fmpy's object of the library, which may lack functions."""
        here = os.getcwd()
        try:
            return _tolerant(self.library)(
                guid=unit.fmu.guid,
                modelIdentifier=unit.fmu.model_identifier,
                unzipDirectory=str(unit.fmu.directory),
                instanceName=unit.name,
            )
        except Exception as error:  # fmpy raises plain Exception here
            problem = binary_problem(unit.fmu) or f"its library cannot be loaded: {error}"
            raise ModelDescriptionError(f"{unit.name}: {unit.fmu.path}: {problem}") from None
        finally:
            os.chdir(here)  # fmpy goes to the library's folder and, if loading fails, stays there

    @abstractmethod
    def _instantiate(self, unit: Unit) -> int | None:
        """Return the instance; None if the FMU refuses."""

    @abstractmethod
    def _exchange(
        self, verb: str, places: Sequence[Place], values: Sequence[Any]
    ) -> tuple[Status, list[Any]]:
        """Set ("Set") or get ("Get") variables of one type; return status and values."""

    def _access(self, verb: str, places: Sequence[Place], values: Sequence[Any]) -> tuple[Status, list[Any]]:
        """Do the same if the library has the function for it."""
        name = verb + places[0].type
        if self._has(name):
            return self._exchange(verb, places, values)
        self._log.add(self.name, ERROR, "", f"the library lacks {self.prefix}{name}")
        return ERROR, [0] * len(places)

    def _has(self, name: str) -> bool:
        return hasattr(self._library, self.prefix + name)

    @abstractmethod
    def connect(self, buffers: Buffers) -> Calls: ...

    @abstractmethod
    def setup(self, experiment: Experiment) -> Status: ...

    @abstractmethod
    def enter(self) -> Status: ...

    @abstractmethod
    def ended(self) -> float | None: ...

    def _function(self, name: str) -> Callable[..., Any]:
        """Return a C function with declared argument types.

        Raises:
            AttributeError: the library lacks it.
        """
        return getattr(self._library, self.prefix + name)

    def _raw(self, name: str) -> Any:
        """Return a C function without declared argument types, for arguments that are C objects."""
        function = self._library[self.prefix + name]
        function.restype = ctypes.c_int
        return function

    def part(self, kind: str) -> str:
        return kind

    def put(self, places: Sequence[Place], values: Sequence[Value]) -> Status:
        given = [v.encode() if isinstance(v, str) else v for v in values]  # C text is in bytes
        return self.note(self._access("Set", places, given)[0])

    def fetch(self, places: Sequence[Place]) -> tuple[Status, list[Value]]:
        status, values = self.look(places)
        return self.note(status), values

    def look(self, places: Sequence[Place]) -> tuple[Status, list[Value]]:
        status, values = self._access("Get", places, ())
        kind = places[0].type
        if kind == "String":
            values = [(text or b"").decode("utf-8", errors="replace") for text in values]
        elif kind == "Boolean":
            values = [bool(value) for value in values]
        return (self.note(status) if status == FATAL else status), values

    def exit(self) -> Status:
        return self.note(self._function("ExitInitializationMode")(self._component))

    def note(self, status: Status) -> Status:
        status = known(status)
        self._worst = max(self._worst, status)
        if status >= FATAL:
            self._corrupted.add(self._directory)
        return status

    def free(self) -> None:
        component, self._component = self._component, None
        if self._freed or self._directory in self._corrupted:
            return  # after Fatal no function of any instance may be called (FMI 2.0.4, 2.1.3)
        self._freed = True
        if component is not None:
            if self._may_terminate and self._worst < ERROR and self._has("Terminate"):
                status = self.note(self._function("Terminate")(component))
                if status != OK:
                    self._log.add(self.name, WARNING, "", f"{self.prefix}Terminate returned {STATUS[status]}")
                if status >= FATAL:
                    return
            self._function("FreeInstance")(component)
        unlisten(self._listener)
        self._fmu.freeLibrary()


class _Passing:
    """A library as fmpy is to see it: to a function that is missing, declarations are lost."""

    def __init__(self, library: Any) -> None:
        self._library = library

    def __getattr__(self, name: str) -> Any:
        return getattr(self._library, name, None) or SimpleNamespace()


def _tolerant(library: type) -> type:
    """Return fmpy's class as one that also loads libraries that lack functions."""

    def load(self: Any) -> None:
        complete, self.dll = self.dll, _Passing(self.dll)
        library._loadFunctions(self)  # type: ignore[attr-defined]
        self.dll = complete

    return type(library.__name__, (library,), {"_loadFunctions": load})


def nothing_to_do() -> Status:
    """Be a call of a step that is not needed."""
    return OK

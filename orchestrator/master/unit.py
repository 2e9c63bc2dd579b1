"""One FMU instance: loaded through fmpy, stepped without it.

fmpy loads the library, declares its functions and frees it again. Of its wrappers the stepping
loop uses nothing: a call is the raw C function with arguments that were made into C objects once
(0.26 us instead of 0.64 us with fmpy's declared types, more with its logging wrappers), on buffers
that belong to the master. Values are never copied in between.
"""

from __future__ import annotations

import ctypes
import functools
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave, fmi2CoSimulation

from ..errors import ModelDescriptionError, SimulationError
from ..plan import Unit, Value
from .log import ERROR, FATAL, OK, STATUS, WARNING, Log, known, listen, unlisten

Status = int


class Calls(NamedTuple):
    """The calls of a communication step, each without arguments, returning an FMI status."""

    set: Callable[[], Status]
    step: Callable[[], Status]
    get: Callable[[], Status]


class Slave(Protocol):
    """What the master needs of an instance. Statuses are FMI's, never exceptions."""

    name: str

    def connect(
        self,
        inputs: np.ndarray,
        input_references: Sequence[int],
        outputs: np.ndarray,
        output_references: Sequence[int],
        time: ctypes.c_double,
        step: ctypes.c_double,
    ) -> Calls:
        """Return the calls that exchange Real values through the two arrays.

        `step` takes the instance from `time` [s] to `time` + `step` [s], both read at the call.
        """

    def part(self, kind: str) -> str:
        """Return which kind of call (set, step, get) has failed when one of `kind` did not return OK."""

    def put(self, kind: str, references: Sequence[int], values: Sequence[Value]) -> Status:
        """Set variables of one type."""

    def fetch(self, kind: str, references: Sequence[int]) -> tuple[Status, list[Value]]:
        """Return variables of one type."""

    def enter(self, stop_time: float) -> Status:
        """Set up the experiment from 0 to `stop_time` [s] and enter initialization mode."""

    def exit(self) -> Status:
        """Leave initialization mode."""

    def note(self, status: Status) -> Status:
        """Remember a status, which decides how the instance may be ended, and return it.

        A number that is no status comes back as UNKNOWN.
        """

    def free(self) -> None:
        """End the instance as its state allows. Once; further calls do nothing."""


class FmuSlave:
    """An instance of an FMI 2.0 co-simulation FMU."""

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
        fmu = unit.fmu
        here = os.getcwd()
        try:
            self._fmu = FMU2Slave(
                guid=fmu.guid,
                modelIdentifier=fmu.model_identifier,
                unzipDirectory=str(fmu.directory),
                instanceName=unit.name,
            )
        except Exception as error:  # fmpy raises plain Exception here
            raise ModelDescriptionError(_cannot_load(unit, error)) from None
        finally:
            os.chdir(here)  # fmpy goes to the library's folder and, if loading fails, stays there
        self._library = self._fmu.dll
        self._log = log
        self._callbacks = listen(log, unit.name)
        self._component = self._library.fmi2Instantiate(
            unit.name.encode(),
            fmi2CoSimulation,
            fmu.guid.encode(),
            Path(fmu.directory, "resources").absolute().as_uri().encode(),
            ctypes.byref(self._callbacks),
            False,
            True,  # PythonFMU passes on no message at all without
        )
        if self._component is None:
            self.free()
            said = log.errors(unit.name)
            reason = said[0].text if said else "it gave no reason"
            raise SimulationError(
                f"{unit.name}: {fmu.path} cannot be instantiated: {reason}", unit=unit.name, time=0.0
            )

    def connect(
        self,
        inputs: np.ndarray,
        input_references: Sequence[int],
        outputs: np.ndarray,
        output_references: Sequence[int],
        time: ctypes.c_double,
        step: ctypes.c_double,
    ) -> Calls:
        component = ctypes.c_void_p(self._component)
        return Calls(
            self._exchange("fmi2SetReal", component, input_references, inputs),
            functools.partial(self._raw("fmi2DoStep"), component, time, step, ctypes.c_int(1)),
            self._exchange("fmi2GetReal", component, output_references, outputs),
        )

    def _exchange(
        self, function: str, component: ctypes.c_void_p, references: Sequence[int], values: np.ndarray
    ) -> Callable[[], Status]:
        if not references:
            return _nothing_to_do
        numbers = (ctypes.c_uint * len(references))(*references)
        buffer = (ctypes.c_double * len(references)).from_buffer(values.data)
        return functools.partial(
            self._raw(function), component, numbers, ctypes.c_size_t(len(references)), buffer
        )

    def _raw(self, name: str) -> Any:
        """Return a C function without declared argument types, for arguments that are C objects."""
        function = self._library[name]
        function.restype = ctypes.c_int
        return function

    def part(self, kind: str) -> str:
        return kind

    def put(self, kind: str, references: Sequence[int], values: Sequence[Value]) -> Status:
        name, c_type = _TYPES[kind]
        given = [v.encode() if isinstance(v, str) else v for v in values]
        return self._call(f"fmi2Set{name}", references, (c_type * len(given))(*given))

    def fetch(self, kind: str, references: Sequence[int]) -> tuple[Status, list[Value]]:
        name, c_type = _TYPES[kind]
        buffer = (c_type * len(references))()
        status = self._call(f"fmi2Get{name}", references, buffer)
        values: list[Any] = list(buffer)
        if kind == "String":
            values = [(text or b"").decode("utf-8", errors="replace") for text in values]
        elif kind == "Boolean":
            values = [bool(value) for value in values]
        return status, values

    def _call(self, function: str, references: Sequence[int], buffer: Any) -> Status:
        numbers = (ctypes.c_uint * len(references))(*references)
        return self.note(getattr(self._library, function)(self._component, numbers, len(references), buffer))

    def enter(self, stop_time: float) -> Status:
        status = self.note(
            self._library.fmi2SetupExperiment(self._component, False, 0.0, 0.0, True, stop_time)
        )
        if status < ERROR:
            self._may_terminate = True
            status = max(status, self.note(self._library.fmi2EnterInitializationMode(self._component)))
        return status

    def exit(self) -> Status:
        return self.note(self._library.fmi2ExitInitializationMode(self._component))

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
            if self._may_terminate and self._worst < ERROR:
                status = self.note(self._library.fmi2Terminate(component))
                if status != OK:
                    self._log.add(self.name, WARNING, "", f"fmi2Terminate returned {STATUS[status]}")
                if status >= FATAL:
                    return
            self._library.fmi2FreeInstance(component)
        unlisten(self._callbacks)
        self._fmu.freeLibrary()


_TYPES: dict[str, tuple[str, Any]] = {
    "Real": ("Real", ctypes.c_double),
    "Integer": ("Integer", ctypes.c_int),
    "Enumeration": ("Integer", ctypes.c_int),
    "Boolean": ("Boolean", ctypes.c_int),
    "String": ("String", ctypes.c_char_p),
}
"""Type of a variable -> name in the FMI functions that set and get it, and its C type."""


def _nothing_to_do() -> Status:
    return OK


def _cannot_load(unit: Unit, error: Exception) -> str:
    platforms = sorted(p.name for p in Path(unit.fmu.directory, "binaries").glob("*") if p.is_dir())
    if fmpy.platform not in platforms:
        listed = ", ".join(platforms) or "none"
        return f"{unit.name}: {unit.fmu.path} has no binary for {fmpy.platform} (it has: {listed})."
    return f"{unit.name}: {unit.fmu.path}: its library cannot be loaded: {error}"

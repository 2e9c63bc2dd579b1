"""Instances of FMI 2.0 co-simulation."""

from __future__ import annotations

import ctypes
import functools
import math
from collections.abc import Callable
from pathlib import Path

from fmpy import calloc, free
from fmpy.fmi2 import (
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2CoSimulation,
    fmi2LastSuccessfulTime,
    fmi2Terminated,
)

from ..plan import Unit
from .log import OK, listen, receive
from .slave import Experiment, Status
from .unit import FmuSlave


class Fmi2Slave(FmuSlave):
    """An instance of an FMI 2.0 co-simulation FMU."""

    prefix = "fmi2"
    version = 2
    real = "Real"
    c_types = {
        "Real": ctypes.c_double,
        "Integer": ctypes.c_int,
        "Boolean": ctypes.c_int,
        "String": ctypes.c_char_p,
    }

    def _instantiate(self, unit: Unit) -> int | None:
        callbacks = _callbacks()
        callbacks.componentEnvironment = self._listener = listen(self._log, unit.name, callbacks)
        instantiate = self._function("Instantiate")
        instantiate.restype = ctypes.c_void_p
        return instantiate(
            unit.name.encode(),
            fmi2CoSimulation,
            unit.fmu.guid.encode(),
            Path(unit.fmu.directory, "resources").absolute().as_uri().encode(),
            ctypes.byref(callbacks),
            False,
            True,  # PythonFMU passes on no message at all without
        )

    def _stepping(self, time: ctypes.c_double, step: ctypes.c_double) -> Callable[[], Status]:
        component = ctypes.c_void_p(self._component)
        return functools.partial(self._function("DoStep"), component, time, step, ctypes.c_int(1))

    def setup(self, experiment: Experiment) -> Status:
        return self._announce("SetupExperiment", experiment)

    def enter(self) -> Status:
        return self._do("EnterInitializationMode")

    def ended(self) -> float | None:
        """Return how far the FMU has gone if it has answered Discard because it wants to end."""
        if not self._has("GetBooleanStatus"):
            return None
        wants, last = ctypes.c_int(0), ctypes.c_double(math.nan)
        if self._do("GetBooleanStatus", fmi2Terminated, ctypes.byref(wants)) != OK or not wants.value:
            return None
        if self._has("GetRealStatus"):
            self._do("GetRealStatus", fmi2LastSuccessfulTime, ctypes.byref(last))
        return last.value


def _log(environment, instance, status, category, text):
    receive(environment, status, category, text)


def _log_unformatted(environment, instance, status, category, text):
    receive(environment, status, category, (text or b"").replace(b"%%", b"%"))


try:
    from fmpy.logging import addLoggerProxy

    _logger = fmi2CallbackLoggerTYPE(_log)
except (ImportError, OSError):  # no native proxy for this platform: arguments stay unformatted
    addLoggerProxy = None
    _logger = fmi2CallbackLoggerTYPE(_log_unformatted)

_allocate = fmi2CallbackAllocateMemoryTYPE(calloc)
_free = fmi2CallbackFreeMemoryTYPE(free)


def _callbacks() -> fmi2CallbackFunctions:
    """Return callback functions for one instance.

    FMI 2.0's log texts are printf formats with arguments that Python cannot read; fmpy's native proxy
    formats them (at most 2047 bytes).
    """
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = _logger
    callbacks.allocateMemory = _allocate
    callbacks.freeMemory = _free
    if addLoggerProxy is not None:
        addLoggerProxy(ctypes.byref(callbacks))
    return callbacks

"""Instances of FMI 3.0 co-simulation, without event mode."""

from __future__ import annotations

import ctypes
import functools
import math
import os
from collections.abc import Callable
from pathlib import Path

from fmpy.fmi3 import fmi3IntermediateUpdateCallback, fmi3LogMessageCallback

from ..fmu.binary import INTEGERS
from ..plan import Unit
from .log import DISCARD, OK, WARNING, listen, receive
from .slave import Experiment, Status
from .unit import FmuSlave


class Fmi3Slave(FmuSlave):
    """An instance of an FMI 3.0 co-simulation FMU."""

    prefix = "fmi3"
    version = 3
    real = "Float64"
    c_types = {
        "Float32": ctypes.c_float,
        "Float64": ctypes.c_double,
        **{name: getattr(ctypes, f"c_{name.lower()}") for name in INTEGERS},
        "Boolean": ctypes.c_bool,
        "String": ctypes.c_char_p,
    }

    def _instantiate(self, unit: Unit) -> int | None:
        self._listener = listen(self._log, unit.name)
        self._experiment = Experiment(0.0, 0.0)
        self._ended = ctypes.c_bool(False)
        self._reached = ctypes.c_double(math.nan)
        resources = str(Path(unit.fmu.directory, "resources").absolute()) + os.sep
        no, yes = False, True
        instantiate = self._function("InstantiateCoSimulation")
        instantiate.restype = ctypes.c_void_p
        return instantiate(
            unit.name.encode(),
            unit.fmu.guid.encode(),
            resources.encode(),
            no,  # visible
            yes,  # logging
            no,  # event mode
            no,  # early return
            None,
            ctypes.c_size_t(0),
            ctypes.c_void_p(self._listener),
            _logger,
            fmi3IntermediateUpdateCallback(),
        )

    def _stepping(self, time: ctypes.c_double, step: ctypes.c_double) -> Callable[[], Status]:
        component, yes = ctypes.c_void_p(self._component), ctypes.c_bool(True)
        event, early, ended, reached = ctypes.c_bool(), ctypes.c_bool(), self._ended, self._reached
        answers = [ctypes.byref(value) for value in (event, ended, early, reached)]
        do_step = self._function("DoStep")
        call = functools.partial(do_step, component, time, step, yes, *answers)

        def go_on(status: Status) -> Status:
            """Do what is left of a step from which the FMU has returned early, though it was told not to."""
            end = time.value + step.value
            while status <= WARNING and early.value and not ended.value and reached.value < end:
                begin = reached.value
                rest = do_step(component, ctypes.c_double(begin), ctypes.c_double(end - begin), yes, *answers)
                status = max(status, rest)
                if early.value and not reached.value > begin:
                    return self._impossible(f"it returned early and stays at t = {begin:.9g} s")
            return status

        def take_step() -> Status:
            status = call()
            if early.value:
                status = go_on(status)
            return max(status, DISCARD) if ended.value else status

        return take_step

    def ended(self) -> float | None:
        return self._reached.value if self._ended.value else None

    def setup(self, experiment: Experiment) -> Status:
        self._experiment = experiment
        return OK

    def enter(self) -> Status:
        return self._announce("EnterInitializationMode", self._experiment)


def _log(environment, status, category, text):
    receive(environment, status, category, text)


_logger = fmi3LogMessageCallback(_log)

"""FMI 2.0 and 3.0 co-simulation instances, loaded into this process through ctypes.

FMI 3.0 is used without event mode and early return.
"""

from __future__ import annotations

import ctypes
import functools
import math
import os
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
from fmpy.fmi3 import fmi3IntermediateUpdateCallback, fmi3LogMessageCallback

from yawbench.fmus.archive import is_native
from yawbench.fmus.description import INTEGERS

from ..plan import Instance, Plan
from .arithmetic import Arithmetic
from .compiled_loop import Kind, OperationData
from .instance import BoundCall, CtypesInstance, ExperimentSetup, PlainCall, Status
from .log import DISCARD, OK, WARNING, Log, listen, receive


class Fmi2Instance(CtypesInstance):
    """An instance of an FMI 2.0 co-simulation FMU."""

    prefix = "fmi2"
    version = 2
    real = "Real"
    exchanging = Kind.EXCHANGE_2
    state = "FMUstate"
    c_types = {
        "Real": ctypes.c_double,
        "Integer": ctypes.c_int,
        "Boolean": ctypes.c_int,
        "String": ctypes.c_char_p,
    }

    def _instantiate(self, instance: Instance) -> int | None:
        callbacks = _callbacks()
        callbacks.componentEnvironment = self._listener = listen(self._log, instance.name, callbacks)
        component: int | None = self._function("Instantiate", ctypes.c_void_p)(
            instance.name.encode(),
            fmi2CoSimulation,
            instance.fmu.guid.encode(),
            Path(instance.fmu.directory, "resources").absolute().as_uri().encode(),
            ctypes.byref(callbacks),
            False,
            True,  # logging on: otherwise PythonFMU passes on no messages at all
        )
        return component

    def _stepping(self, time: ctypes.c_double, step: ctypes.c_double) -> Callable[[], Status]:
        component = ctypes.c_void_p(self._component)
        call = BoundCall(self._function("DoStep"), component, time, step, ctypes.c_int(1))
        call.data = OperationData(Kind.STEP_2, time=time, size=step, **self._callee("DoStep"))
        return call

    def setup(self, experiment: ExperimentSetup) -> Status:
        return self._announce("SetupExperiment", experiment)

    def enter(self) -> Status:
        return self._do("EnterInitializationMode")

    def ended(self) -> float | None:
        """Return the time reached [s] if Discard means that the FMU asks to end the run, else None."""
        if not self._has("GetBooleanStatus"):
            return None
        wants, last = ctypes.c_int(0), ctypes.c_double(math.nan)
        if self._do("GetBooleanStatus", fmi2Terminated, ctypes.byref(wants)) != OK or not wants.value:
            return None
        if self._has("GetRealStatus"):
            self._do("GetRealStatus", fmi2LastSuccessfulTime, ctypes.byref(last))
        return last.value


def _log_fmi2(
    environment: int, instance: bytes, status: int, category: bytes | None, text: bytes | None
) -> None:
    receive(environment, status, category, text)


def _log_unformatted(
    environment: int, instance: bytes, status: int, category: bytes | None, text: bytes | None
) -> None:
    receive(environment, status, category, (text or b"").replace(b"%%", b"%"))


try:
    from fmpy.logging import addLoggerProxy

    _logger_fmi2 = fmi2CallbackLoggerTYPE(_log_fmi2)
except (ImportError, OSError):  # no native proxy for this platform: arguments stay unformatted
    addLoggerProxy = None
    _logger_fmi2 = fmi2CallbackLoggerTYPE(_log_unformatted)

_allocate = fmi2CallbackAllocateMemoryTYPE(calloc)
_free = fmi2CallbackFreeMemoryTYPE(free)


def _callbacks() -> fmi2CallbackFunctions:
    """Return the callback functions for one instance.

    Log texts of FMI 2.0 are printf formats with arguments that Python cannot read; fmpy's native proxy
    formats them (at most 2047 bytes).
    """
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = _logger_fmi2
    callbacks.allocateMemory = _allocate
    callbacks.freeMemory = _free
    if addLoggerProxy is not None:
        addLoggerProxy(ctypes.byref(callbacks))
    return callbacks


class _StepAnswers(ctypes.Structure):
    """Output arguments of `fmi3DoStep`."""

    _fields_ = [
        ("event", ctypes.c_bool),
        ("ended", ctypes.c_bool),
        ("early", ctypes.c_bool),
        ("reached", ctypes.c_double),
    ]


class Fmi3Instance(CtypesInstance):
    """An instance of an FMI 3.0 co-simulation FMU."""

    prefix = "fmi3"
    version = 3
    real = "Float64"
    exchanging = Kind.EXCHANGE_3
    state = "FMUState"
    c_types = {
        "Float32": ctypes.c_float,
        "Float64": ctypes.c_double,
        **{name: getattr(ctypes, f"c_{name.lower()}") for name in INTEGERS},
        "Boolean": ctypes.c_bool,
        "String": ctypes.c_char_p,
    }

    def _instantiate(self, instance: Instance) -> int | None:
        self._listener = listen(self._log, instance.name)
        self._experiment = ExperimentSetup(0.0, 0.0)
        self._answers = _StepAnswers(reached=math.nan)
        resources = str(Path(instance.fmu.directory, "resources").absolute()) + os.sep
        no, yes = False, True
        component: int | None = self._function("InstantiateCoSimulation", ctypes.c_void_p)(
            instance.name.encode(),
            instance.fmu.guid.encode(),
            resources.encode(),
            no,  # visible
            yes,  # logging
            no,  # event mode
            no,  # early return
            None,
            ctypes.c_size_t(0),
            ctypes.c_void_p(self._listener),
            _logger_fmi3,
            fmi3IntermediateUpdateCallback(),
        )
        return component

    def _stepping(self, time: ctypes.c_double, step: ctypes.c_double) -> Callable[[], Status]:
        return _Fmi3Step(self, time, step)

    def ended(self) -> float | None:
        return self._answers.reached if self._answers.ended else None

    def setup(self, experiment: ExperimentSetup) -> Status:
        self._experiment = experiment
        return OK

    def enter(self) -> Status:
        return self._announce("EnterInitializationMode", self._experiment)


class _Fmi3Step(PlainCall):
    """The call of `fmi3DoStep` of an instance."""

    def __init__(self, of: Fmi3Instance, time: ctypes.c_double, step: ctypes.c_double) -> None:
        self._of, self._time, self._step = of, time, step
        answers = self._answers = of._answers
        self._do_step, self._component = of._function("DoStep"), ctypes.c_void_p(of._component)
        fields = [getattr(_StepAnswers, name).offset for name in ("event", "ended", "early", "reached")]
        self._into = [ctypes.byref(answers, offset) for offset in fields]
        self._yes = ctypes.c_bool(True)
        self._call = functools.partial(self._do_step, self._component, time, step, self._yes, *self._into)
        self.data = OperationData(Kind.STEP_3, time=time, size=step, answers=answers, **of._callee("DoStep"))

    def __call__(self) -> Status:
        status = self._call()
        return self.finish(status) if self._answers.early or self._answers.ended else status

    def finish(self, status: Status) -> Status:
        if self._answers.early:
            status = self._go_on(status)
        return max(status, DISCARD) if self._answers.ended else status

    def _go_on(self, status: Status) -> Status:
        """Complete a step from which the FMU returned early although it was not allowed to."""
        answers, end = self._answers, self._time.value + self._step.value
        while status <= WARNING and answers.early and not answers.ended and answers.reached < end:
            begin = answers.reached
            times = ctypes.c_double(begin), ctypes.c_double(end - begin)
            status = max(status, self._do_step(self._component, *times, self._yes, *self._into))
            if answers.early and not answers.reached > begin:
                return self._of._impossible(f"it returned early and stays at t = {begin:.9g} s")
        return status


def _log_fmi3(environment: int, status: int, category: bytes | None, text: bytes | None) -> None:
    receive(environment, status, category, text)


_logger_fmi3 = fmi3LogMessageCallback(_log_fmi3)
INSTANCE_TYPES: dict[int, type[CtypesInstance]] = {2: Fmi2Instance, 3: Fmi3Instance}
"""Major version of FMI -> class of its instances."""


class KeptInstances:
    """Instances that this process keeps between runs: they are reset instead of made anew.

    Only of native FMUs: when they were built, the comparison with Python showed that after a reset they
    compute what new ones do. They are known by checksum, folder and name, so an FMU that has changed is
    opened anew.
    """

    def __init__(self) -> None:
        self.process = os.getpid()
        self.others = False
        """Whether an FMU of another kind has been loaded into this process, which may have changed it."""
        self._idle: dict[tuple[str, Path, str], CtypesInstance] = {}

    def take(self, planned: Instance, log: Log, corrupted: set[Path]) -> CtypesInstance | None:
        """Return an idle instance for a `plan.Instance`; None if there is none."""
        instance = self._idle.pop(_known_by(planned), None)
        if instance is not None:
            instance.renew(log, corrupted)
        return instance

    def keep(self, planned: Instance, instance: CtypesInstance) -> None:
        """Keep an instance that is reset; if there are too many, free the one that was idle for longest."""
        self._idle[_known_by(planned)] = instance
        if len(self._idle) > MOST_KEPT:
            self._idle.pop(next(iter(self._idle))).release()


MOST_KEPT = 200
"""Largest number of idle instances; chosen: those of ten times as many variants as a system has instances."""
_kept: KeptInstances | None = None


def _known_by(instance: Instance) -> tuple[str, Path, str]:
    return instance.fmu.sha256, instance.fmu.directory, instance.name


def keep_instances() -> KeptInstances:
    """Have `open_instance` keep the instances of native FMUs from now on, in this process alone."""
    global _kept
    if _kept is None or _kept.process != os.getpid():
        _kept = KeptInstances()
    return _kept


def keeps(plan: Plan) -> bool:
    """Return whether this process keeps the instances of a run, all of which are native."""
    return _keeping() is not None and all(is_native(instance.fmu.directory) for instance in plan.instances)


def _keeping() -> KeptInstances | None:
    return _kept if _kept is not None and _kept.process == os.getpid() else None


def open_instance(planned: Instance, log: Log, corrupted: set[Path]) -> CtypesInstance:
    """Return the running instance for a `plan.Instance`; arguments and errors as for `CtypesInstance`."""
    kept = _keeping()
    if kept is not None and (idle := kept.take(planned, log, corrupted)) is not None:
        return idle
    arithmetic = Arithmetic()
    try:
        instance = INSTANCE_TYPES[planned.fmu.fmi](planned, log, corrupted)
    finally:
        arithmetic.restore(planned.name, log)
    if kept is not None:
        if is_native(planned.fmu.directory):
            instance.keep = functools.partial(kept.keep, planned)
        else:
            kept.others = True
    return instance

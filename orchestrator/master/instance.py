"""Interface of a running FMU instance, and its implementation on the FMU's C functions through ctypes.

A step call is the raw C function with arguments converted to C objects once (0.26 us instead of 0.64 us
with the types that fmpy declares, more with its logging wrappers), on buffers that belong to the master.
Besides, fmpy refuses to load a library that lacks any function, even one that is never called.

In FMI 3.0 an array is one variable; in a scenario its elements are separate scalars. Most exchanges of a
step are of scalars with the precision and in the order of the master's buffer, and use it directly; others
are converted and rearranged on the way.
"""

from __future__ import annotations

import ctypes
import functools
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Protocol

import fmpy
import numpy as np

from yawbench.fmus.archive import binary_problem
from yawbench.fmus.description import CORE, INTEGERS, binary_of
from yawbench.fmus.fmu import Value, ValueRef
from yawbench.foundation.errors import ModelDescriptionError, SimulationError
from yawbench.foundation.messages import listed

from ..plan import Instance
from .compiled_loop import Kind, OperationData
from .log import ERROR, FATAL, OK, STATUS, WARNING, Log, known, relisten, unlisten

Status = int


class StepCalls(NamedTuple):
    """The calls of a communication step, each without arguments and returning an FMI status."""

    set: Callable[[], Status]
    step: Callable[[], Status]
    get: Callable[[], Status]


class PlainCall:
    """A call that the compiled loop makes by itself, too, from `data` (see `compiled_loop`)."""

    data: OperationData

    def finish(self, status: Status) -> Status:
        """Return the status of the call, of which the C function that `data` name has returned `status`."""
        return status


class BoundCall(functools.partial[Status], PlainCall):
    """A C function with its arguments bound."""


class Buffers(NamedTuple):
    """Arrays of floating-point values through which master and instance exchange, one item per `ValueRef`."""

    inputs: np.ndarray
    input_places: Sequence[ValueRef]
    outputs: np.ndarray
    output_places: Sequence[ValueRef]
    time: ctypes.c_double  # beginning of the step [s], read at every call
    step: ctypes.c_double  # size of the step [s], read at every call


class ExperimentSetup(NamedTuple):
    """Arguments of FMI's experiment setup, passed to an instance before initialization."""

    start: float  # [s]
    stop: float  # [s]
    tolerance: float | None = None  # relative, of its own solver; None: its default


class FmuInstance(Protocol):
    """A running instance of an FMU. Failures are returned as FMI statuses, not raised."""

    name: str

    def connect(self, buffers: Buffers) -> StepCalls:
        """Return the calls of a step, which exchange floating-point values through the buffers."""

    def part(self, kind: str) -> str:
        """Return the kind of call (set, step, get) that failed when one of `kind` did not return OK."""

    def put(self, refs: Sequence[ValueRef], values: Sequence[Value]) -> Status:
        """Set variables of one type; of an array, all elements."""

    def fetch(self, refs: Sequence[ValueRef]) -> tuple[Status, list[Value]]:
        """Return the status and the values of variables of one type."""

    def configure(self, groups: Sequence[tuple[Sequence[ValueRef], Sequence[Value]]]) -> Status:
        """Set structural parameters, in groups of one type, before anything that has their sizes."""

    def setup(self, experiment: ExperimentSetup) -> Status:
        """Set up the experiment: start time, stop time, tolerance."""

    def enter(self) -> Status:
        """Enter initialization mode."""

    def exit(self) -> Status:
        """Leave initialization mode."""

    def ended(self) -> float | None:
        """Return the time [s] that an instance has reached if it asks to end the run, else None.

        Called after a step that returned Discard. NaN: the FMU does not say how far it has got.
        """

    def note(self, status: Status) -> Status:
        """Remember the status of a call, which decides how the instance may be ended, and return it.

        The master reports every status that it acts on. A number that is not an FMI status becomes UNKNOWN.
        """

    def free(self) -> None:
        """Terminate and free the instance as its state allows; further calls do nothing."""


class CtypesInstance(FmuInstance, ABC):
    """Base of the instances of all FMI versions."""

    prefix: ClassVar[str]
    """Prefix of the names of the C functions."""
    version: ClassVar[int]
    """Major version of FMI."""
    real: ClassVar[str]
    """Type, as in the function names, of the values exchanged directly with the master's buffer."""
    exchanging: ClassVar[Kind]
    """Kind of the operation that sets or gets these values."""
    state: ClassVar[str]
    """Name of the state in functions that save and restore it."""
    c_types: ClassVar[dict[str, Any]]
    """Type as in the names of setters and getters -> C type."""

    def __init__(self, instance: Instance, log: Log, corrupted: set[Path]) -> None:
        """Load the library and instantiate.

        Args:
            corrupted: folders of FMUs of which an instance has returned Fatal, shared by the whole run.

        Raises:
            ModelDescriptionError: the FMU has no loadable library for this platform.
            SimulationError: the FMU refuses to be instantiated.
        """
        self.name = instance.name
        self._directory = instance.fmu.directory
        self.keep: Callable[[CtypesInstance], None] | None = None
        """Callback that takes the instance, reset, when it would be freed."""
        self._component: int | None = None
        self._begin(log, corrupted)
        self._listener = 0
        self._library = self._load(instance)
        if missing := [name for name in CORE[self.version] if not self._has(name)]:
            functions = listed(f"{self.prefix}{name}" for name in missing)
            fmpy.freeLibrary(self._library._handle)
            raise ModelDescriptionError(
                f"{instance.name}: {instance.fmu.path}: its library lacks {functions}",
                code="fmu-function-missing",
            )
        self._component = self._instantiate(instance)
        if self._component is None:
            self.free()
            errors = log.errors(instance.name)
            reason = errors[0].text if errors else "it gave no reason"
            if instance.fmu.needs_tool:
                reason += f" (it requires its tool: {instance.fmu.generation_tool or 'not named'})"
            raise SimulationError(
                f"{instance.name}: {instance.fmu.path} cannot be instantiated: {reason}",
                instance=instance.name,
                time=0.0,
                code="fmu-not-loadable",
            )

    def _begin(self, log: Log, corrupted: set[Path]) -> None:
        self._log = log
        self._corrupted = corrupted
        self._may_terminate = False
        self._freed = False
        self._worst = OK
        self._states: list[int] = []

    def renew(self, log: Log, corrupted: set[Path]) -> None:
        """Use an instance that was reset for another run."""
        self._begin(log, corrupted)
        relisten(self._listener, log)

    def _load(self, instance: Instance) -> ctypes.CDLL:
        problem, here = binary_problem(instance.fmu), os.getcwd()
        if not problem:
            file = (
                instance.fmu.directory / binary_of(self.version, instance.fmu.model_identifier)
            ).absolute()
            try:
                os.chdir(file.parent)  # some FMUs look for further libraries in the working directory
                return ctypes.CDLL(str(file))
            except OSError as error:
                problem = f"its library cannot be loaded: {error}"
            finally:
                os.chdir(here)
        raise ModelDescriptionError(
            f"{instance.name}: {instance.fmu.path}: {problem}", code="fmu-not-loadable"
        )

    @abstractmethod
    def _instantiate(self, instance: Instance) -> int | None:
        """Return the C pointer of the new instance, None if the FMU refuses."""

    def connect(self, buffers: Buffers) -> StepCalls:
        inputs, input_places, outputs, output_places, time, step = buffers
        return StepCalls(
            self._calls("Set", inputs, input_places),
            self._stepping(time, step),
            self._calls("Get", outputs, output_places),
        )

    @abstractmethod
    def _stepping(self, time: ctypes.c_double, step: ctypes.c_double) -> Callable[[], Status]:
        """Return the call of the FMU's `DoStep`."""

    def _callee(self, name: str) -> dict[str, Any]:
        """Return the C function `name` and the instance as fields of `OperationData`."""
        function = ctypes.cast(self._library[self.prefix + name], ctypes.c_void_p).value
        return {"function": function, "instance": self._component}

    def _calls(self, verb: str, values: np.ndarray, refs: Sequence[ValueRef]) -> Callable[[], Status]:
        """Return the call that sets or gets floating-point values of single or double precision."""
        calls = []
        for kind in dict.fromkeys(ref.type for ref in refs):
            where = [i for i, ref in enumerate(refs) if ref.type == kind]
            calls.append(self._staged(verb, values, [refs[i] for i in where], where))
        if not calls:
            return nothing_to_do
        return calls[0] if len(calls) == 1 else lambda: max(call() for call in calls)

    def _staged(
        self, verb: str, values: np.ndarray, refs: Sequence[ValueRef], where: list[int]
    ) -> Callable[[], Status]:
        """Return the call for the values at the buffer's indices `where`, all of one type."""
        kind, (references, at, count) = refs[0].type, _layout(refs)
        if kind == self.real and at == where == list(range(len(values))) and count == len(values):
            straight = (ctypes.c_double * count).from_buffer(values.data)
            call = self._call(verb + kind, references, straight)
            call.data = OperationData(
                self.exchanging,
                count,
                references=references,
                n_references=len(references),
                values=straight,
                **self._callee(verb + kind),
            )
            return call
        buffer = (self.c_types[kind] * count)()
        call = self._call(verb + kind, references, buffer)
        staged, here, there = np.frombuffer(buffer, self.c_types[kind]), np.array(where), np.array(at)

        def give() -> Status:
            staged[there] = values[here]
            return call()

        def take() -> Status:
            status = call()
            values[here] = staged[there]
            return status

        return give if verb == "Set" else take

    def _call(self, name: str, references: Any, buffer: Any) -> BoundCall:
        """Return the C setter or getter `name` with its arguments bound."""
        counts = [ctypes.c_size_t(len(references)), buffer]
        if self.version > 2:
            counts.append(ctypes.c_size_t(len(buffer)))
        return BoundCall(self._function(name), ctypes.c_void_p(self._component), references, *counts)

    def _access(self, verb: str, refs: Sequence[ValueRef], values: Sequence[Any]) -> tuple[Status, list[Any]]:
        """Set ("Set") or get ("Get") variables of one type; return status and values."""
        kind, (references, at, count) = refs[0].type, _layout(refs)
        if not self._has(verb + kind):
            return self._impossible(f"the library lacks {self.prefix}{verb}{kind}"), [0] * len(refs)
        buffer, whole = (self.c_types[kind] * count)(), kind in (*INTEGERS, "Integer")
        for i, value in zip(at, values, strict=False):  # empty when getting
            buffer[i] = value
            if whole and buffer[i] != value:
                sentence = f"{value} does not fit into a variable of type {kind}"
                return self._impossible(sentence), list(values)
        status, exchanged = self._call(verb + kind, references, buffer)(), buffer[:]
        return status, [exchanged[i] for i in at]

    def _impossible(self, sentence: str) -> Status:
        self._log.add(self.name, ERROR, "", sentence)
        return ERROR

    def _has(self, name: str) -> bool:
        return hasattr(self._library, self.prefix + name)

    def _function(self, name: str, result: Any = ctypes.c_int) -> Any:
        """Return a C function; it takes C objects and, of Python's numbers, only integers."""
        function = getattr(self._library, self.prefix + name)  # looked up once, unlike by index
        function.restype = result
        return function

    def _do(self, name: str, *arguments: Any) -> Status:
        """Call a C function with the instance as its first argument."""
        status: Status = self._function(name)(ctypes.c_void_p(self._component), *arguments)
        return status

    def _announce(self, name: str, experiment: ExperimentSetup) -> Status:
        """Call the C function that takes start time, stop time and tolerance."""
        start, stop, tolerance = experiment
        times = ctypes.c_double(start), 1, ctypes.c_double(stop)
        self._may_terminate = True
        return self._do(name, int(tolerance is not None), ctypes.c_double(tolerance or 0.0), *times)

    def part(self, kind: str) -> str:
        return kind

    def put(self, refs: Sequence[ValueRef], values: Sequence[Value]) -> Status:
        encoded = [v.encode() if isinstance(v, str) else v for v in values]
        return self._access("Set", refs, encoded)[0]

    def fetch(self, refs: Sequence[ValueRef]) -> tuple[Status, list[Value]]:
        status, values = self._access("Get", refs, ())
        kind = refs[0].type
        if kind == "String":
            values = [(text or b"").decode("utf-8", errors="replace") for text in values]
        elif kind == "Boolean":
            values = [bool(value) for value in values]
        return status, values

    def configure(self, groups: Sequence[tuple[Sequence[ValueRef], Sequence[Value]]]) -> Status:
        for name in ("EnterConfigurationMode", "ExitConfigurationMode"):
            if not self._has(name):
                return self._impossible(f"the library lacks {self.prefix}{name}")
        status = self._do("EnterConfigurationMode")
        for refs, values in groups:
            status = max(status, self.put(refs, values)) if status <= WARNING else status
        return max(status, self._do("ExitConfigurationMode")) if status <= WARNING else status

    def save_state(self) -> int | None:
        """Return a handle of the FMU's state; None if it cannot save it. `free` frees all of them."""
        if not all(self._has(verb + self.state) for verb in ("Get", "Set", "Free")):
            return None
        handle = ctypes.c_void_p()
        if self._do(f"Get{self.state}", ctypes.byref(handle)) > WARNING or handle.value is None:
            return None
        self._states.append(handle.value)
        return handle.value

    def restore_state(self, handle: int) -> bool:
        """Restore a state; return whether the FMU did."""
        return self.note(self._do(f"Set{self.state}", ctypes.c_void_p(handle))) <= WARNING

    def exit(self) -> Status:
        return self._do("ExitInitializationMode")

    def note(self, status: Status) -> Status:
        status = known(status)
        self._worst = max(self._worst, status)
        if status >= FATAL:
            self._corrupted.add(self._directory)
        return status

    def free(self) -> None:
        if self._freed or self._directory in self._corrupted:
            return  # after Fatal no function of any instance may be called (FMI 2.0.4, 2.1.3)
        self._freed = True
        if self._component is not None:
            for handle in self._states:
                self._do(f"Free{self.state}", ctypes.byref(ctypes.c_void_p(handle)))
            if self._may_terminate and self._worst < ERROR and self._has("Terminate"):
                status = self.note(self._do("Terminate"))
                if status != OK:
                    self._log.add(self.name, WARNING, "", f"{self.prefix}Terminate returned {STATUS[status]}")
                if status >= FATAL:
                    return
            if self.keep is not None and self._worst <= WARNING and self._do("Reset") == OK:
                return self.keep(self)
        return self.release()

    def release(self) -> None:
        """Free the instance and its library."""
        if self._component is not None:
            self._do("FreeInstance")
        unlisten(self._listener)
        fmpy.freeLibrary(self._library._handle)


def _layout(refs: Sequence[ValueRef]) -> tuple[Any, list[int], int]:
    """Return the distinct value references, each scalar's index among the values, and their number."""
    first: dict[int, int] = {}
    count = 0
    for ref in refs:
        if ref.reference not in first:
            first[ref.reference] = count
            count += ref.elements
    at = [first[ref.reference] + ref.element for ref in refs]
    return (ctypes.c_uint * len(first))(*first), at, count


def nothing_to_do() -> Status:
    """No-op in place of a step call that is not needed."""
    return OK

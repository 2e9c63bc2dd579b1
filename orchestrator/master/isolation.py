"""Isolated instances: each in a process of its own, so that a crash or a hang ends the run, not the master.

To the master an isolated instance is an `FmuInstance` like any other. Its numbers are identical to those of
the same instance in this process, because the process at the other end runs the same `CtypesInstance` on the
same values. Setting inputs is deferred until the step, and outputs come back with it, so an instance costs
one exchange per step, most of it the two context switches.

The process at the other end is a `Worker`: with its FMU it does what the master asks for (`InstanceServer`).
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from yawbench.fmus.fmu import Value, ValueRef
from yawbench.foundation import processes
from yawbench.foundation.errors import SimulationError, YawbenchError
from yawbench.foundation.interrupts import stop_requested_at
from yawbench.foundation.messages import listed
from yawbench.foundation.processes import ProcessLost, Worker, die_with_parent, end_copy_of, flush_output

from ..plan import Instance, Plan
from .arithmetic import Arithmetic
from .fmi import INSTANCE_TYPES, open_instance
from .instance import Buffers, CtypesInstance, ExperimentSetup, FmuInstance, Status, StepCalls
from .log import FATAL, KILLED, OK, PROCESS, WARNING, Log, LogRelay, known

T = TypeVar("T")

CALL_LIMIT = 10.0
"""Time that a call of an FMU may take [s]; chosen: ten thousand times the length of a step, and still a
tolerable wait."""
START_LIMIT = 60.0
"""Time that a process may take to start [s]; chosen: enough to load Python from a slow disk."""
STOP_GRACE = 1.0
"""Time that a call may still take after a stop request [s]; chosen: a tolerable wait for the user."""


class IsolatedInstance(Worker):
    """An instance of an FMU in a process of its own, which starts at once; `open` makes the instance.

    Args:
        limit: time that a call of the FMU may take [s].
    """

    longest = 1 << 26  # far longer than any text of an FMU

    def __init__(self, instance: Instance, limit: float) -> None:
        self.name = instance.name
        self._log = Log()
        self._instance = instance
        self._limit = limit
        self._lost = False
        self._stepping = False
        self._part = ""
        kind = INSTANCE_TYPES[instance.fmu.fmi]
        self._prefix = kind.prefix
        self._functions = {"set": f"Set{kind.real}", "step": "DoStep", "get": f"Get{kind.real}"}
        super().__init__([__name__], self._log.relayed)
        self.give(_serve, ())

    def open(self, log: Log) -> IsolatedInstance:
        """Load the library and instantiate the FMU.

        Raises:
            ModelDescriptionError, SimulationError: as for `CtypesInstance`; also if the process dies.
        """
        self._unasked = log.relayed
        self._log = log
        doing, refused = "its start", ""
        try:
            self._answer(START_LIMIT)
            doing = f"{self._prefix}Instantiate or before"
            refused = f"{self._instance.fmu.path} cannot be instantiated: "
            # without the hundreds of variables, which the process does not need
            slim = replace(self._instance, fmu=replace(self._instance.fmu, variables={}), series={})
            self._call("open", slim)
        except ProcessLost as lost:
            sentence = f"{self.name}: {refused}{_lost_in(lost, doing)}"
            raise SimulationError(sentence, instance=self.name, time=0.0, code="fmu-not-loadable") from None
        return self

    def _call(self, request: str, *arguments: Any) -> Any:
        """Call a method of the process's `InstanceServer` or of its instance; return the result."""
        with contextlib.suppress(BrokenPipeError):  # the cause is found when the answer is read
            self._channel.send("instance", (request, arguments))
        return self._answer(self._limit)

    def _answer(self, limit: float) -> Any:
        """Return the answer, which may take a time `limit` [s]."""
        self._deadline = time.monotonic() + limit
        value, error = self.answer()
        if isinstance(error, YawbenchError):
            self.close()
            raise error
        if error is not None:
            raise self.lost(f"failed: {type(error).__name__}: {error}")
        return value

    def check_time(self) -> None:
        now, requested = time.monotonic(), stop_requested_at()
        if requested is not None and now - requested > STOP_GRACE:
            raise self.lost("did not return when the run was asked to stop", late=True)
        if now > self._deadline:
            limit = f"{self._limit:g} s, the limit of a call (--call-limit)"
            raise self.lost(f"did not return within {limit}", late=True)

    def connect(self, buffers: Buffers) -> StepCalls:
        inputs, input_places, outputs, output_places, time, step = buffers
        self._ask("", None, "connect", list(input_places), list(output_places), step.value)
        step_and_get = ("step", "get") if len(outputs) else ("step",)
        given, values, fresh, failed = b"", b"", False, (FATAL, "", b"")

        def exchange(*parts: str) -> Status:
            nonlocal given, values
            status, self._part, values = self._ask(parts, failed, "exchange", parts, time.value, given)
            given = b""
            return status

        def set_inputs() -> Status:
            nonlocal given
            given = inputs.tobytes()
            return OK if self._stepping else exchange("set")

        def take_step() -> Status:
            nonlocal fresh
            fresh = True
            return exchange(*(("set",) if given else ()), *step_and_get)

        def get_outputs() -> Status:
            nonlocal fresh
            status = OK if fresh else exchange("get")
            fresh = False
            if values:
                outputs[:] = np.frombuffer(values)
            return status

        self._flush: Callable[[], Status] = lambda: exchange("set") if given else OK
        return StepCalls(set_inputs, take_step, get_outputs)

    def part(self, kind: str) -> str:
        return self._part or kind

    def put(self, refs: Sequence[ValueRef], values: Sequence[Value]) -> Status:
        status = self._flush() if self._stepping else OK  # inputs are set in the order of the calls
        if status > WARNING:
            return status
        function = f"{self._prefix}Set{refs[0].type}"
        return max(status, known(self._ask(function, FATAL, "put", list(refs), list(values))))

    def fetch(self, refs: Sequence[ValueRef]) -> tuple[Status, list[Value]]:
        failed: tuple[Status, list[Value]] = (FATAL, [0] * len(refs))
        return self._ask(f"{self._prefix}Get{refs[0].type}", failed, "fetch", list(refs))

    def configure(self, groups: Sequence[tuple[Sequence[ValueRef], Sequence[Value]]]) -> Status:
        function = f"{self._prefix}EnterConfigurationMode or {self._prefix}ExitConfigurationMode"
        return self._ask(function, FATAL, "configure", list(groups))

    def setup(self, experiment: ExperimentSetup) -> Status:
        return self._ask(f"{self._prefix}SetupExperiment", FATAL, "setup", experiment)

    def enter(self) -> Status:
        return self._ask(f"{self._prefix}EnterInitializationMode", FATAL, "enter")

    def exit(self) -> Status:
        status = self._ask(f"{self._prefix}ExitInitializationMode", FATAL, "exit")
        self._stepping = True
        return status

    def ended(self) -> float | None:
        return self._ask(f"{self._prefix}GetBooleanStatus", None, "ended")

    def note(self, status: Status) -> Status:
        return self._ask("", known(status), "note", status)

    def _ask(self, doing: str | Sequence[str], failed: T, request: str, *arguments: Any) -> T:
        """Return the answer to a request; `failed` if the process is lost, which is logged.

        Args:
            doing: name of the FMI function that is called, or the parts of a step that are done.
        """
        if self._lost:
            return failed
        self._part = ""
        try:
            answer: T = self._call(request, *arguments)
            return answer
        except ProcessLost as lost:
            self._lost = True
            errors = self._log.errors(self.name)
            before = f"; its last message: {' '.join(errors[-1].text.split())}" if errors else ""
            if not isinstance(doing, str):
                doing = listed([self._prefix + self._functions[part] for part in doing], last="or")
            text = _lost_in(lost, doing) + before
            self._log.add(self.name, FATAL, KILLED if lost.killed else PROCESS, text)
            return failed

    def free(self) -> None:
        if self._closed:
            return
        try:
            self._call("free")
        except ProcessLost as lost:  # the results are not affected
            text = _lost_in(lost, f"{self._prefix}Terminate or {self._prefix}FreeInstance")
            self._log.add(self.name, WARNING, PROCESS, text)
        self.close()


def _lost_in(lost: ProcessLost, function: str) -> str:
    """Return the message for a loss during a call of an FMI function ("": between two calls)."""
    if lost.late:
        return f"{function or 'its process'} {lost}"
    return f"its process {lost}" + (f" in {function}" if function else " between two calls")


class Isolation(contextlib.ExitStack):
    """A `run_lifecycle.OpenInstance` that isolates instances; their processes end with the `with` block."""

    def __init__(self, instances: Sequence[Instance], limit: float = CALL_LIMIT) -> None:
        """Remember the instances, so that their processes can start at the same time.

        Args:
            limit: time that a call of an FMU may take [s].
        """
        super().__init__()
        self._planned = instances
        self._limit = limit
        self.instances: dict[str, IsolatedInstance] = {}

    def __call__(self, instance: Instance, log: Log, corrupted: set[Path]) -> FmuInstance:
        """Return a new isolated instance. Fatal from one does not affect the others: they share nothing."""
        if not self.instances:
            for each in self._planned:
                self.instances[each.name] = isolated = IsolatedInstance(each, self._limit)
                self.callback(isolated.close, kill=True)
        return self.instances[instance.name].open(log)


def opener_of(
    plan: Plan, call_limit: float | None
) -> contextlib.AbstractContextManager[Callable[[Instance, Log, set[Path]], FmuInstance]]:
    """Return what opens the instances of a plan: in this process, or isolated if there is a `call_limit` [s].

    Raises:
        SimulationError: isolation is not supported on this operating system.
    """
    if call_limit is None:
        return contextlib.nullcontext(open_instance)
    if sys.platform == "win32":
        raise SimulationError(
            "--isolate needs Linux or macOS.", instance=None, time=0.0, code="isolation-unavailable"
        )
    return Isolation(plan.instances, call_limit)


class InstanceServer:
    """In the process of an instance: does with the FMU what the master asks for."""

    def __init__(self) -> None:
        self._process = os.getpid()
        self._log = LogRelay(processes.asking, timed=False)
        self._arithmetic: Arithmetic | None = Arithmetic()  # until stepping begins
        self._instance: CtypesInstance

    def call(self, request: str, arguments: Sequence[Any]) -> Any:
        """Call a method of this object or of the instance."""
        result = getattr(self if hasattr(self, request) else self._instance, request)(*arguments)
        end_copy_of(self._process)
        if self._arithmetic is not None:
            self._arithmetic.restore("", self._log)
        return result

    def open(self, instance: Instance) -> None:
        self._instance = open_instance(instance, self._log, set())

    def connect(self, inputs: Sequence[ValueRef], outputs: Sequence[ValueRef], step: float) -> None:
        self._time = ctypes.c_double()
        self._inputs, self._outputs = np.zeros(len(inputs)), np.zeros(len(outputs))
        buffers = self._inputs, inputs, self._outputs, outputs, self._time, ctypes.c_double(step)
        self._calls = self._instance.connect(Buffers(*buffers))._asdict()

    def exchange(self, parts: Sequence[str], time: float, given: bytes) -> tuple[Status, str, bytes]:
        """Do parts of a step in order, up to a status worse than Warning.

        Returns:
            the worst status, the part that it belongs to, and the outputs.
        """
        self._time.value = time
        if given:
            self._inputs[:] = np.frombuffer(given)
        worst, of = OK, ""
        for part in parts:
            status = known(self._calls[part]())
            if status > worst:
                worst, of = status, part
            if status > WARNING:
                break
        return worst, of, self._outputs.tobytes()

    def exit(self) -> Status:
        self._arithmetic = None
        return self._instance.exit()

    def free(self) -> None:
        """Free the instance and flush what its library has printed."""
        self._instance.free()
        self._log.finish()
        flush_output()


def _serve() -> None:
    """Make the server of this process, which ends with its parent by a signal that no FMU can ignore."""
    die_with_parent()
    processes.answering["instance"] = InstanceServer().call

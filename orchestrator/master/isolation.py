"""Isolated instances: each in a process of its own, so that a crash or a hang ends the run, not the master.

To the master an isolated instance is an `FmuInstance` like any other. Its numbers are identical to those of
the same instance in this process, because the process at the other end runs the same `CtypesInstance` on the
same values. Setting inputs is deferred until the step, and outputs come back with it, so an instance costs
one exchange per step.

The Real values of a step, its time and its size lie in shared memory; two pipes carry single bytes: which of
set, step and get to do, and how that ended. Such an exchange costs 7 us on one core and 50 us from core to
core, most of it the two context switches; a pair of pipes was the fastest of the mechanisms that report the
death of the other side at once. Everything else, and the messages that the FMU logs meanwhile, is a tagged
record of a few hundred bytes.

An FMU can write into the pipe to the master. So records from there are checked (see `supervised_process`); a
stray byte is recognized by comparison with the last answer and its number in shared memory; and waiting for
a record is limited by the time limit of a call.

`InstanceServer` is the other end: it does with the FMU what the master asks for, and nothing else. Its
process ends when the master does, and with it everything that the FMU has started (see `stand_guard`).
"""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from yawbench.fmus.fmu import Value, ValueRef
from yawbench.foundation.errors import SimulationError, YawbenchError, error_record, rebuilt
from yawbench.foundation.fork_server import start
from yawbench.foundation.interrupts import stop_requested_at
from yawbench.foundation.supervised_process import (
    ANSWER,
    FAILED,
    LOG,
    REPLY,
    REQUEST,
    PipeChannel,
    ProcessLost,
    stand_guard,
)

from ..plan import Instance, Plan
from .fmi import INSTANCE_TYPES, open_instance
from .instance import (
    Buffers,
    CtypesInstance,
    ExperimentSetup,
    FmuInstance,
    SharedBuffer,
    Status,
    StepCalls,
    shared_memory,
)
from .process_state import (
    FATAL,
    KILLED,
    OK,
    PROCESS,
    WARNING,
    FmuProcess,
    Log,
    LogRelay,
    ProcessState,
    flush_output,
    known,
)
from .step_program import copying

T = TypeVar("T")

SET, STEP, GET = 1, 2, 4
"""Parts of an exchange, in this order; a sum of them asks for several."""

CALL_LIMIT = 10.0
"""Time that a call of an FMU may take [s]; chosen: ten thousand times the length of a step, and still a
tolerable wait."""

START_LIMIT = 60.0
"""Time that a process may take to start [s]; chosen: enough to load Python from a slow disk."""
STOP_GRACE = 1.0
"""Time that a call may still take after a stop request [s]; chosen: a tolerable wait for the user."""

_PARTS = {SET: ("set", "Set{}"), STEP: ("step", "DoStep"), GET: ("get", "Get{}")}
"""Part of an exchange -> kind of the master's operation and template of the FMI function's name."""


class InstanceProcess(FmuProcess):
    """The process of one isolated instance."""

    unasked = (LOG, FAILED)

    def __init__(self, values: int, limit: float) -> None:
        """Start the process without waiting for it.

        Args:
            values: number of inputs and outputs to allocate shared memory for.
            limit: time that an answer may take [s].
        """
        self._limit = limit
        self.memory = memory = shared_memory(values)
        super().__init__(
            lambda reading, writing: start(__name__, reading, writing, memory, preload=[__name__]), Log()
        )

    def wait_until_ready(self) -> None:
        """Wait until the process is ready for requests."""
        self.answer(START_LIMIT, REPLY)

    def ask(self, request: str, *arguments: Any) -> Any:
        """Call a method of the process's `InstanceServer` or of its instance; return the result."""
        with contextlib.suppress(BrokenPipeError):  # the cause is found when the answer is read
            self._channel.send_object(REQUEST, (request, arguments))
        return self.answer(self._limit, REPLY)

    def exchange(self, parts: bytes) -> int:
        """Have it do parts of a step; return the result (see `InstanceServer.exchange`)."""
        with contextlib.suppress(BrokenPipeError):
            self._channel.say(parts)
        result: int = self.answer(self._limit, ANSWER)
        return result

    def answer(self, limit: float, wanted: int) -> Any:
        """Return its answer, which may take a time `limit` [s]."""
        self._deadline = time.monotonic() + limit
        return self.hear(wanted)

    def take(self, kind: int, content: Any) -> None:
        if kind == FAILED:
            self.close()
            raise ProcessLost(f"failed: {content}")
        super().take(kind, content)

    def check_time(self) -> None:
        now, requested = time.monotonic(), stop_requested_at()
        if requested is not None and now - requested > STOP_GRACE:
            self.close()
            raise ProcessLost("did not return when the run was asked to stop", late=True)
        if now > self._deadline:
            self.close()
            limit = f"{self._limit:g} s, the limit of a call (--call-limit)"
            raise ProcessLost(f"did not return within {limit}", late=True)

    def close(self, *, kill: bool = False) -> int:
        """End the process by its guardian, which finds the pipe closed and kills everything that is left."""
        if not self._closed:
            os.close(self.memory)
        return super().close()


class IsolatedInstance:
    """An instance of an FMU in a process of its own."""

    def __init__(self, instance: Instance, log: Log, process: InstanceProcess) -> None:
        """Have the process load the library and instantiate the FMU.

        Raises:
            ModelDescriptionError, SimulationError: as for `CtypesInstance`; also if the process dies.
        """
        self.name = instance.name
        self._log = log
        self._process: InstanceProcess | None = process
        self._stepping = False
        self._part = ""
        self._answered = 0
        kind = INSTANCE_TYPES[instance.fmu.fmi]
        self._prefix, self._real = kind.prefix, kind.real
        process.log = log
        try:
            process.wait_until_ready()
        except ProcessLost as lost:
            raise self._refused(f"{instance.name}: {lost.in_('its start')}") from None
        try:
            # without the hundreds of variables, which the process does not need
            failed = process.ask(
                "open", replace(instance, fmu=replace(instance.fmu, variables={}), series={})
            )
        except ProcessLost as lost:
            reason = lost.in_(f"{self._prefix}Instantiate or before")
            raise self._refused(
                f"{instance.name}: {instance.fmu.path} cannot be instantiated: {reason}"
            ) from None
        if failed is not None:
            process.close()
            raise rebuilt(failed)

    def _refused(self, sentence: str) -> SimulationError:
        return SimulationError(sentence, instance=self.name, time=0.0, code="fmu-not-loadable")

    def connect(self, buffers: Buffers) -> StepCalls:
        inputs, input_places, outputs, output_places, time, step = buffers
        assert self._process is not None
        board = SharedBuffer(self._process.memory, len(input_places), len(output_places))
        self._board = board
        self._ask("", None, "connect", list(input_places), list(output_places))
        board.step.value = step.value
        give = copying(inputs, board.inputs)
        take = copying(board.outputs, outputs)
        step_and_get = STEP | GET if len(outputs) else STEP
        waiting, fresh = 0, False

        def set_inputs() -> Status:
            nonlocal waiting
            give()
            if self._stepping:
                waiting = SET
                return OK
            return self._exchange(SET)

        def take_step() -> Status:
            nonlocal waiting, fresh
            board.time.value = time.value
            parts, waiting = waiting | step_and_get, 0
            fresh = True
            return self._exchange(parts)

        def get_outputs() -> Status:
            nonlocal fresh
            status = OK if fresh else self._exchange(GET)
            fresh = False
            take()
            return status

        def flush() -> Status:
            nonlocal waiting
            parts, waiting = waiting, 0
            return self._exchange(parts) if parts else OK

        self._flush: Callable[[], Status] = flush
        return StepCalls(set_inputs, take_step, get_outputs)

    def _exchange(self, parts: int) -> Status:
        if self._process is None:
            return FATAL
        try:
            answer = self._process.exchange(_BYTES[parts])
            self._answered += 256
            if self._board.answer.value != self._answered + answer:
                raise self._process.garbled(f"byte {answer}")
        except ProcessLost as lost:
            self._part, function = _PARTS.get(self._board.part.value, ("", ""))
            return self._lose(lost, function and self._prefix + function.format(self._real))
        if answer == OK:
            return OK
        self._part = _PARTS[answer >> 4][0]
        return answer & 15

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

    def _ask(self, function: str, failed: T, request: str, *arguments: Any) -> T:
        """Return the answer to a request, or `failed` if the process died."""
        if self._process is None:
            return failed
        self._part = ""
        try:
            answer: T = self._process.ask(request, *arguments)
            return answer
        except ProcessLost as lost:
            self._lose(lost, function)
            return failed

    def _lose(self, lost: ProcessLost, function: str) -> Status:
        """Log how the process was lost."""
        self._process = None
        errors = self._log.errors(self.name)
        before = f"; its last message: {' '.join(errors[-1].text.split())}" if errors else ""
        self._log.add(self.name, FATAL, KILLED if lost.killed else PROCESS, lost.in_(function) + before)
        return FATAL

    def free(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        try:
            process.ask("free")
        except ProcessLost as lost:  # the results are not affected
            text = lost.in_(f"{self._prefix}Terminate or {self._prefix}FreeInstance")
            self._log.add(self.name, WARNING, PROCESS, text)
        else:
            process.close()


_BYTES = [bytes([parts]) for parts in range(SET + STEP + GET + 1)]


class Isolation(contextlib.ExitStack):
    """A `run_lifecycle.OpenInstance` that isolates instances; their processes end with the `with` block."""

    def __init__(self, instances: Sequence[Instance], limit: float = CALL_LIMIT) -> None:
        """Remember the instances, so that their processes can start at the same time.

        Args:
            limit: time that a call of an FMU may take [s].
        """
        super().__init__()
        self._units = instances
        self._limit = limit
        self._processes: dict[str, InstanceProcess] = {}

    def __call__(self, instance: Instance, log: Log, corrupted: set[Path]) -> FmuInstance:
        """Return a new isolated instance. Fatal from one does not affect the others: they share nothing."""
        if not self._processes:
            for each in self._units:
                self._processes[each.name] = process = InstanceProcess(len(each.fmu.variables), self._limit)
                self.callback(process.close)
        return IsolatedInstance(instance, log, self._processes[instance.name])


@contextlib.contextmanager
def opener_of(
    plan: Plan, call_limit: float | None
) -> Iterator[Callable[[Instance, Log, set[Path]], FmuInstance]]:
    """Yield a function that opens the instances of a plan: in this process, or isolated if `call_limit` [s].

    Raises:
        SimulationError: isolation is not supported on this operating system.
    """
    if call_limit is None:
        yield open_instance
        return
    if sys.platform == "win32":
        raise SimulationError(
            "--isolate needs Linux or macOS.", instance=None, time=0.0, code="isolation-unavailable"
        )
    with Isolation(plan.instances, call_limit) as isolation:
        yield isolation


class InstanceServer:
    """Serves the master's requests to one FMU instance."""

    def __init__(self, channel: PipeChannel, memory: int) -> None:
        self._channel = channel
        self._memory = memory
        self._log = LogRelay(channel, timed=False)
        self._process_state: ProcessState | None = ProcessState()  # until stepping begins
        self._instance: CtypesInstance

    def serve(self) -> None:
        """Answer requests until the master is gone, or return in a copy forked by the FMU."""
        hear, say, answers = self._channel.hear, self._channel.say, [bytes([i]) for i in range(256)]
        process, count = os.getpid(), 0
        while (byte := hear()) is not None:
            parts = byte if byte <= SET | STEP | GET else 0
            if parts:
                answer, count = self.exchange(parts), count + 256
            else:
                name, arguments = self._channel.receive_object()
                reply = getattr(self if hasattr(self, name) else self._instance, name)(*arguments)
                if self._process_state is not None:
                    self._process_state.restore("", self._log)
            if os.getpid() != process:
                return
            if parts:
                self._answer.value = count + answer
                say(answers[answer])
            else:
                self._channel.send(REPLY, reply)

    def exchange(self, parts: int) -> int:
        """Do parts of a step in order; return the worst status plus 16 times the part it belongs to.

        Stops after a status worse than Warning.
        """
        answer = OK
        for part, call in self._calls:
            if not parts & part:
                continue
            self._part.value = part
            status = known(call())
            if status > answer % 16:
                answer = 16 * part + status
            if status > WARNING:
                break
        self._part.value = 0
        return answer

    def open(self, instance: Instance) -> dict[str, Any] | None:
        """Instantiate the FMU; return a description of the error if that fails."""
        try:
            self._instance = open_instance(instance, self._log, set())
        except YawbenchError as error:
            return error_record(error)
        return None

    def connect(self, input_places: Sequence[ValueRef], output_places: Sequence[ValueRef]) -> None:
        board = SharedBuffer(self._memory, len(input_places), len(output_places))
        calls = self._instance.connect(
            Buffers(board.inputs, input_places, board.outputs, output_places, board.time, board.step)
        )
        self._part = board.part
        self._answer = board.answer
        self._calls = ((SET, calls.set), (STEP, calls.step), (GET, calls.get))

    def exit(self) -> int:
        self._process_state = None
        return self._instance.exit()

    def free(self) -> None:
        """Free the instance and flush what its library has printed."""
        self._instance.free()
        self._log.finish()
        flush_output()


def main(*descriptors: str) -> None:
    """Serve the master: descriptors of the pipes for reading and writing, and of the shared memory."""
    reading, writing, memory = map(int, descriptors)
    stand_guard(reading, (writing, memory))
    channel = PipeChannel(reading, writing)
    channel.send(REPLY, "ready")
    try:
        InstanceServer(channel, memory).serve()
    except Exception as error:
        with contextlib.suppress(OSError):
            channel.send(FAILED, f"{type(error).__name__}: {error}")
        os._exit(1)
    os._exit(0)

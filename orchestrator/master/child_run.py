"""Runs in a child process: the instances are stepped there, while this process keeps the results.

An FMU that crashes, calls exit, hangs or closes all files does so in the child: the parent sees the child end
without its final record, and still has every row. So a run of third-party code never ends silently, and
Ctrl-C always works, whatever the FMU does with signals.

Chosen over isolating every third-party FMU by default, which costs 30 to 70 us per instance and step, and
over a hook that the C library calls at exit(), which neither _exit() nor a signal runs. This costs a fork, a
few milliseconds per run, and nothing per step. It does not protect instances from each other: see
`process_state` for what they may change for each other, and `isolation` for protection. It needs
fork(), and is used on Linux only.

Rows lie in memory shared by both processes: two blocks, one being filled by the child while the other is
being written by the parent. A pipe carries everything else, a few records per second.
"""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import json
import math
import mmap
import os
import sys
import threading
import time
import traceback
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from yawbench.fmus.fmu import Value
from yawbench.foundation.errors import Interrupted, SimulationError, YawbenchError, error_record, rebuilt
from yawbench.foundation.fork_server import ForkedChild, die_with_parent
from yawbench.foundation.interrupts import StopFlag, stop_requested_at
from yawbench.foundation.messages import listed
from yawbench.foundation.supervised_process import LOG, REPLY, PipeChannel, ProcessLost, ProtocolError

from ..plan import Plan
from ..results.recorder import BLOCK, RowBlock
from .fmi import open_instance
from .instance import CtypesInstance
from .isolation import Isolation
from .process_state import MASTER, WARNING, FmuProcess, Log, LogRelay, flush_output
from .run_lifecycle import OpenInstance, RunLifecycle, RunProgress
from .signal_pool import InstanceSlot
from .step_loop import WORDS, EndRequested, Master

ROWS, PROGRESS, ENDED, WHERE = 0x90, 0x91, 0x92, 0x93
"""First bytes of records from the child: a block of rows, progress, end of the run, current instance."""
TAKEN, FREE = b"\x01", b"\x02"
"""Bytes from the parent: the rows have been written; terminate and free the instances."""
ONLY_ASKING = b"\0"
"""Byte in place of the number of a signal: no stop is requested."""

_SLOT = 256
"""Bytes of shared memory per row for values that are not Real, so that they survive a crash of the child."""


class SharedProgress:
    """Memory shared by both processes: how far the run is, and two blocks of rows.

    `completed` is the last communication point reached, `returned` the time [s], by `time.monotonic`, at
    which a call of initialization last returned.
    """

    def __init__(self, width: int) -> None:
        """Allocate it for rows of `width` numbers."""
        self._map = mmap.mmap(-1, 16 + 16 * BLOCK * width)
        self._slots = mmap.mmap(-1, BLOCK * _SLOT)
        self.completed = ctypes.c_int64.from_buffer(self._map)
        self.completed.value = -1
        self.returned = ctypes.c_double.from_buffer(self._map, 8)
        self.returned.value = time.monotonic()
        self.blocks = np.frombuffer(self._map, float, offset=16).reshape(2, BLOCK, width)

    def keep(self, at: int, others: list[Value]) -> None:
        """Store the non-Real values of row `at` of the block being filled, unless they are too long."""
        data = json.dumps(others).encode()
        self._slots[at * _SLOT : (at + 1) * _SLOT] = (data if len(data) <= _SLOT else b"").ljust(_SLOT)

    def kept(self, count: int) -> list[list[Value]]:
        """Return the non-Real values of the first rows of the block being filled, as far as stored."""
        slots = [self._slots[at * _SLOT : (at + 1) * _SLOT].strip() for at in range(count)]
        return [json.loads(slot) for slot in itertools.takewhile(bool, slots)]


class _Others(list[list[Value]]):
    """Non-Real values, one list per row, also stored in shared memory in case the process dies."""

    def __init__(self, shared: SharedProgress) -> None:
        super().__init__()
        self._shared = shared

    def append(self, values: list[Value]) -> None:
        self._shared.keep(len(self), values)
        super().append(values)


class _Rows:
    """The run's rows (see `run_lifecycle.RecordedRows`), passed to the parent block by block."""

    def __init__(self, shared: SharedProgress, channel: PipeChannel) -> None:
        self._channel = channel
        self._blocks = [list(block) for block in shared.blocks]
        self._sent = 0  # blocks
        self._first = 0
        self.rows = self._blocks[0]
        self.others: list[list[Value]] = _Others(shared)

    def write(self, count: int) -> None:
        """Pass the first `count` rows on, once the block before has been written."""
        if count <= 0:
            return
        if self._sent and self._channel.hear() is None:
            os._exit(1)
        self._channel.send(ROWS, (self._first, count, self.others))
        self._sent += 1
        self._first += count
        self.others.clear()
        self.rows = self._blocks[self._sent % 2]


def step_units(
    plan: Plan,
    opener: OpenInstance,
    stop: StopFlag,
    shared: SharedProgress,
    channel: PipeChannel,
    asking: int,
) -> None:
    """Make the run in this process, which has just been forked. Never returns.

    Args:
        asking: pipe through which the parent requests a stop and asks for the current instance.
    """
    try:
        die_with_parent()
        os.setpgid(0, 0)  # signals to an FMU's group, and Ctrl-C, must not reach both
        for descriptor in map(int, os.listdir("/proc/self/fd")):
            if descriptor > 2 and descriptor not in (channel.reading, channel.writing, asking):
                with contextlib.suppress(OSError):  # the descriptor used for listing the folder
                    os.close(descriptor)
        _make(plan, opener, stop, shared, channel, asking)
    except OSError:
        os._exit(1)  # the parent is gone, or an FMU has closed the pipe to it
    except BaseException:
        traceback.print_exc()
        os._exit(1)
    os._exit(0)


def _make(
    plan: Plan,
    opener: OpenInstance,
    stop: StopFlag,
    shared: SharedProgress,
    channel: PipeChannel,
    asking: int,
) -> None:
    log = LogRelay(channel, timed=True)
    rows = _Rows(shared, channel)

    def progress(done: int, total: int) -> None:
        channel.send(PROGRESS, (done, total))

    course = RunLifecycle(plan, rows, log, stop, progress, shared.completed, shared.returned)
    _tell_where(channel, asking, stop)
    error = _go(course, opener)
    log.finish()
    ending = course.ended and (str(course.ended), course.ended.instance, course.ended.time)
    channel.send(ENDED, (course.passes, course.loop, ending, error))
    while (byte := channel.hear()) != FREE[0]:
        if byte is None:
            return
    course.end()
    if isinstance(opener, Isolation):
        opener.close()  # processes of instances that were never opened
    log.finish()
    flush_output()
    channel.send(REPLY, None)


def _go(course: RunLifecycle, opener: OpenInstance) -> dict[str, Any] | None:
    """Open, initialize, step; return a description of the error if that fails."""
    try:
        course.go(opener)
    except (YawbenchError, Interrupted) as error:
        instance = getattr(error, "instance", None)
        return {**error_record(error), "inputs": course.inputs_of(instance) if instance else {}}
    except MemoryError:
        return {"kind": MemoryError.__name__, "inputs": {}}
    except BaseException:
        return {"kind": "", "traceback": traceback.format_exc(), "inputs": {}}
    return None


def _tell_where(channel: PipeChannel, asking: int, stop: StopFlag) -> None:
    """Start a thread that reports the current instance and stops the run; also report exit() by an FMU."""
    stepping, process = threading.get_ident(), os.getpid()

    def answer() -> None:
        with contextlib.suppress(OSError):  # the parent is gone
            while number := os.read(asking, 1):
                if number != ONLY_ASKING:
                    stop.request(number[0])
                channel.send(WHERE, _whereabouts(stepping))

    threading.Thread(target=answer, daemon=True).start()

    def at_exit(status: int, _: int | None) -> None:
        if os.getpid() == process:
            with contextlib.suppress(OSError):
                channel.send(WHERE, _whereabouts(stepping))
        os._exit(status)

    callback = ctypes.CFUNCTYPE(None, ctypes.c_int, ctypes.c_void_p)(at_exit)
    _kept.append(callback)
    ctypes.CDLL(None).on_exit(callback, None)


_kept: list[Any] = []


def _whereabouts(thread: int) -> tuple[str, str] | None:
    """Return the instance whose code a thread is executing, and the operation; None outside all instances."""
    frame, position, function = sys._current_frames().get(thread), None, ""
    here = str(Path(__file__).parent)
    while frame is not None:
        if frame.f_code.co_filename.startswith(here):
            local = frame.f_locals
            if frame.f_code is Master._loop.__code__ and "call" in local:
                operation = local["self"].operation_of(local["k"], local["call"])
                return operation and (operation.instance, WORDS.get(operation.kind, operation.kind))
            if frame.f_code is Master._walk.__code__:
                operation = local["self"].walked_operation()
                return operation and (operation.instance, WORDS.get(operation.kind, operation.kind))
            if isinstance(local.get("self"), CtypesInstance):
                ending = frame.f_code.co_name == CtypesInstance.free.__name__
                function = function or _function_called(frame.f_code.co_name, local)
                position = local["self"].name, "its end" if ending else f"initialization{function}"
            elif position is None and isinstance(local.get("s"), InstanceSlot):
                position = local["s"].name, "initialization (setting inputs or reading outputs)"
        frame = frame.f_back
    return position


def _function_called(caller: str, local: Mapping[str, Any]) -> str:
    """Return the FMI function that a method of `CtypesInstance` is calling, in parentheses; "" if unknown."""
    match caller:
        case "_load":
            return " (loading its library)"
        case "_instantiate":
            name = "Instantiate"
        case "_do":
            name = local["name"]
        case "_access":
            name = local["verb"] + local["kind"]
        case _:
            return ""
    return f" ({local['self'].prefix}{name})"


INITIALIZATION_LIMIT = 60.0
"""Time that a call of an FMU may take during initialization [s]; chosen: enough to load Python and large
tables from a slow disk, as `isolation.START_LIMIT`. --isolate --call-limit allows more."""
ASKED = 1.0
"""Time for an answer to the question where the child is [s]; chosen: far longer than an answer takes."""
ASK_EVERY = 0.1
"""Time between questions to a child that is to stop [s]; chosen: it may have come to another instance."""
KILL_AFTER = 3.0
"""Time from a stop request until the child is killed [s]; chosen: far longer than a step."""
END_LIMIT = 10.0
"""Time allowed for terminating and freeing the instances [s]; the results are written by then."""


def can_be_apart() -> bool:
    """Return whether runs in a child process are supported here: Linux, and the main thread (for signals)."""
    return sys.platform == "linux" and threading.current_thread() is threading.main_thread()


class ChildRun(RunLifecycle, FmuProcess):
    """Runs a plan in a child process."""

    unasked = (LOG, ROWS, PROGRESS, WHERE)

    def __init__(
        self, plan: Plan, rows: RowBlock, log: Log, stop: StopFlag, progress: RunProgress | None
    ) -> None:
        RunLifecycle.__init__(self, plan, rows, log, stop, progress)
        self._rows: RowBlock = rows
        self._shared = SharedProgress(len(rows.rows[0]))
        self._blocks = 0  # written
        self._inputs: dict[str, Value] = {}
        self._where: tuple[str, str] | None = None
        self._started = False
        self._suspects: list[str] = []  # instances that may have ended the process
        self._told_end = False
        self._sealed = False  # no more rows are written
        self._limit = INITIALIZATION_LIMIT
        self._asked_at: float | None = None  # when a call of initialization exceeded its limit
        self._stopped_at = -math.inf  # when the child was last asked to stop

    def inputs_of(self, instance: str) -> dict[str, Value]:
        """Return the inputs with which the failed instance was last stepped."""
        return self._inputs

    def go(self, opener: OpenInstance) -> None:
        if opener is open_instance:
            self._suspects = [u.name for u in self.plan.instances if u.fmu.compiled]
        if isinstance(opener, Isolation):  # which has limits of its own
            self._limit = math.inf
        stop_pipe, self._asking = os.pipe()
        try:
            FmuProcess.__init__(self, partial(self._forked, opener, stop_pipe), self.log)
            self._started = True
        finally:
            os.close(stop_pipe)
        try:
            self.passes, self.loop, ending, failed = self.hear(ENDED)
        except ProcessLost as lost:
            raise self._death(lost) from None
        self._told_end = True
        if ending is not None:
            reason, instance, at = ending
            self.ended = EndRequested(reason, instance=instance, time=at)
        if failed is not None:
            self._inputs = failed["inputs"]
            if failed["kind"] == MemoryError.__name__:
                raise MemoryError
            raise rebuilt(failed) if failed["kind"] else RuntimeError(failed["traceback"])

    def _forked(self, opener: OpenInstance, stop_pipe: int, commands: int, answers: int) -> ForkedChild:
        flush_output()
        process = os.fork()
        if process == 0:
            step_units(self.plan, opener, self._stop, self._shared, PipeChannel(commands, answers), stop_pipe)
        return ForkedChild(process)

    def take(self, kind: int, content: Any) -> None:
        match kind, content:
            case _, [int() as first, int() as count, list() as others] if kind == ROWS:
                if first != self.handed_over:
                    raise ProtocolError(f"rows from {first}, not {self.handed_over}")
                self._record(count, others)
                self._blocks += 1
                with contextlib.suppress(BrokenPipeError):
                    self._channel.say(TAKEN)
            case _, [int() as done, int() as total] if kind == PROGRESS:
                if self._progress is not None:
                    self._progress(done, total)
            case _, [str() as instance, str() as what] if kind == WHERE:
                self._where = instance, what
            case _, None if kind == WHERE:
                pass
            case _:
                super().take(kind, content)

    def _record(self, count: int, others: list[list[Value]]) -> None:
        if self._sealed:
            self.handed_over += count
            return
        self._sealed = True  # if this fails, later rows must not be written either
        self._rows.lay(self._shared.blocks[self._blocks % 2])
        self._rows.others[:] = others
        self._hand_over(count)
        self._sealed = False

    def flush(self) -> None:
        """Write the rows that the child has left in shared memory."""
        count = self._shared.completed.value + 1 - self.handed_over
        others = []
        if len(self.plan.record) + 1 > len(self._rows.rows[0]):  # some columns are not Real
            others = self._shared.kept(count) if count <= BLOCK else []
            count = len(others)
        self._record(min(count, BLOCK), others)
        self._sealed = True

    def check_time(self) -> None:
        """Pass a stop request on to the child; kill it if it does not stop, or takes too long to end."""
        now, requested = time.monotonic(), stop_requested_at()
        if requested is not None and now - self._stopped_at > ASK_EVERY:  # not after each of its answers
            self._stopped_at = now
            self._ask(bytes([self._stop.number]))
        if self._shared.completed.value < 0 and now - self._shared.returned.value > self._limit:
            self._end_hanging(now)
        if now > self._deadline or (requested is not None and now - requested > KILL_AFTER):
            self.close()
            raise ProcessLost("did not respond")

    def _end_hanging(self, now: float) -> None:
        """Ask where the child is hanging; kill it once it has answered, or has had the time to."""
        if self._asked_at is None:
            self._asked_at = now
            self._ask(ONLY_ASKING)
        elif self._where is not None or now - self._asked_at > ASKED:
            self.close()
            limit = f"{self._limit:g} s, the limit of a call during initialization"
            raise ProcessLost(f"did not return within {limit} (--isolate --call-limit allows more)")

    def _ask(self, what: bytes) -> None:
        """Ask the child to report its current instance, and to stop if a signal has requested it."""
        with contextlib.suppress(OSError):
            os.write(self._asking, what)

    def close(self, *, kill: bool = True) -> int:
        """Kill the process and those that FMUs have started; return its return code."""
        if not self._closed:
            self.child.kill(group=True)
            os.close(self._asking)
        return super().close(kill=True)

    def _death(self, lost: ProcessLost) -> SimulationError | Interrupted:
        """Return the exception for the death of the child process."""
        completed = self._shared.completed.value
        instance, doing = self._where or (None, "step" if completed >= 0 else "initialization")
        if instance is None and len(self._suspects) == 1:
            instance = self._suspects[0]
        period = next((u.period for u in self.plan.instances if u.name == instance), 1)
        now = self.plan.time(max(0, completed + 1 - period if (completed + 1) % period == 0 else completed))
        sentence = f"{doing} failed at t = {now:.9g} s: the process of the run {lost}"
        if instance is not None:
            sentence = f"{instance}: {sentence}"
        elif self._suspects:
            sentence += (
                f"; --isolate shows which instance it was (not in Python are {listed(self._suspects)})"
            )
        if self._stop.requested:
            return self._stop.interrupted(f": {sentence}", instance=instance, time=now)
        code = "run-process-died" if lost.killed else "fmu-process-died"
        return SimulationError(sentence, instance=instance, time=now, code=code)

    def end(self) -> None:
        """Let the child terminate and free the instances; a crash there is only a warning."""
        if not self._started or self._closed:
            return
        self._sealed, self._where = True, None
        self._deadline = time.monotonic() + END_LIMIT
        try:
            if not self._told_end:
                self._ask(bytes([self._stop.number]))
                self.hear(ENDED)
            self._where = None  # an answer from before the end of the run
            self._channel.say(FREE)
            self.hear(REPLY)
        except (ProcessLost, OSError) as lost:
            instance = self._where[0] if self._where else ", ".join(self._suspects) or "the instances"
            text = f"while instances were terminated and freed, the process of the run {lost}"
            self.log.add(
                instance, WARNING, MASTER, text, self.plan.time(max(0, self._shared.completed.value))
            )
        self.close()

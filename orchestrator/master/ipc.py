"""Inter-process communication of the master with processes that run FMUs; the guardian that ends them.

The Real values of a step, its time and its size lie in shared memory; two pipes carry single bytes: which of
set, step and get to do, and how that ended. Such an exchange costs 7 us on one core and 50 us from core to
core, most of it the two context switches; a pair of pipes was the fastest of the mechanisms that report the
death of the other side at once. Everything else, and the messages that the FMU logs meanwhile, is a tagged
record of a few hundred bytes.

An FMU can write into the pipe to the master. So records from there are checked (see `supervised_process`); a
stray byte is recognized by comparison with the last answer and its number in shared memory; and waiting for
a record is limited by the time limit of a call.

The guardian is a process between master and isolated instance: nothing that the FMU has started outlives it.
It is forked before the FMU is loaded and adds nothing to the cost of an exchange: it sleeps until the
instance's process or the master has ended (even by SIGKILL), then kills what is left. On Linux these are all
descendants, daemons too, which become its children when their parents die; elsewhere it is the process group
of the instance.
"""

from __future__ import annotations

import contextlib
import ctypes
import mmap
import os
import resource
import select
import signal
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ..errors import Diagnostic, Interrupted, YawbenchError
from ..fork_server import Child, die_with_parent, prctl
from ..supervised_process import LOG, PipeChannel, ProtocolError, SupervisedProcess
from .process_state import KEPT, Log

SET, STEP, GET = 1, 2, 4
"""Parts of an exchange, in this order; a sum of them asks for several."""
_HEAD = 4  # numbers before the inputs: time, step size, part being done, last answer


class SharedBuffer:
    """Shared memory of an instance: time and step size [s], current part, last answer, inputs, outputs."""

    def __init__(self, descriptor: int, inputs: int, outputs: int) -> None:
        """Map the file of `shared_memory` for the given numbers of inputs and outputs."""
        self._map = mmap.mmap(descriptor, size_of(inputs + outputs))
        self.time = ctypes.c_double.from_buffer(self._map, 0)
        self.step = ctypes.c_double.from_buffer(self._map, 8)
        self.part = ctypes.c_int64.from_buffer(self._map, 16)
        self.answer = ctypes.c_int64.from_buffer(self._map, 24)
        """Number of the exchange times 256, plus its result."""
        self.inputs = np.frombuffer(self._map, float, inputs, 8 * _HEAD)
        self.outputs = np.frombuffer(self._map, float, outputs, 8 * (_HEAD + inputs))


def size_of(values: int) -> int:
    """Return the size of a `SharedBuffer` with `values` inputs and outputs [B]."""
    return 8 * (_HEAD + values)


def shared_memory(values: int) -> int:
    """Return the descriptor of an anonymous file for a `SharedBuffer` of `values` inputs and outputs."""
    if hasattr(os, "memfd_create"):
        descriptor = os.memfd_create("yawbench")
    else:
        with tempfile.TemporaryFile() as file:
            descriptor = os.dup(file.fileno())
    os.truncate(descriptor, size_of(values))
    return descriptor


def error_record(error: YawbenchError | Interrupted) -> dict[str, Any]:
    """Return an error as JSON-ready data, for `rebuilt` in another process."""
    where = {name: value for name, value in vars(error).items() if name in ("instance", "time", "number")}
    diagnostics = [diagnostic.record() for diagnostic in error.diagnostics]
    return {"kind": type(error).__name__, "diagnostics": diagnostics, "where": where}


def rebuilt(record: dict[str, Any]) -> YawbenchError | Interrupted:
    """Return the error of an `error_record` from another process."""
    kinds = {kind.__name__: kind for kind in (*YawbenchError.__subclasses__(), Interrupted)}
    kind = kinds.get(record["kind"], YawbenchError)
    error: YawbenchError | Interrupted = kind(map(Diagnostic.of, record["diagnostics"]), **record["where"])
    return error


class LogRelay(Log):
    """Log that passes messages on at once, as the FMU may be about to crash; a flood is only counted.

    Args:
        timed: the simulation time of the messages is known in this process.
    """

    def __init__(self, channel: PipeChannel, *, timed: bool) -> None:
        super().__init__()
        self._channel = channel
        self._timed = timed
        self._unreported = 0  # dropped messages not passed on yet

    def add(self, instance: str, status: int, category: str, text: str, time: float | None = None) -> None:
        kept = len(self.messages)
        super().add(instance, status, category, text, time)
        if len(self.messages) > kept:
            last = self.messages[-1]
            at = last.time if self._timed else None
            self._channel.send(LOG, (instance, last.status, category, last.text, at))

    def drop(self, count: int) -> None:
        super().drop(count)
        self._unreported += count
        if self._unreported >= KEPT:
            self.finish()

    def finish(self) -> None:
        """Pass on the number of messages dropped since the last call."""
        if self._unreported:
            count, self._unreported = self._unreported, 0
            self._channel.send(LOG, count)


class FmuProcess(SupervisedProcess):
    """Parent's side of a process that runs FMUs, and passes on what they log."""

    unasked: ClassVar[tuple[int, ...]] = (LOG,)

    def __init__(self, start: Callable[[int, int], Child], log: Log) -> None:
        super().__init__(start)
        self.log = log

    def take(self, kind: int, content: Any) -> None:
        """Log a message of an FMU, or the number of dropped messages (see `LogRelay`)."""
        if kind != LOG:
            return super().take(kind, content)
        match content:
            case int():
                self.log.drop(content)
            case [
                str() as instance,
                int() as status,
                str() as category,
                str() as text,
                float() | None as time,
            ]:
                self.log.add(instance, status, category, text, time)
            case _:
                raise ProtocolError("an invalid message")
        return None


_PR_SET_CHILD_SUBREAPER = 36  # linux/prctl.h
PATIENCE = 2.0
"""Time spent on killing descendants [s]: a process may start new ones faster than they can be killed."""


def stand_guard(reading: int, others: Iterable[int]) -> None:
    """Fork a guardian; return only in the child, which becomes the instance's process.

    Args:
        reading: pipe from the master; it closes when the master ends.
        others: descriptors that only the instance's process needs.
    """
    prctl(_PR_SET_CHILD_SUBREAPER, 1)
    waking, woken = os.pipe()
    os.set_blocking(woken, False)
    signal.signal(signal.SIGCHLD, lambda number, frame: None)
    signal.set_wakeup_fd(woken, warn_on_full_buffer=False)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    guardian = os.getpid()
    child = os.fork()
    if child:
        try:
            _watch(child, reading, waking, others)
        finally:
            os._exit(1)
    signal.set_wakeup_fd(-1)
    for number in (signal.SIGCHLD, signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    for descriptor in (waking, woken):
        os.close(descriptor)
    for descriptor in (reading, *others):
        os.set_inheritable(descriptor, False)  # not by programs that the FMU starts
    os.setsid()  # signals to its group must not reach the guardian
    die_with_parent()
    if os.getppid() != guardian:
        os._exit(1)


def _watch(process: int, reading: int, waking: int, others: Iterable[int]) -> None:
    """Wait until the instance's process or the master ends; kill what is left; exit with the same status."""
    for descriptor in others:
        os.close(descriptor)
    events = select.poll()
    events.register(reading, 0)  # no events requested: only the end of the pipe is reported
    events.register(waking, select.POLLIN)
    ended: dict[int, int] = {}
    while process not in ended:
        ready = [descriptor for descriptor, _ in events.poll()]
        _reap(ended)
        if reading in ready:
            break
        os.read(waking, 512)
    _kill_all(process, ended)
    code = os.waitstatus_to_exitcode(ended.get(process, 0))
    if code >= 0:
        os._exit(code)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(OSError, ValueError):
        signal.signal(-code, signal.SIG_DFL)
    os.kill(os.getpid(), -code)
    os._exit(128 - code)


def _kill_all(process: int, ended: dict[int, int]) -> None:
    """Kill the instance's process and everything it has started."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        with contextlib.suppress(OSError):
            os.killpg(process, signal.SIGKILL)
        for child in _children():
            with contextlib.suppress(OSError):
                os.kill(child, signal.SIGKILL)
        if not _reap(ended):
            break
        time.sleep(0.001)


def _children() -> list[int]:
    try:
        return [int(word) for word in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()]
    except OSError:  # not Linux
        return []


def _reap(ended: dict[int, int]) -> bool:
    """Collect the exit statuses of ended children; return whether children are left."""
    with contextlib.suppress(ChildProcessError):
        while (child := os.waitpid(-1, os.WNOHANG))[0]:
            ended.setdefault(*child)
        return True
    return False

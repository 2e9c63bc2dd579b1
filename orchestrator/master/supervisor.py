"""Processes at the other ends of two pipes: listened to, watched, ended.

One is that of an isolated unit, here; the other that in which the units of a run are stepped (see `apart`).

The process that stands between master and unit, so that nothing a unit has started outlives it.

Every isolated unit has one, forked before the FMU is loaded, and costs an exchange nothing: it
sleeps until the unit's process has ended or the master has (even by SIGKILL), then kills what is left.
On Linux that is all descendants, daemons too: they become its children when their parents die.
Elsewhere it is the unit's process group.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import select
import signal
import subprocess
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, ClassVar

from ..processes import how_it_ended, python
from .ipc import ANSWER, FAILED, LOG, REPLY, PipeChannel, ProtocolError, shared_memory
from .log import Log
from .process_state import stop_requested_at

START_LIMIT = 60.0
"""Time that a process may take to start [s]; chosen: Python is read from a slow disk in less."""
LOOK_EVERY = 100
"""Time between two looks at the clock while an answer is waited for [ms]."""
STOP_GRACE = 1.0
"""Time that a call may still take when the run is to stop [s]; chosen: as long as one likes to wait."""
CLOSING = 1.0
"""Time in which a process that has closed its pipe is seen to end [s]."""
GRACE = 5.0
"""Time that the process of a unit may take to end when nobody is left to ask it [s]."""


class ProcessLost(Exception):
    """A process that gave no answer; it is gone, or has been ended because of that.

    Args:
        did: what it did, as "died of SIGSEGV".
        late: it is the FMI function being called that did, or did not.
    """

    def __init__(self, did: str, *, late: bool = False) -> None:
        super().__init__(did)
        self._late = late

    def in_(self, function: str) -> str:
        """Return what the process of a unit did, with the FMI function being called ("" for none)."""
        if self._late:
            return f"{function or 'its process'} {self}"
        return f"its process {self}" + (f" in {function}" if function else " between two calls")


class SupervisedProcess(ABC):
    """The hold on a process. All calls that wait for it raise `Lost` if no answer comes."""

    unasked: ClassVar[tuple[int, ...]]
    """First bytes of the records that it may send at any time, beside what is logged in it."""
    log: Log

    def _start(self, start: Callable[[int, int], Any]) -> Any:
        """Let `start` make it, given its ends of the pipes to read from and to write into."""
        commands, writing = os.pipe()
        reading, answers = os.pipe()
        try:
            return start(commands, answers)
        finally:
            os.close(commands)
            os.close(answers)
            self._channel = PipeChannel(reading, writing, self._wait_for_more)
            self._poll = select.poll()
            self._poll.register(reading, select.POLLIN)

    @abstractmethod
    def _take(self, kind: int, content: Any) -> None:
        """Take a record that came unasked; raise `Garbled` if it is none."""

    @abstractmethod
    def _check_time(self) -> None:
        """Raise `Lost` if it has had time enough."""

    @abstractmethod
    def _has_ended(self, within: float) -> bool:
        """Return whether it ends within a time [s]."""

    @abstractmethod
    def close(self) -> int:
        """End it and all that it has started, whatever they are doing; return its exit status. Once."""

    def _hear(self, wanted: int) -> Any:
        """Take what comes until it is the record, or the answer of one byte, that is wanted; return it."""
        try:
            while True:
                self._wait_for_more()
                kind = self._channel.hear()
                if kind is None:
                    raise EOFError
                if kind <= ANSWER and wanted == ANSWER:
                    return kind
                if kind not in (wanted, LOG, *self.unasked):
                    raise ProtocolError(f"byte {kind}")
                content = self._channel.receive()
                if kind == wanted:
                    return content
                if kind == LOG:
                    self._keep(content)
                else:
                    self._take(kind, content)
                self._check_time()
        except EOFError:
            ended = self._has_ended(CLOSING)
            code = self.close()
            raise ProcessLost(how_it_ended(code) if ended else "closed the pipe to the master") from None
        except ProtocolError as error:
            raise self.garbled(str(error)) from None

    def _keep(self, content: Any) -> None:
        """Keep what a unit logs: a message, or how many more there were (see `exchange.Relay`)."""
        match content:
            case int():
                self.log.drop(content)
            case [str() as unit, int() as status, str() as category, str() as text, float() | None as time]:
                self.log.add(unit, status, category, text, time)
            case _:
                raise ProtocolError("a message that is none")

    def _wait_for_more(self) -> None:
        while not self._poll.poll(LOOK_EVERY):
            self._check_time()
            if self._has_ended(0.0) and not self._poll.poll(0):
                raise EOFError  # something that a unit has started holds the pipe open

    def garbled(self, what: str) -> ProcessLost:
        """End it, for its answers can no longer be told from what else came; return what to raise."""
        self.close()
        return ProcessLost(f"wrote into the pipe to the master what is no answer ({what})")


class InstanceProcess(SupervisedProcess):
    """The process of one isolated unit."""

    unasked = (FAILED,)

    def __init__(self, values: int, limit: float) -> None:
        """Start it, without waiting for it.

        Args:
            values: number of inputs and outputs for which there shall be room.
            limit: time that an answer may take [s].
        """
        self._limit = limit
        self.memory = shared_memory(values)
        self._deadline = 0.0
        self._closed = False
        self._popen = self._start(self._spawned)

    def _spawned(self, commands: int, answers: int) -> subprocess.Popen[bytes]:
        theirs = (commands, answers, self.memory)
        return subprocess.Popen(
            python("orchestrator.master.isolation", *theirs),
            stdin=subprocess.DEVNULL,
            pass_fds=theirs,
            start_new_session=True,  # Ctrl-C on the terminal is for the master
        )

    def wait_until_ready(self) -> None:
        """Wait until it can be asked."""
        self._answer(START_LIMIT, REPLY)

    def ask(self, request: str, *arguments: Any) -> Any:
        """Return the answer to a request (a method of `worker.Worker`)."""
        with contextlib.suppress(BrokenPipeError):  # why is found where the answer should be
            self._channel.order((request, arguments))
        return self._answer(self._limit, REPLY)

    def exchange(self, parts: bytes) -> int:
        """Let it do parts of a step; return how that ended (see `worker.Worker.exchange`)."""
        with contextlib.suppress(BrokenPipeError):
            self._channel.say(parts)
        return self._answer(self._limit, ANSWER)

    def _answer(self, limit: float, wanted: int) -> Any:
        self._deadline = time.monotonic() + limit
        return self._hear(wanted)

    def _take(self, kind: int, content: Any) -> None:
        self.close()
        raise ProcessLost(f"failed: {content}")

    def _check_time(self) -> None:
        now, asked = time.monotonic(), stop_requested_at()
        if asked is not None and now - asked > STOP_GRACE:
            self.close()
            raise ProcessLost("did not come back when the run was to stop", late=True)
        if now > self._deadline:
            self.close()
            limit = f"{self._limit:g} s, the limit of a call (--call-limit)"
            raise ProcessLost(f"did not come back within {limit}", late=True)

    def _has_ended(self, within: float) -> bool:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._popen.wait(within)
            return True
        return False

    def close(self) -> int:
        if not self._closed:
            self._closed = True
            self._channel.close()  # its guardian wakes up
            os.close(self.memory)
            if not self._has_ended(GRACE):
                self._popen.kill()
                self._popen.wait()
        return self._popen.returncode


_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36  # linux/prctl.h
PATIENCE = 2.0
"""Time for which what is left is killed [s]: something may start processes faster than they end."""


def stand_guard(reading: int, others: Iterable[int]) -> None:
    """Fork; return in the child, which is to be the unit's process, and never in the guardian.

    Args:
        reading: pipe from the master; when it has no writer any more, the master is gone.
        others: descriptors that only the unit's process needs.
    """
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    waking, woken = os.pipe()
    os.set_blocking(woken, False)
    signal.signal(signal.SIGCHLD, lambda number, frame: None)
    signal.set_wakeup_fd(woken, warn_on_full_buffer=False)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    guardian = os.getpid()
    unit = os.fork()
    if unit:
        try:
            _watch(unit, reading, waking, others)
        finally:
            os._exit(1)
    signal.set_wakeup_fd(-1)
    for number in (signal.SIGCHLD, signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    for descriptor in (waking, woken):
        os.close(descriptor)
    for descriptor in (reading, *others):
        os.set_inheritable(descriptor, False)  # by programs that the FMU starts
    os.setsid()  # what it sends to its group is not for the guardian
    die_with_parent()
    if os.getppid() != guardian:
        os._exit(1)


def _watch(unit: int, reading: int, waking: int, others: Iterable[int]) -> None:
    """Wait for the unit's process or the master to end; kill what is left; end as the unit's did."""
    for descriptor in others:
        os.close(descriptor)
    events = select.poll()
    events.register(reading, 0)  # nothing is asked for, so what comes is the end of the pipe
    events.register(waking, select.POLLIN)
    ended: dict[int, int] = {}
    while unit not in ended:
        ready = [descriptor for descriptor, _ in events.poll()]
        _reap(ended)
        if reading in ready:
            break
        os.read(waking, 512)
    _kill_all(unit, ended)
    code = os.waitstatus_to_exitcode(ended.get(unit, 0))
    if code >= 0:
        os._exit(code)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(OSError, ValueError):
        signal.signal(-code, signal.SIG_DFL)
    os.kill(os.getpid(), -code)
    os._exit(128 - code)


def _kill_all(unit: int, ended: dict[int, int]) -> None:
    """Kill the unit's process and all that it has started."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        with contextlib.suppress(OSError):
            os.killpg(unit, signal.SIGKILL)
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
    """Note how children have ended that did; return whether there are more."""
    with contextlib.suppress(ChildProcessError):
        while (child := os.waitpid(-1, os.WNOHANG))[0]:
            ended.setdefault(*child)
        return True
    return False


def die_with_parent() -> None:
    """Let this process be killed when the one that has forked it ends (Linux)."""
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _prctl(option: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)

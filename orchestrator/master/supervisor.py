"""Supervised child processes: connected by two pipes, watched, and ended with everything they started.

`SupervisedProcess` is the parent's side, for isolated instances (`InstanceProcess`) and for child runs (see
`child_run`).

A guardian process, forked before the FMU is loaded, stands between the master and each isolated instance so
that nothing the FMU has started outlives it. It adds nothing to the cost of an exchange: it sleeps until the
instance's process or the master has ended (even by SIGKILL), then kills what is left. On Linux these are all
descendants, daemons too, which become its children when their parents die; elsewhere it is the process group
of the instance.
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
"""Time that a process may take to start [s]; chosen: enough to load Python from a slow disk."""
LOOK_EVERY = 100
"""Interval between checks of the time limit while waiting for an answer [ms]."""
STOP_GRACE = 1.0
"""Time that a call may still take after a stop request [s]; chosen: a tolerable wait for the user."""
CLOSING = 1.0
"""Time allowed for a process to end after it has closed its pipe [s]."""
GRACE = 5.0
"""Time allowed for an instance's process to end after its pipes are closed [s]."""


class ProcessLost(Exception):
    """A supervised process gave no answer: it has died, or was killed because of that.

    Args:
        did: what happened to it, such as "died of SIGSEGV".
        late: the cause is the FMI function being called, which did not return in time.
    """

    def __init__(self, did: str, *, late: bool = False) -> None:
        super().__init__(did)
        self._late = late

    def in_(self, function: str) -> str:
        """Return the message for a loss during a call of an FMI function ("": between two calls)."""
        if self._late:
            return f"{function or 'its process'} {self}"
        return f"its process {self}" + (f" in {function}" if function else " between two calls")


class SupervisedProcess(ABC):
    """Parent's side of a child process. All calls that wait for it raise `ProcessLost` if no answer comes."""

    unasked: ClassVar[tuple[int, ...]]
    """First bytes of the records that it may send at any time, in addition to log messages."""
    log: Log

    def _start(self, start: Callable[[int, int], Any]) -> Any:
        """Create the pipes and call `start` with the child's ends, for reading and for writing."""
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
        """Handle an unsolicited record; raise `ProtocolError` if it is not valid."""

    @abstractmethod
    def _check_time(self) -> None:
        """Raise `ProcessLost` if the time limit has passed."""

    @abstractmethod
    def _has_ended(self, within: float) -> bool:
        """Wait up to a time [s] for the process to end; return whether it has."""

    @abstractmethod
    def close(self) -> int:
        """Kill the process and everything it started; return its exit status. Later calls do nothing."""

    def _hear(self, wanted: int) -> Any:
        """Handle incoming records until the expected record or one-byte answer arrives; return it."""
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
        """Log a message of an FMU, or the number of dropped messages (see `ipc.LogRelay`)."""
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
                raise EOFError  # a process started by an FMU keeps the pipe open

    def garbled(self, what: str) -> ProcessLost:
        """Kill the process, whose output can no longer be parsed; return the exception to raise."""
        self.close()
        return ProcessLost(f"wrote into the pipe to the master what is no answer ({what})")


class InstanceProcess(SupervisedProcess):
    """The process of one isolated instance."""

    unasked = (FAILED,)

    def __init__(self, values: int, limit: float) -> None:
        """Start the process without waiting for it.

        Args:
            values: number of inputs and outputs to allocate shared memory for.
            limit: time that an answer may take [s].
        """
        self._limit = limit
        self.memory = shared_memory(values)
        self._deadline = 0.0
        self._closed = False
        self._popen = self._start(self._spawned)

    def _spawned(self, commands: int, answers: int) -> subprocess.Popen[bytes]:
        descriptors = (commands, answers, self.memory)
        return subprocess.Popen(
            python("orchestrator.master.isolation", *descriptors),
            stdin=subprocess.DEVNULL,
            pass_fds=descriptors,
            start_new_session=True,  # Ctrl-C on the terminal is handled by the master alone
        )

    def wait_until_ready(self) -> None:
        """Wait until the process is ready for requests."""
        self._answer(START_LIMIT, REPLY)

    def ask(self, request: str, *arguments: Any) -> Any:
        """Call a method of the process's `InstanceServer` or of its instance; return the result."""
        with contextlib.suppress(BrokenPipeError):  # the cause is found when the answer is read
            self._channel.order((request, arguments))
        return self._answer(self._limit, REPLY)

    def exchange(self, parts: bytes) -> int:
        """Have it do parts of a step; return the result (see `isolation.InstanceServer.exchange`)."""
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
            self._channel.close()  # wakes its guardian
            os.close(self.memory)
            if not self._has_ended(GRACE):
                self._popen.kill()
                self._popen.wait()
        return self._popen.returncode


_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36  # linux/prctl.h
PATIENCE = 2.0
"""Time spent on killing descendants [s]: a process may start new ones faster than they can be killed."""


def stand_guard(reading: int, others: Iterable[int]) -> None:
    """Fork a guardian; return only in the child, which becomes the instance's process.

    Args:
        reading: pipe from the master; it closes when the master ends.
        others: descriptors that only the instance's process needs.
    """
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
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


def die_with_parent() -> None:
    """Have this process killed when its parent ends (Linux)."""
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _prctl(option: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)

"""Supervised child processes: connected by two pipes, limited in time, ended with everything they started.

`SupervisedProcess` is the parent's side of all of them: isolated instances (`master.isolation`), runs in a
child process (`master.child_run`) and the workers of pools (`workers`). `PipeChannel` is one side's end of
the pipes.

An FMU can write into any file that its process has open, including the pipe to the parent. So records from a
process that runs FMUs of unknown origin are JSON and checked, never unpickled.

The guardian (`stand_guard`) is a process between the parent and one that runs FMUs of unknown origin: nothing
that an FMU has started outlives it. It is forked before the FMU is loaded and adds nothing to the cost of an
exchange: it sleeps until that process or the parent has ended (even by SIGKILL), then kills what is left. On
Linux these are all descendants, daemons too, which become its children when their parents die; elsewhere it
is the process group.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import pickle
import select
import signal
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, ClassVar

from .fork_server import Child, die_with_parent, how_it_ended, prctl

ANSWER = 0x7F
"""Largest byte that is an answer by itself."""
REQUEST, LOG, REPLY, FAILED = 0x80, 0x81, 0x82, 0x83
"""First bytes of records: the parent's request, a log message, the reply, the reason of a failure."""
LONGEST = 1 << 26
"""Largest record from an untrusted process [B]; chosen: far longer than any text of an FMU."""
LOOK_EVERY = 100
"""Interval between checks of the time limit while waiting for an answer [ms]."""
CLOSING = 1.0
"""Time allowed for a process to end after it has closed its pipe [s]."""
GRACE = 5.0
"""Time allowed for a process to end after its pipes are closed [s]."""

_LENGTH, _LENGTH_OF_OBJECT = 4, 8  # bytes


class ProtocolError(Exception):
    """Data in a pipe are not a valid record."""


class PipeChannel:
    """One process's ends of the two pipes.

    Args:
        wait: called before every read of a record; returns when data are available, or raises.
    """

    def __init__(self, reading: int, writing: int, wait: Callable[[], None] = lambda: None) -> None:
        self.reading = reading
        self.writing = writing
        self._wait = wait
        self._process = os.getpid()
        self._alone = threading.Lock()  # an FMU may log from another thread

    def say(self, byte: bytes) -> None:
        """Write one byte."""
        with self._alone:
            os.write(self.writing, byte)

    def hear(self) -> int | None:
        """Return the next byte; None if the other side is gone."""
        byte = os.read(self.reading, 1)
        return byte[0] if byte else None

    def send_object(self, kind: int, content: Any) -> None:
        """Write a pickled record, for a process that trusts this one."""
        self.send_pickle(kind, pickle.dumps(content))

    def send_pickle(self, kind: int, data: bytes) -> None:
        """Write a record that is pickled already."""
        self._send(kind, data, _LENGTH_OF_OBJECT)

    def receive_object(self) -> Any:
        """Return the record written by `send_object` or `send_pickle`, whose first byte has just been read.

        Raises:
            EOFError: the other side is gone.
        """
        return pickle.loads(self._read(self._length(_LENGTH_OF_OBJECT)))

    def send(self, kind: int, content: Any) -> None:
        """Write a record as JSON.

        Raises:
            ProtocolError: it is too long, or not representable in JSON.
        """
        try:
            data = json.dumps(content).encode()
        except (TypeError, ValueError) as error:
            raise ProtocolError(str(error)) from None
        if len(data) > LONGEST:
            raise ProtocolError(f"{len(data)} bytes exceed the limit of a record, {LONGEST}")
        self._send(kind, data, _LENGTH)

    def receive(self) -> Any:
        """Return the record written by `send`, whose first byte has just been read.

        Raises:
            EOFError: the other side is gone.
            ProtocolError: the data are not a valid record. `wait` may raise others.
        """
        length = self._length(_LENGTH)
        if length > LONGEST:
            raise ProtocolError(f"a record of {length} bytes")
        try:
            return json.loads(self._read(length))
        except (ValueError, RecursionError):
            raise ProtocolError("a record is not valid JSON") from None

    def _send(self, kind: int, data: bytes, size: int) -> None:
        if os.getpid() != self._process:
            os._exit(0)  # a copy of this process forked by an FMU
        rest = memoryview(bytes([kind]) + len(data).to_bytes(size, "little") + data)
        with self._alone:
            while rest:
                rest = rest[os.write(self.writing, rest) :]

    def _length(self, size: int) -> int:
        return int.from_bytes(self._read(size), "little")

    def _read(self, count: int) -> bytes:
        data = bytearray()
        while len(data) < count:
            self._wait()
            more = os.read(self.reading, min(count - len(data), 1 << 20))
            if not more:
                raise EOFError
            data += more
        return bytes(data)

    def close(self) -> None:
        for descriptor in (self.reading, self.writing):
            with contextlib.suppress(OSError):
                os.close(descriptor)


class ProcessLost(Exception):
    """A supervised process gave no answer: it has died, or was killed because of that.

    Args:
        did: what happened to it, such as "died of SIGSEGV".
        late: the cause is the FMI function being called, which did not return in time.
        killed: by SIGKILL, which the system sends if memory runs out.
    """

    def __init__(self, did: str, *, late: bool = False, killed: bool = False) -> None:
        super().__init__(did)
        self._late = late
        self.killed = killed

    def in_(self, function: str) -> str:
        """Return the message for a loss during a call of an FMI function ("": between two calls)."""
        if self._late:
            return f"{function or 'its process'} {self}"
        return f"its process {self}" + (f" in {function}" if function else " between two calls")


class SupervisedProcess:
    """Parent's side of a child process. All calls that wait for it raise `ProcessLost` if no answer comes.

    Args:
        start: starts the process with its ends of the pipes, for reading and for writing.
    """

    trusted: ClassVar = False
    """Whether its replies are pickled."""
    unasked: ClassVar[tuple[int, ...]] = ()
    """First bytes of the records that it may send at any time."""

    def __init__(self, start: Callable[[int, int], Child]) -> None:
        self._deadline = math.inf
        """Time by which an answer is late, of `time.monotonic` [s]."""
        self._closed = False
        commands, writing = os.pipe()
        reading, answers = os.pipe()
        self._channel = PipeChannel(reading, writing, self._wait_for_more)
        try:
            self.child = start(commands, answers)
        except BaseException:
            self._channel.close()
            raise
        finally:
            os.close(commands)
            os.close(answers)
        self._poll = select.poll()
        self._poll.register(reading, select.POLLIN)

    def take(self, kind: int, content: Any) -> None:
        """Handle an unsolicited record; raise `ProtocolError` if it is not valid."""
        raise ProtocolError(f"a record {kind}")

    def check_time(self) -> None:
        """Kill the process if its answer is late, and raise `ProcessLost`."""
        if time.monotonic() > self._deadline:
            self.close(kill=True)
            raise ProcessLost("did not respond")

    def hear(self, wanted: int) -> Any:
        """Handle incoming records until the expected record or one-byte answer arrives; return it."""
        try:
            while True:
                self._wait_for_more()
                kind = self._channel.hear()
                if kind is None:
                    raise EOFError
                if kind <= ANSWER and wanted == ANSWER:
                    return kind
                if kind not in (wanted, *self.unasked):
                    raise ProtocolError(f"byte {kind}")
                content = self._channel.receive_object() if self.trusted else self._channel.receive()
                if kind == wanted:
                    return content
                self.take(kind, content)
                self.check_time()
        except EOFError:
            ended = self.child.ended(CLOSING)
            code = self.close(kill=True)
            if not ended:
                raise ProcessLost("closed the pipe to the master") from None
            raise ProcessLost(how_it_ended(code), killed=code == -signal.SIGKILL) from None
        except ProtocolError as error:
            raise self.garbled(str(error)) from None

    def _wait_for_more(self) -> None:
        while not self._poll.poll(LOOK_EVERY):
            self.check_time()
            if self.child.ended() and not self._poll.poll(0):
                raise EOFError  # a process started by an FMU keeps the pipe open

    def garbled(self, what: str) -> ProcessLost:
        """Kill the process, whose output can no longer be parsed; return the exception to raise."""
        self.close(kill=True)
        return ProcessLost(f"wrote into the pipe to the master something that is not an answer ({what})")

    def close(self, *, kill: bool = False) -> int:
        """End the process; return its return code. Later calls do nothing more.

        It ends by itself when it finds its pipes closed, or is killed after `GRACE`.

        Args:
            kill: do not wait for that.
        """
        if not self._closed:
            self._closed = True
            if kill:
                self.child.kill()
            self._channel.close()
            if not self.child.ended(GRACE):
                self.child.kill()
        return self.child.collect()


_PR_SET_CHILD_SUBREAPER = 36  # linux/prctl.h
PATIENCE = 2.0
"""Time spent on killing descendants [s]: a process may start new ones faster than they can be killed."""


def stand_guard(reading: int, others: Iterable[int]) -> None:
    """Fork a guardian; return only in the child, which becomes the guarded process.

    Args:
        reading: pipe from the parent; it closes when the parent ends.
        others: descriptors that only the guarded process needs.
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
    """Wait until the guarded process or the parent ends; kill what is left; exit with the same status."""
    import resource  # not on Windows

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
    """Kill the guarded process and everything it has started."""
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

"""Supervised child processes: connected by two pipes, limited in time, ended with everything they started.

`SupervisedProcess` is the parent's side of all of them: isolated instances (`master.isolation`), runs in a
child process (`master.child_run`) and the workers of pools (`workers`). `PipeChannel` is one side's end of
the pipes.

An FMU can write into any file that its process has open, including the pipe to the parent. So records from a
process that runs FMUs of unknown origin are JSON and checked, never unpickled.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import pickle
import select
import threading
import time
from collections.abc import Callable
from typing import Any, ClassVar

from .fork_server import Child, how_it_ended

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
    """

    def __init__(self, did: str, *, late: bool = False) -> None:
        super().__init__(did)
        self._late = late

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
            raise ProcessLost(how_it_ended(code) if ended else "closed the pipe to the master") from None
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

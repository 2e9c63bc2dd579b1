"""What the master and the process of an isolated unit say to each other, and the memory they share.

The Real values of a step, its time and its size lie in shared memory; two pipes carry single bytes:
which of set, step and get are to be done, and how that ended. Such an exchange costs 7 us on one core
and 50 us from core to core, most of it the two changes from one process to the other; a pair of pipes
was the quickest of what tells the master at once that the other side has died. All else, and the
messages that the FMU logs meanwhile, is a marked record of a few hundred bytes.

An FMU can write into every file that its process has open, the pipe to the master among them. So what
comes from there is JSON and checked, never unpickled; a byte that is no answer is told by the last answer and
its number, which stand in the shared memory; and no record is waited for longer than a call may take.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import mmap
import os
import pickle
import tempfile
import threading
from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import Interrupted, YawbenchError
from .log import KEPT, Log

SET, STEP, GET = 1, 2, 4
"""Parts of an exchange, in this order; a sum of them asks for several."""
ANSWER = 0x7F
"""The largest byte that tells how an exchange ended (see `worker.Worker.exchange`)."""
REQUEST, LOG, REPLY, FAILED = 0x80, 0x81, 0x82, 0x83
"""First bytes of records: what the master wants, what the FMU says, what the master gets, why it does not."""
LONGEST = 1 << 26
"""Bytes of a record at most; chosen: no text that an FMU hands out is nearly as long."""

_HEAD = 4  # numbers before the inputs: time, step size, part being done, last answer
_LENGTH = 4  # bytes


class ProtocolError(Exception):
    """What came out of a pipe is no record."""


class SharedBuffer:
    """The shared memory of a unit: time and step size [s], part being done, last answer, inputs, outputs."""

    def __init__(self, descriptor: int, inputs: int, outputs: int) -> None:
        """Map the memory that `shared_memory` made, for so many values."""
        self._map = mmap.mmap(descriptor, size_of(inputs + outputs))
        self.time = ctypes.c_double.from_buffer(self._map, 0)
        self.step = ctypes.c_double.from_buffer(self._map, 8)
        self.part = ctypes.c_int64.from_buffer(self._map, 16)
        self.answer = ctypes.c_int64.from_buffer(self._map, 24)
        """Number of the exchange times 256, and how it ended."""
        self.inputs = np.frombuffer(self._map, float, inputs, 8 * _HEAD)
        self.outputs = np.frombuffer(self._map, float, outputs, 8 * (_HEAD + inputs))


def size_of(values: int) -> int:
    """Return the bytes of a board that holds so many inputs and outputs."""
    return 8 * (_HEAD + values)


def shared_memory(values: int) -> int:
    """Return the descriptor of a file without a name, for a board of so many inputs and outputs."""
    if hasattr(os, "memfd_create"):
        descriptor = os.memfd_create("yawbench")
    else:
        with tempfile.TemporaryFile() as file:
            descriptor = os.dup(file.fileno())
    os.truncate(descriptor, size_of(values))
    return descriptor


class PipeChannel:
    """One side's ends of the two pipes.

    Args:
        wait: called before every read; returns when there is something, or raises.
    """

    def __init__(self, reading: int, writing: int, wait: Callable[[], None] = lambda: None) -> None:
        self.reading = reading
        self.writing = writing
        self._wait = wait
        self._process = os.getpid()
        self._alone = threading.Lock()  # an FMU may log from a thread of its own

    def say(self, byte: bytes) -> None:
        """Write one byte."""
        with self._alone:
            os.write(self.writing, byte)

    def hear(self) -> int | None:
        """Return the next byte; None if the other side is gone."""
        byte = os.read(self.reading, 1)
        return byte[0] if byte else None

    def order(self, content: Any) -> None:
        """Write a record to somebody who trusts this side."""
        self._send(REQUEST, pickle.dumps(content))

    def ordered(self) -> Any:
        """Return the record of `order` whose first byte has just been heard.

        Raises:
            EOFError: the other side is gone.
        """
        return pickle.loads(self._content())

    def send(self, kind: int, content: Any) -> None:
        """Write a record of what JSON can hold.

        Raises:
            Garbled: there is too much of it, or JSON cannot hold it.
        """
        try:
            data = json.dumps(content).encode()
        except (TypeError, ValueError) as error:
            raise ProtocolError(str(error)) from None
        if len(data) > LONGEST:
            raise ProtocolError(f"{len(data)} bytes cannot be passed on at once, {LONGEST} can")
        self._send(kind, data)

    def receive(self) -> Any:
        """Return the record of `send` whose first byte has just been heard.

        Raises:
            EOFError: the other side is gone.
            Garbled: it is no record; and whatever `wait` raises.
        """
        try:
            return json.loads(self._content())
        except (ValueError, RecursionError):
            raise ProtocolError("what it holds is no record") from None

    def _send(self, kind: int, data: bytes) -> None:
        if os.getpid() != self._process:
            os._exit(0)  # a copy that an FMU has made of this process
        rest = memoryview(bytes([kind]) + len(data).to_bytes(_LENGTH, "little") + data)
        with self._alone:
            while rest:
                rest = rest[os.write(self.writing, rest) :]

    def _content(self) -> bytes:
        length = int.from_bytes(self._read(_LENGTH), "little")
        if length > LONGEST:
            raise ProtocolError(f"it announces {length} bytes")
        return self._read(length)

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


def told(error: YawbenchError | Interrupted) -> dict[str, Any]:
    """Return what there is to tell of an error to another process."""
    where = {name: value for name, value in vars(error).items() if name in ("unit", "time", "number")}
    return {"kind": type(error).__name__, "problems": error.problems, "where": where}


def rebuilt(told: dict[str, Any]) -> YawbenchError | Interrupted:
    """Return the error that another process has told of."""
    kinds = {kind.__name__: kind for kind in (*YawbenchError.__subclasses__(), Interrupted)}
    return kinds.get(told["kind"], YawbenchError)(told["problems"], **told["where"])


class LogRelay(Log):
    """Passes on what FMUs log at once, for one may be about to crash; a flood it only counts.

    Args:
        timed: it is known here what time the messages are of.
    """

    def __init__(self, channel: PipeChannel, *, timed: bool) -> None:
        super().__init__()
        self._channel = channel
        self._timed = timed
        self._untold = 0  # messages that were dropped

    def add(self, unit: str, status: int, category: str, text: str, time: float | None = None) -> None:
        kept = len(self.messages)
        super().add(unit, status, category, text, time)
        if len(self.messages) > kept:
            last = self.messages[-1]
            at = last.time if self._timed else None
            self._channel.send(LOG, (unit, last.status, category, last.text, at))

    def drop(self, count: int) -> None:
        super().drop(count)
        self._untold += count
        if self._untold >= KEPT:
            self.finish()

    def finish(self) -> None:
        """Pass on how many messages have been dropped since that was told last."""
        if self._untold:
            count, self._untold = self._untold, 0
            self._channel.send(LOG, count)

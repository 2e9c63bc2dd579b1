"""Inter-process communication between the master and its child processes: pipes and shared memory.

The Real values of a step, its time and its size lie in shared memory; two pipes carry single bytes: which of
set, step and get to do, and how that ended. Such an exchange costs 7 us on one core and 50 us from core to
core, most of it the two context switches; a pair of pipes was the fastest of the mechanisms that report the
death of the other side at once. Everything else, and the messages that the FMU logs meanwhile, is a tagged
record of a few hundred bytes.

An FMU can write into any file that its process has open, including the pipe to the master. So records from
there are JSON and checked, never unpickled; a stray byte is recognized by comparison with the last answer and
its number in shared memory; and waiting for a record is limited by the time limit of a call.
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
"""Largest byte that is the result of an exchange (see `isolation.InstanceServer.exchange`)."""
REQUEST, LOG, REPLY, FAILED = 0x80, 0x81, 0x82, 0x83
"""First bytes of records: the master's request, a log message, the reply, the reason of a failure."""
LONGEST = 1 << 26
"""Largest record [B]; chosen: far longer than any text of an FMU."""

_HEAD = 4  # numbers before the inputs: time, step size, part being done, last answer
_LENGTH = 4  # bytes


class ProtocolError(Exception):
    """Data in a pipe are not a valid record."""


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

    def order(self, content: Any) -> None:
        """Write a pickled record, for a process that trusts this one."""
        self._send(REQUEST, pickle.dumps(content))

    def ordered(self) -> Any:
        """Return the record written by `order`, whose first byte has just been read.

        Raises:
            EOFError: the other side is gone.
        """
        return pickle.loads(self._content())

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
            raise ProtocolError(f"{len(data)} bytes cannot be passed on at once, {LONGEST} can")
        self._send(kind, data)

    def receive(self) -> Any:
        """Return the record written by `send`, whose first byte has just been read.

        Raises:
            EOFError: the other side is gone.
            ProtocolError: the data are not a valid record. `wait` may raise others.
        """
        try:
            return json.loads(self._content())
        except (ValueError, RecursionError):
            raise ProtocolError("what it holds is no record") from None

    def _send(self, kind: int, data: bytes) -> None:
        if os.getpid() != self._process:
            os._exit(0)  # a copy of this process forked by an FMU
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
    """Return an error as JSON-ready data, for `rebuilt` in another process."""
    where = {name: value for name, value in vars(error).items() if name in ("instance", "time", "number")}
    return {"kind": type(error).__name__, "problems": error.problems, "where": where}


def rebuilt(told: dict[str, Any]) -> YawbenchError | Interrupted:
    """Return the error that `told` has described in another process."""
    kinds = {kind.__name__: kind for kind in (*YawbenchError.__subclasses__(), Interrupted)}
    return kinds.get(told["kind"], YawbenchError)(told["problems"], **told["where"])


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

    def add(self, unit: str, status: int, category: str, text: str, time: float | None = None) -> None:
        kept = len(self.messages)
        super().add(unit, status, category, text, time)
        if len(self.messages) > kept:
            last = self.messages[-1]
            at = last.time if self._timed else None
            self._channel.send(LOG, (unit, last.status, category, last.text, at))

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

"""What the master and the process of an isolated unit say to each other, and the memory they share.

The Real values of a step, its time and its size lie in shared memory; two pipes carry single bytes:
which of set, step and get are to be done, and how that ended. Such an exchange costs 7 us on one core
and 50 us from core to core, most of it the two changes from one process to the other; a pair of pipes
was the quickest of what tells the master at once that the other side has died. All else, and the
messages that the FMU logs meanwhile, is a marked record of a few hundred bytes.
"""

from __future__ import annotations

import contextlib
import ctypes
import mmap
import os
import pickle
import tempfile
import threading
from typing import Any

import numpy as np

SET, STEP, GET = 1, 2, 4
"""Parts of an exchange, in this order; a sum of them asks for several."""
REQUEST, LOG, REPLY = 0x80, 0x81, 0x82
"""First bytes of records: what the master wants, what the FMU says, what the master gets."""

_HEAD = 3  # numbers before the inputs: time, step size, part being done
_LENGTH = 4  # bytes


class Board:
    """The shared memory of a unit: time and step size [s], the part being done, inputs, outputs."""

    def __init__(self, descriptor: int, inputs: int, outputs: int) -> None:
        """Map the memory that `shared_memory` made, for so many values."""
        self._map = mmap.mmap(descriptor, size_of(inputs + outputs))
        self.time = ctypes.c_double.from_buffer(self._map, 0)
        self.step = ctypes.c_double.from_buffer(self._map, 8)
        self.part = ctypes.c_int64.from_buffer(self._map, 16)
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


class Channel:
    """One side's ends of the two pipes."""

    def __init__(self, reading: int, writing: int) -> None:
        self.reading = reading
        self.writing = writing
        self._alone = threading.Lock()  # an FMU may log from a thread of its own

    def say(self, byte: bytes) -> None:
        """Write one byte."""
        with self._alone:
            os.write(self.writing, byte)

    def hear(self) -> int | None:
        """Return the next byte; None if the other side is gone."""
        byte = os.read(self.reading, 1)
        return byte[0] if byte else None

    def send(self, kind: int, content: Any) -> None:
        """Write a record."""
        data = pickle.dumps(content)
        rest = memoryview(bytes([kind]) + len(data).to_bytes(_LENGTH, "little") + data)
        with self._alone:
            while rest:
                rest = rest[os.write(self.writing, rest) :]

    def receive(self) -> Any:
        """Return the record whose first byte has just been heard.

        Raises:
            EOFError: the other side is gone.
        """
        return pickle.loads(self._read(int.from_bytes(self._read(_LENGTH), "little")))

    def _read(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            more = os.read(self.reading, count - len(data))
            if not more:
                raise EOFError
            data += more
        return data

    def close(self) -> None:
        for descriptor in (self.reading, self.writing):
            with contextlib.suppress(OSError):
                os.close(descriptor)

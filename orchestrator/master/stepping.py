"""The process in which the units of a run are stepped, apart from the one that keeps the results.

The other side is `apart`. Rows lie in memory that both share: two blocks, one of which is being filled
while the other is being written. Beside them the pipe carries what is said a few times a second.
"""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import json
import mmap
import os
import sys
import threading
import traceback
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import Interrupted, YawbenchError
from ..plan import Plan, Value
from ..results.recorder import BLOCK
from .course import Course, Opener
from .exchange import REPLY, Channel, Relay, told
from .guardian import die_with_parent
from .interrupts import StopFlag
from .isolation import Isolation
from .master import WORDS, Master
from .surroundings import flush_output
from .unit import FmuSlave

ROWS, PROGRESS, ENDED, WHERE = 0x90, 0x91, 0x92, 0x93
"""First bytes of records: rows are there, how far the run is, how it ended, in which unit it is."""
TAKEN, FREE = b"\x01", b"\x02"
"""What the other side says: rows have been written; terminate and free the units."""

_SLOT = 256
"""Bytes for what is recorded at a point and no Real, where it is looked for if the process dies."""


class Shared:
    """The memory of both processes: the last communication point reached, and the rows so far."""

    def __init__(self, width: int) -> None:
        """Make it for rows of so many numbers."""
        self._map = mmap.mmap(-1, 8 + 16 * BLOCK * width)
        self._slots = mmap.mmap(-1, BLOCK * _SLOT)
        self.completed = ctypes.c_int64.from_buffer(self._map)
        self.completed.value = -1
        self.blocks = np.frombuffer(self._map, float, offset=8).reshape(2, BLOCK, width)

    def keep(self, at: int, others: list[Value]) -> None:
        """Put what is no Real beside row `at` of the block being filled; nothing if it is too long."""
        data = json.dumps(others).encode()
        self._slots[at * _SLOT : (at + 1) * _SLOT] = (data if len(data) <= _SLOT else b"").ljust(_SLOT)

    def kept(self, count: int) -> list[list[Value]]:
        """Return what is no Real of the first rows of the block being filled, as far as it is there."""
        slots = [self._slots[at * _SLOT : (at + 1) * _SLOT].strip() for at in range(count)]
        return [json.loads(slot) for slot in itertools.takewhile(bool, slots)]


class _Others(list):
    """What is recorded and no Real, one list per row; also where it is found if the process dies."""

    def __init__(self, shared: Shared) -> None:
        super().__init__()
        self._shared = shared

    def append(self, values: list[Value]) -> None:
        self._shared.keep(len(self), values)
        super().append(values)


class _Rows:
    """Where the run's rows go (see `course.Rows`): to the other side."""

    def __init__(self, shared: Shared, channel: Channel) -> None:
        self._channel = channel
        self._blocks = [list(block) for block in shared.blocks]
        self._given = 0  # blocks
        self._first = 0
        self.rows = self._blocks[0]
        self.others: list[list[Value]] = _Others(shared)

    def write(self, count: int) -> None:
        """Give the first `count` of `rows` away, when those before have been written."""
        if count <= 0:
            return
        if self._given and self._channel.hear() is None:
            os._exit(1)
        self._channel.send(ROWS, (self._first, count, self.others))
        self._given += 1
        self._first += count
        self.others.clear()
        self.rows = self._blocks[self._given % 2]


def step_units(
    plan: Plan, opener: Opener, stop: StopFlag, shared: Shared, channel: Channel, asking: int
) -> None:
    """Make the run in this process, which has just been forked. Never returns.

    Args:
        asking: pipe through which the other side says that the run is to stop, and asks in which unit it is.
    """
    try:
        die_with_parent()
        os.setpgid(0, 0)  # what a unit sends to its group, and Ctrl-C on the terminal, is not for both
        for descriptor in map(int, os.listdir("/proc/self/fd")):
            if descriptor > 2 and descriptor not in (channel.reading, channel.writing, asking):
                with contextlib.suppress(OSError):  # that of the folder that has just been listed
                    os.close(descriptor)
        _make(plan, opener, stop, shared, channel, asking)
    except OSError:
        os._exit(1)  # the other side is gone, or a unit has closed the pipe to it
    except BaseException:
        traceback.print_exc()
        os._exit(1)
    os._exit(0)


def _make(plan: Plan, opener: Opener, stop: StopFlag, shared: Shared, channel: Channel, asking: int) -> None:
    log = Relay(channel, timed=True)
    rows = _Rows(shared, channel)

    def progress(done: int, total: int) -> None:
        channel.send(PROGRESS, (done, total))

    course = Course(plan, rows, log, stop, progress, shared.completed)
    _tell_where(channel, asking, stop)
    error = _go(course, opener)
    log.finish()
    ending = course.ended and (str(course.ended), course.ended.unit, course.ended.time)
    channel.send(ENDED, (course.passes, ending, error))
    while (said := channel.hear()) != FREE[0]:
        if said is None:
            return
    course.end()
    if isinstance(opener, Isolation):
        opener.close()  # processes of units that the run has not come to
    log.finish()
    flush_output()
    channel.send(REPLY, None)


def _go(course: Course, opener: Opener) -> dict[str, Any] | None:
    """Open, initialize, step; return what there is to tell if that fails."""
    try:
        course.go(opener)
    except (YawbenchError, Interrupted) as error:
        unit = getattr(error, "unit", None)
        return {**told(error), "inputs": course.inputs_of(unit) if unit else {}}
    except BaseException:
        return {"kind": "", "problems": traceback.format_exc(), "inputs": {}}
    return None


def _tell_where(channel: Channel, asking: int, stop: StopFlag) -> None:
    """Answer, from a thread, in which unit the run is, and let it stop; also when an FMU calls exit()."""
    stepping, process = threading.get_ident(), os.getpid()

    def answer() -> None:
        with contextlib.suppress(OSError):  # the other side is gone
            while number := os.read(asking, 1):
                stop.request(number[0])
                channel.send(WHERE, _whereabouts(stepping))

    threading.Thread(target=answer, daemon=True).start()

    @ctypes.CFUNCTYPE(None, ctypes.c_int, ctypes.c_void_p)
    def at_exit(status: int, _: int | None) -> None:
        if os.getpid() == process:
            with contextlib.suppress(OSError):
                channel.send(WHERE, _whereabouts(stepping))
        os._exit(status)

    _kept.append(at_exit)
    ctypes.CDLL(None).on_exit(at_exit, None)


_kept: list[Any] = []


def _whereabouts(thread: int) -> tuple[str, str] | None:
    """Return the unit that a thread is in, and what is being done with it; None if it is in none."""
    frame, found = sys._current_frames().get(thread), None
    here = str(Path(__file__).parent)
    while frame is not None:
        if frame.f_code.co_filename.startswith(here):
            local = frame.f_locals
            if frame.f_code is Master.advance.__code__ and "call" in local:
                operation = local["self"].operation_of(local["k"], local["call"])
                return operation and (operation.unit, WORDS.get(operation.kind, operation.kind))
            if isinstance(local.get("self"), FmuSlave):
                ending = frame.f_code.co_name == FmuSlave.free.__name__
                found = local["self"].name, "its end" if ending else "initialization"
        frame = frame.f_back
    return found

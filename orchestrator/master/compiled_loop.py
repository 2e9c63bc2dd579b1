"""Compiled step loop: walks step programs as plain data in C, many communication steps per call.

An operation of a step program is described by `OperationData`: which C function with which arguments, which
indices of the pool, which weights. `step_loop.c` walks these for a block of rows and returns to Python only
for what it cannot do (a fault that is not linear, a value that is not Real, an instance in another process),
for a status other than OK, an output that is not finite, a stop request, and every `PAUSE`, so that Python's
signal handlers get their turn. The master sees to it with the code of its own loop and has the walk go on, so
that both loops give the same numbers and sentences. Without a compiler, and if `YAWBENCH_LOOP` is `python`,
the master's loop in Python makes the run.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np

WANTED = "YAWBENCH_LOOP"
"""Environment variable: `python` asks for the loop in Python."""
PAUSE = 20_000_000
"""Time after which a walk returns to Python [ns]; chosen: too short to notice after Ctrl-C."""
CHECKED = -2
"""`WalkState.at` once the outputs of a step have been checked, and before it is recorded."""
EXACT = 2**53
"""Whole numbers below this are exact in double precision, and their quotients correctly rounded."""

Kind = IntEnum(
    "Kind",
    "END CALL COPY BLEND CONVERT SERIES DISTURB EXCHANGE_2 EXCHANGE_3 STEP_2 STEP_3",
    start=0,
)
"""Kinds of operations; CALL: only Python can do it."""
Answer = IntEnum("Answer", "FINISHED INTERRUPTED PYTHON STATUS NOT_FINITE PAUSED", start=0)
"""Reasons for a walk's return; STATUS: a call's status needs attention."""
_ANSWERS = tuple(Answer)  # by number: five times as quick as `Answer(number)`, in every step with a fault


class OperationData(ctypes.Structure):
    """An operation of a step program as plain data: `struct operation` of `step_loop.c`."""

    _fields_ = [
        ("kind", ctypes.c_int64),
        ("count", ctypes.c_int64),
        *((name, ctypes.c_void_p) for name in ("function", "instance", "references")),
        ("n_references", ctypes.c_int64),
        *((name, ctypes.c_void_p) for name in ("values", "first", "second", "factors", "terms")),
        *((name, ctypes.c_void_p) for name in ("time", "size", "answers", "row")),
        *((name, ctypes.c_int64) for name in ("further", "scale", "call")),
    ]

    def __init__(self, kind: Kind = Kind.CALL, count: int = 0, **fields: Any) -> None:
        """Lay out an operation.

        Args:
            count: number of values that it is about.
            fields: numbers, and arrays or ctypes objects, whose addresses are taken and which are kept alive.
        """
        super().__init__(kind, count)
        for name, value in fields.items():
            setattr(self, name, _address_of(value))
        self._kept = fields


class _Clock(ctypes.Structure):
    _fields_ = [("period", ctypes.c_int64), ("time", ctypes.c_void_p)]


class WalkState(ctypes.Structure):
    """`struct run` of `step_loop.c`: where a walk is, and what it is for."""

    k: int
    """The communication point being stepped to."""
    at: int
    """Index of the current operation in the program of the step to `k`; negative between two steps: -2 if
    only recording the step is left."""
    status: int
    """Status that the current operation has returned."""

    _fields_ = [
        *((name, ctypes.c_int64) for name in ("k", "at", "end", "first")),
        ("programs", ctypes.c_void_p),
        ("n_programs", ctypes.c_int64),
        ("clocks", ctypes.c_void_p),
        *((name, ctypes.c_int64) for name in ("n_clocks", "start", "step", "scale")),
        ("pool", ctypes.c_void_p),
        ("time_at", ctypes.c_int64),
        ("expected", ctypes.c_void_p),
        ("n_expected", ctypes.c_int64),
        ("recorded", ctypes.c_void_p),
        ("n_recorded", ctypes.c_int64),
        ("rows", ctypes.c_void_p),
        ("stride", ctypes.c_int64),
        ("position", ctypes.c_void_p),
        ("stop", ctypes.c_void_p),
        ("pause", ctypes.c_int64),
        ("status", ctypes.c_int64),
    ]


def _address_of(value: Any) -> int:
    if isinstance(value, int):
        return value
    return value.ctypes.data if isinstance(value, np.ndarray) else ctypes.addressof(value)


class CompiledLoop:
    """The walk of one run.

    Args:
        pool: the values of the run.
        time_at: index of the time in the pool.
        clocks: period -> beginning of the step of the instances with that period [s].
        grid: start, step and scale: the k-th communication point is at (start + k step) / scale.
        recorded: indices of the values of a row.
        position: a `RunPosition`, kept up to date.
        call_of: instance and kind of an operation -> number of the call in the position.
        stop: nonzero if the run is to stop.
    """

    def __init__(
        self,
        pool: np.ndarray,
        time_at: int,
        clocks: Mapping[int, ctypes.c_double],
        grid: tuple[int, int, int],
        recorded: np.ndarray,
        position: ctypes.Structure,
        call_of: Mapping[tuple[str, str], int],
        stop: ctypes.c_int32,
    ) -> None:
        library = _library()[0]
        assert library is not None
        self._walk: Callable[[Any], int] = library.walk
        start, step, scale = grid
        moving = (_Clock * len(clocks))()
        for i, (period, time) in enumerate(clocks.items()):
            moving[i] = _Clock(period, _address_of(time))
        self.state = WalkState(
            at=-1,
            clocks=_address_of(moving),
            n_clocks=len(clocks),
            start=start,
            step=step,
            scale=scale,
            pool=_address_of(pool),
            time_at=time_at,
            recorded=_address_of(recorded),
            n_recorded=len(recorded),
            position=_address_of(position),
            stop=_address_of(stop),
            pause=PAUSE,
        )
        self._reference = ctypes.byref(self.state)
        self._kept: list[Any] = [pool, clocks, moving, recorded, position, stop]
        self._programs: dict[int, tuple[Sequence[Any], Any]] = {}  # phase -> operations, and as plain data
        self._call_of = call_of

    def expect(self, outputs: np.ndarray) -> None:
        """Have the outputs with these indices checked to be finite."""
        self._expected = outputs.astype(np.int64)
        self.state.expected, self.state.n_expected = _address_of(self._expected), len(outputs)

    def lay(self, points: range, rows: np.ndarray, cycle: int, programs: Mapping[int, Sequence[Any]]) -> None:
        """Set what the next walks are for.

        Args:
            points: communication points to be stepped to.
            rows: one per point; shape (at least as many, columns).
            cycle: the programs repeat after this number of points.
            programs: phase of the cycle -> the operations of a step, whose `data` describe them.

        Raises:
            ValueError: `rows` are too few.
        """
        for phase in [phase for phase, (made_of, _) in self._programs.items() if phase not in programs]:
            del self._programs[phase]
        addresses = [self._address(k % cycle, programs[k % cycle]) for k in points[:cycle]]
        self._table = (ctypes.c_void_p * len(addresses))(*addresses)
        self._rows = rows
        if len(rows) < len(points):
            raise ValueError(f"{len(points)} rows are needed")
        run = self.state
        run.programs, run.n_programs = _address_of(self._table), len(addresses)
        run.first, run.k, run.at = points[0], points[0], -1
        run.rows, run.stride = _address_of(rows), rows.strides[0] // rows.itemsize

    def _address(self, phase: int, operations: Sequence[Any]) -> int:
        """Return the address of a program as plain data."""
        if phase not in self._programs or self._programs[phase][0] is not operations:
            made = (OperationData * (len(operations) + 1))()
            for i, operation in enumerate(operations):
                made[i] = operation.data or OperationData(Kind.CALL)
                made[i].call = self._call_of.get((operation.instance, operation.kind), -1)
            made[len(operations)] = OperationData(Kind.END)
            self._programs[phase] = operations, made
        return _address_of(self._programs[phase][1])

    def walk(self, end: int) -> Answer:
        """Step to a communication point, or until Python is needed."""
        self.state.end = end
        return _ANSWERS[self._walk(self._reference)]


def missing_loop(grid: tuple[int, int, int], n_steps: int) -> str:
    """Return why a run cannot have the compiled loop; empty if it can."""
    start, step, scale = grid
    if _unwanted():
        return f"{WANTED} asks for it"
    if max(abs(start), abs(start + n_steps * step), scale) >= EXACT:
        return "its times are not quotients of double-precision numbers"
    return _library()[1]


def slower_because() -> str:
    """Return why Python makes the steps of runs without being requested; empty if the compiled loop does."""
    return "" if _unwanted() else _library()[1]


def _unwanted() -> bool:
    return os.environ.get(WANTED) == "python"


def _library() -> tuple[ctypes.CDLL | None, str]:
    """Return the library of the loop, or None and why there is none."""
    from yawbench.fmus.compiler import load_compiled

    return load_compiled(Path(__file__).with_name("step_loop.c"))

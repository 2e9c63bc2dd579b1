"""A run whose units are stepped in a process of their own, while the results are kept in this one.

A unit that crashes, calls exit, hangs, or closes all files, does so to the other process: this one sees it
end without the word that a run ends with, and still has every row. So no run of foreign code ends in
silence, and Ctrl-C always works, whatever the FMU does with signals.

Chosen over isolating every foreign FMU by default, which costs 30 to 70 us per unit and step, and over a
hook that the C library calls at exit(), which neither _exit() nor a signal asks. This costs a fork, a few
milliseconds per run, and nothing per step; while one process writes a block of rows the other fills the
next. What it does not give is a wall between units: see `surroundings` for what they may change for each
other, and `isolation` for the wall. It needs fork(), and is used on Linux alone.
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import sys
import threading
import time
from functools import partial
from typing import Any

from ..errors import Interrupted, SimulationError
from ..plan import Plan, Value
from ..results.recorder import BLOCK, Block
from ..wording import listed
from .course import Course, Opener, Progress
from .exchange import REPLY, Channel, Garbled, rebuilt
from .interrupts import StopFlag, stop_requested_at
from .log import MASTER, WARNING, Log
from .master import Ended
from .opening import open_unit
from .process import Lost, Process
from .stepping import ENDED, FREE, PROGRESS, ROWS, TAKEN, WHERE, Shared, step_units
from .surroundings import flush_output

KILL_AFTER = 3.0
"""Time after a wish to stop at which the process is killed [s]; chosen: a step is over long before."""
END_LIMIT = 10.0
"""Time that units may take to be terminated and freed [s]; the results are written by then."""


def can_be_apart() -> bool:
    """Return whether a run can be stepped in a process of its own: signals are for the main thread."""
    return sys.platform == "linux" and threading.current_thread() is threading.main_thread()


class CourseApart(Course, Process):
    """The course of one run in another process."""

    unasked = (ROWS, PROGRESS, WHERE)

    def __init__(self, plan: Plan, rows: Block, log: Log, stop: StopFlag, progress: Progress | None) -> None:
        super().__init__(plan, rows, log, stop, progress)
        self._rows: Block = rows
        self._shared = Shared(len(rows.rows[0]))
        self._blocks = 0  # written
        self._inputs: dict[str, Value] = {}
        self._where: tuple[str, str] | None = None
        self._process: int | None = None
        self._status = 0
        self._deadline = math.inf
        self._suspects: list[str] = []  # units that may have ended the process
        self._told_end = False
        self._closed = False  # no more rows are written

    def inputs_of(self, unit: str) -> dict[str, Value]:
        """Return the inputs with which the unit that has failed was last stepped."""
        return self._inputs

    def go(self, opener: Opener) -> None:
        if opener is open_unit:
            self._suspects = [u.name for u in self.plan.units if u.fmu.compiled]
        asked, self._asking = os.pipe()
        try:
            self._process = self._start(partial(self._forked, opener, asked))
        finally:
            os.close(asked)
        try:
            self.passes, ending, failed = self._hear(ENDED)
        except Lost as lost:
            raise self._death(lost) from None
        self._told_end = True
        if ending is not None:
            reason, unit, at = ending
            self.ended = Ended(reason, unit=unit, time=at)
        if failed is not None:
            self._inputs = failed["inputs"]
            raise rebuilt(failed) if failed["kind"] else RuntimeError(failed["problems"])

    def _forked(self, opener: Opener, asked: int, commands: int, answers: int) -> int:
        flush_output()
        process = os.fork()
        if process == 0:
            step_units(self.plan, opener, self._stop, self._shared, Channel(commands, answers), asked)
        return process

    def _take(self, kind: int, content: Any) -> None:
        match kind, content:
            case _, [int() as first, int() as count, list() as others] if kind == ROWS:
                if first != self.handed_over:
                    raise Garbled(f"rows from {first}, not {self.handed_over}")
                self._record(count, others)
                self._blocks += 1
                with contextlib.suppress(BrokenPipeError):
                    self._channel.say(TAKEN)
            case _, [int() as done, int() as total] if kind == PROGRESS:
                if self._progress is not None:
                    self._progress(done, total)
            case _, [str() as unit, str() as what] if kind == WHERE:
                self._where = unit, what
            case _, None if kind == WHERE:
                pass
            case _:
                raise Garbled(f"a record {kind}")

    def _record(self, count: int, others: list[list[Value]]) -> None:
        if self._closed:
            self.handed_over += count
            return
        self._closed = True  # if this fails, what comes after it is no use
        self._rows.lay(self._shared.blocks[self._blocks % 2])
        self._rows.others[:] = others
        self._hand_over(count)
        self._closed = False

    def flush(self) -> None:
        """Write the rows that the process has left behind."""
        count = self._shared.completed.value + 1 - self.handed_over
        others = []
        if len(self.plan.record) + 1 > len(self._rows.rows[0]):  # there are such as are no Reals
            others = self._shared.kept(count) if count <= BLOCK else []
            count = len(others)
        self._record(min(count, BLOCK), others)
        self._closed = True

    def _check_time(self) -> None:
        """Let the process stop when that is wished; kill it if it does not, or takes too long to end."""
        now, asked = time.monotonic(), stop_requested_at()
        if asked is not None:
            self._ask()
        if now > self._deadline or (asked is not None and now - asked > KILL_AFTER):
            self.close()
            raise Lost("did not come back")

    def _ask(self) -> None:
        """Let the process stop, and tell in which unit it is."""
        with contextlib.suppress(OSError):
            os.write(self._asking, bytes([self._stop.number]))

    def _has_ended(self, within: float) -> bool:
        assert self._process is not None
        end = time.monotonic() + within
        while os.waitid(os.P_PID, self._process, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
            if time.monotonic() >= end:
                return False
            time.sleep(0.001)
        return True

    def close(self) -> int:
        if self._process is not None:
            for kill in (os.killpg, os.kill):  # with what units have started
                with contextlib.suppress(OSError):
                    kill(self._process, signal.SIGKILL)
            _, status = os.waitpid(self._process, 0)
            self._process, self._status = None, os.waitstatus_to_exitcode(status)
            self._channel.close()
            os.close(self._asking)
        return self._status

    def _death(self, lost: Lost) -> SimulationError | Interrupted:
        """Return what ends the run when its process did."""
        completed = self._shared.completed.value
        unit, doing = self._where or (None, "step" if completed >= 0 else "initialization")
        if unit is None and len(self._suspects) == 1:
            unit = self._suspects[0]
        period = next((u.period for u in self.plan.units if u.name == unit), 1)
        now = self.plan.time(max(0, completed + 1 - period if (completed + 1) % period == 0 else completed))
        sentence = f"{doing} failed at t = {now:.9g} s: the process of the run {lost}"
        if unit is not None:
            sentence = f"{unit}: {sentence}"
        elif self._suspects:
            sentence += f"; --isolate tells in which unit (not in Python are {listed(self._suspects)})"
        if self._stop.requested:
            return self._stop.interrupted(f": {sentence}", unit=unit, time=now)
        return SimulationError(sentence, unit=unit, time=now)

    def end(self) -> None:
        """Let the process terminate and free the units; what becomes of it costs the results nothing."""
        if self._process is None:
            return
        self._closed, self._where = True, None
        self._deadline = time.monotonic() + END_LIMIT
        try:
            if not self._told_end:
                self._ask()
                self._hear(ENDED)
            self._where = None  # what was asked for the end belongs to the run
            self._channel.say(FREE)
            self._hear(REPLY)
        except (Lost, OSError) as lost:
            unit = self._where[0] if self._where else ", ".join(self._suspects) or "the units"
            text = f"when units were terminated and freed, the process of the run {lost}"
            self.log.add(unit, WARNING, MASTER, text, self.plan.time(max(0, self._shared.completed.value)))
        self.close()

"""The course of a run: units opened, initialized, stepped, freed.

How long the steps of one unit of a run take, by the processor time of the thread that makes them.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..errors import ResultsError, SimulationError
from ..messages import listed
from ..plan import Instance, Plan, Value
from ..results.recorder import BLOCK
from .instance import FmuInstance, Status, StepCalls
from .log import MASTER, WARNING, Log
from .master import EndRequested, Master
from .process_state import Copies, StopFlag, suspects

RunProgress = Callable[[int, int], None]
"""Called a few times a second with the communication points done and those in all."""

OpenInstance = Callable[[Instance, Log, set[Path]], FmuInstance]
"""Makes the instance of a unit (see `opening.open_unit`)."""


class RecordedRows(Protocol):
    """What a run fills: `rows` with Reals, one per communication point, `others` with what is none."""

    rows: list[np.ndarray]
    others: list[list[Value]]

    def write(self, count: int) -> None:
        """Take over the first `count` of them; they are then free again."""


REPORT_EVERY = 0.2
"""Time between two reports of progress [s], while a single step does not take longer."""


class RunLoop:
    """The course of one run in this process.

    Args:
        rows: where rows go, a recorder's `rows` and `others`, before its `write` is called with their number.
        reached: gets the last communication point at which all values stand, for others to see.
    """

    def __init__(
        self,
        plan: Plan,
        rows: RecordedRows,
        log: Log,
        stop: StopFlag,
        progress: RunProgress | None = None,
        reached: ctypes.c_int64 | None = None,
    ) -> None:
        self.plan = plan
        self.passes = 0  # of initialization
        self.handed_over = 0  # rows given away
        self.writing = False
        self.ended: EndRequested | None = None  # by a unit, before the plan's end
        self._rows = rows
        self.log = log
        self._stop = stop
        self._progress = progress
        self._reached = reached
        self._master: Master | None = None
        self._slaves: dict[str, FmuInstance] = {}
        self._copies = Copies()

    def inputs_of(self, unit: str) -> dict[str, Value]:
        """Return the inputs with which a unit was last stepped."""
        return {} if self._master is None else self._master.inputs_of(unit)

    def go(self, opener: OpenInstance) -> None:
        """Open, initialize, step."""
        corrupted: set[Path] = set()
        for unit in self.plan.instances:
            for doubt in unit.fmu.doubts():
                self.log.add(unit.name, WARNING, MASTER, doubt, self.plan.time(0))
            self._slaves[unit.name] = opener(unit, self.log, corrupted)
            self._copies.end()
        self._master = Master(self.plan, self._slaves, self.log, self._stop, self._reached, self._copies)
        with np.errstate(all="ignore"):  # what is not finite is found by looking, not by warning
            self._master.initialize(self._rows.rows[0], self._rows.others)
            self.passes = self._master.passes
            try:
                self._step(self._master)
            except EndRequested as ending:
                self.ended = ending
                self.flush()

    def _step(self, master: Master) -> None:
        """Step to the end, in stretches short enough to report progress between them."""
        total, stretch, reported = self.plan.n_steps, 1, time.perf_counter()
        while master.completed < total:
            filled = master.completed + 1 - self.handed_over
            if filled == BLOCK:
                self.flush()
                filled = 0
            end = min(total, master.completed + min(stretch, BLOCK - filled))
            since = master.completed
            try:
                master.advance(end, self._rows.rows[filled:], self._rows.others)
            except EndRequested:
                master.check_surroundings(since)
                raise
            master.check_surroundings(since)
            self._refuse_copies(master.completed)
            now = time.perf_counter()
            if now - reported < REPORT_EVERY:
                stretch = min(2 * stretch, BLOCK)
                continue
            stretch, reported = max(1, stretch // 2), now
            if self._progress is not None:
                self._progress(master.completed, total)
        self.flush()
        if self._progress is not None:
            self._progress(total, total)

    def _refuse_copies(self, completed: int) -> None:
        """Make sure that no unit has copied this process.

        Raises:
            SimulationError: one has. It would do so in every step, and each copy remains until the run ends.
        """
        if not self._copies.made:
            return
        time = self.plan.time(completed)
        among = suspects(self.plan.instances)
        raise SimulationError(
            f"by t = {time:.9g} s a unit ({listed(among, last='or')}) had copied the process of the run "
            "(fork), and the copy went on with it; with --isolate it copies its own process alone",
            instance=among[0] if len(among) == 1 else None,
            time=time,
        )

    def flush(self) -> None:
        """Hand over all whole rows."""
        completed = -1 if self._master is None else self._master.completed
        self._hand_over(completed + 1 - self.handed_over)

    def _hand_over(self, count: int) -> None:
        """Let the recorder write rows.

        Raises:
            SimulationError: it cannot.
        """
        self.handed_over += count
        time = self.plan.time(max(0, self.handed_over - 1))
        self.writing = True
        try:
            self._rows.write(count)
        except ResultsError as error:
            kept = "; the rows that fit are kept" if getattr(self._rows, "rows_stay", False) else ""
            problem = f"{error.problems[0].rstrip('.')} (at t = {time:.9g} s){kept}."
            raise SimulationError(problem, instance=None, time=time) from None
        finally:
            self.writing = False

    def end(self) -> None:
        """Terminate and free the units."""
        for slave in reversed(self._slaves.values()):
            slave.free()
            self._copies.end()


@dataclass
class StepClock:
    """What has been counted."""

    steps: int = 0
    total: int = 0  # [ns]

    @property
    def mean(self) -> float:
        """Time of a step with its exchange of inputs and outputs [s]."""
        return 1e-9 * self.total / self.steps


def timing(opener: OpenInstance, unit: str, clock: StepClock) -> OpenInstance:
    """Return an opener whose instance of a unit is timed; the numbers of the run stay as they are."""

    def opened(one: Instance, log: Log, corrupted: set[Path]) -> Any:
        slave: Any = opener(one, log, corrupted)
        if one.name == unit:
            connect = slave.connect
            slave.connect = lambda buffers: _timed(connect(buffers), clock)
        return slave

    return opened


def _timed(calls: StepCalls, clock: StepClock) -> StepCalls:
    """Return the calls of a step, timed."""
    now = time.thread_time_ns

    def around(call: Callable[[], Status], steps: int = 0) -> Callable[[], Status]:
        def timed() -> Status:
            begin = now()
            status = call()
            clock.total += now() - begin
            clock.steps += steps
            return status

        return timed

    return StepCalls(around(calls.set), around(calls.step, 1), around(calls.get))

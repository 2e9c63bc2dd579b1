"""The life of a run: open the FMUs, initialize them, step to the end, free them.

`timing` wraps an instance to measure the processor time of its steps, by the clock of the thread that
makes them.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from yawbench.fmus.fmu import Value
from yawbench.foundation.errors import ResultsError, SimulationError
from yawbench.foundation.interrupts import StopFlag
from yawbench.foundation.processes import end_copy_of

from ..plan import Instance, Plan
from ..results.recorder import BLOCK
from .instance import FmuInstance, Status, StepCalls
from .log import MASTER, WARNING, Log
from .step_loop import EndRequested, Master, RunPosition

RunProgress = Callable[[int, int], None]
"""Called a few times a second with the number of communication points completed and their total."""

OpenInstance = Callable[[Instance, Log, set[Path]], FmuInstance]
"""Creates the running instance for a `plan.Instance` (see `fmi.open_instance`)."""


class RecordedRows(Protocol):
    """Buffer that a run fills: `rows` of Reals, one per communication point, and `others` for other types."""

    rows: np.ndarray
    others: list[list[Value]]

    def write(self, count: int) -> None:
        """Record the first `count` rows, which may then be overwritten."""


SLICE = 0.05
"""Time that a run with a pace makes at once [s]; chosen: twenty pictures a second look smooth."""
REPORT_EVERY = 0.2
"""Time between two reports of progress [s], unless a single step takes longer."""


class RunLifecycle:
    """Runs a plan in this process.

    Args:
        rows: buffer for the recorded values, usually the recorder itself.
        position: kept up to date, possibly in memory shared with another process.
    """

    def __init__(
        self,
        plan: Plan,
        rows: RecordedRows,
        log: Log,
        stop: StopFlag,
        progress: RunProgress | None = None,
        position: RunPosition | None = None,
    ) -> None:
        self.plan = plan
        self.passes = 0  # of initialization
        self.loop = ""  # see `Master.loop`
        self.handed_over = 0  # rows written
        self.writing = False
        self.ended: EndRequested | None = None  # by an instance, before the stop time
        self._rows = rows
        self.log = log
        self._stop = stop
        self._progress = progress
        self.position = position or RunPosition().begin()
        self.master: Master | None = None
        self.pace: float | None = None
        """Simulated seconds per second; None: as fast as possible."""
        self._fmu_instances: dict[str, FmuInstance] = {}

    def inputs_of(self, instance: str) -> dict[str, Value]:
        """Return the inputs with which an instance was last stepped."""
        return {} if self.master is None else self.master.inputs_of(instance)

    def go(self, opener: OpenInstance) -> None:
        """Open the FMUs, initialize them and step to the end."""
        self.begin(opener)
        self.step_to(self.plan.n_steps)

    def begin(self, opener: OpenInstance) -> None:
        """Open the FMUs and initialize them."""
        corrupted: set[Path] = set()
        process = os.getpid()
        for number, instance in enumerate(self.plan.instances):
            for violation in instance.fmu.violations:
                self.log.add(instance.name, WARNING, MASTER, violation.message, self.plan.time(0))
            self.position.enter(number, "initialization")
            self._fmu_instances[instance.name] = opener(instance, self.log, corrupted)
            end_copy_of(process)
            self.position.leave()
        self.master = Master(self.plan, self._fmu_instances, self.log, self._stop, self.position)
        self.loop = self.master.loop
        with np.errstate(all="ignore"):  # non-finite values are found by `Master`, not by NumPy warnings
            self.master.initialize(self._rows.rows[0], self._rows.others)
            self.passes = self.master.passes

    def step_to(self, point: int) -> None:
        """Step to a communication point, unless an instance ends the run before."""
        if self.ended is not None:
            return
        assert self.master is not None
        with np.errstate(all="ignore"):
            try:
                self._step(self.master, point)
            except EndRequested as ending:
                self.ended = ending
                self.flush()

    def go_back(self, point: int, ended: EndRequested | None) -> None:
        """Note that the run is at an earlier communication point again, up to which rows are written."""
        self.handed_over, self.ended = point + 1, ended

    def _step(self, master: Master, point: int) -> None:
        """Step to a point, in stretches short enough to report progress between them."""
        total, stretch, reported = self.plan.n_steps, 1, time.perf_counter()
        begun, first = reported, master.completed
        slice_ = self.pace and max(1, int(SLICE * self.pace / float(self.plan.step)))
        while master.completed < point:
            filled = master.completed + 1 - self.handed_over
            if filled == BLOCK:
                self.flush()
                filled = 0
            end = min(point, master.completed + min(slice_ or stretch, BLOCK - filled))
            since = master.completed
            try:
                master.advance(end, self._rows.rows[filled:], self._rows.others)
            except EndRequested:
                master.check_arithmetic(since)
                raise
            master.check_arithmetic(since)
            now = time.perf_counter()
            if self.pace:
                self.flush()
                due = begun + float((master.completed - first) * self.plan.step) / self.pace
                while (left := due - time.perf_counter()) > 0.0 and not self._stop.requested:
                    time.sleep(min(left, SLICE))
            if now - reported < REPORT_EVERY:
                stretch = min(2 * stretch, BLOCK)
                continue
            stretch, reported = max(1, stretch // 2), now
            if self._progress is not None:
                self._progress(master.completed, total)
        if point == total:
            self.flush()
            if self._progress is not None:
                self._progress(total, total)

    def flush(self) -> None:
        """Write all complete rows."""
        completed = -1 if self.master is None else self.master.completed
        self._hand_over(completed + 1 - self.handed_over)

    def _hand_over(self, count: int) -> None:
        """Write rows to the recorder.

        Raises:
            SimulationError: they cannot be written.
        """
        self.handed_over += count
        self.writing = True
        try:
            self._rows.write(count)
        except ResultsError as error:
            time = self.plan.time(max(0, self.handed_over - 1))
            kept = "; the rows that fit are kept" if getattr(self._rows, "rows_stay", False) else ""
            sentence = f"{str(error.diagnostics[0]).rstrip('.')} (at t = {time:.9g} s){kept}."
            raise SimulationError(sentence, instance=None, time=time, code=error.code) from None
        finally:
            self.writing = False

    def end(self) -> None:
        """Terminate and free the instances."""
        for number, instance in reversed([*enumerate(self._fmu_instances.values())]):
            self.position.enter(number, "its end")
            instance.free()
            self.position.leave()


@dataclass
class StepClock:
    """Accumulated time and number of the steps of an instance."""

    steps: int = 0
    total: int = 0  # [ns]

    @property
    def mean(self) -> float:
        """Time of a step with its exchange of inputs and outputs [s]."""
        return 1e-9 * self.total / self.steps


def timing(opener: OpenInstance, instance: str, clock: StepClock) -> OpenInstance:
    """Return an opener that times the instance named `instance`; the results of the run do not change."""

    def open_timed(planned: Instance, log: Log, corrupted: set[Path]) -> Any:
        fmu_instance: Any = opener(planned, log, corrupted)
        if planned.name == instance:
            connect = fmu_instance.connect
            fmu_instance.connect = lambda buffers: _timed(connect(buffers), clock)
        return fmu_instance

    return open_timed


def _timed(calls: StepCalls, clock: StepClock) -> StepCalls:
    """Return the calls of a step, wrapped to be timed."""
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

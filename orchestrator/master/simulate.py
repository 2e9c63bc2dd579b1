"""One run, from a plan to results on disk."""

from __future__ import annotations

import contextlib
import os
import sys
import time
import uuid
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ResultsError, SimulationError, YawbenchError
from ..plan import Plan, Unit
from ..results.columnar import MemoryRecorder
from ..results.folder import COMPLETED, RUNNING
from ..results.formats import recorder_of
from ..results.read import Results
from ..results.recorder import BLOCK, Recorder
from ..results.run_record import run_record
from .interrupts import StopFlag, interrupts
from .log import MASTER, WARNING, Log, Message
from .master import Ended, Interrupted, Master
from .opening import open_unit
from .slave import Slave

Progress = Callable[[int, int], None]
"""Called a few times a second with the communication points done and those in all."""

Opener = Callable[[Unit, Log, set[Path]], Slave]
"""Makes the instance of a unit (see `opening.open_unit`)."""

KEPT = "What was recorded until then"
"""How the sentence begins that names the results of a run that failed."""
REPORT_EVERY = 0.2
"""Time between two reports of progress [s], while a single step does not take longer."""


@dataclass(frozen=True)
class RunInfo:
    """What a completed run has to tell beside its results."""

    folder: Path
    rows: int
    columns: int
    id: str  # in run.json too: which run the results in a folder are of
    wall_time: float  # of initialization and stepping [s]
    passes: int  # of initialization
    warnings: list[Message] = field(default_factory=list)
    ended: str | None = None  # why a unit ended it before its stop time


def simulate(
    plan: Plan,
    out: Path | str,
    *,
    progress: Progress | None = None,
    opener: Opener = open_unit,
    format: str = "csv",
) -> RunInfo:
    """Run a plan and write its results (`results.csv`) and `run.json` into the folder `out`.

    A run that fails or is interrupted (Ctrl-C, SIGTERM) writes what it has recorded, and why it
    ended, before it raises. Results of an earlier run in `out` are replaced as a whole; a run that fails
    leaves those of one that reached its end, and puts its own into `failed` beside them. A run that a unit
    wants to end is complete, and says so. All is on the
    disk before the units are terminated and freed.

    Args:
        plan: made by `wiring.make_plan`.
        out: folder of the results; made if it does not exist.
        progress: told how far the run is.
        opener: makes the instances; tests put their own in.
        format: of the results, one of `results.formats.FILES`.

    Raises:
        ScenarioError: there is no such format.
        ModelDescriptionError: an FMU has no library that this computer can load.
        SimulationError: a unit failed, a wire was not finite, the run was interrupted or the results
            cannot be written any further.
        ResultsError: nothing can be written to `out`, or the format needs a package that is missing.
    """
    recorder = recorder_of(format)(Path(out), *_columns(plan))
    run = _go(plan, recorder, progress, opener)
    passes = run.master.passes if run.master else 0
    warnings = list(run.log.warnings())
    ended = None if run.ended is None else str(run.ended)
    return RunInfo(
        Path(out), recorder.written, len(plan.record), run.id, run.wall_time, passes, warnings, ended
    )


def simulate_in_memory(
    plan: Plan, *, progress: Progress | None = None, opener: Opener = open_unit
) -> Results:
    """Run a plan and return its results; nothing is written.

    Raises:
        ModelDescriptionError, SimulationError: as `simulate`.
    """
    recorder = MemoryRecorder(*_columns(plan))
    _go(plan, recorder, progress, opener)
    assert recorder.results is not None
    return recorder.results


def _columns(plan: Plan) -> tuple[list[str], list[bool], dict[str, str | None]]:
    """Return the names of the recorded columns, which are Real, and their units."""
    units = {unit.name: unit for unit in plan.units}
    recorded = {f"{unit}.{name}": units[unit].fmu.variables[name] for unit, name in plan.record}
    units_of = {"time": "s", **{column: variable.unit for column, variable in recorded.items()}}
    return list(recorded), [variable.type == "Real" for variable in recorded.values()], units_of


def _go(plan: Plan, recorder: Recorder | MemoryRecorder, progress: Progress | None, opener: Opener) -> _Run:
    """Run a plan into a recorder."""
    run = _Run(plan, recorder, progress)
    with interrupts(run.stop, run.abandon):
        try:
            run.announce()
            try:
                with np.errstate(all="ignore"):  # what is not finite is found by looking, not by warning
                    run.go(opener)
            except BaseException as error:
                run.fail(error)
                raise
            run.save(COMPLETED)
        finally:
            run.end()
    return run


class _Run:
    """The course of one run: what there is to write when it ends, however it ends."""

    def __init__(self, plan: Plan, recorder: Recorder | MemoryRecorder, progress: Progress | None) -> None:
        self.plan = plan
        self.recorder = recorder
        self.progress = progress
        self.log = Log()
        self.stop = StopFlag()
        self.master: Master | None = None
        self.ended: Ended | None = None
        self.id = uuid.uuid4().hex[:12]
        self._slaves: dict[str, Slave] = {}
        self._record: dict[str, Any] = {}  # of the run that has ended
        self._ended_by: str | None = None  # unit
        self._started = datetime.now(timezone.utc)
        self._began = time.perf_counter()
        self._handed_over = 0  # rows given to the recorder
        self._writing = False

    @property
    def wall_time(self) -> float:
        return time.perf_counter() - self._began

    def announce(self) -> None:
        """Write down that the run has begun."""
        self.recorder.announce(self._recorded(RUNNING))

    def go(self, opener: Opener) -> None:
        """Open, initialize, step."""
        corrupted: set[Path] = set()
        for unit in self.plan.units:
            for doubt in unit.fmu.doubts():
                self.log.add(unit.name, WARNING, MASTER, doubt, self.plan.time(0))
            self._slaves[unit.name] = opener(unit, self.log, corrupted)
        self.master = Master(self.plan, self._slaves, self.log, self.stop)
        self.master.initialize(self.recorder.rows[0], self.recorder.others)
        try:
            self._step(self.master)
        except Ended as ending:
            self.ended = ending
            self._flush()

    def end(self) -> None:
        """Terminate and free the units, and note in the record what they said to it."""
        try:
            for slave in reversed(self._slaves.values()):
                slave.free()
        finally:
            freed = {**self._record, **self.log.record(self._ended_by), "units_freed": True}
            self.recorder.close(freed if self._record else None)

    def _step(self, master: Master) -> None:
        """Step to the end, in stretches short enough to report progress between them."""
        total, stretch, reported = self.plan.n_steps, 1, time.perf_counter()
        while master.completed < total:
            filled = master.completed + 1 - self._handed_over
            if filled == BLOCK:
                self._flush()
                filled = 0
            end = min(total, master.completed + min(stretch, BLOCK - filled))
            master.advance(end, self.recorder.rows[filled:], self.recorder.others)
            now = time.perf_counter()
            if now - reported < REPORT_EVERY:
                stretch = min(2 * stretch, BLOCK)
                continue
            stretch, reported = max(1, stretch // 2), now
            if self.progress is not None:
                self.progress(master.completed, total)
        self._flush()
        if self.progress is not None:
            self.progress(total, total)

    def _flush(self) -> None:
        """Hand all whole rows to the disk."""
        if self.master is None:
            return
        count = self.master.completed + 1 - self._handed_over
        self._handed_over += count
        self._writing = True
        try:
            self.recorder.write(count)
        except ResultsError as error:
            time_reached = self.plan.time(self.master.completed)
            kept = "; the rows that fit are kept" if getattr(self.recorder, "rows_stay", False) else ""
            problem = f"{error.problems[0].rstrip('.')} (at t = {time_reached:.9g} s){kept}."
            raise SimulationError(problem, unit=None, time=time_reached) from None
        finally:
            self._writing = False

    def fail(self, error: BaseException) -> None:
        """Write what there is and why there is no more."""
        with contextlib.suppress(SimulationError):  # the disk may be why; what fits has been kept
            self._flush()
        problems = error.problems if isinstance(error, YawbenchError) else []
        try:
            self.save("interrupted" if isinstance(error, Interrupted) else "failed", error)
        except ResultsError as lost:
            problems += lost.problems
        else:
            if self.recorder.place is not None:
                problems.append(f"{KEPT}: {self.recorder.place}")

    def abandon(self) -> None:
        """Leave at once: somebody insists, perhaps because a unit never comes back."""
        if self._writing:
            return
        doing = "while its units were freed" if self._record else "inside a unit"
        error = Interrupted(f"the run was interrupted {doing}", unit=None, time=self.log.time.value)
        try:
            if not self._record:
                self.fail(error)
        finally:
            where = "" if self.recorder.place is None else f"; results so far: {self.recorder.place}"
            print(f"yawbench: {error}{where}", file=sys.stderr, flush=True)
            os._exit(error.exit_status)

    def save(self, status: str, error: BaseException | None = None) -> None:
        """Write the record of the run and put the results in place."""
        self._writing = True
        self._ended_by = getattr(error, "unit", None)
        ended = {"wall_time": self.wall_time, "error": self._explained(error), "units_freed": False}
        if self.ended is not None:
            ended["ended"] = {"unit": self.ended.unit, "time": self.ended.time, "message": str(self.ended)}
        record = self._recorded(status) | self.log.record(self._ended_by) | ended
        self.recorder.finish(record)
        self._record, self._writing = record, False

    def _recorded(self, status: str) -> dict[str, Any]:
        return {"id": self.id, **run_record(self.plan, status=status, started=self._started)}

    def _explained(self, error: BaseException | None) -> dict[str, Any] | None:
        if error is None:
            return None
        unit = getattr(error, "unit", None)
        return {
            "message": str(error) or type(error).__name__,
            "unit": unit,
            "time": getattr(error, "time", None),
            "inputs": self.master.inputs_of(unit) if unit and self.master else {},
            "traceback": self.log.tracebacks(unit) if unit else [],
        }

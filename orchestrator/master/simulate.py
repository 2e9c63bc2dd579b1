"""One run, from a plan to results: what there is to write of it when it ends, however it ends."""

from __future__ import annotations

import contextlib
import os
import sys
import time
import uuid
from dataclasses import asdict, dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from ..errors import (
    KEPT,
    Interrupted,
    Problem,
    ResultsError,
    ScenarioError,
    SimulationError,
    YawbenchError,
)
from ..messages import printable
from ..metrics.plausibility import PlausibilityWatch
from ..plan import Finding, Plan
from ..results.columnar import MemoryRecorder
from ..results.folder import COMPLETED, RUNNING
from ..results.formats import recorder_of
from ..results.freshness import key_of
from ..results.read import Results
from ..results.recorder import Recorder
from ..results.run_record import run_record
from .child_run import ChildRun, can_be_apart
from .fmi import open_unit
from .log import Log, Message
from .process_state import StopFlag, interrupts
from .run_loop import OpenInstance, RunLoop, RunProgress

IN_MEMORY = 16 * 10**9
"""Bytes that the results of a run may take in memory. Chosen: what a desktop computer has."""


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
    findings: tuple[Finding, ...] = ()  # on the run's course


def simulate(
    plan: Plan,
    out: Path | str,
    *,
    progress: RunProgress | None = None,
    opener: OpenInstance = open_unit,
    format: str = "csv",
    apart: bool = False,
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
        apart: step the units in a process of their own, where that is possible (see `apart`): whatever
            becomes of it, the run ends with a sentence and the results so far.

    Raises:
        ScenarioError: there is no such format.
        ModelDescriptionError: an FMU has no library that this computer can load.
        SimulationError: a unit failed, a wire was not finite or the results cannot be written any further.
        Interrupted: Ctrl-C or SIGTERM.
        ResultsError: nothing can be written to `out`, or the format needs a package that is missing.
    """
    recorder = recorder_of(format)(Path(out), *_columns(plan))
    run = Simulation(plan, recorder, progress, apart=apart and can_be_apart())
    run.make(opener)
    return RunInfo(
        Path(out),
        recorder.written,
        len(plan.record),
        run.id,
        run.wall_time,
        run.course.passes,
        list(run.log.warnings()),
        None if run.course.ended is None else str(run.course.ended),
        run.watch.findings(),
    )


def simulate_in_memory(
    plan: Plan, *, progress: RunProgress | None = None, opener: OpenInstance = open_unit
) -> Results:
    """Run a plan and return its results; nothing is written.

    Raises:
        ScenarioError: they would take more memory than `IN_MEMORY`.
        ModelDescriptionError, SimulationError: as `simulate`.
    """
    taken = 8 * (plan.n_steps + 1) * (len(plan.record) + 1)
    if taken > IN_MEMORY:
        size = f"{plan.n_steps:,} steps of {len(plan.record)} variables are {taken / 1e9:.3g} GB"
        raise ScenarioError(
            f"{size}, and {IN_MEMORY / 1e9:g} GB may be kept in memory: record less, or let 'yawbench run' "
            "write them to a file"
        )
    recorder = MemoryRecorder(*_columns(plan))
    Simulation(plan, recorder, progress, apart=False).make(opener)
    assert recorder.results is not None
    return recorder.results


def _columns(plan: Plan) -> tuple[list[str], list[bool], dict[str, str | None]]:
    """Return the names of the recorded columns, which are Real, and their units."""
    units = {unit.name: unit for unit in plan.instances}
    recorded = {f"{unit}.{name}": units[unit].fmu.variables[name] for unit, name in plan.record}
    units_of = {"time": "s", **{column: variable.unit for column, variable in recorded.items()}}
    return list(recorded), [variable.type == "Real" for variable in recorded.values()], units_of


class Simulation:
    """One run of a plan into a recorder.

    Args:
        apart: step the units in a process of their own (see `apart`).
    """

    def __init__(
        self, plan: Plan, recorder: Recorder | MemoryRecorder, progress: RunProgress | None, *, apart: bool
    ) -> None:
        self.plan = plan
        self.recorder = recorder
        self.watch = PlausibilityWatch(plan)
        recorder.looks.append(self.watch.look)
        self.log = Log()
        self.id = uuid.uuid4().hex[:12]
        self._key = key_of(plan)
        self._apart = apart
        self._stop = StopFlag()
        course = ChildRun if apart else RunLoop
        self.course: RunLoop = course(plan, recorder, self.log, self._stop, progress)
        self._saved = False
        self._ended_by: str | None = None  # unit
        self._started = datetime.now(timezone.utc)
        self._began = time.perf_counter()
        self._saving = False

    @property
    def wall_time(self) -> float:
        return time.perf_counter() - self._began

    def make(self, opener: OpenInstance) -> None:
        """Go from beginning to end; write what there is however it ends, before units are freed."""
        with interrupts(self._stop, self._abandon):
            try:
                self.recorder.announce(self._recorded(RUNNING))
                try:
                    self.course.go(opener)
                except BaseException as error:
                    self._fail(error)
                    raise
                self._save(COMPLETED)
            finally:
                self._end()

    def _fail(self, error: BaseException) -> None:
        """Write what there is and why there is no more."""
        with contextlib.suppress(SimulationError):  # the disk may be why; what fits has been kept
            self.course.flush()
        problems = error.problems if isinstance(error, (YawbenchError, Interrupted)) else []
        if isinstance(error, SimulationError):
            error.findings = self.watch.findings()
        try:
            self._save("interrupted" if isinstance(error, KeyboardInterrupt) else "failed", error)
        except ResultsError as lost:
            problems += lost.problems
        else:
            if self.recorder.place is not None:
                sentence = f"What was recorded until then: {self.recorder.place}"
                problems.append(Problem(sentence, kind=KEPT))

    def _abandon(self) -> None:
        """Leave at once: somebody insists, perhaps because a unit never comes back."""
        if self._saving or self.course.writing:
            return
        if self._apart:  # units that are apart are not waited for long anyway
            return
        doing = "while its units were freed" if self._saved else "inside a unit"
        error = self._stop.interrupted(doing, time=self.log.time.value)
        if self.recorder.place is None:  # the program is somebody else's
            raise error
        try:
            if not self._saved:
                self._fail(error)
        finally:
            place = printable(str(self.recorder.place))
            print(f"yawbench: {error}; results so far: {place}", file=sys.stderr, flush=True)
            os._exit(error.exit_status)

    def _save(self, status: str, error: BaseException | None = None) -> None:
        """Write the record of the run and put the results in place."""
        self._saving = True
        self._ended_by = getattr(error, "unit", None)
        ended: dict[str, Any] = {
            "wall_time": self.wall_time,
            "error": self._explained(error),
            "units_freed": False,
            "findings": [asdict(one) for one in (*self.plan.findings, *self.watch.findings())],
        }
        if self.course.ended is not None:
            ended["ended"] = {
                "unit": self.course.ended.instance,
                "time": self.course.ended.time,
                "message": str(self.course.ended),
            }
        record = self._recorded(status) | self.log.record(self._ended_by) | ended
        self.recorder.finish(record)
        self._saved, self._saving = True, False

    def _end(self) -> None:
        """Terminate and free the units; add to the record, which is written by then, what they said."""
        try:
            self.course.end()
        finally:
            freed = {**self.log.record(self._ended_by), "units_freed": True}
            self.recorder.close(freed if self._saved else None)

    def _recorded(self, status: str) -> dict[str, Any]:
        return {
            "id": self.id,
            "key": self._key,
            **run_record(self.plan, status=status, started=self._started),
        }

    def _explained(self, error: BaseException | None) -> dict[str, Any] | None:
        if error is None:
            return None
        unit = getattr(error, "unit", None)
        return {
            "message": str(error) or type(error).__name__,
            "unit": unit,
            "time": getattr(error, "time", None),
            "inputs": self.course.inputs_of(unit) if unit else {},
            "traceback": self.log.tracebacks(unit) if unit else [],
        }

"""Simulate a plan: make one run and write its results and its run record, however the run ends."""

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
from typing import Any, Protocol

import numpy as np

from yawbench.foundation.errors import (
    Diagnostic,
    Interrupted,
    ResultsError,
    ScenarioError,
    SimulationError,
    YawbenchError,
)
from yawbench.foundation.interrupts import StopFlag, interrupts
from yawbench.foundation.messages import printable

from ..plan import Plan
from ..results.freshness import key_of
from ..results.reader import Results
from ..results.record_of_plan import recorded_variables, run_record, units_of
from ..results.recorder import MemoryRecorder, Recorder, recorder_of
from ..results.run_record import EndRecord, ErrorRecord, EventRecord, RunStatus, WarningRecord
from .child_run import ChildRun, can_be_apart
from .fmi import keeps, open_instance
from .isolation import Isolation
from .log import STATUS, Log, Message
from .run_lifecycle import OpenInstance, RunLifecycle, RunProgress

WRITTEN = 100
"""Warnings written into run.json; further ones are only counted."""
IN_MEMORY = 16 * 10**9
"""Largest size of results kept in memory [B]; chosen: the memory of a desktop computer."""


class Watch(Protocol):
    """Observer of a run: looks at the rows as they are recorded, and says what it has seen."""

    def look(self, rows: np.ndarray, /) -> None:
        """Look at rows: shape (n, 1 + Real columns), time first."""

    def warnings(self) -> tuple[Diagnostic, ...]:
        """Return the warnings so far."""

    def events(self) -> list[EventRecord] | None:
        """Return the events so far, in the order of their begin; None if it does not look for them."""

    def geometry(self) -> dict[str, Any]:
        """Return where the run takes place as plain data, empty if nothing is known of it."""


@dataclass(frozen=True)
class RunInfo:
    """Summary of a completed run, in addition to its results."""

    folder: Path
    rows: int
    columns: int
    id: str | None  # unique, also in run.json, to identify the run that a folder's results belong to
    wall_time: float  # of initialization and stepping [s]
    passes: int  # of initialization
    warnings: list[Message] = field(default_factory=list)
    ended: str | None = None  # why an instance ended it before its stop time
    diagnostics: tuple[Diagnostic, ...] = ()  # about its course, such as a car that spins
    events: tuple[EventRecord, ...] = ()  # in the order of their begin


def simulate(
    plan: Plan,
    out: Path | str,
    *,
    progress: RunProgress | None = None,
    opener: OpenInstance = open_instance,
    watch: Watch | None = None,
    format: str = "csv",
    apart: bool = False,
    pace: float | None = None,
    hear: Callable[[Message], None] | None = None,
) -> RunInfo:
    """Run a plan and write its results (`results.csv`) and `run.json` into the folder `out`.

    A run that fails or is interrupted (Ctrl-C, SIGTERM) writes what it has recorded, and why it
    ended, before it raises. Results of an earlier run in `out` are replaced as a whole, but a run that
    fails keeps the results of an earlier completed run and writes its own into the subfolder `failed`.
    A run that an instance asks to end counts as completed, and its record says so. Everything is on disk
    before the instances are terminated and freed.

    Args:
        plan: made by `wiring.make_plan`.
        out: folder of the results; made if it does not exist.
        progress: called with the number of communication points done and their total.
        opener: creates the instances; tests pass their own.
        watch: looks at the recorded rows; its warnings stand in the record.
        format: of the results, one of `results.file_formats.FILES`.
        apart: step the instances in a child process where that is possible (see `child_run`), unless each
            has a process of its own: even if it crashes, the run ends with an error message and the results
            so far.
        pace: simulated seconds per second; None: as fast as possible.
        hear: called with the messages of the instances as they arrive.

    Raises:
        ScenarioError: `format` is unknown.
        ModelDescriptionError: an FMU has no library that this computer can load.
        SimulationError: an instance failed, a wire was not finite or writing the results failed.
        Interrupted: Ctrl-C or SIGTERM.
        ResultsError: `out` is not writable.
    """
    recorder = recorder_of(format)(Path(out), *_columns(plan))
    apart = apart and can_be_apart() and not keeps(plan) and not isinstance(opener, Isolation)
    run = Simulation(plan, recorder, progress, watch, apart=apart, hear=hear)
    run.course.pace = pace
    run.make(opener)
    return RunInfo(
        Path(out),
        recorder.written,
        len(plan.record),
        run.record.id,
        run.wall_time,
        run.course.passes,
        list(run.log.warnings()),
        None if run.course.ended is None else str(run.course.ended),
        run.diagnostics,
        tuple(run.record.events),
    )


def simulate_in_memory(
    plan: Plan,
    *,
    progress: RunProgress | None = None,
    opener: OpenInstance = open_instance,
    watch: Watch | None = None,
) -> Results:
    """Run a plan and return its results without writing anything to disk.

    Raises:
        ScenarioError: the results would take more memory than `IN_MEMORY`.
        ModelDescriptionError, SimulationError: as for `simulate`.
    """
    recorder = memory_recorder(plan)
    Simulation(plan, recorder, progress, watch, apart=False).make(opener)
    assert recorder.results is not None
    return recorder.results


def memory_recorder(plan: Plan) -> MemoryRecorder:
    """Return a recorder in memory for a run.

    Raises:
        ScenarioError: the results would take more memory than `IN_MEMORY`.
    """
    size = 8 * (plan.n_steps + 1) * (len(plan.record) + 1)
    if size > IN_MEMORY:
        what = f"{plan.n_steps:,} steps of {len(plan.record)} variables are {size / 1e9:.3g} GB"
        raise ScenarioError(
            f"{what}, and {IN_MEMORY / 1e9:g} GB may be kept in memory: record less, or let 'yawbench run' "
            "write them to a file",
            code="results-too-large",
        )
    return MemoryRecorder(*_columns(plan), most=plan.n_steps + 1)


def _columns(plan: Plan) -> tuple[list[str], list[bool], dict[str, str | None]]:
    """Return the names of the recorded columns, whether each is Real, and the units of measurement."""
    recorded = recorded_variables(plan)
    return list(recorded), [variable.type == "Real" for variable in recorded.values()], units_of(plan)


class Simulation:
    """Makes one run of a plan and records it.

    Args:
        apart: step the instances in a child process (see `child_run`).
        hear: called with the messages of the instances as they arrive.
    """

    def __init__(
        self,
        plan: Plan,
        recorder: Recorder | MemoryRecorder,
        progress: RunProgress | None,
        watch: Watch | None,
        *,
        apart: bool,
        hear: Callable[[Message], None] | None = None,
    ) -> None:
        self.plan = plan
        self.recorder = recorder
        self._watch = watch
        if watch:
            recorder.looks.append(watch.look)
        self.log = Log(hear)
        self.record = run_record(plan, status=RunStatus.RUNNING, started=datetime.now(timezone.utc))
        self.record.id, self.record.key = uuid.uuid4().hex[:12], key_of(plan)
        self._apart = apart
        self.stop = StopFlag()
        self.notes: list[Diagnostic] = []  # about what its caller has changed during it
        course = ChildRun if apart else RunLifecycle
        self.course: RunLifecycle = course(plan, recorder, self.log, self.stop, progress)
        self._saved = False
        self._ended_by: str | None = None  # instance
        self._began = time.perf_counter()
        self._saving = False

    @property
    def diagnostics(self) -> tuple[Diagnostic, ...]:
        """What is said of the course of the run, such as that a car spins."""
        return (*(self._watch.warnings() if self._watch else ()), *self.notes)

    @property
    def wall_time(self) -> float:
        return time.perf_counter() - self._began

    def make(self, opener: OpenInstance) -> None:
        """Make the run; write results and record however it ends, before the instances are freed."""
        with interrupts(self.stop, self.abandon):
            try:
                self.recorder.announce(self.record)
                try:
                    self.course.go(opener)
                except MemoryError:
                    lost = self._of_machine(
                        "the memory of this computer does not suffice", "memory-exhausted"
                    )
                    self._fail(lost)
                    raise lost from None
                except BaseException as error:
                    self._fail(error)
                    raise
                self.save_all()
            finally:
                self._end()

    def save_all(self) -> None:
        """Write the results of a run that has reached its end, if every row of it was recorded.

        Raises:
            SimulationError: one was not, or they cannot be written.
        """
        rows = self.plan.n_steps + 1 if self.course.ended is None else self.course.handed_over
        if self.recorder.written != rows:
            lost = self._of_machine(
                f"{self.recorder.written} of {rows} rows were recorded", "results-unwritable"
            )
            self._fail(lost)
            raise lost
        try:
            self.save(RunStatus.COMPLETED)
        except ResultsError as error:
            raise self._of_machine(error.diagnostics, error.code) from None

    def _of_machine(self, messages: str | list[Diagnostic], code: str) -> SimulationError:
        """Return the exception for a failure that is not the model's."""
        time = self.plan.time(max(0, self.recorder.written - 1))
        return SimulationError(messages, instance=None, time=time, code=code)

    def _fail(self, error: BaseException) -> None:
        """Write the results so far, and the error that ended the run."""
        with contextlib.suppress(SimulationError):  # perhaps the disk is full; rows that fit are kept
            self.course.flush()
        diagnostics = error.diagnostics if isinstance(error, (YawbenchError, Interrupted)) else []
        if isinstance(error, SimulationError):
            error.warnings = self.diagnostics
        try:
            interrupted = isinstance(error, KeyboardInterrupt)
            self.save(RunStatus.INTERRUPTED if interrupted else RunStatus.FAILED, error)
        except ResultsError as lost:
            diagnostics += lost.diagnostics
        else:
            if self.recorder.written_to is not None:
                sentence = f"What was recorded until then: {self.recorder.written_to}"
                diagnostics.append(Diagnostic("results-kept", sentence, "info"))

    def abandon(self) -> None:
        """Exit at once after a second signal: an FMU may be hanging."""
        if self._saving or self.course.writing:
            return
        if self._apart:  # a child process is never waited for long
            return
        doing = "while its instances were freed" if self._saved else "inside an instance"
        error = self.stop.interrupted(doing, time=self.log.time.value)
        if self.recorder.written_to is None:  # results in memory: the caller's program must go on
            raise error
        try:
            if not self._saved:
                self._fail(error)
        finally:
            results = printable(str(self.recorder.written_to))
            print(f"yawbench: {error}; results so far: {results}", file=sys.stderr, flush=True)
            os._exit(error.exit_status)

    def save(self, status: RunStatus, error: BaseException | None = None) -> None:
        """Write the record of the run and put the results in place."""
        self._saving = True
        self._ended_by = getattr(error, "instance", None)
        record, ended = self.record, self.course.ended
        record.status = status
        record.wall_time, record.loop = self.wall_time, self.course.loop
        record.error = self._explained(error)
        record.units_freed = False
        record.diagnostics = [*self.plan.diagnostics, *self.diagnostics]
        events = self._watch.events() if self._watch else None
        if events is not None:
            record.events = events
        if self._watch and (geometry := self._watch.geometry()):
            record.geometry = geometry
        if ended is not None:
            record.ended = EndRecord(instance=ended.instance, time=ended.time, message=str(ended))
        self._note_warnings()
        try:
            self.recorder.finish(record)
            self._saved = True
        finally:
            self._saving = False

    def _end(self) -> None:
        """Terminate and free the instances; add their last messages to the record already written."""
        try:
            self.course.end()
        finally:
            if self._saved:
                self._note_warnings()
                self.record.units_freed = True
            self.recorder.close(self.record if self._saved else None)

    def _note_warnings(self) -> None:
        """Set the warnings of the record to those logged so far."""
        warnings = list(self.log.warnings(self._ended_by))
        self.record.warnings = [
            WarningRecord(instance=m.instance, time=m.time, status=STATUS[m.status], text=m.text)
            for m in warnings[:WRITTEN]
        ]
        self.record.more_warnings = max(0, len(warnings) - WRITTEN) + self.log.dropped

    def _explained(self, error: BaseException | None) -> ErrorRecord | None:
        if error is None:
            return None
        instance = getattr(error, "instance", None)
        return ErrorRecord(
            message=str(error) or type(error).__name__,
            instance=instance,
            time=getattr(error, "time", None),
            inputs=self.course.inputs_of(instance) if instance else {},
            traceback=self.log.tracebacks(instance) if instance else [],
        )

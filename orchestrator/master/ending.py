"""What there is to write of a run when it ends, however it ends."""

from __future__ import annotations

import contextlib
import os
import sys
import time
import uuid
from dataclasses import asdict
from datetime import datetime, timezone
from typing import Any

from ..errors import KEPT, Problem, ResultsError, SimulationError, YawbenchError
from ..metrics.plausibility import Watch
from ..plan import Plan
from ..results.columnar import MemoryRecorder
from ..results.folder import COMPLETED, RUNNING
from ..results.key import key_of
from ..results.recorder import Recorder
from ..results.run_record import run_record
from .apart import CourseApart
from .course import Course, Opener, Progress
from .interrupts import StopFlag, interrupts
from .log import Log
from .master import Ended, Interrupted


class Run:
    """One run of a plan into a recorder.

    Args:
        apart: step the units in a process of their own (see `apart`).
    """

    def __init__(
        self, plan: Plan, recorder: Recorder | MemoryRecorder, progress: Progress | None, *, apart: bool
    ) -> None:
        self.plan = plan
        self.recorder = recorder
        self.watch = Watch(plan)
        recorder.looks.append(self.watch.look)
        self.log = Log()
        self.id = uuid.uuid4().hex[:12]
        self._key = key_of(plan)
        self._apart = apart
        self._stop = StopFlag()
        course = CourseApart if apart else Course
        self._course: Course | CourseApart = course(plan, recorder, self.log, self._stop, progress)
        self._saved = False
        self._ended_by: str | None = None  # unit
        self._started = datetime.now(timezone.utc)
        self._began = time.perf_counter()
        self._saving = False

    @property
    def wall_time(self) -> float:
        return time.perf_counter() - self._began

    @property
    def passes(self) -> int:
        """Of initialization."""
        return self._course.passes

    @property
    def ended(self) -> Ended | None:
        """Whether a unit has ended the run before the plan's end."""
        return self._course.ended

    def make(self, opener: Opener) -> None:
        """Go from beginning to end; write what there is however it ends, before units are freed."""
        with interrupts(self._stop, self._abandon):
            try:
                self.recorder.announce(self._recorded(RUNNING))
                try:
                    self._course.go(opener)
                except BaseException as error:
                    self._fail(error)
                    raise
                self._save(COMPLETED)
            finally:
                self._end()

    def _fail(self, error: BaseException) -> None:
        """Write what there is and why there is no more."""
        with contextlib.suppress(SimulationError):  # the disk may be why; what fits has been kept
            self._course.flush()
        problems = error.problems if isinstance(error, YawbenchError) else []
        if isinstance(error, SimulationError):
            error.findings = self.watch.findings()
        try:
            self._save("interrupted" if isinstance(error, Interrupted) else "failed", error)
        except ResultsError as lost:
            problems += lost.problems
        else:
            if self.recorder.place is not None:
                sentence = f"What was recorded until then: {self.recorder.place}"
                problems.append(Problem(sentence, kind=KEPT))

    def _abandon(self) -> None:
        """Leave at once: somebody insists, perhaps because a unit never comes back."""
        if (
            self._saving or self._course.writing or self._apart
        ):  # units that are apart are not waited for long anyway
            return
        doing = "while its units were freed" if self._saved else "inside a unit"
        error = Interrupted(f"the run was interrupted {doing}", unit=None, time=self.log.time.value)
        try:
            if not self._saved:
                self._fail(error)
        finally:
            where = "" if self.recorder.place is None else f"; results so far: {self.recorder.place}"
            print(f"yawbench: {error}{where}", file=sys.stderr, flush=True)
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
        if self.ended is not None:
            ended["ended"] = {"unit": self.ended.unit, "time": self.ended.time, "message": str(self.ended)}
        record = self._recorded(status) | self.log.record(self._ended_by) | ended
        self.recorder.finish(record)
        self._saved, self._saving = True, False

    def _end(self) -> None:
        """Terminate and free the units; add to the record, which is written by then, what they said."""
        try:
            self._course.end()
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
            "inputs": self._course.inputs_of(unit) if unit else {},
            "traceback": self.log.tracebacks(unit) if unit else [],
        }

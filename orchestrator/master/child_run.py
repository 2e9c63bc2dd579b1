"""Runs in a child process: the instances are stepped there, while this process keeps the results.

An FMU that crashes, calls exit, hangs or closes all files does so in the child: the parent sees the child end
without its final record, and still has every row. So a run of third-party code never ends silently, and
Ctrl-C always works, whatever the FMU does with signals.

Chosen over isolating every third-party FMU by default, which costs 40 to 90 us per instance and step. This
costs a fork, a few milliseconds per run, and nothing per step. It does not protect instances from each other:
see `arithmetic` for what they may change for each other, and `isolation` for protection. It is used on Linux
only.

The row being filled, those before it that the parent has not been sent yet, and the run's position, which
says whose call ended the process, lie in memory that both share. Blocks of rows and everything else go
through a pipe, a few records per second.
"""

from __future__ import annotations

import itertools
import json
import mmap
import sys
import threading
import time
import traceback
from collections.abc import Callable
from functools import partial

import numpy as np

from yawbench.fmus.fmu import Value
from yawbench.foundation.errors import Interrupted, SimulationError, YawbenchError
from yawbench.foundation.interrupts import StopFlag, stop_requested_at
from yawbench.foundation.messages import listed
from yawbench.foundation.processes import Channel, Child, Process, ProcessLost, fork

from ..plan import Plan
from ..results.recorder import BLOCK, RowBlock
from .log import MASTER, WARNING, Log, LogRelay
from .run_lifecycle import OpenInstance, RunLifecycle, RunProgress
from .step_loop import EndRequested, RunPosition

INITIALIZATION_LIMIT = 60.0
"""Time that a call of an FMU may take during initialization [s]; chosen: enough to load Python and large
tables from a slow disk, as `isolation.START_LIMIT`. --isolate --call-limit allows more."""
KILL_AFTER = 3.0
"""Time from a stop request until the child is killed [s]; chosen: far longer than a step."""
END_LIMIT = 10.0
"""Time allowed for terminating and freeing the instances [s]; the results are written by then."""
_SLOT = 256
"""Bytes of shared memory per row for values that are not Real, so that they survive a crash of the child."""


class _Others(list[list[Value]]):
    """Non-Real values, one list per row, stored in shared memory, too, unless they are too long."""

    def __init__(self) -> None:
        super().__init__()
        self._slots = mmap.mmap(-1, BLOCK * _SLOT)

    def append(self, values: list[Value]) -> None:
        data, at = json.dumps(values).encode(), len(self) * _SLOT
        self._slots[at : at + _SLOT] = (data if len(data) <= _SLOT else b"").ljust(_SLOT)
        super().append(values)

    def kept(self, count: int) -> list[list[Value]]:
        """Return those of the first rows, as far as stored, from the other process, too."""
        slots = [self._slots[at * _SLOT : (at + 1) * _SLOT].strip() for at in range(count)]
        return [json.loads(slot) for slot in itertools.takewhile(bool, slots)]


class SharedRows:
    """Memory shared by both processes: the run's position, and a block of rows of `width` numbers.

    In the child, these are the `run_lifecycle.RecordedRows`, sent to the parent block by block.
    """

    channel: Channel

    def __init__(self, width: int) -> None:
        self._map = mmap.mmap(-1, 32 + 8 * BLOCK * width)
        self.position = RunPosition.from_buffer(self._map).begin()
        self.rows = np.frombuffer(self._map, float, offset=32).reshape(BLOCK, width)
        others = _Others()
        self.others: list[list[Value]] = others
        self.kept = others.kept

    def write(self, count: int) -> None:
        """Send the first `count` rows."""
        if count > 0:
            self.channel.send("rows", (self.rows[:count], list(self.others)))
            self.others.clear()


def _make(
    plan: Plan,
    opener: OpenInstance,
    stop: StopFlag,
    shared: SharedRows,
    pace: float | None,
    commands: int,
    answers: int,
) -> None:
    """Make a run in this process, which has been forked for it."""
    shared.channel = channel = Channel(commands, answers)
    log = LogRelay(channel, timed=True)

    def progress(*done: int) -> None:
        channel.send("progress", done)

    course = RunLifecycle(plan, shared, log, stop, progress, shared.position)
    course.pace = pace
    error: BaseException | None = None
    inputs: dict[str, Value] = {}
    try:
        try:
            course.go(opener)
        except (YawbenchError, Interrupted, MemoryError) as failed:
            error, instance = failed, getattr(failed, "instance", None)
            inputs = course.inputs_of(instance) if instance else {}
        except BaseException:
            error = RuntimeError(traceback.format_exc())
        log.finish()
        ended = course.ended and (str(course.ended), course.ended.instance, course.ended.time)
        channel.send("ended", (course.passes, course.loop, ended, error, inputs))
        while channel.receive()[0] != "free":
            pass
        course.end()
        log.finish()
        channel.send("freed")
    except OSError as gone:
        raise EOFError from gone  # the parent is gone, or an FMU has closed the pipe to it


def can_be_apart() -> bool:
    """Return whether runs in a child process are supported here: Linux, and the main thread (for signals)."""
    return sys.platform == "linux" and threading.current_thread() is threading.main_thread()


class ChildRun(RunLifecycle, Process):
    """Runs a plan in a child process."""

    def __init__(
        self, plan: Plan, rows: RowBlock, log: Log, stop: StopFlag, progress: RunProgress | None
    ) -> None:
        self._shared = SharedRows(len(rows.rows[0]))
        RunLifecycle.__init__(self, plan, rows, log, stop, progress, self._shared.position)
        self._rows: RowBlock = rows
        self._inputs: dict[str, Value] = {}
        self._started = False
        self._told_end = False
        self._told_to_stop = False
        self._sealed = False  # no more rows are written

    def inputs_of(self, instance: str) -> dict[str, Value]:
        """Return the inputs with which the failed instance was last stepped."""
        return self._inputs

    def go(self, opener: OpenInstance) -> None:
        rows: dict[str, Callable[..., None]] = {"rows": self._record, "progress": self._report}
        Process.__init__(self, partial(self._fork, opener), self.log.relayed | rows)
        self._started = True
        try:
            self.passes, self.loop, ended, error, self._inputs = self.hear("ended")
        except ProcessLost as lost:
            raise self._death(lost) from None
        self._told_end = True
        if ended is not None:
            reason, instance, at = ended
            self.ended = EndRequested(reason, instance=instance, time=at)
        if error is not None:
            raise error

    def _fork(self, opener: OpenInstance, commands: int, answers: int) -> Child:
        run = partial(_make, self.plan, opener, self._stop, self._shared, self.pace, commands, answers)
        return Child(fork(run, (commands, answers)))

    def _report(self, done: int, total: int) -> None:
        if self._progress is not None:
            self._progress(done, total)

    def _record(self, rows: np.ndarray, others: list[list[Value]]) -> None:
        if self._sealed:
            self.handed_over += len(rows)
            return
        self._sealed = True  # if this fails, later rows must not be written either
        self._rows.rows = rows
        self._rows.others[:] = others
        self._hand_over(len(rows))
        self._sealed = False

    def flush(self) -> None:
        """Write the rows that the child has left in shared memory."""
        count = min(max(0, self.position.completed + 1 - self.handed_over), BLOCK)
        others = []
        if len(self.plan.record) + 1 > self._shared.rows.shape[1]:  # some columns are not Real
            others = self._shared.kept(count)
            count = len(others)
        self._record(self._shared.rows[:count], others)
        self._sealed = True

    def check_time(self) -> None:
        """Pass a stop request on to the child; kill it if it does not stop, or takes too long."""
        now, requested, position = time.monotonic(), stop_requested_at(), self.position
        if requested is not None and not self._told_to_stop:
            self._told_to_stop = True
            self.child.kill(self._stop.number)
        if now > self._deadline or (requested is not None and now - requested > KILL_AFTER):
            raise self.lost("did not respond")
        if position.completed < 0 and now - position.returned > INITIALIZATION_LIMIT:
            limit = f"{INITIALIZATION_LIMIT:g} s, the limit of a call during initialization"
            raise self.lost(f"did not return within {limit} (--isolate --call-limit allows more)")

    def _death(self, lost: ProcessLost) -> SimulationError | Interrupted:
        """Return the exception for the death of the child process."""
        plan, completed, compiled = self.plan, self.position.completed, []
        instance, doing = None, "step" if completed >= 0 else "initialization"
        if not lost.killed:
            compiled = [one.name for one in plan.instances if one.fmu.compiled]
            number, doing = self.position.where or (None, doing)
            if number is not None:
                instance = plan.instances[number].name
            elif len(compiled) == 1:
                instance = compiled[0]
        period = next((one.period for one in plan.instances if one.name == instance), 1)
        now = plan.time(max(0, completed + 1 - period if (completed + 1) % period == 0 else completed))
        sentence = f"{doing} failed at t = {now:.9g} s: the process of the run {lost}"
        if instance is not None:
            sentence = f"{instance}: {sentence}"
        elif compiled:
            sentence += f"; --isolate shows which instance it was (not in Python are {listed(compiled)})"
        if self._stop.requested:
            return self._stop.interrupted(f": {sentence}", instance=instance, time=now)
        code = "run-process-died" if lost.killed else "fmu-process-died"
        return SimulationError(sentence, instance=instance, time=now, code=code)

    def end(self) -> None:
        """Let the child terminate and free the instances; a crash there is only a warning."""
        if not self._started or self._closed:
            return
        self._sealed = True
        self._deadline = time.monotonic() + END_LIMIT
        try:
            if not self._told_end:
                self.child.kill(self._stop.number)
                self.hear("ended")
            self._channel.send("free")
            self.hear("freed")
        except (ProcessLost, OSError) as lost:
            where = self.position.where
            instance = self.plan.instances[where[0]].name if where else "the instances"
            text = f"while instances were terminated and freed, the process of the run {lost}"
            self.log.add(instance, WARNING, MASTER, text, self.plan.time(max(0, self.position.completed)))
        self.close(kill=True)

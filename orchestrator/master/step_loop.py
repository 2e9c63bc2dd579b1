"""The fixed-step co-simulation master: initializes the instances of a plan and steps them in integer time.

Per communication step it walks a flat list of calls (see `step_program`), checks once that the sum of all
outputs is finite, and copies the recorded values into a row: a few microseconds on top of the instances'
own work, or a fraction of one where `compiled_loop` walks the list. Time is k p / q with whole numbers,
correctly rounded, so it neither drifts nor misses the end.

A value on a wire that is not finite ends the run, because every instance downstream computes with it. A
recorded output that is not wired only gives a warning: FMUs use NaN for "not available" and infinity for a
time that never comes.
"""

from __future__ import annotations

import ctypes
import math
import os
import time
from collections import deque
from collections.abc import Iterator, Mapping
from typing import cast

import numpy as np

from yawbench.fmus.fmu import Value
from yawbench.foundation.errors import Interrupted, SimulationError
from yawbench.foundation.interrupts import StopFlag
from yawbench.foundation.messages import listed
from yawbench.foundation.processes import end_copy_of

from ..plan import Plan
from .arithmetic import Arithmetic
from .compiled_loop import CHECKED, Answer, CompiledLoop, missing_loop
from .initialization import initialize
from .instance import Buffers, FmuInstance, PlainCall, Status
from .log import DISCARD, KILLED, MASTER, OK, WARNING, Log, describe, suspects
from .signal_pool import InstanceSlot, SignalPool
from .step_program import Operation, StepProgram

ALMOST = 1e-6
"""Fraction of a step by which an FMU may stop short of its end; chosen: rounding of its own times."""


class EndRequested(Exception):
    """An instance asked to end the run, which is not a failure: `instance`, at `time` [s]."""

    def __init__(self, reason: str, *, instance: str, time: float) -> None:
        super().__init__(reason)
        self.instance = instance
        self.time = time


WORDS = {"set": "setting inputs", "step": "step", "get": "reading outputs"}
"""Kind of an operation -> what is said of it."""
DOING = (*WORDS.values(), "initialization", "its end")
"""What an instance may be doing."""


class RunPosition(ctypes.Structure):
    """Where a run is, in memory that may be shared with another process.

    `completed` is the last communication point reached, `returned` the time [s], by `time.monotonic`, at
    which a call of initialization last returned, and `call` the number of the call being made: of the
    instance in the plan times the length of `DOING`, plus the place of what it does there; -1 between two.
    """

    _fields_ = [("completed", ctypes.c_int64), ("call", ctypes.c_int64), ("returned", ctypes.c_double)]

    completed: int
    call: int
    returned: float

    def begin(self) -> RunPosition:
        """Set it to the beginning of a run and return it."""
        self.completed = -1
        return self.leave()

    def enter(self, instance: int, doing: str) -> None:
        """Note that a call of an instance begins."""
        self.call = len(DOING) * instance + DOING.index(doing)

    def leave(self) -> RunPosition:
        """Note that it has returned."""
        self.call, self.returned = -1, time.monotonic()
        return self

    @property
    def where(self) -> tuple[int, str] | None:
        """The number of the instance whose code is running, and what it does; None between two calls."""
        instance, doing = divmod(self.call, len(DOING))
        return None if instance < 0 else (instance, DOING[doing])


class Master:
    """Steps the instances of one run. `completed` is the last communication point with all values."""

    def __init__(
        self,
        plan: Plan,
        fmu_instances: Mapping[str, FmuInstance],
        log: Log,
        stop: StopFlag,
        position: RunPosition | None = None,
    ) -> None:
        """Connect the instances; `position` is kept up to date."""
        self.plan = plan
        self.log = log
        self.stop = stop
        self.completed = -1
        log.time.value = plan.time(0)
        self._position = position or RunPosition().begin()
        first = {one.name: len(DOING) * number for number, one in enumerate(plan.instances)}
        self._call_of = {
            (name, kind): first[name] + DOING.index(words) for name in first for kind, words in WORDS.items()
        }
        """Instance and kind of an operation -> number of the call, as in `RunPosition`."""
        self.passes = 0
        self.signals = signals = SignalPool(plan, fmu_instances)
        slow = {s.instance.period for s in signals.slots} - {1}
        self.clocks = {1: log.time} | {period: ctypes.c_double(0.0) for period in slow}
        for s in signals.slots:
            period = s.instance.period
            size = ctypes.c_double(float(period * plan.step))
            into, of = [v.ref for v in s.inputs], [v.ref for v in s.outputs]
            s.calls = s.fmu_instance.connect(Buffers(s.u, into, s.y, of, self.clocks[period], size))
        self.program = StepProgram(signals)
        self._operations: dict[int, list[Operation]] = {}  # of the current `advance`, by phase
        q = math.lcm(plan.step.denominator, plan.start.denominator)
        self._grid = int(plan.start * q), int(plan.step * q), q  # the k-th point is at (s + k p) / q
        real = [signals.index[key] for key in plan.record if key in signals.index]
        self._recorded = np.array([signals.time_at, *real], np.intp)
        self._recorded_others = [key for key in plan.record if key not in signals.index]
        self._wires = [w for w in plan.wires if (w.source, w.output) in signals.index]
        wired = {(w.source, w.output) for w in self._wires}
        self._spare = {key: at for key, at in signals.index.items() if key not in wired}
        """Outputs that are recorded but not wired, and have been finite so far."""
        self._expected = np.arange(signals.n_outputs)  # outputs checked to be finite
        self._ones = np.ones(signals.n_outputs)
        self._ending: EndRequested | None = None
        self._process = os.getpid()
        self._points: Iterator[int] = iter(())  # communication points still to be reached
        self._arithmetic = Arithmetic()
        self._compiled: CompiledLoop | None = None
        self.loop = self._choose_loop()
        """Loop that makes the run: "compiled", or "Python: " and the reason."""

    def _choose_loop(self) -> str:
        """Have the compiled loop make the run if there is something in it that it can do by itself."""
        if not any(isinstance(s.calls.step, PlainCall) for s in self.signals.slots):
            return "Python: no instance is stepped in this process by a C function"
        if missing := missing_loop(self._grid, self.plan.n_steps):
            return f"Python: {missing}"
        signals = self.signals
        parts = signals.pool, signals.time_at, self.clocks, self._grid, self._recorded, self._position
        self._compiled = CompiledLoop(*parts, self._call_of, self.stop.flag)
        self._compiled.expect(self._expected)
        return "compiled"

    def initialize(self, row: np.ndarray, others: list[list[Value]]) -> None:
        """Initialize all instances and record the start as `advance` does.

        Raises:
            SimulationError: an instance fails, a wire does not settle or is not finite.
        """
        self.passes = initialize(self.signals, self._entered, self._check_initialization, self.log)
        self._check_finite(0)
        self.signals.pool.take(self._recorded, None, row, "clip")
        if self._recorded_others:
            others.append(self._values_of_others())
        self.completed = self._position.completed = 0

    def advance(self, end: int, rows: np.ndarray, others: list[list[Value]]) -> None:
        """Step to communication point `end`, filling one of `rows` per point.

        Recorded values that are not Real are appended to `others`, one list per row.

        Raises:
            SimulationError: an instance fails or a wire is not finite. Rows up to `completed` are complete.
            Interrupted: a stop was requested.
            EndRequested: an instance asked to end the run.
        """
        end_copy_of(self._process)
        first, cycle = self.completed + 1, self.program.cycle
        self._operations = {
            k % cycle: self.program.at(k) for k in range(first, min(end, first + cycle - 1) + 1)
        }
        if self._compiled is None:
            self._loop(range(first, end + 1), rows, others)
        else:
            self._compiled.lay(range(first, end + 1), rows, cycle, self._operations)
            self._walk(self._compiled, end, others)
        if self._ending is not None:
            raise self._ending

    def _loop(self, points: range, rows: np.ndarray, others: list[list[Value]]) -> None:
        """Step to the points by the loop in Python, the reference."""
        s, p, q = self._grid
        stop, position, cycle = self.stop.flag, self._position, self.program.cycle
        calls = {
            phase: [(op, op.call, self._call_of.get((op.instance, op.kind), -1)) for op in operations]
            for phase, operations in self._operations.items()
        }
        clocks = list(self.clocks.items())
        total, ones, finite = self.signals.now.dot, self._ones, math.isfinite
        take, recorded, time = self.signals.pool.take, self._recorded, self.signals.time
        self._points = iter(points)
        for k, row in zip(self._points, rows, strict=False):
            if stop.value:
                raise self._interrupted(k)
            for period, clock in clocks:
                if k % period == 0:
                    clock.value = (s + (k - period) * p) / q
            for operation, call, position.call in calls[k % cycle]:
                status = call()
                if status:
                    self._answer(k, operation, status)
            position.call = -1
            end_copy_of(self._process)
            if not finite(total(ones)):
                self._check_finite(k)
            time.value = (s + k * p) / q
            take(recorded, None, row, "clip")
            if self._recorded_others:
                others.append(self._values_of_others())
            self.completed = position.completed = k

    def _walk(self, loop: CompiledLoop, end: int, others: list[list[Value]]) -> None:
        """Step to `end` by the compiled loop, with the calls that only Python can make."""
        cycle, state = self.program.cycle, loop.state
        while self.completed < end:
            answer = loop.walk(self.completed + 1 if self._recorded_others else end)
            self.completed, k = self._position.completed, state.k
            if answer == Answer.FINISHED:
                if self._recorded_others:
                    others.append(self._values_of_others())
            elif answer == Answer.INTERRUPTED:
                raise self._interrupted(k)
            elif answer == Answer.NOT_FINITE:
                self._check_finite(k)
                loop.expect(self._expected)
                state.at = CHECKED
            elif answer in (Answer.PYTHON, Answer.STATUS):
                operation = self._operations[k % cycle][state.at]
                call = operation.call
                if answer == Answer.STATUS:
                    status: Status | None = cast(PlainCall, call).finish(state.status)
                else:
                    self._position.call = self._call_of.get((operation.instance, operation.kind), -1)
                    status = call()
                    end_copy_of(self._process)
                if status:
                    self._answer(k, operation, status)
                    end = end if self._ending is None else k
                state.at += 1

    def go_back(self, point: int) -> None:
        """Note that all values are those of an earlier communication point again."""
        self.completed = self._position.completed = point
        self._ending = None

    def check_arithmetic(self, since: int) -> None:
        """Check that no FMU has changed the floating-point environment that all instances share.

        Args:
            since: communication point of the last successful check. Rows recorded after it are discarded.

        Raises:
            SimulationError: an FMU has changed it.
        """
        if not self._arithmetic.changed():
            return
        time = self.plan.time(since)
        among = suspects(self.plan.instances)
        self._arithmetic.restore("", self.log)
        self.completed = self._position.completed = since
        raise SimulationError(
            f"after t = {time:.9g} s an instance ({listed(among, last='or')}) changed how numbers are "
            "rounded, flushed to zero or trapped, also for all others; --isolate limits it to its process",
            instance=among[0] if len(among) == 1 else None,
            time=time,
            code="process-state-changed",
        )

    def inputs_of(self, instance: str) -> dict[str, Value]:
        """Return the inputs with which an instance was last stepped."""
        s = self.signals.of[instance]
        real = {v.name: float(u) for v, u in zip(s.inputs, s.u, strict=True)}
        return real | self.signals.given_others(s)

    def _values_of_others(self) -> list[Value]:
        return [self.signals.others[key] for key in self._recorded_others]

    def _entered(self) -> Iterator[InstanceSlot]:
        """Yield the slots in turn; until the next one, the code of their instances runs."""
        numbers = {one.name: number for number, one in enumerate(self.plan.instances)}
        for slot in self.signals.slots:
            self._position.enter(numbers[slot.name], "initialization")
            yield slot
        self._position.leave()

    def _check_initialization(self, instance: str, what: str, status: Status) -> None:
        """Check a call made during initialization."""
        end_copy_of(self._process)
        self._position.returned = time.monotonic()
        self._arithmetic.restore(instance, self.log)
        status = self.signals.of[instance].fmu_instance.note(status)
        if status > WARNING:
            start = self.plan.time(0)
            raise self._failure(describe(instance, what, start, status, self.log), instance, start)
        if status == WARNING:
            self._note_warning(instance, what)
        if self.stop.requested:
            raise self.stop.interrupted("during initialization", time=self.plan.time(0))

    def _answer(self, k: int, operation: Operation, status: Status) -> None:
        """Handle an operation of the step from `k` - 1 to `k` that did not return OK."""
        slot = self.signals.of[operation.instance]
        kind = slot.fmu_instance.part(operation.kind)
        status = slot.fmu_instance.note(status)
        if status == WARNING:
            self._note_warning(operation.instance, WORDS[kind])
            return
        self._check_finite(k)  # a non-finite value upstream is the better explanation
        time = self.plan.time(k - slot.instance.period)
        if status == DISCARD and kind == "step" and (reached := slot.fmu_instance.ended()) is not None:
            self._end(k, operation.instance, time if math.isnan(reached) else reached)
            return
        sentence = describe(operation.instance, WORDS[kind], time, status, self.log)
        raise self._failure(sentence, operation.instance, time)

    def _end(self, k: int, instance: str, time: float) -> None:
        """End the run at the request of an instance: now, or after this step if it completed the step."""
        now = self.log.time.value
        texts = [
            " ".join(m.text.split()) for m in self.log.messages if m.instance == instance and m.time >= now
        ]
        reason = f": {texts[-1]}" if texts else ", without a reason"
        ending = EndRequested(
            f"{instance} ended the run at t = {time:.9g} s{reason}", instance=instance, time=time
        )
        if time < self.plan.time(k) - ALMOST * float(self.plan.step):
            raise ending
        self._ending = self._ending or ending
        deque(self._points, maxlen=0)

    def _interrupted(self, k: int) -> Interrupted:
        """Return the exception for a stop requested before the step to `k`."""
        now = self.plan.time(k - 1)
        return self.stop.interrupted(f"at t = {now:.9g} s", time=now)

    def _failure(self, sentence: str, instance: str, time: float) -> SimulationError | Interrupted:
        """Return the exception for a failed instance: an interruption if a stop was requested."""
        if self.stop.requested:
            return self.stop.interrupted(f": {sentence}", instance=instance, time=time)
        killed = any(message.category == KILLED for message in self.log.errors(instance))
        code = "run-process-died" if killed else "fmu-call-failed"
        return SimulationError(sentence, instance=instance, time=time, code=code)

    def _note_warning(self, instance: str, what: str) -> None:
        """Log the status Warning of an instance that has not logged a message itself."""
        if not any(m.instance == instance and m.category != MASTER for m in self.log.warnings()):
            self.log.add(instance, WARNING, "", f"{what}: the FMU returned Warning and gave no reason")

    def _check_finite(self, k: int) -> None:
        """Find the non-finite values that made the sum of all outputs non-finite.

        Raises:
            SimulationError: a wire has such a value; reported is the first in evaluation order.
        """
        signals = self.signals
        if np.isfinite(signals.now[self._expected]).all():
            return
        time = self.plan.time(k)
        wires = sorted(self._wires, key=lambda w: signals.of[w.source].position)
        for wire in wires:
            value = signals.pool[signals.index[wire.source, wire.output]]
            if math.isfinite(value):
                continue
            if self.log.errors(wire.source):
                problem = describe(wire.source, "reading outputs", time, OK, self.log)
            else:
                problem = (
                    f"{wire.source}: {wire.output} is {_spelled(value)} at t = {time:.9g} s, "
                    f"on the wire {wire.source}.{wire.output} -> {wire.target}.{wire.input}"
                )
            raise SimulationError(problem, instance=wire.source, time=time, code="value-not-finite")
        for (instance, name), at in list(self._spare.items()):
            if not math.isfinite(value := signals.pool[at]):
                del self._spare[instance, name]
                self.log.add(
                    instance, WARNING, MASTER, f"{name} is {_spelled(value)}; it is on no wire", time
                )
                self._expected = self._expected[self._expected != at]


def _spelled(value: float) -> str:
    return "not a number" if math.isnan(value) else "infinite"

"""Faults: what becomes of a unit's outputs once they are read, or of its inputs before they are set.

An output is faulty as of the instant that it is given for, so all who take it and the results get it so. An
input is faulty as of the instant that it is taken for (see `coupling.halves_ahead`), after the coupling has
made one value of several samples. At initialization both are so as of the start, however often values go
round: a fault that is told the same instant again forgets what it saw of it before.

Random numbers are counted, not drawn in turn: that of message n follows from the fault's stream and n alone,
so neither the step nor the process, nor another fault, changes any.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..plan import Fault, Plan
from .coupling import halves_ahead
from .instance import Status
from .log import OK

if TYPE_CHECKING:
    from .signal_pool import InstanceSlot, SignalPool

BLOCK = 1024
"""Random numbers made at a time; chosen: ten seconds of messages."""
LATE = 1e-9
"""Part of a message by which an instant may miss its beginning."""

Disturbance = Callable[[float, float], float]
"""Returns what becomes of a value at a time [s]; called for every instant, in order."""


class FaultInjector:
    """The faults of a unit's outputs or of its inputs.

    Args:
        plan: whose time it is.
        period: of the unit, in communication steps.
        at: index of a value, halves of a communication step from the beginning of a step to the instant that
            the value is of, and what becomes of it.
    """

    def __init__(self, plan: Plan, period: int, at: Sequence[tuple[int, int, Disturbance]]) -> None:
        scale = 2 * math.lcm(plan.start.denominator, plan.step.denominator)
        self._start = plan.time(0)
        half = int(plan.step * scale) // 2
        begin = int(plan.start * scale)
        self._at = [(i, begin + ahead * half, disturb) for i, ahead, disturb in at]
        self._further = 2 * period * half
        self._scale = scale

    def begin(self, values: np.ndarray) -> None:
        """Disturb values at the start of the run."""
        for i, _, disturb in self._at:
            values[i] = disturb(self._start, float(values[i]))

    def acting(self, values: np.ndarray) -> Callable[[], Status]:
        """Return the call that disturbs values, once for each step of the unit."""
        at, scale, further, item = self._at, self._scale, self._further, values.item
        passed = 0

        def act() -> Status:
            nonlocal passed
            for i, first, disturb in at:
                values[i] = disturb((first + passed) / scale, item(i))
            passed += further
            return OK

        return act


def faulting(memory: SignalPool, s: InstanceSlot, *, of_output: bool) -> FaultInjector | None:
    """Return the faults of a unit's outputs, or of its inputs, None if it has none."""
    plan, period = memory.plan, s.instance.period
    places = {v.name: (i, v) for i, v in enumerate(s.outputs if of_output else s.inputs)}
    made = []
    for fault in plan.faults:
        if (fault.instance, fault.of_output) != (s.name, of_output) or fault.variable not in places:
            continue
        i, variable = places[fault.variable]
        ahead, held = 2 * period, variable.discrete
        if not of_output:
            wire = s.wires[i]
            assert wire is not None
            ahead = halves_ahead(plan.algorithm, period, direct=s.direct(variable))
            held = memory.of[wire.source].instance.fmu.variables[wire.output].discrete
        made.append((i, ahead, disturbance(fault, held=held)))
    return FaultInjector(plan, period, made) if made else None


def disturbance(fault: Fault, *, held: bool) -> Disturbance:
    """Return what becomes of a signal.

    Args:
        fault: of it.
        held: the signal holds its value from one sample to the next, and is no line between them.
    """
    begin, end, value = fault.begin, fault.end, fault.value
    stuck_at_once = fault.kind == "stuck" and value is not None
    if fault.kind in ("freeze", "stuck") and not stuck_at_once:
        return _frozen(begin, end)
    if fault.kind == "dropout":
        return _dropping(fault)
    assert value is not None
    if fault.kind == "delay":
        return _late(begin, end, value, held=held)
    if fault.kind == "drift":
        return _drifting(begin, end, value)
    if fault.kind == "noise":
        numbers = CountedNoise(fault, lambda made: made.standard_normal(BLOCK))
        return lambda t, x: x + value * numbers.at(t) if begin <= t < end else x
    if fault.kind == "outlier":
        chances = CountedNoise(fault, lambda made: made.random(BLOCK))
        share = fault.share
        return lambda t, x: x + value * _sign(chances.at(t), share) if begin <= t < end else x
    changed: Callable[[float], float] = {
        "bias": lambda x: x + value,
        "gain": lambda x: x * value,
        "value": lambda x: value,
        "stuck": lambda x: value,
        "saturation": lambda x: min(max(x, -value), value),
        "loss": lambda x: x * (1.0 - value),
    }[fault.kind]
    return lambda t, x: changed(x) if begin <= t < end else x


def _sign(chance: float, share: float) -> float:
    return 0.0 if chance >= share else 1.0 if chance < share / 2 else -1.0


def _frozen(begin: float, end: float) -> Disturbance:
    since, kept = math.nan, math.nan

    def disturb(t: float, x: float) -> float:
        nonlocal since, kept
        if not begin <= t < end:
            return x
        if math.isnan(since) or t == since:
            since, kept = t, x
        return kept

    return disturb


def _drifting(begin: float, end: float, rate: float) -> Disturbance:
    since = begin if math.isfinite(begin) else math.nan

    def disturb(t: float, x: float) -> float:
        nonlocal since
        if math.isnan(since):
            since = t
        return x + rate * (t - since) if begin <= t < end else x

    return disturb


def _late(begin: float, end: float, delay: float, *, held: bool) -> Disturbance:
    samples: deque[tuple[float, float]] = deque()

    def disturb(t: float, x: float) -> float:
        if samples and samples[-1][0] == t:
            samples.pop()
        samples.append((t, x))
        wanted = t - delay
        while len(samples) > 1 and samples[1][0] <= wanted + LATE * abs(delay):
            samples.popleft()
        if not begin <= t < end:
            return x
        (before, first), (after, second) = samples[0], samples[min(1, len(samples) - 1)]
        if held or after == before or wanted <= before:
            return first
        return first + (second - first) * (wanted - before) / (after - before)

    return disturb


def _dropping(fault: Fault) -> Disturbance:
    chances = CountedNoise(fault, lambda made: made.random(BLOCK))
    begin, end, share = fault.begin, fault.end, fault.share
    first, kept = math.nan, math.nan

    def disturb(t: float, x: float) -> float:
        nonlocal first, kept
        if math.isnan(first):
            first = t
        if begin <= t < end and t > first and chances.at(t) < share:
            return kept
        kept = x
        return x

    return disturb


class CountedNoise:
    """Random numbers by their message, of which a fault has one every so often.

    Args:
        fault: its stream and the time between messages.
        draw: `BLOCK` numbers.
    """

    def __init__(self, fault: Fault, draw: Callable[[np.random.Generator], np.ndarray]) -> None:
        self._stream = fault.stream
        self._every = fault.every
        self._draw = draw
        self._block: int | None = None
        self._numbers: list[float] = []

    def at(self, t: float) -> float:
        """Return the number of the message that is in force at a time [s]."""
        block, place = divmod(math.floor(t / self._every + LATE), BLOCK)
        if block != self._block:
            key = np.array([self._stream, block % 2**64], np.uint64)
            self._block = block
            self._numbers = self._draw(np.random.Generator(np.random.Philox(key=key))).tolist()
        return self._numbers[place]

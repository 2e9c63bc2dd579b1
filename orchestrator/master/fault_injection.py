"""Fault injection: disturb an instance's outputs after they are read, or its inputs before they are set.

An output is disturbed as of the time of its sample, so all receivers and the results get the same faulty
value. An input is disturbed as of the time that it is taken for (see `coupling.halves_ahead`), after the
coupling has combined several samples into one value. At initialization both are disturbed as of the start,
however many passes it takes: calling a fault twice for the same time discards its first observation.

Random numbers are counter-based: that of message n depends on the fault's stream and n alone, so neither the
step size nor the process nor another fault changes any of them.
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
"""Random numbers generated at a time; chosen: ten seconds of messages."""
LATE = 1e-9
"""Fraction of a message's period by which a time may fall short of its beginning."""

Disturbance = Callable[[float, float], float]
"""Called with time [s] and value of every sample, in order; returns the disturbed value."""


class FaultInjector:
    """Applies the faults of an instance's outputs or of its inputs.

    Args:
        plan: its start and step define the times.
        period: of the instance, in communication steps.
        at: per fault, the index of the value, the time that the value is for, in halves of a communication
            step after the beginning of an instance's step, and the disturbance.
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
        """Return the call that disturbs `values`, to be made once per step of the instance."""
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
    """Return the injector for the faults of an instance's outputs or inputs, None if it has none."""
    plan, period = memory.plan, s.instance.period
    places = {v.name: (i, v) for i, v in enumerate(s.outputs if of_output else s.inputs)}
    disturbances = []
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
        disturbances.append((i, ahead, disturbance(fault, held=held)))
    return FaultInjector(plan, period, disturbances) if disturbances else None


def disturbance(fault: Fault, *, held: bool) -> Disturbance:
    """Return the disturbance function of a fault.

    Args:
        held: the signal holds its value between samples, so that delays do not interpolate.
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
        numbers = CountedNoise(fault, lambda generator: generator.standard_normal(BLOCK))
        return lambda t, x: x + value * numbers.at(t) if begin <= t < end else x
    if fault.kind == "outlier":
        chances = CountedNoise(fault, lambda generator: generator.random(BLOCK))
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
        past = t - delay
        while len(samples) > 1 and samples[1][0] <= past + LATE * abs(delay):
            samples.popleft()
        if not begin <= t < end:
            return x
        (before, first), (after, second) = samples[0], samples[min(1, len(samples) - 1)]
        if held or after == before or past <= before:
            return first
        return first + (second - first) * (past - before) / (after - before)

    return disturb


def _dropping(fault: Fault) -> Disturbance:
    chances = CountedNoise(fault, lambda generator: generator.random(BLOCK))
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
    """Counter-based random numbers, one per message of a fault, whose messages are equally spaced in time.

    Args:
        fault: defines the random stream and the time between messages.
        draw: returns the next `BLOCK` numbers of a generator.
    """

    def __init__(self, fault: Fault, draw: Callable[[np.random.Generator], np.ndarray]) -> None:
        self._stream = fault.stream
        self._every = fault.every
        self._draw = draw
        self._block: int | None = None
        self._numbers: list[float] = []

    def at(self, t: float) -> float:
        """Return the random number of the message in force at a time [s]."""
        block, place = divmod(math.floor(t / self._every + LATE), BLOCK)
        if block != self._block:
            key = np.array([self._stream, block % 2**64], np.uint64)
            self._block = block
            self._numbers = self._draw(np.random.Generator(np.random.Philox(key=key))).tolist()
        return self._numbers[place]

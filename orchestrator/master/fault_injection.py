"""Fault injection: disturb an instance's outputs after they are read, or its inputs before they are set.

An output is disturbed as of the time of its sample, so all receivers and the results get the same faulty
value. An input is disturbed as of the time that it is taken for (see `coupling`), after the
coupling has combined several samples into one value. At initialization both are disturbed as of the start,
however many passes it takes: calling a fault twice for the same time discards its first observation.

What each kind does to a value is in `fault_kinds`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..coupling import ALGORITHMS
from ..fault_kinds import KINDS, Disturbance
from ..plan import Plan
from .instance import Status
from .log import OK

if TYPE_CHECKING:
    from .signal_pool import InstanceSlot, SignalPool


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
    for signal in plan.faults:
        if (signal.instance, signal.of_output) != (s.name, of_output) or signal.variable not in places:
            continue
        i, variable = places[signal.variable]
        ahead, held = 2 * period, variable.discrete
        if not of_output:
            wire = s.wires[i]
            assert wire is not None
            ahead = ALGORITHMS[plan.algorithm].halves_ahead(period, s.direct(variable))
            held = memory.of[wire.source].instance.fmu.variables[wire.output].discrete
        disturbances.append((i, ahead, KINDS[signal.fault.kind].disturbance(signal, held)))
    return FaultInjector(plan, period, disturbances) if disturbances else None

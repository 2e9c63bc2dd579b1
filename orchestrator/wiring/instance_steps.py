"""Warnings about steps of instances: longer than the run, or not those that their FMUs were made for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from fractions import Fraction

from yawbench.foundation.errors import Diagnostic, Location

from ..plan import Instance
from ..scenario.loader import LoadedScenario
from ..scenario.quantities import exact_text

STEP_TOLERANCE = 1e-6
"""Relative difference up to which two steps are the same; chosen: FMUs round theirs to as few digits."""


def doubtful_steps(scenario: LoadedScenario, instances: Iterable[Instance]) -> Iterator[Diagnostic]:
    """Yield a warning for every instance whose step is longer than the run, or not that of its FMU."""
    lasts = scenario.stop_time - scenario.start_time
    for instance in instances:
        signal, fixed = f"{instance.name}.step_size", instance.fmu.fixed_step
        step = instance.period * scenario.step_size
        if step > lasts:
            says = (
                f"{instance.name} never takes a step: its step_size, {float(step):g} s, is longer than the "
                f"run, {float(lasts):g} s; its outputs keep their initial values"
            )
            yield Diagnostic("instance-never-steps", says, "warning", Location(signal=signal), float(step))
        if fixed is None:
            continue
        times = round(float(step) / fixed) if instance.fmu.takes_multiples else 1
        if not math.isclose(step, max(times, 1) * fixed, rel_tol=STEP_TOLERANCE):
            own = exact_text(Fraction(repr(fixed)))
            base = "" if Fraction(repr(fixed)) % scenario.step_size == 0 else f"--set step_size={own} "
            says = (
                f"{instance.name} ({instance.fmu.name}) declares "
                f"{'an internal' if instance.fmu.takes_multiples else 'a fixed'} step of {own} s and runs "
                f"with one of {exact_text(step)} s, so its results may be wrong; "
                f"'{base}--set {signal}={own}' gives it that step"
            )
            yield Diagnostic("instance-step-differs", says, "warning", Location(signal=signal), float(step))

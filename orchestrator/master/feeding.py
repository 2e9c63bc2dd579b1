"""Inputs that follow a time series: their values at the instants that the coupling asks for.

A series is known at all times, so nothing has to be extrapolated: `jacobi` takes its value at the
beginning of a unit's step, `gauss_seidel` at its end, `extrapolated` in the middle of the step for an
input that enters an integration and at the end for any other (see `coupling`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from ..plan import Plan, Series, Variable
from .coupling import halves_ahead
from .log import OK
from .memory import Memory, Station
from .slave import Status

BLOCK = 1024
"""Steps for which values are made at a time; chosen: some kilobytes per input."""
LATE = 1e-9
"""Part of a communication step by which an instant may miss the time that a file gives for a value."""


def feeding(memory: Memory, s: Station) -> Callable[[], Status]:
    """Return the call that brings the series of a unit up to date, once for each of its steps."""
    real = [(i, v) for i, v in enumerate(s.inputs) if v.name in s.unit.series]
    others = [(s.name, v.name) for v, _ in s.other_inputs if v.name in s.unit.series]
    slots = s.sources[[i for i, _ in real]] if real else np.empty(0, np.intp)
    named = [v for _, v in real] + [v for v, _ in s.other_inputs if v.name in s.unit.series]
    columns = [_column(memory.plan, s, v, s.unit.series[v.name]) for v in named]
    pool, kept, n_real = memory.pool, memory.others, len(real)

    def fed() -> Status:
        values = [next(column) for column in columns]
        if n_real:
            pool[slots] = values[:n_real]
        if others:
            kept.update(zip(others, values[n_real:], strict=True))
        return OK

    return fed


def _column(plan: Plan, s: Station, variable: Variable, series: Series) -> Iterator:
    """Yield the values of one input, step by step."""
    period, first = s.unit.period, 0
    ahead = halves_ahead(plan.algorithm, period, direct=s.direct(variable))
    halves, start = plan.step / 2, float(plan.start)
    while True:
        k = np.arange(first, first + period * BLOCK, period)
        times = start + (2 * k + ahead) * halves.numerator / halves.denominator
        yield from series.at(times + LATE * float(plan.step) * series.held).tolist()
        first += period * BLOCK

"""fmpy's own simulation of SSP archives (`fmpy.ssp.simulation.simulate_ssp`).

It reads structure and FMUs from the archive but no parameter values, which are handed to it here;
texts it cannot set. It exchanges nothing before the first step: every input is 0 in it, whatever
the units' outputs are at the start. It steps all units with one step, and labels the values after
a step with the time at its beginning.
"""

from __future__ import annotations

import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...scenario import ssp_read
from .request import Recording, Request


def drive(request: Request) -> Recording:
    """Run the archive in fmpy."""
    from fmpy.ssp.simulation import simulate_ssp

    spent = _Stopwatch()
    rows = spent.around(
        simulate_ssp,
        request.archive,
        stop_time=(request.n_steps - 0.5) * request.step,
        step_size=request.step,
        parameter_set=SimpleNamespace(parameters=_parameters(request.archive)),
    )
    values = np.full((request.n_steps + 1, len(request.columns)), np.nan)
    for i, (unit, name) in enumerate(request.columns):
        values[1:, i] = rows[f"{unit}.{name}"][: request.n_steps]
    return Recording(values, spent.seconds / request.n_steps)


def _parameters(archive: str) -> list[Any]:
    """Return the values of the archive that fmpy can set, by unit.variable."""
    data = ssp_read.read(Path(archive)).data
    given = dict(data["inputs"])
    for unit, spec in data["units"].items():
        given |= {f"{unit}.{name}": value for name, value in spec.get("parameters", {}).items()}
    return [SimpleNamespace(name=name, value=v) for name, v in given.items() if not isinstance(v, str)]


class _Stopwatch:
    """Measures the steps of fmpy's loop: from its first to its last call of `do_step`."""

    seconds = 0.0

    def around(self, call: Any, *arguments: Any, **options: Any) -> Any:
        from fmpy.ssp import simulation

        step, begin = simulation.do_step, [0.0]

        def timed(*given: Any) -> Any:
            begin[0] = begin[0] or time.perf_counter()
            result = step(*given)
            self.seconds = time.perf_counter() - begin[0]
            return result

        simulation.do_step = timed
        try:
            return call(*arguments, **options)
        finally:
            simulation.do_step = step

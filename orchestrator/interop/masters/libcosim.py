"""libcosim, the co-simulation core of the Open Simulation Platform, through libcosimpy.

Its fixed-step algorithm steps all units from the same exchanged values, so it is `jacobi`; a unit
with a step of its own is stepped once in so many communication steps, over its whole step. An
observer has values only from the first step on. A connection that it cannot make is answered with
-1, which nobody looks at; here the system comes from an archive whose wiring has been checked.
"""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import numpy as np

from .request import Recording, Request

NANOSECONDS = 1_000_000_000


def drive(request: Request) -> Recording:
    """Run the archive in libcosim.

    Raises:
        RuntimeError: it does not step.
    """
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_ssp_file(request.archive, round(request.step * NANOSECONDS))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    readers = _readers(execution, observer, request)
    values = np.full((request.n_steps + 1, len(request.columns)), np.nan)
    spent = 0.0
    for k in range(1, request.n_steps + 1):
        begin = time.perf_counter()
        if not execution.step(1):
            raise RuntimeError(f"libcosim stopped at t = {(k - 1) * request.step:.9g} s")
        spent += time.perf_counter() - begin
        for where, read in readers:
            values[k, where] = read()
    return Recording(values, spent / request.n_steps)


def _readers(execution: Any, observer: Any, request: Request) -> list[tuple[list[int], Any]]:
    """Return, per unit, the columns and a function that gives their values."""
    infos = execution.slave_infos()
    units = {infos[i].name.decode(): infos[i].index for i in range(execution.num_slaves())}
    readers = []
    for unit, index in units.items():
        references = {v.name.decode(): v.reference for v in execution.slave_variables(index)}
        where = [i for i, (u, _) in enumerate(request.columns) if u == unit]
        wanted = [references[request.columns[i][1]] for i in where]
        if where:
            readers.append((where, partial(observer.last_real_values, index, wanted)))
    return readers

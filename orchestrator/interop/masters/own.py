"""This program's master, run on an archive and measured as the others are."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...master.interrupts import StopFlag
from ...master.log import Log
from ...master.master import Master
from ...master.opening import open_unit
from ...master.slave import Slave
from ...plan import Change
from ...scenario.load import load_scenario
from ...wiring.make_plan import make_plan
from .request import Recording, Request


def drive(request: Request) -> Recording:
    """Run the archive here as `jacobi`.

    Raises:
        YawbenchError: the archive cannot be read, or the run fails.
    """
    alike = Change("algorithm", "jacobi", "second-opinion")
    plan = make_plan(load_scenario(Path(request.archive), changes=[alike]))
    log, slaves = Log(), dict[str, Slave]()
    plan = replace(plan, record=tuple(request.columns))
    rows = np.zeros((request.n_steps + 1, 1 + len(request.columns)))
    try:
        for unit in plan.units:
            slaves[unit.name] = open_unit(unit, log, set())
        master = Master(plan, slaves, log, StopFlag())
        master.initialize(rows[0], [])
        begin = time.perf_counter()
        master.advance(request.n_steps, list(rows[1:]), [])
        spent = time.perf_counter() - begin
    finally:
        for slave in slaves.values():
            slave.free()
    return Recording(rows[:, 1:], spent / request.n_steps)

"""Ecos, through ecospy.

Its fixed-step algorithm steps all units from the same exchanged values, so it is `jacobi`. Of a
unit with a step of its own it calls one step in so many, but over a single communication step (its
`fixed_step_algorithm` passes the base step on), so such a unit is half asleep; systems for it are
given one step for all. It takes a parameter set of an archive by name, and accumulates its time
in floating point, so steps are counted here.

ecospy needs Intel's TBB and does not load it: the package `tbb` puts it beside the interpreter.
"""

from __future__ import annotations

import contextlib
import ctypes
import sys
import time
from pathlib import Path

import numpy as np

from ...scenario.ssp_names import PARAMETER_SET
from .request import Recording, Request

TBB = ("libtbb.so.12", "libtbb.12.dylib", "tbb12.dll")


def drive(request: Request) -> Recording:
    """Run the archive in Ecos.

    Raises:
        RuntimeError: it cannot initialize the system.
    """
    _load_tbb()
    from ecospy.EcosSimulation import EcosSimulation

    simulation = EcosSimulation(request.step, ssp_path=request.archive)
    if not simulation.init(0, PARAMETER_SET):
        raise RuntimeError("Ecos cannot initialize the system")
    names = [f"{unit}::{name}" for unit, name in request.columns]
    read = simulation.get_real
    values = np.empty((request.n_steps + 1, len(names)))
    values[0] = [read(name) for name in names]
    spent = 0.0
    for k in range(1, request.n_steps + 1):
        begin = time.perf_counter()
        simulation.step(1)
        spent += time.perf_counter() - begin
        values[k] = [read(name) for name in names]
    simulation.terminate()
    return Recording(values, spent / request.n_steps)


def _load_tbb() -> None:
    for folder in (Path(sys.prefix, "lib"), Path(sys.prefix, "Library", "bin")):
        for name in TBB:
            if (folder / name).exists():
                with contextlib.suppress(OSError):
                    ctypes.CDLL(str(folder / name), mode=ctypes.RTLD_GLOBAL)

"""Adapters that run an SSP archive in a co-simulation master: this program's own, fmpy, libcosim or Ecos.

Each runs in a process of its own (`main`), so a crash costs only that master's result.

**Own**: this program's master with the algorithm `jacobi`, timed as the others are.

**fmpy**: its simulation of SSP archives (`fmpy.ssp.simulation.simulate_ssp`). It reads structure and FMUs
from the archive but no parameter values, which are passed to it here; it cannot set texts. It exchanges
nothing before the first step: every input is 0 in it, whatever the outputs are at the start. It steps all
instances with one step, and labels the values after a step with the time at its beginning.

**libcosim**: the co-simulation core of the Open Simulation Platform, through libcosimpy. Its fixed-step
algorithm steps all instances from the same exchanged values, so it is `jacobi`; an instance with a longer
step is stepped once per multiple of the communication step, over its whole step. An observer has values only
from the first step on. A connection that it cannot make returns -1, which its loader ignores; here the system
comes from an archive whose wiring has been checked.

**Ecos**: through ecospy. Its fixed-step algorithm steps all instances from the same exchanged values, so it
is `jacobi`. It steps an instance with a longer step once per multiple of the communication step, but only
over a single communication step (its `fixed_step_algorithm` passes the base step on), so such an instance
advances too slowly; systems for it get one step for all. It takes a parameter set of an archive by name, and
accumulates its time in floating point, so steps are counted here. ecospy needs Intel's TBB and does not load
it: the package `tbb` installs it next to the interpreter.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import sys
import time
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..plan import Override
from ..scenario.ssp_archive import PARAMETER_SET
from ..signal_names import SignalName


@dataclass(frozen=True)
class Request:
    """A run asked of a master: an SSP archive with a fixed communication step."""

    archive: str
    step: float  # communication step [s]
    n_steps: int
    columns: list[tuple[str, str]]  # instance and output, of type Real
    core: int | None = None  # the only processor core the master may use

    def write(self, path: Path) -> None:
        """Write the request as JSON."""
        path.write_text(json.dumps(asdict(self)), encoding="utf-8")

    @classmethod
    def read(cls, path: Path) -> Request:
        """Read a file written by `write`."""
        content = json.loads(path.read_text(encoding="utf-8"))
        content["columns"] = [tuple(column) for column in content["columns"]]
        return cls(**content)


@dataclass(frozen=True)
class Recording:
    """Result of a master: the values after 0, 1, ... n communication steps, and the time per step.

    `values` has a row per communication point and a column per requested output; NaN: no value available.
    """

    values: np.ndarray
    seconds: float  # time spent in the master's own step, per communication step

    def write(self, path: Path) -> None:
        """Write the recording as .npz."""
        np.savez(path, values=self.values, seconds=self.seconds)

    @classmethod
    def read(cls, path: Path) -> Recording:
        """Read a file written by `write`."""
        with np.load(path) as content:
            return cls(content["values"], float(content["seconds"]))


def run_own(request: Request) -> Recording:
    """Run the archive in this program's master, with the algorithm `jacobi`.

    Raises:
        YawbenchError: the archive cannot be read, or the run fails.
    """
    from ..interrupts import StopFlag  # slow to import, and the other masters need none of it
    from ..master.fmi import open_instance
    from ..master.instance import FmuInstance
    from ..master.process_state import Log
    from ..master.step_loop import Master
    from ..planner import Planner

    jacobi = Override.of("algorithm", "jacobi", "second-opinion")
    planner = Planner()
    plan = planner.plan(planner.load(Path(request.archive), [jacobi]))
    log, running = Log(), dict[str, FmuInstance]()
    plan = replace(plan, record=tuple(SignalName(*column) for column in request.columns))
    rows = np.zeros((request.n_steps + 1, 1 + len(request.columns)))
    try:
        for instance in plan.instances:
            running[instance.name] = open_instance(instance, log, set())
        master = Master(plan, running, log, StopFlag())
        master.initialize(rows[0], [])
        begin = time.perf_counter()
        master.advance(request.n_steps, list(rows[1:]), [])
        spent = time.perf_counter() - begin
    finally:
        for fmu_instance in running.values():
            fmu_instance.free()
    return Recording(rows[:, 1:], spent / request.n_steps)


def run_fmpy_ssp(request: Request) -> Recording:
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
    for i, (instance, name) in enumerate(request.columns):
        values[1:, i] = rows[f"{instance}.{name}"][: request.n_steps]
    return Recording(values, spent.seconds / request.n_steps)


def _parameters(archive: str) -> list[Any]:
    """Return the values of the archive that fmpy can set, named `instance.variable`."""
    from ..scenario import ssp_read

    data = ssp_read.read(Path(archive)).data
    values = dict(data["inputs"])
    for instance, spec in data["units"].items():
        values |= {f"{instance}.{name}": value for name, value in spec.get("parameters", {}).items()}
    return [SimpleNamespace(name=name, value=v) for name, v in values.items() if not isinstance(v, str)]


class _Stopwatch:
    """Measures fmpy's loop, from its first to its last call of `do_step`."""

    seconds = 0.0

    def around(self, call: Any, *arguments: Any, **options: Any) -> Any:
        from fmpy.ssp import simulation

        step, begin = simulation.do_step, [0.0]

        def timed(*arguments: Any) -> Any:
            begin[0] = begin[0] or time.perf_counter()
            result = step(*arguments)
            self.seconds = time.perf_counter() - begin[0]
            return result

        simulation.do_step = timed
        try:
            return call(*arguments, **options)
        finally:
            simulation.do_step = step


NANOSECONDS = 1_000_000_000


def run_libcosim(request: Request) -> Recording:
    """Run the archive in libcosim.

    Raises:
        RuntimeError: libcosim stops before the end.
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
    """Return, per instance, its columns and a function that reads their values."""
    infos = execution.slave_infos()
    instances = {infos[i].name.decode(): infos[i].index for i in range(execution.num_slaves())}
    readers = []
    for instance, index in instances.items():
        references = {v.name.decode(): v.reference for v in execution.slave_variables(index)}
        where = [i for i, (u, _) in enumerate(request.columns) if u == instance]
        outputs = [references[request.columns[i][1]] for i in where]
        if where:
            readers.append((where, partial(observer.last_real_values, index, outputs)))
    return readers


TBB = ("libtbb.so.12", "libtbb.12.dylib", "tbb12.dll")


def run_ecos(request: Request) -> Recording:
    """Run the archive in Ecos.

    Raises:
        RuntimeError: Ecos cannot initialize the system.
    """
    _load_tbb()
    from ecospy.EcosSimulation import EcosSimulation

    simulation = EcosSimulation(request.step, ssp_path=request.archive)
    if not simulation.init(0, PARAMETER_SET):
        raise RuntimeError("Ecos cannot initialize the system")
    names = [f"{instance}::{name}" for instance, name in request.columns]
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
    """Load Intel's TBB, if installed next to the interpreter, for ecospy to find."""
    for folder in (Path(sys.prefix, "lib"), Path(sys.prefix, "Library", "bin")):
        for name in TBB:
            if (folder / name).exists():
                with contextlib.suppress(OSError):
                    ctypes.CDLL(str(folder / name), mode=ctypes.RTLD_GLOBAL)


MASTERS = {"own": run_own, "fmpy_ssp": run_fmpy_ssp, "libcosim": run_libcosim, "ecos": run_ecos}


def main(name: str, request_file: str, recording_file: str) -> None:
    """Run a request in the named master and write its recording; errors go to stderr with exit status 1."""
    request = Request.read(Path(request_file))
    if request.core is not None and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {request.core})
    try:
        MASTERS[name](request).write(Path(recording_file))
    except Exception as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        sys.exit(1)
    os._exit(0)  # some masters leave threads running that never end

"""Second opinions: run a scenario in other co-simulation masters and compare the results with ours.

Everything is exported as an SSP archive and every master runs it in a process of its own (`main`), so a crash
or a hang costs only an error message. Samples are counted, not matched by time labels: after k steps is after
k steps, whatever a program calls that time. The algorithm compared is `jacobi`, which all of them have; a
difference is relative to the signal's range in our run. A master that cannot give an instance its own step
gets the system with one step for all, and is compared with our run of that system.

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
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from yawbench.foundation.errors import WiringError
from yawbench.foundation.processes import how_it_ended, python
from yawbench.orchestrator.plan import Override, Plan
from yawbench.orchestrator.scenario import ssp_read
from yawbench.orchestrator.scenario.ssp_archive import PARAMETER_SET
from yawbench.orchestrator.signal_names import SignalName

from .ssp_write import with_numbers, write_ssp

AGREEMENT = 1e-9
"""Difference, relative to a signal's range, up to which two runs agree: rounding, and the fact that one
program counts time in nanoseconds and another accumulates steps."""
ROUNDING = 1e-12
"""Range, relative to a signal's magnitude, up to which it counts as constant; chosen: thousands of
roundings, far below the motion of any signal here."""
LIMIT = 900.0
"""Time that a master may take [s]."""


@dataclass(frozen=True)
class OtherMaster:
    """Another program that runs SSP archives: its key in `RUN_IN`, its package, its limitations."""

    title: str
    module: str
    package: str
    one_step: bool  # cannot give an instance a step of its own
    note: str = ""


MASTERS = (
    OtherMaster("libcosim", "libcosim", "libcosimpy", False),
    OtherMaster(
        "Ecos", "ecos", "ecospy", True,
        "it calls an instance with a longer step less often, but only for one communication step",
    ),
    OtherMaster(
        "fmpy", "fmpy_ssp", "fmpy", True,
        "its SSP simulation has one step for all instances, exchanges nothing before the first step (all "
        "inputs are 0 in it) and sets no texts, so it starts from other values and stays different",
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Request:
    """A run asked of a master: an SSP archive with a fixed communication step."""

    archive: str
    step: float  # communication step [s]
    n_steps: int
    columns: list[tuple[str, str]]  # instance and output, of type Real
    core: int | None = None  # the only processor core the master may use

    @property
    def names(self) -> list[str]:
        """Full names of the columns."""
        return [f"{instance}.{name}" for instance, name in self.columns]


@dataclass(frozen=True)
class Recording:
    """Result of a master: the values after 0, 1, ... n communication steps, and the time per step.

    `values` has a row per communication point and a column per requested output; NaN: no value available.
    """

    values: np.ndarray
    seconds: float  # time spent in the master's own step, per communication step


@dataclass(frozen=True)
class SecondOpinion:
    """Comparison of another master's run with our run of the same archive."""

    master: OtherMaster
    one_step: bool  # the system was run with one step for all instances
    problem: str = ""
    differences: dict[str, float] = field(
        default_factory=dict
    )  # instance.variable -> largest, relative to its range
    seconds: dict[str, float] = field(default_factory=dict)  # per step: "theirs", "ours", "... on one core"
    still: tuple[str, ...] = ()  # constant signals in our run, which prove little

    @property
    def largest(self) -> float:
        """The largest difference of all signals."""
        return max(self.differences.values(), default=0.0)

    @property
    def agrees(self) -> bool:
        """Whether the run succeeded and all differences are within `AGREEMENT`."""
        return not self.problem and self.largest <= AGREEMENT


def installed(master: OtherMaster) -> bool:
    """Return whether the master's Python package is installed."""
    return importlib.util.find_spec(master.package) is not None


def second_opinion(
    plan: Plan,
    folder: Path,
    *,
    masters: Sequence[OtherMaster] = MASTERS,
    pinned: bool = True,
    progress: Callable[[str], None] = lambda text: None,
) -> list[SecondOpinion]:
    """Run a plan in other masters and compare the results with ours.

    Args:
        plan: its algorithm is ignored: `jacobi` is compared.
        folder: for archives and recordings.
        masters: to compare with; those not installed are reported as such.
        pinned: also measure every master on one processor core.
        progress: called with the name of the master about to run.

    Raises:
        WiringError: no output of type Real is recorded, or the run does not begin at 0 s.
        ResultsError: the archive cannot be written.
        RuntimeError: our own run failed.
    """
    if not _columns(plan):
        raise WiringError(
            f"{plan.title or 'this system'}: nothing to compare: no output of type Real is recorded",
            code="nothing-to-compare",
        )
    if plan.start:
        raise WiringError(
            "start_time: a second opinion needs a run that begins at 0 s: omit it", code="option-invalid"
        )
    ours: dict[bool, tuple[Request, dict[str, Recording]]] = {}
    opinions = []
    for master in masters:
        one_step = master.one_step and any(instance.period > 1 for instance in plan.instances)
        if not installed(master):
            problem = f"{master.package} is not installed: pip install 'yawbench[interop]'"
            opinions.append(SecondOpinion(master, one_step, problem))
            continue
        if one_step not in ours:
            request = _request(plan, one_step, folder)
            progress(f"yawbench{', one step for all instances' if one_step else ''}")
            result = _recordings("own", request, pinned, folder)
            if isinstance(result, str):
                raise RuntimeError(f"our own run of the archive failed: {result}")
            ours[one_step] = request, result
        request, own = ours[one_step]
        progress(master.title)
        theirs = _recordings(master.module, request, pinned, folder)
        if isinstance(theirs, str):
            opinions.append(SecondOpinion(master, one_step, theirs))
            continue
        seconds = {f"theirs{key}": recording.seconds for key, recording in theirs.items()}
        seconds |= {f"ours{key}": recording.seconds for key, recording in own.items()}
        gaps = differences(request, own[""].values, theirs[""].values)
        still = still_signals(request, own[""].values)
        opinions.append(SecondOpinion(master, one_step, differences=gaps, seconds=seconds, still=still))
    return opinions


def _request(plan: Plan, one_step: bool, folder: Path) -> Request:
    """Write the archive; return the request to run it."""
    if one_step:
        plan = replace(plan, instances=tuple(replace(instance, period=1) for instance in plan.instances))
    path = folder / ("one_step.ssp" if one_step else "system.ssp")
    with tempfile.TemporaryDirectory(dir=folder) as numbered:
        write_ssp(with_numbers(plan, Path(numbered)), path)
    return Request(str(path), float(plan.step), plan.n_steps, _columns(plan))


def _columns(plan: Plan) -> list[tuple[str, str]]:
    """Return the outputs to compare: all recorded ones of type Real."""
    instances = {instance.name: instance.fmu for instance in plan.instances}
    return [(u, name) for u, name in plan.record if instances[u].variables[name].type == "Real"]


def _recordings(module: str, request: Request, pinned: bool, folder: Path) -> dict[str, Recording] | str:
    """Run a master, if `pinned` also on one core; return an error message if it has no result."""
    variants = {"": request}
    if pinned and hasattr(os, "sched_getaffinity"):
        variants[" on one core"] = replace(request, core=max(os.sched_getaffinity(0)))
    recordings = {}
    for key, variant in variants.items():
        recording = _run(module, variant, folder)
        if isinstance(recording, str):
            return recording
        recordings[key] = recording
    return recordings


def _run(module: str, request: Request, folder: Path) -> Recording | str:
    """Run a master in a process of its own; return an error message if it has no result."""
    request_file, recording_file = folder / "request.json", folder / "recording.npz"
    request_file.write_text(json.dumps(asdict(request)), encoding="utf-8")
    recording_file.unlink(missing_ok=True)
    command = python(__name__, module, request_file, recording_file)
    environment = os.environ | {"TMPDIR": str(folder)}  # Ecos does not delete the files it unpacks
    try:
        done = subprocess.run(command, capture_output=True, timeout=LIMIT, env=environment, check=False)
    except subprocess.TimeoutExpired:
        return f"it did not end within {LIMIT:g} s"
    if done.returncode == 0 and recording_file.exists():
        with np.load(recording_file) as content:
            return Recording(content["values"], float(content["seconds"]))
    lines = done.stderr.decode(errors="replace").strip().splitlines()
    if done.returncode < 0:
        output = f"; its last output: {' '.join(lines[-2:])}" if lines else ""
        return f"it {how_it_ended(done.returncode)}{output}"
    return lines[-1] if lines else f"it ended without a message, exit status {done.returncode}"


def differences(request: Request, own: np.ndarray, other: np.ndarray) -> dict[str, float]:
    """Return each signal's largest difference, relative to its range in our run.

    A signal that is constant up to rounding (`ROUNDING`) is scaled by its magnitude instead, or by 1 if that
    is 0. The first row is left out if the other master has no values for it at all; any other value that is
    not finite counts as an infinite difference.
    """
    first = int(np.all(np.isnan(other[0])))
    gap = np.abs(other[first:] - own[first:])
    gap = np.where(np.isfinite(gap), gap, np.inf)
    magnitude = np.max(np.abs(own), axis=0)
    scale = np.where(_moving(own), np.ptp(own, axis=0), np.where(magnitude > 0, magnitude, 1.0))
    return dict(zip(request.names, (np.max(gap, axis=0) / scale).tolist(), strict=True))


def still_signals(request: Request, own: np.ndarray) -> tuple[str, ...]:
    """Return the signals that are constant up to rounding in our run."""
    return tuple(name for name, moves in zip(request.names, _moving(own), strict=True) if not moves)


def _moving(own: np.ndarray) -> np.ndarray:
    """Return which columns change by more than rounding, shape (columns,)."""
    return np.asarray(np.ptp(own, axis=0) > ROUNDING * np.max(np.abs(own), axis=0))


def run_own(request: Request) -> Recording:
    """Run the archive in this program's master, with the algorithm `jacobi`.

    Raises:
        YawbenchError: the archive cannot be read, or the run fails.
    """
    from yawbench.foundation.interrupts import (
        StopFlag,  # slow to import, and the other masters need none of it
    )
    from yawbench.orchestrator.master.fmi import open_instance
    from yawbench.orchestrator.master.instance import FmuInstance
    from yawbench.orchestrator.master.log import Log
    from yawbench.orchestrator.master.step_loop import Master
    from yawbench.planner import Planner

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
        master.advance(request.n_steps, rows[1:], [])
        spent = time.perf_counter() - begin
    finally:
        for fmu_instance in running.values():
            fmu_instance.free()
    return Recording(rows[:, 1:], spent / request.n_steps)


def run_fmpy_ssp(request: Request) -> Recording:
    """Run the archive in fmpy; its loop is timed from the first to the last call of `do_step`."""
    from fmpy.ssp import simulation

    step, begin, end = simulation.do_step, 0.0, 0.0

    def timed_step(*arguments: Any) -> None:
        nonlocal begin, end
        begin = begin or time.perf_counter()
        step(*arguments)
        end = time.perf_counter()

    simulation.do_step = timed_step  # for good: this process makes one run
    rows = simulation.simulate_ssp(
        request.archive,
        stop_time=(request.n_steps - 0.5) * request.step,
        step_size=request.step,
        parameter_set=SimpleNamespace(parameters=_parameters(request.archive)),
    )
    values = np.full((request.n_steps + 1, len(request.columns)), np.nan)
    for i, name in enumerate(request.names):
        values[1:, i] = rows[name][: request.n_steps]
    return Recording(values, (end - begin) / request.n_steps)


def _parameters(archive: str) -> list[Any]:
    """Return the values of the archive that fmpy can set, named `instance.variable`."""
    data = ssp_read.read(Path(archive)).data
    values = dict(data["inputs"])
    for instance, spec in data["units"].items():
        values |= {f"{instance}.{name}": value for name, value in spec.get("parameters", {}).items()}
    return [SimpleNamespace(name=name, value=v) for name, v in values.items() if not isinstance(v, str)]


def run_libcosim(request: Request) -> Recording:
    """Run the archive in libcosim.

    Raises:
        RuntimeError: libcosim stops before the end.
    """
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_ssp_file(request.archive, round(1e9 * request.step))
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


RUN_IN = {"own": run_own, "fmpy_ssp": run_fmpy_ssp, "libcosim": run_libcosim, "ecos": run_ecos}


def main(name: str, request_file: str, recording_file: str) -> None:
    """Run a request in the named master and write its recording; errors go to stderr with exit status 1."""
    request = Request(**json.loads(Path(request_file).read_text(encoding="utf-8")))
    if request.core is not None and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {request.core})
    try:
        recording = RUN_IN[name](request)
        np.savez(recording_file, values=recording.values, seconds=recording.seconds)
    except Exception as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        sys.exit(1)
    os._exit(0)  # some masters leave threads running that never end

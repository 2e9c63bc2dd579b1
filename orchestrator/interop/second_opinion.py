"""Second opinions: run a scenario in other co-simulation masters and compare the results with ours.

Everything is exported as an SSP archive and every master runs it in a process of its own, so a crash or a
hang costs only an error message. Samples are counted, not matched by time labels: after k steps is after k
steps, whatever a program calls that time. The algorithm compared is `jacobi`, which all of them have; a
difference is relative to the signal's range in our run.

A master that cannot give an instance its own step gets the system with one step for all, and is compared
with our run of that system.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..errors import WiringError
from ..fork_server import how_it_ended, python
from ..plan import Plan
from .masters import Recording, Request
from .ssp_write import write_ssp

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
    """Another program that runs SSP archives: its key in `masters.MASTERS`, its package, its limitations."""

    title: str
    module: str
    package: str
    one_step: bool  # cannot give an instance a step of its own
    note: str = ""


MASTERS = (
    OtherMaster("libcosim", "libcosim", "libcosimpy", False),
    OtherMaster(
        "Ecos",
        "ecos",
        "ecospy",
        True,
        "it calls an instance with a longer step less often, but only for one communication step",
    ),
    OtherMaster(
        "fmpy",
        "fmpy_ssp",
        "fmpy",
        True,
        "its SSP simulation has one step for all instances, exchanges nothing before the first step (all "
        "inputs are 0 in it) and sets no texts, so it starts from other values and stays different",
    ),
)


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
    write_ssp(plan, path)
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
    request.write(request_file)
    recording_file.unlink(missing_ok=True)
    command = python("orchestrator.interop.masters", module, request_file, recording_file)
    environment = os.environ | {"TMPDIR": str(folder)}  # Ecos does not delete the files it unpacks
    try:
        done = subprocess.run(command, capture_output=True, timeout=LIMIT, env=environment, check=False)
    except subprocess.TimeoutExpired:
        return f"it did not end within {LIMIT:g} s"
    if done.returncode == 0 and recording_file.exists():
        return Recording.read(recording_file)
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
    relative = np.max(gap, axis=0) / scale
    return {
        f"{instance}.{name}": float(d) for (instance, name), d in zip(request.columns, relative, strict=True)
    }


def still_signals(request: Request, own: np.ndarray) -> tuple[str, ...]:
    """Return the signals that are constant up to rounding in our run."""
    return tuple(
        f"{instance}.{name}"
        for (instance, name), moves in zip(request.columns, _moving(own), strict=True)
        if not moves
    )


def _moving(own: np.ndarray) -> np.ndarray:
    """Return which columns change by more than rounding, shape (columns,)."""
    return np.asarray(np.ptp(own, axis=0) > ROUNDING * np.max(np.abs(own), axis=0))

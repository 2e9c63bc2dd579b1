"""A scenario run by other masters, and how far their numbers are from those of ours.

Everything is exported as an SSP archive and every master runs it in a process of its own, so one
that crashes or never ends costs a sentence. Samples are counted, not read off time labels: after k
steps is after k steps, whatever a program calls that instant. What is compared is `jacobi`, the
algorithm that they all have; a difference is relative to the signal's range in our run.

A master that cannot give a unit a step of its own gets the system with one step for all, and is
compared with our run of that system.
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
from ..plan import Plan
from ..processes import how_it_ended, python
from .masters import Recording, Request
from .ssp_write import write_ssp

AGREEMENT = 1e-9
"""Difference, relative to a signal's range, below which two runs are the same run: rounding, and that
one program counts time in nanoseconds and another adds steps up."""
ROUNDING = 1e-12
"""Range, relative to a signal's magnitude, up to which it counts as constant; chosen: thousands of
roundings, far below what any signal here does."""
LIMIT = 900.0
"""Time that a master may take [s]."""


@dataclass(frozen=True)
class OtherMaster:
    """A program that runs SSP archives: its module, its package, what has to be known of it."""

    title: str
    module: str
    package: str
    one_step: bool  # cannot give a unit a step of its own
    note: str = ""


MASTERS = (
    OtherMaster("libcosim", "libcosim", "libcosimpy", False),
    OtherMaster(
        "Ecos",
        "ecos",
        "ecospy",
        True,
        "it calls a unit with a longer step less often, but only for one communication step",
    ),
    OtherMaster(
        "fmpy",
        "fmpy_ssp",
        "fmpy",
        True,
        "its SSP simulation steps all units alike, exchanges nothing before the first step (all inputs "
        "are 0 in it) and sets no texts, so it starts elsewhere and its differences stay",
    ),
)


@dataclass(frozen=True)
class SecondOpinion:
    """What another master made of a system, beside what ours made of the same archive."""

    master: OtherMaster
    one_step: bool  # the system was given one step for all units
    problem: str = ""
    differences: dict[str, float] = field(default_factory=dict)  # unit.variable -> largest, over range
    seconds: dict[str, float] = field(default_factory=dict)  # per step: "theirs", "ours", "... on one core"
    still: tuple[str, ...] = ()  # signals that keep their first value in our run, and so say little

    @property
    def largest(self) -> float:
        """The largest difference of all signals."""
        return max(self.differences.values(), default=0.0)

    @property
    def agrees(self) -> bool:
        return not self.problem and self.largest <= AGREEMENT


def installed(master: OtherMaster) -> bool:
    """Return whether the program's package is there."""
    return importlib.util.find_spec(master.package) is not None


def second_opinion(
    plan: Plan,
    folder: Path,
    *,
    masters: Sequence[OtherMaster] = MASTERS,
    pinned: bool = True,
    said: Callable[[str], None] = lambda text: None,
) -> list[SecondOpinion]:
    """Run a plan in other masters and compare.

    Args:
        plan: its algorithm does not matter, `jacobi` is compared.
        folder: for archives and recordings.
        masters: which ones; those not installed get a sentence.
        pinned: also measure every master on one processor core.
        said: told what is being run.

    Raises:
        WiringError: there is nothing to compare.
        ResultsError: the archive cannot be written.
        RuntimeError: our own run failed.
    """
    if not _columns(plan):
        raise WiringError(
            f"{plan.title or 'this system'}: nothing to compare: no output of type Real is recorded"
        )
    if plan.start:
        raise WiringError("a second opinion is of runs that begin at 0 s: leave start_time out")
    ours: dict[bool, tuple[Request, dict[str, Recording]]] = {}
    opinions = []
    for master in masters:
        one_step = master.one_step and any(unit.period > 1 for unit in plan.instances)
        if not installed(master):
            says = f"{master.package} is not installed: pip install 'yawbench[interop]'"
            opinions.append(SecondOpinion(master, one_step, says))
            continue
        if one_step not in ours:
            request = _request(plan, one_step, folder)
            said(f"yawbench{', one step for all units' if one_step else ''}")
            made = _recordings("own", request, pinned, folder)
            if isinstance(made, str):
                raise RuntimeError(f"our own run of the archive has failed: {made}")
            ours[one_step] = request, made
        request, own = ours[one_step]
        said(master.title)
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
    """Write the archive; return what is to be run."""
    if one_step:
        plan = replace(plan, instances=tuple(replace(unit, period=1) for unit in plan.instances))
    path = folder / ("one_step.ssp" if one_step else "system.ssp")
    write_ssp(plan, path)
    return Request(str(path), float(plan.step), plan.n_steps, _columns(plan))


def _columns(plan: Plan) -> list[tuple[str, str]]:
    """Return what is compared: every recorded output of type Real."""
    units = {unit.name: unit.fmu for unit in plan.instances}
    return [(u, name) for u, name in plan.record if units[u].variables[name].type == "Real"]


def _recordings(module: str, request: Request, pinned: bool, folder: Path) -> dict[str, Recording] | str:
    """Run one master, also on one core if asked; return a sentence if it has no result."""
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
    """Run one master in a process of its own; return a sentence if it has no result."""
    asked, answered = folder / "request.json", folder / "recording.npz"
    request.write(asked)
    answered.unlink(missing_ok=True)
    command = python("orchestrator.interop.masters", module, asked, answered)
    environment = os.environ | {"TMPDIR": str(folder)}  # Ecos leaves what it has unpacked
    try:
        done = subprocess.run(command, capture_output=True, timeout=LIMIT, env=environment, check=False)
    except subprocess.TimeoutExpired:
        return f"it did not end within {LIMIT:g} s"
    if done.returncode == 0 and answered.exists():
        return Recording.read(answered)
    lines = done.stderr.decode(errors="replace").strip().splitlines()
    if done.returncode < 0:
        before = f"; before that it said: {' '.join(lines[-2:])}" if lines else ""
        return f"it {how_it_ended(done.returncode)}{before}"
    return lines[-1] if lines else f"it ended without a word, exit status {done.returncode}"


def differences(request: Request, own: np.ndarray, other: np.ndarray) -> dict[str, float]:
    """Return each signal's largest difference over its range in our run.

    One that stays constant but for rounding (`ROUNDING`) has no range: over its magnitude, over 1 if
    that is 0. The first row does not count where the other master has no value for it at all; any
    other value that is not finite counts as infinite.
    """
    first = int(np.all(np.isnan(other[0])))
    gap = np.abs(other[first:] - own[first:])
    gap = np.where(np.isfinite(gap), gap, np.inf)
    magnitude = np.max(np.abs(own), axis=0)
    scale = np.where(_moving(own), np.ptp(own, axis=0), np.where(magnitude > 0, magnitude, 1.0))
    relative = np.max(gap, axis=0) / scale
    return {f"{unit}.{name}": float(d) for (unit, name), d in zip(request.columns, relative, strict=True)}


def still_signals(request: Request, own: np.ndarray) -> tuple[str, ...]:
    """Return the signals that stay constant but for rounding in our run."""
    return tuple(
        f"{unit}.{name}"
        for (unit, name), moves in zip(request.columns, _moving(own), strict=True)
        if not moves
    )


def _moving(own: np.ndarray) -> np.ndarray:
    """Return which columns change by more than rounding, shape (columns,)."""
    return np.asarray(np.ptp(own, axis=0) > ROUNDING * np.max(np.abs(own), axis=0))

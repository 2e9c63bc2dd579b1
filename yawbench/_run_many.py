"""Executes many runs: those with Python components in this process, the others in worker processes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from yawbench.foundation.errors import SimulationError, YawbenchError
from yawbench.orchestrator.master.fmi import open_instance
from yawbench.orchestrator.master.log import Log
from yawbench.orchestrator.plan import Instance
from yawbench.studies.jobs import Job, Outcome, execute

from ._controller import PythonComponent
from .planner import Planner


def opener_of(programs: Mapping[Path, PythonComponent]) -> Callable[[Instance, Log, set[Path]], Any]:
    """Return the function that opens a run's instances: FMUs, and `programs` by their virtual paths."""

    def opener(instance: Instance, log: Log, corrupted: set[Path]) -> Any:
        program = programs.get(instance.fmu.path)
        return (
            program.open(instance, log)
            if program and _in_python(instance)
            else open_instance(instance, log, corrupted)
        )

    return opener


class Opened:
    """An opener that keeps the instances it has opened, for the exception of the one that failed."""

    def __init__(self, make: Callable[..., Any]) -> None:
        self._make = make
        self.instances: list[Any] = []

    def __call__(self, instance: Instance, log: Log, corrupted: set[Path]) -> Any:
        self.instances.append(self._make(instance, log, corrupted))
        return self.instances[-1]

    def cause(self, error: SimulationError) -> BaseException | None:
        """Return the exception of Python code in the instance that an error names; None if it is no code."""
        failed = (one for one in self.instances if one.name == error.instance)
        return next((getattr(one, "error", None) for one in failed), None)


def planner_of(programs: Mapping[Path, PythonComponent]) -> Planner:
    """Return a planner that rebuilds stale FMUs silently and resolves plain Python components."""
    opened = {path: program.as_now() for path, program in programs.items()}
    return Planner(build=True, report=lambda text: None, opened=opened)


def _in_python(instance: Instance) -> bool:
    return not (instance.fmu.runs_as and instance.fmu.runs_as.native)


def make_all(
    jobs: Sequence[Job],
    programs: Mapping[Path, PythonComponent],
    *,
    workers: int | None,
    done: Callable[[Outcome], None],
    run: Callable[..., Any],
) -> list[Outcome]:
    """Make all runs and return their outcomes in order; those with Python components run last, serially.

    Args:
        jobs: planned runs.
        programs: Python components by their virtual paths.
        workers, done, run: see `execute`; `run` also takes an `opener`.
    """
    here = [
        any(instance.fmu.path in programs and _in_python(instance) for instance in job.plan.instances)
        if job.plan
        else False
        for job in jobs
    ]
    apart = [job for job, plain in zip(jobs, here, strict=True) if not plain]
    outcomes_apart = iter(execute(apart, workers=workers, done=done, run=run) if apart else ())
    outcomes = []
    for job, plain in zip(jobs, here, strict=True):
        outcome = _made_here(job, run, programs) if plain else next(outcomes_apart)
        outcomes.append(outcome)
        if plain:
            done(outcome)
    return outcomes


def _made_here(job: Job, run: Callable[..., Any], programs: Mapping[Path, PythonComponent]) -> Outcome:
    try:
        return Outcome(job, value=run(job, opener=opener_of(programs)))
    except YawbenchError as error:
        return Outcome(job, tuple(error.diagnostics), error.exit_status)

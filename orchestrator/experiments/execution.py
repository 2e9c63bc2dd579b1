"""Execution of an experiment's jobs: which are still to be run, by which runner, noted in the journal."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from .. import checksums
from ..errors import ResultsError, ScenarioError
from ..metrics.run_metrics import metric, results_to_be, unit_in
from ..plan import Plan
from ..results.freshness import altered, staleness
from .jobs import Job, MeasuredRun, MetricRequests, OnOutcome, Outcome, read_back
from .journal import Journal
from .workers import execute

Runner = Callable[[Sequence[Job], OnOutcome], object]
"""Executes jobs and reports each outcome; see `runner_of`."""


def left_to_do(jobs: Sequence[Job], records: Mapping[str, MeasuredRun]) -> list[Job]:
    """Return the jobs that are still to be run, without repetition, in their order.

    A job with metrics is finished if its key is in `records` and, where results are kept, they can be
    read; any other job is finished if the key in its results matches. Warns of results that were edited.
    """
    left: dict[tuple[str, Path], Job] = {}
    for job in jobs:
        if (job.key, job.out) in left:
            continue
        if not (job.metrics or job.test):
            made = job.plan is not None and staleness(job.plan, job.out) is None
        else:
            record = records.get(job.key)
            if record is not None and (words := _other_unit(job, record)):
                checksums.warn(f"{job.label} is to be made again: {words}")
                record = None
            made = record is not None and not (job.keep and record.ok and isinstance(read_back(job.out), str))
        if made:
            continue
        left[job.key, job.out] = job
        if words := altered(job.out):
            checksums.warn(f"{job.label} is to be made again: {words}")
    return list(left.values())


def _other_unit(job: Job, record: MeasuredRun) -> str:
    """Describe a metric that was recorded in another unit than the plan's; "" if there is none."""
    assert job.plan is not None
    units = _units(job.plan, job.metrics)
    for key, value in record.values.items():
        if value is not None and units.get(key, value[1]) != value[1]:
            return f"{key} is noted in {value[1]}, and measured in {units[key]}"
    return ""


def _units(plan: Plan, metrics: MetricRequests) -> dict[str, str]:
    """Return metric key -> unit."""
    results = results_to_be(plan)
    return {key: unit for key, name, _ in metrics if (unit := unit_in(results, metric(name))) is not None}


def finish(
    left: Sequence[Job], journal: Journal | None, *, runner: Runner, told: OnOutcome = lambda _: None
) -> list[Outcome]:
    """Execute jobs, add each to the journal (if any) as it ends, and return the outcomes.

    Raises:
        KeyboardInterrupt: Ctrl-C; finished runs are in the journal.
        ResultsError: the journal cannot be written, or the cluster was lost.
    """
    outcomes: list[Outcome] = []

    def done(outcome: Outcome) -> None:
        final = outcome.ok or (outcome.exit_status == 1 and not outcome.died)  # else try again
        if journal:
            journal.add(outcome.job.key, outcome.record, last=final)
        outcomes.append(outcome)
        told(outcome)

    runner(left, done)
    if journal and any(job.key not in journal.records for job in left):
        raise ResultsError(f"{journal.folder}: not all runs were made; start it again.")
    return outcomes


def runner_of(workers: int | None, scheduler: str | None) -> Runner:
    """Return a runner: local worker processes (see `execute`), or a Dask cluster.

    Args:
        workers: number of processes; None: one per core.
        scheduler: address of the cluster's scheduler; None or "": run locally.

    Raises:
        ScenarioError: the package `distributed` is missing.
    """
    if not scheduler:
        return lambda jobs, told: execute(jobs, workers=workers, done=told)
    try:
        from .cluster import run_on_cluster
    except ImportError:
        raise ScenarioError(
            "--scheduler needs the package distributed: pip install 'yawbench[cluster]'"
        ) from None
    return functools.partial(run_on_cluster, scheduler=scheduler)

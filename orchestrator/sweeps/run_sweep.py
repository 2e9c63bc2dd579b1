"""The course of a sweep: what is left to be done, done, and noted in the journal."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ..errors import ResultsError
from ..master.run import KEPT
from ..studies.jobs import Outcome, read_back
from .journal import Journal, Record
from .local import run_here
from .measuring import Measurement, Metrics
from .planning import Planned, PlannedRun

Runner = Callable[[list[Measurement], Callable[[Outcome], None]], None]
"""Makes runs and tells of each that is finished: `run_here`, or a cluster."""


def left_to_do(
    planned: Planned, records: Mapping[str, Record], *, keep: bool = False, format: str = "csv"
) -> list[Measurement]:
    """Return the runs that are not finished, each key once, in the order of the design.

    Args:
        planned: the sweep.
        records: key -> what is known of runs that are finished.
        keep: whether runs keep their results; one that has not kept them is made again.
        format: of results that are kept.
    """
    metrics: Metrics = tuple(
        (key, spec.metric, spec.window) for key, spec in planned.sweep.spec.metrics.items()
    )
    left: dict[str, Measurement] = {}
    for run in planned.runs:
        if run.key in left or (run.key in records and not (keep and _lost(run, records[run.key]))):
            continue
        job = run.job
        left[run.key] = Measurement(
            job.label, job.scenario, job.out.absolute(), format=format, key=run.key, plan=run.plan,
            metrics=metrics, keep=keep, call_limit=job.call_limit,
        )  # fmt: skip
    return list(left.values())


def _lost(run: PlannedRun, record: Record) -> bool:
    """Return whether a run that went well has left no results."""
    return record.ok and isinstance(read_back(run.job.out), str)


def finish(
    left: list[Measurement],
    journal: Journal,
    *,
    runner: Runner = run_here,
    told: Callable[[Outcome], None] = lambda outcome: None,
) -> None:
    """Make the runs that are left and note each in the journal as it ends.

    Args:
        left: by `left_to_do`.
        journal: of the sweep.
        runner: where runs are made.
        told: called with every outcome.

    Raises:
        KeyboardInterrupt: Ctrl-C; what is finished is in the journal.
        ResultsError: the journal cannot be written, or a cluster was lost.
    """

    def done(outcome: Outcome) -> None:
        job = outcome.job
        assert isinstance(job, Measurement)
        problems = tuple(text for text in outcome.problems if not text.startswith(KEPT))
        final = outcome.ok or (outcome.exit_status == 1 and not outcome.died)  # else it may go well next time
        values, findings = outcome.value or ({}, ())
        journal.add(job.key, Record(values, problems, findings), last=final)
        told(outcome)

    runner(left, done)
    if any(job.key not in journal.records for job in left):
        raise ResultsError(f"{journal.folder}: not all runs were made; start the sweep again.")

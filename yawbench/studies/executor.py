"""Execution of experiments: which runs are still to be made, by which runner, noted in the journal.

An experiment may depend on the results of earlier ones in the same folder: the next generation of a search,
amplitudes that are multiples of a measured angle, the next step of a bisection. Such a sequence is a function
that builds experiments and hands each to an `Executor`. It is deterministic and finished runs are in the
journal, so calling it again resumes it where it was interrupted.
"""

from __future__ import annotations

import functools
from array import array
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

from yawbench.foundation import plugins
from yawbench.foundation.errors import ResultsError, ScenarioError, YawbenchError
from yawbench.foundation.workers import Pool
from yawbench.orchestrator.plan import Plan
from yawbench.orchestrator.results.freshness import staleness
from yawbench.orchestrator.results.run_record import RUN_FILE
from yawbench.planner import Planner

from .experiment import Case, LoadedExperiment, NamedRun, PlannedExperiment, plan_experiment
from .experiment_result import Each, ExperimentResult, judge_records, judge_results
from .jobs import Job, MeasuredRun, OnOutcome, Outcome, execute_each, pool_for, read_back, ready
from .jobs import planned as planned_run
from .journal import Journal
from .on_demand import OnDemand

Runner = Callable[[Sequence[Job], OnOutcome], object]
"""Executes jobs and reports each outcome; see `runner_of`."""


class Display(Protocol):
    """Shows the progress of experiments."""

    def planning(self, total: int) -> AbstractContextManager[Callable[[int], None]]:
        """Show the planning of a number of runs, while it is called with how many are planned."""
        return nullcontext(lambda done: None)

    def planned(self, planned: PlannedExperiment) -> None:
        """Show the diagnostics of plans."""

    def running(
        self, title: str, runs: int, finished: int, left: int, *, journaled: bool
    ) -> AbstractContextManager[OnOutcome]:
        """Show the execution of runs while it is called with their outcomes.

        Args:
            title: describes them.
            runs: the number of all, with repetitions.
            finished, left: the numbers of those that are finished and that are to be made.
            journaled: whether finished ones are in the journal.
        """
        return nullcontext(lambda outcome: None)


class NoDisplay(Display):
    """Shows nothing."""


@dataclass(frozen=True)
class Executor(AbstractContextManager["Executor"]):
    """Executes experiments in one locked results folder, with one journal and one planner.

    The journal has the runs of experiments with axes; those of others have results in folders of their own.
    """

    folder: Path
    identity: str  # of the experiments, in the journal
    runner: Runner | None  # None: missing runs are not made
    planner: Planner = field(default_factory=Planner)
    fresh: bool = False  # whether finished runs are made again
    of_jobs: Mapping[str, Any] = field(default_factory=dict)  # fields of all jobs
    each: Each = map  # to read results with
    display: Display = field(default_factory=NoDisplay)

    @cached_property
    def journal(self) -> Journal:
        """The journal, opened when it is first needed.

        Raises:
            ResultsError: the folder belongs to another experiment, or cannot be written.
        """
        return Journal(self.folder, self.identity, fresh=self.fresh)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if isinstance(self.runner, LocalRunner):
            self.runner.end(terminate=kind is not None)
        if "journal" in self.__dict__:
            self.journal.close()

    def __call__(
        self,
        experiment: LoadedExperiment,
        *,
        only: Callable[[Case], bool] = lambda case: True,
        **of_jobs: Any,
    ) -> ExperimentResult:
        """Execute the missing runs of an experiment and return its result.

        Args:
            experiment: as loaded or computed.
            only: whether a missing case is executed; a finished one counts in any case.
            of_jobs: fields of all jobs in place of the executor's.

        Raises:
            YawbenchError: a run cannot start; none has been started.
        """
        planned = self.planned(experiment, **of_jobs)
        experiment, journaled = planned.experiment, bool(experiment.spec.axes)
        chosen = array("L", (case.number for case in experiment.cases if only(case)))
        jobs = OnDemand(chosen, planned.jobs.__getitem__)
        outcomes = self.run(experiment.title, jobs, journaled=journaled)
        if journaled:
            return judge_records(planned, self.journal.records)
        return judge_results(experiment, self.folder, outcomes, planned=planned, each=self.each)

    def planned(self, experiment: LoadedExperiment, **of_jobs: Any) -> PlannedExperiment:
        """Plan all cases of an experiment.

        Raises:
            YawbenchError: a run cannot start.
        """
        with self.display.planning(len(experiment.cases)) as progress:
            options = {**self.of_jobs, **of_jobs}
            planned = plan_experiment(
                experiment, self.folder, planner=self.planner, progress=progress, **options
            )
        self.display.planned(planned)
        return planned

    def plans(self, runs: Iterable[NamedRun]) -> list[Plan]:
        """Return the plans of named runs, for experiments that depend on values in their scenarios.

        Raises:
            ScenarioError: some of the runs cannot start; lists each problem once.
        """
        jobs = [Job(run.label, run.scenario, self.folder, run.changes, **self.of_jobs) for run in runs]
        return [job.plan for job in ready(jobs, planner=self.planner) if job.plan]

    def run(self, title: str, jobs: Sequence[Job], *, journaled: bool) -> list[Outcome]:
        """Execute those of the jobs that are not finished; return their outcomes if not journaled.

        Args:
            title: describes the jobs.
            jobs: with plans and keys.
            journaled: whether the journal has the finished runs; else their results are looked for.

        Raises:
            KeyboardInterrupt: Ctrl-C; what has finished is kept.
            YawbenchError: the journal cannot be written, or the cluster does not exist.
        """
        if self.runner is None and not journaled:
            return []
        journal = self.journal if journaled else None
        records, again = journal.records if journal else {}, self.fresh and not journaled
        left, finished = left_to_do(jobs, records, again=again)
        with self.display.running(title, len(jobs), finished, len(left), journaled=journaled) as on_outcome:
            return (
                finish(left, journal, runner=self.runner, on_outcome=on_outcome)
                if self.runner and left
                else []
            )

    def keeping(
        self, findings: ExperimentResult, numbers: Collection[int], record: Sequence[str] = ()
    ) -> ExperimentResult:
        """Return a result whose cases with these numbers keep their results.

        Which runs are worth keeping is known when all have been judged. Those without results are made
        again; the journal keeps the records of their first time.

        Args:
            findings: of an experiment with axes.
            numbers: of its cases.
            record: signals, or patterns of names, that they record besides those of the experiment.
        """
        planned = findings.planned
        assert planned is not None
        planner = Planner()

        def keeping(number: int) -> Job:
            job = planned.jobs[number]
            if number not in numbers:
                return job
            kept = replace(job, keep=True)
            if not record:
                return kept
            wider = replace(kept, record=(*job.record, *record))
            try:
                return replace(wider, plan=planned_run(wider, planner)[1])
            except YawbenchError:  # of an FMU that is an object of the caller: it was planned with it
                return kept

        jobs = OnDemand(range(len(planned.jobs)), keeping)
        lacking = {
            planned.keys[number]: number
            for number in sorted(numbers)
            if not _has_results(jobs[number], findings.records[number])
        }
        left = OnDemand([*lacking.values()], keeping)
        if self.runner and left:
            title = f"{findings.spec.title}: results to keep"
            with self.display.running(title, len(left), 0, len(left), journaled=True) as on_outcome:
                finish(left, None, runner=self.runner, on_outcome=on_outcome)
        return replace(findings, planned=replace(planned, jobs=jobs))


def _has_results(job: Job, record: MeasuredRun) -> bool:
    """Return whether the results of a finished run are in its folder; of a failed one, up to its failure."""
    if record.failed:
        return (job.out / RUN_FILE).is_file()
    return job.plan is not None and staleness(job.plan, job.out) is None


def left_to_do(
    jobs: Sequence[Job], records: Mapping[str, MeasuredRun], *, again: bool = False
) -> tuple[Sequence[Job], int]:
    """Return the jobs that are still to be run, in their order, and how many are finished; none twice.

    A job with metrics is finished if its key is in `records` and, where results are kept, they can be
    read; any other job is finished if the key in its results matches.

    Args:
        jobs: with plans and keys.
        records: job key -> record of the run.
        again: whether finished jobs are to be run again.
    """
    left, known = array("L"), set[str]()
    for number, job in enumerate(jobs):
        if (run := f"{job.key} {job.out}") in known:
            continue
        known.add(run)
        if again:
            left.append(number)
            continue
        if not (job.metrics or job.test):
            made = job.plan is not None and staleness(job.plan, job.out) is None
        else:
            record = records.get(job.key)
            made = record is not None and not (job.keep and record.ok and isinstance(read_back(job.out), str))
        if made:
            continue
        left.append(number)
    return OnDemand(left, jobs.__getitem__), len(known) - len(left)


def finish(
    left: Sequence[Job], journal: Journal | None, *, runner: Runner, on_outcome: OnOutcome = lambda _: None
) -> list[Outcome]:
    """Execute jobs and add each to the journal as it ends; without a journal, return the outcomes.

    Raises:
        KeyboardInterrupt: Ctrl-C; finished runs are in the journal.
        ResultsError: the journal cannot be written, or the cluster was lost.
    """
    outcomes: list[Outcome] = []
    made = 0

    def done(outcome: Outcome) -> None:
        nonlocal made
        made += 1
        final = outcome.ok or (outcome.exit_status == 1 and not outcome.died)  # else try again
        if journal:
            journal.add(outcome.job.key, outcome.record, last=final and not outcome.record.of_machine)
        else:
            outcomes.append(outcome)
        on_outcome(outcome)

    runner(left, done)
    if journal and made < len(left):
        raise ResultsError(f"{journal.folder}: not all runs were made; start it again.", code="runs-missing")
    return outcomes


class LocalRunner:
    """Executes jobs in local worker processes (see `execute_each`), which the executor ends.

    Rounds of a search share them, and with them the instances that they keep.

    Args:
        workers: number of processes; None: one per core.
    """

    def __init__(self, workers: int | None) -> None:
        self._workers = workers
        self._pool: Pool | None = None

    def __call__(self, jobs: Sequence[Job], on_outcome: OnOutcome) -> None:
        self._pool = self._pool or pool_for(jobs, self._workers)
        try:
            execute_each(jobs, lambda _, outcome: on_outcome(outcome), pool=self._pool)
        except BaseException:
            self.end(terminate=True)
            raise

    def end(self, *, terminate: bool) -> None:
        """End the processes; `terminate`: without waiting for their runs."""
        if self._pool:
            self._pool.end(terminate=terminate)


def runner_of(workers: int | None, scheduler: str | None) -> Runner:
    """Return a runner: local worker processes (see `LocalRunner`), or a Dask cluster.

    Args:
        workers: number of processes; None: one per core.
        scheduler: address of the cluster's scheduler; None or "": run locally.

    Raises:
        ScenarioError: the package `distributed` is missing.
    """
    if not scheduler:
        return LocalRunner(workers)
    try:
        run_on_cluster = plugins.require("runner", "scheduler")
    except ImportError:
        raise ScenarioError(
            "--scheduler needs the package distributed: pip install 'yawbench[cluster]'",
            code="package-missing",
        ) from None
    return functools.partial(run_on_cluster, scheduler=scheduler)

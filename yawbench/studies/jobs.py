"""Jobs: runs planned in advance and executed by whichever process they are handed to.

`execute` hands them to worker processes, so that a crash does not affect other runs.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from yawbench.foundation.cache import OF_METRICS, OF_TESTS, sources_hash
from yawbench.foundation.errors import (
    BuildError,
    Diagnostic,
    Interrupted,
    Location,
    ResultsError,
    ScenarioError,
    YawbenchError,
    errors_in,
    text_of,
    warnings_in,
)
from yawbench.foundation.interrupts import StopFlag, interrupts
from yawbench.foundation.messages import listed, printable
from yawbench.foundation.processes import retire
from yawbench.foundation.safe_files import reason
from yawbench.foundation.workers import Finished, Pool
from yawbench.metrics.expressions import evaluate, metric
from yawbench.orchestrator.plan import Override, Plan
from yawbench.orchestrator.results import freshness
from yawbench.orchestrator.results.reader import Results, load_results
from yawbench.orchestrator.results.run_record import RunStatus
from yawbench.planner import Planner

from .on_demand import StoredPlans

if TYPE_CHECKING:
    from yawbench.orchestrator.master.run_lifecycle import OpenInstance
    from yawbench.orchestrator.scenario.schema import LoadedScenario

MANY = 10
"""Errors shown; the rest are only counted."""

TRIES = 2
"""Attempts at a run whose process dies; chosen: a kill from outside rarely happens twice."""
LASTING = 200
"""Runs that a worker makes before it is replaced."""
NEEDED = ("yawbench.studies.jobs", "yawbench.orchestrator.master.simulate", "pyarrow.csv")
"""Modules to preload for runs, because they are slow to import."""
FOR_TESTS = ("scipy.signal", "yawbench.proving_ground.sine_with_dwell")
"""Further modules to preload if runs are judged by a standard test."""

OF_MACHINE = frozenset({"results-unwritable", "run-process-died", "memory-exhausted"})
"""Codes of failures that say nothing about the model, such as a full disk; such runs are made again."""

MetricRequests = tuple[tuple[str, str, tuple[float, float] | None], ...]
"""(key, metric, window) of each metric."""
TestRequest = tuple[str, float | None]
"""Name of a standard test, and its steering angle A [rad] if known."""
STEP_TIME = "step_time"
"""Metric key of the mean processor time per step of the timed instance [s]."""
MetricValues = Mapping[str, tuple[float, str] | None]
"""Metric key -> (value, unit); None where the run yields no value."""


@dataclass(frozen=True)
class Job:
    """A run to be executed: scenario, overrides, results folder, and what to measure."""

    label: str
    scenario: Path
    out: Path
    changes: tuple[Override, ...] = ()
    fmus: Path | None = None
    record: tuple[str, ...] = ()  # signals, or patterns of names; default: those the scenario records
    format: str = "csv"  # of the results
    call_limit: float | None = None  # of an FMU call [s], isolates the instances; None: not isolated
    metrics: MetricRequests = ()  # computed when the run ends
    test: TestRequest | None = None  # likewise, its quantities and verdicts
    timed: str = ""  # likewise, the time per step of this instance
    keep: bool = True  # whether results are written
    plan: Plan | None = None  # None until planned
    key: str = ""  # see `keyed`


MeasuredStatus = Literal["not made", "completed", "ended early", "failed"]
"""State of a run of an experiment."""


@dataclass(frozen=True, slots=True)
class MeasuredRun:
    """Metrics of a run, or the reason why there are none."""

    values: MetricValues
    diagnostics: tuple[Diagnostic, ...] = ()  # errors, and warnings about the course of the run
    ended: str | None = None  # why an instance ended it early
    id: str | None = None  # id of its results on disk, if just written
    made: bool = True  # False: the run has not been executed yet

    @property
    def ok(self) -> bool:
        return not errors_in(self.diagnostics)

    @property
    def failed(self) -> bool:
        """Whether the run was executed without yielding a result."""
        return self.made and not self.ok

    @property
    def of_machine(self) -> bool:
        """Whether it failed for a reason of the machine (see `OF_MACHINE`)."""
        return any(diagnostic.code in OF_MACHINE for diagnostic in errors_in(self.diagnostics))

    @property
    def status(self) -> MeasuredStatus:
        """One- or two-word status."""
        if not self.made:
            return "not made"
        return ("ended early" if self.ended else "completed") if self.ok else "failed"

    @property
    def warning_codes(self) -> tuple[str, ...]:
        """Codes of the warnings about the course of the run."""
        return tuple(diagnostic.code for diagnostic in warnings_in(self.diagnostics))

    @property
    def reason(self) -> str | None:
        """Reason why the run failed or ended early; None if neither."""
        return text_of(errors_in(self.diagnostics)) or self.ended


NOT_MADE = MeasuredRun({}, (Diagnostic("run-not-made", "not made"),), made=False)
"""Record of a run that has not been executed yet."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Outcome of a job; `diagnostics` is empty if it succeeded."""

    job: Job
    diagnostics: tuple[Diagnostic, ...] = ()
    exit_status: int = 0
    seconds: float = 0.0  # wall time of the process
    value: Any = None  # return value; of `run_job` a `MeasuredRun`
    died: bool = False  # the process ended without a report, or was interrupted

    @property
    def ok(self) -> bool:
        return not self.diagnostics

    @property
    def reason(self) -> str:
        """Reason why the job failed, in one line."""
        return text_of(self.diagnostics)

    @property
    def record(self) -> MeasuredRun:
        """The record of the run, as its process reported it."""
        errors = errors_in(self.diagnostics)  # not where the results of a failed run are
        return MeasuredRun({}, errors) if errors else self.value


OnOutcome = Callable[[Outcome], None]
"""Callback, called once per finished job."""


def planned(job: Job, planner: Planner | None = None) -> tuple[LoadedScenario, Plan]:
    """Return a job's scenario with its overrides applied, and its plan; `planner`: one for many jobs.

    Raises:
        YawbenchError: the scenario, an option or an FMU is wrong.
    """
    planner = planner or Planner()
    scenario = planner.load(job.scenario, job.changes)
    isolated = job.call_limit is not None
    return scenario, planner.plan(scenario, fmus=job.fmus, isolated=isolated, record=job.record)


def plans_of(
    jobs: Iterable[Job],
    *,
    planner: Planner | None = None,
    progress: Callable[[int], None] = lambda done: None,
    cause: Callable[[str], tuple[Hashable, Location] | None] = lambda place: None,
) -> StoredPlans:
    """Plan all jobs, so that each of them is known to be able to start.

    Args:
        jobs: the runs.
        planner: makes the plans; builds stale FMUs first if its opener does.
        progress: called with the number of jobs planned so far.
        cause: returns what has made the override that an error is at, and where; only the first error of a
            thing is reported, there.

    Raises:
        BuildError: stale FMUs cannot be built.
        ScenarioError: some jobs cannot start; lists each error once.
        ResultsError: the plans cannot be stored.
    """
    planner, plans = planner or Planner(), StoredPlans()
    errors: dict[Hashable, Diagnostic] = {}
    for number, job in enumerate(jobs, start=1):
        try:
            _, plan = planned(job, planner)
        except BuildError:
            raise
        except YawbenchError as problem:
            for error in problem.diagnostics:
                thing, where = cause(error.location.target) or (error, None)
                moved = Diagnostic(error.code, str(error), location=where) if where else error
                errors.setdefault(thing, moved)
        else:
            plans.add(plan)
        progress(number)
    if errors:
        problems = _missing_once(errors.values())
        more = f"and {len(problems) - MANY} more problems"
        omitted = [Diagnostic("errors-omitted", more)] if len(problems) > MANY else []
        raise ScenarioError([*problems[:MANY], *omitted])
    return plans


def _missing_once(errors: Iterable[Diagnostic]) -> list[Diagnostic]:
    """Return the errors; of those on the same missing FMU the first, with the other places that need it."""
    alike: dict[Hashable, list[Diagnostic]] = {}
    for error in errors:
        alike.setdefault(error.message if error.code == "fmu-missing" else error, []).append(error)
    once = []
    for first, *others in alike.values():
        places = [replace(other.location, target="") for other in others if other.location.file]
        also = f" (needed also at {listed(places)})" if places else ""
        once.append(replace(first, message=f"{first.message}{also}"))
    return once


def ready(jobs: Sequence[Job], **options: Any) -> list[Job]:
    """Return jobs with their plans; `options`, and what it raises, as of `plans_of`."""
    plans = plans_of(jobs, **options)
    return [replace(job, plan=plans[number]) for number, job in enumerate(jobs)]


def keyed(job: Job, metrics: MetricRequests = ()) -> Job:
    """Return a job with its metrics and key."""
    assert job.plan is not None
    return replace(job, metrics=metrics, key=key_of(job.plan, metrics, job.test, job.timed))


def key_of(plan: Plan, metrics: MetricRequests = (), test: TestRequest | None = None, timed: str = "") -> str:
    """Return the key of a job; jobs with equal keys are the same run."""
    also: list[Any] | None = [metrics, sources_hash(OF_METRICS)] if metrics else None
    if test:
        also = [metrics, test, sources_hash(OF_TESTS)]
    if timed:  # native code and Python of the same sources give the same numbers in other times
        also = [also, *(unit.fmu.sha256 for unit in plan.instances if unit.name == timed)]
    return freshness.key_of(plan, also)


def run_job(job: Job, opener: OpenInstance | None = None) -> MeasuredRun:
    """Execute one run in this process; `opener` replaces the one that creates instances from FMUs.

    Raises:
        YawbenchError: the scenario is wrong or the run failed.
    """
    from yawbench.events.kinds import RunWatch, WarningWatch
    from yawbench.orchestrator.master.isolation import opener_of
    from yawbench.orchestrator.master.run_lifecycle import StepClock, timing
    from yawbench.orchestrator.master.simulate import simulate, simulate_in_memory

    plan, clock, run = job.plan or planned(job)[1], StepClock(), None
    with opener_of(plan, job.call_limit) as own:
        opening = opener or own
        timed = timing(opening, job.timed, clock) if job.timed and job.call_limit is None else opening
        if job.keep:
            apart = timed is own  # a step clock and instances in plain Python need this process
            run = simulate(
                plan, job.out, opener=timed, watch=RunWatch(plan), format=job.format, apart=apart
            ).id
            if not (job.metrics or job.test):
                return MeasuredRun({}, id=run)
            results = load_results(job.out)
        else:
            results = simulate_in_memory(plan, opener=timed, watch=WarningWatch(plan))
        record = measured(results, job.metrics, job.test)
    time = {STEP_TIME: (clock.mean, "s")} if clock.steps else {}
    return replace(record, values={**record.values, **time}, id=run)


def recorded(job: Job) -> Results:
    """Execute one run in this process and return its results, which are not written.

    Raises:
        YawbenchError: the scenario is wrong or the run failed.
    """
    from yawbench.events.kinds import WarningWatch
    from yawbench.orchestrator.master.simulate import simulate_in_memory

    plan = job.plan or planned(job)[1]
    return simulate_in_memory(plan, watch=WarningWatch(plan))


def measured(results: Results, metrics: MetricRequests, test: TestRequest | None = None) -> MeasuredRun:
    """Compute the metrics of a finished run; of a test its quantities, and its verdicts as 1, 0 or None."""
    values: dict[str, tuple[float, str] | None] = {}
    for key, name, window in metrics:
        value = evaluate(results, metric(name), window)
        short = results.ended and not window  # over a shorter time it is another metric
        values[key] = None if value is None or short else (value.number, value.shown_in)
    if test:
        values |= _judged(results, *test)
    return MeasuredRun(values, results.record.course_warnings, results.ended)


def _judged(results: Results, name: str, angle: float | None) -> dict[str, tuple[float, str] | None]:
    from yawbench.proving_ground.standard_tests import TESTS
    from yawbench.proving_ground.trace import trace_of

    judged = TESTS[name].evaluate(trace_of(results, name), angle)
    quantities = {
        key: None if quantity.value is None else (quantity.value, quantity.shown_in)
        for key, quantity in judged.quantities.items()
    }
    verdicts = {
        criterion: None if verdict.holds is None else (float(verdict.holds), "1")
        for criterion, verdict in judged.criteria.items()
    }
    return quantities | verdicts


def read_back(folder: Path, run: str | None = None) -> Results | str:
    """Return the results of a completed run, or a sentence that says why there are none.

    Args:
        folder: results folder.
        run: expected id of the run; None: any.
    """
    try:
        results = load_results(folder)
    except ResultsError as error:
        return str(error)
    if run is not None and results.record.id != run:
        return f"{folder}: holds the results of another run than the one just made"
    if results.record.status is RunStatus.COMPLETED:
        return results
    failed = results.record.error
    return f"{folder}: this run ended early: {failed.message if failed else 'no reason recorded'}"


def execute(jobs: Sequence[Job], *, done: OnOutcome = lambda outcome: None, **options: Any) -> list[Outcome]:
    """Execute all jobs in worker processes and return their outcomes in order.

    Args:
        jobs: the runs.
        done: called with each outcome as it arrives, once per job.
        options: see `execute_each`, also for what it raises.
    """
    outcomes: dict[int, Outcome] = {}

    def keep(number: int, outcome: Outcome) -> None:
        outcomes[number] = outcome
        done(outcome)

    execute_each(jobs, keep, **options)
    return [outcomes[number] for number in range(len(jobs))]


def execute_each(
    jobs: Sequence[Job],
    done: Callable[[int, Outcome], None],
    *,
    workers: int | None = None,
    run: Callable[[Job], Any] = run_job,
    pool: Pool | None = None,
    stop: StopFlag | None = None,
) -> None:
    """Execute all jobs in worker processes; as many of them are in memory as are executed at a time.

    A worker keeps the instances of native FMUs for its next run, until a run fails or it has made `LASTING`.
    Runs with other FMUs step in a process that it forks, or if they write no results, are the worker's
    last. A run whose process died is executed again after the others, in a fresh worker that keeps nothing:
    the process may have been killed from outside.

    Args:
        jobs: the runs.
        done: called with the number and the outcome of each job as it arrives, once per job.
        workers: number of processes; None: one per core.
        run: function that a process calls with its job, importable by name. Its return value becomes the
            outcome's value.
        pool: the worker processes, kept by the caller; default: one that ends with the last run.
        stop: requests the end of all runs; default: Ctrl-C and SIGTERM do.

    Raises:
        Interrupted: Ctrl-C or SIGTERM, after all processes have ended; or `stop`.
        YawbenchError: the limit of open files is too low.
    """
    stop = stop or StopFlag()

    def look() -> None:
        if stop.requested:
            raise Interrupted(number=stop.number)

    left: Sequence[int] = range(len(jobs))
    executed: dict[int, Job] = {}

    def calls(keep: bool) -> Iterator[tuple[Job, Callable[[Job], Any], bool]]:
        for place, number in enumerate(left):
            executed[place] = jobs[number]
            yield executed[place], run, keep

    own = nullcontext(pool) if pool else pool_for(jobs, workers)
    with interrupts(stop, lambda: None), own as pool:
        for tries in reversed(range(TRIES)):
            again = []
            for finished in pool.each(_report_of, calls(tries == TRIES - 1), look=look):
                number, outcome = left[finished.number], _outcome(executed.pop(finished.number), finished)
                if outcome.died and tries:
                    again.append(number)
                else:
                    done(number, outcome)
            left = again


def pool_for(jobs: Sequence[Job], workers: int | None = None) -> Pool:
    """Return a pool of worker processes for such jobs.

    Args:
        jobs: what the first of them needs is imported once for all processes.
        workers: number of processes; None: one per core.

    Raises:
        YawbenchError: the limit of open files is too low.
    """
    preload = (*NEEDED, *(FOR_TESTS if any(job.test for job in jobs[:1]) else ()))
    return Pool(workers, preload=preload, lasting=LASTING)


def _outcome(job: Job, finished: Finished) -> Outcome:
    """Return the outcome that the process of a run reported, or how it died."""
    if finished.died:
        lost = Diagnostic("run-process-died", f"the process of this run {finished.died}")
        return Outcome(job, (lost,), 1, finished.seconds, died=True)
    if finished.error is not None:
        raise finished.error
    status, diagnostics, value, interrupted = finished.value
    return Outcome(job, tuple(diagnostics), status, finished.seconds, value, interrupted)


def _report_of(job: Job, run: Callable[[Job], Any], keep: bool) -> tuple[int, list[Diagnostic], Any, bool]:
    """Execute a job in a worker; return exit status, diagnostics, value, and whether it was interrupted.

    Args:
        keep: keep instances for the worker's next run.
    """
    from yawbench.orchestrator.master.fmi import keep_instances

    kept = keep_instances() if keep else None
    report: tuple[int, list[Diagnostic], Any, bool]
    try:
        report = 0, [], run(job), False
    except (YawbenchError, Interrupted) as error:
        report = error.exit_status, error.diagnostics, None, isinstance(error, Interrupted)
    except MemoryError:
        lost = Diagnostic("memory-exhausted", "the memory of this computer does not suffice")
        report = 1, [lost], None, False
    except OSError as error:
        report = (
            1,
            [Diagnostic("results-unwritable", f"{error.filename or job.out}: {reason(error)}")],
            None,
            False,
        )
    except BaseException as error:
        print(printable("".join(traceback.format_exception(error))), file=sys.stderr)
        lost = Diagnostic("internal-error", f"{type(error).__name__}: {error}")
        report = 1, [lost], None, False
    if kept is None or kept.others or report[0]:
        retire()
    return report

"""Forecasts of an experiment: the runs, time and disk space it still needs; writes no results.

The time of a run comes from its last run where its results are recorded, else from short runs of the same
FMUs in a temporary folder: `Pace`. Experiments that depend on results are bounded: a region by its first and
its last look, searches for levels by the shortest and the longest path.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from yawbench.foundation.errors import YawbenchError
from yawbench.foundation.messages import counted, in_bytes
from yawbench.orchestrator.master.simulate import simulate
from yawbench.orchestrator.plan import Plan
from yawbench.orchestrator.results.file_formats import expected_size
from yawbench.orchestrator.results.run_record import RUN_FILE

from .axes import VariantSpec
from .executor import Executor, left_to_do
from .experiment import LoadedExperiment, PlannedExperiment
from .jobs import Job
from .journal import records_in
from .open_value_regions import RegionCell, plan_region
from .tables import Table
from .tuning import middle_of, trials_of, tuning_of

SHORT, LONG = 40, 400
"""Steps of the two short runs whose difference is the time per step; chosen: a tenth of a second."""
MEASURED = 6
"""Largest number of FMU sets that are measured; others take the mean. Chosen: about three seconds."""
LINE = 700
"""Bytes of a run in the journal; measured: 500 to 900 in the rankings and sweeps of scenarios/."""


class Span(NamedTuple):
    """A number that is known between two bounds."""

    least: float = 0.0
    most: float = 0.0

    def plus(self, least: float, most: float | None = None) -> Span:
        """Return the sum with a number, or with another span."""
        return Span(self.least + least, self.most + (least if most is None else most))


@dataclass
class Forecast:
    """Forecast of the runs, time and disk space that an experiment still needs."""

    title: str
    finished: int = 0  # runs that are up to date
    left: Span = field(default_factory=Span)
    seconds: Span = field(default_factory=Span)  # of one processor
    size: Span = field(default_factory=Span)  # bytes
    notes: list[str] = field(default_factory=list)

    def add(self, runs: Span, seconds: float, size: float) -> None:
        """Add runs with the seconds and bytes that each takes."""
        self.left = self.left.plus(*runs)
        self.seconds = self.seconds.plus(runs.least * seconds, runs.most * seconds)
        self.size = self.size.plus(runs.least * size, runs.most * size)


@dataclass
class Pace:
    """Estimates of how long runs take."""

    known: dict[tuple[str, ...], tuple[float, float]] = field(default_factory=dict)
    """SHA-256 of the FMUs -> time [s] of a run without steps, and of a step."""

    def of(self, job: Job) -> float:
        """Return the time of a run [s]."""
        assert job.plan is not None
        return _recorded(job.out) or self.of_plan(job.plan)

    def of_plan(self, plan: Plan) -> float:
        """Return the time of a run [s], from short ones."""
        fmus = tuple(instance.fmu.sha256 for instance in plan.instances)
        if fmus not in self.known:
            if len(self.known) >= MEASURED:
                pairs = [*self.known.values()]
                begin, step = (sum(pair[k] for pair in pairs) / len(pairs) for k in (0, 1))
                return begin + step * plan.n_steps
            self.known[fmus] = _measured(plan)
        begin, step = self.known[fmus]
        return begin + step * plan.n_steps


def _recorded(folder: Path) -> float | None:
    """Return the time that the run in a folder took [s]; None if it is not recorded."""
    try:
        seconds = json.loads((folder / RUN_FILE).read_bytes())["wall_time"]
    except (OSError, ValueError, LookupError, TypeError):
        return None
    return float(seconds) if isinstance(seconds, float) and seconds > 0.0 else None


def _measured(plan: Plan) -> tuple[float, float]:
    """Return the time [s] of a run without steps and of a step, from short runs that are thrown away."""
    times = []
    with tempfile.TemporaryDirectory() as folder:
        for steps in (SHORT, SHORT, LONG):  # the first loads the FMUs
            begun = time.perf_counter()
            try:
                simulate(replace(plan, n_steps=min(steps, plan.n_steps)), Path(folder) / "run")
            except YawbenchError:
                continue  # the run will fail, and take no longer than up to there
            times.append(time.perf_counter() - begun)
    if len(times) < 3 or plan.n_steps <= SHORT:
        return (times[-1] if times else 0.0), 0.0
    step = max(0.0, (times[2] - times[1]) / (min(LONG, plan.n_steps) - SHORT))
    return max(0.0, times[1] - SHORT * step), step


def of_experiment(
    experiment: LoadedExperiment,
    execute: Executor,
    pace: Pace,
    *,
    quick: bool = False,
    keep: bool = False,
) -> Forecast:
    """Return the cost of a study or a sweep.

    Args:
        experiment: as loaded.
        execute: plans its runs.
        pace: of runs.
        quick: without region and repeats.
        keep: keep the results of all runs along axes.

    Raises:
        YawbenchError: a run cannot start.
    """
    experiment = experiment.short if quick and experiment.spec.repeats else experiment
    forecast = Forecast(experiment.spec.title)
    planned = execute.planned(experiment, keep=keep or experiment.spec.keep == "all")
    add_jobs(forecast, planned.jobs, execute, pace, journaled=bool(experiment.spec.axes))
    if experiment.spec.region and not quick:
        _add_region(forecast, planned, execute, pace)
    if experiment.spec.axes and experiment.spec.keep == "limits" and forecast.left.most:
        size = max(expected_size(job.plan, job.format) for job in planned.jobs if job.plan)
        forecast.notes.append(f"runs at limits keep their results, {in_bytes(size)} each")
    return forecast


def add_jobs(
    forecast: Forecast,
    jobs: Sequence[Job],
    execute: Executor,
    pace: Pace,
    *,
    journaled: bool,
) -> None:
    """Add the runs of some jobs that are still to be made; `journaled`: finished ones are in the journal."""
    records = {} if execute.fresh or not journaled else records_in(execute.folder)
    left, finished = left_to_do(jobs, records, again=execute.fresh)
    forecast.finished += finished
    for job in left:
        assert job.plan is not None
        size = LINE * journaled + (expected_size(job.plan, job.format) if job.keep or not journaled else 0)
        forecast.add(Span(1, 1), pace.of(job), size)


def _add_region(forecast: Forecast, planned: PlannedExperiment, execute: Executor, pace: Pace) -> None:
    region = planned.experiment.spec.region
    assert region is not None
    plan = plan_region(planned, execute.folder, planner=execute.planner)
    first, every = set[RegionCell](), set[RegionCell]()
    for (group, _), question in plan.questions.items():
        if group == "claims":
            along = plan.along(question)
            first |= {*along, *plan.cells(question, question.points[: region.looks[0]])}
            every |= {*along, *plan.cells(question, question.points)}
    made = 0 if execute.fresh else len(records_in(execute.folder))
    forecast.finished += min(made, len(every))
    if not every:
        return
    jobs = {case.run.name: job for case, job in zip(planned.experiment.cases, planned.jobs, strict=True)}
    seconds = sum(pace.of(jobs[name]) for name, _ in every) / len(every)
    left = Span(max(0, len(first) - made), max(0, len(every) - made))
    forecast.add(left, seconds, LINE)


def of_tuning(experiment: LoadedExperiment, execute: Executor, pace: Pace) -> Forecast:
    """Return the cost of a tuning; its trials depend on each other, so finished ones are only counted.

    Raises:
        YawbenchError: a run cannot start.
    """
    tuning = tuning_of(experiment)
    forecast = Forecast(experiment.spec.title)
    made = 0 if execute.fresh else len(records_in(execute.folder))
    trials_of_law = tuning.population * tuning.generations
    kinds = [(middle_of(law), trials_of_law, True) for law in tuning.laws.values()]
    for changes, trials, driven in (*kinds, (VariantSpec.model_validate({}), 1, False)):
        tried = trials_of(experiment, {"one": changes}, driven=driven)
        if not tried.runs:
            continue
        jobs = execute.planned(tried).jobs
        runs = trials * len(jobs)
        finished, made = min(made, runs), max(0, made - runs)
        forecast.finished += finished
        seconds = sum(map(pace.of, jobs)) / len(jobs)
        forecast.add(Span(runs - finished, runs - finished), seconds, LINE)
    return forecast


def _between(span: Span, text: Callable[[float], str]) -> str:
    least, most = text(span.least), text(span.most)
    return most if least == most else f"{least} to {most}"


def _duration(seconds: float) -> str:
    """Return a time to two digits in the unit that suits it."""
    for size, unit in ((3600.0, "h"), (60.0, "min")):
        if seconds >= 1.5 * size:
            return f"{float(f'{seconds / size:.2g}'):g} {unit}"
    return f"{float(f'{seconds:.2g}'):g} s"


def forecast_table(forecasts: Iterable[Forecast], workers: int) -> Table:
    """Return a table of what experiments would take; `workers`: number of runs at the same time."""
    columns = ["experiment", "up to date", "to be run", "time", "disk space"]
    table = Table("Nothing is run", columns, numbers={1, 2, 3, 4})
    for forecast in forecasts:
        parallel = max(1, min(workers, int(forecast.left.most)))
        table.rows.append(
            [
                forecast.title,
                str(forecast.finished),
                _between(forecast.left, lambda number: f"{number:.0f}"),
                _between(Span(*(part / parallel for part in forecast.seconds)), _duration),
                _between(forecast.size, in_bytes),
            ]
        )
        table.notes += forecast.notes
    table.notes.append(f"Times are of {counted(workers, 'run')} at once, without planning and drawing.")
    return table

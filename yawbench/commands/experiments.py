"""`yawbench study`, `sweep` and `report`: plan, run, judge and draw experiments; write pages."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from yawbench.commands import json_and_latex
from yawbench.foundation.errors import ScenarioError, YawbenchError
from yawbench.foundation.messages import counted, listed

from .json_and_latex import tabular
from .options import CHANGES, MAKING, RunOptions, executor_of, named, pooled, takes
from .output import print_tables
from .strict_and_junit import judged_experiment, judging
from .terminal_progress import hold, say, say_failed, stoppable

if TYPE_CHECKING:
    from yawbench.figures.display import LabelledRun
    from yawbench.reports.study_page import StudyPage
    from yawbench.reports.viewer_views import View
    from yawbench.studies.dry_run import Forecast, Pace
    from yawbench.studies.executor import Executor
    from yawbench.studies.experiment import LoadedExperiment, PlannedExperiment
    from yawbench.studies.experiment_result import Each, ExperimentResult


def conduct(
    experiment: LoadedExperiment, folder: Path, options: RunOptions, each: Each, **of_jobs: Any
) -> ExperimentResult:
    """Make missing runs, judge them, draw the figures and write all outputs.

    Args:
        experiment: as loaded.
        folder: its results folder.
        options: the options of the command.
        each: `map` used to read results and to draw figures.
        of_jobs: fields of all jobs in place of their defaults.

    Raises:
        YawbenchError: a run cannot start; none has been started.
        typer.Exit: Ctrl-C.
    """
    with stoppable(folder), executor_of(folder, experiment.identity, options, each, **of_jobs) as execute:
        return concluded(experiment, execute, options)


def concluded(experiment: LoadedExperiment, execute: Executor, options: RunOptions) -> ExperimentResult:
    """Return the result of an experiment, drawn and written; see `conduct`."""
    from yawbench.orchestrator.scenario.overrides import changed
    from yawbench.studies.experiment_result import judge_results
    from yawbench.studies.limits import kept_cases
    from yawbench.studies.result_figures import draw_all
    from yawbench.studies.result_files import write_findings

    if options.quick and experiment.spec.repeats:
        experiment = experiment.short
    if experiment.quick:
        say(experiment.quick)
    if experiment.by_options:
        say(f"changed: {changed(experiment.by_options)}")
    try:
        findings = execute(experiment, keep=options.keep or experiment.spec.keep == "all")
        if experiment.spec.axes:
            findings = execute.keeping(findings, kept_cases(findings))
    except YawbenchError:
        if not options.no_run or experiment.spec.axes:
            raise  # scenarios or FMUs are missing, but existing results can be judged without them
        findings = judge_results(experiment, execute.folder, each=execute.each)
    drawn, problems = draw_all(findings, execute.folder, each=execute.each)
    if findings.planned and experiment.spec.region and not options.quick:
        findings = _over_region(findings.planned, findings, execute)
    write_findings(findings, drawn, execute.folder)
    for problem in problems:
        say(problem)
    say_problems(findings)
    return findings


def print_forecasts(options: RunOptions, forecasts: Callable[[Pace], Sequence[Forecast]]) -> None:
    """Print what experiments would take, which `forecasts` returns."""
    import os
    from dataclasses import asdict

    from yawbench.studies.dry_run import Pace, forecast_table

    made = forecasts(Pace())
    json_and_latex.answer(forecasts=[asdict(forecast) for forecast in made])
    print_tables([forecast_table(made, options.jobs or os.cpu_count() or 1)])


def data_of(findings: ExperimentResult, folder: Path) -> dict[str, Any]:
    """Return an experiment's result for programs: how many runs there are, which failed, and its record."""
    from yawbench.studies.result_files import record_of

    runs = {
        "runs": len(findings.records),
        "missing": findings.not_made,
        "failed": {str(words): str(why) for words, why in findings.failed.items()},
    }
    return {"folder": folder, **runs, "record": record_of(findings)}


def say_problems(findings: ExperimentResult) -> None:
    """Print which runs of an experiment are missing or failed, and the warnings about the others."""
    if findings.not_made:
        say(f"{findings.not_made} of {counted(len(findings.records), 'run')} not made yet")
    if findings.spec.axes:  # without axes, failed runs have been reported one by one
        say_failed(findings.failed)
        if remarks := findings.remarkable():
            say(f"note: {remarks}")


def _over_region(
    planned: PlannedExperiment, findings: ExperimentResult, execute: Executor
) -> ExperimentResult:
    """Return the findings with the verdicts over the region added; the journal has the runs already made."""
    from yawbench.studies.executor import left_to_do
    from yawbench.studies.open_value_regions import judge_region, next_jobs, plan_region

    plan = plan_region(planned, execute.folder, planner=execute.planner)
    records = execute.journal.records
    title = f"{planned.experiment.spec.title}, region of the verdicts"
    while True:
        with execute.display.planning(0) as planning:
            more = next_jobs(plan, findings, records, progress=planning)
        if not more:
            break
        if execute.runner is None and (left := left_to_do(more, records)[0]):
            say(f"note: {counted(len(left), 'run')} of the region not made yet; the region is omitted")
            return findings
        execute.run(title, more, journaled=True)
        title = f"{planned.experiment.spec.title}, claims undecided so far at further points"
    jobs = {job.key: job for job in plan.jobs.values()}
    failed = {jobs[key].label: str(records[key].reason) for key in jobs if not records[key].ok}
    say_failed(failed)
    if failed:
        say(f"{len(failed)} of {len(jobs)} runs of the region failed; their verdicts count as different")
    return replace(findings, regions=judge_region(plan, findings, records))


def chapter_of(
    findings: ExperimentResult,
    folder: Path,
    command: str,
    *,
    views: Sequence[View] = (),
    measured: Sequence[LabelledRun] = (),
    each: Each = map,
    **parts: Any,
) -> StudyPage:
    """Return what the page of an experiment in its folder shows; say which runs are out of date.

    `parts`: fields of the page in place of those that every experiment has.
    """
    from yawbench.orchestrator.results.freshness import staleness
    from yawbench.orchestrator.results.run_record import RUN_FILE
    from yawbench.reports.study_page import chapter

    jobs = findings.planned.jobs if findings.planned and not findings.spec.axes else []
    stale = {
        job.label: why
        for job in jobs
        if job.plan and (job.out / RUN_FILE).is_file() and (why := staleness(job.plan, job.out))
    }
    with stoppable(folder):
        page = chapter(
            findings, command=command, stale=stale, folder=folder, views=views, measured=measured, each=each
        )
    for name, why in stale.items():
        say(f"{name}: out of date: {why}")
    return replace(page, **parts)


def command_of(preset: str, path: Path, *, quick: bool = False, **options: Iterable[object] | None) -> str:
    """Return the command line that repeats an experiment; `options`: name -> values given."""
    import shlex

    flags = ["--quick"] if quick else []
    pairs = [(f"--{name}", str(value)) for name, values in options.items() for value in values or ()]
    return shlex.join(["yawbench", preset, str(path), *flags, *itertools.chain.from_iterable(pairs)])


def write_page(view: StudyPage, folder: Path) -> Path:
    """Write the page of an experiment into its folder; return its path."""
    from yawbench.foundation.safe_files import write_whole
    from yawbench.reports.page_parts import PAGE, render

    page = folder / PAGE
    write_whole(page, render(view))
    json_and_latex.answer(page=page)
    return page


def say_page(page: Path) -> None:
    """Print the path of a page and its size."""
    say(f"The page: {page} ({page.stat().st_size / 1e6:.1f} MB)")


def write_overview(chapters: Sequence[StudyPage], pages: Sequence[Path], folder: Path) -> Path:
    """Write the overview of several experiments into a folder; return its path."""
    import os

    from yawbench.foundation.safe_files import write_whole
    from yawbench.reports.overview_page import overview_page
    from yawbench.reports.page_parts import PAGE, RANKING

    def address(page: Path) -> str:
        return Path(os.path.relpath(page, folder)).as_posix()

    page = folder / PAGE
    ranking = address(RANKING) if RANKING.is_file() else ""
    write_whole(page, overview_page(chapters, [*map(address, pages)], folder, ranking))
    json_and_latex.answer(page=page)
    return page


def of_files(context: typer.Context, files: Sequence[Path], options: RunOptions) -> None:
    """Conduct the experiments of files; the tables of a single one are printed, all go to one page.

    Raises:
        YawbenchError: a file or a run of it is invalid.
        typer.Exit: a run failed.
    """
    import os

    from yawbench.orchestrator.results.folder_names import default_folder, names_of
    from yawbench.studies.load_experiment import load_experiment
    from yawbench.studies.result_tables import all_tables, counts_of, reach, tally_words

    changes, out = options.changes, options.out
    experiments = [load_experiment(file, changes=changes) for file in files]
    if tuned := [str(experiment.path) for experiment in experiments if experiment.spec.tuning]:
        raise ScenarioError(
            [f"{file}: a tuning file; use `yawbench tune`" for file in tuned], code="file-wrong-kind"
        )
    if out is None:
        folders = [default_folder(file, changes) for file in files]
        page = folders[0] if len(folders) == 1 else Path(os.path.commonpath(folders))
    else:
        page = out
        below = [out.joinpath(*names_of(file)) for file in files]
        folders = [out] if len(files) == 1 else below
    for folder in dict.fromkeys(folders):
        if len(sharing := [str(f) for f, of in zip(files, folders, strict=True) if of == folder]) > 1:
            raise ScenarioError(
                f"{listed(sharing, last='and')} would share the results folder {folder}; name them apart, or "
                "report on them one by one, with --out",
                code="name-duplicate",
            )
    if options.dry_run:
        from yawbench.studies.dry_run import of_experiment

        executors = [
            executor_of(folder, experiment.identity, options)
            for experiment, folder in zip(experiments, folders, strict=True)
        ]
        print_forecasts(
            options,
            lambda pace: [
                of_experiment(experiment, execute, pace, quick=options.quick, keep=options.keep)
                for experiment, execute in zip(experiments, executors, strict=True)
            ],
        )
        return
    hold(context, *folders)
    each = pooled(context, options)
    chapters, pages, conducted, failed = [], [], [], False
    for experiment, folder in zip(experiments, folders, strict=True):
        findings = conduct(experiment, folder, options, each)
        command = command_of(
            "study" if experiment.spec.runs else "sweep",
            experiment.path,
            quick=options.quick and (experiment.spec.region is not None or bool(experiment.spec.repeats)),
            **options.changing,
        )
        chapters.append(chapter_of(findings, folder, command, each=each))
        pages.append(write_page(chapters[-1], folder))
        conducted.append(data_of(findings, folder))
        judged_experiment(findings)
        failed = failed or bool(findings.failed) or bool(findings.not_made)
        if len(files) == 1:
            print_tables(all_tables(findings))
        if verdicts := tally_words(counts_of(findings.claims)):
            where = reach(findings)
            say(f"{experiment.spec.title}: {verdicts}" + f" ({where})" * bool(where))
    say_page(pages[0] if len(pages) == 1 else write_overview(chapters, pages, page))
    json_and_latex.answer(experiments=conducted)
    if failed:
        raise typer.Exit(1)


StudyFile = Annotated[
    Path, named("a study file", help="Study: YAML file, or a name in scenarios/.", metavar="STUDY")
]


@tabular
@judging
@takes(*CHANGES, *MAKING, "jobs", "scheduler", "format_", "quick", "fresh", "no_run", "dry_run")
def study(context: typer.Context, file: StudyFile, options: RunOptions) -> None:
    """Run a study: tables, figures, a verdict per claim.

    Start reading at report.html. Without --out, results go to results/<folder of the study>/<its name>. Runs
    are made by worker processes; a run that fails is listed in the table, the others continue. Runs
    already made from the same scenario, FMUs and program version are not repeated. If the file
    has a region, claims are also judged over the open values there: how robust each verdict is.
    """
    of_files(context, [file], options)


SweepFile = Annotated[
    Path, named("a sweep file", help="Sweep: YAML file, or a name in scenarios/.", metavar="SWEEP")
]


@tabular
@judging
@takes(*CHANGES, *MAKING, "jobs", "scheduler", "keep", "format_", "fresh", "no_run", "dry_run")
def sweep(context: typer.Context, file: SweepFile, options: RunOptions) -> None:
    """Run a scenario over a grid, a list, or a sample of distributions.

    Writes report.html with tables, limits, curves and maps of the metrics; table.csv and table.parquet,
    one row per run; figures. Without --out, results go to results/<folder of the sweep file>/<its name>.
    Runs are made by worker processes. An interrupted sweep is resumed; finished runs are not repeated.
    """
    of_files(context, [file], options)


Studies = Annotated[
    list[Path] | None,
    named("a study file", help="Studies: YAML files, or names; default: all in scenarios/.", metavar="STUDY"),
]


@tabular
@judging
@takes(*MAKING, "jobs", "format_", "quick", "fresh", "no_run", "dry_run")
def report(context: typer.Context, options: RunOptions, studies: Studies = None) -> None:
    """Write the pages that reproduce the papers.

    Per study report.html, a single file: verdicts, runs, system, tables, parameters and their sources,
    with the figures beside it as SVG and PNG. Of several studies also an overview, which shows the runs
    of every claim. Runs whose results are missing or out of date are made first. Without --out, pages go
    to the studies' folders below results/, the overview to results/. All studies in scenarios/ take four
    to seven minutes on two cores; --quick omits the regions.
    """
    from yawbench.studies.load_experiment import found_studies

    paths = list(dict.fromkeys(studies or found_studies()))
    of_files(context, paths, options)

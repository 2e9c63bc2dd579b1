"""The course of every command that makes the runs of an experiment: plan, make, judge, draw, write."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ..wording import counted, listed
from .batch import bar, hold, reported, say, stoppable

if TYPE_CHECKING:
    from ..experiments.experiment import Experiment
    from ..experiments.findings import Findings
    from ..experiments.jobs import Once
    from ..experiments.planning import Planned
    from ..plan import Change

SHOWN = 10
"""Failed runs named on the terminal; all are in the table."""


@dataclass(frozen=True)
class Wishes:
    """What the options of a command ask for, apart from the experiment itself."""

    fmus: Path | None = None
    build: bool = True
    workers: int | None = None
    scheduler: str | None = None
    format: str = "csv"
    call_limit: float | None = None
    keep: bool = False
    fresh: bool = False
    no_run: bool = False
    quick: bool = False  # no regions


def conduct(experiment: Experiment, folder: Path, wishes: Wishes, **of_jobs: Any) -> Findings:
    """Make the runs that have not been made already, judge them, draw the figures and write it all down.

    Args:
        experiment: as loaded.
        folder: of its results.
        wishes: of the user.
        of_jobs: fields of all jobs in place of their defaults.

    Raises:
        YawbenchError: a run cannot start; none has been.
        typer.Exit: Ctrl-C.
    """
    from dataclasses import replace

    from ..errors import YawbenchError
    from ..experiments.figures import draw_all
    from ..experiments.findings import judge_results
    from ..experiments.jobs import Once
    from ..experiments.planning import jobs_of, plan_experiment
    from ..experiments.record import write_findings
    from ..experiments.workers import pool
    from ..fmu.opener import stale_fmus
    from ..titles import changed

    if wishes.quick and experiment.spec.repeats:
        experiment = experiment.short
    jobs = jobs_of(
        experiment, folder, wishes.fmus, keep=wishes.keep, format=wishes.format, call_limit=wishes.call_limit
    )
    jobs = [replace(job, **of_jobs) for job in jobs]
    planned: Planned | None = None
    once = Once(build=wishes.build and not wishes.no_run)
    with stoppable(folder):
        try:
            with bar("planning", len(jobs), quiet=True) as planning:
                planned = plan_experiment(experiment, jobs, once=once, progress=planning)
        except YawbenchError:
            if not wishes.no_run or experiment.spec.axes:
                raise  # else scenarios or FMUs are not here: results can be judged without them
        if planned:
            experiment = planned.experiment
            for note in stale_fmus(planned.fmus.values()):
                say(f"note: {note}")
        if experiment.by_options:
            say(f"changed: {changed(experiment.by_options)}")
        with pool(wishes.workers) as workers:
            if experiment.spec.axes:
                assert planned is not None
                findings = _along_axes(planned, folder, wishes)
            else:
                outcomes = _named(planned, wishes) if planned and not wishes.no_run else []
                findings = judge_results(experiment, folder, outcomes, planned=planned, each=workers.map)
            drawn, problems = draw_all(findings, folder, each=workers.map)
        if planned and experiment.spec.region and not wishes.quick:
            findings = _over_region(planned, findings, folder, wishes, once)
        write_findings(findings, drawn, folder)
    for problem in problems:
        say(problem)
    failed = findings.failed if experiment.spec.axes else {}  # the others have been named as they failed
    for words, why in list(failed.items())[:SHOWN]:
        say(f"{words} failed: {why}")
    if len(failed) > SHOWN:
        say(f"{len(failed) - SHOWN} more failed")
    if experiment.spec.axes and (found := findings.remarkable()):
        say(f"note: {found}")
    return findings


def _along_axes(planned: Planned, folder: Path, wishes: Wishes) -> Findings:
    """Make the runs of cases along axes that are left; a journal knows of those that are finished."""
    from ..experiments.execution import finish, left_to_do, runner_of
    from ..experiments.findings import judge_records
    from ..experiments.journal import Journal

    experiment = planned.experiment
    runner = runner_of(planned.fmus, wishes.workers, wishes.scheduler)
    with contextlib.closing(Journal(folder, experiment.identity, fresh=wishes.fresh)) as journal:
        left = [] if wishes.no_run else left_to_do(planned.jobs, journal.records)
        total = len({job.key for job in planned.jobs})
        _announce(experiment.spec.title, len(planned.jobs), total - len(left), total)
        with reported(experiment.path.stem, total, total - len(left), each=False) as told:
            finish(left, journal, runner=runner, told=told)
        return judge_records(planned, journal.records)


def _named(planned: Planned, wishes: Wishes) -> Sequence[Any]:
    """Make the named runs that are left; what has been made already stands in their folders."""
    from ..experiments.execution import left_to_do, runner_of

    left = planned.jobs if wishes.fresh else left_to_do(planned.jobs, {})
    runner = runner_of(planned.fmus, wishes.workers, wishes.scheduler)
    total = len(planned.jobs)
    _announce(planned.experiment.spec.title, total, total - len(left), total)
    outcomes: list[Any] = []
    with reported(planned.experiment.path.stem, len(left)) as told:

        def done(outcome: Any) -> None:
            outcomes.append(outcome)
            told(outcome)

        runner(left, done)
    return outcomes


def _over_region(planned: Planned, findings: Findings, folder: Path, wishes: Wishes, once: Once) -> Findings:
    """Return the findings with what becomes of their verdicts over the region; the journal knows its runs."""
    from dataclasses import replace

    from ..experiments.execution import finish, left_to_do, runner_of
    from ..experiments.journal import Journal
    from ..experiments.region import judge_region, plan_region

    experiment = planned.experiment
    with bar("planning", 0, quiet=True) as planning:
        plan = plan_region(planned, folder, once=once, progress=planning)
    jobs = {job.key: job for job in plan.jobs.values()}
    used = {unit.fmu.sha256: unit.fmu for job in jobs.values() if job.plan for unit in job.plan.units}
    runner = runner_of(used, wishes.workers, wishes.scheduler)
    with contextlib.closing(Journal(folder, experiment.identity, fresh=wishes.fresh)) as journal:
        left = left_to_do(list(jobs.values()), journal.records)
        if left and wishes.no_run:
            say(f"note: {counted(len(left), 'run')} of the region not made yet; it is left out")
            return findings
        total = len(jobs)
        _announce(f"{experiment.spec.title}, region of its verdicts", total, total - len(left), total)
        with reported(f"{experiment.path.stem}, region", total, total - len(left), each=False) as told:
            finish(left, journal, runner=runner, told=told)
        failed = [key for key in jobs if not journal.records[key].ok]
        for key in failed[:SHOWN]:
            say(f"{jobs[key].label} failed: {journal.records[key].reason}")
        if failed:
            say(f"{len(failed)} of {total} runs of the region failed; they count as another verdict")
        return replace(findings, regions=judge_region(plan, findings, journal.records))


def _announce(title: str, runs: int, done: int, total: int) -> None:
    """Say how many runs there are, and how many of all that differ are finished."""
    before = "" if not done else ", all finished before" if done == total else f", {done} finished before"
    say(f"{title}: {counted(runs, 'run')}{before}")


def chapter_of(
    findings: Findings, folder: Path, command: str, *, shown_in: Path, **more: Any
) -> dict[str, Any]:
    """Return the chapter of an experiment in a page that lies in a folder; `more`: facts of its own."""
    from ..experiments.execution import stale
    from ..experiments.workers import pool
    from ..pages.chapter import chapter
    from ..results.folder import RUN_FILE

    jobs = findings.planned.jobs if findings.planned and not findings.spec.axes else []
    out_of_date = stale([job for job in jobs if (job.out / RUN_FILE).is_file()])
    with stoppable(folder), pool() as workers:
        facts = chapter(
            findings, command=command, stale=out_of_date, folder=folder, shown_in=shown_in, each=workers.map
        )
    for name, why in out_of_date.items():
        say(f"{name}: not what a run would give now: {why}")
    return facts | {"comparison": None, "results": []} | more


def command_of(preset: str, path: Path, *, quick: bool = False, **options: Iterable[object] | None) -> str:
    """Return the command line that makes an experiment again; `options`: name -> what it was given."""
    import shlex

    flags = ["--quick"] if quick else []
    given = [(f"--{name}", str(value)) for name, values in options.items() for value in values or ()]
    return shlex.join(["yawbench", preset, str(path), *flags, *itertools.chain.from_iterable(given)])


def write_page(chapters: Sequence[dict[str, Any]], folder: Path) -> None:
    """Write the page of chapters into a folder and say where it is."""
    import os

    from ..pages.report import PAGE, RANKING, report_page
    from ..writing import write_whole

    page = folder / PAGE
    ranking = Path(os.path.relpath(RANKING, folder)).as_posix() if RANKING.is_file() else ""
    write_whole(page, report_page(chapters, ranking))
    say(f"The page: {page} ({page.stat().st_size / 1e6:.1f} MB)")


def of_files(
    context: typer.Context,
    files: Sequence[Path],
    changes: Sequence[Change],
    out: Path | None,
    wishes: Wishes,
) -> None:
    """Conduct the experiments of files; tables of a single one go to the terminal, all to one page.

    Raises:
        YawbenchError: a file or a run of it is wrong.
        typer.Exit: a run failed.
    """
    import os

    from ..errors import ScenarioError
    from ..experiments.experiment import load_experiment
    from ..experiments.verdicts import all_tables, counts_of
    from ..results.formats import check_format
    from ..results.naming import default_folder
    from .batch import print_tables

    if wishes.fresh and wishes.no_run:
        raise ScenarioError("--fresh and --no-run contradict each other")
    check_format(wishes.format)
    experiments = [load_experiment(file, changes=changes) for file in files]
    if tuned := [str(one.path) for one in experiments if one.spec.tuning]:
        raise ScenarioError([f"{file}: a tuning file; it is for `yawbench tune`" for file in tuned])
    folders = [default_folder(file, changes) for file in files]
    page = out or (folders[0] if len(folders) == 1 else Path(os.path.commonpath(folders)))
    if out is not None:
        below = [out / file.absolute().parent.name / file.stem for file in files]
        folders = [out] if len(files) == 1 else below
    for folder in dict.fromkeys(folders):
        if len(sharing := [str(f) for f, of in zip(files, folders, strict=True) if of == folder]) > 1:
            raise ScenarioError(
                f"{listed(sharing, last='and')} would share the results folder {folder}; name them apart, or "
                "report on them one by one, with --out"
            )
    hold(context, *folders)
    chapters, failed = [], False
    for experiment, folder in zip(experiments, folders, strict=True):
        findings = conduct(experiment, folder, wishes)
        command = command_of(
            "study" if experiment.spec.runs else "sweep",
            experiment.path,
            quick=wishes.quick and (experiment.spec.region is not None or bool(experiment.spec.repeats)),
            swap=[f"{one.place}={one.value}" for one in changes if one.swaps],
            set=[f"{one.place}={one.value}" for one in changes if not (one.swaps or one.faulty)],
            fault=[f"{one.faulty}: {one.value}" for one in changes if one.faulty],
        )
        chapters.append(chapter_of(findings, folder, command, shown_in=page))
        failed = failed or bool(findings.failed)
        if len(files) == 1:
            print_tables(all_tables(findings))
        counts = counts_of(findings.claims, "claims")
        if verdicts := ", ".join(f"{word}: {count}" for word, count in counts.items()):
            say(f"{experiment.spec.title}: {verdicts}")
    write_page(chapters, page)
    if failed:
        raise typer.Exit(1)

"""The course of every command that makes the runs of an experiment: plan, make, judge, draw, write."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ..wording import counted, listed
from .batch import bar, hold, make, pooled, say, say_failed, stoppable
from .options import Wishes

if TYPE_CHECKING:
    from ..experiments.experiment import Experiment
    from ..experiments.findings import Each, Findings
    from ..experiments.jobs import Once
    from ..experiments.planning import Planned


def conduct(experiment: Experiment, folder: Path, wishes: Wishes, each: Each, **of_jobs: Any) -> Findings:
    """Make the runs that have not been made already, judge them, draw the figures and write it all down.

    Args:
        experiment: as loaded.
        folder: of its results.
        wishes: of the user.
        each: how to read the results of all runs, and how to draw all figures.
        of_jobs: fields of all jobs in place of their defaults.

    Raises:
        YawbenchError: a run cannot start; none has been.
        typer.Exit: Ctrl-C.
    """
    from ..errors import YawbenchError
    from ..experiments.figures import draw_all
    from ..experiments.findings import judge_records, judge_results
    from ..experiments.jobs import Once
    from ..experiments.journal import Journal
    from ..experiments.planning import plan_experiment
    from ..experiments.record import write_findings
    from ..fmu.opener import stale_fmus
    from ..titles import changed

    if wishes.quick and experiment.spec.repeats:
        experiment = experiment.short
    planned: Planned | None = None
    once = Once(build=wishes.build)
    with stoppable(folder):
        try:
            with bar("planning", len(experiment.cases), quiet=True) as planning:
                planned = plan_experiment(
                    experiment, folder, once=once, progress=planning, keep=wishes.keep,
                    **wishes.of_jobs | of_jobs,
                )  # fmt: skip
        except YawbenchError:
            if not wishes.no_run or experiment.spec.axes:
                raise  # else scenarios or FMUs are not here: results can be judged without them
        if planned:
            experiment = planned.experiment
            for note in stale_fmus(planned.fmus.values()):
                say(f"note: {note}")
        if experiment.by_options:
            say(f"changed: {changed(experiment.by_options)}")
        if planned and experiment.spec.axes:
            with contextlib.closing(Journal(folder, experiment.identity, fresh=wishes.fresh)) as journal:
                make(experiment.spec.title, planned.jobs, wishes, journal)
                findings = judge_records(planned, journal.records)
        else:
            outcomes = make(experiment.spec.title, planned.jobs, wishes) if planned else []
            findings = judge_results(experiment, folder, outcomes, planned=planned, each=each)
        drawn, problems = draw_all(findings, folder, each=each)
        if planned and experiment.spec.region and not wishes.quick:
            findings = _over_region(planned, findings, folder, wishes, once)
        write_findings(findings, drawn, folder)
    for problem in problems:
        say(problem)
    if findings.not_made:
        say(f"{findings.not_made} of {counted(len(findings.records), 'run')} not made yet")
    if experiment.spec.axes:  # others have been named as they failed
        say_failed(findings.failed)
        if found := findings.remarkable():
            say(f"note: {found}")
    return findings


def _over_region(planned: Planned, findings: Findings, folder: Path, wishes: Wishes, once: Once) -> Findings:
    """Return the findings with what becomes of their verdicts over the region; the journal knows its runs."""
    from ..experiments.execution import left_to_do
    from ..experiments.journal import Journal
    from ..experiments.region import judge_region, plan_region

    experiment = planned.experiment
    with bar("planning", 0, quiet=True) as planning:
        plan = plan_region(planned, folder, once=once, progress=planning)
    jobs = {job.key: job for job in plan.jobs.values()}
    with contextlib.closing(Journal(folder, experiment.identity, fresh=wishes.fresh)) as journal:
        if wishes.no_run and (left := left_to_do(list(jobs.values()), journal.records)):
            say(f"note: {counted(len(left), 'run')} of the region not made yet; it is left out")
            return findings
        make(f"{experiment.spec.title}, region of its verdicts", list(jobs.values()), wishes, journal)
        records = journal.records
    failed = {jobs[key].label: str(records[key].reason) for key in jobs if not records[key].ok}
    say_failed(failed)
    if failed:
        say(f"{len(failed)} of {len(jobs)} runs of the region failed; they count as another verdict")
    return replace(findings, regions=judge_region(plan, findings, records))


def chapter_of(
    findings: Findings, folder: Path, command: str, each: Each, *, shown_in: Path, **more: Any
) -> dict[str, Any]:
    """Return the chapter of an experiment in a page that lies in a folder; `more`: facts of its own."""
    from ..pages.chapter import chapter
    from ..results.folder import RUN_FILE
    from ..results.freshness import staleness

    jobs = findings.planned.jobs if findings.planned and not findings.spec.axes else []
    out_of_date = {
        job.label: why
        for job in jobs
        if job.plan and (job.out / RUN_FILE).is_file() and (why := staleness(job.plan, job.out))
    }
    with stoppable(folder):
        facts = chapter(
            findings, command=command, stale=out_of_date, folder=folder, shown_in=shown_in, each=each
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


def of_files(context: typer.Context, files: Sequence[Path], wishes: Wishes) -> None:
    """Conduct the experiments of files; tables of a single one go to the terminal, all to one page.

    Raises:
        YawbenchError: a file or a run of it is wrong.
        typer.Exit: a run failed.
    """
    import os

    from ..errors import ScenarioError
    from ..experiments.experiment import load_experiment
    from ..experiments.verdicts import all_tables, counts_of, reach, tally_words
    from ..results.naming import default_folder, names_of
    from .batch import print_tables

    changes, out = wishes.changes, wishes.out
    experiments = [load_experiment(file, changes=changes) for file in files]
    if tuned := [str(one.path) for one in experiments if one.spec.tuning]:
        raise ScenarioError([f"{file}: a tuning file; it is for `yawbench tune`" for file in tuned])
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
                "report on them one by one, with --out"
            )
    hold(context, *folders)
    each = pooled(context, wishes)
    chapters, failed = [], False
    for experiment, folder in zip(experiments, folders, strict=True):
        findings = conduct(experiment, folder, wishes, each)
        command = command_of(
            "study" if experiment.spec.runs else "sweep",
            experiment.path,
            quick=wishes.quick and (experiment.spec.region is not None or bool(experiment.spec.repeats)),
            **wishes.changing,
        )
        chapters.append(chapter_of(findings, folder, command, each, shown_in=page))
        failed = failed or bool(findings.failed) or bool(findings.not_made)
        if len(files) == 1:
            print_tables(all_tables(findings))
        if verdicts := tally_words(counts_of(findings.claims)):
            where = reach(findings)
            say(f"{experiment.spec.title}: {verdicts}" + f" ({where})" * bool(where))
    write_page(chapters, page)
    if failed:
        raise typer.Exit(1)

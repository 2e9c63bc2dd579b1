"""`yawbench report`: one page that reproduces the papers."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from .batch import Jobs
from .options import CallLimit, Fmus, Format, Isolate, NoBuild, isolation, named

Studies = Annotated[
    list[Path] | None,
    named("a study file", help="Studies: YAML files, or names; default: all in scenarios/.", metavar="STUDY"),
]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder for the page, with results and figures below it."),
]
Again = Annotated[bool, typer.Option("--again", help="Make all runs again, also those with good results.")]
NoRun = Annotated[
    bool, typer.Option("--no-run", help="Run and build nothing: report what stands in the results.")
]


def report(
    context: typer.Context,
    studies: Studies = None,
    out: Out = None,
    fmus: Fmus = None,
    no_build: NoBuild = False,
    jobs: Jobs = None,
    format_: Format = "csv",
    again: Again = False,
    no_run: NoRun = False,
    isolate: Isolate = False,
    call_limit: CallLimit = None,
) -> None:
    """Write one page that reproduces the papers.

    report.html: per study the system, parameters and their source, figures, tables, verdicts. One
    file that needs no server; figures lie beside it as SVG and PNG. Runs whose results are missing,
    or were made from another scenario or FMU, are made first. Without --out, the page of one study
    lies in its folder below results/, that of several in results/.
    """
    from ..errors import ScenarioError
    from ..fmu.opener import stale_fmus
    from ..pages.chapter import chapter
    from ..pages.report import PAGE, found_studies, report_page, still_stale, wanted
    from ..results.formats import check_format
    from ..results.naming import default_folder
    from ..studies.jobs import Outcome, pool
    from ..studies.study import all_tables, judge_study
    from ..studies.study_report import write_study
    from ..wording import counted
    from ..writing import write_whole
    from .batch import hold, print_tables, run_all, say, stoppable

    if again and no_run:
        raise ScenarioError("--again and --no-run contradict each other")
    check_format(format_)
    limit = isolation(isolate, call_limit)
    paths = list(dict.fromkeys(studies or found_studies()))
    folders = [default_folder(path) for path in paths]
    page_folder = out or (folders[0] if len(folders) == 1 else Path(os.path.commonpath(folders)))
    if out is not None:
        below = [out / path.absolute().parent.name / path.stem for path in paths]
        folders = [out] if len(paths) == 1 else below
    hold(context, *folders)
    every = [
        wanted(path, folder, fmus=fmus, format=format_, call_limit=limit, build=not (no_build or no_run))
        for path, folder in zip(paths, folders, strict=True)
    ]
    if no_run:
        for note in stale_fmus(u.fmu for one in every for _, plan in one.plans.values() for u in plan.units):
            say(f"note: {note}")
    chapters, failed = [], False
    for one in every:
        work = [job for name, job in one.jobs.items() if again or name in one.stale]
        outcomes: list[Outcome] = []
        if not no_run:
            good = len(one.jobs) - len(work)
            say(f"{one.study.spec.title}: {counted(len(work), 'run')} to make, {good} with good results")
            outcomes = run_all(work, one.folder, workers=jobs, build=not no_build) if work else []
        with stoppable(one.folder), pool(jobs) as workers:
            findings = judge_study(one.study, one.folder, outcomes, each=workers.map)
            for problem in write_study(findings, one.folder, each=workers.map):
                say(problem)
            facts = chapter(
                findings, one.plans, still_stale(one), folder=one.folder, shown_in=page_folder,
                each=workers.map,
            )  # fmt: skip
        chapters.append(facts)
        failed = failed or bool(findings.failed)
        if len(every) == 1:
            print_tables(all_tables(findings))
        verdicts = ", ".join(f"{word}: {count}" for word, count in facts["counts"].items())
        say(f"{one.study.spec.title}: {verdicts or 'no claims of its own'}")
    page = page_folder / PAGE
    write_whole(page, report_page(chapters))
    say(f"The report: {page} ({page.stat().st_size / 1e6:.1f} MB)")
    if failed:
        raise typer.Exit(1)

"""`yawbench study`: run all that a study file names and judge its claims."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .batch import Jobs
from .options import CallLimit, Fmus, Format, Isolate, NoBuild, Out, isolation, named

StudyFile = Annotated[
    Path, named("a study file", help="Study: YAML file, or a name in scenarios/.", metavar="STUDY")
]
NoRun = Annotated[
    bool, typer.Option("--no-run", help="Run nothing: judge and draw what stands in the results folder.")
]


def study(
    context: typer.Context,
    file: StudyFile,
    out: Out = None,
    fmus: Fmus = None,
    no_build: NoBuild = False,
    jobs: Jobs = None,
    format_: Format = "csv",
    no_run: NoRun = False,
    isolate: Isolate = False,
    call_limit: CallLimit = None,
) -> None:
    """Run a study: tables, figures, a verdict per claim.

    Without --out, results go to results/<folder of the study>/<its name>. Every run has a process
    of its own; one that fails is named in the table and takes no other with it.
    """
    from dataclasses import replace

    from ..results.formats import check_format
    from ..results.naming import default_folder
    from ..studies.jobs import Outcome, pool
    from ..studies.study import all_tables, judge_study
    from ..studies.study_file import load_study
    from ..studies.study_report import REPORT, write_study
    from .batch import hold, print_tables, run_all, say, stoppable

    check_format(format_)
    limit = isolation(isolate, call_limit)
    loaded = load_study(file)
    folder = out or default_folder(file)
    hold(context, folder)
    outcomes: list[Outcome] = []
    if not no_run:
        made = [run.job(folder, fmus) for run in loaded.runs.values()]
        work = [replace(job, format=format_, call_limit=limit) for job in made]
        outcomes = run_all(work, folder, workers=jobs, build=not no_build)
    with stoppable(folder), pool(jobs) as workers:
        findings = judge_study(loaded, folder, outcomes, each=workers.map)
        problems = write_study(findings, folder, each=workers.map)
    for problem in problems:
        say(problem)
    print_tables(all_tables(findings))
    if no_run:
        for name, why in _stale(file, folder, fmus, build=not no_build).items():
            say(f"{name}: not what a run would give now: {why}")
    say(f"Results, figures and tables: {folder} (begin with {folder / REPORT})")
    if findings.failed:
        raise typer.Exit(1)


def _stale(file: Path, folder: Path, fmus: Path | None, *, build: bool) -> dict[str, str]:
    """Return run -> why its results are not those of a run made now, as far as that can be told."""
    from ..errors import YawbenchError
    from ..pages.report import still_stale, wanted

    try:
        return still_stale(wanted(file, folder, fmus=fmus, format="csv", build=build))
    except YawbenchError:  # scenarios or FMUs are not here: results can be judged without them
        return {}

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
    bool,
    typer.Option("--no-run", help="Run and build nothing: judge and draw what stands in the results folder."),
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
        for sentence in _stale(file, folder, fmus):
            say(sentence)
    say(f"Results, figures and tables: {folder} (begin with {folder / REPORT})")
    if findings.failed:
        raise typer.Exit(1)


def _stale(file: Path, folder: Path, fmus: Path | None) -> list[str]:
    """Return sentences on what would be other if it were run now, as far as that can be told."""
    from ..errors import YawbenchError
    from ..fmu.opener import stale_fmus
    from ..pages.report import still_stale, wanted

    try:
        found = wanted(file, folder, fmus=fmus, format="csv")
    except YawbenchError:  # scenarios or FMUs are not here: results can be judged without them
        return []
    stale = stale_fmus(unit.fmu for _, plan in found.plans.values() for unit in plan.units)
    return [
        *(f"{name}: not what a run would give now: {why}" for name, why in still_stale(found).items()),
        *(f"note: {sentence}" for sentence in stale),
    ]

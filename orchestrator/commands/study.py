"""`yawbench study`: run all that a study file names and judge its claims."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .batch import Jobs
from .experiment import Wishes, of_files
from .options import (
    CallLimit,
    Fault,
    Fmus,
    Format,
    Fresh,
    Isolate,
    NoBuild,
    NoRun,
    Out,
    Quick,
    Scheduler,
    Set,
    Swap,
    isolation,
    named,
)

StudyFile = Annotated[
    Path, named("a study file", help="Study: YAML file, or a name in scenarios/.", metavar="STUDY")
]


def study(
    context: typer.Context,
    file: StudyFile,
    swap: Swap = None,
    set_: Set = None,
    fault: Fault = None,
    out: Out = None,
    fmus: Fmus = None,
    no_build: NoBuild = False,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    format_: Format = "csv",
    quick: Quick = False,
    fresh: Fresh = False,
    no_run: NoRun = False,
    isolate: Isolate = False,
    call_limit: CallLimit = None,
) -> None:
    """Run a study: tables, figures, a verdict per claim.

    Begin with report.html. Without --out, results go to results/<folder of the study>/<its name>. Every
    run has a process of its own; one that fails is named in the table and takes no other with it. Runs
    that have been made already, of the same scenario, FMUs and program, are not made again. If the file
    has a region, claims are also judged over the open values there: how far each verdict carries.
    """
    from ..scenario.overrides import read_changes

    wishes = Wishes(
        fmus,
        not no_build,
        jobs,
        scheduler,
        format_,
        isolation(isolate, call_limit),
        fresh=fresh,
        no_run=no_run,
        quick=quick,
    )
    of_files(context, [file], read_changes(swap or (), set_ or (), fault or ()), out, wishes)

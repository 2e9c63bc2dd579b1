"""`yawbench study`: run all that a study file names and judge its claims."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .experiment import of_files
from .options import CHANGES, MAKING, Wishes, named, takes

StudyFile = Annotated[
    Path, named("a study file", help="Study: YAML file, or a name in scenarios/.", metavar="STUDY")
]


@takes(*CHANGES, *MAKING, "jobs", "scheduler", "format_", "quick", "fresh", "no_run")
def study(context: typer.Context, file: StudyFile, wishes: Wishes) -> None:
    """Run a study: tables, figures, a verdict per claim.

    Begin with report.html. Without --out, results go to results/<folder of the study>/<its name>. Every
    run has a process of its own; one that fails is named in the table and takes no other with it. Runs
    that have been made already, of the same scenario, FMUs and program, are not made again. If the file
    has a region, claims are also judged over the open values there: how far each verdict carries.
    """
    of_files(context, [file], wishes)

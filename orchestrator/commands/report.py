"""`yawbench report`: one page that reproduces the papers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .batch import Jobs
from .experiment import Wishes, of_files
from .options import CallLimit, Fmus, Format, Fresh, Isolate, NoBuild, NoRun, Quick, isolation, named

Studies = Annotated[
    list[Path] | None,
    named("a study file", help="Studies: YAML files, or names; default: all in scenarios/.", metavar="STUDY"),
]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder for the page, with results and figures below it."),
]


def report(
    context: typer.Context,
    studies: Studies = None,
    out: Out = None,
    fmus: Fmus = None,
    no_build: NoBuild = False,
    jobs: Jobs = None,
    format_: Format = "csv",
    quick: Quick = False,
    fresh: Fresh = False,
    no_run: NoRun = False,
    isolate: Isolate = False,
    call_limit: CallLimit = None,
) -> None:
    """Write one page that reproduces the papers.

    report.html: per study the verdicts, system, figures, tables, parameters and their source. One file
    that needs no server; figures lie beside it as SVG and PNG. Runs whose results are missing, or were
    made from another scenario or FMU, are made first. Without --out, the page of one study lies in its
    folder below results/, that of several in results/. Regions take most of the time, half an
    hour on two cores for all studies in scenarios/; --quick leaves them out.
    """
    from ..pages.report import found_studies

    paths = list(dict.fromkeys(studies or found_studies()))
    wishes = Wishes(
        fmus,
        not no_build,
        jobs,
        None,
        format_,
        isolation(isolate, call_limit),
        fresh=fresh,
        no_run=no_run,
        quick=quick,
    )
    of_files(context, paths, (), out, wishes)

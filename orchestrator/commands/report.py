"""`yawbench report`: one page that reproduces the papers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .experiment import of_files
from .options import MAKING, Wishes, named, takes

Studies = Annotated[
    list[Path] | None,
    named("a study file", help="Studies: YAML files, or names; default: all in scenarios/.", metavar="STUDY"),
]


@takes(*MAKING, "jobs", "format_", "quick", "fresh", "no_run")
def report(context: typer.Context, wishes: Wishes, studies: Studies = None) -> None:
    """Write one page that reproduces the papers.

    report.html: per study the verdicts, system, figures, tables, parameters and their source. One file
    that needs no server; figures lie beside it as SVG and PNG. Runs whose results are missing, or were
    made from another scenario or FMU, are made first. Without --out, the page of one study lies in its
    folder below results/, that of several in results/. Regions take most of the time, half an
    hour on two cores for all studies in scenarios/; --quick leaves them out.
    """
    from ..pages.report import found_studies

    paths = list(dict.fromkeys(studies or found_studies()))
    of_files(context, paths, wishes)

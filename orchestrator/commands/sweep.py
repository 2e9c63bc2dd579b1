"""`yawbench sweep`: one scenario over many conditions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .experiment import of_files
from .options import CHANGES, MAKING, Wishes, named, takes

SweepFile = Annotated[
    Path, named("a sweep file", help="Sweep: YAML file, or a name in scenarios/.", metavar="SWEEP")
]


@takes(*CHANGES, *MAKING, "jobs", "scheduler", "keep", "format_", "fresh", "no_run")
def sweep(context: typer.Context, file: SweepFile, wishes: Wishes) -> None:
    """Run a scenario over a grid, list or Latin hypercube.

    Its metrics become a table, limits, curves and maps. Without --out, results go to
    results/<folder of the sweep file>/<its name>: report.html; table.csv and table.parquet, one row per
    run; figures. Every run has a process of its own. An interrupted sweep goes on where it was; nothing
    that is finished is run again.
    """
    of_files(context, [file], wishes)

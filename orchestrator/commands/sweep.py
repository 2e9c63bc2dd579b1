"""`yawbench sweep`: one scenario over many conditions."""

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
    Scheduler,
    Set,
    Swap,
    isolation,
    named,
)

SweepFile = Annotated[
    Path, named("a sweep file", help="Sweep: YAML file, or a name in scenarios/.", metavar="SWEEP")
]
Keep = Annotated[
    bool, typer.Option("--keep", help="Keep the results of every run, in runs/<its key in the table>.")
]


def sweep(
    context: typer.Context,
    file: SweepFile,
    swap: Swap = None,
    set_: Set = None,
    fault: Fault = None,
    out: Out = None,
    fmus: Fmus = None,
    no_build: NoBuild = False,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    keep: Keep = False,
    format_: Format = "csv",
    fresh: Fresh = False,
    no_run: NoRun = False,
    isolate: Isolate = False,
    call_limit: CallLimit = None,
) -> None:
    """Run a scenario over a grid, list or Latin hypercube.

    Its metrics become a table, limits, curves and maps. Without --out, results go to
    results/<folder of the sweep file>/<its name>: report.html; table.csv and table.parquet, one row per
    run; figures. Every run has a process of its own. An interrupted sweep goes on where it was; nothing
    that is finished is run again.
    """
    from ..scenario.overrides import read_changes

    wishes = Wishes(
        fmus, not no_build, jobs, scheduler, format_, isolation(isolate, call_limit), keep, fresh, no_run
    )
    of_files(context, [file], read_changes(swap or (), set_ or (), fault or ()), out, wishes)

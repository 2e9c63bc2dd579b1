"""`yawbench export`: recorded runs as a file for another program."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from yawbench.commands import json_and_latex
from yawbench.commands.options import CHANGES, RunOptions, takes
from yawbench.commands.recorded_runs import Labels, RunSources, folder_of_all, labels_of, read_runs, recorded
from yawbench.commands.terminal_progress import say

To = Annotated[
    str,
    typer.Option("--to", metavar="FORMAT", help="rerun, mcap, mdf, parquet, csv or mat.", show_default=False),
]
File = Annotated[
    Path | None,
    typer.Option("--out", metavar="FILE", help="File to write. Default: runs.* in the folder of the runs."),
]


@takes(*CHANGES, "fmus", "no_build")
def export(sources: RunSources, options: RunOptions, to: To, label: Labels = None, out: File = None) -> None:
    """Write runs as one file for another program, with all signals and their units.

    rerun, mcap: the scene in three dimensions with all cars, forces, lanes and ground, the signals, the
    events, and a layout that shows how the runs differ. mdf: a group of channels per run. parquet, csv: a row
    per run and instant. mat: a structure per run, for MATLAB. A scenario is run first if its results are
    missing or out of date.
    """
    from .formats import ExportedRun, format_of, write

    format = format_of(to)
    folders = recorded(sources, options)
    labels = labels_of(folders, label)
    runs = [ExportedRun(*one) for one in zip(labels, read_runs(folders, 0.0), strict=True)]
    file = out or folder_of_all(folders) / f"runs{format.ending}"
    for written in write(runs, file, format):
        say(f"{written}: {written.stat().st_size / 1000:.0f} kB")
    if to == "rerun":
        say(f"to look at it, without listening to the network: rerun --bind 127.0.0.1 {file}")
    json_and_latex.answer(file=file, runs=labels)

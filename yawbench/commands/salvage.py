"""`yawbench salvage`: results of runs that were killed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from yawbench.commands.terminal_progress import say
from yawbench.foundation.messages import counted

Folders = Annotated[
    list[Path], typer.Argument(help="Results folders of runs that were killed.", metavar="FOLDER...")
]


def salvage(folders: Folders) -> None:
    """Recover the results of runs that were killed.

    Killed processes leave files that end in .part. Their complete rows become results with the status
    "died"; if the folder has results of an earlier run, which become readable again, they go to failed/
    instead. Incomplete Parquet files cannot be recovered.
    """
    from yawbench.orchestrator.results.salvage import lost_format, salvage

    for folder in folders:
        lost = lost_format(folder)
        place, rows = salvage(folder)
        if rows:
            say(f"{place}: {counted(rows, 'row')}")
        else:
            why = f"incomplete {lost} files cannot be read" if lost else "no complete row was written"
            say(f"{folder}: nothing could be recovered: {why}")

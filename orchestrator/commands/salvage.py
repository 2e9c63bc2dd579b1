"""`yawbench salvage`: keep what a run recorded whose process was killed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Folders = Annotated[list[Path], typer.Argument(help="Folders of runs that died.", metavar="FOLDER...")]


def salvage(folders: Folders) -> None:
    """Recover what runs recorded before they died.

    Killed processes leave files that end in .part. The whole rows among them become results with the
    status "died"; if results of an earlier run stand in the folder they go to failed/ beside those, which
    can then be read again. Of Parquet and MDF, which can be read only whole, nothing is kept.
    """
    from ..results.salvage import lost_format, salvage
    from ..wording import counted
    from .batch import say

    for folder in folders:
        lost = lost_format(folder)
        place, rows = salvage(folder)
        if rows:
            say(f"{place}: {counted(rows, 'row')}")
        else:
            why = f"{lost} can be read only whole" if lost else "it had written no row"
            say(f"{folder}: nothing of the run could be kept: {why}")

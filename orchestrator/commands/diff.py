"""`yawbench diff`: what differs between two runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

One = Annotated[Path, typer.Argument(help="Folder of results.", metavar="RUN")]
Other = Annotated[Path, typer.Argument(help="Folder of the results to compare it with.", metavar="RUN")]


def diff(one: One, other: Other) -> None:
    """Show what differs between two runs.

    First what they were made of: scenario, parameters, FMUs, connections, versions of programs. Then
    their results, signal by signal: from when on they differ, from when on a curve shows it (1 % of the
    signal's largest value), and by how much at most.
    """
    from ..pages.divergence import differences, differences_table, divergence, partings_table
    from ..results.read import load_results
    from .batch import print_tables, say
    from .recorded import distinct

    first, second = load_results(one), load_results(other)
    found, parted = differences(first.run, second.run), divergence(first, second)
    if found:
        print_tables([differences_table(found, *distinct([one, other]))])
    if parted.partings or parted.notes:
        print_tables([partings_table(parted, first, second)])
    if not (found or parted.partings or parted.notes):
        say("The runs are the same, in what they were made of and in every number.")

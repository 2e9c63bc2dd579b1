"""Tables and figures of commands: tables as wide as the terminal, or in the form that is asked for."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from .json_and_latex import collect, form
from .terminal_progress import say

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console

    from yawbench.studies.tables import Table


WIDTH = 140
"""Width of tables written to a file or a pipe, unless `COLUMNS` is set."""
NARROWEST = 20
"""Narrowest width of tables; a terminal that states less does not know its own."""


def save_figure(figure: Figure, wanted: Path | None, default: Path) -> None:
    """Save a figure as `.svg` and `.png` and print the paths; `wanted` may have either suffix, or none."""
    from yawbench.figures.style import save

    stem = wanted or default
    if stem.suffix.lower() in (".svg", ".png"):
        stem = stem.with_suffix("")
    svg, png = save(figure, stem)
    say(f"{svg}, {png.name}")


def print_tables(tables: Iterable[Table]) -> None:
    """Print tables to stdout for the width of `console`, or in the form that is asked for."""
    if form() != "text":
        collect(tables)
        return
    from yawbench.studies.terminal_tables import TerminalTable

    screen = console()
    for table in tables:
        screen.print()
        screen.print(TerminalTable(table), crop=False)


def console() -> Console:
    """Return stdout as a console as wide as `COLUMNS` says, or the terminal, or `WIDTH`."""
    from rich.console import Console

    columns, lines = shutil.get_terminal_size((WIDTH, 50))
    width = max(columns, NARROWEST)  # with a height, for rich to use it on every terminal
    return Console(highlight=False, markup=False, emoji=False, width=width, height=lines)

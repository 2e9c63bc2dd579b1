"""Tables for people, on the terminal or in a page, from one description."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from ..figures.display import shown
from ..metrics.plausibility import findings_in, first_of_each
from ..metrics.run_metrics import Value, evaluate_all, metric
from ..titles import changes_in, with_changes
from ..wording import printable

if TYPE_CHECKING:
    import rich.console

    from ..results.read import Results

MARK = "†"
"""Behind the name of a run whose course had something remarkable."""
MIN_HEADING = 12
"""Characters of a heading over numbers before it is broken at a space."""

Cell = str | Value | None
"""Words, a number with its unit, or nothing."""


@dataclass
class Table:
    """Headings, rows of cells, and what has to be said below them."""

    title: str
    headings: list[str]
    rows: list[Sequence[Cell]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    numbers: set[int] = field(default_factory=set)  # columns of numbers that stand as text

    def text(self) -> list[list[str]]:
        """Return the cells of all rows as people read them."""
        return [[_shown(cell) for cell in row] for row in self.rows]

    def is_number(self, column: int) -> bool:
        """Return whether a column holds numbers, and so is set flush right."""
        return column in self.numbers or any(isinstance(row[column], Value) for row in self.rows)


def _shown(cell: Cell) -> str:
    if cell is None:
        return "-"
    return shown(cell.number, cell.unit, half=cell.half) if isinstance(cell, Value) else printable(cell)


def for_terminal(table: Table) -> rich.console.Group:
    """Return the table for a rich console; title and notes may be wider than the columns."""
    import rich.table
    from rich import box
    from rich.console import Group
    from rich.text import Text

    shape = rich.table.Table(box=box.SIMPLE_HEAD, pad_edge=False)
    rows = table.text()
    for i, heading in enumerate(table.headings):
        number = table.is_number(i)
        if number:  # a long heading is no reason for a broad column
            widest = max(MIN_HEADING, *(len(row[i]) for row in rows))
            heading = "\n".join(textwrap.wrap(heading, widest, break_long_words=False)) or heading
        side: Literal["left", "right"] = "right" if number else "left"
        shape.add_column(Text(printable(heading)), justify=side, no_wrap=number, overflow="fold")
    for row in rows:
        shape.add_row(*(Text(cell) for cell in row))
    notes = [Text(printable(note)) for note in table.notes]
    return Group(*([Text(printable(table.title), "bold")] if table.title else []), shape, *notes)


def marked(label: str, results: Results) -> str:
    """Return what a table calls a run, with a mark if something in its course was remarkable."""
    return f"{label} {MARK}" if _remarkable(results) else label


def remarks(runs: Iterable[tuple[str, Results]]) -> list[str]:
    """Return a note for each run (label, results) with a mark."""
    return [f"{MARK} {label}: {says}" for label, results in runs if (says := _remarkable(results))]


def _remarkable(results: Results) -> str:
    found = [one for one in findings_in(results.run) if one.time is not None]
    return "; ".join(one.says for one in first_of_each(found))


def metrics_of_run(results: Results, names: Sequence[str]) -> Table:
    """Return a table of the metrics of one run, one row each; those it has no signals for are left out."""
    values = evaluate_all(results, names)
    rows: list[Sequence[Cell]] = [
        [metric(name).title, metric(name).formula, value] for name, value in values.items()
    ]
    title = with_changes(str(results.run.get("title") or results.folder), changes_in(results.run))
    missing = [name for name in names if name not in values]
    notes = [f"No number for {', '.join(missing)}."] if missing else []
    return Table(title, ["metric", "", "value"], rows, notes)

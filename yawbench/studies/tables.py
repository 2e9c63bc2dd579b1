"""Tables, shown on the terminal and on pages and written to files."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from yawbench.figures.display import shown_value
from yawbench.figures.latex import escaped
from yawbench.foundation.messages import printable
from yawbench.metrics.expressions import MetricValue
from yawbench.metrics.verdict import VerdictText

if TYPE_CHECKING:
    import pandas as pd


MARK = "†"
"""Mark after the name of a run with plausibility warnings."""
Cell = str | MetricValue | float | None
"""A table cell: text, a number with its unit or in that of its column, or None if empty."""
Kind = Literal["int64", "float64", "string"]
"""Kind of the cells of a column, for data frames and files."""


@dataclass(frozen=True)
class Column:
    """A column of a table, without its cells."""

    heading: str
    kind: Kind | None = None  # of all cells; None: as they are
    about: dict[str, str] = field(default_factory=dict)  # for programs; `unit`: SI unit of plain numbers
    number: bool = False  # numbers formatted as text, aligned right


class Table:
    """A table, shown on the terminal and on pages, and written as CSV, Parquet and data frames.

    Args:
        title: above it.
        columns: columns, or headings of columns of any cells.
        rows: a cell per column.
        notes: below it.
        numbers: indices of the headings over numbers that are formatted as text.
    """

    def __init__(
        self,
        title: str,
        columns: Iterable[str | Column],
        rows: Iterable[Sequence[Cell]] = (),
        notes: Iterable[str] = (),
        numbers: Collection[int] = (),
    ) -> None:
        self.title = title
        self.columns = [
            entry if isinstance(entry, Column) else Column(entry, number=k in numbers)
            for k, entry in enumerate(columns)
        ]
        self.rows = list(rows)
        self.notes = list(notes)

    @classmethod
    def of_columns(cls, columns: Iterable[tuple[Column, Sequence[Cell]]]) -> Table:
        """Return a table of columns with their cells."""
        listed = list(columns)
        return cls("", [about for about, _ in listed], zip(*(cells for _, cells in listed), strict=True))

    @property
    def headings(self) -> list[str]:
        """The headings of all columns."""
        return [column.heading for column in self.columns]

    def text(self) -> list[list[str]]:
        """Return the cells of all rows as text."""
        units = [column.about.get("unit", "") for column in self.columns]
        return [[_shown(cell, unit) for cell, unit in zip(row, units, strict=True)] for row in self.rows]

    def is_number(self, column: int) -> bool:
        """Return whether a column has numbers, and so is aligned right."""
        return self.columns[column].number or any(
            isinstance(row[column], (MetricValue, float, int)) for row in self.rows
        )

    def unit(self, column: int) -> str | None:
        """Return the SI unit of a column's numbers; None if it has none, or several."""
        if unit := self.columns[column].about.get("unit"):
            return unit
        cells = [row[column] for row in self.rows if row[column] is not None]
        units = {cell.unit if isinstance(cell, MetricValue) else None for cell in cells}
        return units.pop() if len(units) == 1 else None

    def values(self, column: int) -> list[str | float | None]:
        """Return a column for programs: numbers in SI units if all have the same, else text."""
        cells = [row[column] for row in self.rows]
        if self.unit(column) is None:
            return [_shown(cell) if isinstance(cell, MetricValue) else cell for cell in cells]
        return [cell.number if isinstance(cell, MetricValue) else cell for cell in cells]

    def kind(self, column: int) -> Kind:
        """Return the kind of a column's values."""
        known = [value for value in self.values(column) if value is not None]
        numbers = bool(known) and not any(isinstance(value, str) for value in known)
        return self.columns[column].kind or ("float64" if numbers else "string")


def column(
    heading: str, kind: Kind, cells: Sequence[Cell], about: dict[str, str] | None = None
) -> tuple[Column, Sequence[Cell]]:
    """Return a column of one kind with its cells, for `Table.of_columns`."""
    return Column(heading, kind, about or {}), cells


def text_column(heading: str, values: Iterable[object]) -> tuple[Column, Sequence[Cell]]:
    """Return a column of texts, empty where there is none."""
    return column(heading, "string", [None if value is None else str(value) for value in values])


def count_column(heading: str, values: Iterable[int | None]) -> tuple[Column, Sequence[Cell]]:
    """Return a column of counts."""
    return column(heading, "int64", list(values))


def number_column(heading: str, unit: str, values: Iterable[float | None]) -> tuple[Column, Sequence[Cell]]:
    """Return a column of numbers in an SI unit."""
    return column(heading, "float64", list(values), {"unit": unit})


def _shown(cell: Cell, unit: str = "") -> str:
    if cell is None:
        return "-"
    if isinstance(cell, str):
        return cell if isinstance(cell, VerdictText) else printable(cell)
    if isinstance(cell, int):
        return str(cell)
    value = cell if isinstance(cell, MetricValue) else MetricValue(cell, unit or "1")
    return shown_value(value)


def to_pandas(table: Table) -> pd.DataFrame:
    """Return a table as a data frame; `attrs["units"]` has the units of its numbers."""
    import pandas as pd

    kinds = {"string": "object"}
    series = {
        heading: pd.Series(table.values(k), dtype=kinds.get(table.kind(k), table.kind(k)))
        for k, heading in enumerate(table.headings)
    }
    frame = pd.DataFrame(series)
    units = {heading: table.unit(k) for k, heading in enumerate(table.headings)}
    frame.attrs["units"] = {heading: unit for heading, unit in units.items() if unit}
    return frame


def records_in(table: Table) -> list[dict[str, str | float | None]]:
    """Return the rows of a table as heading -> value, numbers in SI units."""
    columns = [table.values(k) for k in range(len(table.columns))]
    return [dict(zip(table.headings, row, strict=True)) for row in zip(*columns, strict=True)]


def to_csv(table: Table) -> str:
    """Return a table as CSV, with units in the headings."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    units = [table.unit(k) for k in range(len(table.columns))]
    writer.writerow(
        f"{heading} [{unit}]" if unit else heading
        for heading, unit in zip(table.headings, units, strict=True)
    )
    writer.writerows(map(_plain, zip(*map(table.values, range(len(table.columns))), strict=True)))
    return text.getvalue()


def to_latex(table: Table, *, label: str = "") -> str:
    """Return a table for LaTeX with the package booktabs; its notes as a paragraph below.

    `label`: for `\\ref`.
    """
    shape = "".join("r" if table.is_number(k) else "l" for k in range(len(table.columns)))
    rows = [" & ".join(map(_cell_in_latex, row)) + r" \\" for row in table.text()]
    lines = [
        *([rf"\caption{{{_in_latex(table.title)}}}"] if table.title else []),
        *([rf"\label{{{label}}}"] if label else []),
        rf"\begin{{tabular}}{{{shape}}}", r"\toprule",
        " & ".join(map(_cell_in_latex, table.headings)) + r" \\", r"\midrule",
        *rows, r"\bottomrule", r"\end{tabular}",
        *(rf"\par {_in_latex(note)}" for note in table.notes),
    ]  # fmt: skip
    return "\n".join([r"\begin{table}", r"\centering", *lines, r"\end{table}", ""])


def _in_latex(text: str) -> str:
    return escaped(" ".join(printable(text).split()))


def _cell_in_latex(text: str) -> str:
    """Return a cell for LaTeX; one of several lines is a table of its own."""
    lines = r" \\ ".join(map(_in_latex, text.splitlines()))
    return rf"\begin{{tabular}}[t]{{@{{}}l@{{}}}}{lines}\end{{tabular}}" if "\n" in text else lines


def _plain(row: Sequence[Any]) -> list[str]:
    """Return a row as text: numbers with all digits, "" for None."""
    return [
        "" if x is None else repr(x) if isinstance(x, float) and math.isfinite(x) else str(x) for x in row
    ]

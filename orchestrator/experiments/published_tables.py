"""Grids: a metric of many runs in rows and columns, compared with the numbers a paper publishes."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from ..figures.style import digits_of, shown
from .claim_schema import GridSpec, rank_correlation
from .claims import MetricTable
from .tables import Cell, Column, Table


@dataclass(frozen=True)
class GridCell:
    """A cell of a grid: its run and metric, row and column, and the published number, if any."""

    run: str  # "" for a derived number
    metric: str  # or the key of a derived number
    row: str
    column: str
    published: float | None

    @property
    def key(self) -> tuple[str, str]:
        """Key of the cell's value in a `MetricTable`."""
        return self.run, self.metric


def cells(spec: GridSpec) -> list[GridCell]:
    """Return the cells row by row, then the runs outside the grid, whose column is empty."""
    ((row_key, rows),) = spec.rows.items()
    ((column_key, columns),) = spec.columns.items()
    in_grid = []
    for (i, row), (k, column) in itertools.product(enumerate(rows), enumerate(columns)):
        run, derived = (
            text.replace(f"{{{row_key}}}", row).replace(f"{{{column_key}}}", column)
            for text in (spec.run, spec.derived)
        )
        published = spec.published[i][k] if spec.published else None
        in_grid.append(GridCell(run, spec.metric or derived, rows[row], columns[column], published))
    return in_grid + [GridCell(cell.run, spec.metric, cell.says, "", cell.published) for cell in spec.beside]


def ranked(spec: GridSpec, only: Mapping[str, Collection[str]] | None = None) -> list[GridCell]:
    """Return the cells whose order is compared with the paper's: those with a published number.

    Args:
        spec: the grid.
        only: name of rows or columns -> values to include; excludes runs outside the grid.
    """
    among = [cell for cell in cells(spec) if cell.published is not None]
    if not only:
        return among
    ((row_key, rows),), ((column_key, columns),) = spec.rows.items(), spec.columns.items()
    kept = {words for value, words in rows.items() if value in only.get(row_key, rows)}
    in_columns = {words for value, words in columns.items() if value in only.get(column_key, columns)}
    return [cell for cell in among if cell.row in kept and cell.column in in_columns]


def correlation(
    spec: GridSpec, values: MetricTable, only: Mapping[str, Collection[str]] | None = None
) -> float | None:
    """Return Spearman's rank correlation with the published values; None if a run is missing.

    Args:
        spec: the grid.
        values: metrics of the runs.
        only: see `ranked`.
    """
    among = ranked(spec, only)
    pairs = [
        (value.number, cell.published)
        for cell in among
        if cell.published is not None and (value := values.get(cell.key)) is not None
    ]
    wanted = len(among)
    if len(pairs) < max(wanted, 2):
        return None
    measured, published = zip(*pairs, strict=True)
    return rank_correlation(measured, published)


def grid_tables(spec: GridSpec, values: MetricTable, verdicts: Mapping[tuple[str, str], str]) -> list[Table]:
    """Return the table of measured numbers and that of published ones, in SI units with three digits.

    A grid with `holds`, of derived numbers or of means over repeats has its numbers in display units.

    Args:
        spec: the grid.
        values: metrics of the runs; derived numbers under the run "".
        verdicts: key of a cell -> verdict on claims about it: "" if they hold, else a sign.
    """
    ((_, rows),) = spec.rows.items()
    ((_, columns),) = spec.columns.items()
    inside_all = [values.get(cell.key) for cell in cells(spec)]
    if spec.holds or spec.derived or any(value and (value.half or value.between) for value in inside_all):
        return [_display_table(spec, values, verdicts)]
    units = {value.unit for (_, key), value in values.items() if key == spec.metric}
    unit = "" if units <= {"1", "%"} else f" [{units.pop()}]"
    width, every = len(columns), cells(spec)
    inside, beside = every[: len(rows) * width], every[len(rows) * width :]
    lines = [(row, inside[i * width : (i + 1) * width]) for i, row in enumerate(rows.values())]
    title, headings, numbers = (
        f"{spec.title}{unit}",
        [spec.corner, *columns.values()],
        set(range(1, width + 1)),
    )
    measured = [[row, *(_digits(_measured(cell, values)) for cell in line)] for row, line in lines]
    tables = [Table(title, headings, [*measured], [], numbers)]
    if spec.published:
        printed = [[row, *(_digits(cell.published) for cell in line)] for row, line in lines]
        tables.append(Table(f"{title}: published values", headings, [*printed], [], numbers))
    table = tables[-1]
    for cell in beside:
        published = f", the paper: {_digits(cell.published)}" if cell.published is not None else ""
        table.notes.append(f"{cell.row}: {_digits(_measured(cell, values))}{published}")
    if spec.published:
        coefficient = correlation(spec, values)
        table.notes.append(
            f"rank correlation (Spearman) with the paper over {_count(every)} runs: "
            f"{'not all runs have results' if coefficient is None else digits_of(coefficient)}"
        )
    return tables


def side_by_side(tables: Sequence[Table]) -> Table:
    """Join the tables of measured and published numbers into one."""
    if len(tables) == 1:
        return tables[0]
    ours, theirs = tables
    rows = [[*left, *right] for left, right in zip(ours.rows, theirs.rows, strict=True)]
    columns = [*ours.columns, Column("the paper:"), *theirs.columns[1:]]
    return Table(ours.title, columns, rows, theirs.notes)


def _display_table(spec: GridSpec, values: MetricTable, verdicts: Mapping[tuple[str, str], str]) -> Table:
    """Return a grid in display units, with confidence and, if it has `holds`, its last row."""
    ((_, rows),) = spec.rows.items()
    ((_, columns),) = spec.columns.items()
    every = cells(spec)
    table = Table(spec.title, [spec.corner, *columns.values()], numbers=set(range(1, len(columns) + 1)))
    for row in rows.values():
        words = []
        for cell in (other for other in every if other.row == row):
            value = values.get(cell.key)
            text = (
                "-"
                if value is None
                else shown(value.number, value.unit, half=value.half, between=value.between)
            )
            words.append(f"{text} {verdicts.get(cell.key, '')}".rstrip() if spec.holds else text)
        table.rows.append([row, *words])
    for cell in (other for other in every if not other.column):
        value = values.get(cell.key)
        text = (
            "-" if value is None else shown(value.number, value.unit, half=value.half, between=value.between)
        )
        table.rows.append([cell.row, *[text] * len(columns)])
    if spec.holds:
        table.rows.append([spec.holds, *(_down_to(spec, column, verdicts) for column in columns.values())])
    return table


def _down_to(spec: GridSpec, column: str, verdicts: Mapping[tuple[str, str], str]) -> str:
    """Return the last row of a column down to which all claims about its cells hold."""
    last = ""
    for cell in (other for other in cells(spec) if other.column == column):
        if verdicts.get(cell.key):
            return last or "-"
        last = cell.row
    return "all"


def _measured(cell: GridCell, values: MetricTable) -> float | None:
    value = values.get(cell.key)
    return None if value is None else value.number


def _digits(number: float | None) -> Cell:
    return None if number is None else digits_of(number)


def _count(every: Sequence[GridCell]) -> int:
    return sum(cell.published is not None for cell in every)

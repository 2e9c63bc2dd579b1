"""Numbers of many runs together: grids beside a paper's, rank correlations, derived numbers."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from yawbench.metrics.expressions import MetricValue

from .claim_schema import GridSpec
from .schema import ExperimentSpec

MetricTable = Mapping[tuple[str, str], MetricValue]
"""(run, metric key) -> value, where there is one."""


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
    if len(pairs) < max(len(among), 2):
        return None
    measured, published = zip(*pairs, strict=True)
    return rank_correlation(measured, published)


def ranks(x: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the ranks of values, from 1; ties get the mean of their ranks."""
    array = np.asarray(x, dtype=float)
    below = (array[:, None] > array[None, :]).sum(axis=1)
    equal = (array[:, None] == array[None, :]).sum(axis=1)
    average: np.ndarray = below + (equal + 1) / 2
    return average


def rank_correlation(x: Sequence[float], y: Sequence[float]) -> float | None:
    """Return Spearman's rank correlation of two sequences of equal length; None if one is constant."""
    a, b = (ranks(values) - (len(values) + 1) / 2 for values in (x, y))
    scale = math.sqrt(float(a @ a) * float(b @ b)) if len(x) > 1 else 0.0
    return float(a @ b) / scale if scale > 0 else None


def derive(spec: ExperimentSpec, values: MetricTable) -> dict[str, MetricValue]:
    """Compute the derived numbers, without those whose runs are missing."""
    derived: dict[str, MetricValue] = {}
    for key, entry in spec.derived.items():
        number = None
        if entry.rank_correlation is not None:
            number = correlation(spec.grids[entry.rank_correlation], values, entry.only)
        elif entry.expression is not None:
            known = {word: values.get((source.run, source.metric)) for word, source in entry.of.items()}
            numbers = {word: value.number for word, value in known.items() if value is not None}
            number = entry.expression.value(numbers) if len(numbers) == len(known) else None
        if number is not None:
            derived[key] = MetricValue(number, entry.unit)
    return derived

"""Friction tables: a road's friction over x and y, as text in the CSV format of spreadsheets.

    y \\ x,    0,   20,   40
        4,   0.9,  0.9,  0.9
        0,   0.9,  0.3,  0.8
       -4,   0.9,  0.3,  0.8

The first row contains x [m], the first column y [m], in rising or falling order; the corner cell and text
after `#` are comments. Values are separated by commas, semicolons or tabs. Friction is interpolated linearly
between the points along x and y; the table does not define it elsewhere.
"""

import re
from bisect import bisect_right
from math import isfinite
from typing import NamedTuple

Point = tuple[float, float]


class FrictionTable(NamedTuple):
    """Friction at grid points: `rows` by y, within a row by x, both rising."""

    x: tuple[float, ...]
    y: tuple[float, ...]
    rows: tuple[tuple[float, ...], ...]

    def at(self, point: Point) -> float | None:
        """Return the friction [1] at x, y [m], None outside the table."""
        x, y = point
        if not (self.x[0] <= x <= self.x[-1] and self.y[0] <= y <= self.y[-1]):
            return None
        i = min(bisect_right(self.x, x), len(self.x) - 1)
        j = min(bisect_right(self.y, y), len(self.y) - 1)
        below, above = (
            between(x, self.x[i - 1], self.x[i], row[i - 1], row[i])
            for row in (self.rows[j - 1], self.rows[j])
        )
        return between(y, self.y[j - 1], self.y[j], below, above)


def between(x: float, x_0: float, x_1: float, f_0: float, f_1: float) -> float:
    """Interpolate between f_0 at x_0 and f_1 at x_1; swapping both ends gives the same bits."""
    return (f_0 * (x_1 - x) + f_1 * (x - x_0)) / (x_1 - x_0)


def table_of(text: str) -> FrictionTable | None:
    """Parse a table; None for an empty text.

    Raises:
        ValueError: the text is not a table; the message gives the line.
    """
    rows = [
        (number, re.split(r"[,;\t]", line.partition("#")[0]))
        for number, line in enumerate(text.splitlines(), start=1)
        if line.partition("#")[0].strip()
    ]
    if not rows:
        return None
    x = [_number(cell, rows[0][0]) for cell in rows[0][1][1:]]
    by_y: dict[float, list[float]] = {}
    for number, cells in rows[1:]:
        y, *values = (_number(cell, number) for cell in cells)
        if len(values) != len(x):
            raise ValueError(
                f"line {number}: must have {len(x)} values of friction, one for each x (got {len(values)})"
            )
        if (least := min(values, default=0.0)) < 0.0:
            raise ValueError(f"line {number}: friction must not be negative (got {least:g})")
        if y in by_y:
            raise ValueError(f"line {number}: there is already a row for y = {y:g}")
        by_y[y] = values
    for name, axis in (("x", x), ("y", list(by_y))):
        if len(axis) < 2:
            raise ValueError(f"a table needs at least two values of {name} (got {len(axis)})")
        if axis not in (sorted({*axis}), sorted({*axis}, reverse=True)):
            raise ValueError(f"values of {name} must strictly rise or fall")
    columns = sorted(range(len(x)), key=lambda i: x[i])
    return FrictionTable(
        tuple(x[i] for i in columns),
        tuple(sorted(by_y)),
        tuple(tuple(by_y[y][i] for i in columns) for y in sorted(by_y)),
    )


def _number(cell: str, line: int) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise ValueError(f"line {line}: {cell.strip()!r} is not a finite number")
    return value

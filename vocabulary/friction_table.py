"""A road's friction as a table over x and y, written as text: what a spreadsheet keeps as CSV.

    y \\ x,    0,   20,   40
        4,   0.9,  0.9,  0.9
        0,   0.9,  0.3,  0.8
       -4,   0.9,  0.3,  0.8

The first row holds x [m], the first column y [m], in rising or falling order; what stands in the corner is a
remark, and so is what follows a `#`. Values are apart by commas, semicolons or tabs. Between them friction is
interpolated along x and y; outside the table the road has its friction elsewhere.
"""

import re
from bisect import bisect_right
from math import isfinite
from typing import NamedTuple

Point = tuple[float, float]


class FrictionTable(NamedTuple):
    """Friction at points: `rows` by y, within a row by x, both rising."""

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
    """Return the value at x on the line from f_0 at x_0 to f_1 at x_1, to the bit from either end."""
    return (f_0 * (x_1 - x) + f_1 * (x - x_0)) / (x_1 - x_0)


def table_of(text: str) -> FrictionTable | None:
    """Return the table that a text says, None if it says nothing.

    Raises:
        ValueError: what is wrong with it, and in which line.
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
            raise ValueError(f"line {number}: {len(values)} values of friction for {len(x)} of x")
        if (least := min(values, default=0.0)) < 0.0:
            raise ValueError(f"line {number}: friction must not be negative (got {least:g})")
        if y in by_y:
            raise ValueError(f"line {number}: y = {y:g} has a row already")
        by_y[y] = values
    for name, axis in (("x", x), ("y", list(by_y))):
        if len(axis) < 2:
            raise ValueError(f"a table needs two values of {name} or more (got {len(axis)})")
        if axis not in (sorted({*axis}), sorted({*axis}, reverse=True)):
            raise ValueError(f"values of {name} must rise or fall from one to the next")
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
        raise ValueError(f"line {line}: {cell.strip()!r} is no number")
    return value

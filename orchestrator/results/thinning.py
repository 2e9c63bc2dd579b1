"""Long results thinned while they are read, for drawings in which every peak stays.

Of each stretch of rows those are kept in which a column, or a signal's distance from its reference, is
smallest or largest, and the first and last. The rows are kept whole: values of one moment stay together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

LONG = 200_000
"""Rows from which on results are thinned; chosen: ten times those of the papers' longest run."""
STRETCHES = 1500
"""Stretches that a run is divided into: as many as a line drawn over the width of a page has points."""


def thinned(
    blocks: Iterator[list[np.ndarray]], columns: Sequence[str], rows: int
) -> Iterator[list[np.ndarray]]:
    """Yield the blocks of rows without those that a drawing can do without.

    Args:
        blocks: arrays of equal length, one for each column.
        columns: their names.
        rows: in all blocks, as far as is known; short results are left as they are.
    """
    if rows < LONG:
        yield from blocks
        return
    length = -(-rows // STRETCHES)
    place = {name: i for i, name in enumerate(columns)}
    errors = [(i, place[r]) for name, i in place.items() if (r := _reference(name, columns)) is not None]
    for block in blocks:
        numbers = [i for i, column in enumerate(block) if column.dtype.kind == "f"]
        distances = [block[i] - block[k] for i, k in errors if i in numbers and k in numbers]
        seen = np.vstack([*(block[i] for i in numbers), *distances])
        kept = np.zeros(len(block[0]), dtype=bool)
        for begin in range(0, len(kept), length):
            part = seen[:, begin : begin + length]
            gaps = np.isnan(part)
            kept[begin + np.where(gaps, np.inf, part).argmin(axis=1)] = True
            kept[begin + np.where(gaps, -np.inf, part).argmax(axis=1)] = True
            kept[begin + gaps.argmax(axis=1)] = True  # the first gap, else the first row
            kept[begin + part.shape[1] - 1] = True
        yield [column[kept] for column in block]


def _reference(name: str, columns: Sequence[str]) -> str | None:
    """Return the only column that holds the reference of a signal."""
    found = [other for other in columns if other.partition(".")[2] == f"{name.partition('.')[2]}_ref"]
    return found[0] if len(found) == 1 and name.partition(".")[2] else None

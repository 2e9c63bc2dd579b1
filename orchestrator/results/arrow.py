"""Columns of Apache Arrow from arrays and back: Reals by their memory, as all else imports pandas first."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pyarrow as pa

REAL = np.dtype(float)


def column_of(values: np.ndarray) -> pa.Array:
    """Return an array as a column."""
    import pyarrow as pa

    if values.dtype != REAL:
        return pa.array(values)
    memory = pa.py_buffer(np.ascontiguousarray(values))
    return pa.Array.from_buffers(pa.float64(), len(values), [None, memory])


def values_of(column: pa.Array) -> np.ndarray:
    """Return a column as an array."""
    import pyarrow as pa

    if column.type != pa.float64() or column.null_count or not len(column):
        return column.to_numpy(zero_copy_only=False)
    _, memory = column.buffers()
    return np.frombuffer(memory, REAL, len(column), REAL.itemsize * column.offset)

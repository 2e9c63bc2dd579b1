"""Recording by columns, in memory, for formats that write columns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..plan import Value
from .recorder import Recorder


class Columns:
    """Blocks of rows as they come, and the columns they add up to.

    Args:
        order: where each column stands in a row of Reals followed by the others; see `Block`.
        reals: how many stand in the row of Reals, time included.
    """

    def __init__(self, order: Sequence[int], reals: int) -> None:
        self._order = order
        self._reals = reals
        self.clear()

    def clear(self) -> None:
        """Forget all rows."""
        self.rows = 0
        self._blocks: list[np.ndarray] = []
        self._others: list[list[Value]] = []

    def add(self, block: np.ndarray, others: Sequence[list[Value]]) -> None:
        """Take over rows; both are copied."""
        self._blocks.append(block.copy())
        self._others.extend(others)
        self.rows += len(block)

    def arrays(self) -> list[np.ndarray]:
        """Return the columns in order, time first: float64, int64, bool, or object for text."""
        table = np.concatenate(self._blocks) if self._blocks else np.empty((0, self._reals))
        reals = list(np.ascontiguousarray(table.T))
        return [
            reals[place] if place < self._reals else self._other(place - self._reals) for place in self._order
        ]

    def _other(self, k: int) -> np.ndarray:
        values = [row[k] for row in self._others]
        if any(isinstance(value, str) for value in values):
            return np.array(values, dtype=object)
        return np.array(values) if values else np.empty(0)


class ColumnRecorder(Recorder):
    """A recorder that keeps rows until there are `CHUNK` of them, or until the run ends."""

    rows_stay = False
    CHUNK: int | None = None

    def _begin(self) -> None:
        self._columns = Columns(self._order, self._block.shape[1])

    def write(self, count: int) -> None:
        if count <= 0:
            return
        self._look_at(self._block[:count])
        self._columns.add(self._block[:count], self.others[:count])
        self.others.clear()
        self.written += count
        if self.CHUNK is not None and self._columns.rows >= self.CHUNK:
            self._pass_on()

    def _pass_on(self) -> None:
        """Write the columns so far and forget them."""
        raise NotImplementedError

    def _make_room(self, needed: int) -> bool:
        return False  # half a file of columns is no use


def plain(array: np.ndarray) -> np.ndarray:
    """Return a column as `load_results` gives it: float64, or text."""
    return array.astype(str) if array.dtype.kind in "OSU" else array.astype(float)

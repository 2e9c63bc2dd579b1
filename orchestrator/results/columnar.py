"""Recorders that keep columns in memory: `MemoryRecorder`, the base of column formats, `write_results`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..plan import Value
from .formats import plain, recorder_of
from .read import Results
from .recorder import BLOCK, Recorder, RowBlock
from .run_record import RunRecord


class Columns:
    """Accumulates blocks of rows and returns them as columns.

    Args:
        order: index of each column in a row of Reals followed by the others; see `RowBlock`.
        reals: number of Reals in a row, time included.
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
        """Append rows; both arguments are copied."""
        self._blocks.append(block.T.copy())  # while it is in the processor's cache
        self._others.extend(others)
        self.rows += len(block)

    def arrays(self) -> list[np.ndarray]:
        """Return the columns in order, time first: float64, int64, bool, or object for text."""
        reals = list(np.concatenate([np.empty((self._reals, 0)), *self._blocks], axis=1))
        return [
            reals[place] if place < self._reals else self._other(place - self._reals) for place in self._order
        ]

    def _other(self, k: int) -> np.ndarray:
        values = [row[k] for row in self._others]
        if any(isinstance(value, str) for value in values):
            return np.array(values, dtype=object)
        return np.array(values) if values else np.empty(0)


class MemoryRecorder(RowBlock):
    """Records a run in memory only; `results` is what reading the files back would give."""

    folder = place = None

    def __init__(
        self, columns: Sequence[str], real: Sequence[bool], units: Mapping[str, str | None] | None = None
    ) -> None:
        super().__init__(columns, real)
        self.units = dict(units or {})
        self.results: Results | None = None
        self._columns = Columns(self._order, self._block.shape[1])

    def _take(self, block: np.ndarray, others: list[list[Value]]) -> None:
        self._columns.add(block, others)

    def finish(self, record: RunRecord) -> None:
        """Make `results` from the rows written so far."""
        time, *values = (plain(array) for array in self._columns.arrays())
        units = {name: self.units.get(name) or "" for name in ("time", *self.columns)}
        record.rows = self.written
        record.smallest, record.largest = self.extremes()
        self.results = Results(Path(), time, dict(zip(self.columns, values, strict=True)), units, record)

    def announce(self, record: RunRecord) -> None:
        """Do nothing: there are no files."""

    def close(self, record: RunRecord | None = None) -> None:
        """Do nothing: there are no files."""


class ColumnRecorder(Recorder):
    """Base of recorders that buffer rows until there are `CHUNK` of them or the run ends."""

    rows_stay = False
    CHUNK: int | None = None

    def _begin(self) -> None:
        self._columns = Columns(self._order, self._block.shape[1])

    def _take(self, block: np.ndarray, others: list[list[Value]]) -> None:
        self._columns.add(block, others)
        if self.CHUNK is not None and self._columns.rows >= self.CHUNK:
            self._pass_on()

    def _pass_on(self) -> None:
        """Write the buffered columns and clear the buffer."""
        raise NotImplementedError

    def _make_room(self, needed: int) -> bool:
        return False  # part of a columnar file cannot be read


def write_results(results: Results, folder: Path, *, format: str = "csv") -> None:
    """Write results that are in memory to a folder as a run would; results already there are replaced.

    Raises:
        ScenarioError: the format does not exist.
        ResultsError: the files cannot be written.
    """
    names = list(results)
    real = [np.issubdtype(results[name].dtype, np.number) for name in names]
    recorder = recorder_of(format)(folder, names, real, results.units)
    numbers = np.column_stack([results.time, *(results[n] for n, r in zip(names, real, strict=True) if r)])
    others = [*zip(*(results[n].tolist() for n, r in zip(names, real, strict=True) if not r), strict=True)]
    try:
        for first in range(0, len(numbers), BLOCK):
            block = numbers[first : first + BLOCK]
            recorder.lay(block)
            recorder.others += [list(row) for row in others[first : first + len(block)]]
            recorder.write(len(block))
        recorder.finish(results.record.model_copy())
    finally:
        recorder.close()

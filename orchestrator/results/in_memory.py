"""Recording in memory alone, for runs that need no file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .columnar import Columns, plain
from .folder import RUN_FILE
from .read import Results
from .recorder import Block


class MemoryRecorder(Block):
    """A run's results in memory alone, as if they had been written and read back."""

    folder = place = None

    def __init__(
        self, columns: Sequence[str], real: Sequence[bool], units: Mapping[str, str | None] | None = None
    ) -> None:
        super().__init__(columns, real)
        self.units = dict(units or {})
        self.results: Results | None = None
        self._columns = Columns(self._order, self._block.shape[1])

    def write(self, count: int) -> None:
        """Take over the first `count` of `rows`; they are then free again."""
        if count > 0:
            self._columns.add(self._block[:count], self.others[:count])
            self.others.clear()
            self.written += count

    def finish(self, run: dict[str, Any]) -> None:
        """Make `results` of what has been written."""
        time, *values = (plain(array) for array in self._columns.arrays())
        units = {name: self.units.get(name) or "" for name in ("time", *self.columns)}
        record = {**run, "rows": self.written}
        self.results = Results(
            Path(RUN_FILE).parent, time, dict(zip(self.columns, values, strict=True)), units, record
        )

    def announce(self, run: dict[str, Any]) -> None:
        """Nothing: there are no files."""

    def close(self, run: dict[str, Any] | None = None) -> None:
        """Nothing: there are no files."""

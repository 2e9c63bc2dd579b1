"""Results as Parquet: a column per variable, its measurement unit in the field's metadata."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ResultsError
from .arrow import column_of, values_of
from .columnar import ColumnRecorder
from .formats import FILES, plain

UNIT = b"unit"
"""Key of the measurement unit in a field's metadata."""


class ParquetRecorder(ColumnRecorder):
    """The results of one run as Parquet. The file can be read once the run has ended."""

    file = FILES["parquet"]
    CHUNK = 32_768  # rows of a row group; chosen: 2 MB of 64 columns in memory are soon compressed

    def _begin(self) -> None:
        super()._begin()
        self._writer: Any = None
        self._lost: ResultsError | None = None

    def _pass_on(self) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        arrays = [column_of(array) for array in self._columns.arrays()]
        self._columns.clear()
        if self._writer is None:
            names = ["time", *self.columns]
            self._schema = pa.schema(
                pa.field(name, array.type, metadata={UNIT: self.units.get(name) or ""})
                for name, array in zip(names, arrays, strict=True)
            )
            sink = pa.PythonFile(_Sink(self._append), mode="w")
            self._writer = pq.ParquetWriter(sink, self._schema, compression="zstd")
        try:
            self._writer.write_table(pa.Table.from_arrays(arrays, schema=self._schema))
        except ResultsError as error:
            self._lost = error
            raise

    def _complete(self, run: dict[str, Any]) -> None:
        if self._lost is not None:  # a file with a hole is no use
            raise ResultsError(self._lost.problems)
        if self._columns.rows or self._writer is None:
            self._pass_on()
        self._writer.close()


class _Sink:
    """What pyarrow writes into. It takes no notice of a file that accepts less than it is given."""

    closed = False

    def __init__(self, append: Callable[[bytes], None]) -> None:
        self._append = append

    def write(self, data: bytes) -> int:
        self._append(data)
        return len(data)

    def flush(self) -> None:
        """Nothing: the file has no buffer."""

    def close(self) -> None:
        """Nothing: the recorder closes its file."""


class ParquetFile:
    """A Parquet file of results (see `formats.Source`)."""

    def __init__(self, path: Path, texts: Sequence[str] | None = None) -> None:
        import pyarrow.parquet as pq

        self._file = pq.ParquetFile(path)  # by itself, whatever the folder above is called
        self.names = list(self._file.schema_arrow.names)

    def blocks(self, columns: Sequence[str]) -> Iterator[list[np.ndarray]]:
        """Yield some rows after the other of chosen columns."""
        for batch in self._file.iter_batches(columns=list(columns)):
            yield [plain(values_of(batch.column(name))) for name in columns]

"""Results as Apache Parquet: a column per variable, its unit in the metadata of the field."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from yawbench.foundation.errors import ResultsError

from .file_formats import FILES, column_of, plain, values_of
from .recorder import ColumnRecorder
from .run_record import RunRecord

UNIT = b"unit"
"""Key of the measurement unit in a field's metadata."""


class ParquetRecorder(ColumnRecorder):
    """Records a run as Parquet. The file can be read only once the run has ended."""

    file = FILES["parquet"]
    CHUNK = 32_768  # rows per row group; chosen: 64 columns take 2 MB, which is compressed quickly

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

    def _complete(self, record: RunRecord) -> None:
        if self._lost is not None:  # a file with a gap is useless
            raise ResultsError(self._lost.diagnostics)
        if self._columns.rows or self._writer is None:
            self._pass_on()
        self._writer.close()


class _Sink:
    """File object that pyarrow writes to; it passes on all data, where pyarrow would ignore short writes."""

    closed = False

    def __init__(self, append: Callable[[bytes], None]) -> None:
        self._append = append

    def write(self, data: bytes) -> int:
        self._append(data)
        return len(data)

    def flush(self) -> None:
        """Do nothing: the file has no buffer."""

    def close(self) -> None:
        """Do nothing: the recorder closes the file."""


class ParquetFile:
    """A Parquet file of results (see `file_formats.ResultsSource`)."""

    def __init__(self, path: Path, texts: Sequence[str] = ()) -> None:
        import pyarrow.parquet as pq

        self._file = pq.ParquetFile(path)  # pyarrow must not interpret the names of its folders as partitions
        self.names = list(self._file.schema_arrow.names)

    def blocks(self, columns: Sequence[str]) -> Iterator[list[np.ndarray]]:
        """Yield the chosen columns, a block of rows at a time."""
        for batch in self._file.iter_batches(columns=list(columns)):
            yield [plain(values_of(batch.column(name))) for name in columns]

"""Recorders and readers of results as Apache Parquet and as ASAM MDF 4.

Parquet: a column per variable, its unit in the field's metadata. MDF 4, the format of measurement tools: one
channel group, units in its channels.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from yawbench.foundation.errors import ResultsError

from ..scenario.overrides import with_changes
from .file_formats import FILES, FORMATS, column_of, plain, values_of
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


@dataclass(frozen=True)
class MdfGroup:
    """A group of channels with common times [s]."""

    name: str
    comment: str
    time: np.ndarray
    columns: Mapping[str, np.ndarray]
    units: Mapping[str, str | None]


def mdf_of(groups: Sequence[MdfGroup], started: str | None) -> bytes:
    """Return the bytes of a file of MDF 4; `started`: in ISO 8601.

    Data are not compressed: programs that read one channel after the other, as most do, would decompress the
    whole group for each, 3.4 s for the 95 channels of a run of 6.5 s where it takes 0.2 s now.
    """
    package: Any = FORMATS["mf4"].require()
    with package.MDF(version="4.10") as mdf:
        if started:
            mdf.header.start_time = datetime.fromisoformat(started)
        for group in groups:
            signals = [
                package.Signal(
                    _samples(array), group.time, name=name, unit=group.units.get(name) or "", encoding="utf-8"
                )
                for name, array in group.columns.items()
            ]
            mdf.append(signals, acq_name=group.name or None, comment=group.comment, common_timebase=True)
        data = io.BytesIO()
        mdf.save(data, compression=0)
    return data.getvalue()


class MdfRecorder(ColumnRecorder):
    """Records a run as MDF 4. All rows stay in memory until the run has ended."""

    file = FILES["mf4"]

    def _complete(self, record: RunRecord) -> None:
        time, *columns = self._columns.arrays()
        title = with_changes(record.title or "", record.overrides)
        group = MdfGroup("", title, time, dict(zip(self.columns, columns, strict=True)), self.units)
        self._append(mdf_of([group], record.started))


def _samples(array: np.ndarray) -> np.ndarray:
    if array.dtype.kind == "O":
        return np.array([str(value).encode() for value in array])
    return array.astype(np.uint8) if array.dtype == bool else array


class MdfFile:
    """An MDF file of results with one channel group (see `file_formats.ResultsSource`).

    Raises:
        ResultsError: asammdf is not installed.
    """

    ROWS = 200_000
    """Rows read at a time; chosen: a column of them takes a few megabytes at most."""

    def __init__(self, path: Path, texts: Sequence[str] = ()) -> None:
        self._path = path
        with self._open() as mdf:
            (group,) = mdf.groups
            master = mdf.masters_db.get(0)
            self._places = {channel.name: i for i, channel in enumerate(group.channels) if i != master}
            self.names = ["time", *(channel.name for i, channel in enumerate(group.channels) if i != master)]
            self._rows = int(group.channel_group.cycles_nr)

    @contextlib.contextmanager
    def _open(self) -> Iterator[Any]:
        try:
            package: Any = FORMATS["mf4"].require()
            with package.MDF(self._path) as mdf:
                yield mdf
        except (OSError, ValueError, ResultsError):
            raise
        except Exception as error:  # asammdf raises MdfException and whatever its parsing meets
            raise ValueError(" ".join(str(error).split()) or type(error).__name__) from None

    def blocks(self, columns: Sequence[str]) -> Iterator[list[np.ndarray]]:
        """Yield the chosen columns, a block of rows at a time."""
        wanted = [name for name in columns if name != "time"]
        with self._open() as mdf:
            for begin in range(0, self._rows, self.ROWS):
                part: dict[str, Any] = {"record_offset": begin, "record_count": self.ROWS}
                # one call for all channels: each call decompresses the whole group
                signals = (
                    mdf.select([(None, 0, self._places[name]) for name in wanted], **part) if wanted else []
                )
                time = signals[0].timestamps if signals else mdf.get_master(0, **part)
                taken = {name: _decoded(signal.samples) for name, signal in zip(wanted, signals, strict=True)}
                yield [plain(time if name == "time" else taken[name]) for name in columns]


def _decoded(samples: np.ndarray) -> np.ndarray:
    return np.char.decode(samples, "utf-8") if samples.dtype.kind == "S" else samples

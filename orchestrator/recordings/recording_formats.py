"""Files of recorded columns: CSV and other text, .vbo of Racelogic, Parquet, ASAM MDF and logs of CAN frames.

A header may name a unit, `delta [deg]`, and text may have a row of units below its header; Parquet has
units in the metadata of fields, MDF in channels. The units of results of this program are in the run.json
next to them. Of columns or channels of the same name, `speed#2` is the second, and `speed#gps` that of the
source or group `gps`.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.foundation.messages import cut, hint, listed
from yawbench.foundation.safe_files import read_bytes, reading, reason

from ..results.run_record import RUN_FILE, check_record
from ..scenario.quantities import Unit, spellings
from .can_logs import LOGS, LoggedSignal, read_log
from .clocks import refuse_infinite
from .text_tables import MISSING, Mark, read_text_table, split_header
from .units_of_loggers import factors, stated_unit

LARGEST = 1_000_000_000
"""Bytes of a file. Chosen: it fits into memory."""
_INDEXED = re.compile(r".*\w\[[\d, ]+\]\s*")
TEXT, MDF = (".csv", ".tsv", ".txt", ".vbo"), (".mf4", ".mdf", ".dat")


class FileColumn(NamedTuple):
    """A column as in the file, and the times of its values."""

    times: np.ndarray  # shape (rows,): numbers [time_unit], NaN where a row has none, text, or times of NumPy
    values: np.ndarray  # shape (rows,): numbers, NaN where none was taken, or text, None where none was taken
    time_unit: str | None
    unit: str | None


class _Table(NamedTuple):
    """The columns of a file, independent of its format; the callables take the index of a column."""

    headers: list[str]
    units: Sequence[str | None]  # where the format has them apart from headers
    sources: Sequence[str]  # groups of channels, or what a table states as the source of a column; "": none
    values: Callable[[int], np.ndarray]
    times: Callable[[int], np.ndarray] | None = None  # in s, if every column has its own times
    notes: Sequence[str] = ()


class ColumnFile:
    """A file of columns, read into memory.

    Args:
        path: the file.
        asked: names of columns that will be asked for, by which the line of names is found.
        header: of text, the line of the names of columns; default: it is looked for.
        decimal: of text, the decimal mark; default: as the numbers show.

    Raises:
        OSError: the file cannot be read.
        ValueError: its content is not usable; also raised by `column`.
    """

    def __init__(
        self,
        path: Path,
        asked: Collection[str] = (),
        *,
        header: int | None = None,
        decimal: Mark | None = None,
    ) -> None:
        raw = read_bytes(path, largest=LARGEST)
        digest = hashlib.sha256(raw)
        ending = path.suffix.lower()
        if ending in TEXT:
            self._table = _text(raw, asked, header, decimal)
        elif ending == ".parquet":
            self._table = _parquet(raw)
        elif ending in LOGS:
            signals, database = read_log(path, raw)
            self._table = _can_log(signals)
            digest.update(database)
        elif ending in MDF:
            self._table = _mdf(raw, {name.partition("#")[0].strip() for name in asked})
        else:
            raise ValueError(f"must be a file of type {', '.join((*TEXT, '.parquet', *MDF, *LOGS))}")
        self.sha256 = digest.hexdigest()
        self.notes = self._table.notes
        self._clocks: dict[int, np.ndarray] = {}
        self._names: list[str] = []
        self._units: list[str | None] = []
        beside = _units_beside(path)
        for heading, unit in zip(self._table.headers, self._table.units, strict=True):
            known = unit or beside.get(heading)
            element = known and _INDEXED.fullmatch(heading)
            name, in_header = (heading.strip(), None) if element else split_header(heading)
            self._names.append(name)
            self._units.append(in_header or known or beside.get(name))

    def column(self, name: str, time: str) -> FileColumn:
        """Return a column with its times: those of the column `time`, in MDF those of the channel."""
        table, at = self._table, self._find(name)
        if table.times:
            return FileColumn(table.times(at), table.values(at), "s", self._units[at])
        clock = self._find(time)
        if clock not in self._clocks:
            self._clocks[clock] = table.values(clock)
        return FileColumn(self._clocks[clock], table.values(at), self._units[clock], self._units[at])

    def _find(self, asked: str) -> int:
        found = self._called(asked)
        name, mark, which = asked.rpartition("#")
        if not found and mark:
            alike = self._called(name.strip())
            found = [at for at in alike if self._is_of(self._table.sources[at], which.strip())]
            if which.strip().isdigit() and alike and not found:
                if not 1 <= int(which) <= len(alike):
                    raise ValueError(f"has no column {asked!r}: {self._alike(name.strip(), alike)}")
                found = [alike[int(which) - 1]]
        if len(found) > 1:
            raise ValueError(self._alike(asked, found))
        if found:
            return found[0]
        raise ValueError(f"has no column {asked!r}{self._instead(asked)}")

    def _called(self, name: str) -> list[int]:
        pairs = zip(self._names, self._table.headers, strict=True)
        return [at for at, of_column in enumerate(pairs) if name in of_column]

    @staticmethod
    def _is_of(source: str, asked: str) -> bool:
        """Return whether a source is the one asked for: `gps` is `100: gps`, too."""
        return bool(source) and asked.lower() in (source.lower(), source.rpartition(":")[2].strip().lower())

    def _alike(self, name: str, indices: Sequence[int]) -> str:
        """Return the message of several columns of a name, which tells how to choose one."""
        table = self._table
        ways = []
        for number, at in enumerate(indices, start=1):
            about = ", ".join(filter(None, (self._units[at], table.sources[at])))
            ways.append(f"'{name}#{number}'{f' ({about})' if about else ''}")
        return f"{len(indices)} columns are called {name!r}: write {listed(ways[:10], last='or')}"

    def _instead(self, asked: str) -> str:
        """Return what a missing column may be instead."""
        table = self._table
        if any(header.startswith("CAN_DataFrame") for header in table.headers):
            return ": it has raw CAN frames, no signals: decode it, with a DBC file and asammdf, before"
        if len(table.headers) <= LIST_OF_READINGS and not table.times:
            for at, header in enumerate(table.headers):
                values = table.values(at)
                if values.dtype.kind == "O" and asked in values:
                    return (
                        f": it is a list of readings, and {asked!r} stands in rows of its column {header!r}: "
                        "export a table with a column per signal"
                    )
        return hint(asked, self._names, lead="it has")


LIST_OF_READINGS = 8
"""Columns of a list with a reading per row at most: time, name, number, unit, and some of positions."""


def _text(raw: bytes, asked: Collection[str], header: int | None, decimal: Mark | None) -> _Table:
    table = read_text_table(raw, asked=asked, header=header, decimal=decimal)
    return _Table(table.headers, table.units, table.sources, table.column, notes=table.notes)


def _parquet(raw: bytes) -> _Table:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(pa.BufferReader(raw))
    except pa.ArrowInvalid as error:
        raise ValueError(f"is not a Parquet file, or damaged: {error}") from None
    units = [stated_unit((field.metadata or {}).get(b"unit", b"").decode()) for field in table.schema]

    def values(at: int) -> np.ndarray:
        column, kind = table.column(at), table.column(at).type
        if pa.types.is_dictionary(kind):
            column = column.cast(kind.value_type)
            kind = kind.value_type
        if pa.types.is_nested(kind):
            raise ValueError(f"column {table.column_names[at]!r} holds lists: one number per row is wanted")
        if pa.types.is_time(kind):
            column = column.cast(pa.string())
        elif pa.types.is_decimal(kind) or pa.types.is_boolean(kind):
            column = column.cast(pa.float64())
        elif pa.types.is_date(kind):
            column = column.cast(pa.timestamp("ms"))
        array: np.ndarray = column.to_numpy()
        return array

    return _Table(table.column_names, units, [""] * len(units), values)


def _mdf(raw: bytes, asked: Collection[str]) -> _Table:
    """Return the channels of an MDF file; those asked for are read together, as groups may be compressed."""
    try:
        import asammdf
    except ImportError:
        raise ValueError("ASAM MDF needs the package asammdf: pip install 'yawbench[mdf]'") from None
    try:
        mdf: Any = asammdf.MDF(io.BytesIO(raw))
        channels = [
            (group, index, channel.name, mdf.get_channel_unit(group=group, index=index))
            for group, channels in enumerate(mdf.groups)
            for index, channel in enumerate(channels.channels)
            if index != mdf.masters_db.get(group)
        ]
        sources = [_group_name(mdf.groups[group].channel_group) for group, *_ in channels]
    except Exception as error:  # asammdf raises whatever its parsing meets
        why = re.sub(r'"?<_io\.BytesIO[^>]*>"?', "it", " ".join(str(error).split()))
        raise ValueError(f"is not an MDF file, or damaged: {why}") from None

    read: dict[int, Any] = {}

    def signal(at: int) -> Any:
        group, _, name, _ = channels[at]
        master = mdf.masters_db.get(group)
        if master is None or getattr(mdf.groups[group].channels[master], "sync_type", 1) not in (0, 1):
            raise ValueError(f"channel {name!r} has no times: its group {sources[at]!r} has no clock in s")
        if at not in read:
            wanted = [
                k
                for k, (of, _, known, _) in enumerate(channels)
                if k == at or (of == group and known in asked)
            ]
            signals = mdf.select([(None, group, channels[k][1]) for k in wanted])
            read.update((k, one.validate(copy=False)) for k, one in zip(wanted, signals, strict=True))
        taken = read[at]
        if taken.samples.ndim != 1 or taken.samples.dtype.names:
            raise ValueError(f"channel {name!r} holds arrays: one number per sample is wanted")
        return taken

    def values(at: int) -> np.ndarray:
        samples: np.ndarray = signal(at).samples
        return np.char.decode(samples, "utf-8").astype(object) if samples.dtype.kind == "S" else samples

    headers, units = [name for _, _, name, _ in channels], [stated_unit(unit) for *_, unit in channels]
    return _Table(headers, units, sources, values, times=lambda at: signal(at).timestamps)


def _can_log(signals: Sequence[LoggedSignal]) -> _Table:
    """Return the signals of a log of CAN frames, each with the times of its messages."""
    return _Table(
        [signal.name for signal in signals],
        [stated_unit(signal.unit) for signal in signals],
        [signal.message for signal in signals],
        lambda at: signals[at].values,
        times=lambda at: signals[at].times,
    )


def _group_name(group: Any) -> str:
    """Return what an MDF calls a group of channels: name, source or comment; "": nothing."""
    source = getattr(group, "acq_source", None)
    names = (getattr(group, "acq_name", ""), getattr(source, "name", ""), getattr(group, "comment", ""))
    return next((cut(str(name).strip(), 60) for name in names if name and str(name).strip()), "")


def _units_beside(path: Path) -> Mapping[str, str]:
    """Return the units of recorded results, from the run record next to them.

    Raises:
        ValueError: the run record cannot be read.
    """
    beside = path.with_name(RUN_FILE)
    if path.stem != "results" or not beside.exists():
        return {}
    try:
        record = check_record(json.loads(read_bytes(beside, largest=LARGEST)), beside)
    except (OSError, ValueError, RecursionError, ResultsError) as error:
        raise ValueError(f"the {RUN_FILE} beside it cannot be read: {reason(error)}") from None
    return {name: unit for name, unit in record.units.items() if unit} if record.results == path.name else {}


@contextlib.contextmanager
def reading_series(path: Path | str) -> Iterator[None]:
    """Like `files.reading` for files of time series, but raise ValueError."""
    try:
        with reading("file of time series", path, ScenarioError):
            try:
                yield
            except ValueError as error:
                raise ScenarioError(f"{path}: {error}", code="series-unreadable") from None
    except ScenarioError as error:
        raise ValueError(str(error.diagnostics[0])) from error.__cause__


def numbers_in(column: np.ndarray, unit: str | None, wanted: Unit | None, says: str, what: str) -> np.ndarray:
    """Convert a column to numbers in a unit, NaN where none was taken.

    A column without a unit is taken to be in that unit.

    Args:
        column: numbers or text.
        unit: of the column.
        wanted, says: the unit to convert to, and its name for messages.
        what: name of the column for messages.

    Raises:
        ValueError: the column is not numeric, not finite or without any number, or its unit does not fit.
    """
    numbers = _numbers(column, what)
    if unit is None or wanted is None:
        return numbers
    gain, offset = factors(unit, wanted, says, what)
    return numbers if (gain, offset) == (1.0, 0.0) else gain * numbers + offset


def _numbers(column: np.ndarray, what: str) -> np.ndarray:
    """Convert a column to numbers; None and NaN are values that were not taken."""
    if column.dtype.kind in "mM":
        raise ValueError(f"{what} has times, not numbers")
    numbers = np.full(column.size, np.nan)
    try:
        numbers[:] = column
    except (TypeError, ValueError):
        for row, cell in enumerate(column):
            try:
                numbers[row] = np.nan if str(cell).strip().lower() in MISSING else float(cell)
            except (TypeError, ValueError):  # noqa: PERF203 - the first ends the loop
                raise ValueError(f"{what}: value {row + 1} is not a number ({cell!r})") from None
    refuse_infinite(numbers, what)
    if np.isnan(numbers).all():
        raise ValueError(f"{what} has no values")
    return numbers


def unit_of(name: str, column: str, stated: str | None, wanted: str) -> str:
    """Return the unit of a signal's column or of the time column.

    Raises:
        ValueError: neither the description nor the file states it; only plain numbers may have none.
    """
    unit = stated or (wanted if wanted == "1" else None)
    if unit is None:
        raise ValueError(
            f"column {column!r} has no unit, such as {listed(spellings(wanted), last='or')}: write "
            f"'{name}: {{column: {column}, unit: {wanted}}}', or in the file's header '{column} [{wanted}]'"
        )
    return unit

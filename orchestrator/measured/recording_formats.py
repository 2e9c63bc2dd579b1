"""Files of recorded columns: CSV, Parquet and ASAM MDF 4.

CSV is separated by `,`, `;`, tab, `|` or spaces, in UTF-8, UTF-16 or Latin-1 (Windows-1252). Its numbers may
have a decimal comma if the comma does not separate. A header may name a unit, `delta [deg]`, and CSV may have
a row of units below its header; Parquet has units in the metadata of fields, MDF in channels. The units of
results of this program are in the run.json next to them.
"""

from __future__ import annotations

import contextlib
import csv
import hashlib
import io
import itertools
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vocabulary.signals import SignalEntry

from ..cache import changed_since, has_checksums, warn_of_record
from ..errors import ScenarioError
from ..messages import hint, listed
from ..safe_files import read_bytes, reading, reason
from ..scenario.quantities import Unit, gain_and_offset, meant_unit, measure_of, spellings

LARGEST = 1_000_000_000
"""Bytes of a file. Chosen: it fits into memory."""
BESIDE = "run.json"
_HEADER = re.compile(r"(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]\s*")
_INDEXED = re.compile(r".*\w\[[\d, ]+\]\s*")


class FileColumn(NamedTuple):
    """A column as in the file, and the times of its values."""

    times: np.ndarray  # shape (rows,) [time_unit]
    values: np.ndarray  # shape (rows,), numbers or text
    time_unit: str | None
    unit: str | None


class _Table(NamedTuple):
    """The columns of a file, independent of its format; the callables take the index of a column."""

    headers: list[str]
    units: Sequence[str | None]  # where the format has them apart from headers
    values: Callable[[int], np.ndarray]
    times: Callable[[int], np.ndarray] | None = None  # in s, if every column has its own times


class ColumnFile:
    """A file of columns, read into memory.

    Raises:
        OSError: the file cannot be read.
        ValueError: its content is not usable; also raised by `column`.
    """

    def __init__(self, path: Path) -> None:
        raw = read_bytes(path, largest=LARGEST)
        self.sha256 = hashlib.sha256(raw).hexdigest()
        kinds: dict[str, Callable[[bytes], _Table]] = {
            ".csv": _csv, ".tsv": _csv, ".txt": _csv, ".parquet": _parquet, ".mf4": _mdf,
        }  # fmt: skip
        if path.suffix.lower() not in kinds:
            raise ValueError(f"must be a file of type {', '.join(kinds)}")
        self._table = kinds[path.suffix.lower()](raw)
        self._clocks: dict[int, np.ndarray] = {}
        self._names: list[str] = []
        self._units: list[str | None] = []
        beside = _units_beside(path)
        for header, unit in zip(self._table.headers, self._table.units, strict=True):
            known = unit or beside.get(header)
            parts = None if known and _INDEXED.fullmatch(header) else _HEADER.fullmatch(header)
            name = parts["name"] if parts else header.strip()
            self._names.append(name)
            self._units.append((parts and parts["unit"].strip()) or known or beside.get(name))

    def column(self, name: str, time: str) -> FileColumn:
        """Return a column with its times: those of the column `time`, in MDF those of the channel."""
        table, at = self._table, self._find(name)
        if table.times:
            return FileColumn(table.times(at), table.values(at), "s", self._units[at])
        clock = self._find(time)
        if clock not in self._clocks:
            self._clocks[clock] = table.values(clock)
        return FileColumn(self._clocks[clock], table.values(at), self._units[clock], self._units[at])

    def _find(self, name: str) -> int:
        for names in (self._names, self._table.headers):
            indices = [i for i, column in enumerate(names) if column == name]
            if len(indices) > 1:
                raise ValueError(f"{len(indices)} columns are called {name!r}")
            if indices:
                return indices[0]
        raise ValueError(f"has no column {name!r}{hint(name, self._names, lead='it has')}")


def _csv(raw: bytes) -> _Table:
    """Return the table of a CSV file; its text is parsed again for every column, to save memory."""
    encoding = _encoding(raw)
    first, _, rest = raw[:HEADING].decode(encoding, "replace").partition("\n")
    separator = max(SEPARATORS, key=first.count)
    spaced = separator not in first and len(first.split()) == len(rest.partition("\n")[0].split()) > 1

    def rows() -> Iterator[list[str]]:
        text = io.TextIOWrapper(io.BytesIO(raw), encoding=encoding, newline="")
        lines = (line.split() for line in text) if spaced else csv.reader(text, delimiter=separator)
        return itertools.islice(filter(None, lines), head, None)

    def values(at: int) -> np.ndarray:
        cells: Iterable[str] = map(itemgetter(at), rows())
        if spaced or separator != ",":
            cells = (cell.replace(",", ".") for cell in cells)
        try:
            return np.fromiter(map(float, cells), float)
        except ValueError:
            return np.array([row[at] for row in rows()], dtype=object)

    head = 0
    headers, below = [*itertools.islice(rows(), 2), [], []][:2]
    units = _row_of_units(below) if len(below) == len(headers) else None
    head = 2 if units else 1
    last = head
    for last, row in enumerate(rows(), start=head + 1):
        if len(row) != len(headers):
            raise ValueError(f"row {last} has {len(row)} values for {len(headers)} columns")
    if last == head:
        raise ValueError("has no rows")
    return _Table(headers, units or [None] * len(headers), values)


SEPARATORS = ",;\t|"
HEADING = 100_000
"""Bytes in which the first two lines of a CSV file end. Chosen: some thousand columns."""


def _encoding(raw: bytes) -> str:
    """Return the encoding of a text.

    Raises:
        ValueError: not a text.
    """
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if b"\0" in raw:
        raise ValueError("is not text")
    try:
        raw.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252" if not _UNDEFINED.intersection(raw) else "latin-1"
    return "utf-8-sig"


_UNDEFINED = frozenset(b"\x81\x8d\x8f\x90\x9d")
"""Bytes that Windows-1252 does not define; Latin-1 does."""


def _row_of_units(row: Sequence[str]) -> list[str | None] | None:
    """Return the unit of each column from a row of units, None if the row has a number or no unit at all.

    An empty cell and `-` mean no unit.
    """
    cells = [cell.strip().removeprefix("[").removesuffix("]").strip() for cell in row]
    units = [cell if cell not in ("", "-") else None for cell in cells]
    return units if any(units) and not any(map(_is_number, cells)) else None


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _parquet(raw: bytes) -> _Table:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(pa.BufferReader(raw))
    except pa.ArrowInvalid as error:
        raise ValueError(f"is not a Parquet file, or damaged: {error}") from None
    units = [(field.metadata or {}).get(b"unit", b"").decode() for field in table.schema]
    return _Table(table.column_names, units, lambda at: table.column(at).to_numpy())


def _mdf(raw: bytes) -> _Table:
    try:
        import asammdf
    except ImportError:
        raise ValueError("ASAM MDF needs the package asammdf: pip install 'yawbench[mdf]'") from None
    try:
        mdf: Any = asammdf.MDF(io.BytesIO(raw))
        channels = [
            (group, index, channel.name, channel.unit)
            for group, channels in enumerate(mdf.groups)
            for index, channel in enumerate(channels.channels)
            if index != mdf.masters_db.get(group)
        ]
    except Exception as error:  # asammdf raises whatever its parsing meets
        why = re.sub(r'"?<_io\.BytesIO[^>]*>"?', "it", " ".join(str(error).split()))
        raise ValueError(f"is not an MDF file, or damaged: {why}") from None

    def signal(at: int) -> Any:
        group, index, *_ = channels[at]
        return mdf.get(group=group, index=index)

    def values(at: int) -> np.ndarray:
        samples = signal(at).samples
        return np.char.decode(samples, "utf-8").astype(object) if samples.dtype.kind == "S" else samples

    headers, units = [name for _, _, name, _ in channels], [unit for *_, unit in channels]
    return _Table(headers, units, values, times=lambda at: signal(at).timestamps)


def _units_beside(path: Path) -> Mapping[str, str]:
    """Return the units of recorded results, from the run record next to them.

    Raises:
        ValueError: the run record was changed after its run, or cannot be read.
    """
    if path.stem != "results":
        return {}
    beside = path.parent / BESIDE
    try:
        record = json.loads(read_bytes(beside, largest=LARGEST))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(f"the {BESIDE} beside it cannot be read: {reason(error)}") from None
    if not isinstance(record, dict) or record.get("results", "results.csv") != path.name:
        return {}
    if words := changed_since(record):
        raise ValueError(f"the {BESIDE} beside it is not what the run has written: {words}")
    units = record.get("units")
    if isinstance(units, dict) and not has_checksums(record):
        warn_of_record(f"{beside}: has no checksums; its units are taken as they are")
    return {str(name): str(unit) for name, unit in units.items() if unit} if isinstance(units, dict) else {}


SECOND = measure_of("s")


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
    """Convert a column to finite numbers in a unit; a column without a unit is taken to be in that unit.

    Args:
        column: numbers or text.
        unit: of the column.
        wanted, says: the unit to convert to, and its name for messages.
        what: name of the column for messages.

    Raises:
        ValueError: the column is not numeric, not finite, or in an incompatible unit.
    """
    numbers = _numbers(column, what)
    if unit is None or wanted is None:
        return numbers
    between = gain_and_offset(unit, wanted)
    if between is None:
        raise ValueError(f"{what}: its unit {unit!r} does not fit: {says} is wanted")
    gain, offset = between
    return numbers if between == (1.0, 0.0) else gain * numbers + offset


def _numbers(column: np.ndarray, what: str) -> np.ndarray:
    """Convert a column to finite numbers."""
    try:
        numbers = column.astype(float)
    except (TypeError, ValueError):
        for row, cell in enumerate(column, start=1):
            try:
                float(cell)
            except (TypeError, ValueError):  # noqa: PERF203 - the first ends the loop
                raise ValueError(f"{what}: value {row} is not a number ({cell!r})") from None
        raise
    bad = np.flatnonzero(~np.isfinite(numbers))
    if bad.size:
        raise ValueError(f"{what}: value {bad[0] + 1} is not finite ({numbers[bad[0]]:g})")
    return numbers


SHARE_OF_SPIKES = 0.01
"""Share of samples that may exceed the largest plausible value; chosen: accelerometers have spikes."""


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


def refuse_implausible(
    name: str, entry: SignalEntry, column: str, recorded: np.ndarray, values: np.ndarray, unit: str
) -> None:
    """Raise ValueError if values of a signal are implausible for a car; suggest the unit that was meant.

    Args:
        name, entry: the signal.
        column: heading of its column.
        given: the numbers of the column, in `unit`.
        values: the same in SI.
        unit: unit of the column.
    """
    largest, wanted = entry.largest, entry.unit
    if largest is None or np.mean(np.abs(values) > largest) <= SHARE_OF_SPIKES:
        return
    number = float(np.quantile(np.abs(recorded.astype(float)), 1.0 - SHARE_OF_SPIKES))
    likely = meant_unit(number, unit, wanted, lambda value: abs(value) <= largest)
    value = f"{number:.4g} {unit}" if unit != "1" else f"{number:.4g}"
    raise ValueError(
        f"column {column!r}: no car reaches {name} of {value}, "
        f"at most {largest:.4g} {wanted} is allowed{f'; did you mean {likely!r}?' if likely else ''}"
    )

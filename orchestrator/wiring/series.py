"""Reads time series for inputs from files, converted to unit and type of the input and checked for the run.

Formats are CSV (separated by `,`, `;` or tab), Parquet and ASAM MDF 4. A header may name a unit,
`delta [deg]`, and CSV may have a row of units below its header; Parquet has units in the metadata of fields,
MDF in channels. The units of results of this program are in the run.json next to them.
"""

from __future__ import annotations

import contextlib
import csv
import hashlib
import io
import itertools
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..cache_and_checksums import changed_since, has_checksums, warn_of_record
from ..errors import ScenarioError
from ..files import read_bytes, reading, reason
from ..messages import hint
from ..plan import InputSeries, Value, Variable
from ..scenario.find_and_load import LoadedScenario
from ..scenario.quantities import Unit, gain_and_offset, measure_of
from ..scenario.scenario_schema import SeriesSpec
from .parameters import value_for

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


class SeriesFile:
    """A file of columns, read into memory.

    Raises:
        OSError: the file cannot be read.
        ValueError: its content is not usable; also raised by `column`.
    """

    def __init__(self, path: Path) -> None:
        raw = read_bytes(path, largest=LARGEST)
        self.sha256 = hashlib.sha256(raw).hexdigest()
        kinds: dict[str, Callable[[bytes], _Table]] = {".csv": _csv, ".parquet": _parquet, ".mf4": _mdf}
        if path.suffix.lower() not in kinds:
            raise ValueError(f"must be a file of type {', '.join(kinds)}")
        self._table = kinds[path.suffix.lower()](raw)
        self._names: list[str] = []
        self._units: list[str | None] = []
        beside = _units_beside(path)
        for header, unit in zip(self._table.headers, self._table.units, strict=True):
            known = unit or beside.get(header)
            found = None if known and _INDEXED.fullmatch(header) else _HEADER.fullmatch(header)
            name = found["name"] if found else header.strip()
            self._names.append(name)
            self._units.append((found and found["unit"].strip()) or known or beside.get(name))

    def column(self, name: str, time: str) -> FileColumn:
        """Return a column with its times: those of the column `time`, in MDF those of the channel."""
        table, at = self._table, self._find(name)
        if table.times:
            return FileColumn(table.times(at), table.values(at), "s", self._units[at])
        clock = self._find(time)
        return FileColumn(table.values(clock), table.values(at), self._units[clock], self._units[at])

    def _find(self, name: str) -> int:
        for names in (self._names, self._table.headers):
            found = [i for i, one in enumerate(names) if one == name]
            if len(found) > 1:
                raise ValueError(f"{len(found)} columns are called {name!r}")
            if found:
                return found[0]
        raise ValueError(f"has no column {name!r}{hint(name, self._names, lead='it has')}")


def _csv(raw: bytes) -> _Table:
    """Return the table of a CSV file; its text is parsed again for every column, to save memory."""
    first = raw.partition(b"\n")[0].decode("utf-8-sig", "replace")
    delimiter = max(",;\t", key=first.count)

    def rows() -> Iterator[list[str]]:
        text = io.TextIOWrapper(io.BytesIO(raw), encoding="utf-8-sig", newline="")
        found = (row for row in csv.reader(text, delimiter=delimiter) if row)
        return itertools.islice(found, head, None)

    def values(at: int) -> np.ndarray:
        try:
            return np.fromiter((float(row[at]) for row in rows()), float)
        except ValueError:
            return np.array([row[at] for row in rows()], dtype=object)

    head = 0
    try:
        headers, below = [*itertools.islice(rows(), 2), [], []][:2]
        units = _row_of_units(below) if len(below) == len(headers) else None
        head = 2 if units else 1
        number = head
        for number, row in enumerate(rows(), start=head + 1):
            if len(row) != len(headers):
                raise ValueError(f"row {number} has {len(row)} values for {len(headers)} columns")
    except UnicodeDecodeError:
        raise ValueError("is not UTF-8") from None
    if number == head:
        raise ValueError("has no rows")
    return _Table(headers, units or [None] * len(headers), values)


def _row_of_units(row: Sequence[str]) -> list[str | None] | None:
    """Return the unit of each column from a row of units, None if the row has a number or no unit at all.

    An empty cell and `-` mean no unit.
    """
    cells = [cell.strip().removeprefix("[").removesuffix("]").strip() for cell in row]
    units = [cell if cell not in ("", "-") else None for cell in cells]
    return units if any(units) and not any(map(_is_number, cells)) else None


def _is_number(text: str) -> bool:
    try:
        float(text)
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
        places = [
            (group, index, channel.name, channel.unit)
            for group, one in enumerate(mdf.groups)
            for index, channel in enumerate(one.channels)
            if index != mdf.masters_db.get(group)
        ]
    except Exception as error:  # asammdf raises whatever its parsing meets
        raise ValueError(f"is not an MDF file, or damaged: {' '.join(str(error).split())}") from None

    def signal(at: int) -> Any:
        group, index, *_ = places[at]
        return mdf.get(group=group, index=index)

    def values(at: int) -> np.ndarray:
        samples = signal(at).samples
        return np.char.decode(samples, "utf-8").astype(object) if samples.dtype.kind == "S" else samples

    headers, units = [name for _, _, name, _ in places], [unit for *_, unit in places]
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


Reader = Callable[[SeriesSpec, str, Variable], InputSeries]
"""Callback: (specification, part matched by the `*` of its key, input) -> time series."""

SECOND = measure_of("s")


def series_reader(scenario: LoadedScenario) -> Reader:
    """Return a reader for the time series of a scenario, which reads every file once.

    The reader raises ValueError if the file or a column is missing or unusable, the unit is incompatible, or
    the times do not cover the run.
    """

    @cache
    def opened(file: str) -> SeriesFile:
        path = Path(os.path.normpath(scenario.path.parent / file))
        with reading_series(path):
            return SeriesFile(path)

    def read(spec: SeriesSpec, part: str, variable: Variable) -> InputSeries:
        file = opened(spec.file)
        name = (spec.column or variable.name).replace("*", part)
        with reading_series(spec.file):
            column = file.column(name, spec.time)
            times = numbers_in(column.times, column.time_unit, SECOND, "s", f"time {spec.time!r}")
            values = _values(column.values, column.unit, name, variable)
            _check_times(times, scenario, spec)
        held = spec.interpolation == "held" or variable.type != "Real"
        return InputSeries(spec.file, name, file.sha256, held, times, values)

    return read


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
            except (TypeError, ValueError):  # noqa: PERF203 - it is the first
                raise ValueError(f"{what}: value {row} is not a number ({cell!r})") from None
        raise
    bad = np.flatnonzero(~np.isfinite(numbers))
    if bad.size:
        raise ValueError(f"{what}: value {bad[0] + 1} is not finite ({numbers[bad[0]]:g})")
    return numbers


def _values(column: np.ndarray, unit: str | None, name: str, variable: Variable) -> np.ndarray:
    """Convert the values of a column to the type and unit of a variable."""
    if variable.type == "Real":
        wanted = measure_of(variable.unit, variable.definition)
        numbers = numbers_in(column, unit, wanted, variable.unit or "none", f"column {name!r}")
        for extreme in (numbers.min(), numbers.max()):
            value_for(variable, float(extreme))
        return numbers
    taken = np.empty(len(column), dtype=object)
    for i, cell in enumerate(column.tolist()):
        try:
            taken[i] = value_for(variable, _plain(cell, variable))
        except ValueError as error:  # noqa: PERF203 - the first is told
            raise ValueError(f"column {name!r}: value {i + 1} {error}") from None
    return taken


def _plain(cell: Any, variable: Variable) -> Value:
    """Return a cell as in a scenario: files have whole numbers as floats, and booleans as 0 and 1."""
    if variable.type == "Boolean" and cell in (0, 1):
        return bool(cell)
    return int(cell) if isinstance(cell, float) and cell.is_integer() else cell


def _check_times(times: np.ndarray, scenario: LoadedScenario, spec: SeriesSpec) -> None:
    back = np.flatnonzero(np.diff(times) <= 0)
    if back.size:
        at = int(back[0]) + 1
        raise ValueError(f"time must increase: {times[at]:g} s follows {times[at - 1]:g} s (value {at + 1})")
    if spec.extrapolate == "hold":
        return
    start, stop = float(scenario.start_time), float(scenario.stop_time)
    slack = 1e-9 * max(abs(start), abs(stop))
    last = float(times[-1])
    if spec.interpolation == "held" and len(times) > 1:
        last += float(times[-1] - times[-2])  # the last value holds as long as the previous one
    if times[0] > start + slack or last < stop - slack:
        raise ValueError(
            f"covers {times[0]:g} to {times[-1]:g} s of a run from {start:g} to {stop:g} s; "
            "'extrapolate: hold' would hold its ends"
        )

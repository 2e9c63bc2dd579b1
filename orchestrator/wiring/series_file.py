"""Files of time series: columns by name, with the units of measurement that their headers give.

CSV (`,`, `;` or tab), Parquet, ASAM MDF 4. A header may name a unit, `delta [deg]`, and CSV may have a row
of units below its header; Parquet has it in the field's metadata, MDF in the channel. Results of a run here
have theirs in the run.json beside them.
"""

from __future__ import annotations

import csv
import hashlib
import io
import itertools
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .. import checksums
from ..files import read_bytes, reason
from ..wording import hint

LARGEST = 1_000_000_000
"""Bytes of a file. Chosen: it is held in memory."""
BESIDE = "run.json"
_HEADER = re.compile(r"(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]\s*")


class Column(NamedTuple):
    """A column as it stands in the file, and the times of its values."""

    times: np.ndarray  # shape (rows,) [time_unit]
    values: np.ndarray  # shape (rows,), numbers or text
    time_unit: str | None
    unit: str | None


class _Table(NamedTuple):
    """Columns as a kind of file has them; their functions take the number of a column."""

    headers: list[str]
    units: Sequence[str | None]  # beside the headers
    values: Callable[[int], np.ndarray]
    times: Callable[[int], np.ndarray] | None = None  # if every column has its own, in s


class SeriesFile:
    """A file of columns, read into memory.

    Raises:
        OSError: it cannot be read.
        ValueError: a sentence; so does `column`.
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
            found = _HEADER.fullmatch(header)
            name = found["name"] if found else header.strip()
            self._names.append(name)
            self._units.append((found and found["unit"].strip()) or unit or beside.get(name))

    def column(self, name: str, time: str) -> Column:
        """Return a column and the one of its times, which in MDF every channel has of its own."""
        table, at = self._table, self._find(name)
        if table.times:
            return Column(table.times(at), table.values(at), "s", self._units[at])
        clock = self._find(time)
        return Column(table.values(clock), table.values(at), self._units[clock], self._units[at])

    def _find(self, name: str) -> int:
        for names in (self._names, self._table.headers):
            found = [i for i, one in enumerate(names) if one == name]
            if len(found) > 1:
                raise ValueError(f"{len(found)} columns are called {name!r}")
            if found:
                return found[0]
        raise ValueError(f"has no column {name!r}{hint(name, self._names, lead='it has')}")


def _csv(raw: bytes) -> _Table:
    """Return the table of a file whose rows are read again for every column: as text, all would be large."""
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
    """Return what a row of units says of each column, None if it is a row of values, which has a number.

    Nothing and `-` stand for no unit.
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
        raise ValueError(f"is no Parquet file, or damaged: {error}") from None
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
        raise ValueError(f"is no MDF file, or damaged: {' '.join(str(error).split())}") from None

    def signal(at: int) -> Any:
        group, index, *_ = places[at]
        return mdf.get(group=group, index=index)

    def values(at: int) -> np.ndarray:
        samples = signal(at).samples
        return np.char.decode(samples, "utf-8").astype(object) if samples.dtype.kind == "S" else samples

    headers, units = [name for _, _, name, _ in places], [unit for *_, unit in places]
    return _Table(headers, units, values, times=lambda at: signal(at).timestamps)


def _units_beside(path: Path) -> Mapping[str, str]:
    """Return the units of recorded results.

    Raises:
        ValueError: the record beside them is not what their run has written.
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
    if words := checksums.changed_since(record):
        raise ValueError(f"the {BESIDE} beside it is not what the run has written: {words}")
    units = record.get("units")
    if isinstance(units, dict) and not checksums.has_checksums(record):
        checksums.warn(f"{beside}: has no checksums; its units are taken as they are")
    return {str(name): str(unit) for name, unit in units.items() if unit} if isinstance(units, dict) else {}

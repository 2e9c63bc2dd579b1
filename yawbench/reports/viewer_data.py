"""Recorded signals as a page carries them: every sample, compressed, decoded by the browser.

A run is one block of bytes: each column as first or second differences of integer codes over the range that
all runs of the page share, in byte planes; compressed by gzip, in base64. Codes have 16 bits, or 24 where
another run is so close that their difference would be rounding; zero has a code of its own. Columns with
values that are not finite are 32-bit floats. Equal columns, such as both ends of a wire, share their bytes.
Samples are never thinned in time. `static/viewer_data.js` is the other half.

Sizes, paper A at 25 m/s, 4 runs of 216 columns and 8,001 rows: 0.65 MB; plain 32-bit floats take 9.2 MB.
"""

from __future__ import annotations

import base64
import gzip
import math
import zlib
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any, Literal

import numpy as np

from yawbench.metrics.expressions import while_moving
from yawbench.orchestrator.results.reader import Results

LEVELS = {2: 2**16 - 2, 3: 2**24 - 2}
"""Bytes of a code -> steps over a range. A sample is off by at most half a step: 1/131068 of the range, or
1/33554428."""
LEVEL = 7
"""Compression level of gzip. Chosen: a third of the time of the highest one, for a hundredth more bytes."""
CLOSE = 0.01
"""Share of the range within which two runs count as close, and have the finer codes."""


@dataclass(frozen=True)
class PackedColumn:
    """A column: its form, what decodes it, and its byte planes (none for a constant).

    The forms are ("q", first, step, order, bytes): codes as differences of that order, a sample is
    (first + code) step; ("f",): differences of the bits of 32-bit floats; ("r",): 32-bit floats as they are;
    ("c", value): a constant; of times also ("d",): 64-bit floats, and ("u", begin, end): evenly spaced.
    """

    form: Literal["q", "f", "r", "c", "d", "u"]
    numbers: tuple[float, ...] = ()
    planes: bytes = b""


@dataclass(frozen=True)
class PackedRun:
    """A run's samples: its times and columns, each packed by itself."""

    rows: int
    time: PackedColumn
    columns: dict[str, PackedColumn]
    address: str = ""
    """Address from which the page loads the bytes; "": it carries them."""

    def only(self, names: Collection[str]) -> PackedRun:
        """Return the run with some of its columns."""
        return replace(self, columns={name: column for name, column in self.columns.items() if name in names})

    @cached_property
    def _offsets(self) -> dict[bytes, int]:
        """Byte planes -> their offset in the block; equal ones are stored once."""
        offsets: dict[bytes, int] = {b"": 0}
        size = 0
        for column in (self.time, *self.columns.values()):
            if column.planes not in offsets:
                offsets[column.planes] = size
                size += len(column.planes)
        return offsets

    @property
    def data(self) -> bytes:
        """All byte planes."""
        return b"".join(self._offsets)

    @cached_property
    def block(self) -> str:
        """The bytes as a page carries them: compressed, in base64."""
        return base64.b64encode(gzip.compress(self.data, LEVEL, mtime=0)).decode("ascii")

    @property
    def header(self) -> dict[str, Any]:
        """Header from which the script decodes the block: of times and each column [form, offset, ...]."""

        def place(column: PackedColumn) -> list[Any]:
            return [column.form, self._offsets[column.planes], *column.numbers]

        columns = {name: place(column) for name, column in self.columns.items()}
        return {"rows": self.rows, "time": place(self.time), "columns": columns}


def pack(runs: Sequence[Results], *, raw: bool = False) -> list[PackedRun]:
    """Pack all numeric columns of runs; angles of velocities are NaN while a car stands.

    Args:
        runs: those of one page.
        raw: leave all columns 32-bit floats, for a page that gets the bytes from a server: nothing to
            compress, and the page reads them at once.
    """
    runs = [*map(while_moving, runs)]
    ranges = _ranges(runs)
    return [_packed(run, ranges, fine, raw) for run, fine in zip(runs, _close(runs, ranges), strict=True)]


def is_numeric(values: np.ndarray) -> bool:
    """Return whether a column holds numbers; String variables do not."""
    return np.issubdtype(values.dtype, np.number) or values.dtype == bool


def _ranges(runs: Sequence[Results]) -> dict[str, tuple[float, float]]:
    """Return the smallest and largest finite value of every column over all runs."""
    ranges: dict[str, tuple[float, float]] = {}
    for run in runs:
        for name, values in run.columns.items():
            if not is_numeric(values):
                continue
            finite = values[np.isfinite(values)] if values.dtype.kind == "f" else values
            low, high = ranges.get(name, (np.inf, -np.inf))
            if finite.size:
                low, high = min(low, float(finite.min())), max(high, float(finite.max()))
            ranges[name] = (low, high)
    return ranges


def _close(runs: Sequence[Results], ranges: dict[str, tuple[float, float]]) -> list[set[str]]:
    """Return, for each run, the columns in which another of its length differs, but by less than `CLOSE` of
    the range."""
    close: list[set[str]] = [set() for _ in runs]
    of_length: dict[int, list[int]] = {}
    for i, run in enumerate(runs):
        of_length.setdefault(run.time.size, []).append(i)
    for alike, (name, (low, high)) in product(of_length.values(), ranges.items()):
        having = [i for i in alike if name in runs[i].columns]
        if len(having) < 2 or high <= low:
            continue
        columns = np.array([np.asarray(runs[i].columns[name], float) for i in having])
        for k in range(len(having) - 1):
            with np.errstate(invalid="ignore"):
                apart = np.abs(columns[k + 1 :] - columns[k])
            apart[~np.isfinite(apart)] = 0.0
            most = apart.max(axis=1, initial=0.0)
            near = np.flatnonzero((most > 0.0) & (most < CLOSE * (high - low)))
            for j in (k, *(k + 1 + near)) if near.size else ():
                close[having[j]].add(name)
    return close


def _packed(run: Results, ranges: dict[str, tuple[float, float]], fine: set[str], raw: bool) -> PackedRun:
    columns: dict[str, PackedColumn] = {}
    for name, values in run.columns.items():
        if not is_numeric(values):
            continue
        low, high = ranges[name]
        values = np.asarray(values, float)
        size = 3 if name in fine else 2
        step = (high - low) / LEVELS[size]
        if np.isfinite(values[:1]).all() and (values == values[:1]).all():
            columns[name] = PackedColumn("c", (float(values[0]),))
        elif raw:
            columns[name] = PackedColumn("r", (), values.astype("<f4").tobytes())
        elif not (0.0 < step < np.inf and np.isfinite(values).all()):
            columns[name] = PackedColumn("f", (), _float_planes(values))
        else:
            first = math.floor(low / step)
            order, planes = _code_planes(np.rint(values / step) - first, size)
            columns[name] = PackedColumn("q", (first, step, order, size), planes)
    return PackedRun(run.time.size, _packed_time(run.time), columns)


def _packed_time(time: np.ndarray) -> PackedColumn:
    """Return evenly spaced times as their ends, others as 64-bit floats."""
    if time.size > 1:
        even = np.linspace(time[0], time[-1], time.size)
        if np.allclose(time, even, rtol=0.0, atol=1e-9):
            return PackedColumn("u", (float(time[0]), float(time[-1])))
    raw = np.ascontiguousarray(time, "<f8").view(np.uint8).reshape(-1, 8)
    return PackedColumn("d", (), raw.T.tobytes())


def _code_planes(codes: np.ndarray, size: int) -> tuple[int, bytes]:
    """Return the order of differences that compresses best, and the zigzagged differences in byte planes.

    Args:
        codes: integers from 0 below 256**size.
        size: bytes of a code. Differences are modulo 256**size; the lowest bytes come first.
    """
    best: tuple[int, int, bytes] | None = None
    bits = 8 * size
    steps = codes.astype(np.int64)
    for order in (1, 2):
        steps = np.diff(steps, prepend=0)
        signed = ((steps + (1 << (bits - 1))) & ((1 << bits) - 1)) - (1 << (bits - 1))
        folded = ((signed << 1) ^ (signed >> 63)).astype("<u4")
        planes = folded.view(np.uint8).reshape(-1, 4)[:, :size].T.tobytes()
        packed = len(zlib.compress(planes, 1))
        if best is None or packed < best[0]:
            best = packed, order, planes
    assert best is not None
    return best[1:]


def _float_planes(values: np.ndarray) -> bytes:
    """Return the differences of the bits of 32-bit floats, in four byte planes."""
    with np.errstate(over="ignore"):
        bits = np.ascontiguousarray(values, "<f4").view("<u4").astype(np.int64)
    steps = (np.diff(bits, prepend=0) & 0xFFFFFFFF).astype("<u4")
    planes: np.ndarray = steps.view(np.uint8).reshape(-1, 4).T
    return planes.tobytes()

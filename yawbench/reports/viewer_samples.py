"""Recorded signals as a page carries them: every sample, compressed, decoded by the browser.

There is one encoding, for times and signals: a sample is base + code step, and the codes of a column, 32-bit
integers, are stored as second differences, zigzagged, the lowest bytes of all samples before the next ones. A
run is one block of its columns' bytes; in a file it is compressed by gzip and written in base64. Negative
codes stand for values that are not finite. Equal columns, such as both ends of a wire, share their bytes.
Samples are never thinned in time. `static/viewer_data.js` is the other half.

The step is a part of the range that all runs of the page share: `COARSE`, or `FINE` where another run is so
close that their difference would be rounding, or `EXACT`. Zero has a code of its own.

Sizes of the samples, paper A at 25 m/s, 4 runs of 64 columns and 8,001 rows: 0.48 MB. Without the order of
the bytes 0.63 MB, without the differences 1.9 MB, as 32-bit floats 5.7 MB, all of them compressed.
"""

from __future__ import annotations

import base64
import gzip
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from yawbench.metrics.expressions import while_moving
from yawbench.orchestrator.results.reader import Results

COARSE, FINE, EXACT = 2**16 - 2, 2**24 - 2, 2**31 - 2
"""Steps over a range. A sample is off by at most half a step: 1/131068 of the range, 1/33554428, and less
than a 32-bit float of the size of the range."""
NAN, MINUS, PLUS = -1, -2, -3
"""Codes of values that are not finite: no number, minus and plus infinity."""
LEVEL = 7
"""Compression level of gzip. Chosen: a third of the time of the highest one, for a hundredth more bytes."""
CLOSE = 0.01
"""Share of the range within which two runs count as close, and have the finer steps."""


@dataclass(frozen=True)
class PackedColumn:
    """A column: a sample is base + code step; `data` has the codes."""

    base: float
    step: float
    data: bytes


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
        """Bytes of a column -> their offset in the block; equal ones are stored once."""
        different = dict.fromkeys(column.data for column in (self.time, *self.columns.values()))
        return {data: 4 * self.rows * number for number, data in enumerate(different)}

    @property
    def data(self) -> bytes:
        """The bytes of all columns."""
        return b"".join(self._offsets)

    @cached_property
    def block(self) -> str:
        """The bytes as a page carries them: compressed, in base64."""
        return base64.b64encode(gzip.compress(self.data, LEVEL, mtime=0)).decode("ascii")

    @property
    def header(self) -> dict[str, Any]:
        """Header from which the script decodes the block: of times and each column [offset, base, step]."""

        def place(column: PackedColumn) -> list[float]:
            return [self._offsets[column.data], column.base, column.step]

        columns = {name: place(column) for name, column in self.columns.items()}
        return {"rows": self.rows, "time": place(self.time), "columns": columns}


def pack(runs: Sequence[Results], *, exact: bool = False) -> list[PackedRun]:
    """Pack all numeric columns of runs; angles of velocities are NaN while a car stands.

    Args:
        runs: those of one page.
        exact: the finest steps for all columns, for a page that gets the bytes from a server, uncompressed.
    """
    runs = [*map(while_moving, runs)]
    ranges = _ranges(runs)
    return [_packed(run, ranges, fine, exact) for run, fine in zip(runs, _close(runs, ranges), strict=True)]


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


def _packed(run: Results, ranges: dict[str, tuple[float, float]], fine: set[str], exact: bool) -> PackedRun:
    columns: dict[str, PackedColumn] = {}
    for name, values in run.columns.items():
        if not is_numeric(values):
            continue
        values = np.asarray(values, float)
        low, high = ranges[name]
        finest = exact or not np.isfinite(values).all()
        levels = EXACT if finest else FINE if name in fine else COARSE
        step = high / levels - low / levels if low < high else 0.0
        base = math.floor(low / step) * step if step else low if low == high else 0.0
        columns[name] = _column(values, base, step)
    return PackedRun(run.time.size, _time(run.time), columns)


def _time(time: np.ndarray) -> PackedColumn:
    """Return times: those that are evenly spaced have this step."""
    begin, end = float(time[0]), float(time[-1])
    rows = time.size
    even = rows > 1 and np.allclose(time, np.linspace(begin, end, rows), rtol=0.0, atol=1e-9)
    return _column(time, begin, (end - begin) / (rows - 1 if even else EXACT))


def _column(values: np.ndarray, base: float, step: float) -> PackedColumn:
    """Return the codes of values."""
    finite = np.isfinite(values)
    codes = np.where(values > 0, PLUS, np.where(values < 0, MINUS, NAN)).astype("<i4")
    codes[finite] = np.clip(np.rint((values[finite] - base) / step), 0, EXACT + 1) if step else 0
    steps = np.diff(codes, 2, prepend=np.zeros(2, codes.dtype))  # modulo 2^32
    folded = (steps << 1) ^ (steps >> 31)
    return PackedColumn(base, step, folded.view(np.uint8).reshape(-1, 4).T.tobytes())

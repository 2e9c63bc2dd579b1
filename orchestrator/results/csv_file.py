"""Writing and reading results.csv, in blocks of rows: a long run needs no more memory than the rows kept.

`rows_text` writes numbers as Python's `repr` does, and reading them gives the same bits. A function in C does
it in a twentieth of the time; without a compiler Python does, with the same bytes.

`column_of` and `values_of` convert between NumPy arrays and Apache Arrow columns. Reals share their memory;
pyarrow's own conversions would import pandas first.
"""

from __future__ import annotations

import csv
import ctypes
import functools
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..files import open_regular
from ..messages import short
from .formats import plain

if TYPE_CHECKING:
    import pyarrow as pa


REAL = np.dtype(float)


def column_of(values: np.ndarray) -> pa.Array:
    """Return an array as an Arrow column."""
    import pyarrow as pa

    if values.dtype != REAL:
        return pa.array(values)
    memory = pa.py_buffer(np.ascontiguousarray(values))
    return pa.Array.from_buffers(pa.float64(), len(values), [None, memory])


def values_of(column: pa.Array) -> np.ndarray:
    """Return an Arrow column as an array."""
    import pyarrow as pa

    if column.type != pa.float64() or column.null_count or not len(column):
        copied: np.ndarray = column.to_numpy(zero_copy_only=False)
        return copied
    _, memory = column.buffers()
    return np.frombuffer(memory, REAL, len(column), REAL.itemsize * column.offset)


BLOCK = 8_000_000
"""Bytes read at a time; chosen: a few thousand rows of a hundred variables."""


LONGEST = 25
"""Characters that a number takes at most, with a comma: -1.7976931348623157e+308."""
_POWERS = range(-292, 325)
"""Exponents of the powers of ten that `rows_text.c` needs for all numbers of double precision."""


def rows_text(block: np.ndarray) -> bytes:
    """Return rows of numbers as lines of CSV; shape (rows, columns)."""
    writer = _writer()
    if writer is not None:
        return writer(np.ascontiguousarray(block))
    # repr of a list of lists is the fastest way in Python to format many shortest decimal numbers
    return (repr(block.tolist())[2:-2].replace("], [", "\n").replace(", ", ",") + "\n").encode()


@functools.cache
def _writer() -> Callable[[np.ndarray], bytes] | None:
    """Return the function in C, with its tables; None if it cannot be compiled here."""
    from fmus.compiler import load_compiled

    library, _ = load_compiled(Path(__file__).with_name("rows_text.c"))
    if library is None:
        return None
    function = library.rows_text
    function.restype = ctypes.c_int64
    powers = np.array([divmod(_power(k), 2**64) for k in _POWERS], np.uint64)

    def write(block: np.ndarray) -> bytes:
        text = ctypes.create_string_buffer(LONGEST * block.size)
        rows, columns = map(ctypes.c_int64, block.shape)
        addresses = [ctypes.c_void_p(array.ctypes.data) for array in (block, powers)]
        return ctypes.string_at(text, function(addresses[0], rows, columns, addresses[1], text))

    return write


def _power(k: int) -> int:
    """Return 10^k times a power of two that makes it a number of 128 bits, rounded up."""
    power: int = 10 ** abs(k)
    if k >= 0:
        bits = power.bit_length() - 128
        return power << -bits if bits <= 0 else -(-power >> bits)
    return -(-(1 << power.bit_length() + 127) // power)


class CsvFile:
    """A CSV file: the `names` of its columns, and its rows in blocks.

    Args:
        path: path of the file.
        texts: columns that hold text; None: those whose first value is not a number.

    Raises:
        OSError, ValueError: the file cannot be read; `blocks` raises them too.
    """

    def __init__(self, path: Path, texts: Sequence[str] | None = None) -> None:
        self._path = path
        try:
            with open_regular(path) as stream:
                lines = (_line(raw) for raw in iter(lambda: stream.readline(BLOCK), b""))
                self.names = [name.lstrip("\ufeff") for name in next(csv.reader(lines), [])]
                self._begin = stream.tell()  # the header may span several lines
                first = next(csv.reader(lines), [])
        except csv.Error as error:
            raise ValueError(str(error)) from None
        if texts is None:
            texts = [name for name, cell in zip(self.names, first, strict=False) if not _is_number(cell)]
        self._texts = set(texts)

    def blocks(self, columns: Sequence[str]) -> Iterator[list[np.ndarray]]:
        """Yield the chosen columns, a block of rows at a time."""
        import pyarrow as pa
        from pyarrow import csv as arrow

        types = {name: pa.string() if name in self._texts else pa.float64() for name in columns}
        with open_regular(self._path) as stream:
            stream.seek(self._begin)
            if not stream.read(1):
                return
            stream.seek(self._begin)
            try:
                for batch in arrow.open_csv(
                    stream,
                    arrow.ReadOptions(column_names=self.names, block_size=BLOCK),
                    arrow.ParseOptions(newlines_in_values=bool(self._texts), ignore_empty_lines=False),
                    arrow.ConvertOptions(include_columns=columns, column_types=types, null_values=[]),
                ):
                    yield [plain(values_of(column)) for column in batch]
            except pa.ArrowInvalid as error:
                raise ValueError(self._fault() or " ".join(str(error).split())) from None

    def _fault(self) -> str | None:
        """Return a sentence on the first malformed row, None if there is none."""
        with self._path.open(encoding="utf-8", errors="replace", newline="") as stream:
            reader = csv.reader(stream)
            try:
                next(reader)
                for row in reader:
                    if len(row) != len(self.names):
                        return f"line {reader.line_num} has {len(row)} values for {len(self.names)} columns"
                    for name, cell in zip(self.names, row, strict=True):
                        if name not in self._texts and not _is_number(cell):
                            return f"line {reader.line_num}: {short(cell)} in column {name!r} is not a number"
            except csv.Error as error:
                return f"line {reader.line_num}: {error}"
        return None


def _line(raw: bytes) -> str:
    if len(raw) == BLOCK:
        raise ValueError(f"a line is longer than {BLOCK} bytes")
    return raw.decode()


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True

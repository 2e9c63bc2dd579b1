"""Formats of result files: how rows of CSV are written and read; names and sizes of all formats.

CSV is written and read in blocks of rows: a long run needs no more memory than the rows kept. `rows_text`
writes numbers as Python's `repr` does, and reading them gives the same bits. A function in C does it in a
twentieth of the time; without a compiler Python does, with the same bytes.

`column_of` and `values_of` convert between NumPy arrays and Apache Arrow columns. Reals share their memory;
pyarrow's own conversions would import pandas first.
"""

from __future__ import annotations

import csv
import ctypes
import functools
import pkgutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import hint, in_bytes
from yawbench.foundation.safe_files import open_regular

if TYPE_CHECKING:
    import numpy as np
    import pyarrow as pa

    from ..plan import Plan


RESULTS_FILE = "results.csv"


@dataclass(frozen=True)
class Format:
    """A file format of results."""

    file: str
    says: str
    recorder: str  # "module:class" in this package that writes it, see `recorder.recorder_of`
    source: str  # "module:class" that reads it, see `reader.source_of`
    bytes: int  # per value; measured on one run of each of the papers A to D, rounded


FORMATS = {
    "csv": Format(
        RESULTS_FILE, "text that every program reads",
        "recorder:Recorder", "file_formats:CsvFile", bytes=17,
    ),
    "parquet": Format(
        "results.parquet", "Apache Parquet", "parquet:ParquetRecorder", "parquet:ParquetFile", bytes=7,
    ),
}  # fmt: skip
"""Format name -> format. CSV is the default: every program reads it, and killed runs can be salvaged."""
FILES = {name: format.file for name, format in FORMATS.items()}
"""Format name -> file name."""


def check_format(name: str) -> str:
    """Return the name of a format.

    Raises:
        ScenarioError: the format does not exist.
    """
    if name not in FORMATS:
        raise ScenarioError(
            f"--format {name}: no such format{hint(name, FORMATS, lead='there are')}", code="format-unknown"
        )
    return name


def load_class(path: str) -> Any:
    """Import and return a class that a format names."""
    return pkgutil.resolve_name(f"{__package__}.{path}")


class ResultsSource(Protocol):
    """A results file that is read in blocks of rows.

    Its methods raise OSError or ValueError if the file is not one that a run writes.
    """

    names: list[str]
    """Names of all columns, `time` first."""

    def blocks(self, columns: Sequence[str]) -> Iterator[list[np.ndarray]]:
        """Yield the chosen columns, a block of rows at a time, each passed through `plain`.

        Nothing is yielded if there are no rows. Booleans are 0 and 1.
        """


def plain(array: np.ndarray) -> np.ndarray:
    """Return a column in the type that `Results` uses: float64, or text."""
    return array.astype(str) if array.dtype.kind in "OSU" else array.astype(float, copy=False)


HUGE = 2e9
"""Size of results above which a run warns before it starts [bytes]. Chosen: takes a minute to read."""


def expected_size(plan: Plan, format: str) -> int:
    """Return the approximate size in bytes of the results of a run in a format."""
    return (plan.n_steps + 1) * (len(plan.record) + 1) * FORMATS[format].bytes


def size_note(plan: Plan, folder: Path, format: str) -> str | None:
    """Return a warning if the results will be huge, else None."""
    size = expected_size(plan, format)
    if size < HUGE:
        return None
    note = (
        f"{folder / FORMATS[format].file} will take about {in_bytes(size)} "
        f"({plan.n_steps + 1} rows of {len(plan.record)} variables)"
    )
    shorter = "name the variables that you need under 'record:' in the scenario"
    if format == "csv":
        return f"{note}; {shorter}, or take --format parquet ({in_bytes(expected_size(plan, 'parquet'))})"
    return f"{note}; {shorter}"


def column_of(values: np.ndarray) -> pa.Array:
    """Return an array as an Arrow column."""
    import numpy as np
    import pyarrow as pa

    if values.dtype != float:
        return pa.array(values)
    memory = pa.py_buffer(np.ascontiguousarray(values))
    return pa.Array.from_buffers(pa.float64(), len(values), [None, memory])


def values_of(column: pa.Array) -> np.ndarray:
    """Return an Arrow column as an array."""
    import numpy as np
    import pyarrow as pa

    if column.type != pa.float64() or column.null_count or not len(column):
        copied: np.ndarray = column.to_numpy(zero_copy_only=False)
        return copied
    _, memory = column.buffers()
    real = np.dtype(float)
    return np.frombuffer(memory, real, len(column), real.itemsize * column.offset)


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
        import numpy as np  # slow to import, and most commands ask for the names of formats alone

        return writer(np.ascontiguousarray(block))
    # repr of a list of lists is the fastest way in Python to format many shortest decimal numbers
    return (repr(block.tolist())[2:-2].replace("], [", "\n").replace(", ", ",") + "\n").encode()


@functools.cache
def _writer() -> Callable[[np.ndarray], bytes] | None:
    """Return the function in C, with its tables; None if it cannot be compiled here."""
    import numpy as np

    from yawbench.fmus.compiler import load_compiled

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


def _line(raw: bytes) -> str:
    """Return a line of a file; one that fills a block has no end.

    Raises:
        ValueError: it has none.
    """
    if len(raw) == BLOCK:
        raise ValueError(f"a line is longer than {BLOCK} bytes")
    return raw.decode()


class CsvFile:
    """A CSV file: the `names` of its columns, and its rows in blocks.

    Args:
        path: path of the file.
        texts: columns that hold text.

    Raises:
        OSError, ValueError: the file cannot be read; `blocks` raises them too.
    """

    def __init__(self, path: Path, texts: Sequence[str] = ()) -> None:
        self._path = path
        try:
            with open_regular(path) as stream:
                lines = map(_line, iter(lambda: stream.readline(BLOCK), b""))
                self.names = [name.lstrip("\ufeff") for name in next(csv.reader(lines), [])]
                self._begin = stream.tell()  # the header may span several lines
        except csv.Error as error:
            raise ValueError(str(error)) from None
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
                raise ValueError(" ".join(str(error).split())) from None

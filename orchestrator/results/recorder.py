"""Recorders: take the rows of a run, put results and record in place; the base of those of every format.

Both files are written under temporary names and renamed together at the end (see `run_folder`), so a
folder has either the earlier results or the new ones; the folder is locked while a run writes. Rows are
written in blocks during the run: whatever ends it, the rows recorded so far stay. Numbers are written so that
reading them gives the same bits.
"""

from __future__ import annotations

import contextlib
import csv
import io
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from yawbench.fmus.fmu import Value
from yawbench.foundation.errors import ResultsError
from yawbench.foundation.safe_files import reason, write_whole

from .file_formats import FORMATS, RESULTS_FILE, check_format, load_class, plain, rows_text
from .folder_lock import FolderLock
from .reader import Results
from .run_folder import PART, put_in_place, tidy
from .run_record import RUN_FILE, RunRecord

BLOCK = 512
"""Rows buffered in memory before they are written."""


class RowBlock:
    """The buffer for the latest rows of a run. Fill `rows` (and `others`), then call `write`.

    Args:
        columns: names in the header, `<instance>.<variable>`.
        real: which of them are Real; the values of the others go into `others`, one list per row.
    """

    def __init__(self, columns: Sequence[str], real: Sequence[bool]) -> None:
        self.written = 0
        self.columns = list(columns)
        self._order = [0, *_order(real)]
        self.rows = np.zeros((BLOCK, 1 + sum(real)))
        """Memory for the rows; other memory may take its place, shape (at most BLOCK, 1 + Reals)."""
        self.others: list[list[Value]] = []
        self._real = [name for name, is_real in zip(columns, real, strict=True) if is_real]
        self.looks: list[
            Callable[[np.ndarray], None]
        ] = []  # observers, called with every block: time, then Reals
        self._extremes = np.full((2, sum(real)), np.nan)

    def write(self, count: int) -> None:
        """Record the first `count` of `rows`, which can then be overwritten."""
        if count <= 0:
            return
        self._look_at(self.rows[:count])
        others = self.others[:count]
        self.others.clear()
        self._take(self.rows[:count], others)
        self.written += count

    def _take(self, block: np.ndarray, others: list[list[Value]]) -> None:
        """Store rows; the arrays will be overwritten after the call."""
        raise NotImplementedError

    def extremes(self) -> tuple[dict[str, float], dict[str, float]]:
        """Return the smallest and the largest value so far of every Real column."""
        smallest, largest = (dict(zip(self._real, row.tolist(), strict=True)) for row in self._extremes)
        return smallest, largest

    def _look_at(self, rows: np.ndarray) -> None:
        """Update the extremes with a block, ignoring NaN, and pass the block to the observers."""
        np.fmin(self._extremes[0], np.fmin.reduce(rows[:, 1:]), out=self._extremes[0])
        np.fmax(self._extremes[1], np.fmax.reduce(rows[:, 1:]), out=self._extremes[1])
        for look in self.looks:
            look(rows)


class Recorder(RowBlock):
    """Records a run on disk. Call `write` for every block; at the end `finish`.

    Args:
        folder: created if it does not exist.
        columns, real: see `RowBlock`.
        units: column -> unit, for formats that store it.

    Attributes:
        written_to: where the results are once the run has ended: `folder`, or a folder below it if the run
            failed and `folder` has results of a completed run.

    Raises:
        ResultsError: another run is writing into the folder, or it or a file in it cannot be written;
            the methods raise it too.
    """

    file = RESULTS_FILE
    rows_stay = True
    """Whether rows already written can be read if the run dies: only those of CSV, see `salvage`."""

    def __init__(
        self,
        folder: Path,
        columns: Sequence[str],
        real: Sequence[bool],
        units: Mapping[str, str | None] | None = None,
    ) -> None:
        super().__init__(columns, real)
        self.folder = self.written_to = folder
        self.units = dict(units or {})
        self._home = folder.absolute()  # an FMU may change the working directory
        self._path = self._home / f"{self.file}{PART}"
        self._run_path = self._home / f"{RUN_FILE}{PART}"
        self._lock = FolderLock(folder)
        try:
            tidy(self._home)
            # "x" does not follow a link of that name; a file that something truncates stays shorter
            append = lambda name, flags: os.open(name, flags | os.O_APPEND, 0o666)  # noqa: E731
            self._file = open(self._path, "xb", buffering=0, opener=append)  # noqa: SIM115
        except OSError as error:
            self._lock.release()
            raise ResultsError(
                f"{folder}: results cannot be written here: {reason(error)}.", code="results-unwritable"
            ) from None
        self._size = 0
        try:
            self._begin()
        except ResultsError:
            self.discard()
            raise

    def announce(self, record: RunRecord) -> None:
        """Write the record of a run that is starting, so that it is there if the run dies."""
        try:
            write_whole(self._run_path, record.to_json())
        except OSError as error:
            self.discard()
            raise self._unwritable(error) from None

    def _begin(self) -> None:
        """Write the header, if the format has one."""
        header = io.StringIO()
        csv.writer(header, lineterminator="\n").writerow(["time", *self.columns])
        self._append(header.getvalue().encode())

    def _take(self, block: np.ndarray, others: list[list[Value]]) -> None:
        whole = len(self._order) == self.rows.shape[1]
        self._append(rows_text(block) if whole else self._mixed(block.tolist(), others).encode())

    def _mixed(self, values: list[list[float]], others: list[list[Value]]) -> str:
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        for row, more in zip(values, others, strict=True):
            cells = [*row, *(int(v) if isinstance(v, bool) else v for v in more)]
            writer.writerow([cells[i] for i in self._order])
        return text.getvalue()

    def _append(self, data: bytes) -> None:
        view = memoryview(data)
        try:
            while view:
                view = view[self._file.write(view) :]
        except OSError as error:
            self._cut_back(data[: len(data) - len(view)])
            raise ResultsError(
                f"{self.folder / self.file}: cannot be written: {reason(error)}.", code="results-unwritable"
            ) from None
        self._size += len(data)

    def _cut_back(self, arrived: bytes) -> None:
        """Keep the whole rows of a block that did not fit on the disk."""
        whole = arrived.rfind(b"\n") + 1
        self.written += arrived[:whole].count(b"\n") if self._size else 0
        self._size += whole
        with contextlib.suppress(OSError):
            self._file.truncate(self._size)

    def finish(self, record: RunRecord) -> None:
        """Complete and write the run record, flush everything to disk, and give both files their final names.

        If the disk has no room for the record, the files stay as those of a run that died. The folder stays
        locked until `close`.

        Raises:
            ResultsError: not every row is in the file, or the record cannot be written.
        """
        try:
            self._complete(record)
            os.fsync(self._file.fileno())
            if not self._path.exists() or self._path.stat().st_size != self._size:
                raise ResultsError(
                    f"{self.folder / self._path.name}: was removed, cut off or lengthened by something else "
                    "before the run had ended, and its rows are lost; run it again.",
                    code="results-unwritable",
                )
            self._write_record(record)
            self._file.close()
            self.written_to = self.folder / put_in_place(self._home).relative_to(self._home)
        except ResultsError:
            self.discard()
            raise
        except OSError as error:
            if not (self.rows_stay and self._run_path.exists()):
                self.discard()
                raise self._unwritable(error) from None
            self._file.close()
            self._lock.release()
            way_out = f"; make room, then 'yawbench salvage {self.folder}' keeps the rows"
            raise self._unwritable(error, way_out) from None

    def close(self, record: RunRecord | None = None) -> None:
        """Release the folder.

        Args:
            record: the run record if it has changed since `finish`.
        """
        if record is not None:
            path = self._home / self.written_to.relative_to(self.folder) / RUN_FILE
            with contextlib.suppress(OSError):  # results and record are in place already
                write_whole(path, record.to_json())
        self._lock.release()

    def _complete(self, record: RunRecord) -> None:
        """Write the end of the file, if the format has one."""

    def _write_record(self, record: RunRecord) -> None:
        """Complete a run record with what only the recorder knows, and write it."""
        record.rows, record.size = self.written, self._size
        if record.results != self.file:
            record.results = self.file
        record.smallest, record.largest = self.extremes()
        write_whole(self._run_path, record.to_json())

    def _unwritable(self, error: OSError, way_out: str = "") -> ResultsError:
        return ResultsError(
            f"{self.folder}: results cannot be written: {reason(error)}{way_out}.", code="results-unwritable"
        )

    def discard(self) -> None:
        """Remove the temporary files; earlier results stay as they are."""
        self._file.close()
        with contextlib.suppress(OSError):
            self._path.unlink(missing_ok=True)
            self._run_path.unlink(missing_ok=True)
        self._lock.release()


def _order(real: Sequence[bool]) -> list[int]:
    """Return the index of each column in a row of time, Reals and others."""
    reals, others = 1, 1 + sum(real)
    order = []
    for is_real in real:
        order.append(reals if is_real else others)
        reals, others = reals + is_real, others + (not is_real)
    return order


class Columns:
    """Accumulates blocks of rows and returns them as columns.

    Args:
        order: index of each column in a row of Reals followed by the others; see `RowBlock`.
        reals: number of Reals in a row, time included.
        most: expected number of rows; more find room, too.
    """

    def __init__(self, order: Sequence[int], reals: int, most: int = BLOCK) -> None:
        self._order = order
        self._room = np.empty((reals, most))
        self.clear()

    def clear(self) -> None:
        """Forget all rows. The next ones take the place of arrays returned before."""
        self.rows = 0
        self._others: list[list[Value]] = []

    def cut(self, rows: int) -> None:
        """Forget all rows after the first ones."""
        self.rows = rows
        del self._others[rows:]

    def add(self, block: np.ndarray, others: Sequence[list[Value]]) -> None:
        """Append rows; both arguments are copied."""
        end, (reals, most) = self.rows + len(block), self._room.shape
        if end > most:
            kept, self._room = self._room, np.empty((reals, max(end, 2 * most)))
            self._room[:, : self.rows] = kept[:, : self.rows]
        self._room[:, self.rows : end] = block.T
        self._others.extend(others)
        self.rows = end

    def arrays(self) -> list[np.ndarray]:
        """Return the columns in order, time first: float64, int64, bool, or object for text."""
        reals = list(self._room[:, : self.rows])
        return [
            reals[column] if column < len(reals) else self._other(column - len(reals))
            for column in self._order
        ]

    def _other(self, k: int) -> np.ndarray:
        values = [row[k] for row in self._others]
        if any(isinstance(value, str) for value in values):
            return np.array(values, dtype=object)
        return np.array(values) if values else np.empty(0)


class MemoryRecorder(RowBlock):
    """Records a run in memory only; `results` is what reading the files back would give.

    Args:
        columns, real, units: see `Recorder`.
        most: expected number of rows.
    """

    folder = written_to = None

    def __init__(
        self,
        columns: Sequence[str],
        real: Sequence[bool],
        units: Mapping[str, str | None] | None = None,
        *,
        most: int = BLOCK,
    ) -> None:
        super().__init__(columns, real)
        self.units = dict(units or {})
        self.results: Results | None = None
        self._columns = Columns(self._order, self.rows.shape[1], most)

    def _take(self, block: np.ndarray, others: list[list[Value]]) -> None:
        self._columns.add(block, others)

    def mark(self) -> tuple[int, np.ndarray]:
        """Return where the recorder is, all rows written, for `go_back`."""
        return self.written, self._extremes.copy()

    def go_back(self, mark: tuple[int, np.ndarray]) -> None:
        """Forget the rows since a mark."""
        self.written, self._extremes = mark[0], mark[1].copy()
        self.others.clear()
        self._columns.cut(self.written)

    def finish(self, record: RunRecord) -> None:
        """Make `results` from the rows written so far."""
        time, *values = (plain(array) for array in self._columns.arrays())
        units = {name: self.units.get(name) or "" for name in ("time", *self.columns)}
        record.rows = self.written
        record.smallest, record.largest = self.extremes()
        self.results = Results(Path(), time, dict(zip(self.columns, values, strict=True)), units, record)

    def announce(self, record: RunRecord) -> None:
        """Do nothing: there are no files."""

    def close(self, record: RunRecord | None = None) -> None:
        """Do nothing: there are no files."""


class ColumnRecorder(Recorder):
    """Base of recorders that buffer rows until there are `CHUNK` of them or the run ends."""

    rows_stay = False
    CHUNK: int | None = None

    def _begin(self) -> None:
        self._columns = Columns(self._order, self.rows.shape[1])

    def _take(self, block: np.ndarray, others: list[list[Value]]) -> None:
        self._columns.add(block, others)
        if self.CHUNK is not None and self._columns.rows >= self.CHUNK:
            self._pass_on()

    def _pass_on(self) -> None:
        """Write the buffered columns and clear the buffer."""
        raise NotImplementedError


def recorder_of(format: str) -> type[Recorder]:
    """Return the recorder class of a format, a subclass of `Recorder`.

    Raises:
        ScenarioError: the format does not exist.
    """
    recorder: type[Recorder] = load_class(FORMATS[check_format(format)].recorder)
    return recorder


def write_results(results: Results, folder: Path, *, format: str = "csv") -> None:
    """Write results that are in memory to a folder as a run would; results already there are replaced.

    Raises:
        ScenarioError: the format does not exist.
        ResultsError: the files cannot be written.
    """
    names = list(results)
    real = [np.issubdtype(results[name].dtype, np.number) for name in names]
    recorder = recorder_of(format)(folder, names, real, results.units)
    numbers = np.column_stack([results.time, *(results[n] for n, r in zip(names, real, strict=True) if r)])
    others = [*zip(*(results[n].tolist() for n, r in zip(names, real, strict=True) if not r), strict=True)]
    try:
        for first in range(0, len(numbers), BLOCK):
            block = numbers[first : first + BLOCK]
            recorder.rows = block
            recorder.others += [list(row) for row in others[first : first + len(block)]]
            recorder.write(len(block))
        recorder.finish(results.record.model_copy())
    finally:
        recorder.close()

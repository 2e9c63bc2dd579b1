"""Writing results.csv (the other formats: `columnar`) and run.json.

Both are written under temporary names and take their places together at the end, so a folder holds
either the earlier results or the new ones; while a run writes there, no other may. Rows go out in
blocks during the run: whatever ends it, what has been recorded stays. Numbers are written so that
reading them gives the same bits.
"""

from __future__ import annotations

import contextlib
import csv
import errno
import io
import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ResultsError
from ..plan import Value
from .formats import FILES, RESULTS_FILE, RUN_FILE

BLOCK = 512
"""Rows kept in memory before they are written."""


class Block:
    """The rows that a run has made last. Fill `rows` (and `others`), then call `write`.

    Args:
        columns: names below the header, `<unit>.<variable>`.
        real: which of them are Real; the others come in `others`, one list per row.
    """

    def __init__(self, columns: Sequence[str], real: Sequence[bool]) -> None:
        self.written = 0
        self.columns = list(columns)
        self._order = [0, *_order(real)]
        self._block = np.zeros((BLOCK, 1 + sum(real)))
        self.rows = list(self._block)
        self.others: list[list[Value]] = []


class Recorder(Block):
    """The results of one run on disk. Call `write` for every block; at the end `finish`.

    Args:
        folder: made if it does not exist.
        columns, real: see `Block`.
        units: column -> measurement unit, for formats that carry it.

    Raises:
        ResultsError: another run is writing into the folder, or it or a file in it cannot be written;
            so do the methods.
    """

    file = RESULTS_FILE
    rows_stay = True
    """Whether rows that have been written can be read if no more follow."""

    def __init__(
        self,
        folder: Path,
        columns: Sequence[str],
        real: Sequence[bool],
        units: Mapping[str, str | None] | None = None,
    ) -> None:
        super().__init__(columns, real)
        self.folder = folder
        self.units = dict(units or {})
        self._home = folder.absolute()  # an FMU may change the working directory
        self._path = self._home / f"{self.file}.part"
        self._run_path = self._home / f"{RUN_FILE}.part"
        self._lock: int | None = None
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = _lock(folder)
            self._file = self._path.open("wb", buffering=0)
        except FileExistsError:
            raise ResultsError(f"{folder}: results cannot be written here: it is no folder.") from None
        except OSError as error:
            self._unlock()
            raise ResultsError(f"{folder}: results cannot be written here: {reason(error)}.") from None
        self._size = 0
        try:
            self._begin()
        except ResultsError:
            self.discard()
            raise

    def _begin(self) -> None:
        """Write what stands before the rows."""
        header = io.StringIO()
        csv.writer(header, lineterminator="\n").writerow(["time", *self.columns])
        self._append(header.getvalue().encode())

    def write(self, count: int) -> None:
        """Write the first `count` of `rows`; they are then free again."""
        if count <= 0:
            return
        values = self._block[:count].tolist()
        if len(self._order) == self._block.shape[1]:
            # the text of a list of lists is the fastest way to many shortest decimal numbers
            text = repr(values)[2:-2].replace("], [", "\n").replace(", ", ",") + "\n"
        else:
            text = self._mixed(values, count)
        self.others.clear()
        self._append(text.encode())
        self.written += count

    def _mixed(self, values: list[list[float]], count: int) -> str:
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        for row, others in zip(values, self.others[:count], strict=True):
            cells = [*row, *(int(v) if isinstance(v, bool) else v for v in others)]
            writer.writerow([cells[i] for i in self._order])
        return text.getvalue()

    def _append(self, data: bytes) -> None:
        view = memoryview(data)
        try:
            while view:
                view = view[self._file.write(view) :]
        except OSError as error:
            self._cut_back(data[: len(data) - len(view)])
            raise ResultsError(f"{self.folder / self.file}: cannot be written: {reason(error)}.") from None
        self._size += len(data)

    def _cut_back(self, arrived: bytes) -> None:
        """Keep the whole rows of a block that did not fit."""
        whole = arrived.rfind(b"\n") + 1
        self.written += arrived[:whole].count(b"\n") if self._size else 0
        self._size += whole
        with contextlib.suppress(OSError):
            self._file.truncate(self._size)

    def finish(self, run: dict[str, Any]) -> None:
        """Write the record of the run and put both files in their places.

        On a full disk the last rows give way to the record, without which the others are no use.
        """
        try:
            self._complete(run)
            try:
                self._write_record(run)
            except OSError as error:
                if error.errno != errno.ENOSPC or not self._make_room(len(json.dumps(_plain(run)))):
                    raise
                self._write_record(run)
            self._file.close()
            target = self._home / RUN_FILE
            target.unlink(missing_ok=True)  # from here on the earlier results are gone as a whole
            os.replace(self._path, self._home / self.file)
            for other in FILES.values():
                if other != self.file:
                    (self._home / other).unlink(missing_ok=True)
            os.replace(self._run_path, target)
            self._unlock()
        except ResultsError:
            self.discard()
            raise
        except OSError as error:
            self.discard()
            raise ResultsError(f"{self.folder}: results cannot be written: {reason(error)}.") from None

    def _complete(self, run: dict[str, Any]) -> None:
        """Write what stands behind the rows."""

    def _write_record(self, run: dict[str, Any]) -> None:
        run = {**run, "rows": self.written}
        if self.file != RESULTS_FILE:
            run["results"] = self.file
        text = json.dumps(_plain(run), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        # a path that is no UTF-8 comes as lone surrogates, which JSON writes as \\udcxx
        self._run_path.write_text(text, encoding="utf-8", errors="backslashreplace")

    def _make_room(self, needed: int) -> bool:
        """Cut rows off the end of the results; return whether that gave any room."""
        size = self._size - 2 * needed - 2 * 4096
        if size <= 0:
            return False
        with self._path.open("rb") as stream:
            stream.seek(size)
            lost = stream.read(self._size - size)
        whole = lost.find(b"\n") + 1
        self.written -= lost[whole:].count(b"\n")
        self._size = size + whole
        self._file.truncate(self._size)
        return True

    def discard(self) -> None:
        """Remove the temporary files; earlier results stay as they are."""
        self._file.close()
        with contextlib.suppress(OSError):
            self._path.unlink(missing_ok=True)
            self._run_path.unlink(missing_ok=True)
        self._unlock()

    def _unlock(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def _lock(folder: Path) -> int | None:
    """Claim a folder for this run until the descriptor is closed; None where that is not possible.

    Two runs in one folder would write into each other's files.
    """
    try:
        import fcntl
    except ImportError:  # Windows, where a file that is being written cannot be replaced anyway
        return None
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
            raise ResultsError(f"{folder}: another run is writing its results here.") from None
        return None  # some network drives cannot lock folders
    return descriptor


def _order(real: Sequence[bool]) -> list[int]:
    """Return where each column stands in time, Reals, others."""
    reals, others = 1, 1 + sum(real)
    order = []
    for is_real in real:
        order.append(reals if is_real else others)
        reals, others = reals + is_real, others + (not is_real)
    return order


def reason(error: OSError) -> str:
    """Return why something cannot be written, in words."""
    if error.errno == errno.ENOSPC:
        return "the disk is full"
    return f"{error.strerror or error}"


def _plain(value: Any) -> Any:
    """Return `value` as JSON can hold it: numbers that are not finite become text."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, bool) or value is None or isinstance(value, (int, str)):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else repr(value)
    return str(value)

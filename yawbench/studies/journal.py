"""Journal of finished runs that keep no results: one JSON line per run, appended as it ends.

Each line is synced to disk before the next run is counted. On resuming, a line truncated by a kill or
damaged is dropped, and its run is executed again. The caller must have the folder locked.
"""

from __future__ import annotations

import contextlib
import json
import os
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, ClassVar

from pydantic import BaseModel, ConfigDict, Field, StrictFloat

from yawbench.foundation.errors import ResultsError
from yawbench.foundation.safe_files import open_own, reason
from yawbench.orchestrator.results.run_record import RecordedDiagnostic

from .jobs import MeasuredRun, MetricValues

FILE = "runs.jsonl"
FORMAT = 3
"""Version of the file format; that of 0.2 is 1."""


class _Line(BaseModel):
    """Base of the lines."""

    model_config = ConfigDict(strict=True, extra="forbid")

    def text(self) -> bytes:
        """Return the line as JSON, without fields at their defaults."""
        content = self.model_dump(exclude_defaults=True)
        return json.dumps(content, ensure_ascii=False).encode("utf-8", "backslashreplace") + b"\n"


class _Head(_Line):
    """The first line: the experiment that the runs belong to."""

    sweep: str
    format: int


class _Entry(_Line):
    """The record of a finished run."""

    key: str
    values: dict[str, Annotated[tuple[StrictFloat, str], Field(strict=False)] | None]
    diagnostics: list[RecordedDiagnostic] = []
    ended: str | None = None

    @property
    def record(self) -> MeasuredRun:
        """The line as a `MeasuredRun`."""
        return MeasuredRun(_Packed(self.values), tuple(self.diagnostics), self.ended)


class _Packed(Mapping[str, "tuple[float, str] | None"]):
    """Metric values in little memory: their keys and units are held once for all runs that have the same."""

    __slots__ = ("_numbers", "_units")
    _known: ClassVar[dict[tuple[tuple[str, str | None], ...], dict[str, str | None]]] = {}

    def __init__(self, values: MetricValues) -> None:
        units = {key: value[1] if value else None for key, value in values.items()}
        self._units = self._known.setdefault(tuple(units.items()), units)
        self._numbers = array("d", [value[0] if value else 0.0 for value in values.values()]).tobytes()

    def __getitem__(self, key: str) -> tuple[float, str] | None:
        unit = self._units[key]
        if unit is None:
            return None
        return array("d", self._numbers)[[*self._units].index(key)], unit

    def __iter__(self) -> Iterator[str]:
        return iter(self._units)

    def __len__(self) -> int:
        return len(self._units)


class Journal:
    """Finished runs of the experiment in a results folder.

    Args:
        folder: results folder, created if missing.
        identity: of the experiment; a folder of another one is an error.
        fresh: discard all finished runs, of whichever experiment.

    Raises:
        ResultsError: the folder belongs to another experiment, or cannot be written.
    """

    def __init__(self, folder: Path, identity: str, *, fresh: bool = False) -> None:
        self.folder = folder
        self.records: dict[str, MeasuredRun] = {}
        self._path = path = folder / FILE
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file = _opened(path)
        except OSError as error:
            raise ResultsError(
                f"{folder}: results cannot be written here: {reason(error)}.", code="results-unwritable"
            ) from None
        try:
            if fresh:
                os.ftruncate(self._file, 0)
            lines, whole = _whole_lines(path.read_bytes())
            os.ftruncate(self._file, whole)
            self._take_over(lines, _Head(sweep=identity, format=FORMAT))
        except BaseException:
            self.close()
            raise

    def _take_over(self, lines: list[bytes], head: _Head) -> None:
        """Read the lines of an existing journal; runs of damaged lines will be made again.

        Raises:
            ResultsError: it belongs to another experiment, or is not a journal.
        """
        if not lines:
            self._append(head)
            return
        if lines[0] + b"\n" != head.text():
            other = _sweep_of(lines[0])
            raise ResultsError(
                f"{self.folder}: holds the runs of "
                f"{'another version of this program' if other in ('', head.sweep) else other}; give another "
                "folder with --out, or --fresh to begin anew.",
                code="results-of-another",
            )
        self.records = _records(lines[1:])

    def add(self, key: str, record: MeasuredRun, *, last: bool = True) -> None:
        """Add a finished run.

        Args:
            key: key of the run.
            record: its metrics, or why there are none.
            last: False if the run is to be executed again on resuming; then nothing is written.

        Raises:
            ResultsError: the journal cannot be written.
        """
        if last:
            self._append(
                _Entry(
                    key=key,
                    values={**record.values},
                    diagnostics=[*record.diagnostics],
                    ended=record.ended,
                )
            )
        self.records[key] = replace(record, values=_Packed(record.values), id=None)

    def _append(self, entry: _Line) -> None:
        try:
            view = memoryview(entry.text())
            while view:
                view = view[os.write(self._file, view) :]
            os.fsync(self._file)
        except OSError as error:
            raise ResultsError(
                f"{self._path}: cannot be written: {reason(error)}.", code="results-unwritable"
            ) from None

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)


def records_in(folder: Path) -> dict[str, MeasuredRun]:
    """Return key -> record of the finished runs in a results folder, without changing it; damaged lines less.

    The folder may be missing, and it need not be locked.
    """
    try:
        lines, _ = _whole_lines((folder / FILE).read_bytes())
    except OSError:
        return {}
    return _records(lines[1:])


def _records(lines: list[bytes]) -> dict[str, MeasuredRun]:
    records = {}
    for line in lines:
        with contextlib.suppress(ValueError, TypeError, RecursionError):
            entry = _Entry.model_validate(json.loads(line))
            records[entry.key] = entry.record
    return records


def _sweep_of(head: bytes) -> str:
    """Return the experiment that the first line of a journal names, "" if it is not one."""
    try:
        return str(json.loads(head)["sweep"])
    except (ValueError, TypeError, LookupError, RecursionError):
        return ""


def _opened(path: Path) -> int:
    return open_own(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)


def _whole_lines(data: bytes) -> tuple[list[bytes], int]:
    """Return the lines that end with a newline, and their total length in bytes."""
    whole = data.rfind(b"\n") + 1
    return data[:whole].split(b"\n")[:-1], whole

"""Journal of finished runs that keep no results: one JSON line per run, appended as it ends.

Each line is synced to disk before the next run is counted. On resuming, a line truncated by a kill is
dropped; a line with wrong checksums or types is dropped with a warning, and its run is executed again. The
caller must have the folder locked.
"""

from __future__ import annotations

import contextlib
import json
import os
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, NoReturn

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from yawbench.foundation.cache import KEY, changed_since, has_checksums, warn_of_record, with_checksums
from yawbench.foundation.errors import Diagnostic, ResultsError
from yawbench.foundation.messages import counted
from yawbench.foundation.safe_files import open_own, reason, write_whole
from yawbench.orchestrator.results.run_record import EARLIER

from .jobs import MeasuredRun, MetricValues

FILE = "runs.jsonl"
FORMAT = 2
"""Version of the file format; 1 had no checksums."""
NAMED = 10
"""Damaged lines reported one by one. Chosen: they fit on a terminal."""


class _Line(BaseModel):
    """Base of the lines; written with checksums of its fields."""

    model_config = ConfigDict(strict=True, extra="forbid")

    def text(self) -> bytes:
        """Return the line as JSON with checksums, without fields at their defaults."""
        content = with_checksums(self.model_dump(exclude_defaults=True))
        return json.dumps(content, ensure_ascii=False).encode("utf-8", "backslashreplace") + b"\n"

    @classmethod
    def read(cls, line: bytes) -> Any:
        """Parse a line.

        Raises:
            ValueError: the line was damaged or edited; says how.
        """
        content = _content(line)
        if not has_checksums(content):
            raise ValueError("it has no checksums")
        if changed := changed_since(content):
            raise ValueError(changed)
        try:
            return cls.model_validate({key: x for key, x in content.items() if key != KEY})
        except ValidationError as errors:
            first = errors.errors(include_url=False)[0]
            raise ValueError(f"{'.'.join(map(str, first['loc']))}: {first['msg'].lower()}") from None


class _Head(_Line):
    """The first line: the experiment that the runs belong to."""

    sweep: str
    format: int


class _Entry(_Line):
    """The record of a finished run."""

    key: str
    values: dict[str, Annotated[tuple[float, str], Field(strict=False)] | None]
    diagnostics: list[dict[str, Any]] = []
    problems: list[str] = []  # until 0.2: sentences
    findings: list[str] = []  # until 0.2: names of warnings
    ended: str | None = None

    @property
    def record(self) -> MeasuredRun:
        """The line as a `MeasuredRun`."""
        earlier = (
            *(Diagnostic("run-failed", sentence) for sentence in self.problems),
            *(Diagnostic(EARLIER.get(kind, kind), kind, "warning") for kind in self.findings),
        )
        return MeasuredRun(
            _Packed(self.values), (*map(Diagnostic.of, self.diagnostics), *earlier), self.ended
        )


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
        """Read the lines of an existing journal, and rewrite it without damaged ones.

        Raises:
            ResultsError: it belongs to another experiment, or is not a journal.
        """
        if not lines:
            self._append(head)
            return
        damaged: dict[int, str] = {}
        whole = [head.text()]
        for number, line in enumerate(lines[1:], start=2):
            try:
                entry: _Entry = _Entry.read(line)
            except ValueError as error:  # noqa: PERF203 - all are named
                damaged[number] = str(error)
            else:
                if not entry.record.of_machine:  # written by an earlier version
                    self.records[entry.key] = entry.record
                    whole.append(line + b"\n")
        try:
            self._check(_Head.read(lines[0]), head)
        except ValueError as error:
            if _is_earlier(lines[0]):
                self._refuse("an earlier version of this program")
            if not self.records:
                raise ResultsError(
                    f"{self._path}: line 1 is damaged: {error}; --fresh begins anew."
                ) from None
            warn_of_record(f"{self._path}: line 1: {error}; the runs below it are kept")
        for number, why in list(damaged.items())[:NAMED]:
            warn_of_record(f"{self._path}: line {number}: {why}; its run will be repeated")
        if len(damaged) > NAMED:
            warn_of_record(f"{self._path}: {counted(len(damaged) - NAMED, 'more line')} like these")
        if whole != [line + b"\n" for line in lines]:
            self._replace(b"".join(whole))

    def _check(self, head: _Head, wanted: _Head) -> None:
        if head.sweep != wanted.sweep:
            self._refuse(head.sweep)
        if head.format != wanted.format:
            self._refuse("another version of this program")

    def _refuse(self, other: str) -> NoReturn:
        raise ResultsError(
            f"{self.folder}: holds the runs of {other}; give another folder with --out, "
            "or --fresh to begin anew.",
            code="results-of-another",
        )

    def _replace(self, content: bytes) -> None:
        os.close(self._file)
        try:
            write_whole(self._path, content)
        finally:
            self._file = _opened(self._path)

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
                    diagnostics=[diagnostic.record() for diagnostic in record.diagnostics],
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
    records = {}
    for line in lines[1:]:
        with contextlib.suppress(ValueError):
            entry: _Entry = _Entry.read(line)
            records[entry.key] = entry.record
    return records


def _opened(path: Path) -> int:
    return open_own(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)


def _content(line: bytes) -> dict[str, Any]:
    """Return the JSON object of a line.

    Raises:
        ValueError: it is not a JSON object.
    """
    try:
        content = json.loads(line)
    except (ValueError, RecursionError):
        raise ValueError("is not JSON") from None
    if not isinstance(content, dict):
        raise ValueError("is not a JSON object")
    return content


def _is_earlier(line: bytes) -> bool:
    """Return whether this is the first line of a journal in the earlier format, without checksums."""
    try:
        content = _content(line)
    except ValueError:
        return False
    return content.keys() == {"sweep", "format"} and content["format"] == FORMAT - 1


def _whole_lines(data: bytes) -> tuple[list[bytes], int]:
    """Return the lines that end with a newline, and their total length in bytes."""
    whole = data.rfind(b"\n") + 1
    return data[:whole].split(b"\n")[:-1], whole

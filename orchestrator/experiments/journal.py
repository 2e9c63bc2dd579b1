"""Which runs are finished that keep no results, and what they came to: a line per run, written as it ends.

The file is only ever appended to, each line is on the disk before the next run is counted, and a
line that a kill has cut off is dropped when the experiment goes on. The folder is held by its writer.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from ..errors import ResultsError
from ..files import reason
from ..writing import open_own
from .jobs import Record

FILE = "runs.jsonl"
FORMAT = 1


class Journal:
    """The finished runs of the experiment whose results go to a folder.

    Args:
        folder: made if it does not exist.
        identity: of the experiment; a folder that holds another one is refused.
        fresh: forget all runs that are finished, whichever experiment they are of.

    Raises:
        ResultsError: the folder holds another one, or it cannot be written.
    """

    def __init__(self, folder: Path, identity: str, *, fresh: bool = False) -> None:
        self.folder = folder
        self.records: dict[str, Record] = {}
        path = folder / FILE
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file = open_own(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        except OSError as error:
            raise ResultsError(f"{folder}: results cannot be written here: {reason(error)}.") from None
        try:
            if fresh:
                os.ftruncate(self._file, 0)
            lines, whole = _whole_lines(path.read_bytes())
            os.ftruncate(self._file, whole)
            self._take_over(lines, identity)
        except BaseException:
            self.close()
            raise

    def _take_over(self, lines: list[bytes], identity: str) -> None:
        path = self.folder / FILE
        if not lines:
            self._append({"sweep": identity, "format": FORMAT})
            return
        entry = 0
        try:
            self._check(json.loads(lines[0]), identity)
            for entry in range(1, len(lines)):
                key, record = _record(json.loads(lines[entry]))
                self.records[key] = record
        except (ValueError, KeyError, TypeError, AttributeError, IndexError):
            raise ResultsError(f"{path}: line {entry + 1} is damaged; --fresh begins anew.") from None

    def _check(self, entry: dict[str, Any], identity: str) -> None:
        if entry["sweep"] != identity or entry["format"] != FORMAT:
            other = entry["sweep"] if entry["sweep"] != identity else "an earlier version of this program"
            raise ResultsError(
                f"{self.folder}: holds the runs of {other}; give another folder with --out, "
                "or --fresh to begin anew."
            )

    def add(self, key: str, record: Record, *, last: bool = True) -> None:
        """Note that a run is finished.

        Args:
            key: of the run.
            record: what became of it.
            last: False if the run is to be made again when the experiment goes on; nothing is written then.

        Raises:
            ResultsError: the journal cannot be written.
        """
        if last:
            entry = {"key": key, "values": record.values, "problems": record.problems}
            more = {"findings": record.findings, "ended": record.ended}
            self._append(entry | {name: value for name, value in more.items() if value})
        self.records[key] = record

    def _append(self, entry: dict[str, Any]) -> None:
        line = json.dumps(entry, ensure_ascii=False).encode("utf-8", "backslashreplace") + b"\n"
        try:
            view = memoryview(line)
            while view:
                view = view[os.write(self._file, view) :]
            os.fsync(self._file)
        except OSError as error:
            path = self.folder / FILE
            raise ResultsError(f"{path}: cannot be written: {reason(error)}.") from None

    def close(self) -> None:
        """Let go of the file."""
        os.close(self._file)


def _record(entry: dict[str, Any]) -> tuple[str, Record]:
    values = {key: value and (float(value[0]), str(value[1])) for key, value in entry["values"].items()}
    problems, findings = tuple(entry["problems"]), tuple(entry.get("findings", ()))
    return str(entry["key"]), Record(values, problems, findings, entry.get("ended"))


def _whole_lines(data: bytes) -> tuple[list[bytes], int]:
    """Return the lines that have an end, and where the last of them ends."""
    whole = data.rfind(b"\n") + 1
    return data[:whole].splitlines(), whole

"""The runs whose results stand below a folder."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import ResultsError
from .folder import DIED, PART, RUN_FILE, RUNNING, is_dead, unfinished
from .record_file import check_record, load_record, warn_if_unchecked

UNREADABLE = "unreadable"
"""Status of a run whose record cannot be read, or is not as it was written."""


@dataclass(frozen=True)
class FoundRun:
    """A run by its folder and its record."""

    folder: Path
    status: str  # "completed", "failed", "interrupted", "running", "died", or UNREADABLE
    record: dict[str, Any]
    problem: str = ""  # why it has no results, or none to the end


def found_runs(folder: Path) -> list[FoundRun]:
    """Return all runs in and below a folder, the earliest first.

    Raises:
        ResultsError: there is no such folder, or no run in it.
    """
    if not folder.is_dir():
        raise ResultsError(f"{folder}: there is no such folder; name one that holds results")
    found = [run for place in _folders(folder) for run in _runs_in(place)]
    if not found:
        raise ResultsError(f"{folder}: holds no results; make some with 'yawbench run SCENARIO'")
    return sorted(found, key=lambda run: (str(run.record.get("started") or ""), run.folder))


def _folders(folder: Path) -> Iterator[Path]:
    for place, below, files in os.walk(folder):
        below.sort()
        if not {RUN_FILE, f"{RUN_FILE}{PART}"}.isdisjoint(files):
            yield Path(place)


def _runs_in(folder: Path) -> Iterator[FoundRun]:
    """Yield the run whose results stand in a folder, and the one that goes on or has died there."""
    going = unfinished(folder)
    if going is not None:
        dead = is_dead(folder)
        try:
            record = check_record(going, folder / f"{RUN_FILE}{PART}")
        except ResultsError:  # of a run that has died, perhaps before it had written its record
            record = {}
        yield FoundRun(folder, DIED if dead else RUNNING, record, "it ended without a word" if dead else "")
    if going is not None and not os.path.lexists(folder / RUN_FILE):
        return
    try:
        record = load_record(folder, settled=going is not None)
        warn_if_unchecked(record, folder)
    except ResultsError as error:
        yield FoundRun(folder, UNREADABLE, {}, str(error))
        return
    problem = str((record.get("error") or {}).get("message") or "")
    yield FoundRun(folder, str(record.get("status") or ""), record, problem)

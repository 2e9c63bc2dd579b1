"""The results folder of a run: its files, and their final renames.

While a run goes on its files end in `.part`, and its record says "running"; earlier results stay next to
them. At the end the files get their final names. If a record ends in `.part` while no process has the folder
locked, the run has died. Readers report that and change nothing; the next run in the folder, or `salvage`,
completes the renames.

Results of a completed run are replaced only by those of another completed run; those of a failed run go to
`failed` below them. Only files in the folder that have names of our formats are moved, and no links followed.
"""

from __future__ import annotations

import contextlib
import json
import os
import stat
from enum import Enum
from pathlib import Path
from typing import Any

from yawbench.foundation.errors import ResultsError
from yawbench.foundation.messages import cut
from yawbench.foundation.safe_files import NEW, read_bytes, refuse_link

from .file_formats import FILES, RESULTS_FILE
from .folder_lock import holder_of

RUN_FILE = "run.json"
PART = ".part"
"""Suffix of a run's files until it has ended."""
LARGEST = 100_000_000
"""Largest size of a record [bytes]. Chosen: a thousand times that of ours."""
FAILED = "failed"
"""Subfolder for the results of a failed run when the folder has those of a completed one."""


class RunStatus(str, Enum):
    """Status of a run, as its record has it."""

    UNKNOWN = ""  # the record has none that is known
    PLANNED = "planned"
    RUNNING = "running"
    COMPLETED = "completed"
    FAILED = "failed"
    INTERRUPTED = "interrupted"
    DIED = "died"  # the process ended without a word; its results may be salvaged
    UNREADABLE = "unreadable"  # the record cannot be read or has been changed

    @classmethod
    def _missing_(cls, value: object) -> RunStatus:
        return cls.UNKNOWN

    @property
    def final(self) -> bool:
        """Whether a run has ended with it."""
        return self in (RunStatus.COMPLETED, RunStatus.FAILED, RunStatus.INTERRUPTED, RunStatus.DIED)


def folder_for(folder: Path, status: RunStatus) -> Path:
    """Return the folder for the results of a run that has ended with `status`."""
    completed = RunStatus.COMPLETED
    return folder if status is completed or _status(folder / RUN_FILE) is not completed else folder / FAILED


def put_in_place(folder: Path) -> Path:
    """Give the files of a run that has ended their final names; return the folder they are in.

    If a process dies halfway, the next call completes the renames. The caller must have the folder locked.

    Raises:
        OSError: the files cannot be renamed.
    """
    part = folder / f"{RUN_FILE}{PART}"
    run = _record(part, follow=False)
    status = RunStatus(run.get("status"))
    final = folder_for(folder, status)
    file = _file_of(run)
    if final != folder:
        refuse_link(final)
        final.mkdir(exist_ok=True)
    if is_regular(results := folder / f"{file}{PART}"):
        os.replace(results, final / file)
    os.replace(part, final / RUN_FILE)
    for other in {*FILES.values()} - {file}:
        (final / other).unlink(missing_ok=True)
    if final == folder and status is RunStatus.COMPLETED:
        remove_results(folder / FAILED)
    return final


def remove_results(folder: Path) -> None:
    """Remove the results in a folder, and the folder if it is then empty; links are not followed."""
    if folder.is_symlink():
        return
    for name in (*FILES.values(), RUN_FILE):
        with contextlib.suppress(OSError):
            (folder / name).unlink()
    with contextlib.suppress(OSError):
        folder.rmdir()


def is_regular(path: Path) -> bool:
    """Return whether a path is a regular file and not a link to one."""
    try:
        return stat.S_ISREG(path.lstat().st_mode)
    except (OSError, ValueError):
        return False


def tidy(folder: Path) -> None:
    """Clean up after a run that died: keep finished results, remove everything else.

    The caller must have the folder locked.

    Raises:
        OSError: files cannot be renamed or removed.
    """
    if is_final(folder):
        put_in_place(folder)
    for name in (*FILES.values(), RUN_FILE):
        for left in (f"{name}{PART}", f"{name}{PART}{NEW}", f"{name}{NEW}"):
            (folder / left).unlink(missing_ok=True)


def refuse_dead(folder: Path) -> None:
    """Raise if the last run in a folder has died.

    Raises:
        ResultsError: it has died.
    """
    if is_dead(folder):
        raise ResultsError(death(folder), code="run-died")


def death(folder: Path) -> str:
    """Return the message on a run that has died in a folder."""
    begun = _record(folder / f"{RUN_FILE}{PART}", follow=False).get("started")
    when = f" begun at {cut(begun, 60)}" if begun and isinstance(begun, str) else ""
    if is_final(folder):
        return (
            f"{folder}: the run{when} was stopped before its results were in place; move them there "
            f"with 'yawbench salvage {folder}', or run it again."
        )
    beside = "; the results of the run before it are read again then" if _status(folder / RUN_FILE) else ""
    return (
        f"{folder}: the run{when} ended abnormally; run it again, or keep what it recorded with "
        f"'yawbench salvage {folder}'{beside}."
    )


def is_dead(folder: Path) -> bool:
    """Return whether the last run in a folder has died."""
    part = folder / f"{RUN_FILE}{PART}"
    # look again: the run may have ended between the first look and that at its lock
    return os.path.lexists(part) and holder_of(folder) is None and os.path.lexists(part)


def unfinished(folder: Path) -> dict[str, Any] | None:
    """Return the record of a run that is going on or has died in a folder; None if there is none."""
    part = folder / f"{RUN_FILE}{PART}"
    return _record(part, follow=False) if os.path.lexists(part) else None


def is_final(folder: Path) -> bool:
    """Return whether a run has ended but its files still have their temporary names."""
    run = _record(folder / f"{RUN_FILE}{PART}", follow=False)
    return RunStatus(run.get("status")).final and _file_of(run) in FILES.values()


def _file_of(run: dict[str, Any]) -> str:
    """Return the name of the results file that a record refers to."""
    return str(run.get("results") or RESULTS_FILE)


def _status(path: Path) -> RunStatus:
    return RunStatus(_record(path).get("status"))


def _record(path: Path, *, follow: bool = True) -> dict[str, Any]:
    """Return a record without validating it; an empty dictionary if there is none."""
    try:
        content = json.loads(read_bytes(path, largest=LARGEST, follow=follow))
    except (OSError, ValueError, RecursionError, MemoryError):
        return {}
    return content if isinstance(content, dict) else {}

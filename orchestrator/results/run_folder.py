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
from pathlib import Path

from yawbench.foundation.errors import ResultsError
from yawbench.foundation.messages import cut
from yawbench.foundation.safe_files import NEW, read_bytes, reading, reason, refuse_link

from .file_formats import FILES
from .folder_lock import holder_of
from .run_record import LARGEST, RUN_FILE, RunRecord, RunStatus, check_record

PART = ".part"
"""Suffix of a run's files until it has ended."""
FAILED = "failed"
"""Subfolder for the results of a failed run when the folder has those of a completed one."""


def put_in_place(folder: Path) -> Path:
    """Give the files of a run that has ended their final names; return the folder they are in.

    If a process dies halfway, the next call completes the renames. The caller must have the folder locked.

    Raises:
        OSError: the files cannot be renamed.
    """
    part = folder / f"{RUN_FILE}{PART}"
    run = _record(part)
    status, file = run.status, run.results
    completed = RunStatus.COMPLETED
    keeps = status is not completed and _record(folder / RUN_FILE).status is completed
    final = folder / FAILED if keeps else folder
    if final != folder:
        refuse_link(final)
        final.mkdir(exist_ok=True)
    if is_regular(results := folder / f"{file}{PART}"):
        os.replace(results, final / file)
    os.replace(part, final / RUN_FILE)
    for other in {*FILES.values()} - {file}:
        (final / other).unlink(missing_ok=True)
    if status is completed:
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
    begun = _record(folder / f"{RUN_FILE}{PART}").started
    when = f" begun at {cut(begun, 60)}" if begun else ""
    if is_final(folder):
        return (
            f"{folder}: the run{when} was stopped before its results were in place; move them there "
            f"with 'yawbench salvage {folder}', or run it again."
        )
    beside = (
        "; the results of the run before it are read again then"
        if _record(folder / RUN_FILE).status.final
        else ""
    )
    return (
        f"{folder}: the run{when} ended abnormally; run it again, or keep what it recorded with "
        f"'yawbench salvage {folder}'{beside}."
    )


def is_dead(folder: Path) -> bool:
    """Return whether the last run in a folder has died."""
    part = folder / f"{RUN_FILE}{PART}"
    # look again: the run may have ended between the first look and that at its lock
    return os.path.lexists(part) and holder_of(folder) is None and os.path.lexists(part)


def unfinished(folder: Path) -> RunRecord | None:
    """Return the record of a run that is going on or has died in a folder; None if there is none."""
    part = folder / f"{RUN_FILE}{PART}"
    return _record(part) if os.path.lexists(part) else None


def is_final(folder: Path) -> bool:
    """Return whether a run has ended but its files still have their temporary names."""
    run = _record(part := folder / f"{RUN_FILE}{PART}")
    return is_regular(part) and run.status.final and run.results in FILES.values()


def _record(path: Path) -> RunRecord:
    """Return the record in a file; an empty one if there is none that can be read."""
    try:
        return check_record(json.loads(read_bytes(path, largest=LARGEST)), path)
    except (OSError, ValueError, RecursionError, MemoryError, ResultsError):
        return RunRecord()


def load_record(folder: Path, *, settled: bool = False) -> RunRecord:
    """Read the record of the run whose results are in a folder.

    Args:
        folder: the results folder.
        settled: read the record of earlier results even if the last run has died.

    Raises:
        ResultsError: there is none, it is not one that `yawbench run` writes, or the last run here has died.
    """
    if not settled:
        refuse_dead(folder)
    file = folder / RUN_FILE
    with reading("record of a run", file, ResultsError):
        try:
            run = json.loads(read_bytes(file, largest=LARGEST).decode())
        except FileNotFoundError:
            failed = f"; those of a run that failed: {folder / FAILED}" if (folder / FAILED).exists() else ""
            raise ResultsError(
                f"{folder}: no results here, {RUN_FILE} is missing; make them with "
                f"'yawbench run SCENARIO --out {folder}'{failed}.",
                code="results-missing",
            ) from None
        except NotADirectoryError:
            holds = f", {folder.parent}" if folder.name in (RUN_FILE, *FILES.values()) else ""
            raise ResultsError(f"{folder}: is a file; name the folder of the results{holds}.") from None
        except (OSError, ValueError) as error:
            raise ResultsError(f"{file}: cannot be read: {reason(error)}") from None
        return check_record(run, file)

"""The folder of a run: what stands in it, and how new results take their place.

While a run goes on its files are called `.part`, and the record among them says "running"; earlier
results stay beside them. At its end the record is replaced by the final one, and from then on the end
can be caught up with by whoever comes next, should the process die between two renames. Where the
record still says "running" and nobody holds the folder, the run has died: the folder is not read
before that has been dealt with, by another run or by `salvage`.

Results that reached their end are replaced only by such. Those of a run that failed go to `failed`
below them, until a run reaches its end again.
"""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path
from typing import Any

from ..errors import ResultsError
from ..files import read_bytes, reason
from ..writing import NEW
from .formats import FILES, RESULTS_FILE
from .lock import Lock, holder_of

RUN_FILE = "run.json"

PART = ".part"
"""What the names of a run's files end in while it goes on."""
LARGEST = 100_000_000
"""Bytes of a record. Chosen: a thousand times what one of ours has."""
FAILED = "failed"
"""Folder of a failed run's results below those of one that reached its end."""
RUNNING, COMPLETED, DIED = "running", "completed", "died"
"""What a record says of a run that goes on, that reached its end, that was salvaged after its death."""


def place_of(folder: Path, status: str) -> Path:
    """Return where the results of a run that has ended so go."""
    return folder if status == COMPLETED or _status(folder / RUN_FILE) != COMPLETED else folder / FAILED


def put_in_place(folder: Path) -> Path:
    """Give the files of a run whose record is final their names; return the folder they are in.

    Further calls go on where an earlier one has ended.

    Raises:
        OSError: they cannot be renamed.
    """
    part = folder / f"{RUN_FILE}{PART}"
    run = _record(part)
    place = place_of(folder, run.get("status", ""))
    file = str(run.get("results", RESULTS_FILE))
    if (results := folder / f"{file}{PART}").exists():
        place.mkdir(exist_ok=True)
        os.replace(results, place / file)
    os.replace(part, place / RUN_FILE)
    for other in {*FILES.values()} - {file}:
        (place / other).unlink(missing_ok=True)
    if place == folder and run.get("status") == COMPLETED:
        remove_results(folder / FAILED)
    return place


def remove_results(folder: Path) -> None:
    """Remove the results in a folder, and the folder if it is empty then."""
    for name in (*FILES.values(), RUN_FILE):
        with contextlib.suppress(OSError):
            (folder / name).unlink()
    with contextlib.suppress(OSError):
        folder.rmdir()


def tidy(folder: Path) -> None:
    """Deal with what a dead run has left, before the next: keep what is whole, remove the rest.

    To be called by the holder of the folder.

    Raises:
        OSError: files cannot be renamed or removed.
    """
    if _is_final(folder):
        put_in_place(folder)
    for name in (*FILES.values(), RUN_FILE):
        for left in (f"{name}{PART}", f"{name}{PART}{NEW}", f"{name}{NEW}"):
            (folder / left).unlink(missing_ok=True)


def settle(folder: Path) -> None:
    """Make sure that what stands in a folder may be read.

    Raises:
        ResultsError: the last run there has died, or its results cannot be put in their places.
    """
    record = folder / f"{RUN_FILE}{PART}"
    if not record.exists() or holder_of(folder) is not None:
        return
    if not _is_final(folder):
        raise ResultsError(death(folder))
    lock = Lock(folder)
    try:
        if _is_final(folder):
            put_in_place(folder)
    except OSError as error:
        raise ResultsError(f"{folder}: results cannot be put in their places: {reason(error)}.") from None
    finally:
        lock.release()


def death(folder: Path) -> str:
    """Return a sentence on a run that has died in a folder."""
    begun = str(_record(folder / f"{RUN_FILE}{PART}").get("started") or "")
    when = f" begun at {begun}" if begun else ""
    beside = "; the results of the run before it are read again then" if _status(folder / RUN_FILE) else ""
    return (
        f"{folder}: the run{when} ended without a word; run it again, or keep what it recorded with "
        f"'yawbench salvage {folder}'{beside}."
    )


def is_dead(folder: Path) -> bool:
    """Return whether the last run in a folder has died."""
    part = folder / f"{RUN_FILE}{PART}"
    return part.exists() and holder_of(folder) is None and not _is_final(folder)


def unfinished(folder: Path) -> dict[str, Any] | None:
    """Return the record of the run that goes on in a folder, or has died there; None if there is none."""
    part = folder / f"{RUN_FILE}{PART}"
    return _record(part) if part.exists() and not _is_final(folder) else None


def _is_final(folder: Path) -> bool:
    return _status(folder / f"{RUN_FILE}{PART}") not in ("", RUNNING)


def _status(path: Path) -> str:
    return str(_record(path).get("status") or "")


def _record(path: Path) -> dict[str, Any]:
    """Return a record without looking into it; an empty one if there is none."""
    try:
        found = json.loads(read_bytes(path, largest=LARGEST))
    except (OSError, ValueError, RecursionError, MemoryError):
        return {}
    return found if isinstance(found, dict) else {}

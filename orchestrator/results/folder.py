"""The folder of a run: what stands in it, and how new results take their place.

While a run goes on its files are called `.part`, and the record among them says "running"; earlier
results stay beside them. At its end the record is replaced by the final one, and the files get their
names. A record that is still called `.part` while nobody holds the folder is that of a run that has died.
Readers say so and change nothing; the next run there, or `salvage`, puts in place what is whole.

Results that reached their end are replaced only by such. Those of a run that failed go to `failed`
below them, until a run reaches its end again.

The content of a folder may come from anybody. Only files are moved that have the names of our formats and
stand in the folder itself; a link among them is never followed.

Where results go if nothing else is said: a folder named after the file and what was changed.

    results/<folder of the file>/<its name>                                        as it stands
    results/<folder of the file>/<its name>,controller=controller_off,stop_time=2  changed

Whoever looks for the results of a scenario asks here, with the changes of its plan.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..errors import ResultsError, ScenarioError
from ..files import NEW, read_bytes, refuse_link
from ..messages import cut
from ..plan import Override, Value
from .formats import FILES, RESULTS_FILE
from .lock import holder_of

RUN_FILE = "run.json"

PART = ".part"
"""What the names of a run's files end in while it goes on."""
LARGEST = 100_000_000
"""Bytes of a record. Chosen: a thousand times what one of ours has."""
FAILED = "failed"
"""Folder of a failed run's results below those of one that reached its end."""
RUNNING, COMPLETED, DIED = "running", "completed", "died"
"""What a record says of a run that goes on, that reached its end, that was salvaged after its death."""
FINAL = (COMPLETED, "failed", "interrupted", DIED)
"""What it says of a run that has ended."""


def place_of(folder: Path, status: str) -> Path:
    """Return where the results of a run that has ended so go."""
    return folder if status == COMPLETED or _status(folder / RUN_FILE) != COMPLETED else folder / FAILED


def put_in_place(folder: Path) -> Path:
    """Give the files of a run whose record is final their names; return the folder they are in.

    Further calls go on where an earlier one has ended. To be called by the holder of the folder.

    Raises:
        OSError: they cannot be renamed.
    """
    part = folder / f"{RUN_FILE}{PART}"
    run = _record(part, follow=False)
    place = place_of(folder, run.get("status", ""))
    file = _file_of(run)
    if place != folder:
        refuse_link(place)
        place.mkdir(exist_ok=True)
    if is_regular(results := folder / f"{file}{PART}"):
        os.replace(results, place / file)
    os.replace(part, place / RUN_FILE)
    for other in {*FILES.values()} - {file}:
        (place / other).unlink(missing_ok=True)
    if place == folder and run.get("status") == COMPLETED:
        remove_results(folder / FAILED)
    return place


def remove_results(folder: Path) -> None:
    """Remove the results in a folder, and the folder if it is empty then; nothing through a link."""
    if folder.is_symlink():
        return
    for name in (*FILES.values(), RUN_FILE):
        with contextlib.suppress(OSError):
            (folder / name).unlink()
    with contextlib.suppress(OSError):
        folder.rmdir()


def is_regular(path: Path) -> bool:
    """Return whether a path names a regular file, not by a link."""
    try:
        return stat.S_ISREG(path.lstat().st_mode)
    except (OSError, ValueError):
        return False


def tidy(folder: Path) -> None:
    """Deal with what a dead run has left, before the next: keep what is whole, remove the rest.

    To be called by the holder of the folder.

    Raises:
        OSError: files cannot be renamed or removed.
    """
    if is_final(folder):
        put_in_place(folder)
    for name in (*FILES.values(), RUN_FILE):
        for left in (f"{name}{PART}", f"{name}{PART}{NEW}", f"{name}{NEW}"):
            (folder / left).unlink(missing_ok=True)


def refuse_dead(folder: Path) -> None:
    """Make sure that the last run in a folder has not died.

    Raises:
        ResultsError: it has.
    """
    if is_dead(folder):
        raise ResultsError(death(folder))


def death(folder: Path) -> str:
    """Return a sentence on a run that has died in a folder."""
    begun = _record(folder / f"{RUN_FILE}{PART}", follow=False).get("started")
    when = f" begun at {cut(begun, 60)}" if begun and isinstance(begun, str) else ""
    if is_final(folder):
        return (
            f"{folder}: the run{when} was stopped before its results were in their places; put them there "
            f"with 'yawbench salvage {folder}', or run it again."
        )
    beside = "; the results of the run before it are read again then" if _status(folder / RUN_FILE) else ""
    return (
        f"{folder}: the run{when} ended without a word; run it again, or keep what it recorded with "
        f"'yawbench salvage {folder}'{beside}."
    )


def is_dead(folder: Path) -> bool:
    """Return whether the last run in a folder has died."""
    part = folder / f"{RUN_FILE}{PART}"
    # the second look is for a run that has ended between the first one and that at its lock
    return os.path.lexists(part) and holder_of(folder) is None and os.path.lexists(part)


def unfinished(folder: Path) -> dict[str, Any] | None:
    """Return the record of the run that goes on in a folder, or has died there; None if there is none."""
    part = folder / f"{RUN_FILE}{PART}"
    return _record(part, follow=False) if os.path.lexists(part) else None


def is_final(folder: Path) -> bool:
    """Return whether a run that has ended has yet to get its files put in their places."""
    run = _record(folder / f"{RUN_FILE}{PART}", follow=False)
    return run.get("status") in FINAL and _file_of(run) in FILES.values()


def _file_of(run: dict[str, Any]) -> str:
    """Return the name of the file of results that a record names."""
    return str(run.get("results") or RESULTS_FILE)


def _status(path: Path) -> str:
    return str(_record(path).get("status") or "")


def _record(path: Path, *, follow: bool = True) -> dict[str, Any]:
    """Return a record without looking into it; an empty one if there is none."""
    try:
        found = json.loads(read_bytes(path, largest=LARGEST, follow=follow))
    except (OSError, ValueError, RecursionError, MemoryError):
        return {}
    return found if isinstance(found, dict) else {}


RESULTS = Path("results")
"""Folder in the working folder that holds all results."""
LONGEST = 100
"""Characters of a name; chosen: short enough for a table, and far from what disks allow (255 bytes)."""


def default_folder(
    file: Path, changes: Iterable[Override] = (), *, suffix: str = "", name: str | None = None
) -> Path:
    """Return the folder of the results of a scenario, study or sweep file.

    Args:
        file: whose results they are.
        changes: against the file, in their order.
        suffix: of the file's name, for other results than those of a run of it.
        name: in place of one made of the file and the changes.

    Raises:
        ScenarioError: no folder can be called so.
        ResultsError: see `below_results`.
    """
    above, stem = names_of(file)
    if name is None:
        return below_results(above, _with_changes(f"{stem}{suffix}", changes))
    if not _is_name(name) or re.search(r'[\x00-\x1f/\\:*?"<>|]', name) or len(name.encode()) > 200:
        raise ScenarioError(f"--name {name}: must be the name of one folder; a path is given with --out")
    return below_results(above, name)


def names_of(file: Path) -> tuple[str, str]:
    """Return what results of a file are called: the name of its folder, "" of the root's, and its own.

    Raises:
        ScenarioError: no folder can be called as the file is.
    """
    above = Path(os.path.abspath(file)).parent.name
    if not _is_name(file.stem) or (above and not _is_name(above)):
        raise ScenarioError(f"{file}: no folder of results can be named after it; name one with --out")
    return above, file.stem


def below_results(*names: str) -> Path:
    """Return a folder below `results`, which may itself be a link; none below it is followed.

    Args:
        names: of a folder in each other; empty ones are left out.

    Raises:
        ScenarioError: no folder can be called so.
        ResultsError: one of them is a link.
    """
    place = RESULTS
    for name in filter(None, names):
        if not _is_name(name):
            raise ScenarioError(f"no folder below {RESULTS} can be called {name!r}; name one with --out")
        place /= name
        if place.is_symlink():
            raise ResultsError(
                f"{place}: is a symbolic link, which is not followed below {RESULTS}; "
                "name the folder that it leads to with --out"
            )
    return place


def _is_name(text: str) -> bool:
    """Return whether a folder can be called so: neither itself, nor the one above, nor a path."""
    return bool(text.strip(". ")) and "/" not in text and os.sep not in text


def _with_changes(stem: str, changes: Iterable[Override]) -> str:
    """Return a name with changes behind it: readable, and with a hash where that does not say all."""
    given = list(changes)
    values = [_text(one.plain) for one in given]
    of_files = [one.names_file for one in given]
    names = [re.split(r"[/\\]", v)[-1] if file else v for v, file in zip(values, of_files, strict=True)]
    readable = ",".join([stem, *(f"{one.place}={name}" for one, name in zip(given, names, strict=True))])
    portable = re.sub(r"[^\w.,=+-]", "_", readable, flags=re.ASCII)
    if not given or (names == values and portable == readable and len(portable) <= LONGEST):
        return readable
    exact = repr([(one.place, one.plain) for one in given])
    return f"{portable[: LONGEST - 7].rstrip('.')}~{hashlib.sha256(exact.encode()).hexdigest()[:6]}"


def _text(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.10g}" if isinstance(value, float) else str(value)

"""The results folder of a run: its files, their final renames, its lock, and where it is by default.

While a run goes on its files end in `.part`, and its record says "running"; earlier results stay next to
them. At the end the files get their final names. If a record ends in `.part` while no process has the folder
locked, the run has died. Readers report that and change nothing; the next run in the folder, or `salvage`,
completes the renames.

Results of a completed run are replaced only by those of another completed run; those of a failed run go to
`failed` below them. Only files in the folder that have names of our formats are moved, and no links followed.

Without `--out`, results go to a folder named after the file and its overrides:

    results/<folder of the file>/<its name>                                        no overrides
    results/<folder of the file>/<its name>,controller=controller_off,stop_time=2  with overrides

One command at a time writes into a folder. The lock is a locked file that names its holder; the operating
system releases it when the process ends, and the next command takes over a file that was left behind.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import shlex
import socket
import stat
import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from datetime import datetime
from enum import Enum
from pathlib import Path
from typing import Any

from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.foundation.messages import cut
from yawbench.foundation.safe_files import (
    LOCK_FILE,
    NEW,
    claim,
    fcntl,
    lock_note,
    read_bytes,
    reason,
    refuse_link,
    refuse_links_within,
)

from ..plan import Override
from ..scenario.overrides import value_in_words
from .file_formats import FILES, RESULTS_FILE

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


RESULTS = Path("results")
"""Folder for all results, in the working directory."""
LONGEST = 100
"""Largest length of a name. Chosen: short enough for a table, well below what disks allow (255 bytes)."""


def default_folder(
    file: Path, changes: Iterable[Override] = (), *, suffix: str = "", name: str | None = None
) -> Path:
    """Return the results folder of a scenario, study or sweep file.

    Args:
        file: the scenario or experiment file.
        changes: its overrides, in their order.
        suffix: appended to the file's name, for results other than those of a run of it.
        name: replaces the name made from the file and the overrides.

    Raises:
        ScenarioError: the name cannot be that of a folder.
        ResultsError: see `below_results`.
    """
    above, stem = names_of(file)
    if name is None:
        return below_results(above, _with_changes(f"{stem}{suffix}", changes))
    if not _is_name(name) or re.search(r'[\x00-\x1f/\\:*?"<>|]', name) or len(name.encode()) > 200:
        raise ScenarioError(
            f"--name {name}: must be the name of one folder; a path is given with --out",
            code="option-invalid",
        )
    return below_results(above, name)


def names_of(file: Path) -> tuple[str, str]:
    """Return the names that results of a file have: that of its folder ("" for the root) and its own.

    Raises:
        ScenarioError: the file's name cannot be that of a folder.
    """
    above = Path(os.path.abspath(file)).parent.name
    if not _is_name(file.stem) or (above and not _is_name(above)):
        raise ScenarioError(
            f"{file}: no folder of results can be named after it; name one with --out", code="folder-invalid"
        )
    return above, file.stem


def below_results(*names: str) -> Path:
    """Return a folder below `results`. `results` may itself be a link; links below it are refused.

    Args:
        names: of nested folders; empty ones are skipped.

    Raises:
        ScenarioError: a name cannot be that of a folder.
        ResultsError: one of the folders is a link.
    """
    folder = RESULTS
    for name in filter(None, names):
        if not _is_name(name):
            raise ScenarioError(
                f"no folder below {RESULTS} can be called {name!r}; name one with --out",
                code="folder-invalid",
            )
        folder /= name
        if folder.is_symlink():
            raise ResultsError(
                f"{folder}: is a symbolic link, which is not followed below {RESULTS}; "
                "name the folder that it leads to with --out",
                code="results-unwritable",
            )
    return folder


def _is_name(text: str) -> bool:
    """Return whether a text is a single folder name: not a path, and neither `.` nor `..`."""
    return bool(text.strip(". ")) and "/" not in text and os.sep not in text


def _with_changes(stem: str, changes: Iterable[Override]) -> str:
    """Return a name followed by its overrides, shortened and with a hash where they cannot be written out."""
    overrides = list(changes)
    values = [value_in_words(override.plain) for override in overrides]
    of_files = [override.target.names_file for override in overrides]
    names = [re.split(r"[/\\]", v)[-1] if file else v for v, file in zip(values, of_files, strict=True)]
    readable = ",".join(
        [stem, *(f"{override.target}={name}" for override, name in zip(overrides, names, strict=True))]
    )
    portable = re.sub(r"[^\w.,=+-]", "_", readable, flags=re.ASCII)
    if not overrides or (names == values and portable == readable and len(portable) <= LONGEST):
        return readable
    exact = repr([(str(override.target), override.plain) for override in overrides])
    return f"{portable[: LONGEST - 7].rstrip('.')}~{hashlib.sha256(exact.encode()).hexdigest()[:6]}"


LOOKS = 100
"""Attempts to get a lock, 10 ms apart. Chosen: runs whose command was killed end within that time."""


@dataclass(frozen=True)
class LockHolder:
    """The command that has a folder locked."""

    command: str
    process: int
    host: str
    since: str  # ISO 8601

    @classmethod
    def here(cls) -> LockHolder:
        """Return the holder that describes this process."""
        name = Path(sys.argv[0]).stem if sys.argv else ""
        command = shlex.join(["yawbench" if name in ("", "cli", "-c") else name, *sys.argv[1:]])
        now = datetime.now().astimezone().isoformat(timespec="seconds")
        return cls(command, os.getpid(), socket.gethostname(), now)

    def __str__(self) -> str:
        command = self.command if len(self.command) <= 100 else f"{self.command[:97]}..."
        return f"{command!r} (process {self.process} on {self.host}, since {self.since[11:19]})"


class FolderLock:
    """An exclusive lock on a folder until `release`. The folder is created if it does not exist.

    Raises:
        ResultsError: another process has the lock, or the folder is not writable.
    """

    def __init__(self, folder: Path) -> None:
        home = folder.absolute()
        self._path = home / LOCK_FILE
        self._made: list[Path] = []
        self._descriptor: int | None = None
        try:
            refuse_links_within(home)
            self._made = [parent for parent in (home, *home.parents) if not parent.exists()]
            home.mkdir(parents=True, exist_ok=True)
            self._descriptor = _claimed(self._path)
            os.ftruncate(self._descriptor, 0)
            os.write(self._descriptor, json.dumps(asdict(LockHolder.here())).encode())
        except FileExistsError:
            raise ResultsError(
                f"{folder}: results cannot be written here: it is not a folder; name another with --out.",
                code="results-unwritable",
            ) from None
        except BlockingIOError:
            raise _held(folder, holder_of(home) or _holder_in(b"")) from None
        except OSError as error:
            self.release()
            raise ResultsError(
                f"{folder}: results cannot be written here: {reason(error)}.", code="results-unwritable"
            ) from None

    def release(self) -> None:
        """Release the lock; remove the folder if it was created here and is still empty.

        Further calls do nothing.
        """
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            if fcntl is None:
                os.close(descriptor)  # Windows cannot remove open files
            with contextlib.suppress(OSError):
                self._path.unlink()
            if fcntl is not None:
                os.close(descriptor)
        with contextlib.suppress(OSError):
            for parent in self._made:
                parent.rmdir()


def _claimed(path: Path) -> int:
    """Open and lock a file, retrying: readers (`holder_of`) and ending processes lock it only briefly."""
    for _ in range(LOOKS):
        with contextlib.suppress(BlockingIOError):
            return claim(path)
        time.sleep(0.01)
    return claim(path)


@contextlib.contextmanager
def writing(*folders: Path) -> Iterator[None]:
    """Lock folders, and everything below them, while the block runs.

    Runs of the same command lock their own folders below.

    Raises:
        ResultsError: another command has locked one of them or a folder above, or one is not writable.
    """
    with contextlib.ExitStack() as stack:
        for folder in {folder.resolve(): folder for folder in folders}.values():
            refuse_below_others(folder)
            stack.callback(FolderLock(folder).release)
        yield


def refuse_below_others(folder: Path) -> None:
    """Raise if another process has locked a folder above this one.

    Raises:
        ResultsError: another process has.
    """
    for above in folder.absolute().parents:
        holder = holder_of(above)
        if holder is not None and (holder.process, holder.host) != (os.getpid(), socket.gethostname()):
            raise _held(above, holder)


def holder_of(folder: Path) -> LockHolder | None:
    """Return the holder of the lock on a folder, None if it is not locked. Changes nothing there."""
    note = lock_note(folder)
    return None if note is None else _holder_in(note)


def _holder_in(note: bytes) -> LockHolder:
    """Return the holder that a lock file names; the file may be incomplete."""
    try:
        content = json.loads(note)
        holder = LockHolder(
            str(content["command"]), int(content["process"]), str(content["host"]), str(content["since"])
        )
    except (ValueError, TypeError, KeyError, RecursionError, OverflowError):
        return LockHolder("another run", 0, "this computer", "")
    return holder


def _held(folder: Path, holder: LockHolder) -> ResultsError:
    return ResultsError(
        f"{folder}: {holder} is writing here; wait for it, or give another folder with --out.",
        code="results-locked",
    )

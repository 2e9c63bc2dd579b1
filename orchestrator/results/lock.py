"""Locks on folders: one command at a time writes into a folder.

A lock is a locked file in the folder that names its holder. The operating system releases it when the
process ends, however it ends; the file that a killed process leaves behind is taken over by the next one.
"""

from __future__ import annotations

import contextlib
import json
import os
import shlex
import socket
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path

from ..errors import ResultsError
from ..files import LOCK_FILE, claim, fcntl, lock_note, reason, refuse_links_within

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
            self._made = [place for place in (home, *home.parents) if not place.exists()]
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
            for place in self._made:
                place.rmdir()


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

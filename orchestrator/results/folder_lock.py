"""Locks of results folders: one command at a time writes into a folder.

The lock is a locked file that names its holder; the operating system releases it when the process ends, and
the next command takes over a file that was left behind.
"""

from __future__ import annotations

import contextlib
import os
import shlex
import socket
import sys
import time
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

from yawbench.foundation.errors import ResultsError
from yawbench.foundation.messages import cut, printable
from yawbench.foundation.safe_files import (
    LOCK_FILE,
    claim,
    fcntl,
    lock_note,
    reason,
    refuse_links_within,
)

LOOKS = 100
"""Attempts to get a lock, 10 ms apart. Chosen: runs whose command was killed end within that time."""
_own: set[Path] = set()
"""Folders that this process has locked."""


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
            os.write(self._descriptor, _holder().encode("utf-8", "replace"))
            _own.add(home.resolve())
        except FileExistsError:
            raise ResultsError(
                f"{folder}: results cannot be written here: it is not a folder; name another with --out.",
                code="results-unwritable",
            ) from None
        except BlockingIOError:
            raise _held(folder, holder_of(home) or "another run") from None
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
        _own.discard(self._path.parent.resolve())
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
    for above in folder.resolve().parents:
        if above not in _own and (holder := holder_of(above)):
            raise _held(above, holder)


def holder_of(folder: Path) -> str | None:
    """Return in words who has locked a folder, None if it is not locked. Changes nothing there."""
    note = lock_note(folder)
    return None if note is None else cut(printable(note.decode("utf-8", "replace"))) or "another run"


def _holder() -> str:
    """Return the command of this process in words, for others that want to write here."""
    name = Path(sys.argv[0]).stem if sys.argv else ""
    command = shlex.join(["yawbench" if name in ("", "cli", "-c") else name, *sys.argv[1:]])
    host, now = socket.gethostname(), datetime.now()
    return f"{cut(command, 100)!r} (process {os.getpid()} on {host}, since {now:%H:%M:%S})"


def _held(folder: Path, holder: str) -> ResultsError:
    return ResultsError(
        f"{folder}: {holder} is writing here; wait for it, or give another folder with --out.",
        code="results-locked",
    )

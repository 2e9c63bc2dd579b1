"""Who writes into a folder: one command at a time.

A lock is a small file in the folder that says who holds it. The operating system ends the hold when
the process ends, however it does; the file that a killed process leaves is taken over by the next.
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
"""Times that a lock is asked for again, 10 ms apart; chosen: runs whose command was killed end sooner."""


@dataclass(frozen=True)
class LockHolder:
    """A command that writes into a folder."""

    command: str
    process: int
    host: str
    since: str  # ISO 8601

    @classmethod
    def here(cls) -> LockHolder:
        """Return this process."""
        name = Path(sys.argv[0]).stem if sys.argv else ""
        command = shlex.join(["yawbench" if name in ("", "cli", "-c") else name, *sys.argv[1:]])
        now = datetime.now().astimezone().isoformat(timespec="seconds")
        return cls(command, os.getpid(), socket.gethostname(), now)

    def __str__(self) -> str:
        command = self.command if len(self.command) <= 100 else f"{self.command[:97]}..."
        return f"{command!r} (process {self.process} on {self.host}, since {self.since[11:19]})"


class FolderLock:
    """The hold of a folder, until it is released. The folder is made if it does not exist.

    Raises:
        ResultsError: somebody else holds it, or nothing can be written there.
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
                f"{folder}: results cannot be written here: it is no folder; name another with --out."
            ) from None
        except BlockingIOError:
            raise _held(folder, holder_of(home) or _said(b"")) from None
        except OSError as error:
            self.release()
            raise ResultsError(f"{folder}: results cannot be written here: {reason(error)}.") from None

    def release(self) -> None:
        """Let go of the folder; one that was made for nothing is removed. Further calls do nothing."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            if fcntl is None:
                os.close(descriptor)  # Windows removes no open file
            with contextlib.suppress(OSError):
                self._path.unlink()
            if fcntl is not None:
                os.close(descriptor)
        with contextlib.suppress(OSError):
            for place in self._made:
                place.rmdir()


def _claimed(path: Path) -> int:
    """Claim a file; one who only looks at it (`holder_of`), or is about to end, is no reason to give up."""
    for _ in range(LOOKS):
        with contextlib.suppress(BlockingIOError):
            return claim(path)
        time.sleep(0.01)
    return claim(path)


@contextlib.contextmanager
def writing(*folders: Path) -> Iterator[None]:
    """Hold folders, and all that is below them, while the block runs.

    Runs of the same command lock their own folders below.

    Raises:
        ResultsError: another command holds one of them or a folder above, or nothing can be written there.
    """
    with contextlib.ExitStack() as stack:
        for folder in {folder.resolve(): folder for folder in folders}.values():
            refuse_below_others(folder)
            stack.callback(FolderLock(folder).release)
        yield


def refuse_below_others(folder: Path) -> None:
    """Make sure that no other process holds a folder above.

    Raises:
        ResultsError: one does.
    """
    for above in folder.absolute().parents:
        holder = holder_of(above)
        if holder is not None and (holder.process, holder.host) != (os.getpid(), socket.gethostname()):
            raise _held(above, holder)


def holder_of(folder: Path) -> LockHolder | None:
    """Return who writes into a folder, None if nobody does. Nothing is changed there."""
    note = lock_note(folder)
    return None if note is None else _said(note)


def _said(note: bytes) -> LockHolder:
    """Return what a lock file says of its holder, who may not have come to say it."""
    try:
        said = json.loads(note)
        holder = LockHolder(str(said["command"]), int(said["process"]), str(said["host"]), str(said["since"]))
    except (ValueError, TypeError, KeyError, RecursionError, OverflowError):
        return LockHolder("another run", 0, "this computer", "")
    return holder


def _held(folder: Path, holder: LockHolder) -> ResultsError:
    return ResultsError(
        f"{folder}: {holder} is writing here; wait for it, or give another folder with --out."
    )

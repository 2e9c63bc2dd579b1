"""Files written whole or not at all, and never through a link in a results folder.

Results may come from somebody else, with links in place of the files and folders that are written there.
The folder that the user names may itself be a link, or lie behind one. Below it no link is followed.
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from collections.abc import Iterator
from pathlib import Path

from .files import NO_FOLLOW, TEXT, refuse_link

try:
    import fcntl
except ImportError:  # Windows, where a file that somebody writes cannot be replaced anyway
    fcntl = None  # type: ignore[assignment]

NEW = ".new"
"""What the name of a file ends in for the moment in which it is being written."""


LOCK_FILE = ".yawbench-lock"
"""Name of the file that its writer has locked in a folder of results."""


def write_whole(path: Path, content: str | bytes, *, named: bool = False) -> None:
    """Write a file so that at any moment there is what stood there before, or all of the new content.

    The folder is made if it does not exist. What a dead process has left under the temporary name is
    overwritten. A link, pipe or device in the file's place is replaced, its target left alone.

    Args:
        path: of the file.
        content: of the file.
        named: the user has named this very file: a link stays and its target is replaced, a pipe or a
            device is written to.

    Raises:
        OSError: the file cannot be written; what stood there has not changed.
    """
    # a path that is no UTF-8 comes as lone surrogates, which text shows as \\udcxx
    data = content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
    target = Path(os.path.realpath(path)) if named else path
    try:
        if not named:
            refuse_links_within(target.parent)
        target.parent.mkdir(parents=True, exist_ok=True)
        if named and target.exists() and not target.is_file():  # a device or a pipe; a folder will say so
            target.write_bytes(data)
            return
        part = target.with_name(target.name + NEW)
        try:
            with os.fdopen(claim(part, wait=True), "wb") as stream:
                os.ftruncate(stream.fileno(), 0)
                stream.write(data)
                stream.flush()
                os.fsync(stream.fileno())
                if fcntl is None:
                    stream.close()
                os.replace(part, target)
        except BaseException:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)
            raise
    except OSError as error:
        error.filename, error.filename2 = str(path), None
        raise


def open_own(path: Path, flags: int, mode: int = 0o666) -> int:
    """Open a file that only this program writes: a regular file, no link, with no other name.

    Raises:
        OSError: it cannot be opened, or is something else.
    """
    refuse_link(path)
    more = NO_FOLLOW | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
    descriptor = os.open(path, flags | more, mode)
    status = os.fstat(descriptor)
    if not stat.S_ISREG(status.st_mode):
        problem = "is a pipe, a socket or a device, not a file"
    elif status.st_nlink > 1:
        problem = "has another name (a hard link), whose content would change, too; copy or remove it"
    else:
        return descriptor
    os.close(descriptor)
    raise OSError(errno.EINVAL, f"{path.name} {problem}", str(path))


def claim(path: Path, *, wait: bool = False) -> int:
    """Open a file (see `open_own`), made if it does not exist, and lock it until its descriptor is closed.

    The lock ends with the process, however that ends. On network drives that cannot lock it is none.

    Args:
        path: of the file.
        wait: for the one who holds it.

    Raises:
        BlockingIOError: somebody else holds it, and nobody is to wait.
        OSError: it cannot be opened.
    """
    while True:
        descriptor = open_own(path, os.O_RDWR | os.O_CREAT)
        if fcntl is None:
            return descriptor
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except OSError as error:
            if error.errno not in (errno.EWOULDBLOCK, errno.EACCES):
                return descriptor
            os.close(descriptor)
            raise BlockingIOError(error.errno, os.strerror(error.errno), str(path)) from None
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(descriptor), os.lstat(path)):
                return descriptor
        os.close(descriptor)  # the one who held it has renamed or removed it


@contextlib.contextmanager
def draft_of(file: Path, content: bytes) -> Iterator[Path]:
    """Write `content` beside `file`, for whoever looks at it before it is put in its place.

    Who else makes a draft of the same file waits. What a dead process has left is overwritten.
    """
    path = _draft(file)
    descriptor = claim(path, wait=True)
    try:
        os.ftruncate(descriptor, 0)
        with os.fdopen(os.dup(descriptor), "wb") as draft:
            draft.write(content)
            draft.flush()
            os.fsync(draft.fileno())
        if fcntl is None:
            os.close(descriptor)
        yield path
    finally:
        path.unlink(missing_ok=True)
        if fcntl is not None:
            os.close(descriptor)


def remove_draft(file: Path) -> None:
    """Remove the draft of a file that a dead process has left."""
    path = _draft(file)
    if not path.is_file():
        return
    with contextlib.suppress(OSError):
        descriptor = claim(path)
        path.unlink(missing_ok=True)
        os.close(descriptor)


def _draft(file: Path) -> Path:
    return file.with_name(f".{file.name}.draft")


def lock_note(folder: Path) -> bytes | None:
    """Return what the process that holds a folder has written into its lock file, None if nobody does.

    Nothing is changed, and no lock file made.
    """
    try:
        descriptor = open_own(folder / LOCK_FILE, os.O_RDONLY)
    except OSError:
        return None
    with os.fdopen(descriptor, "rb") as stream:
        try:
            if fcntl is not None:
                fcntl.flock(stream.fileno(), fcntl.LOCK_SH | fcntl.LOCK_NB)
                return None
        except OSError:  # held, or on a network drive that cannot tell
            pass
        with contextlib.suppress(OSError):
            return stream.read(TEXT)
        return b""


def refuse_links_within(folder: Path) -> None:
    """Make sure that no link leads from a held folder to one below it, or out of it.

    Raises:
        OSError: one of the folders below the outermost that a process holds is a link.
    """
    absolute = Path(os.path.abspath(folder))
    below: list[Path] = []
    for place in reversed((absolute, *absolute.parents)):
        if below or lock_note(place) is not None:
            below.append(place)
    for place in below[1:]:
        refuse_link(place)

"""Files that are written whole or not at all, whatever ends the program on the way."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows, where a file that somebody writes cannot be replaced anyway
    fcntl = None  # type: ignore[assignment]

NEW = ".new"
"""What the name of a file ends in for the moment in which it is being written."""


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file so that at any moment there is what stood there before, or all of the new content.

    The folder is made if it does not exist. A symbolic link stays one: its target is replaced. What a
    dead process has left under the temporary name is overwritten.

    Raises:
        OSError: the file cannot be written; what stood there has not changed.
    """
    # a path that is no UTF-8 comes as lone surrogates, which text shows as \\udcxx
    data = content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
    target = Path(os.path.realpath(path))
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.exists() and not target.is_file():  # a device or a pipe; a folder will say so
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


def claim(path: Path, *, wait: bool = False) -> int:
    """Open a file, made if it does not exist, and lock it until its descriptor is closed.

    The lock ends with the process, however that ends. On network drives that cannot lock it is none.

    Args:
        path: of the file.
        wait: for the one who holds it.

    Raises:
        BlockingIOError: somebody else holds it, and nobody is to wait.
        OSError: it cannot be opened.
    """
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o666)
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
            if os.path.samestat(os.fstat(descriptor), os.stat(path)):
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

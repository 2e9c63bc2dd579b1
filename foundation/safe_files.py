"""Safe reading and atomic writing of files.

Reading never blocks, is bounded in size, and turns every error into one message. Every reader of a user's
file (scenario, vehicle, study, sweep, SSP archive, FMU, results, time series) gets its bytes from
`read_bytes` or `open_regular` and works inside `reading`. Readers report expected errors with their line;
`reading` turns everything else into one message.

Files are written completely or not at all, and never through a symbolic link in a results folder: results
may come from other people, with links in place of files and folders. The folder that the user names may
itself be a link, or be reached through one; below it, no link is followed.
"""

from __future__ import annotations

import contextlib
import errno
import functools
import os
import stat
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from pathlib import Path
from typing import BinaryIO, Concatenate, ParamSpec, TypeVar

from .errors import YawbenchError
from .messages import in_bytes

P = ParamSpec("P")
R = TypeVar("R")

TEXT = 1_000_000
"""Bytes of a YAML file. Chosen: fifty times the largest of ours; reading them takes five seconds."""
PACKED = 1_000_000_000
"""Bytes of an archive. Chosen: larger than all FMUs known to us, and it fits into memory."""
NO_FOLLOW = getattr(os, "O_NOFOLLOW", 0)
"""Flag that refuses to open symbolic links; missing on Windows, where `refuse_link` alone has to do."""


_READ: ContextVar[set[Path] | None] = ContextVar("_READ", default=None)


@contextlib.contextmanager
def noting_files() -> Iterator[set[Path]]:
    """Yield a set that receives the absolute path of every user's file that this thread reads meanwhile."""
    read: set[Path] = set()
    token = _READ.set(read)
    try:
        yield read
    finally:
        _READ.reset(token)


def check_regular(path: Path) -> None:
    """Check that a path is a regular file; see `open_regular`."""
    open_regular(path).close()


def refuse_link(path: Path) -> None:
    """Check that a path is not a symbolic link.

    Raises:
        OSError: it is one.
    """
    if os.path.islink(path):
        raise OSError(errno.ELOOP, f"{path.name} is a symbolic link, which is not followed", str(path))


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file for reading, without blocking.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it is not a regular file, or not a valid path.
    """
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    mode = os.fstat(descriptor).st_mode
    if stat.S_ISREG(mode):
        if (read := _READ.get()) is not None:
            read.add(Path(os.path.abspath(path)))
        return open(descriptor, "rb")
    os.close(descriptor)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    raise ValueError("it is a pipe, a socket or a device, not a file")


def read_bytes(path: Path, *, largest: int) -> bytes:
    """Return the content of a regular file.

    Args:
        path: the file.
        largest: maximum size [bytes].

    Raises:
        OSError: the file cannot be opened or read.
        ValueError: it is not a regular file, not a valid path, or larger than `largest`.
    """
    with open_regular(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        if size > largest:
            raise ValueError(f"it is larger than {in_bytes(largest)}")
        return stream.read(size)  # allocates that much even for a short file, so not `largest`


@contextlib.contextmanager
def reading(what: str, path: Path | str, error: type[YawbenchError]) -> Iterator[None]:
    """Convert unexpected exceptions while a user's file is read into one message, with the cause chained.

    Args:
        what: kind of the file, for the message: "scenario file".
        path: the file, or another description of the location.
        error: type of the exception to raise.
    """
    try:
        yield
    except YawbenchError:
        raise
    except (RecursionError, MemoryError) as cause:
        why = "is nested too deeply" if isinstance(cause, RecursionError) else "does not fit into the memory"
        raise error(f"{path}: cannot read this {what}: it {why}") from cause
    except OSError as cause:
        raise error(f"{cause.filename or path}: cannot read this {what}: {reason(cause)}") from cause
    except Exception as cause:
        text = f"{type(cause).__name__}: {reason(cause)}"
        raise error(f"{path}: cannot read this {what}: something in it is not understood ({text})") from cause


def reads(
    what: str, error: type[YawbenchError]
) -> Callable[[Callable[Concatenate[Path | str, P], R]], Callable[Concatenate[Path | str, P], R]]:
    """Decorate a function that reads the file given as its first argument; see `reading`."""

    def decorate(
        function: Callable[Concatenate[Path | str, P], R],
    ) -> Callable[Concatenate[Path | str, P], R]:
        @functools.wraps(function)
        def wrapper(path: Path | str, /, *args: P.args, **kwargs: P.kwargs) -> R:
            with reading(what, path, error):
                return function(path, *args, **kwargs)

        return wrapper

    return decorate


def reason(error: Exception) -> str:
    """Return why a file cannot be read or written, in one line."""
    if isinstance(error, OSError) and error.errno == errno.ENOSPC:
        return "the disk is full"
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(text).split())


try:
    import fcntl as fcntl
except ImportError:  # Windows, where an open file cannot be replaced anyway
    fcntl = None  # type: ignore[assignment]

NEW = ".new"
"""Suffix of the temporary file while a file is written."""
LOCK_FILE = ".yawbench-lock"
"""Name of the file in a results folder that is locked by its writer."""


def write_whole(path: Path, content: str | bytes, *, named: bool = False) -> None:
    """Write a file atomically: at any moment it has its old content or all of the new.

    The folder is created if necessary. A temporary file left by a dead process is overwritten. A link,
    pipe or device at the path is replaced, its target unchanged.

    Args:
        path: the file.
        content: its new content.
        named: the user has named this very file: a link is kept and its target replaced, a pipe or a
            device is written to.

    Raises:
        OSError: the file cannot be written; its old content is unchanged.
    """
    # a path that is not UTF-8 has lone surrogates, which are written as \\udcxx
    data = content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
    target = Path(os.path.realpath(path)) if named else path
    try:
        if not named:
            refuse_links_within(target.parent)
        target.parent.mkdir(parents=True, exist_ok=True)
        if named and target.exists() and not target.is_file():  # a device or a pipe; a folder raises
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
    """Open a file that only this program writes; refuse symbolic and hard links, pipes and devices.

    Raises:
        OSError: the file cannot be opened, or is refused.
    """
    refuse_link(path)
    more = NO_FOLLOW | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
    descriptor = os.open(path, flags | more, mode)
    status = os.fstat(descriptor)
    if not stat.S_ISREG(status.st_mode):
        problem = "is a pipe, a socket or a device, not a file"
    elif status.st_nlink > 1:
        problem = "has another name (a hard link), whose content would change too; copy or remove it"
    else:
        return descriptor
    os.close(descriptor)
    raise OSError(errno.EINVAL, f"{path.name} {problem}", str(path))


def claim(path: Path, *, wait: bool = False) -> int:
    """Open or create a file (see `open_own`), and lock it until its descriptor is closed.

    The lock ends with the process, however that ends. Network drives without locks are not locked.

    Args:
        path: the file.
        wait: whether to wait if another process has locked it.

    Raises:
        BlockingIOError: another process has locked it, and `wait` is False.
        OSError: the file cannot be opened.
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
        os.close(descriptor)  # the previous owner of the lock has renamed or removed the file: try again


def lock_note(folder: Path) -> bytes | None:
    """Return the content of a folder's lock file if a process has locked it, else None.

    Changes nothing and creates no lock file.
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
        except OSError:  # locked, or on a network drive without locks
            pass
        with contextlib.suppress(OSError):
            return stream.read(TEXT)
        return b""


def refuse_links_within(folder: Path) -> None:
    """Check that no folder on the path below a locked results folder is a symbolic link.

    Raises:
        OSError: one of the folders below the outermost locked one is a link.
    """
    absolute = Path(os.path.abspath(folder))
    below: list[Path] = []
    for parent in reversed((absolute, *absolute.parents)):
        if below or lock_note(parent) is not None:
            below.append(parent)
    for parent in below[1:]:
        refuse_link(parent)

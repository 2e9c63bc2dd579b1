"""Users' files: opened without waiting, bounded in size, and every mistake in them a sentence.

Every reader of a user's file (scenario, vehicle, study, sweep, SSP archive, FMU, results, time series)
gets its bytes from `read_bytes` or `open_regular` and works inside `reading`. Mistakes that a reader
foresees it reports itself, with the line; `reading` is for those that nobody foresaw.

Files written whole or not at all, and never through a link in a results folder.

Results may come from somebody else, with links in place of the files and folders that are written there.
The folder that the user names may itself be a link, or lie behind one. Below it no link is followed.
"""

from __future__ import annotations

import contextlib
import errno
import functools
import os
import re
import stat
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO, Concatenate, ParamSpec, TypeVar

from .errors import YawbenchError

P = ParamSpec("P")
R = TypeVar("R")

TEXT = 1_000_000
"""Bytes of a YAML file. Chosen: fifty times the largest of ours; reading them takes five seconds."""
PACKED = 1_000_000_000
"""Bytes of an archive. Chosen: more than any FMU that we have met, and it is held in memory."""
UNPACKED = 1_000_000_000
"""Bytes of all members of an archive. Chosen: likewise."""
MEMBERS = 50_000
"""Members of an archive. Chosen: ten times what a whole Python with numpy has."""
DEPTH = 100
"""Folders in each other in an archive. Chosen: ten times what a whole Python has; the standard library
makes and deletes folders by recursion."""


NO_FOLLOW = getattr(os, "O_NOFOLLOW", 0)
"""Flag that opens no symbolic link; Windows has none, there `refuse_link` alone must do."""


class TooLargeError(ValueError):
    """What is in a file is more than is read, in a sentence that begins with "it" or a participle."""


def check_regular(path: Path) -> None:
    """Make sure that a path names a regular file, so that no reader waits for a pipe or a device.

    Raises:
        OSError: there is none, or a folder.
        ValueError: it is something else, or no path can be called so.
    """
    mode = os.stat(path).st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode):
        raise ValueError("it is a pipe, a socket or a device, not a file")


def refuse_link(path: Path) -> None:
    """Make sure that a path does not name a symbolic link.

    Raises:
        OSError: it does.
    """
    if os.path.islink(path):
        raise OSError(errno.ELOOP, f"{path.name} is a symbolic link, which is not followed", str(path))


def open_regular(path: Path, *, follow: bool = True) -> BinaryIO:
    """Open a regular file for reading, without waiting for anything.

    Args:
        path: of the file.
        follow: a symbolic link; False: refuse it.

    Raises:
        OSError: it cannot be opened.
        ValueError: it is no regular file, or no path can be called so.
    """
    check_regular(path)
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    if not follow:
        refuse_link(path)
        flags |= NO_FOLLOW
    stream = open(os.open(path, flags), "rb")  # noqa: SIM115
    if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):  # exchanged since
        stream.close()
        raise ValueError("it is a pipe, a socket or a device, not a file")
    return stream


def read_bytes(path: Path, *, largest: int, follow: bool = True) -> bytes:
    """Return the content of a regular file.

    Args:
        path: of the file.
        largest: size [bytes].
        follow: a symbolic link; False: refuse it.

    Raises:
        OSError: it cannot be opened or read.
        ValueError: it is no regular file, or no path can be called so.
        TooLargeError: it is larger than `largest`.
    """
    with open_regular(path, follow=follow) as stream:
        size = os.fstat(stream.fileno()).st_size
        if size > largest:
            raise TooLargeError(f"it is larger than {_in_words(largest)}")
        return stream.read(size)  # room for as much is made, however little there is


def check_archive(archive: zipfile.ZipFile) -> None:
    """Make sure that an archive can be unpacked, by what its directory says: no more is ever read.

    Raises:
        TooLargeError: a sentence.
    """
    members = archive.infolist()
    if len(members) > MEMBERS:
        raise TooLargeError(f"it holds {len(members)} files, more than {MEMBERS}")
    size = sum(member.file_size for member in members)
    if size > UNPACKED:
        raise TooLargeError(f"unpacked it has {_in_words(size)}, more than {_in_words(UNPACKED)}")
    depth = max((re.sub(r"[/\\\\]+", "/", member.filename).count("/") for member in members), default=0)
    if depth > DEPTH:
        raise TooLargeError(f"it holds {depth} folders in each other, more than {DEPTH}")


def _in_words(size: int) -> str:
    return f"{size / 1e9:.3g} GB" if size >= 1e9 else f"{size / 1e6:.3g} MB"


@contextlib.contextmanager
def reading(what: str, path: Path | str, error: type[YawbenchError]) -> Iterator[None]:
    """Turn what nobody foresaw while a user's file is read into one sentence; the cause stays chained.

    Args:
        what: the file is, or what else is read: "scenario file".
        path: of the file, or what else says the place.
        error: raised in place of the cause.
    """
    try:
        yield
    except YawbenchError:
        raise
    except RecursionError as cause:
        raise error(f"{path}: cannot read this {what}: it is nested too deeply") from cause
    except MemoryError as cause:
        raise error(f"{path}: cannot read this {what}: it does not fit into the memory") from cause
    except OSError as cause:
        raise error(f"{cause.filename or path}: cannot read this {what}: {reason(cause)}") from cause
    except Exception as cause:
        text = f"{type(cause).__name__}: {reason(cause)}"
        raise error(f"{path}: cannot read this {what}: something in it is not understood ({text})") from cause


def reads(
    what: str, error: type[YawbenchError]
) -> Callable[[Callable[Concatenate[Path | str, P], R]], Callable[Concatenate[Path | str, P], R]]:
    """Return a decorator for a function that reads the file that is its first argument; see `reading`."""

    def decorate(
        function: Callable[Concatenate[Path | str, P], R],
    ) -> Callable[Concatenate[Path | str, P], R]:
        @functools.wraps(function)
        def wrapper(path: Path | str, *args: P.args, **kwargs: P.kwargs) -> R:
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

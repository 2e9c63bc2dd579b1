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
import re
import stat
import zipfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path, PurePosixPath
from typing import BinaryIO, Concatenate, ParamSpec, TypeVar

from .errors import YawbenchError

P = ParamSpec("P")
R = TypeVar("R")

TEXT = 1_000_000
"""Bytes of a YAML file. Chosen: fifty times the largest of ours; reading them takes five seconds."""
PACKED = 1_000_000_000
"""Bytes of an archive. Chosen: larger than all FMUs known to us, and it fits into memory."""
UNPACKED = 1_000_000_000
"""Bytes of all members of an archive, unpacked. Chosen: as `PACKED`."""
MEMBERS = 50_000
"""Members of an archive. Chosen: ten times what a whole Python with numpy has."""
DEPTH = 100
"""Nested folders in an archive. Chosen: ten times what a whole Python has; the standard library
creates and deletes folders by recursion."""


NO_FOLLOW = getattr(os, "O_NOFOLLOW", 0)
"""Flag that refuses to open symbolic links; missing on Windows, where `refuse_link` alone has to do."""


class TooLargeError(ValueError):
    """A file is too large to read; the message has the file as its subject ("it is larger than ...")."""


class ArchiveError(ValueError):
    """The members of an archive cannot be taken; the message is a sentence of its own."""


def check_regular(path: Path) -> None:
    """Check that a path is a regular file, so that no reader blocks on a pipe or a device.

    Raises:
        OSError: the path does not exist, or is a folder.
        ValueError: it is something else, or not a valid path.
    """
    mode = os.stat(path).st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode):
        raise ValueError("it is a pipe, a socket or a device, not a file")


def refuse_link(path: Path) -> None:
    """Check that a path is not a symbolic link.

    Raises:
        OSError: it is one.
    """
    if os.path.islink(path):
        raise OSError(errno.ELOOP, f"{path.name} is a symbolic link, which is not followed", str(path))


def open_regular(path: Path, *, follow: bool = True) -> BinaryIO:
    """Open a regular file for reading, without blocking.

    Args:
        path: the file.
        follow: whether to follow a symbolic link; False: refuse it.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it is not a regular file, or not a valid path.
    """
    check_regular(path)
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    if not follow:
        refuse_link(path)
        flags |= NO_FOLLOW
    stream = open(os.open(path, flags), "rb")  # noqa: SIM115
    if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):  # replaced since the check
        stream.close()
        raise ValueError("it is a pipe, a socket or a device, not a file")
    return stream


def read_bytes(path: Path, *, largest: int, follow: bool = True) -> bytes:
    """Return the content of a regular file.

    Args:
        path: the file.
        largest: maximum size [bytes].
        follow: whether to follow a symbolic link; False: refuse it.

    Raises:
        OSError: the file cannot be opened or read.
        ValueError: it is not a regular file, or not a valid path.
        TooLargeError: it is larger than `largest`.
    """
    with open_regular(path, follow=follow) as stream:
        size = os.fstat(stream.fileno()).st_size
        if size > largest:
            raise TooLargeError(f"it is larger than {_in_words(largest)}")
        return stream.read(size)  # allocates that much even for a short file, so not `largest`


_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)


def members(archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """Return the files of an archive by path: with /, and without the ./ and \\ that some programs write.

    Raises:
        TooLargeError: too many members, too many bytes, or too deeply nested folders.
        ArchiveError: a path leads out of the archive or names two things, or a file is encrypted or packed
            by an unknown method.
    """
    _check_size(archive)
    files: dict[str, zipfile.ZipInfo] = {}
    for info in archive.infolist():
        name = info.filename.replace("\\", "/")
        parts = PurePosixPath(name).parts
        if name.startswith("/") or ".." in parts or ":" in name or "\0" in name:
            raise ArchiveError(f"the archive is unsafe: it contains the path {info.filename!r}")
        if name.endswith("/") or not parts:
            continue
        if info.flag_bits & 0x1:
            raise ArchiveError(f"the archive is encrypted ({info.filename}): pack it without a password")
        if info.compress_type not in _METHODS:
            raise ArchiveError(
                f"{info.filename} is compressed by a method that is not supported, number "
                f"{info.compress_type}: pack the archive with 'deflate'"
            )
        other = files.setdefault("/".join(parts), info)
        if (other.CRC, other.file_size) != (info.CRC, info.file_size):
            raise ArchiveError(f"the archive contains {'/'.join(parts)} twice, with different contents")
    for name in files:
        if both := next((str(above) for above in PurePosixPath(name).parents if str(above) in files), None):
            raise ArchiveError(f"the archive contains {both} as a file and as a folder")
    return files


def misplaced(files: Iterable[str], wanted: str) -> str:
    """Return why an archive with these files lacks the file `wanted` in its first folder."""
    for name in files:
        folder, _, last = name.rpartition("/")
        if last == wanted and folder.split("/")[0] not in ("resources", "extra", "sources"):
            return (
                f"{wanted} is in the folder {folder!r} of the archive: pack the content of that folder, not "
                "the folder"
            )
        if name.lower() == wanted.lower():
            return f"the archive contains {name}, which has to be called {wanted}"
    return f"the archive contains no {wanted}"


def _check_size(archive: zipfile.ZipFile) -> None:
    """Check the size of an archive by its directory; `zipfile` never reads more than that declares.

    Raises:
        TooLargeError: too many members, too many bytes, or too deeply nested folders.
    """
    infos = archive.infolist()
    if len(infos) > MEMBERS:
        raise TooLargeError(f"it contains {len(infos)} files, more than {MEMBERS}")
    size = sum(info.file_size for info in infos)
    if size > UNPACKED:
        raise TooLargeError(f"unpacked it has {_in_words(size)}, more than {_in_words(UNPACKED)}")
    depth = max((re.sub(r"[/\\\\]+", "/", info.filename).count("/") for info in infos), default=0)
    if depth > DEPTH:
        raise TooLargeError(f"it contains {depth} nested folders, more than {DEPTH}")


def _in_words(size: int) -> str:
    return f"{size / 1e9:.3g} GB" if size >= 1e9 else f"{size / 1e6:.3g} MB"


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


@contextlib.contextmanager
def draft_of(file: Path, content: bytes) -> Iterator[Path]:
    """Write `content` to a temporary draft next to `file`, to be checked before it replaces the file.

    Other processes that draft the same file wait. A draft left by a dead process is overwritten.
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
    """Remove a draft of a file that a dead process has left."""
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

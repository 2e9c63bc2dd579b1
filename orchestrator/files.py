"""Users' files: opened without waiting, bounded in size, and every mistake in them a sentence.

Every reader of a user's file (scenario, vehicle, study, sweep, SSP archive, FMU, results, time series)
gets its bytes from `read_bytes` or `open_regular` and works inside `reading`. Mistakes that a reader
foresees it reports itself, with the line; `reading` is for those that nobody foresaw.
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

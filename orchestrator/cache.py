"""What this program keeps because it is costly to make again: in the user's cache, or a temporary folder.

    <32 digits>-<n>/    FMUs, unpacked (see `fmu.archive`)
    <store>/<key>       small files that begin with the hash of their content

Nobody has to look after it. Nothing in it is believed unseen: a file that was cut off or changed is
made anew. Where the user's folder cannot be written (a container, another user's home), or its path
is not plain ASCII, a temporary folder serves. The path must be plain because stock PythonFMU decodes
nothing but `%20` in the address of its resources.

A hash of this program's own code: its version tells releases apart, not what was changed since.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import tempfile
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from .errors import ModelDescriptionError
from .files import fcntl, write_whole

_PLAIN_PATH = re.compile(r"[A-Za-z0-9_.~/\\: -]+")
KEEP_DAYS = 60
"""What has not been used, or kept anew, for so long is deleted when something else is kept."""
_DIGITS = 32
"""Of the hash that a kept file begins with."""


def cache_folders() -> Iterator[Path]:
    """Yield the folders to keep things in, best first: YAWBENCH_CACHE or the user's cache, a temporary one.

    Raises:
        ModelDescriptionError: there is none.
    """
    wanted = _wanted()
    problems = []
    not_plain = (
        f"{wanted}: FMUs cannot be unpacked here: the path holds more than ASCII letters, digits, "
        "spaces and ._~-; name another folder in YAWBENCH_CACHE"
    )
    found = wanted is not None and bool(_PLAIN_PATH.fullmatch(str(wanted)))
    if wanted is not None and found:
        yield wanted
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user").encode().hex()
    for base in dict.fromkeys((_temporary(), os.environ.get("PUBLIC", "/tmp"))):
        if _PLAIN_PATH.fullmatch(base):
            try:
                yield _private(Path(base) / f"yawbench-{user}")
                found = True
            except OSError as error:
                problems.append(f"{base}: FMUs cannot be unpacked here: {error.strerror}")
            except ModelDescriptionError as error:
                problems += error.problems
    if not found:
        raise ModelDescriptionError([*problems, not_plain][0])


def cache_folder() -> Path:
    """Return the best of `cache_folders` that can be written.

    Raises:
        ModelDescriptionError: there is none.
    """
    for folder in cache_folders():
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if os.access(folder, os.W_OK | os.X_OK):
                return folder
    raise ModelDescriptionError("no folder for the cache can be written; name one in YAWBENCH_CACHE")


_held: dict[Path, int] = {}
"""Folders of the cache that this process uses, and the descriptors of its locks."""


def hold(folder: Path) -> None:
    """Keep a folder of the cache from being cleared until this process has ended; it is made if need be."""
    if fcntl is None or folder in _held:
        return
    with contextlib.suppress(OSError):  # what cannot be locked is not cleared either
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        descriptor = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_SH)
        except OSError:
            os.close(descriptor)
            raise
        _held[folder] = descriptor


@contextlib.contextmanager
def alone_in(folder: Path) -> Iterator[bool]:
    """Keep others from using a folder of the cache while the block runs; yield whether nobody does."""
    if fcntl is None:
        yield True
        return
    if folder in _held:
        os.close(_held.pop(folder))
    descriptor = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
        else:
            yield True
    finally:
        os.close(descriptor)


def _wanted() -> Path | None:
    """Return the folder that the environment asks for, or the user's; None without a home."""
    from platformdirs import user_cache_path

    chosen = os.environ.get("YAWBENCH_CACHE")
    if chosen:
        return Path(chosen).absolute()
    try:
        folder = user_cache_path("yawbench")
    except RuntimeError:
        return None
    return folder if folder.is_absolute() else None


def _temporary() -> str:
    try:
        return tempfile.gettempdir()
    except FileNotFoundError:  # no folder that can be written
        return ""


def _private(folder: Path) -> Path:
    """Make a folder that others could have made first; refuse it if they have."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if hasattr(os, "getuid") and folder.lstat().st_uid != os.getuid():
        raise ModelDescriptionError(
            f"{folder}: FMUs cannot be unpacked here: the folder belongs to another user; "
            "name another one in YAWBENCH_CACHE"
        )
    return folder


def recall(store: str, key: str) -> bytes | None:
    """Return what was kept under `key`, None if nothing was or it is not whole."""
    with contextlib.suppress(ModelDescriptionError):
        for folder in cache_folders():
            with contextlib.suppress(OSError):
                if (content := content_of(folder / store / key)) is not None:
                    return content
    return None


def keep(store: str, key: str, content: bytes) -> None:
    """Keep `content` under `key` in place of what was kept there, in the first folder that takes it.

    Where none does, nothing is kept: whatever it is will be made again.
    """
    with contextlib.suppress(ModelDescriptionError):
        for folder in cache_folders():
            file = folder / store / key
            try:
                file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
                write_whole(file, _hash(content) + content)
            except OSError:
                continue
            oldest = time.time() - KEEP_DAYS * 86400.0
            for other in file.parent.iterdir():
                with contextlib.suppress(OSError):
                    if other.stat().st_mtime < oldest:
                        other.unlink()
            return


def content_of(file: Path) -> bytes | None:
    """Return what a kept file holds, None if it is not whole.

    Raises:
        OSError: it cannot be read.
    """
    whole = file.read_bytes()
    return whole[_DIGITS:] if whole[:_DIGITS] == _hash(whole[_DIGITS:]) else None


def _hash(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest()[:_DIGITS].encode()


OF_RESULTS = ("plan.py", "scenario", "fmu", "wiring", "master", "results", "tyres")
"""Modules and stages that have a say in what a run records; units have hashes of their own."""
OF_METRICS = (*OF_RESULTS, "metrics")
"""And in the numbers made of it."""
OF_TESTS = (*OF_METRICS, "evaluation")
"""And in what a standard test makes of it."""

_HERE = Path(__file__).parent


@cache
def sources_hash(parts: tuple[str, ...]) -> str:
    """Return the first twelve digits of the SHA-256 of the code of modules and folders."""
    digest = hashlib.sha256()
    for part in parts:
        place = _HERE / part
        for file in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            digest.update(f"{file.relative_to(_HERE).as_posix()}\0".encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()[:12]

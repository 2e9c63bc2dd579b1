"""On-disk cache of expensive intermediate files; the hash of this program's own code.

    <32 digits>-<n>/    FMUs, unpacked (see `fmu.archive`)
    <store>/<key>       small files that begin with the hash of their content

The cache is in the user's cache folder or a temporary one. It cleans up after itself, and every file is
verified before it is used: a truncated or changed file is made again. If the user's folder cannot be written
(a container, another user's home), or its path is not plain ASCII, a temporary folder is used. The path must
be plain because stock PythonFMU decodes only `%20` in the URI of its resources.

`sources_hash` identifies this program's own code, for keys and records: the version number does not change
between releases.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from .errors import Diagnostic, ModelDescriptionError
from .safe_files import fcntl, write_whole

_PLAIN_PATH = re.compile(r"[A-Za-z0-9_.~/\\: -]+")
STORES = {
    "launcher": "launchers",
    "native": "native libraries",
    "compiled": "libraries for other platforms",
    "step_loop": "step loops",
    "rows_text": "writers of CSV",
    "keys": "keys of sources",
    "efforts": "times of builds",
}
"""Name of a store -> its entries, as `yawbench cache` lists them; `keep` knows no others."""
KEEP_DAYS = 60
"""Files that have not been written for this many days are deleted when a process first stores another one."""
_DIGITS = 32
"""Length of the hash at the beginning of a cached file."""


def cache_folders() -> Iterator[Path]:
    """Yield the candidate cache folders, best first: YAWBENCH_CACHE or the user's cache, then temporary ones.

    Raises:
        ModelDescriptionError: there is no usable folder.
    """
    folder = _user_folder()
    errors: list[str | Diagnostic] = []
    not_plain = (
        f"{folder}: FMUs cannot be unpacked here: the path has more than ASCII letters, digits, "
        "spaces and ._~-; name another folder in YAWBENCH_CACHE"
    )
    usable = folder is not None and bool(_PLAIN_PATH.fullmatch(str(folder)))
    if folder is not None and usable:
        yield folder
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user").encode().hex()
    for base in dict.fromkeys((_temporary(), os.environ.get("PUBLIC", "/tmp"))):
        if _PLAIN_PATH.fullmatch(base):
            try:
                yield _private(Path(base) / f"yawbench-{user}")
                usable = True
            except OSError as error:
                errors.append(f"{base}: FMUs cannot be unpacked here: {error.strerror}")
            except ModelDescriptionError as error:
                errors += error.diagnostics
    if not usable:
        raise ModelDescriptionError([*errors, not_plain][0], code="cache-unwritable")


def cache_folder() -> Path:
    """Return the first of `cache_folders` that can be written.

    Raises:
        ModelDescriptionError: none can be written.
    """
    for folder in cache_folders():
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if os.access(folder, os.W_OK | os.X_OK):
                return folder
    raise ModelDescriptionError(
        "no folder for the cache can be written; name one in YAWBENCH_CACHE", code="cache-unwritable"
    )


_held: dict[Path, int] = {}
"""Cache folders that this process uses -> descriptors of its shared locks."""


def hold(folder: Path) -> None:
    """Protect a cache folder from being cleared while this process lives; create it if necessary."""
    if fcntl is None or folder in _held:
        return
    with contextlib.suppress(OSError):  # a folder that cannot be locked is never cleared either
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
    """Lock a cache folder exclusively while the block runs; yield False if another process uses it."""
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


def _user_folder() -> Path | None:
    """Return the folder from YAWBENCH_CACHE, else the user's cache folder; None without a home directory."""
    chosen = os.environ.get("YAWBENCH_CACHE")
    if chosen:
        return Path(chosen).absolute()
    from platformdirs import user_cache_path

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
    """Create a folder in a shared place; refuse it if another user has created it first."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if hasattr(os, "getuid") and folder.lstat().st_uid != os.getuid():
        raise ModelDescriptionError(
            f"{folder}: FMUs cannot be unpacked here: the folder belongs to another user; "
            "name another one in YAWBENCH_CACHE",
            code="cache-unwritable",
        )
    return folder


def recall(store: str, key: str) -> bytes | None:
    """Return the content stored under `key`, None if there is none or it is damaged."""
    with contextlib.suppress(ModelDescriptionError):
        for folder in cache_folders():
            with contextlib.suppress(OSError):
                if (content := content_of(folder / store / key)) is not None:
                    return content
    return None


def keep(store: str, key: str, content: bytes) -> None:
    """Store `content` under `key`, replacing an earlier value, in the first folder that can be written.

    If none can, nothing is stored: the content will be computed again.
    """
    assert store in STORES
    with contextlib.suppress(ModelDescriptionError):
        for folder in cache_folders():
            file = folder / store / key
            try:
                file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
                write_whole(file, _hash(content) + content)
            except OSError:
                continue
            delete_unused(file.parent)
            return


@cache
def delete_unused(folder: Path, names: str = ".*") -> None:
    """Delete the entries of a cache folder that have not been written for `KEEP_DAYS`.

    Once in each process: a folder may have ten thousand entries.

    Args:
        folder: to look into.
        names: regular expression of the names of entries; others are not ours.
    """
    oldest = time.time() - KEEP_DAYS * 86400.0
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            with contextlib.suppress(OSError):
                if re.fullmatch(names, entry.name) and entry.stat().st_mtime < oldest:
                    remove(Path(entry.path))


def remove(path: Path) -> None:
    """Delete an entry, even while it is in use."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def content_of(file: Path) -> bytes | None:
    """Return the content of a cached file, None if it is damaged.

    Raises:
        OSError: the file cannot be read.
    """
    whole = file.read_bytes()
    return whole[_DIGITS:] if whole[:_DIGITS] == _hash(whole[_DIGITS:]) else None


def _hash(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest()[:_DIGITS].encode()


OF_RESULTS = (
    *("fmus/fmu.py", "fmus/archive.py", "fmus/description.py", "fmus/opener.py", "fmus/zip_members.py"),
    *("orchestrator", "measurements", "vehicles", "vocabulary/facts.py", "planner.py", "tyre_stand.py"),
)
"""Modules and packages of yawbench on which the results of a run depend; FMUs are hashed separately."""
OF_METRICS = (*OF_RESULTS, "vocabulary/motion.py", "metrics")
"""Modules and packages on which the metrics of a run depend."""
OF_TESTS = (*OF_METRICS, "proving_ground")
"""Modules and packages on which the evaluation of a standard test depends."""

_HERE = Path(__file__).parents[1]  # of the package, as imported: in a checkout folders in it are links


@cache
def sources_hash(parts: tuple[str, ...]) -> str:
    """Return the first twelve hexadecimal digits of the SHA-256 of the code of modules and packages."""
    digest = hashlib.sha256()
    for part in parts:
        path = _HERE / part
        for file in sorted([*path.rglob("*.py"), *path.rglob("*.c")]) if path.is_dir() else [path]:
            digest.update(f"{file.relative_to(_HERE).as_posix()}\0".encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()[:12]

"""On-disk cache of expensive intermediate files; checksums that detect changes of files and records.

    <32 digits>-<n>/    FMUs, unpacked (see `fmu.archive`)
    <store>/<key>       small files that begin with the hash of their content

The cache is in the user's cache folder or a temporary one. It cleans up after itself, and every file is
verified before it is used: a truncated or changed file is made again. If the user's folder cannot be written
(a container, another user's home), or its path is not plain ASCII, a temporary folder is used. The path must
be plain because stock PythonFMU decodes only `%20` in the URI of its resources.

Every JSON record and journal line that is read back carries checksums, one per key. They protect against
editors, merges and faulty disks, not against deliberate forgery.

`sources_hash` identifies this program's own code, for keys and records: the version number does not change
between releases.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import shutil
import tempfile
import time
import warnings
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from .errors import Diagnostic, ModelDescriptionError, RecordWarning
from .messages import listed, short
from .safe_files import fcntl, open_regular, write_whole

_PLAIN_PATH = re.compile(r"[A-Za-z0-9_.~/\\: -]+")
STORES = {
    "launcher": "launchers",
    "native": "native libraries",
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
    *("fmus/fmu.py", "fmus/archive.py", "fmus/description.py", "fmus/opener.py"),
    *("orchestrator", "vehicles", "vocabulary/facts.py", "planner.py", "tyre_stand.py"),
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


KEY = "checksums"
WHOLE = "*"
"""Key of the checksum of the whole record, which detects added and removed keys."""
DIGITS = 16
"""Hexadecimal digits of a checksum. Chosen: one in 10^19 changes goes undetected."""
NAMED = 5
"""Maximum number of keys named in a message. Chosen: they fit into a line or two."""


def checksums_of(content: Mapping[str, Any]) -> dict[str, str]:
    """Return the checksums of a record: one per key, and one of the whole record."""
    parts = {key: _digest(value) for key, value in content.items()}
    return {WHOLE: _digest(dict(content)), **parts}


def with_checksums(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return a record with its checksums, replacing existing ones."""
    bare = {key: value for key, value in content.items() if key != KEY}
    return {**bare, KEY: checksums_of(bare)}


def changed_since(content: Mapping[str, Any]) -> str:
    """Describe changes in a record since it was written, "" if there are none.

    A record without checksums counts as unchanged; see `has_checksums`.
    """
    if not has_checksums(content):
        return ""
    return what_changed({key: value for key, value in content.items() if key != KEY}, content[KEY])


def what_changed(content: Mapping[str, Any], known: Any) -> str:
    """Describe which keys of a record do not match its checksums, "" if all do."""
    if not isinstance(known, dict) or WHOLE not in known:
        return f"{KEY!r} was changed"
    actual = checksums_of(content)
    words = [
        f"{what} was {how}"
        for how, keys in (
            ("changed", [key for key in actual if key in known and known[key] != actual[key]]),
            ("added", [key for key in actual if key not in known]),
            ("removed", [key for key in known if key not in actual]),
        )
        if (what := _named([key for key in keys if key != WHOLE]))
    ]
    if not words and known[WHOLE] != actual[WHOLE]:
        words = [f"{KEY}.{WHOLE} was changed"]
    return ", ".join(words)


def has_checksums(content: Mapping[str, Any]) -> bool:
    """Return whether a record carries checksums; records of earlier versions do not."""
    return KEY in content


def warn_of_record(sentence: str) -> None:
    """Warn the user about a record; worker processes ignore these warnings."""
    warnings.warn(RecordWarning(sentence), stacklevel=3)


def _named(keys: list[str]) -> str:
    more = [f"{len(keys) - NAMED} more"] if len(keys) > NAMED else []
    return listed([*(short(key) for key in keys[:NAMED]), *more], last="and") if keys else ""


def _digest(value: Any) -> str:
    text = json.dumps(value, sort_keys=True)
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()[:DIGITS]}"


def checksum(path: Path) -> str:
    """Return the checksum of a file."""
    digest = hashlib.sha256()
    with open_regular(path) as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    return shown(digest)


def shown(digest: Any) -> str:
    """Return a SHA-256 as written in run records."""
    return f"sha256:{digest.hexdigest()}"

"""FMU archives, each unpacked once into a cache named by its content.

The cache holds, per archive, its files in `fmu/` and beside them `description.json`: the model
description as this program needs it (parsing it anew costs 15 to 50 ms) and every file's size. An
entry appears under its name in one rename, complete, so processes that unpack the same archive at
the same time cannot meet a half one. Every file's time is set to one fixed instant: a file that was
changed, cut off or deleted since is found by its size and time, and put back.

The cache's path is plain ASCII, because stock PythonFMU decodes nothing but `%20` in the address of
its resources: where the user's cache folder is called something else, a temporary folder serves.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import io
import json
import lzma
import os
import re
import shutil
import struct
import sys
import tempfile
import time
import zipfile
import zlib
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path, PurePosixPath

from ..errors import ModelDescriptionError
from ..plan import Fmu
from ..wording import closest, listed, short
from . import description as fmu_description

FORMAT = 3
"""Of the cache's entries; part of their names, so versions of this program do not quarrel."""

KEEP_DAYS = 60
"""An entry unused for so long is deleted when another is made."""

_PLAIN_PATH = re.compile(r"[A-Za-z0-9_.~/\\: -]+")
_FILE_NAME = re.compile(r"[^/\\:\x00-\x1f\x7f]{1,200}")
_FILE_TIME = 946_684_800  # 2000-01-01, in s
_DAMAGE = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, EOFError, OSError, ValueError,
    RuntimeError,  # encrypted, or packed by a method that is not known
)  # fmt: skip


def open_fmu(path: Path | str) -> Fmu:
    """Return the FMU `path`, unpacked in the cache.

    Raises:
        ModelDescriptionError: missing, damaged, not supported, or no room to unpack it.
    """
    path = Path(path).absolute()
    raw = read_archive(path)
    folder = cache_folder()
    entry = folder / f"{hashlib.sha256(raw).hexdigest()[:32]}-{FORMAT}"
    fmu = _load(entry, path)
    if fmu is None:
        fmu = _unpack(raw, entry, path)
    if problem := binary_problem(fmu):
        raise ModelDescriptionError(f"{fmu.path}: {problem}")
    return fmu


def cache_folder() -> Path:
    """Return the folder of unpacked FMUs: YAWBENCH_CACHE, the user's cache, or a temporary folder.

    Raises:
        ModelDescriptionError: none has a plain ASCII path.
    """
    chosen = os.environ.get("YAWBENCH_CACHE")
    if chosen:
        wanted = Path(chosen).absolute()
    else:
        from platformdirs import user_cache_path

        wanted = user_cache_path("yawbench")
    if _PLAIN_PATH.fullmatch(str(wanted)):
        return wanted
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user").encode().hex()
    for base in (tempfile.gettempdir(), os.environ.get("PUBLIC", "/tmp")):
        if _PLAIN_PATH.fullmatch(base):
            return _private(Path(base) / f"yawbench-{user}")
    raise ModelDescriptionError(
        f"{wanted}: FMUs cannot be unpacked here: the path holds more than ASCII letters, digits, "
        "spaces and ._~-; name another folder in YAWBENCH_CACHE"
    )


def _private(folder: Path) -> Path:
    """Make a folder that others could have made first; refuse it if they have."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if hasattr(os, "getuid") and folder.stat().st_uid != os.getuid():
        raise ModelDescriptionError(
            f"{folder}: FMUs cannot be unpacked here: the folder belongs to another user; "
            "name another one in YAWBENCH_CACHE"
        )
    return folder


def platform() -> tuple[str, str]:
    """Return FMI 2.0's name of this platform and the suffix of its binaries."""
    names = {"win32": ("win", ".dll"), "cygwin": ("win", ".dll"), "darwin": ("darwin", ".dylib")}
    system, suffix = names.get(sys.platform, ("linux", ".so"))
    return f"{system}{64 if sys.maxsize > 2**32 else 32}", suffix


def read_archive(path: Path) -> bytes:
    """Return an FMU's bytes; it may be in an archive itself, such as system.ssp/resources/plant.fmu.

    Raises:
        ModelDescriptionError: it cannot be read.
    """
    try:
        return path.read_bytes()
    except FileNotFoundError:
        names = sorted(p.name for p in path.parent.glob("*.fmu")) if path.parent.is_dir() else []
        likely = closest(path.name, names)
        if likely:
            more = f"; did you mean {likely!r}?"
        else:
            more = f"; {path.parent} holds {listed(names)}" if names else ""
        raise ModelDescriptionError(f"{path}: no such FMU{more}") from None
    except NotADirectoryError:
        return _read_member(path)
    except OSError as error:
        raise ModelDescriptionError(f"{path}: cannot read this FMU: {error.strerror}") from None
    except ValueError as error:  # a null character in the path
        raise ModelDescriptionError(f"{str(path)!r}: cannot read this FMU: {error}") from None


def _read_member(path: Path) -> bytes:
    """Return an FMU that is a member of an archive."""
    outer = next(above for above in path.parents if above.is_file())
    member = path.relative_to(outer).as_posix()
    try:
        with zipfile.ZipFile(outer) as archive:
            return archive.read(member)
    except KeyError:
        raise ModelDescriptionError(f"{path}: no such FMU: {outer} does not hold it") from None
    except _DAMAGE as error:
        raise ModelDescriptionError(f"{path}: cannot read this FMU: {error}") from None


def _load(entry: Path, path: Path) -> Fmu | None:
    """Return the FMU of a cache entry, None if there is none or it is damaged."""
    try:
        record = json.loads((entry / "description.json").read_bytes())
        for name, size in record["files"].items():
            status = os.stat(entry / "fmu" / name)
            if status.st_size != size or int(status.st_mtime) != _FILE_TIME:
                return None
        fmu = fmu_description.from_record(record["fmu"], path=path, directory=entry / "fmu")
        with contextlib.suppress(OSError):  # a cache that others keep up is none to be tidied from here
            os.utime(entry)
        return fmu
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _unpack(raw: bytes, entry: Path, path: Path) -> Fmu:
    files = _files(raw, path)
    fmu = fmu_description.describe(files, raw, path)
    try:
        _make_entry(files, fmu, entry)
    except OSError as error:
        where = f"{path}: cannot unpack this FMU into {entry.parent}"
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            reason = "no space left; free some there or name another folder in YAWBENCH_CACHE"
        else:
            reason = f"{error.strerror}; another folder can be named in YAWBENCH_CACHE"
        raise ModelDescriptionError(f"{where}: {reason}") from None
    return replace(fmu, directory=entry / "fmu")


def _files(raw: bytes, path: Path) -> dict[str, bytes]:
    """Return the content of the archive's files by relative path, none of which leaves the folder."""
    files = {}
    try:
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            for info in archive.infolist():
                name = info.filename.replace("\\", "/")
                parts = PurePosixPath(name).parts
                if name.startswith("/") or ".." in parts or ":" in name or "\0" in name:
                    raise ModelDescriptionError(
                        f"{path}: the archive is unsafe: it holds the path {info.filename!r}"
                    )
                if not name.endswith("/"):
                    files["/".join(parts)] = archive.read(info)
    except _DAMAGE as error:
        if raw[:2] != b"PK":
            raise ModelDescriptionError(f"{path}: no FMU: this is not a zip archive") from None
        reason = str(error).rstrip(".") or type(error).__name__
        raise ModelDescriptionError(f"{path}: the archive is damaged or cut off ({reason})") from None
    return files


def _make_entry(files: dict[str, bytes], fmu: Fmu, entry: Path) -> None:
    """Unpack beside the entry, then put it in its place, or what is damaged in its place."""
    entry.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    scratch = Path(tempfile.mkdtemp(prefix=".unpacking-", dir=entry.parent))
    try:
        for name, content in files.items():
            target = scratch / "fmu" / name
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
            target.chmod(0o755 if name.startswith("binaries/") else 0o644)
            os.utime(target, (_FILE_TIME, _FILE_TIME))
        sizes = {name: len(content) for name, content in files.items()}
        record = {"fmu": fmu_description.to_record(fmu), "files": sizes}
        (scratch / "description.json").write_text(json.dumps(record), encoding="utf-8")
        try:
            os.rename(scratch, entry)
        except OSError:
            if not entry.is_dir():
                raise
            if _load(entry, fmu.path) is None:
                _repair(entry, scratch, files)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    _prune(entry.parent)


def _repair(entry: Path, scratch: Path, files: Iterable[str]) -> None:
    """Put every file back, one by one, so a process that uses the entry keeps what it has open."""
    for name in (*(f"fmu/{name}" for name in files), "description.json"):
        target = entry / name
        if target.is_dir():
            shutil.rmtree(target)
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(scratch / name, target)


def _prune(folder: Path) -> None:
    """Delete entries and left-over scratch folders that nobody has used for long."""
    oldest = time.time() - KEEP_DAYS * 86400.0
    for entry in folder.iterdir():
        ours = entry.name.startswith(".unpacking-") or re.fullmatch(r"[0-9a-f]{32}-\d+", entry.name)
        try:
            if ours and entry.stat().st_mtime < oldest:
                shutil.rmtree(entry, ignore_errors=True)
        except OSError:
            continue


def binary_problem(fmu: Fmu) -> str | None:
    """Return why an FMU cannot be loaded on this platform, None if it has a binary for it."""
    name, suffix = platform()
    identifier = fmu.model_identifier
    if not _FILE_NAME.fullmatch(identifier) or identifier in (".", ".."):
        return (
            f"modelIdentifier {short(identifier)} cannot name the library of an FMU: "
            "allowed are letters, digits and _, at most 200"
        )
    if (fmu.directory / "binaries" / name / (identifier + suffix)).is_file():
        return None
    present = sorted(p.name for p in fmu.directory.glob("binaries/*") if p.is_dir() and any(p.iterdir()))
    missing = f"binaries/{name}/{identifier}{suffix}"
    if name in present:
        files = sorted(p.name for p in (fmu.directory / "binaries" / name).iterdir())
        return (
            f"no binary of the name that the model identifier asks for ({missing}); binaries/{name} holds "
            f"{listed(files)}"
        )
    others = f"it has binaries for {listed(present)}" if present else "it has no binaries"
    return f"no binary for this platform ({missing}); {others}"

"""FMU archives: read, and unpacked once each into the cache, under a name derived from the content.

A cache entry consists of the unpacked files in `fmu/` and `description.json`: the model description as this
program needs it (parsing it again costs 15 to 50 ms) and every file's hash. It appears under its name
complete, in one rename, so processes that unpack the same archive at the same time never meet half an entry.
A file that was changed, truncated or deleted since is detected by its hash, which costs a millisecond per
FMU, and restored.

`binary_problem` says why an FMU cannot be loaded on this platform, `runs_as` whether one that was built from
Python runs as native code.

`kept_in` lists the entries of a cache folder.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import io
import json
import os
import re
import shutil
import sys
import tempfile
import zipfile
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from yawbench.foundation.cache import STORES, cache_folders, delete_unused, hold
from yawbench.foundation.errors import ModelDescriptionError
from yawbench.foundation.messages import closest, listed, short
from yawbench.foundation.safe_files import PACKED, read_bytes, reason

from . import description as fmu_description
from .description import binary_of, platform
from .fmu import Fmu, RunsAs
from .zip_members import DAMAGE, ArchiveError, members

FORMAT = 12
"""Format version of cache entries; part of their names, so versions of this program can share a cache."""

_FILE_NAME = re.compile(r"[^/\\:\x00-\x1f\x7f]{1,200}")
_FILE_TIME = 946_684_800
"""Time stamp of unpacked files, 2000-01-01 [s]: keeps Python's bytecode valid after a restore."""


def open_fmu(path: Path | str, *, validate: bool = True) -> Fmu:
    """Open the FMU at `path`: unpack it into the cache, unless it is there, and describe it.

    Args:
        validate: refuse an invalid model description even if it could be used.

    Raises:
        ModelDescriptionError: the FMU is missing, damaged or not supported, or cannot be unpacked.
    """
    path = Path(path).absolute()
    raw = read_archive(path)
    name = f"{hashlib.sha256(raw).hexdigest()[:32]}-{FORMAT}"
    problem: ModelDescriptionError | None = None
    for folder in cache_folders():
        hold(folder)
        try:
            fmu = _load(folder / name, path) or _unpack(raw, folder / name, path)
        except OSError as error:
            problem = problem or ModelDescriptionError(_no_room(path, folder, error), code="cache-unwritable")
            continue
        if validate and fmu.violations:
            more = f" (and {len(fmu.violations) - 1} more)" if len(fmu.violations) > 1 else ""
            way = "; 'validate: false' for the instance (--set INSTANCE.validate=false) makes it a warning"
            raise ModelDescriptionError(f"{fmu.path}: {fmu.violations[0].message.rstrip('.')}{more}{way}")
        if wrong := binary_problem(fmu):
            raise ModelDescriptionError(f"{fmu.path}: {wrong}")
        return fmu
    assert problem is not None
    raise problem


def binary_problem(fmu: Fmu) -> str | None:
    """Return why an FMU cannot be loaded on this platform, None if it has a binary for it."""
    identifier = fmu.model_identifier
    if not _FILE_NAME.fullmatch(identifier) or identifier in (".", ".."):
        return (
            f"modelIdentifier {short(identifier)} cannot name the library of an FMU: "
            "it may contain letters, digits and _, at most 200"
        )
    missing = binary_of(fmu.fmi, identifier)
    if (fmu.directory / missing).is_file():
        return None
    name, _ = platform(fmu.fmi)
    present = sorted(p.name for p in fmu.directory.glob("binaries/*") if p.is_dir() and any(p.iterdir()))
    if name in present:
        files = sorted(p.name for p in (fmu.directory / "binaries" / name).iterdir())
        return (
            f"no binary of the name that the model identifier asks for ({missing}); binaries/{name} contains "
            f"{listed(files)}"
        )
    others = f"it has binaries for {listed(present)}" if present else "it has no binaries"
    return f"no binary for this platform ({missing}); {others}"


def _no_room(path: Path, folder: Path, error: OSError) -> str:
    where = f"{path}: cannot unpack this FMU into {folder}"
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"{where}: no space left; free some there or name another folder in YAWBENCH_CACHE"
    return f"{where}: {error.strerror}; another folder can be named in YAWBENCH_CACHE"


def read_archive(path: Path) -> bytes:
    """Return an FMU's bytes; it may be inside another archive, such as system.ssp/resources/plant.fmu.

    Raises:
        ModelDescriptionError: it cannot be read.
    """
    try:
        return read_bytes(path, largest=PACKED)
    except FileNotFoundError:
        names = sorted(p.name for p in path.parent.glob("*.fmu")) if path.parent.is_dir() else []
        likely = closest(path.name, names)
        if likely:
            more = f"; did you mean {likely!r}?"
        else:
            more = f"; {path.parent} contains {listed(names)}" if names else ""
        if "~" in path.parts:
            more = "; ~ is a folder's name here: write the path of your home folder"
        elif "\\" in path.name:
            more = "; write paths with /, not \\"
        raise ModelDescriptionError(f"{path}: no such FMU{more}", code="fmu-missing") from None
    except NotADirectoryError:
        return _read_member(path)
    except (OSError, ValueError) as error:
        raise ModelDescriptionError(
            f"{path}: cannot read this FMU: {reason(error)}", code="fmu-damaged"
        ) from None


def _read_member(path: Path) -> bytes:
    """Return the bytes of an FMU that is a member of another archive."""
    outer = next(above for above in path.parents if os.path.isfile(above))
    member = path.relative_to(outer).as_posix()
    try:
        with zipfile.ZipFile(outer) as archive:
            return archive.read(members(archive)[member])
    except KeyError:
        raise ModelDescriptionError(
            f"{path}: no such FMU: {outer} does not contain it", code="fmu-missing"
        ) from None
    except DAMAGE as error:
        raise ModelDescriptionError(f"{path}: cannot read this FMU: {error}", code="fmu-damaged") from None


def _load(entry: Path, path: Path) -> Fmu | None:
    """Return the FMU of a cache entry, None if one of its files is missing or has changed."""
    try:
        record = json.loads((entry / "description.json").read_bytes())
        for name, digest in record["files"].items():
            with open(f"{entry}/fmu/{name}", "rb", buffering=0) as file:
                if hashlib.sha256(file.read()).hexdigest() != digest:
                    return None
        fmu = fmu_description.from_record(record["fmu"], path=path, directory=entry / "fmu")
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    with contextlib.suppress(OSError):  # a read-only cache is maintained by others
        os.utime(entry)
    return fmu


def _unpack(raw: bytes, entry: Path, path: Path) -> Fmu:
    contents = _files(raw, path)
    fmu = fmu_description.describe(contents, raw, path)
    _make_entry(contents, fmu, entry)
    return replace(fmu, directory=entry / "fmu")


def _files(raw: bytes, path: Path) -> dict[str, bytes]:
    """Return relative path -> content of the archive's files; refuse paths that leave the folder."""
    try:
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            contents = {name: archive.read(info) for name, info in members(archive).items()}
    except ArchiveError as error:
        raise ModelDescriptionError(f"{path}: cannot read this FMU: {error}", code="fmu-damaged") from None
    except DAMAGE as error:
        if raw[:2] != b"PK":
            raise ModelDescriptionError(
                f"{path}: not an FMU: this is not a zip archive", code="fmu-damaged"
            ) from None
        why = reason(error).rstrip(".")
        raise ModelDescriptionError(
            f"{path}: the archive is damaged or cut off ({why})", code="fmu-damaged"
        ) from None
    return contents


def _make_entry(files: dict[str, bytes], fmu: Fmu, entry: Path) -> None:
    """Unpack into a scratch folder, then rename it to the entry, or put it in place of a damaged one."""
    entry.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    scratch = Path(tempfile.mkdtemp(prefix=".unpacking-", dir=entry.parent))
    try:
        for name, content in files.items():
            target = scratch / "fmu" / name
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
            target.chmod(0o755 if name.startswith("binaries/") else 0o644)
            os.utime(target, (_FILE_TIME, _FILE_TIME))
        hashes = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
        record = {"fmu": fmu_description.to_record(fmu), "files": hashes}
        (scratch / "description.json").write_text(json.dumps(record), encoding="utf-8")
        try:
            os.rename(scratch, entry)
        except OSError:
            if not entry.is_dir():
                raise
            if _load(entry, fmu.path) is None:  # damaged; processes that use it keep its open files
                shutil.rmtree(entry, ignore_errors=True)
                os.rename(scratch, entry)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    delete_unused(entry.parent, r"\.unpacking-.*|[0-9a-f]{32}-\d+")


def kept_in(folder: Path) -> dict[str, list[Path]]:
    """Return kind -> entries of a cache folder; other files there are not ours and left out."""
    unpacked = re.compile(rf"[0-9a-f]{{32}}-{FORMAT}")
    left_over = re.compile(r"[0-9a-f]{32}-\d+|\.unpacking-.*")  # of other versions, or interrupted
    names = {path.name: path for path in folder.iterdir()}
    entries_by_kind = {
        "unpacked FMUs": [path for name, path in names.items() if unpacked.fullmatch(name)],
        **{name: [*folder.glob(f"{store}/*")] for store, name in STORES.items()},
        "FMUs": [*folder.glob("fmus/*/*.fmu")],
        "left over": [
            path for name, path in names.items() if left_over.fullmatch(name) and not unpacked.fullmatch(name)
        ],
    }
    return {kind: entries for kind, entries in entries_by_kind.items() if entries}


def size_of(entry: Path) -> int:
    """Return the total size of the files of an entry [B]."""
    files = entry.rglob("*") if entry.is_dir() else [entry]
    return sum(file.lstat().st_size for file in files if not file.is_dir())


REASON = "extra/org.yawbench.native/native.txt"
"""Path in an archive of why it has no native library; empty if it has one."""
UNTRIED = "extra/org.yawbench.native/untried.txt"
"""Path in an archive of places in its native library that were never compared with Python, a line each."""
WANTED = "YAWBENCH_UNITS"
"""Environment variable: `python` asks for Python in place of native code."""
PYTHON_WANTED = RunsAs(f"{WANTED} asks for it")


def python_wanted() -> bool:
    """Return whether the environment asks for Python in place of native code."""
    return os.environ.get(WANTED) == "python"


def runs_as(archive: Path) -> RunsAs | None:
    """Return how an FMU that was built from Python here runs, None for any other."""
    try:
        how = _how_built(str(archive), os.stat(archive).st_mtime_ns)
    except OSError:
        return None
    if how is None or not how.native:
        return how
    if python_wanted():
        return PYTHON_WANTED
    return how if sys.platform == "linux" else RunsAs("the native library is for Linux")


def is_native(directory: Path) -> bool:
    """Return whether the FMU unpacked in a folder was built here and runs natively in this process."""
    if sys.platform != "linux" or python_wanted():
        return False
    try:
        return (directory / REASON).stat().st_size == 0
    except OSError:
        return False


@lru_cache(maxsize=1024)
def _how_built(archive: str, changed: int) -> RunsAs | None:
    try:
        with zipfile.ZipFile(archive) as opened:
            why = opened.read(REASON).decode("utf-8", "replace")
            listed = UNTRIED in opened.namelist()
            places = opened.read(UNTRIED).decode("utf-8", "replace") if listed else ""
    except (KeyError, zipfile.BadZipFile):
        return None
    return RunsAs(why, tuple(places.splitlines()))

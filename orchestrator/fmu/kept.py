"""What the cache holds, seen from outside: kinds of entries, their sizes, whether they are whole."""

from __future__ import annotations

import contextlib
import re
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from ..cache import content_of
from .archive import FORMAT, whole_entry


@dataclass(frozen=True)
class Entry:
    """A file or folder of the cache."""

    path: Path
    whole: Callable[[], bool]

    @property
    def size(self) -> int:
        """Of all its files [B]."""
        files = self.path.rglob("*") if self.path.is_dir() else [self.path]
        return sum(file.lstat().st_size for file in files if not file.is_dir())


def kept_in(folder: Path) -> dict[str, list[Entry]]:
    """Return kind -> entries of a folder of the cache; nothing else that lies there is ours."""
    found: dict[str, list[Entry]] = {
        "unpacked FMUs": [],
        "launchers": [_file(file) for file in folder.glob("launcher/*")],
        "keys of sources": [_file(file) for file in folder.glob("keys/*")],
        "FMUs": [Entry(file, partial(_zip_is_whole, file)) for file in folder.glob("fmus/*/*.fmu")],
        "left over": [],
    }
    for path in folder.iterdir():
        match = re.fullmatch(r"[0-9a-f]{32}-(\d+)", path.name)
        if match and int(match[1]) == FORMAT:
            found["unpacked FMUs"].append(Entry(path, partial(_entry_is_whole, path)))
        elif match or path.name.startswith(".unpacking-"):
            found["left over"].append(Entry(path, lambda: True))  # of other versions, or ended half-way
    return {kind: entries for kind, entries in found.items() if entries}


def _file(file: Path) -> Entry:
    return Entry(file, lambda: content_of(file) is not None)


def _entry_is_whole(entry: Path) -> bool:
    return whole_entry(entry) is not None


def _zip_is_whole(file: Path) -> bool:
    with contextlib.suppress(zipfile.BadZipFile, OSError), zipfile.ZipFile(file) as archive:
        return archive.testzip() is None
    return False


def remove(path: Path) -> None:
    """Delete an entry, also while somebody uses it."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)

"""Snapshot of a folder, to be compared with a later one."""

from __future__ import annotations

import os
import stat
from pathlib import Path


def snapshot(*folders: Path) -> dict[str, tuple[int, int, object]]:
    """Return mode, time and content of everything in and below folders; a link's content is its target."""
    found: dict[str, tuple[int, int, object]] = {}
    for folder in folders:
        found[str(folder)] = _state(folder)
        for above, below, files in os.walk(folder):
            found |= {os.path.join(above, name): _state(Path(above, name)) for name in (*below, *files)}
    return found


def _state(path: Path) -> tuple[int, int, object]:
    status = path.lstat()
    content: object = None
    if stat.S_ISLNK(status.st_mode):
        content = os.readlink(path)
    elif stat.S_ISREG(status.st_mode):
        # holes in a file of many gigabytes are not read
        content = path.read_bytes() if status.st_size < 10_000_000 else status.st_size
    return status.st_mode, status.st_mtime_ns, content

"""Folders with FMUs for tests: copies of the project's own."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path

from yawbench.fmus.build import HERE as FMUS
from yawbench.fmus.build import build_all, find_recipes


def put_fmus(folder: Path, *, components: Iterable[str] | None = None) -> None:
    """Copy FMUs of these components, or of all, into a folder; stale ones in `fmus/` are built first."""
    names = list(find_recipes() if components is None else components)
    build_all(FMUS, components=names)
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        shutil.copyfile(FMUS / f"{name}.fmu", folder / f"{name}.fmu")

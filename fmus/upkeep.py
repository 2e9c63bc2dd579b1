"""FMUs that are made of the sources as they are now: before a scenario runs, what is stale is built.

An FMU was built here if its archive says so. Its key is compared with the one that its sources have
now. To find that key takes a tenth of a second; it is kept in the cache with its evidence, which
takes a few milliseconds to look at. FMUs are built in their place: those of the project's
components in its folder `fmus/`, those of somebody's own files where they were built. A copy that
somebody put elsewhere is never touched, only told of. Where the folder cannot be written, FMUs are
built into the cache, as are those of an installed yawbench: a package's folder is its installer's.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from orchestrator.cache import cache_folder, keep, recall
from orchestrator.errors import BuildError
from orchestrator.plan import BuildInfo

from .evidence import SourceDigests, content_digest
from .mark import BuildStamp, read_mark

if TYPE_CHECKING:
    from .build import Recipe

HERE = Path(__file__).resolve().parent
KEYS = "keys"
"""Store of keys, with their evidence, in the cache."""
BUILT = "fmus"
"""Folder of the cache for FMUs that are not built in their own folder."""
_NO_KEY = "none"
"""Of sources that cannot be read or parsed."""


class FmuUpdater:
    """Brings FMUs up to date, each once. `tell` is called with a line for each that is built."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._looks = SourceDigests()
        self._recipes: dict[str, Recipe] = {}
        self._found: dict[tuple[Path, bool], tuple[Path, BuildInfo | None]] = {}

    def bring(self, archive: Path, *, build: bool) -> tuple[Path, BuildInfo | None]:
        """Return the archive to open in place of `archive`, and what it was built from if that is here.

        If it does not exist and cannot be built, it is returned all the same.

        Raises:
            BuildError: it has to be built, and cannot be.
        """
        if (archive, build) not in self._found:
            self._found[archive, build] = self._bring(archive, build)
        return self._found[archive, build]

    def _bring(self, archive: Path, build: bool) -> tuple[Path, BuildInfo | None]:
        places = dict.fromkeys((archive, place_of(archive.parent) / archive.name))
        marks = {place: read_mark(place) for place in places if os.path.exists(place)}
        if archive in marks and marks[archive] is None:
            return archive, None
        found, mark = next(
            ((p, m) for p, m in marks.items() if m), (archive, BuildStamp(archive.stem, "", ""))
        )
        key = self._key(archive, mark)
        for place, its in marks.items():
            if its and its.is_of(key):
                return place, _built(its, current=True)
        at_home = _is_at_home(archive, mark)
        if key is not None and at_home and build:
            return self._build(archive, mark)
        gone = mark.is_component and at_home  # its source, so that it is not made of what is there
        stale = bool(marks) and (key is not None or gone)
        return found, _built(mark, current=False) if stale else None

    def _key(self, archive: Path, mark: BuildStamp) -> str | None:
        """Return the key that the FMU would get if it were built now, None if its source is not here."""
        entry = content_digest(str(archive).encode())
        about = asdict(replace(mark, key=""))
        record = json.loads(recall(KEYS, entry) or b"{}")
        if record.get("of") == about and self._looks.confirm(record["evidence"]):
            known: str | None = record["key"]
            return known
        try:
            recipe = self._recipe(archive, mark)
            if recipe is None:
                return None
            key = recipe.key()
        except (BuildError, OSError):
            return _NO_KEY
        record = {"of": about, "key": key, "evidence": recipe.evidence()}
        keep(KEYS, entry, json.dumps(record).encode())
        return key

    def _recipe(self, archive: Path, mark: BuildStamp) -> Recipe | None:
        """Return how an FMU is built, None if its source is not here."""
        from .build import find_recipes, recipe_of  # slow to import, and not needed if all is current

        if mark.is_component:
            if not mark.source and not _is_at_home(archive, mark):
                return None  # no FMU, and nothing says that it could be one of ours
            self._recipes = self._recipes or find_recipes()
            return self._recipes.get(mark.name)
        source = (archive.parent / mark.source).resolve()
        if not source.exists() or not _is_at_home(archive, mark):
            return None
        return recipe_of(source, role=mark.role or None, name=mark.name, defaults=mark.defaults)

    def _build(self, archive: Path, mark: BuildStamp) -> tuple[Path, BuildInfo]:
        from .build import bring_up_to_date, component_mark
        from .native.build import LATER

        target = place_of(archive.parent) / archive.name
        recipe = self._recipe(archive, mark)
        assert recipe is not None
        if mark.is_component:
            mark = component_mark(recipe)
        bring_up_to_date(recipe, target, mark, hurry=True)
        made = read_mark(target)
        assert made is not None
        later = f"; it runs in Python: {LATER}" if made.is_unfinished else ""
        self._tell(f"{recipe.name}: built{later}")
        return target, _built(made, current=True)


def place_of(folder: Path) -> Path:
    """Return where FMUs are built that belong into `folder`: there, or in the cache."""
    installed = folder == HERE and not (HERE.parent / "pyproject.toml").exists()
    return folder if os.access(folder, os.W_OK) and not installed else in_cache(folder)


def in_cache(folder: Path) -> Path:
    """Return where FMUs stand whose own folder cannot be written, or is not a checkout's."""
    return cache_folder() / BUILT / content_digest(str(folder).encode())


def _built(mark: BuildStamp, *, current: bool) -> BuildInfo:
    return BuildInfo(mark.source, mark.key, mark.tool, current)


def _is_at_home(archive: Path, mark: BuildStamp) -> bool:
    """Return whether an FMU stands where it was built, so far as can be told."""
    return archive.parent.resolve() == HERE if mark.is_component else archive.parent.name == mark.home

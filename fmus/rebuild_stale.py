"""Rebuilds stale FMUs before a scenario runs.

FMUs built by this program carry a stamp, whose key is compared with the current key of the sources.
Computing a key takes a tenth of a second, so it is cached with its evidence, which takes a few
milliseconds to check. FMUs are rebuilt in place: those of the project's components in its folder
`fmus/`, those of users' files where they were built. Copies elsewhere are never changed, only
reported. If the folder is not writable, or belongs to an installed yawbench, FMUs are built into
the cache.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from yawbench.foundation.cache import cache_folder, keep, recall
from yawbench.foundation.errors import BuildError

from .build_stamp import BuildStamp, read_stamp
from .fmu import BuildInfo
from .source_digests import SourceDigests, content_digest

if TYPE_CHECKING:
    from .build import Recipe

HERE = Path(__file__).resolve().parent
KEYS = "keys"
"""Folder of the cache for keys with their evidence."""
BUILT = "fmus"
"""Folder of the cache for FMUs that are not built in their own folder."""
_NO_KEY = "none"
"""Key of sources that cannot be read or parsed."""


class FmuUpdater:
    """Brings FMUs up to date, each once; `report` is called with a line for each FMU that is built."""

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report
        self._digests = SourceDigests()
        self._recipes: dict[str, Recipe] = {}
        self._brought: dict[tuple[Path, object], tuple[Path, BuildInfo | None]] = {}

    def bring(self, archive: Path, *, build: bool | Literal["missing"]) -> tuple[Path, BuildInfo | None]:
        """Return the archive to open instead of `archive`, and its build info if its sources exist.

        `build`: whether it is built if it is stale or missing, or only if it is missing. If the FMU does not
        exist and cannot be built, `archive` itself is returned.

        Raises:
            BuildError: the FMU must be built, but the build fails.
        """
        if (archive, build) not in self._brought:
            self._brought[archive, build] = self._bring(archive, build)
        return self._brought[archive, build]

    def _bring(self, archive: Path, build: bool | Literal["missing"]) -> tuple[Path, BuildInfo | None]:
        places = dict.fromkeys((archive, build_folder(archive.parent) / archive.name))
        stamps = {place: read_stamp(place) for place in places if os.path.exists(place)}
        if archive in stamps and stamps[archive] is None:
            return archive, None
        existing, stamp = next(
            ((p, m) for p, m in stamps.items() if m), (archive, BuildStamp(archive.stem, "", ""))
        )
        key = self._key(archive, stamp)
        for place, its in stamps.items():
            if its and its.is_of(key):
                return place, _built(its, current=True)
        at_home = _is_at_home(archive, stamp)
        if key is not None and at_home and (not stamps if build == "missing" else build):
            return self._build(archive, stamp)
        gone = stamp.is_component and at_home  # its source no longer exists
        stale = bool(stamps) and (key is not None or gone)
        return existing, _built(stamp, current=False) if stale else None

    def _key(self, archive: Path, stamp: BuildStamp) -> str | None:
        """Return the key that the FMU would have if built now, None if its source does not exist."""
        entry = content_digest(str(archive).encode())
        about = json.loads(json.dumps(asdict(replace(stamp, key=""))))  # as it reads back: lists for tuples
        record = json.loads(recall(KEYS, entry) or b"{}")
        if record.get("of") == about and self._digests.confirm(record["evidence"]):
            known: str | None = record["key"]
            return known
        try:
            recipe = self._recipe(archive, stamp)
            if recipe is None:
                return None
            key = recipe.key()
        except (BuildError, OSError):
            return _NO_KEY
        record = {"of": about, "key": key, "evidence": recipe.evidence()}
        keep(KEYS, entry, json.dumps(record).encode())
        return key

    def _recipe(self, archive: Path, stamp: BuildStamp) -> Recipe | None:
        """Return the recipe of an FMU, None if its source does not exist."""
        from .build import find_recipes, recipe_of  # slow to import, and not needed if all is current

        if stamp.is_component:
            if not stamp.source and not _is_at_home(archive, stamp):
                return None  # neither an FMU of ours nor in our folder
            self._recipes = self._recipes or find_recipes()
            return self._recipes.get(stamp.name)
        source = (archive.parent.resolve() / stamp.source).resolve()
        if not source.exists() or not _is_at_home(archive, stamp):
            return None
        return recipe_of(source, role=stamp.role or None, name=stamp.name, defaults=stamp.defaults)

    def _build(self, archive: Path, stamp: BuildStamp) -> tuple[Path, BuildInfo]:
        from .archive import runs_as
        from .build import bring_up_to_date, component_stamp

        target = build_folder(archive.parent) / archive.name
        recipe = self._recipe(archive, stamp)
        assert recipe is not None
        if stamp.is_component:
            stamp = component_stamp(recipe, edition=stamp.edition)
        bring_up_to_date(recipe, target, stamp, hurry=True)
        built = read_stamp(target)
        assert built is not None
        how = runs_as(target)
        later = f"; it runs in Python: {how.why}" if built.is_unfinished and how and how.why else ""
        self._report(f"{recipe.name}: built{later}")
        return target, _built(built, current=True)


def build_folder(folder: Path) -> Path:
    """Return the folder into which FMUs of `folder` are built: `folder` itself, or a folder of the cache."""
    installed = folder == HERE and not (HERE.parent / "pyproject.toml").exists()
    return folder if os.access(folder, os.W_OK) and not installed else in_cache(folder)


def in_cache(folder: Path) -> Path:
    """Return the folder of the cache for FMUs whose own folder is not writable or installed."""
    return cache_folder() / BUILT / content_digest(str(folder).encode())


def _built(stamp: BuildStamp, *, current: bool) -> BuildInfo:
    return BuildInfo(stamp.source, stamp.key, stamp.tool, current)


def _is_at_home(archive: Path, stamp: BuildStamp) -> bool:
    """Return whether an FMU is still where it was built, according to its stamp."""
    folder = archive.parent.resolve()
    return folder == HERE if stamp.is_component else folder.name == stamp.home

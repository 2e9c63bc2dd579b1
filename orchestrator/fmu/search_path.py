"""Sources of FMUs beyond a folder `fmus`: folders of the environment, then installed packages.

`YAWBENCH_FMUS` names folders of FMUs, separated as in PATH. Packages provide components by an entry point of
the group `yawbench.components`, whose value is a package with folders of roles:

    [project.entry-points."yawbench.components"]
    laws = "my_laws.components"          # my_laws/components/controllers/follow.py is controller_follow

They are built into the cache when they are first used, and again when they have changed. The first place
that has a name counts; the last is the folder of yawbench's own FMUs.
"""

from __future__ import annotations

import functools
import importlib.machinery
import importlib.util
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from ..errors import Diagnostic, ModelDescriptionError
from ..messages import listed

FOLDERS = "YAWBENCH_FMUS"
"""Environment variable."""
GROUP = "yawbench.components"
"""Group of entry points."""


@dataclass(frozen=True)
class PackagedComponent:
    """A component of an installed package."""

    fmu: str  # name of its FMU
    source: Path  # Python file, or folder of C files
    package: str  # name of the distribution

    @property
    def archive(self) -> Path:
        """Path of its FMU, which is built in the cache."""
        from fmus.rebuild_stale import in_cache

        return in_cache(self.source.parent) / f"{self.fmu}.fmu"

    def __str__(self) -> str:
        return f"the package {self.package}"


def further_folders() -> list[Path]:
    """Return the folders that the environment names.

    Raises:
        ModelDescriptionError: one of them does not exist.
    """
    folders = [Path(text) for text in os.environ.get(FOLDERS, "").split(os.pathsep) if text]
    missing = [f"{FOLDERS}: there is no folder {folder}" for folder in folders if not folder.is_dir()]
    if missing:
        raise ModelDescriptionError(missing, code="folder-missing")
    return folders


@functools.cache
def packaged_components() -> Mapping[str, tuple[PackagedComponent, ...]]:
    """Return name of FMU -> the components of installed packages that have it, several if names collide.

    Packages are not imported, except for those above the one that an entry point names.

    Raises:
        ModelDescriptionError: an entry point names what is not a package.
    """
    from importlib.metadata import entry_points  # slow to import, and rarely needed

    components: dict[str, tuple[PackagedComponent, ...]] = {}
    errors = []
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: (entry.value, entry.name)):
        package = entry.dist.name if entry.dist else entry.value
        folders = _folders_of(entry.module)
        if not folders:
            errors.append(
                f"{package}: the entry point {entry.name!r} of {GROUP} names {entry.value!r}, which is not "
                "an importable package"
            )
        for component in (each for folder in folders for each in _components_in(folder, package)):
            others = components.get(component.fmu, ())
            if component.source not in [other.source for other in others]:
                components[component.fmu] = (*others, component)
    if errors:
        raise ModelDescriptionError(errors, code="folder-missing")
    return MappingProxyType(components)


def _folders_of(module: str) -> list[Path]:
    try:
        spec: importlib.machinery.ModuleSpec | None = importlib.util.find_spec(module)
    except (ImportError, ValueError):
        return []
    return [Path(folder) for folder in (spec.submodule_search_locations or ())] if spec else []


def _components_in(folder: Path, package: str) -> list[PackagedComponent]:
    from fmus.build import find_components
    from fmus.c.c_recipe import find_c_components

    in_python = {
        name: folder.joinpath(*parts).with_suffix(".py")
        for name, parts in find_components(folder).items()
        if not parts[-1].startswith("_")
    }
    every = {**in_python, **find_c_components(folder)}
    return [PackagedComponent(name, source, package) for name, source in every.items()]


def packaged(name: str) -> PackagedComponent | None:
    """Return the component of an installed package whose FMU has a name; None if there is none.

    Raises:
        ModelDescriptionError: several packages have it.
    """
    components = packaged_components().get(name, ())
    if len(components) > 1:
        raise ModelDescriptionError(
            f"{name} is in {listed(components)}: rename one, or name the path of an FMU",
            code="fmu-ambiguous",
        )
    return components[0] if components else None


def hidden(names: Iterable[str], folder: Path, *, packages: bool) -> list[Diagnostic]:
    """Return a warning for every FMU that hides others of its name.

    Args:
        names: of FMUs.
        folder: of FMUs, where they are looked for first.
        packages: look into installed packages, too, which takes a tenth of a second.
    """
    components = packaged_components() if packages else {}
    if not components and not os.environ.get(FOLDERS):
        return []
    warnings = []
    for name in dict.fromkeys(names):
        places: list[object] = [
            place for place in (folder, *further_folders()) if (place / f"{name}.fmu").is_file()
        ]
        places = [*dict.fromkeys([*places, *components.get(name, ())])]
        if len(places) > 1:
            sentence = f"{name} is in {listed(places)}; that in {places[0]} is used"
            warnings.append(Diagnostic("fmu-ambiguous", sentence, "warning"))
    return warnings

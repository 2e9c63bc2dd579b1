"""Finds and opens the FMUs of plans, each once; FMUs of the project's own components are rebuilt if stale.

A name is looked for in the folder `fmus`, in the folders that `YAWBENCH_FMUS` names (separated as in PATH),
among the components of installed packages, and among yawbench's own. Packages provide components by an entry
point of the group `yawbench.components`, whose value is a package with folders of roles:

    [project.entry-points."yawbench.components"]
    laws = "my_laws.components"          # my_laws/components/controllers/follow.py is controller_follow

They are built into the cache when they are first used, and again when they have changed. The first place
that has a name counts.

`shadowed_modules` detects PythonFMU instances that would silently run each other's code: all of them in a
process share one interpreter, and of two modules with the same name the second is never loaded. FMUs built by
`yawbench build` have module names that are unique to their content; FMUs from other sources may not.
"""

from __future__ import annotations

import functools
import importlib.machinery
import importlib.util
import os
import sys
from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from yawbench import fmus
from yawbench.foundation.errors import Diagnostic, ModelDescriptionError
from yawbench.foundation.messages import hint, listed, printable, short
from yawbench.vocabulary.roles import role_in

from .archive import open_fmu
from .description import hashes_of_modules
from .fmu import BuildInfo, Fmu, is_path

if TYPE_CHECKING:
    from .rebuild_stale import FmuUpdater


Building = bool | Literal["missing"]
"""Whether FMUs are built: those that are stale or missing, the missing alone, or none."""
HOME = Path(fmus.__file__).resolve().parent
"""Folder of the FMUs of the project's own components."""
FOLDERS = "YAWBENCH_FMUS"
"""Environment variable with folders of FMUs."""
GROUP = "yawbench.components"
"""Group of entry points of packages with components."""


def report_to_stderr(text: str) -> None:
    """Print a line, at once."""
    print(printable(text), file=sys.stderr, flush=True)


class Opener:
    """Opens the FMUs of one or several plans.

    Args:
        build: build FMUs that are stale, or missing but buildable; "missing": these alone. Only the process
            that starts runs does so, once for all of them; FMUs found stale later are listed in the plan.
        report: called with a line for every FMU that is built.
        opened: FMUs already opened, by their paths.
    """

    def __init__(
        self,
        *,
        build: Building = False,
        report: Callable[[str], None] = report_to_stderr,
        opened: Mapping[Path, Fmu] | None = None,
    ) -> None:
        self.build = build
        self._report = report
        self._preopened = dict(opened or {})
        self._opened: dict[tuple[Path, BuildInfo | None, bool], Fmu] = {}
        self._built: dict[Path, BuildInfo | None] = {}
        self.folders: dict[tuple[Path, Path], Path] = {}
        """Folder of a scenario, working directory -> what `find_folder` has returned."""
        self.opened_as: dict[Hashable, Fmu] = {}
        """FMU as named, with the folders and options by which it is found -> the opened FMU."""

    @cached_property
    def _upkeep(self) -> FmuUpdater:
        from .rebuild_stale import FmuUpdater

        return FmuUpdater(self._report)

    def bring(self, archive: Path, *, build: bool = True) -> Path:
        """Return the archive to open for `archive`, building it if necessary; it may not exist.

        Raises:
            BuildError: building fails.
        """
        if archive in self._preopened:
            return archive
        path, self._built[path] = self._upkeep.bring(archive, build=build and self.build)
        return path

    def open(self, archive: Path, *, validate: bool = True) -> Fmu:
        """Open an FMU as `open_fmu` does, with its build info if `bring` has returned it; each only once."""
        if archive in self._preopened:
            return self._preopened[archive]
        built = self._built.get(archive)
        key = (archive, built, validate)
        if key not in self._opened:
            fmu = open_fmu(archive, validate=validate)
            lacking = [name for name in fmu.host_packages if importlib.util.find_spec(name) is None]
            if lacking:
                raise ModelDescriptionError(
                    f"{archive}: needs {listed(lacking)} in the Python that runs it, which this one lacks: "
                    f"{sys.prefix}",
                    code="fmu-needs-packages",
                )
            self._opened[key] = replace(fmu, built=built)
        return self._opened[key]

    def bring_packaged(self, component: PackagedComponent) -> Path:
        """Return the archive of a component of an installed package, building it if necessary.

        Raises:
            BuildError: building fails.
            ModelDescriptionError: it is not built, and building is not allowed.
        """
        archive = component.archive
        if archive.is_file() or archive in self._preopened:
            return self.bring(archive)
        if not self.build:
            raise ModelDescriptionError(
                f"{component.fmu} of {component} is not built; 'yawbench build {component.fmu}' builds it",
                code="fmu-missing",
            )
        from .build import build_component

        self._report(f"{component.fmu}: built from {component}")
        return build_component(component.source, archive.parent)

    def names(self, folder: Path) -> list[str]:
        """Return the names of the FMUs that can be used beside a folder, with those that can be built."""
        names = {path.stem for place in (folder, *further_folders()) for path in place.glob("*.fmu")}
        names |= packaged_components().keys()
        return sorted(names | (_own() if self.build else _built_own()))


def _own() -> set[str]:
    """Return the names of the FMUs of the project's own components, built or not."""
    from .build import find_recipes  # slow to import

    return {*find_recipes()}


def _built_own() -> set[str]:
    """Return the names of those that are built, in their folder or in the cache."""
    from .rebuild_stale import build_folder

    return {path.stem for place in (HOME, build_folder(HOME)) for path in place.glob("*.fmu")}


def find_folder(scenario: Path, *, opener: Opener) -> Path:
    """Return the nearest folder `fmus` with FMUs, upwards from the scenario, then from the working directory.

    If there is none, the project's own; its FMUs may be in the cache.
    """
    above = scenario.absolute().parent
    here = Path.cwd()
    if known := opener.folders.get((above, here)):
        return known
    for folder in (above, *above.parents, here, *here.parents):
        if any((folder / "fmus").glob("*.fmu")):
            return opener.folders.setdefault((above, here), folder / "fmus")
    return HOME


def find_fmu(fmu: str, *, scenario: Path, fmus: Path, opener: Opener, build: bool = True) -> Path:
    """Return the archive for `fmu`, a path relative to the scenario or a name in a folder; may build it.

    Args:
        fmu: path or name, as given in the scenario or an option.
        scenario: the scenario file.
        fmus: the folder of FMUs.
        opener: brings archives up to date.
        build: whether it may build this one.

    Raises:
        ModelDescriptionError: no such FMU; the message names those most like it.
        BuildError: building fails.
    """
    if is_path(fmu):
        return opener.bring(Path(os.path.normpath(scenario.absolute().parent / fmu)), build=build)
    archive = opener.bring(fmus.absolute() / f"{fmu}.fmu", build=build)
    if os.path.isfile(archive):
        return archive
    for place in further_folders():
        if (place / archive.name).is_file():
            return opener.bring(place.absolute() / archive.name, build=build)
    if component := packaged(fmu):
        return opener.bring_packaged(component)
    own = opener.bring(HOME / archive.name, build=build)
    if os.path.isfile(own):
        return own
    if fmu in _own():
        raise ModelDescriptionError(
            f"{fmu} is not built, and building is off (--no-build, --no-run); 'yawbench build' builds it",
            code="fmu-missing",
        )
    names = opener.names(fmus)
    role = role_in(fmu)
    related = [name for name in names if role and role_in(name) == role] or names
    raise ModelDescriptionError(
        f"no FMU {short(fmu)} in {fmus}{hint(fmu, related, lead='there are')}", code="fmu-missing"
    )


def stale_fmus(fmus: Iterable[Fmu]) -> list[Diagnostic]:
    """Return a warning for every FMU that is out of date with its sources."""
    stale = {fmu.path: fmu.built.source for fmu in fmus if fmu.built is not None and not fmu.built.current}
    return [
        Diagnostic(
            "fmu-out-of-date",
            f"{path.name} is out of date with {source or 'its sources'}; build it again",
            "warning",
        )
        for path, source in stale.items()
    ]


def host_needs(fmus: Iterable[Fmu]) -> list[Diagnostic]:
    """Return a note for every FMU that needs packages beyond the standard library in its host's Python."""
    needs = {fmu.name: fmu.host_packages for fmu in fmus if fmu.host_packages}
    return [
        Diagnostic(
            "fmu-needs-packages", f"{name} needs {listed(packages)} in the Python of every host", "info"
        )
        for name, packages in needs.items()
    ]


@dataclass(frozen=True)
class PackagedComponent:
    """A component of an installed package."""

    fmu: str  # name of its FMU
    source: Path  # Python file, or folder of C files
    package: str  # name of the distribution

    @property
    def archive(self) -> Path:
        """Path of its FMU, which is built in the cache."""
        from .rebuild_stale import in_cache

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
    from .build import find_components
    from .c.c_recipe import find_c_components

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


def shadowed_modules(fmus: Mapping[str, Fmu], *, isolated: bool = False) -> list[str]:
    """Return an error message for every instance that would run another instance's or this program's module.

    Args:
        fmus: instance -> FMU.
        isolated: each instance has a process of its own, and so its own modules.
    """
    problems = []
    first_in: dict[str, tuple[str, str]] = {}
    for instance, fmu in fmus.items():
        for module, content in fmu.python_modules.items():
            other, its_content = first_in.setdefault(module, (instance, content))
            if its_content != content and not isolated:
                problems.append(
                    f"{instance} ({fmu.name}) would run code of {other} ({fmus[other].name}): both FMUs "
                    f"bring a Python module {module!r}, and a process has room for one; rebuild one of them "
                    "with another module name, or run with --isolate"
                )
            elif module in sys.stdlib_module_names:
                problems.append(
                    f"{instance} ({fmu.name}) would run other code: its Python module {module!r} has the "
                    "name of one of Python's own; rebuild it with another module name"
                )
            elif _loaded_from_elsewhere(module, content, fmu.directory):
                problems.append(
                    f"{instance} ({fmu.name}) would run other code: another Python module {module!r} is "
                    "loaded in this process already; rebuild it with another module name"
                )
    return problems


def _loaded_from_elsewhere(module: str, content: str, directory: Path) -> bool:
    """Return whether a different module with this name is already loaded in this process."""
    homes = [home for home in _homes(module) if not home.is_relative_to(directory)]
    return any(_content(home, module) != content for home in homes)


def _homes(module: str) -> list[Path]:
    """Return the folders that a loaded module comes from: several if it is a folder without __init__.py."""
    loaded = sys.modules.get(module)
    file = getattr(loaded, "__file__", None)
    if file is not None:
        return [Path(file).parents[1 if Path(file).name == "__init__.py" else 0]]
    return [Path(folder).parent for folder in getattr(loaded, "__path__", ())]


def _content(home: Path, module: str) -> str | None:
    """Return the hash of a module's files in a folder; None if they cannot be read."""
    package = home / module
    files = package.rglob("*.py") if package.is_dir() else [home / f"{module}.py"]
    try:
        return hashes_of_modules({f.relative_to(home).as_posix(): f.read_bytes() for f in files}).get(module)
    except OSError:
        return None

"""Finds and opens the FMUs of plans, each once; FMUs of the project's own components are rebuilt if stale."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import fmus
from vocabulary.roles import role_in

from ..errors import Diagnostic, ModelDescriptionError
from ..messages import closest, listed, printable, short
from ..plan import BuildInfo, Fmu
from ..scenario.overrides import is_path
from .archive import open_fmu
from .search_path import PackagedComponent, further_folders, packaged, packaged_components

if TYPE_CHECKING:
    from fmus.rebuild_stale import FmuUpdater


HOME = Path(fmus.__file__).resolve().parent
"""Folder of the FMUs of the project's own components."""


def report_to_stderr(text: str) -> None:
    """Print a line, at once."""
    print(printable(text), file=sys.stderr, flush=True)


class Opener:
    """Opens the FMUs of one or several plans.

    Args:
        build: build FMUs that are stale, or missing but buildable. Only the process that starts runs does
            so, once for all of them; FMUs found stale later are listed in the plan.
        report: called with a line for every FMU that is built.
        opened: FMUs already opened, by their paths.
    """

    def __init__(
        self,
        *,
        build: bool = False,
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
        from fmus.rebuild_stale import FmuUpdater

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
            lacking = [name for name in fmu.host_packages if find_spec(name) is None]
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
        from fmus.build import build_component

        self._report(f"{component.fmu}: built from {component}")
        return build_component(component.source, archive.parent)

    def names(self, folder: Path) -> list[str]:
        """Return the names of the FMUs that can be used beside a folder, with those that can be built."""
        names = {path.stem for place in (folder, *further_folders()) for path in place.glob("*.fmu")}
        names |= packaged_components().keys()
        names |= {path.stem for path in HOME.glob("*.fmu")}
        if self.build:
            from fmus.build import find_recipes

            names |= find_recipes().keys()
        return sorted(names)


def find_folder(scenario: Path, *, opener: Opener) -> Path:
    """Return the nearest folder `fmus` with FMUs, upwards from the scenario, then from the working directory.

    Raises:
        ModelDescriptionError: there is none, and building is not allowed.
    """
    above = scenario.absolute().parent
    here = Path.cwd()
    if known := opener.folders.get((above, here)):
        return known
    for folder in (above, *above.parents, here, *here.parents):
        if any((folder / "fmus").glob("*.fmu")):
            return opener.folders.setdefault((above, here), folder / "fmus")
    if opener.build:
        return HOME
    raise ModelDescriptionError(
        f"no folder fmus/ with FMUs in {above}, in {here} or above them; "
        "make them with 'yawbench build' or name their folder with --fmus",
        code="fmu-missing",
    )


def find_fmu(fmu: str, *, scenario: Path, fmus: Path, opener: Opener, build: bool = True) -> Path:
    """Return the archive for `fmu`, a path relative to the scenario or a name in a folder; may build it.

    Args:
        fmu: path or name, as given in the scenario or an option.
        scenario: the scenario file.
        fmus: the folder of FMUs.
        opener: brings archives up to date.
        build: whether it may build this one.

    Raises:
        ModelDescriptionError: no such FMU; the message lists the existing ones.
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
    names = opener.names(fmus)
    if not names:
        raise ModelDescriptionError(
            f"no FMU {short(fmu)}: the folder {fmus} contains no FMUs", code="fmu-missing"
        )
    role = role_in(fmu)
    related = [name for name in names if role and role_in(name) == role] or names
    likely = closest(fmu, names)
    guess = f"did you mean {likely!r}? " if likely else ""
    raise ModelDescriptionError(
        f"no FMU {short(fmu)} in {fmus}; {guess}there are: {listed(related)}", code="fmu-missing"
    )


def stale_fmus(fmus: Iterable[Fmu]) -> list[Diagnostic]:
    """Return a warning for every FMU that is out of date with its sources."""
    stale = {fmu.path: fmu.built.source for fmu in fmus if fmu.built is not None and not fmu.built.current}
    return [
        Diagnostic(
            "fmu-out-of-date",
            f"{path.name} is out of date with {source or 'its sources'}; 'yawbench build' rebuilds it",
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

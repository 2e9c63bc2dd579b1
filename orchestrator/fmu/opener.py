"""FMUs found and opened for plans: each once, brought up to date with its sources before if they are here."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import fmus

from ..errors import ModelDescriptionError
from ..messages import closest, listed, printable, short
from ..plan import BuildInfo, Fmu
from ..scenario.overrides import is_path
from .archive import open_fmu

if TYPE_CHECKING:
    from fmus.upkeep import FmuUpdater


HOME = Path(fmus.__file__).resolve().parent
"""Folder of the FMUs of the project's own components."""


def _say(text: str) -> None:
    print(printable(text), file=sys.stderr, flush=True)


class Opener:
    """Opens the FMUs of one plan or many.

    Args:
        build: build what is stale, or missing and can be built. Only who starts runs does so, and
            once for all of them; what each run finds stale then, its plan says.
        tell: called with a line for every FMU that is built.
        opened: FMUs that need not be opened, by the path that stands for each.
    """

    def __init__(
        self,
        *,
        build: bool = False,
        tell: Callable[[str], None] = _say,
        opened: Mapping[Path, Fmu] | None = None,
    ) -> None:
        self.build = build
        self._tell = tell
        self._given = dict(opened or {})
        self._opened: dict[tuple[Path, BuildInfo | None, bool], Fmu] = {}
        self._built: dict[Path, BuildInfo | None] = {}

    @cached_property
    def _upkeep(self) -> FmuUpdater:
        from fmus.upkeep import FmuUpdater

        return FmuUpdater(lambda name: self._tell(f"{name}: built"))

    def bring(self, archive: Path, *, build: bool = True) -> Path:
        """Return the archive to open in place of `archive`, built if need be; it may not exist.

        Raises:
            BuildError: its sources cannot be made into an FMU.
        """
        if archive in self._given:
            return archive
        path, self._built[path] = self._upkeep.bring(archive, build=build and self.build)
        return path

    def open(self, archive: Path, *, validate: bool = True) -> Fmu:
        """Return an FMU as `open_fmu` does, with what it was built from if it has been brought."""
        if archive in self._given:
            return self._given[archive]
        built = self._built.get(archive)
        key = (archive, built, validate)
        if key not in self._opened:
            fmu = open_fmu(archive, validate=validate)
            lacking = [name for name in fmu.host_packages if find_spec(name) is None]
            if lacking:
                raise ModelDescriptionError(
                    f"{archive}: needs {listed(lacking)} in the Python that runs it, which this one lacks: "
                    f"{sys.prefix}"
                )
            self._opened[key] = replace(fmu, built=built)
        return self._opened[key]

    def names(self, folder: Path) -> list[str]:
        """Return the names of the FMUs that a folder holds, or that can be built into it."""
        held = {path.stem for path in folder.glob("*.fmu")}
        if self.build and folder.resolve() == HOME:
            from fmus.build import find_recipes

            held |= find_recipes().keys()
        return sorted(held)


def find_folder(scenario: Path, *, opener: Opener) -> Path:
    """Return the nearest folder `fmus` that holds FMUs, upward from a scenario file, then from here.

    Raises:
        ModelDescriptionError: there is none, and none may be built.
    """
    above = scenario.absolute().parent
    here = Path.cwd()
    for folder in (above, *above.parents, here, *here.parents):
        if any((folder / "fmus").glob("*.fmu")):
            return folder / "fmus"
    if opener.build:
        return HOME
    raise ModelDescriptionError(
        f"no folder fmus/ with FMUs in {above}, in {here} or above them; "
        "make them with 'yawbench build' or name their folder with --fmus"
    )


def find_fmu(fmu: str, *, scenario: Path, fmus: Path, opener: Opener, build: bool = True) -> Path:
    """Return the archive that `fmu` means, built if need be: a path from the scenario, or a name in a folder.

    Args:
        fmu: as the scenario or an option gives it.
        scenario: the scenario file.
        fmus: the folder of FMUs.
        opener: brings archives up to date.
        build: whether it may build this one.

    Raises:
        ModelDescriptionError: no such FMU; names those there are.
        BuildError: its sources cannot be made into an FMU.
    """
    if is_path(fmu):
        return opener.bring(Path(os.path.normpath(scenario.absolute().parent / fmu)), build=build)
    archive = opener.bring(fmus.absolute() / f"{fmu}.fmu", build=build)
    if os.path.isfile(archive):
        return archive
    names = opener.names(fmus)
    if not names:
        raise ModelDescriptionError(f"no FMU {short(fmu)}: the folder {fmus} holds no FMUs")
    role = fmu.partition("_")[0] + "_"
    related = [name for name in names if name.startswith(role)] or names
    likely = closest(fmu, names)
    guess = f"did you mean {likely!r}? " if likely else ""
    raise ModelDescriptionError(f"no FMU {short(fmu)} in {fmus}; {guess}there are: {listed(related)}")


def stale_fmus(fmus: Iterable[Fmu]) -> list[str]:
    """Return a sentence for every FMU that is not made of its sources as they are."""
    stale = {fmu.path: fmu.built.source for fmu in fmus if fmu.built is not None and not fmu.built.current}
    return [
        f"{path.name} is not made of {source or 'its sources'} as it is now; 'yawbench build' makes it anew"
        for path, source in stale.items()
    ]


def host_needs(fmus: Iterable[Fmu]) -> list[str]:
    """Return a sentence for every FMU that needs more of a host's Python than the standard library."""
    needs = {fmu.name: fmu.host_packages for fmu in fmus if fmu.host_packages}
    return [
        f"{name} needs {listed(packages)} in the Python of every host" for name, packages in needs.items()
    ]

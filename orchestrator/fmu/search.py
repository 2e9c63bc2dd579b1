"""Where the FMUs are that a scenario names."""

from __future__ import annotations

import os
from pathlib import Path

from ..errors import ModelDescriptionError
from ..scenario.overrides import is_path
from ..wording import closest, listed, short
from .opener import HOME, Opener


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

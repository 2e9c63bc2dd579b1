"""Where the FMUs are that a scenario names."""

from __future__ import annotations

import os
from pathlib import Path

from ..errors import ModelDescriptionError
from ..scenario.overrides import is_path
from ..wording import closest, listed, short


def find_folder(scenario: Path) -> Path:
    """Return the nearest folder `fmus` that holds FMUs, upward from a scenario file, then from here.

    Raises:
        ModelDescriptionError: there is none.
    """
    above = scenario.absolute().parent
    here = Path.cwd()
    for folder in (above, *above.parents, here, *here.parents):
        if any((folder / "fmus").glob("*.fmu")):
            return folder / "fmus"
    raise ModelDescriptionError(
        f"no folder fmus/ with FMUs in {above}, in {here} or above them; "
        "make them with 'yawbench build' or name their folder with --fmus"
    )


def find_fmu(fmu: str, *, scenario: Path, fmus: Path | None) -> Path:
    """Return the archive that `fmu` means: a path, relative to the scenario, or a name in a folder.

    Args:
        fmu: as the scenario or an option gives it.
        scenario: the scenario file.
        fmus: the folder of FMUs; None: `find_folder`.

    Raises:
        ModelDescriptionError: no such FMU; names those there are.
    """
    if is_path(fmu):
        return Path(os.path.normpath(scenario.absolute().parent / fmu))
    folder = find_folder(scenario) if fmus is None else fmus
    archive = folder / f"{fmu}.fmu"
    if os.path.isfile(archive):
        return archive
    names = sorted(p.stem for p in folder.glob("*.fmu"))
    if not names:
        raise ModelDescriptionError(f"no FMU {short(fmu)}: the folder {folder} holds no FMUs")
    role = fmu.partition("_")[0] + "_"
    related = [name for name in names if name.startswith(role)] or names
    likely = closest(fmu, names)
    guess = f"did you mean {likely!r}? " if likely else ""
    raise ModelDescriptionError(f"no FMU {short(fmu)} in {folder}; {guess}there are: {listed(related)}")

"""Scenario, study and sweep files by name: `fnn_sideslip/25mps` is the file in the folder of scenarios."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterator
from itertools import islice
from pathlib import Path

from ..errors import ScenarioError
from ..files import TEXT, read_bytes
from ..messages import hint, listed, short
from .validation import KINDS

FOLDER = "scenarios"
SHIPPED = Path(__file__).resolve().parents[2] / FOLDER
"""Where this program's own scenarios lie."""
YAML = (".yaml", ".yml")
ENDINGS = (*YAML, ".ssp")
LOOKED_AT = 20_000
"""Entries of a folder that are looked at for files. Chosen: a second, and more than anybody has."""
COMMANDS = {
    "a scenario": "run",
    "a study file": "study",
    "a sweep file": "sweep",
    "a tuning file": "tune",
    "a ranking file": "rank",
}
"""Kind of file -> the command that is for it."""
HOMES = {"a vehicle file": "vehicles"}
"""Kind of file -> the one folder they lie in, which names need not say: `van` for `vehicles/van`."""
_KEY = re.compile(rf"^[\"']?({'|'.join(KINDS)})[\"']?[ \t]*:", re.MULTILINE)


def folders() -> list[Path]:
    """Return the folders of scenarios: the nearest upward from here, then this program's own."""
    here = Path.cwd()
    near = [folder / FOLDER for folder in (here, *here.parents) if (folder / FOLDER).is_dir()]
    return list(dict.fromkeys([*(_from_here(folder) for folder in near[:1]), _from_here(SHIPPED)]))


def kind_of(path: Path) -> str:
    """Return the kind of a file (`strict.KINDS`) as a glance tells it; "" if it is none of them."""
    if path.suffix == ".ssp":
        return "a scenario"
    try:
        keys = _KEY.findall(read_bytes(path, largest=TEXT).decode("utf-8-sig"))
    except (OSError, ValueError):
        return ""
    return next((kind for key, (kind, *_) in KINDS.items() if key in keys), "")


def files(folder: Path, kinds: Collection[str], *, depth: int | None = None) -> Iterator[tuple[Path, str]]:
    """Yield every file of some kinds in a folder with its kind, in alphabetical order.

    Args:
        folder: where they are; of very many files in it the first `LOOKED_AT` are looked at.
        kinds: of `strict.KINDS`.
        depth: 1: those in the folder itself, 2: those in a folder of it; None: all below.
    """
    for path in sorted(islice(_below(folder, depth), LOOKED_AT)):
        if path.suffix in ENDINGS and (kind := kind_of(path)) in kinds:
            yield path, kind


def _below(folder: Path, depth: int | None) -> Iterator[Path]:
    """Yield what is in a folder and may be read; no link to a folder is followed."""
    for above, inside, names in os.walk(folder):
        place = Path(above)
        level = len(place.relative_to(folder).parts) + 1
        if depth is None or level == depth:
            yield from (place / name for name in (*inside, *names))
        if level == depth:
            inside.clear()
        inside.sort()


def names(kind: str) -> list[str]:
    """Return the names that `find` takes for a kind of file, each once."""
    found = (
        path.relative_to(folder).with_suffix("").as_posix()
        for folder in folders()
        for path, _ in files(folder, [kind], depth=2)
    )
    return list(dict.fromkeys(found))


def named(name: str | Path, kind: str = "") -> Path | None:
    """Return the file that a name means, None if there is none: here, or in a folder of scenarios."""
    bases = [Path(), *folders()]
    if kind in HOMES:
        bases += [folder / HOMES[kind] for folder in folders()]
    candidates = (base / f"{name}{ending}" for base in bases for ending in ENDINGS)
    return next((path for path in candidates if os.path.isfile(path)), None)


def find(source: str | Path, kind: str) -> Path:
    """Return the file that a path or a name in a folder of scenarios means.

    A path with the ending of such a file is returned as it stands, though there be no such file.

    Raises:
        ScenarioError: there is none; names those there are.
    """
    path = Path(source)
    if os.path.isdir(path):
        raise ScenarioError(f"{source}: {_what_is_in(path, kind)}")
    if os.path.exists(path):
        return path
    known = [name.removeprefix(f"{HOMES.get(kind)}/") for name in names(kind)]
    elsewhere = [name for name in known if path.stem == name.rpartition("/")[2]]
    if path.suffix in ENDINGS and not elsewhere:
        return path
    if file := named(source, kind):
        return file
    for folder in (base / path for base in folders()):
        if os.path.isdir(folder):
            raise ScenarioError(f"{source}: {_what_is_in(folder, kind)}")
    others = hint(str(source), elsewhere or known, lead="by name there are")
    what = kind.partition(" ")[2]
    raise ScenarioError(f"there is no {what} {short(str(source))}{others}")


def _what_is_in(folder: Path, kind: str) -> str:
    """Return what a folder is that was given in place of a file, and what could be meant."""
    if (folder / "run.json").is_file():
        return f"these are the results of a run, not {kind}; 'yawbench plot {folder}' draws them"
    for depth in (1, 2):
        if found := [str(path) for path, _ in files(folder, [kind], depth=depth)]:
            return f"a folder, not {kind}; in it there are: {listed(found)}"
    for other, command in COMMANDS.items():
        if found := [str(path) for path, _ in files(folder, [other])]:
            return f"a folder without {kind}; 'yawbench {command}' takes {listed(found, last='or')}"
    known = names(kind)
    return f"a folder without {kind}{f'; by name there are: {listed(known)}' if known else ''}"


def _from_here(path: Path) -> Path:
    """Return a path as one would type it."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path

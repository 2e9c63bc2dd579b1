"""Finds scenario, study, sweep and other files by name (`fnn_sideslip/25mps`); their kind and title."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterator
from itertools import islice
from pathlib import Path

from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import hint, listed, short
from yawbench.foundation.safe_files import TEXT, read_bytes

from . import yaml_lines
from .schema_validation import KINDS

FOLDER = "scenarios"
SHIPPED = Path(__file__).resolve().parents[2] / FOLDER
"""Folder of the scenarios that come with this program."""
YAML = (".yaml", ".yml")
ENDINGS = (*YAML, ".ssp")
ARCHIVES = (".ssp", ".ssd")
"""Endings of an SSP archive, and of a description in one."""
FMU = ".fmu"
"""Ending of an FMU, which alone is a scenario, too (`fmu_alone`)."""
LOOKED_AT = 20_000
"""Maximum number of examined entries of a folder. Chosen: a second, and more than real folders have."""
COMMANDS = {
    "a scenario": "run",
    "a study file": "study",
    "a sweep file": "sweep",
    "a tuning file": "tune",
    "a ranking file": "rank",
}
"""Kind of file -> the command that takes it."""
HOMES = {"a vehicle file": "vehicles", "a file of bands": "bands"}
"""Kind of file -> its folder, which names may omit: `van` for `vehicles/van`."""
MEASUREMENT = "a measurement file"
_KEY = re.compile(rf"^[\"']?({'|'.join(KINDS)})[\"']?[ \t]*:", re.MULTILINE)
_LIKE = re.compile(r"^[\"']?like[\"']?[ \t]*:[ \t]+([^\s#].*?)[ \t]*(?:#.*)?$", re.MULTILINE)
MOST_ALIKE = 10
"""Files followed from one to the file that it is like, when only its kind or title is asked. Chosen."""
_TITLE = re.compile(r"^[\"']?title[\"']?[ \t]*:[ \t]+([^\s\[{&*!#].*(?:\n[ \t]+\S.*)*)", re.MULTILINE)
"""The entry of a text for the title, with the lines that continue it."""


def folders() -> list[Path]:
    """Return the folders of scenarios: the nearest in the working folder or above, then this program's."""
    here = Path.cwd()
    near = [folder / FOLDER for folder in (here, *here.parents) if (folder / FOLDER).is_dir()]
    return list(dict.fromkeys([*(_from_here(folder) for folder in near[:1]), _from_here(SHIPPED)]))


def kind_of(path: Path) -> str:
    """Guess the kind of a file (`schema_validation.KINDS`) from its keys, unparsed; "" if unknown."""
    if path.suffix.lower() in (*ARCHIVES, FMU):
        return "a scenario"
    keys = {key for text in _texts(path) for key in _KEY.findall(text)}
    return next((kind for key, (kind, *_) in KINDS.items() if key in keys), "")


def title_of(path: Path) -> str:
    """Return the title of a YAML file, whose other entries are not parsed; "" if it has none."""
    entry = next(filter(None, map(_TITLE.search, _texts(path))), None)
    return str(yaml_lines.scalar(entry[1]) or "") if entry else ""


def _texts(path: Path) -> Iterator[str]:
    """Yield the texts of a YAML file, of the file that it is like, and so on; none that cannot be read."""
    for _ in range(MOST_ALIKE):
        try:
            text = read_bytes(path, largest=TEXT).decode("utf-8-sig")
        except (OSError, ValueError):
            return
        yield text
        if (like := _LIKE.search(text)) is None:
            return
        name = str(yaml_lines.scalar(like[1]))
        found = (beside(path, name, kind) for kind in ("", *HOMES))
        path = next(filter(os.path.isfile, found), path.parent / name)


def files(folder: Path, kinds: Collection[str], *, depth: int | None = None) -> Iterator[tuple[Path, str]]:
    """Yield (path, kind) of every file of some kinds in a folder, in alphabetical order.

    Args:
        folder: where to search; only the first `LOOKED_AT` entries are examined.
        kinds: of `schema_validation.KINDS`.
        depth: 1: files in the folder itself, 2: files in its subfolders; None: all below.
    """
    for path in sorted(islice(_below(folder, depth), LOOKED_AT)):
        if path.suffix in ENDINGS and (kind := kind_of(path)) in kinds:
            yield path, kind


def _below(folder: Path, depth: int | None) -> Iterator[Path]:
    """Yield the readable entries below a folder; links to folders are not followed."""
    for above, inside, names in os.walk(folder):
        parent = Path(above)
        below = len(parent.relative_to(folder).parts) + 1
        if depth is None or below == depth:
            yield from (parent / name for name in (*inside, *names))
        if below == depth:
            inside.clear()
        inside.sort()


def names(kind: str) -> list[str]:
    """Return the names that `find` accepts for a kind of file, without duplicates."""
    matching = (
        path.relative_to(folder).with_suffix("").as_posix()
        for folder in folders()
        for path, _ in files(folder, [kind], depth=2)
    )
    return list(dict.fromkeys(matching))


def named(name: str | Path, kind: str = "") -> Path | None:
    """Return the file with a name, in the working folder or a folder of scenarios, None if there is none."""
    return _first(name, "", [Path()]) or _first(name, kind, folders())


def beside(file: Path, name: str, kind: str) -> Path:
    """Return the file that another one names: by a relative path, else by its name in a folder of scenarios.

    If there is none, what the path would be.
    """
    path = Path(os.path.normpath(file.parent / name))
    if Path(name).suffix in ENDINGS or os.path.exists(path):
        return path
    if near := _first(path.name, "", [path.parent]):
        return near
    found = _first(name, kind, folders())
    return found.absolute() if found else path


def _first(name: str | Path, kind: str, bases: list[Path]) -> Path | None:
    """Return the first file with a name in some folders, of each those in its folder for the kind first."""
    homes = dict.fromkeys((HOMES.get(kind, ""), ""))
    candidates = (base / home / f"{name}{ending}" for base in bases for home in homes for ending in ENDINGS)
    return next(filter(os.path.isfile, candidates), None)


def placed(folder: Path, name: str, kind: str) -> Path:
    """Return the file that one in a folder names: the relative path as it is if it leads somewhere."""
    path = folder / name
    return path if os.path.exists(path) else beside(folder / "file", name, kind)


def find(source: str | Path, kind: str) -> Path:
    """Find a file by its path, or by its name in a folder of scenarios.

    A path with the suffix of such a file is returned unchanged even if the file does not exist.

    Raises:
        ScenarioError: there is no such file; the message names existing ones.
    """
    path = Path(source)
    if os.path.isdir(path):
        raise ScenarioError(f"{source}: {_what_is_in(path, kind)}", code="scenario-unknown")
    if os.path.exists(path):
        return path
    if file := named(source, kind):
        return file
    known = [name.removeprefix(f"{HOMES.get(kind)}/") for name in names(kind)]
    elsewhere = [name for name in known if path.stem == name.rpartition("/")[2]]
    if (path.suffix in ENDINGS and not elsewhere) or path.suffix.lower() in (*ARCHIVES, FMU):
        return path
    for folder in (base / path for base in folders()):
        if os.path.isdir(folder):
            raise ScenarioError(f"{source}: {_what_is_in(folder, kind)}", code="scenario-unknown")
    others = hint(str(source), elsewhere or known, lead="by name there are")
    what = kind.partition(" ")[2]
    raise ScenarioError(f"there is no {what} {short(str(source))}{others}", code="scenario-unknown")


def _what_is_in(folder: Path, kind: str) -> str:
    """Describe a folder that was given instead of a file, and suggest what could be meant."""
    if (folder / "run.json").is_file():
        return f"these are the results of a run, not {kind}; 'yawbench plot {folder}' draws them"
    for depth in (1, 2):
        if paths := [str(path) for path, _ in files(folder, [kind], depth=depth)]:
            return f"a folder, not {kind}; in it there are: {listed(paths)}"
    for other, command in COMMANDS.items():
        if paths := [str(path) for path, _ in files(folder, [other])]:
            return f"a folder without {kind}; 'yawbench {command}' takes {listed(paths, last='or')}"
    known = names(kind)
    return f"a folder without {kind}{f'; by name there are: {listed(known)}' if known else ''}"


def _from_here(path: Path) -> Path:
    """Return a path relative to the working folder if it is below it."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path

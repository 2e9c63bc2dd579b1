"""`yawbench new`: files to begin with, for somebody who brings an idea."""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ..scaffold.beginnings import KINDS

if TYPE_CHECKING:
    from ..scaffold.beginnings import Beginning


Kind = Literal[KINDS]  # type: ignore[valid-type]
What = Annotated[Kind, typer.Argument(help="What to write.", metavar="KIND")]  # type: ignore[valid-type]
Name = Annotated[str, typer.Argument(help="Its name: lower-case letters, digits and _.", metavar="NAME")]
Written = Annotated[Literal["python", "c"], typer.Option("--language", help="Language of a controller.")]
Project = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="DIR",
        help="Folder of the project; default: the checkout you are in, else this folder.",
    ),
]


def new(kind: What, name: Name, language: Written = "python", out: Project = None) -> None:
    """Write a starting point that works as it stands.

    KIND is a unit (controller, driver, reference, tyre, plant, road), written with its test and a scenario
    that uses it; a vehicle with a scenario; a scenario; or a study or sweep of one. The next steps are
    printed. In a checkout of yawbench the files are put among its own, where `yawbench build` finds them;
    elsewhere into folders controllers, tests, scenarios and so on. Nothing is ever overwritten.
    """
    from fmus.build import COMPONENTS, find_recipes

    from ..errors import ScenarioError
    from ..scaffold.beginnings import begin, write_new
    from ..scaffold.names import check_name
    from .batch import say

    check_name(name, role=kind, taken=set(find_recipes()))
    if language == "c" and kind != "controller":
        raise ScenarioError("--language c: only a controller can be begun in C")
    root = COMPONENTS.parent
    checkout = root if (root / "scenarios").is_dir() else None  # None: installed without them
    here = checkout is not None and Path.cwd().resolve().is_relative_to(checkout)
    folder = out or (checkout if checkout is not None and here else Path())
    in_checkout = folder.resolve() == checkout
    beginning = begin(kind, name, language, in_checkout=in_checkout)
    also = [beginning.source] if beginning.source else []
    write_new(beginning.files, folder, also=also)
    for path in beginning.files:
        say(f"wrote {_shown(folder / path)}")
    say("Next:")
    for command in _next(kind, name, beginning, folder, in_checkout):
        print(shlex.join(command))


def _next(kind: str, name: str, begun: Beginning, folder: Path, in_checkout: bool) -> list[list[str]]:
    """Return the commands that build, test and run what has been written."""
    from ..scaffold.beginnings import MORE, UNITS

    yawbench, python = _program("yawbench"), _program("python")
    fmus = [] if in_checkout else ["--out", str(_shown(folder / "fmus"))]
    commands = [[yawbench, "build", *fmus]]
    if begun.source and not in_checkout:
        commands.append([yawbench, "build", str(_shown(folder / begun.source)), *fmus])
    if begun.test:
        if importlib.util.find_spec("pytest") is None:
            commands.append([python, "-m", "pip", "install", "pytest"])
        commands.append([python, "-m", "pytest", str(_shown(folder / begun.test))])
    main = str(_shown(folder / begun.main))
    commands.append([yawbench, kind if kind in ("study", "sweep") else "run", main])
    if begun.source:
        other = "controller_off" if kind == "controller" else (UNITS | MORE)[kind][0]
        commands.append([yawbench, "compare", main, "--swap", f"{kind}={other},{kind}_{name}"])
    return commands


def _shown(path: Path) -> Path:
    """Return a path as somebody would type it here."""
    relative = Path(os.path.relpath(path))
    return path.absolute() if relative.parts[:1] == ("..",) else relative


def _program(name: str) -> str:
    """Return how to call a program of this environment from here."""
    ours = Path(sys.executable).with_name(name)
    found = shutil.which(name)
    if not ours.exists() or (found is not None and os.path.samefile(found, ours)):
        return name
    return str(_shown(ours))

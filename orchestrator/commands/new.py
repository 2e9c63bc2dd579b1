"""`yawbench new`: files to begin with, for somebody who brings an idea."""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import sys
from enum import Enum
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ..scaffold.controller import Layout


class Kind(str, Enum):
    """What can be begun with."""

    controller = "controller"


class Language(str, Enum):
    """What its source is written in."""

    python = "python"
    c = "c"


What = Annotated[Kind, typer.Argument(help="What to begin: a controller.", metavar="controller")]
Name = Annotated[str, typer.Argument(help="Its name: lower-case letters, digits and _.", metavar="NAME")]
Written = Annotated[Language, typer.Option("--language", help="What it is written in.")]
Project = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="DIR",
        help="Folder of the project; default: the checkout you are in, else this folder.",
    ),
]


def new(kind: What, name: Name, language: Written = Language.python, out: Project = None) -> None:
    """Write a working controller, its test and a scenario.

    What to do next is printed. In a checkout of yawbench the files stand among its own, so
    `yawbench build` finds them; elsewhere in folders controllers, tests and scenarios. Nothing is
    ever overwritten.
    """
    from fmus.build import COMPONENTS, find_recipes

    from ..scaffold.controller import controller_files, layout, write_new
    from ..scaffold.names import check_name
    from .batch import say

    check_name(name, role=kind.value, taken=set(find_recipes()))
    root = COMPONENTS.parent
    checkout = root if (root / "scenarios").is_dir() else None  # None: installed without them
    here = checkout is not None and Path.cwd().resolve().is_relative_to(checkout)
    folder = out or (checkout if checkout is not None and here else Path())
    places = layout(name, language.value, in_checkout=folder.resolve() == checkout)
    files = controller_files(name, language.value, places)
    write_new(files, folder, also=[places.source])
    for path in files:
        say(f"wrote {_shown(folder / path)}")
    say("Next:")
    for command in _next(name, places, folder):
        print(shlex.join(command))


def _next(name: str, places: Layout, folder: Path) -> list[list[str]]:
    """Return the commands that build, test, run and compare a new controller."""
    yawbench = _program("yawbench")
    python = _program("python")
    source, test, scenario = (str(_shown(folder / path)) for path in _paths(places))
    commands = []
    if places.in_checkout:
        commands.append([yawbench, "build"])
    else:
        fmus = str(_shown(folder / "fmus"))
        commands += [[yawbench, "build", "--out", fmus], [yawbench, "build", source, "--out", fmus]]
    if importlib.util.find_spec("pytest") is None:
        commands.append([python, "-m", "pip", "install", "pytest"])
    commands.append([python, "-m", "pytest", test])
    commands.append([yawbench, "run", scenario])
    against = f"controller=controller_off,controller_{name}"
    commands.append([yawbench, "compare", scenario, "--swap", against])
    return commands


def _paths(places: Layout) -> tuple[PurePosixPath, PurePosixPath, PurePosixPath]:
    return places.source, places.test, places.scenario


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

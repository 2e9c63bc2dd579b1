"""`yawbench build`: make the components into FMUs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from ..errors import BuildError

Components = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[COMPONENT]...",
        help="What to build: names of FMUs (controller_fnn), Python files, folders of units in C; "
        "default: every component.",
    ),
]
Target = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder for the FMUs; default: fmus/ beside components/."),
]
Force = Annotated[bool, typer.Option("--force", help="Build also what has not changed.")]


def build(components: Components = None, out: Target = None, force: Force = False) -> None:
    """Build the FMUs whose sources have changed."""
    from fmus.build import HERE, build_all, build_component, find_components
    from fmus.c.build import build_all_c, build_c, find_c_components

    target = out or HERE
    in_python, in_c = find_components(), find_c_components()
    named = list(components or ())
    names = [name for name in named if name in in_python or name in in_c]
    for name in named:
        if name in names:
            continue
        if not name.endswith(".py") and not Path(name).is_dir():
            known = ", ".join(sorted([*in_python, *in_c]))
            raise typer.BadParameter(f"there is no component {name!r}; there are: {known}")
        fmu = (build_component if name.endswith(".py") else build_c)(Path(name), target, force=force)
        print(f"{fmu.stem}: built from {name}", file=sys.stderr)
    if named and not names:
        return
    problems: list[str] = []
    built = current = 0
    for every, known_to_it in ((build_all, in_python), (build_all_c, in_c)):
        chosen = [name for name in names if name in known_to_it] if names else None
        if chosen == []:
            continue
        try:
            report = every(target, components=chosen, force=force, progress=_show)
        except BuildError as error:
            problems += error.problems
            continue
        built, current = built + len(report.built), current + len(report.current)
        if report.warning and report.built:
            why = f"these FMUs load in Python only, they have no launcher: {report.warning}"
            print(f"warning: {why}", file=sys.stderr)
    if problems:
        raise BuildError(problems)
    if current:
        print(f"{current} of {built + current} FMUs up to date", file=sys.stderr)


def _show(name: str, what: str) -> None:
    if what != "current":
        print(f"{name}: {what}", file=sys.stderr)

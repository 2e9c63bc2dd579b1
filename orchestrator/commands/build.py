"""`yawbench build`: make the components into FMUs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

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
    typer.Option(
        "--out", metavar="DIR", help="Folder for the FMUs; default: fmus/ of a checkout, else the cache."
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Build even what has not changed.")]


def build(components: Components = None, out: Target = None, force: Force = False) -> None:
    """Build the FMUs whose sources have changed."""
    from fmus.build import HERE, build_all, build_component, find_recipes
    from fmus.upkeep import place_of

    target = out or place_of(HERE)
    if out is None and target != HERE:
        print(f"FMUs go to {target}", file=sys.stderr)

    from orchestrator.wording import hint

    known = find_recipes()
    named = list(components or ())
    for name in named:
        if name in known:
            continue
        if not name.endswith(".py") and not Path(name).is_dir():
            raise typer.BadParameter(
                f"there is no component {name!r}{hint(name, sorted(known), lead='there are')}"
            )
        if not Path(name).exists():
            raise typer.BadParameter(f"{name}: there is no such file; name a component or its Python file")
        fmu = build_component(Path(name), target, force=force)
        print(f"{fmu.stem}: built from {name}", file=sys.stderr)
    names = [name for name in named if name in known]
    if named and not names:
        return
    report = build_all(target, components=names or None, force=force, progress=tell_of_build)
    if report.warning:
        why = f"these FMUs load in Python only, they have no launcher: {report.warning}"
        print(f"warning: {why}", file=sys.stderr)
    for name, why in report.in_python.items():
        print(f"{name} runs in Python: {why}", file=sys.stderr)
    if report.current:
        total = len(report.built) + len(report.current)
        print(f"{len(report.current)} of {total} FMUs up to date", file=sys.stderr)


def tell_of_build(name: str, what: str) -> None:
    """Say what became of an FMU, unless nothing had to be done."""
    if what != "current":
        print(f"{name}: {what}", file=sys.stderr)

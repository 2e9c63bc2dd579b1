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
        help="What to build: names of FMUs (controller_fnn) or Python files; default: every component.",
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

    target = out or HERE
    files = [name for name in components or () if name.endswith(".py")]
    names = [name for name in components or () if name not in files]
    known = find_components()
    for name in names:
        if name not in known:
            raise typer.BadParameter(f"there is no component {name!r}; there are: {', '.join(known)}")
    for name in files:
        fmu = build_component(Path(name), target, force=force)
        print(f"{fmu.stem}: built from {name}", file=sys.stderr)
    if files and not names:
        return
    report = build_all(target, components=names or None, force=force, progress=_show)
    if report.warning and report.built:
        print(
            f"warning: these FMUs load in Python only, they have no launcher: {report.warning}",
            file=sys.stderr,
        )
    if report.current:
        print(
            f"{len(report.current)} of {len(report.built) + len(report.current)} FMUs up to date",
            file=sys.stderr,
        )


def _show(name: str, what: str) -> None:
    if what != "current":
        print(f"{name}: {what}", file=sys.stderr)

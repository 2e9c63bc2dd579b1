"""`yawbench build`: build FMUs whose sources have changed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from yawbench.fmus.archive import runs_as
from yawbench.fmus.opener import PackagedComponent

from .output import say

Components = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[COMPONENT]...",
        help="What to build: names of FMUs (controller_fnn), Python files, folders of components in C; "
        "default: every component.",
    ),
]
BuildFolder = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="DIR", help="Folder for the FMUs. Default: fmus/ of a checkout, else the cache."
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Also build FMUs whose sources have not changed.")]


def build(components: Components = None, out: BuildFolder = None, force: Force = False) -> None:
    """Build the FMUs whose sources have changed."""
    from yawbench.fmus.build import HERE, build_all, build_component, find_recipes
    from yawbench.fmus.rebuild_stale import build_folder

    target = out or build_folder(HERE)
    if out is None and target != HERE:
        say(f"FMUs go to {target}")

    from yawbench.fmus.opener import hidden, packaged, packaged_components
    from yawbench.foundation.messages import hint

    known = find_recipes()
    named = [*(components or ())]
    for name in named:
        if name in known:
            continue
        if component := packaged(name):
            _build_packaged(component, force=force)
            continue
        if not name.endswith(".py") and not Path(name).is_dir():
            raise typer.BadParameter(
                f"there is no component {name!r}{hint(name, sorted(known), lead='there are')}"
            )
        if not Path(name).exists():
            raise typer.BadParameter(f"{name}: there is no such file; name a component or its Python file")
        fmu = build_component(Path(name), target, force=force)
        say(f"{fmu.stem}: built from {name}")
        if (how := runs_as(fmu)) and (how.why or how.note):
            say(f"{fmu.stem} runs in Python: {how.why}" if how.why else f"{fmu.stem}: {how.note}")
    for warning in hidden(packaged_components(), target, packages=True):
        say(f"warning: {warning}")
    names = [name for name in named if name in known]
    if named and not names:
        return
    report = build_all(target, components=names or None, force=force, progress=report_build)
    if report.warning:
        why = f"these FMUs load in Python only, as they have no launcher: {report.warning}"
        say(f"warning: {why}")
    for name, why in report.in_python.items():
        say(f"{name} runs in Python: {why}")
    if len(report.notes) == 1:
        say(*(f"{name}: {note}" for name, note in report.notes.items()))
    elif report.notes:
        words = "have branches in native code that were never compared with Python: yawbench list --units"
        say(f"{len(report.notes)} FMUs {words}")
    for component in map(packaged, [] if named else packaged_components()):
        if component:
            _build_packaged(component, force=force)
    if report.current:
        total = len(report.built) + len(report.current)
        say(f"{len(report.current)} of {total} FMUs up to date")


def _build_packaged(component: PackagedComponent, *, force: bool) -> None:
    from yawbench.fmus.build import build_component

    fmu = build_component(component.source, component.archive.parent, force=force)
    say(f"{fmu.stem} of {component}: {fmu}")


def report_build(name: str, what: str) -> None:
    """Report the result of building an FMU, unless it was up to date."""
    if what != "current":
        say(f"{name}: {what}")

"""`yawbench build`: build FMUs whose sources have changed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from yawbench.fmus.archive import runs_as
from yawbench.fmus.build_stamp import Edition
from yawbench.fmus.compiler import OWN, PLATFORMS, TO_WINDOWS
from yawbench.fmus.opener import PackagedComponent

from .terminal_progress import say

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
        "--out",
        metavar="DIR",
        help="Folder for the FMUs. Default: fmus/ of a checkout, else the cache; fmi3/ in it with --fmi 3.",
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Also build FMUs whose sources have not changed.")]
Version = Annotated[
    Literal["2", "3"],
    typer.Option("--fmi", help="Version of FMI. Components that run in Python are FMI 2.0 only."),
]
Platforms = Annotated[
    list[str] | None,
    typer.Option(
        "--platform",
        metavar="NAME",
        help=f"Further platform of native libraries: {', '.join(PLATFORMS)}, or all; repeatable. Windows is "
        "always included where MinGW-w64 is installed.",
    ),
]
WithSources = Annotated[
    bool, typer.Option("--sources", help="Add the sources in C, from which a host can compile the library.")
]


def build(
    components: Components = None,
    out: BuildFolder = None,
    force: Force = False,
    fmi: Version = "2",
    platform: Platforms = None,
    sources: WithSources = False,
) -> None:
    """Build the FMUs whose sources have changed."""
    from yawbench.fmus.build import HERE, build_all, build_component, find_recipes
    from yawbench.fmus.rebuild_stale import build_folder

    edition = Edition(int(fmi), _platforms(platform or []), sources)
    target = out or build_folder(HERE)
    if out is None and fmi == "3":
        target = target / "fmi3"
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
            _build_packaged(component, force=force, edition=edition)
            continue
        if not name.endswith(".py") and not Path(name).is_dir():
            raise typer.BadParameter(
                f"there is no component {name!r}{hint(name, sorted(known), lead='there are')}"
            )
        if not Path(name).exists():
            raise typer.BadParameter(f"{name}: there is no such file; name a component or its Python file")
        fmu = build_component(Path(name), target, force=force, edition=edition)
        say(f"{fmu.stem}: built from {name}")
        if (how := runs_as(fmu)) and (how.why or how.note):
            say(f"{fmu.stem} runs in Python: {how.why}" if how.why else f"{fmu.stem}: {how.note}")
    for warning in hidden(packaged_components(), target, packages=True):
        say(f"warning: {warning}")
    names = [name for name in named if name in known]
    if named and not names:
        return
    report = build_all(target, components=names or None, force=force, progress=report_build, edition=edition)
    if report.warning:
        why = f"these FMUs load in Python only, as they have no launcher: {report.warning}"
        say(f"warning: {why}")
    for name, why in report.only_fmi2.items():
        say(why if why.startswith(f"{name}: ") else f"{name}: {why}")
    if report.not_on_windows:
        without = f"{len(report.not_on_windows)} FMUs have no native library for Windows"
        say(f"{without}; 'yawbench build --platform {TO_WINDOWS.name}' makes them, with MinGW-w64 or Zig")
    for name, why in report.in_python.items():
        say(f"{name} runs in Python: {why}")
    if len(report.notes) == 1:
        say(*(f"{name}: {note}" for name, note in report.notes.items()))
    elif report.notes:
        words = "have branches in native code that were never compared with Python: yawbench list --units"
        say(f"{len(report.notes)} FMUs {words}")
    for component in map(packaged, [] if named else packaged_components()):
        if component:
            _build_packaged(component, force=force, edition=edition)
    if report.current:
        total = len(report.built) + len(report.current)
        say(f"{len(report.current)} of {total} FMUs up to date")


def _platforms(names: list[str]) -> tuple[str, ...]:
    wrong = [name for name in names if name not in (*PLATFORMS, "all")]
    if wrong:
        raise typer.BadParameter(f"there is no platform {wrong[0]!r}; there are: {', '.join(PLATFORMS)}, all")
    return tuple(sorted({*(PLATFORMS if "all" in names else names)} - {OWN.name}))


def _build_packaged(component: PackagedComponent, *, force: bool, edition: Edition) -> None:
    from yawbench.fmus.build import build_component

    folder = component.archive.parent / "fmi3" if edition.fmi == 3 else component.archive.parent
    fmu = build_component(component.source, folder, force=force, edition=edition)
    say(f"{fmu.stem} of {component}: {fmu}")


def report_build(name: str, what: str) -> None:
    """Report the result of building an FMU, unless it was up to date."""
    if what != "current":
        say(f"{name}: {what}")

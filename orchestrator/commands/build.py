"""`yawbench build` and `yawbench cache`: build FMUs from components; manage the cache."""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

from .progress import say

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
    from fmus.build import HERE, build_all, build_component, find_recipes
    from fmus.upkeep import build_folder

    target = out or build_folder(HERE)
    if out is None and target != HERE:
        say(f"FMUs go to {target}")

    from orchestrator.messages import hint

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
        say(f"{fmu.stem}: built from {name}")
    names = [name for name in named if name in known]
    if named and not names:
        return
    report = build_all(target, components=names or None, force=force, progress=report_build)
    if report.warning:
        why = f"these FMUs load in Python only, as they have no launcher: {report.warning}"
        say(f"warning: {why}")
    for name, why in report.in_python.items():
        say(f"{name} runs in Python: {why}")
    if report.current:
        total = len(report.built) + len(report.current)
        say(f"{len(report.current)} of {total} FMUs up to date")


def report_build(name: str, what: str) -> None:
    """Report the result of building an FMU, unless it was up to date."""
    if what != "current":
        say(f"{name}: {what}")


Action = Literal["show", "verify", "clear"]
CacheAction = Annotated[
    Action,
    typer.Argument(
        help="show: list contents and sizes; verify: check every byte and delete damaged entries; "
        "clear: delete everything.",
    ),
]


def cache(action: CacheAction = "show") -> None:
    """Show, verify or clear the cache.

    Unpacked FMUs, the compiled launcher, keys of sources, and FMUs whose own folder cannot be
    written. Deleted entries are made again when needed.
    Nothing is deleted while another command uses the cache.
    """
    from ..cache_and_checksums import alone_in, cache_folders
    from ..fmu.archive import kept_in, remove

    damaged, in_use = 0, False
    for folder in cache_folders():
        if not os.access(folder, os.R_OK | os.X_OK):
            continue
        print(folder)
        with contextlib.nullcontext(True) if action == "show" else alone_in(folder) as alone:
            for kind, entries in kept_in(folder).items():
                size = sum(entry.size for entry in entries)
                unwanted = [
                    one for one in entries if action == "clear" or (action == "verify" and not one.whole())
                ]
                for entry in unwanted if alone else ():
                    remove(entry.path)
                damaged += len(unwanted)
                also = f", {len(unwanted)} {'deleted' if alone else 'kept'}" if unwanted else ""
                print(f"  {kind}: {len(entries)}, {size / 1e6:.1f} MB{also}")
                if unwanted and not alone:
                    in_use = True
        if not alone:
            print(f"{folder}: in use by another command, nothing was deleted", file=sys.stderr)
    if action == "verify":
        print(f"damaged: {damaged}" if damaged else "no entry is damaged", file=sys.stderr)
    if in_use:
        raise typer.Exit(1)

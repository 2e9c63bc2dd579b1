"""`yawbench build`, `cache` and `list`: build FMUs, manage the cache, list runs, scenarios, FMUs, ..."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import typer

from yawbench.fmus.archive import runs_as
from yawbench.fmus.opener import Building, PackagedComponent
from yawbench.foundation.errors import ModelDescriptionError

from .options import RunOptions, plan_of_scenario, takes
from .output import print_tables, say, tabular

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


CacheAction = Annotated[
    Literal["show", "clear"],
    typer.Argument(help="show: list contents and sizes; clear: delete everything."),
]


def cache(action: CacheAction = "show") -> None:
    """Show or clear the cache.

    Unpacked FMUs, compiled libraries, keys of sources, and FMUs whose own folder cannot be
    written. Deleted entries are made again when needed.
    Nothing is deleted while another command uses the cache.
    """
    from yawbench.fmus.archive import kept_in, size_of
    from yawbench.foundation.cache import alone_in, cache_folders, remove

    in_use = False
    for folder in cache_folders():
        if not os.access(folder, os.R_OK | os.X_OK):
            continue
        print(folder)
        clears = action == "clear"
        with alone_in(folder) if clears else contextlib.nullcontext(True) as alone:
            for kind, entries in kept_in(folder).items():
                size = sum(map(size_of, entries))
                for entry in entries if clears and alone else ():
                    remove(entry)
                also = f", {len(entries)} {'deleted' if alone else 'kept'}" if clears else ""
                print(f"  {kind}: {len(entries)}, {size / 1e6:.1f} MB{also}")
                in_use = in_use or not alone
        if not alone:
            print(f"{folder}: in use by another command, nothing was deleted", file=sys.stderr)
    if in_use:
        raise typer.Exit(1)


Wanted = Annotated[
    Literal["runs", "scenarios", "fmus", "vehicles", "signals", "metrics"] | None,
    typer.Argument(help="What to list. Default: scenarios and vehicles.", metavar="WHAT"),
]
SCENARIOS = ("a scenario", "a study file", "a sweep file")
VEHICLES = ("a vehicle file",)
ListedFolder = Annotated[
    Path | None,
    typer.Argument(
        help="Folder to search for runs, scenarios, FMUs or vehicles; default: results, scenarios, or "
        "the nearest fmus. For signals: a scenario; default: all FMUs.",
        metavar="PLACE",
    ),
]


Units = Annotated[
    bool,
    typer.Option("--units", help="List FMUs and whether each runs natively, or why it runs in Python."),
]


@tabular
@takes("fmus")
def list(options: RunOptions, what: Wanted = None, place: ListedFolder = None, units: Units = False) -> None:
    """List runs, scenarios, FMUs, vehicles, signals or metrics.

    Runs are listed with their start time, scenario, overrides, status, and the largest sideslip, yaw rate
    and lateral acceleration.
    """
    from yawbench.fmus.opener import hidden
    from yawbench.orchestrator.results.reader import found_runs
    from yawbench.orchestrator.scenario import loader
    from yawbench.studies.listings import (
        files_table,
        fmus_in,
        fmus_table,
        metrics_table,
        recorded_table,
        runs_table,
        signals_table,
        units_table,
    )

    further = [] if place or options.fmus else _further_folders(build=options.build)
    if units:
        fmus, errors = fmus_in(_folder_of_fmus(place or options.fmus), *further)
        table = units_table(fmus)
        table.notes += map(str, errors)
        print_tables([table])
        return
    if what is None:
        tables = [files_table(None, kinds) for kinds in (SCENARIOS, VEHICLES)]
        tables[-1].notes.append("'yawbench list' also lists runs, fmus, signals and metrics.")
        print_tables(tables)
        return
    if what == "runs":
        table = runs_table(found_runs(place or Path("results")))
    elif what == "scenarios":
        table = files_table(place, SCENARIOS)
    elif what == "vehicles":
        table = files_table(place, VEHICLES)
    elif what == "metrics":
        table = metrics_table()
    elif what == "signals" and place is not None:
        scenario = loader.find(place, "a scenario")
        table = recorded_table(plan_of_scenario(scenario, options))
    else:
        folder = _folder_of_fmus(place or options.fmus)
        fmus, errors = fmus_in(folder, *further)
        if further:
            errors += hidden((fmu.path.stem for fmu in fmus), folder, packages=True)
        table = fmus_table(fmus, errors)
        if what == "signals":
            table = signals_table(fmus)
    print_tables([table])


def _further_folders(*, build: Building) -> Sequence[Path]:
    """Return the folders of FMUs that the environment names, and those of packages, whose FMUs are built."""
    from yawbench.fmus.opener import Opener, further_folders, packaged, packaged_components

    opener = Opener(build=build)
    components = [component for name in packaged_components() if (component := packaged(name))]
    archives = [opener.bring_packaged(component) for component in components]
    return [*dict.fromkeys([*further_folders(), *(archive.parent for archive in archives)])]


def _folder_of_fmus(folder: Path | None) -> Path:
    """Return the given or the nearest folder of FMUs; if there is none, build the project's FMUs."""
    from yawbench.fmus.build import build_all
    from yawbench.fmus.opener import HOME, Opener, find_folder
    from yawbench.fmus.rebuild_stale import build_folder

    if folder is None:
        folder = find_folder(Path("here"), opener=Opener(build=True))
        if folder == HOME:
            folder = build_folder(HOME)
            build_all(folder, progress=report_build)
        return folder
    if not any(folder.glob("*.fmu")):
        raise ModelDescriptionError(f"{folder}: contains no FMUs", code="fmu-missing")
    return folder

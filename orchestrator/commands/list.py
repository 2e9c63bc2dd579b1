"""`yawbench list`: runs, scenarios, FMUs, vehicles, signals and metrics."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from .options import RunOptions, plan_of_scenario, takes

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


@takes("fmus")
def list(options: RunOptions, what: Wanted = None, place: ListedFolder = None, units: Units = False) -> None:
    """List runs, scenarios, FMUs, vehicles, signals or metrics.

    Runs are listed with their start time, scenario, overrides, status, and the largest sideslip, yaw rate
    and lateral acceleration.
    """
    from ..experiments.tables import (
        files_table,
        fmus_in,
        fmus_table,
        metrics_table,
        recorded_table,
        runs_table,
        signals_table,
        units_table,
    )
    from ..results.read_and_salvage import found_runs
    from ..scenario import find_and_load
    from .progress import print_tables

    if units:
        found, errors = fmus_in(_folder_of_fmus(place or options.fmus))
        table = units_table(found)
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
        scenario = find_and_load.find(place, "a scenario")
        table = recorded_table(plan_of_scenario(scenario, options))
    else:
        found, errors = fmus_in(_folder_of_fmus(place or options.fmus))
        table = fmus_table(found, errors)
        if what == "signals":
            table = signals_table(found)
    print_tables([table])


def _folder_of_fmus(folder: Path | None) -> Path:
    """Return the given or the nearest folder of FMUs; if there is none, build the project's FMUs."""
    from fmus.build import build_all
    from fmus.upkeep import build_folder

    from ..errors import ModelDescriptionError
    from ..fmu.opener import HOME, Opener, find_folder
    from .build import report_build

    if folder is None:
        folder = find_folder(Path("here"), opener=Opener(build=True))
        if folder == HOME:
            folder = build_folder(HOME)
            build_all(folder, progress=report_build)
        return folder
    if not any(folder.glob("*.fmu")):
        raise ModelDescriptionError(f"{folder}: contains no FMUs", code="fmu-missing")
    return folder

"""`yawbench list`: runs, scenarios, FMUs, vehicles, signals, metrics (tables: `studies.listings`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import typer

from yawbench.commands.json_and_latex import tabular
from yawbench.commands.options import RunOptions, plan_of_scenario, takes
from yawbench.commands.output import print_tables
from yawbench.foundation.errors import ModelDescriptionError

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
    and lateral acceleration. Nothing is built.
    """
    from yawbench.fmus.opener import hidden
    from yawbench.orchestrator.results.reader import found_runs
    from yawbench.orchestrator.scenario import catalogue
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

    further, missing = ([], []) if place or options.fmus else _further_folders()
    if units:
        fmus, errors = fmus_in(_folder_of_fmus(place or options.fmus), *further)
        table = units_table(fmus)
        table.notes += [*map(str, errors), *missing]
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
        scenario = catalogue.find(place, "a scenario")
        table = recorded_table(plan_of_scenario(scenario, replace(options, no_build=True)))
    else:
        folder = _folder_of_fmus(place or options.fmus)
        fmus, errors = fmus_in(folder, *further)
        if further:
            errors += hidden((fmu.path.stem for fmu in fmus), folder, packages=True)
        table = fmus_table(fmus, errors)
        table.notes += missing
        if what == "signals":
            table = signals_table(fmus)
    print_tables([table])


def _further_folders() -> tuple[Sequence[Path], Sequence[str]]:
    """Return the folders of FMUs that the environment names and those of packages, and what is not built."""
    from yawbench.fmus.opener import further_folders, packaged, packaged_components

    components = [component for name in packaged_components() if (component := packaged(name))]
    built = [component.archive for component in components if component.archive.is_file()]
    missing = [
        f"{component.fmu} of {component} is not built: yawbench build {component.fmu}"
        for component in components
        if component.archive not in built
    ]
    return [*dict.fromkeys([*further_folders(), *(archive.parent for archive in built)])], missing


def _folder_of_fmus(folder: Path | None) -> Path:
    """Return the given or the nearest folder of FMUs.

    Raises:
        ModelDescriptionError: it contains none.
    """
    from yawbench.fmus.opener import HOME, Opener, find_folder
    from yawbench.fmus.rebuild_stale import build_folder

    advice = ""
    if folder is None:
        folder = find_folder(Path("here"), opener=Opener())
        if folder == HOME:
            folder = build_folder(HOME)
            advice = "; 'yawbench build' makes them"
    if not any(folder.glob("*.fmu")):
        raise ModelDescriptionError(f"{folder}: contains no FMUs{advice}", code="fmu-missing")
    return folder

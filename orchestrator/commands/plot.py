"""`yawbench plot`: draw figures of recorded results, or of a scenario's run."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import CallLimit, Fmus, Isolate, NoBuild, Out, Set, Swap, isolation

if TYPE_CHECKING:
    from ..plan import Change

Sources = Annotated[
    list[Path],
    typer.Argument(
        help="Folders of results, or scenario files; several are laid over each other.", metavar="RESULTS..."
    ),
]
Labels = Annotated[
    list[str] | None,
    typer.Option("--label", metavar="TEXT", help="Label of a run in the legend, in the order of RESULTS."),
]
Panels = Annotated[
    list[str] | None,
    typer.Option(
        "--panel",
        metavar="NAME",
        help="A signal (yaw_rate, plant.roll_angle, wheel_torque_*), its error (sideslip_error), one over "
        "another (yaw_rate(sideslip)) or path; repeatable. Default: all the papers draw.",
    ),
]


SCENARIOS = (".yaml", ".yml", ".ssp")
"""Endings of files that are scenarios."""


def plot(
    sources: Sources,
    label: Labels = None,
    panel: Panels = None,
    swap: Swap = None,
    set_: Set = None,
    out: Out = None,
    fmus: Fmus = None,
    no_build: NoBuild = False,
    isolate: Isolate = False,
    call_limit: CallLimit = None,
) -> None:
    """Draw runs, one or several laid over each other.

    Figures are written as SVG and PNG. A scenario is run first if its results (those of `yawbench
    run` without --out) are missing or were made from another scenario or FMU. Without --out, the
    figure of one run goes into its folder, that of several into the folder that holds them all.
    """
    from ..errors import ScenarioError
    from ..figures.panels import Run, check_panels, shown_by
    from ..figures.plots import OVERVIEW, draw
    from ..figures.style import save
    from ..results.read import load_results
    from ..scenario.overrides import read_changes
    from ..studies.compare import FIGURES
    from ..wording import counted
    from .batch import say

    if label and len(label) != len(sources):
        given = f"{counted(len(label), 'label')}, {counted(len(sources), 'folder')}"
        raise ScenarioError(f"--label: needs one for each folder of results ({given})")
    limit = isolation(isolate, call_limit)
    folders = _recorded(sources, read_changes(swap or (), set_ or ()), fmus, limit, build=not no_build)
    labels = label or distinct(folders)
    runs = [Run(name, load_results(folder, thin=True)) for name, folder in zip(labels, folders, strict=True)]
    check_panels(runs, panel or ())
    figures: dict[str, Sequence[str]] = {"overview": panel or OVERVIEW}
    target = folders[0]
    if len(runs) > 1:
        target = Path(os.path.commonpath([folder.absolute().parent for folder in folders]))
        if not panel:
            figures = {name: panels for name, panels in FIGURES.items() if shown_by(runs, panels)}
    for name, panels in figures.items():
        paths = save(draw(runs, panels), (out or target) / name)
        say(f"{paths[0]}, {paths[1].name}")


def _recorded(
    sources: Sequence[Path],
    changes: tuple[Change, ...],
    fmus: Path | None,
    limit: float | None,
    *,
    build: bool,
) -> list[Path]:
    """Return the folders of all results, after making the runs of scenarios that have none.

    Raises:
        ScenarioError: a scenario or an option is wrong.
    """
    from ..errors import ScenarioError
    from ..pages.freshness import staleness
    from ..results.naming import default_folder
    from ..studies.jobs import Job, Once, plan_of
    from .batch import run_all

    scenarios = [source for source in sources if source.suffix in SCENARIOS and not source.is_dir()]
    if changes and not scenarios:
        raise ScenarioError("--swap and --set change a scenario; only folders of results are given")
    jobs, stale, once = {}, [], Once(build=build)
    for source in scenarios:
        plan = plan_of(Job(source.stem, source, Path(), changes, fmus), once)
        job = Job(source.stem, source, default_folder(source, plan.changes), changes, fmus, call_limit=limit)
        jobs[source] = job
        stale += [job] if staleness(plan, job.out) else []
    outcomes = run_all(stale, Path("results"), workers=None, build=build) if stale else []
    for outcome in outcomes:
        if not outcome.ok:
            raise typer.Exit(outcome.exit_status)
    return [jobs[source].out if source in jobs else source for source in sources]


def distinct(folders: Sequence[Path]) -> list[str]:
    """Return the shortest ends of the paths that tell the folders apart."""
    parts = [folder.absolute().parts for folder in folders]
    longest = max(len(p) for p in parts)
    for n in range(1, longest + 1):
        names = ["/".join(p[-n:]) for p in parts]
        if len(set(names)) == len(names):
            return names
    return ["/".join(p[-1:]) for p in parts]

"""Recorded runs that a command is given as folders of results or as scenarios."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from .options import Wishes

Sources = Annotated[
    list[Path],
    typer.Argument(help="Folders of results, or scenarios; several are overlaid.", metavar="RESULTS..."),
]
Labels = Annotated[
    list[str] | None,
    typer.Option("--label", metavar="TEXT", help="Label of a run in the legend, in the order of RESULTS."),
]


def recorded(sources: Sequence[Path], wishes: Wishes) -> list[Path]:
    """Return the folders of all results, after making the runs of scenarios that have none.

    Raises:
        ScenarioError: a scenario or an option is wrong.
    """
    from ..errors import ScenarioError
    from ..experiments.jobs import Job, Once, ready
    from ..experiments.workers import execute
    from ..fmu.opener import stale_fmus
    from ..results.freshness import staleness
    from ..results.naming import default_folder
    from ..scenario import catalogue
    from .batch import reported, say, stoppable

    sources = [one if os.path.exists(one) else catalogue.named(one) or one for one in sources]
    scenarios = [one for one in sources if one.suffix in catalogue.ENDINGS and not os.path.isdir(one)]
    if wishes.changes and not scenarios:
        raise ScenarioError("--swap, --set and --fault change a scenario; only folders of results are given")
    given = [Job(one.stem, one, Path(), wishes.changes, **wishes.of_jobs) for one in scenarios]
    jobs = {}
    for job in ready(given, once=Once(build=wishes.build)):
        assert job.plan is not None
        jobs[job.scenario] = replace(job, out=default_folder(job.scenario, job.plan.changes))
    for note in stale_fmus(unit.fmu for job in jobs.values() if job.plan for unit in job.plan.units):
        say(f"note: {note}")
    stale = [job for job in jobs.values() if job.plan and staleness(job.plan, job.out)]
    with stoppable(Path("results")), reported("", len(stale)) as told:
        outcomes = execute(stale, done=told)
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


def labels_of(folders: Sequence[Path], given: Sequence[str] | None) -> list[str]:
    """Return what the legend calls each run: the labels given, or `distinct`.

    Raises:
        ScenarioError: there are not as many labels as folders.
    """
    from ..errors import ScenarioError
    from ..wording import counted

    if given and len(given) != len(folders):
        counts = f"{counted(len(given), 'label')}, {counted(len(folders), 'folder')}"
        raise ScenarioError(f"--label: needs one for each folder of results ({counts})")
    return list(given or distinct(folders))


def folder_of_all(folders: Sequence[Path]) -> Path:
    """Return where what shows all runs goes: the folder of the only one, or the one that holds them all."""
    if len(folders) == 1:
        return folders[0]
    return Path(os.path.commonpath([folder.absolute().parent for folder in folders]))

"""Recorded runs that commands draw or compare: folders, scenarios that are run first, measurement files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from yawbench.commands.options import RunOptions
from yawbench.commands.terminal_progress import reported, say, stoppable
from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import counted

if TYPE_CHECKING:
    from yawbench.figures.display import LabelledRun
    from yawbench.orchestrator.results.reader import Results


RunSources = Annotated[
    list[Path],
    typer.Argument(
        help="Results folders, scenarios or measurement files; several are overlaid.", metavar="RESULTS..."
    ),
]
Labels = Annotated[
    list[str] | None,
    typer.Option(
        "--label",
        metavar="TEXT",
        help="Label of a run in tables and figures, in the order of runs. Repeatable.",
    ),
]


def recorded(sources: Sequence[Path], options: RunOptions) -> list[Path]:
    """Return the folders of all results, after running scenarios that have none.

    Raises:
        ScenarioError: a scenario or an option is invalid.
    """
    from yawbench.fmus.opener import stale_fmus
    from yawbench.measurements.measured_results import is_measurement, segments_of
    from yawbench.orchestrator.results.folder_names import default_folder
    from yawbench.orchestrator.results.freshness import staleness
    from yawbench.orchestrator.scenario import catalogue
    from yawbench.orchestrator.scenario.catalogue import MEASUREMENT
    from yawbench.planner import Planner
    from yawbench.studies.jobs import Job, execute, ready

    sources = [path if os.path.exists(path) else catalogue.named(path) or path for path in sources]
    endings = (*catalogue.ENDINGS, catalogue.FMU)
    files = [path for path in sources if path.suffix in endings and not os.path.isdir(path)]
    scenarios = [path for path in files if catalogue.kind_of(path) != MEASUREMENT]
    if options.changes and not scenarios:
        raise ScenarioError(
            "--swap, --set and --fault apply to scenarios, not to results folders",
            code="option-invalid",
        )
    wanted = [Job(path.stem, path, Path(), options.changes, **options.of_jobs) for path in scenarios]
    jobs = {}
    for job in ready(wanted, planner=Planner(build=options.build)):
        assert job.plan is not None
        jobs[job.scenario] = replace(job, out=default_folder(job.scenario, job.plan.changes))
    plans = [job.plan for job in jobs.values() if job.plan]
    for note in stale_fmus(instance.fmu for plan in plans for instance in plan.instances):
        say(f"note: {note}")
    stale = [job for job in jobs.values() if job.plan and staleness(job.plan, job.out)]
    with stoppable(Path("results")), reported("", len(stale)) as report:
        outcomes = execute(stale, done=report)
    for outcome in outcomes:
        if not outcome.ok:
            raise typer.Exit(outcome.exit_status)
    folders: list[Path] = []
    for source in sources:
        if source in jobs:
            folders.append(jobs[source].out)
        else:
            folders += segments_of(source) if is_measurement(source) else [source]
    return folders


def distinct(folders: Sequence[Path]) -> list[str]:
    """Return the shortest suffixes of the paths that are different for all folders."""
    parts = [folder.absolute().parts for folder in folders]
    longest = max(len(p) for p in parts)
    for n in range(1, longest + 1):
        names = ["/".join(p[-n:]) for p in parts]
        if len(set(names)) == len(names):
            return names
    return ["/".join(p[-1:]) for p in parts]


def labels_of(folders: Sequence[Path], labels: Sequence[str] | None) -> list[str]:
    """Return the label of each run in a legend: as given, or from `distinct`.

    Raises:
        ScenarioError: the numbers of labels and folders differ.
    """
    if labels and len(labels) != len(folders):
        counts = f"{counted(len(labels), 'label')}, {counted(len(folders), 'folder')}"
        raise ScenarioError(f"--label: give one label per results folder (got {counts})")
    return list(labels or distinct(folders))


def folder_of_all(folders: Sequence[Path]) -> Path:
    """Return the folder for figures of all runs: that of a single run, else their common parent."""
    from yawbench.measurements.measured_results import is_measurement
    from yawbench.orchestrator.results.folder_names import below_results

    if not (own := [folder for folder in folders if not is_measurement(folder)]):
        return below_results("measured", folders[0].stem)
    folders = own
    if len(folders) == 1:
        return folders[0]
    return Path(os.path.commonpath([folder.absolute().parent for folder in folders]))


MeasuredRuns = Annotated[
    list[Path] | None,
    typer.Option(
        "--measured",
        metavar="FILE",
        help="Measurement file, FILE#2 for its second segment: overlaid, dashed; its filter acts on the runs "
        "too. Repeatable.",
    ),
]
MeasuredFrom = Annotated[
    str,
    typer.Option("--from", metavar="TIME", help="Time of the measurements at which the runs begin: '12 s'."),
]


def start_of(begin: str) -> float:
    """Return the time [s] that `--from` gives.

    Raises:
        ScenarioError: it is malformed.
    """
    from yawbench.orchestrator.scenario.quantities import convert

    try:
        return float(convert(begin, "s"))
    except ValueError as error:
        raise ScenarioError(f"--from: {error}", code="option-invalid") from None


def with_segments(folders: Sequence[Path], measured: Sequence[Path] | None) -> list[Path]:
    """Return folders of runs, and the segments of measurement files.

    Raises:
        ResultsError: a file does not exist.
    """
    from yawbench.measurements.measured_results import segments_of

    return [*folders, *(segment for file in measured or () for segment in segments_of(file))]


def read_runs(places: Sequence[Path], start: float, *, thin: bool = False) -> list[Results]:
    """Return runs and measurements, the former filtered like the latter.

    Args:
        places: folders of runs, and measurement files, which begin at `start` [s].
        thin: see `load_results`; not beside a measurement, whose filter needs all rows.

    Raises:
        ResultsError, ScenarioError: one of them cannot be read.
    """
    from yawbench.measurements.measured_results import filtered_alike, is_measurement, load_run

    thin = thin and not any(map(is_measurement, places))
    return filtered_alike([load_run(place, thin=thin, start=start) for place in places])


def labelled(
    labels: Sequence[str], places: Sequence[Path], start: float, *, thin: bool = False
) -> list[LabelledRun]:
    """Return runs and measurements with their labels; see `read_runs`."""
    from yawbench.figures.display import LabelledRun

    return [*map(LabelledRun, labels, read_runs(places, start, thin=thin))]

"""`yawbench animate`: an interactive page of recorded runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from yawbench.commands.options import CHANGES, RunOptions, takes
from yawbench.commands.output import say
from yawbench.commands.recorded_runs import (
    Labels,
    MeasuredFrom,
    MeasuredRuns,
    RunSources,
    folder_of_all,
    labels_of,
    read_runs,
    recorded,
    start_of,
    with_segments,
)
from yawbench.foundation.errors import ResultsError

Page = Annotated[Path | None, typer.Option("--out", metavar="FILE.html", help="Page to write.")]


@takes(*CHANGES, "fmus", "no_build")
def animate(
    sources: RunSources,
    options: RunOptions,
    label: Labels = None,
    measured: MeasuredRuns = None,
    begin: MeasuredFrom = "0 s",
    out: Page = None,
) -> None:
    """Write an interactive page of runs, like `plot --page`.

    Shows all recorded signals with a common cursor, zoom and differences from a baseline, and animates
    cars, paths, lanes, road patches, tyre forces and friction circles. A scenario is run first if its
    results are missing or out of date. Without --out, the page of one run is view.html in its folder,
    that of several goes to their common parent folder.
    """
    start = start_of(begin)
    folders = with_segments(recorded(sources, options), measured)
    write_view(folders, labels_of(folders, label), (), out, start)


def write_view(
    folders: Sequence[Path],
    labels: Sequence[str],
    panels: Sequence[str],
    out: Path | None,
    start: float = 0.0,
) -> None:
    """Write the page of a viewer.

    Args:
        folders: of the runs.
        labels: of the runs.
        panels: signals shown at first; none: those that the papers draw.
        out: the page; default: view.html in the folder of the run, or in that of all runs.
        start: time of measurements [s] at which the runs begin.

    Raises:
        ResultsError: a run cannot be read, or the page cannot be written.
    """
    from yawbench.figures.display import LabelledRun
    from yawbench.foundation.safe_files import write_whole
    from yawbench.reports.viewer import SETTINGS, Settings, page
    from yawbench.reports.viewer_views import View

    read = read_runs(folders, start)
    runs = [LabelledRun(name, results) for name, results in zip(labels, read, strict=True)]
    text = page(runs, Settings((View(panels=panels),)) if panels else SETTINGS)
    file = out or folder_of_all(folders) / "view.html"
    try:
        write_whole(file, text, named=out is not None)
    except OSError as error:
        raise ResultsError(
            f"{file}: cannot write the page: {error.strerror or error}", code="results-unwritable"
        ) from None
    say(f"{file}: {len(text.encode()) / 1000:.0f} kB")

"""`yawbench animate`: an interactive page of recorded runs, or a video of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from yawbench.commands.options import CHANGES, RunOptions, takes
from yawbench.commands.recorded_runs import (
    Labels,
    MeasuredFrom,
    MeasuredRuns,
    RunSources,
    folder_of_all,
    labelled,
    labels_of,
    recorded,
    start_of,
    with_segments,
)
from yawbench.commands.terminal_progress import say
from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.foundation.messages import hint, listed

if TYPE_CHECKING:
    from yawbench.figures.display import LabelledRun

Page = Annotated[
    Path | None, typer.Option("--out", metavar="FILE", help="Page (.html), or video: .gif, .webp, .png.")
]
Camera = Annotated[
    str | None, typer.Option(help="Of a video: chase, side, fixed, orbit, cars or whole. Default: chase.")
]
Speed = Annotated[
    float | None, typer.Option(min=0.01, max=100.0, help="Of a video over that of the cars. Default: 1.")
]


@takes(*CHANGES, "fmus", "no_build")
def animate(
    sources: RunSources,
    options: RunOptions,
    label: Labels = None,
    measured: MeasuredRuns = None,
    begin: MeasuredFrom = "0 s",
    out: Page = None,
    camera: Camera = None,
    speed: Speed = None,
) -> None:
    """Write an interactive page of runs, like `plot --page`, or a video of them.

    Shows all recorded signals with a common cursor, zoom and differences from a baseline, and animates
    cars, paths, lanes, road patches, tyre forces and friction circles, from above and in three dimensions.
    A scenario is run first if its results are missing or out of date. Without --out, the page of one run
    is view.html in its folder, that of several goes to their common parent folder. A video shows what a
    camera of the page does; it needs Chromium. The first run is solid, the others are ghosts.
    """
    from yawbench.reports.video import CAMERAS, FORMATS

    moving = out is not None and out.suffix in FORMATS
    if (camera is not None or speed is not None) and not moving:
        raise ScenarioError(
            f"--camera and --speed are of a video: name one with --out, ending with "
            f"{listed(FORMATS, last='or')}",
            code="option-invalid",
        )
    if camera is not None and camera not in CAMERAS:
        raise ScenarioError(
            f"--camera {camera}: no such camera{hint(camera, CAMERAS, lead='there are')}",
            code="option-invalid",
        )
    start = start_of(begin)
    folders = with_segments(recorded(sources, options), measured)
    runs = labelled(labels_of(folders, label), folders, start)
    if not moving or out is None:
        write_view(runs, (), out, folder_of_all(folders))
        return
    from yawbench.reports.video import write_video

    text = page_of(runs, ())
    count = write_video(text, out, camera=camera or "chase", speed=speed or 1.0)
    say(f"{out}: {count} frames, {out.stat().st_size / 1000:.0f} kB")


def write_view(runs: Sequence[LabelledRun], panels: Sequence[str], out: Path | None, folder: Path) -> None:
    """Write the page of a viewer.

    Args:
        runs: shown, with their labels.
        panels: signals shown at first; none: those that the papers draw.
        out: the page; default: view.html in `folder`.
        folder: of the runs.

    Raises:
        ResultsError: the page cannot be written.
        ScenarioError: no run has recorded a panel.
    """
    from yawbench.foundation.safe_files import write_whole

    text = page_of(runs, panels)
    file = out or folder / "view.html"
    try:
        write_whole(file, text, named=out is not None)
    except OSError as error:
        raise ResultsError(
            f"{file}: cannot write the page: {error.strerror or error}", code="results-unwritable"
        ) from None
    say(f"{file}: {len(text.encode()) / 1000:.0f} kB")


def page_of(runs: Sequence[LabelledRun], panels: Sequence[str]) -> str:
    """Return the page of a viewer; for arguments and errors see `write_view`."""
    from yawbench.reports.viewer import Settings, check_panels, page
    from yawbench.reports.viewer_views import views_of

    check_panels(runs, panels)
    return page(runs, Settings([*views_of(panels)]))

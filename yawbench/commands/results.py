"""`yawbench plot`, `animate`, `serve` and `salvage`: commands on recorded runs.

A run is given by its results folder, or by a scenario, which is run first if its results are missing or out
of date.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.foundation.messages import counted, listed

from .options import CHANGES, MAKING, RunOptions, takes
from .output import reported, say, stoppable

if TYPE_CHECKING:
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
        "--label", metavar="TEXT", help="Label of a run in the legend, in the order of RESULTS. Repeatable."
    ),
]


def recorded(sources: Sequence[Path], options: RunOptions) -> list[Path]:
    """Return the folders of all results, after running scenarios that have none.

    Raises:
        ScenarioError: a scenario or an option is invalid.
    """
    from yawbench.fmus.opener import stale_fmus
    from yawbench.orchestrator.results.folder_names import default_folder
    from yawbench.orchestrator.results.freshness import staleness
    from yawbench.orchestrator.results.measurement_results import is_measurement, segments_of
    from yawbench.orchestrator.scenario import loader
    from yawbench.orchestrator.scenario.loader import MEASUREMENT
    from yawbench.planner import Planner
    from yawbench.studies.jobs import Job, execute, ready

    sources = [path if os.path.exists(path) else loader.named(path) or path for path in sources]
    files = [path for path in sources if path.suffix in loader.ENDINGS and not os.path.isdir(path)]
    scenarios = [path for path in files if loader.kind_of(path) != MEASUREMENT]
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
    from yawbench.orchestrator.results.folder_names import below_results
    from yawbench.orchestrator.results.measurement_results import is_measurement

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
    from yawbench.orchestrator.results.measurement_results import segments_of

    return [*folders, *(segment for file in measured or () for segment in segments_of(file))]


def read_runs(places: Sequence[Path], start: float, *, thin: bool = False) -> list[Results]:
    """Return runs and measurements, the former filtered like the latter.

    Args:
        places: folders of runs, and measurement files, which begin at `start` [s].
        thin: see `load_results`; not beside a measurement, whose filter needs all rows.

    Raises:
        ResultsError, ScenarioError: one of them cannot be read.
    """
    from yawbench.orchestrator.results.measurement_results import filtered_alike, is_measurement, load_run

    thin = thin and not any(map(is_measurement, places))
    return filtered_alike([load_run(place, thin=thin, start=start) for place in places])


Panels = Annotated[
    list[str] | None,
    typer.Option(
        "--panel",
        metavar="NAME",
        help="A signal (yaw_rate, plant.roll_angle, wheel_torque_*), its error (sideslip_error), one over "
        "another (yaw_rate(sideslip)) or path; repeatable. Default: the figures of the papers.",
    ),
]


AsPage = Annotated[bool, typer.Option("--page", help="Write view.html, an interactive page, instead.")]


FileFormat = Annotated[
    Literal["pdf", "svg", "png", "pgf"] | None,
    typer.Option("--format", help="Format of the figure; default: SVG and PNG, or that of --out FILE."),
]
Size = Annotated[
    str | None,
    typer.Option("--size", metavar="WxHmm", help="Size of the figure: 88x60mm, 9x6cm or 3.5x2.4in."),
]
Style = Annotated[
    Literal["ieee", "elsevier", "slides"] | None,
    typer.Option(
        "--style", help="Fonts, line widths and column width of a publisher, without title and note."
    ),
]
_SIZE = re.compile(r"(\d+(?:\.\d+)?)x(\d+(?:\.\d+)?)(mm|cm|in)")
_INCH = {"mm": 25.4, "cm": 2.54, "in": 1.0}
LARGEST_SIZE = 100.0
"""Largest width or height of a figure [inches]. Chosen: a poster, and its pixels fit into memory."""


def _settings(style: str | None, size: str | None) -> Any:
    """Return the settings of matplotlib for a style and a size.

    Raises:
        ScenarioError: the size is malformed.
    """
    from yawbench.figures.style import STYLES

    settings = dict(STYLES[style]) if style else {}
    if size is not None:
        match = _SIZE.fullmatch(size)
        sides = [float(length) / _INCH[match[3]] for length in match.groups()[:2]] if match else []
        if not match or not all(0.5 <= side <= LARGEST_SIZE for side in sides):
            raise ScenarioError(
                f"--size {size}: write width x height, such as 88x60mm, of 0.5 to {LARGEST_SIZE:g} inches",
                code="option-invalid",
            )
        settings["figure.figsize"] = sides
    return settings


def _check_output(out: Path | None, page: bool, format: str | None, published: bool) -> None:
    """Check that the file, its format and the kind of output agree; `published`: with a style or a size.

    Raises:
        ScenarioError: they do not.
    """
    from matplotlib.backend_bases import FigureCanvasBase

    from yawbench.figures.style import KINDS

    kind = out.suffix[1:].lower() if out else ""
    others = {"html", "gif", "bmp", *FigureCanvasBase.get_supported_filetypes()} - KINDS.keys()
    problem = ""
    if page and (format or published):
        problem = "--page: --format, --size and --style are of figures, not of pages"
    elif not page and kind in others:
        problem = f"--out {out}: a figure is {listed(KINDS, last='or')}" + "; a page needs --page" * (
            kind == "html"
        )
    elif not page and format and kind in KINDS and kind != format:
        problem = f"--out {out}: its ending differs from --format {format}"
    if problem:
        raise ScenarioError(problem, code="option-invalid")


@takes(*CHANGES, *MAKING)
def plot(
    sources: RunSources,
    options: RunOptions,
    label: Labels = None,
    panel: Panels = None,
    measured: MeasuredRuns = None,
    begin: MeasuredFrom = "0 s",
    page: AsPage = False,
    format: FileFormat = None,
    size: Size = None,
    style: Style = None,
) -> None:
    """Draw one run, or several overlaid.

    Figures are written as SVG and PNG; --format, or a file such as --out fig.pdf, chooses one format.
    With --style or --size, they are made for a publication: no title, no note, fonts embedded. With
    --page, an interactive page is written instead. A scenario is run first if its results (those of
    `yawbench run` without --out) are missing or out of date. Without --out, the figure of one run goes
    into its folder, that of several into their common parent folder.
    """
    import matplotlib

    from yawbench.figures.display import LabelledRun
    from yawbench.figures.panels import check_panels
    from yawbench.figures.plots import OVERVIEW, draw, shown_by, size_of_style
    from yawbench.figures.style import KINDS, save
    from yawbench.studies.comparison import FIGURES

    settings = _settings(style, size)
    _check_output(options.out, page, format, bool(settings))
    file = options.out if options.out and options.out.suffix[1:] in KINDS and not page else None
    start = start_of(begin)
    folders = with_segments(recorded(sources, options), measured)
    labels = labels_of(folders, label)
    if page:
        out = options.out
        page_file = out if out is None or out.suffix == ".html" else out / "view.html"
        write_view(folders, labels, panel or (), page_file, start)
        return
    runs = [
        LabelledRun(name, results)
        for name, results in zip(labels, read_runs(folders, start, thin=True), strict=True)
    ]
    check_panels(runs, panel or ())
    figures: dict[str, Sequence[str]] = {"overview": panel or OVERVIEW}
    if file:
        figures = {file.stem: panel or OVERVIEW}
    elif len(runs) > 1 and not panel:
        figures = {name: panels for name, panels in FIGURES.items() if shown_by(runs, panels)}
    for name, panels in figures.items():
        folder = file.parent if file else options.out or folder_of_all(folders)
        kinds = [format or file.suffix[1:]] if file else [format] if format else ["svg", "png"]
        if style and size is None:
            settings["figure.figsize"] = size_of_style(style, shown_by(runs, panels))
        with matplotlib.rc_context(settings):
            first, *others = save(draw(runs, panels), folder / name, kinds)
        say(", ".join([str(first), *(path.name for path in others)]))


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
    from yawbench.reports.viewer import SETTINGS, Settings, View, page

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


Folders = Annotated[
    list[Path], typer.Argument(help="Results folders of runs that were killed.", metavar="FOLDER...")
]


def salvage(folders: Folders) -> None:
    """Recover the results of runs that were killed.

    Killed processes leave files that end in .part. Their complete rows become results with the status
    "died"; if the folder has results of an earlier run, which become readable again, they go to failed/
    instead. Incomplete Parquet and MDF files cannot be recovered.
    """
    from yawbench.orchestrator.results.salvage import lost_format, salvage

    for folder in folders:
        lost = lost_format(folder)
        place, rows = salvage(folder)
        if rows:
            say(f"{place}: {counted(rows, 'row')}")
        else:
            why = f"incomplete {lost} files cannot be read" if lost else "no complete row was written"
            say(f"{folder}: nothing could be recovered: {why}")

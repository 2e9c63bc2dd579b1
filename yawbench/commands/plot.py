"""`yawbench plot`: figures of recorded runs."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from yawbench.commands.animate import write_view
from yawbench.commands.options import CHANGES, MAKING, RunOptions, completing_names, takes
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
from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import hint, listed

Panels = Annotated[
    list[str] | None,
    typer.Option(
        "--panel",
        metavar="NAME",
        autocompletion=completing_names("signals"),
        help="A signal (yaw_rate, plant.roll_angle, wheel_torque_*), its error (sideslip_error), one over "
        "another (yaw_rate(sideslip)), a difference or sum ('yaw_rate - yaw_rate_ref') or path; repeatable. "
        "Default: the figures of the papers.",
    ),
]
Minus = Annotated[
    str | None,
    typer.Option(
        "--minus",
        metavar="RUN",
        help="Draw the differences of the other runs from this one, a label or a folder of RESULTS.",
    ),
]
During = Annotated[
    str | None,
    typer.Option("--during", metavar="SPAN", help="Draw a time span alone, such as '1 to 3 s'."),
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


def _place(run: str, labels: Sequence[str], folders: Sequence[Path]) -> int:
    """Return the number of a run that is named by its label or its folder, among several.

    Raises:
        ScenarioError: there is none, or no other run.
    """
    names = [*labels, *map(str, folders)]
    wanted = run if run in labels else str(Path(run))
    if wanted not in names:
        near = hint(run, labels, lead="there are")
        raise ScenarioError(f"--minus {run}: no such run{near}", code="option-invalid")
    if len(folders) < 2:
        raise ScenarioError("--minus: needs two runs at least", code="option-invalid")
    return names.index(wanted) % len(labels)


def _window(text: str) -> tuple[float, float]:
    """Return the time span [s] that `--during` gives.

    Raises:
        ScenarioError: it is none.
    """
    from yawbench.metrics.expressions import window_of

    try:
        begin, end = window_of(text)
    except ValueError:
        begin = end = 0.0
    if not begin < end:
        raise ScenarioError(
            f"--during: {text!r} is no time span: write one such as '1 to 3 s'", code="option-invalid"
        )
    return begin, end


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
    minus: Minus = None,
    during: During = None,
    measured: MeasuredRuns = None,
    begin: MeasuredFrom = "0 s",
    page: AsPage = False,
    format: FileFormat = None,
    size: Size = None,
    style: Style = None,
) -> None:
    """Draw one run, or several overlaid.

    Figures are written as SVG and PNG; --format, or a file such as --out fig.pdf, chooses one format.
    With --minus RUN, the other runs' differences from that run are drawn, with --during a time span. With
    --style or --size, they are made for a publication: no title, no note, fonts embedded. With --page, an
    interactive page is written instead. A scenario is run first if its results (those of `yawbench run`
    without --out) are missing or out of date. Without --out, the figure of one run goes into its folder,
    that of several into their common parent folder.
    """
    import matplotlib

    from yawbench.figures.panels import check_panels
    from yawbench.figures.plots import draw, overview_of, shown_by, size_of_style, within
    from yawbench.figures.plots import minus as differences
    from yawbench.figures.style import KINDS, save
    from yawbench.studies.comparison import FIGURES

    if page and minus is not None:
        raise ScenarioError(
            "--minus is of figures; on a page, mark the baseline, and 'minus the baseline'",
            code="option-invalid",
        )
    if page and during is not None:
        raise ScenarioError(
            "--during is of figures; on a page, drag over the time span", code="option-invalid"
        )
    window = _window(during) if during is not None else None
    settings = _settings(style, size)
    _check_output(options.out, page, format, bool(settings))
    file = options.out if options.out and options.out.suffix[1:] in KINDS and not page else None
    start = start_of(begin)
    folders = with_segments(recorded(sources, options), measured)
    labels, thin = labels_of(folders, label), not page and minus is None and window is None
    runs = labelled(labels, folders, start, thin=thin)
    if page:
        out = options.out
        page_file = out if out is None or out.suffix == ".html" else out / "view.html"
        write_view(runs, panel or (), page_file, folder_of_all(folders))
        return
    if minus is not None:
        runs = differences(runs, runs[_place(minus, labels, folders)])
        if "path" in (panel or ()):
            raise ScenarioError("--minus: the path is no signal; position_y is one", code="option-invalid")
        panel = panel or [name for name in overview_of(runs) if name != "path"]
    if window:
        runs = within(runs, window)
    check_panels(runs, panel or ())
    figures: dict[str, Sequence[str]] = {"overview": panel or overview_of(runs)}
    if file:
        figures = {file.stem: panel or overview_of(runs)}
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

"""Parts shared by report, comparison and ranking pages: figures, animations, tables of FMUs and versions.

Figures are embedded panel by panel, as small SVG images that a page puts next to or below each other. Their
titles and legends are HTML text of the page, so that they can be read on a phone.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from markupsafe import Markup

from ..errors import ResultsError
from ..experiments.tables import Table
from ..figures.panels import Panel, draw_path, shown_by, thinned
from ..figures.plots import legend_of
from ..figures.style import RC, LabelledRun
from ..messages import listed
from ..plan import Plan
from ..results.read import Results
from ..results.run_record import versions
from .animation import MOST, fragment, frames_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


WIDTH, ROW = 4.7, 2.15
"""Width of a panel and height of a row [inches]; chosen: 9 pt text is still 7 pt on a phone."""
BUCKETS = 450
"""Number of buckets that a line over time is thinned to; chosen: one per pixel of a panel."""
CURLY = str.maketrans("'\"", "’”")
"""Typographic quotes for text, so that straight ones occur only in the markup."""
LOOK: Any = {**RC, "svg.fonttype": "none", "axes.titlesize": 9}
"""Style of figures, with text kept as text."""


@dataclass(frozen=True)
class PanelImage:
    """A panel: its title, and its image as a `data:` URL for an `<img>`."""

    name: str
    heading: Markup
    address: Markup


@dataclass(frozen=True)
class LegendEntry:
    """A line of a legend: label, colour, width [px] and dashes (SVG)."""

    label: str
    colour: str
    width: float
    dashes: str


def panel_images(
    runs: Sequence[LabelledRun], names: Sequence[str], *, whole: bool = False
) -> tuple[list[PanelImage], list[LegendEntry]]:
    """Return the panels whose signals the runs have recorded, and their common legend.

    `whole`: axes include all lines, however far they go.
    """
    import matplotlib

    panels = [_path_beside(panel, runs) for panel in shown_by(runs, names, whole=whole)]
    with matplotlib.rc_context(LOOK):
        drawn = [_draw(panel) for panel in panels]
        for scale in {panel.scale for panel in panels if panel.scale}:
            alike = [
                figure.axes[0] for panel, figure in zip(panels, drawn, strict=True) if panel.scale == scale
            ]
            low, high = zip(*(axes.get_ylim() for axes in alike), strict=True)
            for axes in alike:
                axes.set_ylim(min(low), max(high))
        explained = legend_of(runs, (figure.axes[0] for figure in drawn))
        legend = [_entry(label, style) for label, style in explained]
        headings = [_take_title(figure.axes[0]) for figure in drawn]
        _align(drawn)
        images = [
            PanelImage(panel.name, heading, _address(figure))
            for panel, heading, figure in zip(panels, headings, drawn, strict=True)
        ]
    return images, legend


def _path_beside(panel: Panel, runs: Sequence[LabelledRun]) -> Panel:
    """Return the panel; a path panel gets the shape of the others."""
    if panel.name != "path":
        return panel
    room = (ROW - 0.5) / (WIDTH - 0.6)
    return replace(panel, draw=lambda axes: draw_path(axes, runs, room=room))


def _draw(panel: Panel) -> Figure:
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, ROW * panel.rows), layout="constrained")
    FigureCanvasSVG(figure)
    axes = figure.add_subplot()
    panel.draw(axes)
    for line in axes.get_lines():
        x, y = line.get_data()
        if panel.over_time:
            line.set_data(*thinned(x, y, BUCKETS))  # type: ignore[arg-type]
    if (legend := axes.get_legend()) is not None:
        legend.set_ncols(2)
    return figure


def _align(drawn: Sequence[Figure]) -> None:
    """Align the left and right ends of the axes of all panels."""
    for figure in drawn:
        if (layout := figure.get_layout_engine()) is not None:
            layout.execute(figure)  # runs the layout without drawing
            figure.set_layout_engine("none")
    places = [figure.axes[0].get_position(original=True) for figure in drawn]
    left = max((place.x0 for place in places), default=0.0)
    right = min((place.x1 for place in places), default=1.0)
    for figure, place in zip(drawn, places, strict=True):
        figure.axes[0].set_position((left, place.y0, right - left, place.height))


def _entry(label: str, style: dict[str, Any]) -> LegendEntry:
    dashes = style["linestyle"][1] if isinstance(style["linestyle"], tuple) else ()
    width = float(style["linewidth"])
    return LegendEntry(label, style["color"], width, " ".join(f"{part * width:.3g}" for part in dashes))


def _take_title(axes: Axes) -> Markup:
    """Remove the title from the axes and return it as HTML."""
    heading = axes.get_title(loc="left")
    axes.set_title("", loc="left")
    return in_html(heading)


def _address(figure: Figure) -> Markup:
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    return address_of(text.getvalue())


def address_of(svg: str) -> Markup:
    """Return an SVG image as a short `data:` URL for an attribute in double quotes."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"(?<=>)[^<]+(?=<)", lambda text: text[0].translate(CURLY), svg)
    svg = svg.replace("'", "").replace('"', "'")
    svg = re.sub(
        r"(scale\([^)]*\))|(\.\d\d)\d+", lambda found: found[1] or found[2], svg
    )  # glyphs keep their aspect ratio
    svg = re.sub(r"\s*\n\s*", "\n", svg)
    return Markup("data:image/svg+xml," + quote(svg, safe=" =:/'(),;.-+*!?@$[]{}|^`~"))


@dataclass(frozen=True)
class FigureImage:
    """A whole figure: its title, and its image as a `data:` URL for an `<img>`."""

    title: str
    address: Markup


def image_of(file: Path, title: str) -> FigureImage:
    """Return an SVG file as an image."""
    return FigureImage(title, address_of(file.read_text(encoding="utf-8")))


def in_html(title: str) -> Markup:
    """Return a title of matplotlib as HTML: `$β_\\mathrm{ref}$` with its index below."""

    def formula(match: re.Match[str]) -> str:
        plain = re.sub(r"\\mathrm\{(.*?)\}", r"\1", match[1])
        return re.sub(r"_(\w+)", r"<sub>\1</sub>", f"<i>{plain}</i>")

    escaped = str(Markup.escape(title.replace("'", "’")))
    found = re.sub(r"(?<!\\)\$(.*?)(?<!\\)\$", formula, " ".join(escaped.split()))
    return Markup(found.replace(r"\$", "$"))


@dataclass(frozen=True)
class PageFigure:
    """A figure as a page shows it, panel by panel."""

    id: str
    title: str
    panels: list[PanelImage]
    legend: list[LegendEntry]
    files: tuple[str, ...] = ()


def figure_of(
    wanted: tuple[str, str, Sequence[LabelledRun], Sequence[str], tuple[str, ...]], *, whole: bool = False
) -> PageFigure | None:
    """Return a figure of (id, title, runs, panels, files); None if the runs recorded none of its signals.

    `whole`: axes include all lines, however far they go.
    """
    name, title, runs, panels, files = wanted
    images, legend = panel_images(runs, panels, whole=whole)
    return PageFigure(name, title, images, legend, files) if images else None


@dataclass(frozen=True)
class Animation:
    """An animation of runs seen from above, and the runs of the figure that are not in it."""

    title: str
    drawing: Markup
    left_out: str


def animation_of(runs: Sequence[LabelledRun], title: str) -> Animation | None:
    """Return the animation of as many runs as there are colours; None if none recorded its position."""
    placed = [_is_placed(run) for run in runs]
    able = list(compress(runs, placed))
    if not able:
        return None
    unable = [run.label for run, known in zip(runs, placed, strict=True) if not known]
    shown, others = able[:MOST], [run.label for run in able[MOST:]]
    reasons = [f"{listed(unable)}: no position recorded"] if unable else []
    reasons += [f"{listed(others)}: an animation shows up to {MOST} runs"] if others else []
    return Animation(title, fragment(shown, title=listed(run.label for run in shown)), "; ".join(reasons))


def fmus_of(runs: Iterable[Results | Plan]) -> Table:
    """Return the table of all FMUs in the runs, taken from their records or plans."""
    found: dict[tuple[str, str], dict[str, None]] = {}
    for one in runs:
        for unit, name, sha256 in _fmus_in(one):
            found.setdefault((name, sha256), {})[unit] = None
    ordered = sorted(found.items(), key=lambda one: (min(one[1]), one[0][0]))
    rows = [(name, ", ".join(units), sha256) for (name, sha256), units in ordered]
    return Table("", ["FMU", "as", "SHA-256"], [*rows])


def _is_placed(run: LabelledRun) -> bool:
    """Return whether a run recorded the position of its car."""
    try:
        frames_of(run.results)
    except ResultsError:
        return False
    return True


def _fmus_in(one: Results | Plan) -> Iterator[tuple[str, str, str]]:
    """Yield instance, FMU and its hash."""
    if isinstance(one, Plan):
        yield from ((unit.name, unit.fmu.name, unit.fmu.sha256) for unit in one.instances)
    else:
        for unit, fmu in one.record.fmus.items():
            yield unit, fmu.name or unit, fmu.sha256


def programs_of(runs: Iterable[Results | Plan]) -> dict[str, str]:
    """Return the versions of the programs that made the runs, taken from their records.

    Runs without a record, known by their key in the journal, have today's versions: the key includes them.
    """
    found: dict[str, dict[str, None]] = {}
    for one in runs:
        known = versions() if isinstance(one, Plan) else one.record.versions
        for name, version in known.items():
            found.setdefault(name, {})[str(version)] = None
    return {name: " and ".join(several) for name, several in found.items()}


def made_by() -> dict[str, object]:
    """Return the content of the footer of every page."""
    return {
        "versions": versions(),
        "made": f"{datetime.now(timezone.utc):%Y-%m-%d %H:%M} UTC",
    }


def anchor(text: str) -> str:
    """Return a text as an HTML anchor name."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")

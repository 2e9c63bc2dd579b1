"""The panels of a figure one by one, as small SVG images that a page puts side by side or below each other.

What stands above a panel in a figure, title and legend, is text of the page here, so that it can be read
on a phone.
"""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from markupsafe import Markup

from ..figures.display import Run
from ..figures.panels import Panel, draw_path, shown_by, thinned
from ..figures.plots import legend_of
from ..figures.style import RC

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH, ROW = 4.7, 2.15
"""Width of a panel and height of a row [inches]; chosen: 9 points of type stay 7 on a phone."""
BUCKETS = 450
"""Buckets that a line over time is thinned to; chosen: one per pixel of a panel."""
CURLY = str.maketrans("'\"", "’”")
"""Quotes in a text, so that those of the markup can be told from them."""
LOOK: Any = {**RC, "svg.fonttype": "none", "axes.titlesize": 9}
"""As in figures, but with text as text."""


@dataclass(frozen=True)
class PanelImage:
    """A panel: what it shows, and its image as the address of an `<img>`."""

    name: str
    heading: Markup
    address: Markup


@dataclass(frozen=True)
class LegendEntry:
    """What a line stands for; its colour, width [px] and dashes (SVG)."""

    label: str
    colour: str
    width: float
    dashes: str


def panel_images(
    runs: Sequence[Run], names: Sequence[str], *, whole: bool = False
) -> tuple[list[PanelImage], list[LegendEntry]]:
    """Return the panels that the runs have the signals for, and the legend that they share.

    `whole`: no run leaves the axes, however far it goes.
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


def _path_beside(panel: Panel, runs: Sequence[Run]) -> Panel:
    """Return the panel; a path as one of the shape of the others."""
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
    """Give the axes of all panels the same left and right ends."""
    for figure in drawn:
        if (layout := figure.get_layout_engine()) is not None:
            layout.execute(figure)  # nothing need be drawn for that
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
    """Take the title away from the axes and return it for the page."""
    heading = axes.get_title(loc="left")
    axes.set_title("", loc="left")
    return in_html(heading)


def _address(figure: Figure) -> Markup:
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    return address_of(text.getvalue())


def address_of(svg: str) -> Markup:
    """Return an SVG image as a `data:` address for an attribute in double quotes, as short as it can be."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"(?<=>)[^<]+(?=<)", lambda text: text[0].translate(CURLY), svg)
    svg = svg.replace("'", "").replace('"', "'")
    svg = re.sub(
        r"(scale\([^)]*\))|(\.\d\d)\d+", lambda found: found[1] or found[2], svg
    )  # glyphs keep their size
    svg = re.sub(r"\s*\n\s*", "\n", svg)
    return Markup("data:image/svg+xml," + quote(svg, safe=" =:/'(),;.-+*!?@$[]{}|^`~"))


@dataclass(frozen=True)
class Image:
    """A whole figure: what it is called, and its image as the address of an `<img>`."""

    title: str
    address: Markup


def image_of(file: Path, title: str) -> Image:
    """Return an SVG file as an image."""
    return Image(title, address_of(file.read_text(encoding="utf-8")))


def in_html(title: str) -> Markup:
    """Return a title of matplotlib as HTML: `$β_\\mathrm{ref}$` with its index below."""

    def formula(match: re.Match[str]) -> str:
        plain = re.sub(r"\\mathrm\{(.*?)\}", r"\1", match[1])
        return re.sub(r"_(\w+)", r"<sub>\1</sub>", f"<i>{plain}</i>")

    escaped = str(Markup.escape(title.replace("'", "’")))
    found = re.sub(r"(?<!\\)\$(.*?)(?<!\\)\$", formula, " ".join(escaped.split()))
    return Markup(found.replace(r"\$", "$"))

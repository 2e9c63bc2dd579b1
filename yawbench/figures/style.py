"""The style of all figures, and the writing of their files.

Colours can be told apart by colour-blind readers and in grey print.
"""

from __future__ import annotations

import io
import math
import re
import sys
import textwrap
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from yawbench.foundation.errors import ResultsError
from yawbench.foundation.messages import cut, printable
from yawbench.foundation.safe_files import reason, write_whole
from yawbench.measurements.measured_results import MeasuredResults
from yawbench.orchestrator.results.reader import Results

from .latex import characters

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.lines import Line2D


LINES: tuple[dict[str, Any], ...] = (
    {"color": "#0072B2", "linestyle": "-", "linewidth": 1.6},
    {"color": "#D55E00", "linestyle": (0, (5, 1.6)), "linewidth": 1.6},
    {"color": "#111111", "linestyle": (0, (6, 1.5, 1.2, 1.5)), "linewidth": 1.3},
    {"color": "#009E73", "linestyle": (0, (1.2, 1.2)), "linewidth": 1.9},
    {"color": "#CC79A7", "linestyle": (0, (9, 2)), "linewidth": 1.6},
    {"color": "#56B4E9", "linestyle": (0, (3, 1, 1, 1, 1, 1)), "linewidth": 1.6},
    {"color": "#E69F00", "linestyle": "-", "linewidth": 1.1},
)
"""One style per run: Okabe and Ito's colours, and a dash pattern that survives grey print."""

MEASURED_LINE = (0, (3.5, 1.5))
"""Dash pattern of measured runs."""
REFERENCE: dict[str, Any] = {"color": "#B8B8B8", "linestyle": "-", "linewidth": 5.0, "solid_capstyle": "butt"}
"""Line style of references: wide and pale, so that a run that follows its reference is visible on it."""

RC: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titley": 1.0,  # fixed: to move titles above what else is there takes half the time of drawing
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#666666",
    "axes.formatter.useoffset": False,
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.7,
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "legend.frameon": False,
    "legend.handlelength": 3.2,
    "lines.dash_capstyle": "butt",
    "path.simplify_threshold": 0.2,
    "svg.hashsalt": "yawbench",
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
    "savefig.dpi": 150,
}
NO_LAYOUT = {"figure.autolayout": False, "figure.constrained_layout.use": False}
"""Settings with which a figure whose layout engine is None has none."""
DRAWN = 1e100
"""Largest number that is drawn. Chosen: more than any car does, and far less than matplotlib bears."""
WIDTH, ROW = 10.0, 2.25
"""Width of a figure and height of a row of panels [inches]."""
KINDS: dict[str, dict[str, None]] = {
    "svg": {"Date": None}, "png": {"Software": None}, "pdf": {"CreationDate": None}, "pgf": {},
}  # fmt: skip
"""Format of a figure's file -> metadata to be left out, so that equal figures give equal files."""
STYLES: dict[str, dict[str, Any]] = {
    "ieee": {
        "font.family": "serif", "font.serif": ["Times New Roman", "Liberation Serif", "STIXGeneral"],
        "mathtext.fontset": "stix", "font.size": 8, "axes.titlesize": 8, "lines.linewidth": 1.0,
        "figure.figsize": (3.5, 2.4), "savefig.dpi": 600, "pdf.fonttype": 42,
    },
    "elsevier": {
        "font.family": "sans-serif", "font.sans-serif": ["Arial", "Liberation Sans", "DejaVu Sans"],
        "font.size": 7, "axes.titlesize": 7, "lines.linewidth": 1.0,
        "figure.figsize": (3.54, 2.4), "savefig.dpi": 500, "pdf.fonttype": 42,
    },
    "slides": {
        "font.size": 16, "axes.titlesize": 17, "lines.linewidth": 2.4,
        "figure.figsize": (10.0, 5.6), "savefig.dpi": 150, "pdf.fonttype": 42,
    },
}  # fmt: skip
"""Style of a figure to be published -> settings of matplotlib. Widths [inches] are one column of IEEE,
88.9 mm, and of Elsevier, 90 mm; font sizes and resolutions follow their instructions for authors; slides:
chosen."""
NARROW = 6.0
"""Width [inches] below which panels are not placed side by side; chosen: two columns of a paper."""
PANEL_LINES = 12
"""Smallest height of a row of panels in a style, in lines of text; chosen: six rows fill a page."""
CHARACTER = 0.5
"""Mean width of a character over the size of its font; chosen: that of common fonts, rounded up."""
QUIET = "#666666"
"""Colour of secondary text and lines: provenance, guides."""
CHANGED = "#A33B00"
"""Colour of overrides and limits."""

LONGEST = 3000
"""Characters of a title, a note and changes in a figure; chosen: a page full, drawn in less than a second."""
NOTE_WIDTH = 72
"""Largest line length of a note above a panel of half the figure's width."""


def line_style(number: int) -> dict[str, Any]:
    """Return the line style of a run by its number, counted from 0; styles repeat after the last.

    Widths, and colours if the caller has set a cycle of them, are matplotlib's in use.
    """
    style = _scaled(LINES[number % len(LINES)])
    if "matplotlib" in sys.modules:
        from matplotlib import rcParams, rcParamsDefault

        if rcParams["axes.prop_cycle"] != rcParamsDefault["axes.prop_cycle"]:
            cycle = list(rcParams["axes.prop_cycle"])
            style |= cycle[number % len(cycle)]
    return style


def reference_style() -> dict[str, Any]:
    """Return the line style of references; their width follows matplotlib's in use."""
    return _scaled(REFERENCE)


def _scaled(style: Mapping[str, Any]) -> dict[str, Any]:
    """Return a line style with its width in proportion to matplotlib's in use."""
    if "matplotlib" not in sys.modules:
        return dict(style)
    from matplotlib import rcParams, rcParamsDefault

    ratio = rcParams["lines.linewidth"] / rcParamsDefault["lines.linewidth"]
    return {**style, "linewidth": style["linewidth"] * ratio}


def style_of_run(number: int, results: Results) -> dict[str, Any]:
    """Return the line style of a run by its number; that of a measurement is dashed."""
    style = line_style(number)
    return style | {"linestyle": MEASURED_LINE} if isinstance(results, MeasuredResults) else style


def _own() -> Any:
    """Return the settings of the common style, without those that the caller has set."""
    from matplotlib import rcParams, rcParamsDefault

    return {name: value for name, value in RC.items() if rcParams[name] == rcParamsDefault[name]}


def own_size() -> tuple[float, float] | None:
    """Return the size of a figure [inches] that the caller has set; None if none was set."""
    from matplotlib import rcParams, rcParamsDefault

    width, height = rcParams["figure.figsize"]
    return (width, height) if [width, height] != list(rcParamsDefault["figure.figsize"]) else None


@contextmanager
def new_figure() -> Iterator[Figure]:
    """Context that yields an empty figure; drawing within it uses the common style."""
    import matplotlib
    import numpy as np
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib.rc_context(_own()), warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")  # of runs that are not finite, or have no range
        figure = Figure(layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        _end_lines_that_grow(figure)


def _end_lines_that_grow(figure: Figure) -> None:
    """Draw nothing of values beyond `DRAWN`, for which matplotlib has no axis."""
    import numpy as np

    for axes in figure.axes:
        for line in axes.lines:
            points = np.array(line.get_xydata(), float)
            beyond = (np.abs(points) > DRAWN).any(axis=1)
            if beyond.any():
                points[beyond] = np.nan
                line.set_data(points.T)
                axes.relim()
                axes.autoscale_view()


def save(figure: Figure, stem: Path, kinds: Sequence[str] = ("svg", "png")) -> list[Path]:
    """Write a figure in some formats of `KINDS` and return the paths; equal figures give equal files.

    Raises:
        ResultsError: they cannot be written, panels have no room, or there is no LaTeX for PGF.
    """
    paths = [stem.with_name(f"{stem.name}.{kind}") for kind in kinds]
    import matplotlib
    import numpy as np
    from matplotlib.text import Text

    with matplotlib.rc_context(_own() | NO_LAYOUT), warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")  # such as of characters without a font, which are shown as boxes
        warnings.filterwarnings("error", "constrained_layout not applied")
        try:
            if (layout := figure.get_layout_engine()) is not None:
                layout.execute(figure)  # once, not once per file
                figure.set_layout_engine(None)  # after "none", saving would draw twice
            for path, kind in zip(paths, kinds, strict=True):
                content = io.BytesIO()
                known: dict[str, Any] = {"metadata": KINDS[kind]} if KINDS[kind] else {}  # PGF takes none
                for text in figure.findobj(Text) if kind == "pgf" else ():
                    text.set_text(characters(text.get_text()))
                figure.savefig(content, format=kind, **known)
                written = content.getvalue()
                write_whole(path, OWN_FONTS.sub(b"", written) if kind == "pgf" else written)
        except UserWarning:
            wide, high = (25.4 * side for side in figure.get_size_inches())
            raise ResultsError(
                f"{stem}: the panels have no room in {wide:.0f} x {high:.0f} mm: fewer panels (--panel) or a "
                "larger figure (--size)",
                code="option-invalid",
            ) from None
        except RuntimeError as error:  # of matplotlib, which measures texts with LaTeX
            raise ResultsError(
                f"{stem}.pgf: PGF needs LaTeX (xelatex), which is not installed", code="package-missing"
            ) from error
        except OSError as error:
            raise ResultsError(
                f"{stem}: the figure cannot be written: {reason(error)}.", code="results-unwritable"
            ) from None
    return paths


OWN_FONTS = re.compile(rb"^%%.*\\detokenize.*\n", re.MULTILINE)
"""Comments in PGF on the files of this computer's fonts."""


def reference_words(lines: Iterable[Line2D]) -> str | None:
    """Return the legend entry of the reference lines among those drawn; None if there are none."""
    pale = [line for line in lines if line.get_label() == "reference"]
    own = any(line.get_color() != REFERENCE["color"] for line in pale)
    return ("wide: own reference" if own else "reference") if pale else None


def _characters(axes: Axes) -> int:
    """Return how many characters fit above a panel, in a figure whose size is set."""
    from matplotlib import rcParams

    wide = axes.get_position().width * rcParams["figure.figsize"][0]  # inches
    return int(wide * 72 / (CHARACTER * rcParams["font.size"]))


def note_beyond(axes: Axes, lines: Iterable[tuple[str, str]]) -> None:
    """Write between a panel and its title which lines (label, how far they go) leave the axes."""
    note = f"beyond the axes: {'; '.join(f'{label}, up to {far}' for label, far in lines)}"
    rows = textwrap.wrap(literal(note), _characters(axes) if own_size() else NOTE_WIDTH)
    axes.set_title(axes.get_title(loc="left"), pad=6 + 10 * len(rows))
    axes.annotate(
        "\n".join(rows), (0, 1), (0, 4), xycoords="axes fraction",
        textcoords="offset points", fontsize=7.5, color=QUIET,
    )  # fmt: skip


def literal(text: str) -> str:
    """Return a user's text with control characters escaped and `$` not starting a formula."""
    return printable(text).replace("$", r"\$")


def frame(
    figure: Figure, height: float, handles: Sequence[Artist], title: str, note: str, changed: str = ""
) -> None:
    """Place title and legend above the panels and the note below them.

    Args:
        figure: with constrained layout.
        height: of all its panels [inches].
        handles: entries of the legend.
        title, note: broken into lines as needed.
        changed: overrides of the scenario that the title names; shown below the title.
    """
    if size := own_size():
        _frame_bare(figure, size, handles)
        return
    titles, notes = textwrap.wrap(cut(title, LONGEST), 95), textwrap.wrap(cut(note, LONGEST), 165)
    changes = textwrap.wrap(cut(f"changed: {changed}", LONGEST), 110) if changed else []
    for handle in handles:
        handle.set_label(literal(str(handle.get_label())))
    widths = [len(str(handle.get_label())) + 9 for handle in handles]  # characters
    columns = len(handles) if sum(widths) <= 135 else max(1, 135 // max(widths))
    above = 0.12 + 0.22 * len(titles) + 0.18 * len(changes) + 0.06 * bool(changes)
    lines = math.ceil(len(handles) / max(columns, 1))
    head, foot = above + 0.2 * lines + 0.08, 0.12 + 0.13 * len(notes)  # inches
    total = height + head + foot
    figure.set_size_inches(WIDTH, total)
    figure.get_layout_engine().set(rect=(0, foot / total, 1, height / total), h_pad=0.07)  # type: ignore[union-attr, call-arg]
    left = 0.1 / WIDTH
    below = 1 - (0.12 + 0.22 * len(titles)) / total
    heading: dict[str, Any] = {"va": "top", "fontweight": "bold"}
    figure.text(left, 1 - 0.1 / total, literal("\n".join(titles)), fontsize=12, **heading)
    if changes:
        figure.text(left, below, literal("\n".join(changes)), fontsize=10, color=CHANGED, **heading)
    figure.text(left, 0.08 / total, literal("\n".join(notes)), va="bottom", fontsize=7, color=QUIET)
    if handles:
        figure.legend(
            handles=handles, loc="upper left", bbox_to_anchor=(left, 1 - above / total),
            ncols=columns, borderaxespad=0.0, borderpad=0.0,
        )  # fmt: skip


def _frame_bare(figure: Figure, size: tuple[float, float], handles: Sequence[Artist]) -> None:
    """Give a figure its size and a legend; its title and provenance belong into the caption."""
    from matplotlib import rcParams

    figure.set_size_inches(*size)
    for axes in figure.axes:
        title = textwrap.wrap(axes.get_title(loc="left"), _characters(axes))
        if len(title) > 1:
            axes.set_title("\n".join(title))
    line = rcParams["font.size"] / 72  # inches
    most = int((size[0] / line - 4) / CHARACTER)  # characters beside a handle
    for handle in handles:
        handle.set_label("\n".join(textwrap.wrap(literal(str(handle.get_label())), most)))

    def place(row: Sequence[Artist], down: float) -> Legend:
        return figure.legend(
            handles=row, loc="upper left", bbox_to_anchor=(0.0, 1 - down), ncols=len(row),
            borderaxespad=0.2, borderpad=0.0, columnspacing=1.0, handlelength=2.2,
        )  # fmt: skip

    # of the legend, filled as lines of a text are: columns would make more of them
    rows: list[list[Artist]] = []
    for handle in handles:
        trial = place([*(rows[-1] if rows else []), handle], 0.0)
        if rows and trial.get_window_extent().width <= 0.98 * figure.bbox.width:
            rows[-1].append(handle)
        else:
            rows.append([handle])
        trial.remove()
    head = 0.0  # of the figure's height
    for row in rows:
        head += (place(row, head).get_window_extent().height / figure.dpi + 0.3 * line) / size[1]
    if rows:
        figure.get_layout_engine().set(rect=(0, 0, 1, 1 - head - 0.3 * line / size[1]))  # type: ignore[union-attr, call-arg]

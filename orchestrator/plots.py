"""Figures of one run or of several laid over each other, drawn as the papers draw them.

A figure is a list of panels, named by what they show (see `panels`). A panel whose signal no run has
is left out. Angles are in degrees, speeds in km/h. Title and legend stand above the panels, so the
legend covers no data; the line at the bottom says where the figure comes from.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from .display import digits_of
from .errors import ResultsError
from .figure_style import QUIET, RC, REFERENCE, line_style
from .panels import ROW, WIDTH, Panel, Run, panels_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

OVERVIEW = (
    "steer_angle",
    "sideslip",
    "yaw_rate",
    "acceleration_y",
    "yaw_moment",
    "wheel_torque_*",
    "path",
)
"""The panels of the figures in the papers."""


def draw(
    runs: Sequence[Run],
    panels: Sequence[str] = OVERVIEW,
    *,
    title: str | None = None,
    note: str | None = None,
) -> Figure:
    """Return a figure of the panels with all runs laid over each other.

    Args:
        runs: the first is drawn first; the legend keeps the order.
        panels: names of panels, in order; those that no run has the signals for are left out.
        title: default: the scenario's title.
        note: the line of provenance at the bottom; default: made from the runs' records.

    Raises:
        ResultsError: there is nothing to draw.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    found = [panel for name in panels for panel in panels_of(runs, name)]
    if not found:
        where = ", ".join(str(run.results.folder) for run in runs)
        raise ResultsError(f"{where}: nothing to draw, no run recorded any of {', '.join(panels)}.")
    rows = _rows(found)
    with matplotlib.rc_context(RC):
        figure = Figure(layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(len(rows), 2)
        for i, row in enumerate(rows):
            for k, panel in enumerate(row):
                axes = figure.add_subplot(grid[i, :] if len(row) == 1 else grid[i, k])
                axes.set_label(panel.name)
                panel.draw(axes)
                below = rows[i + 1] if i + 1 < len(rows) else []
                if below and below[0].name != "path":
                    axes.set_xlabel("")  # the same time axis stands below
        foot = provenance(runs) if note is None else note
        _frame(figure, ROW * len(rows), _legend(figure, runs), title or title_of(runs), foot)
    return figure


def _rows(panels: Sequence[Panel]) -> list[list[Panel]]:
    rows: list[list[Panel]] = []
    for panel in panels:
        if not panel.wide and rows and len(rows[-1]) == 1 and not rows[-1][0].wide:
            rows[-1].append(panel)
        else:
            rows.append([panel])
    return rows


def _legend(figure: Figure, runs: Sequence[Run]) -> list[Line2D]:
    """Return what the legend shows: the runs if there are several, and what the pale lines are."""
    from matplotlib.lines import Line2D

    several = len(runs) > 1
    handles = [Line2D([], [], label=run.label, **line_style(k)) for k, run in enumerate(runs) if several]
    pale = [line for axes in figure.axes for line in axes.get_lines() if line.get_label() == "reference"]
    if pale:
        own = any(line.get_color() != REFERENCE["color"] for line in pale)
        says = "wide and pale: the run's own reference" if own else "reference"
        handles.append(Line2D([], [], label=says, **REFERENCE))
    return handles


def _frame(figure: Figure, height: float, handles: list[Line2D], title: str, note: str) -> None:
    """Set title and legend above the panels and the note below, in room of their own."""
    titles, notes = textwrap.wrap(title, 95), textwrap.wrap(note, 165)
    widths = [len(str(handle.get_label())) + 9 for handle in handles]  # characters
    columns = len(handles) if sum(widths) <= 135 else max(1, 135 // max(widths))
    above = 0.12 + 0.22 * len(titles)
    lines = math.ceil(len(handles) / max(columns, 1))
    head, foot = above + 0.2 * lines + 0.08, 0.12 + 0.13 * len(notes)  # inches
    total = height + head + foot
    figure.set_size_inches(WIDTH, total)
    figure.get_layout_engine().set(rect=(0, foot / total, 1, height / total), h_pad=0.07)  # type: ignore[union-attr, call-arg]
    left = 0.1 / WIDTH
    figure.text(left, 1 - 0.1 / total, "\n".join(titles), va="top", fontsize=12, fontweight="bold")
    figure.text(left, 0.08 / total, "\n".join(notes), va="bottom", fontsize=7, color=QUIET)
    if handles:
        figure.legend(
            handles=handles, loc="upper left", bbox_to_anchor=(left, 1 - above / total),
            ncols=columns, borderaxespad=0.0, borderpad=0.0,
        )  # fmt: skip


def title_of(runs: Sequence[Run]) -> str:
    """Return the title of the runs' scenario, or a general one where they differ."""
    titles = {str(run.results.run.get("scenario", {}).get("title") or "") for run in runs}
    return (titles.pop() if len(titles) == 1 else "") or "Comparison of runs"


def provenance(runs: Sequence[Run]) -> str:
    """Return where the figure comes from: source, folders, algorithm, step, version, as far as recorded."""
    first = runs[0].results.run
    scenario = first.get("scenario", {})
    parts = [str(scenario["source"])] if scenario.get("source") else []
    for key in ("algorithm", "step_size"):
        given = {run.results.run.get("scenario", {}).get(key) for run in runs}
        if len(given) == 1 and None not in given:
            value = given.pop()
            parts.append(f"step {digits_of(1000 * value)} ms" if isinstance(value, float) else str(value))
    unfinished = [run.label for run in runs if run.results.run.get("status") not in (None, "completed", "ok")]
    parts += [f"ended early: {', '.join(unfinished)}"] if unfinished else []
    version = first.get("versions", {}).get("yawbench")
    return " · ".join([f"yawbench {version}" if version else "yawbench", *parts])

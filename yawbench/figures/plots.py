"""Figures of one run or of several overlaid, in the style of the papers.

A figure is a list of panels, named by what they show (see `panels`). A panel whose signal no run has is
omitted. Angles are in degrees, speeds in km/h. Title and legend are above the panels, so that the legend
covers no data; the line at the bottom gives the provenance. Times in which faults act are coloured spans
behind the lines.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from yawbench.foundation.errors import ResultsError
from yawbench.foundation.messages import fold
from yawbench.metrics.expressions import TimeWindow, reference_of
from yawbench.metrics.expressions import during as said_during
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.recordings.gaps import gaps_noted
from yawbench.orchestrator.results.run_record import RunStatus
from yawbench.orchestrator.scenario.overrides import changed, fmu_of

from .display import LabelledRun, digits_of
from .panels import Difference, Panel, in_motion, panels_of
from .style import (
    NARROW,
    PANEL_LINES,
    ROW,
    STYLES,
    WIDTH,
    frame,
    new_figure,
    own_size,
    reference_style,
    reference_words,
    style_of_run,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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
MOST_PANELS = 12
"""Panels of a figure of runs that recorded none of these signals. Chosen: one page."""
FAULTY = "#F7DDC8"
"""Colour of fault spans; pale enough for all lines and the grid."""
SPAN: dict[str, Any] = {"color": FAULTY, "linewidth": 8.0, "linestyle": "-", "solid_capstyle": "butt"}
"""Line style of a fault span in a legend."""
NAMED = 4
"""Number of faults listed in a legend; if there are more, it gives their number. Chosen: fits a legend."""


class FaultSpan(NamedTuple):
    """The start and end [s] of a fault, and its description."""

    begin: float
    end: float
    label: str


def spans_of(runs: Sequence[LabelledRun]) -> list[FaultSpan]:
    """Return the faults of runs and gaps of recordings, each once; one that not all have names its run."""
    labels_of: dict[FaultSpan, list[str]] = {}
    for label, results in runs:
        for fault in results.record.faults if results.time.size else ():
            begin, end = fault.begin, fault.until
            first, last = results.time[0], results.time[-1]
            span = FaultSpan(
                float(first if begin is None else max(begin, first)),
                float(last if end is None else min(end, last)),
                fault.words,
            )
            if span.begin < span.end:
                labels_of.setdefault(span, []).append(label)
        for names, gap in gaps_noted(results.record.all_diagnostics):
            lost = FaultSpan(*gap, f"no samples{f' of {names}' * bool(names)}")
            labels_of.setdefault(lost, []).append(label)
    return [
        span if len(labels) == len(runs) else span._replace(label=f"{', '.join(labels)}: {span.label}")
        for span, labels in labels_of.items()
    ]


def mark(axes: Axes, spans: Sequence[FaultSpan]) -> None:
    """Draw spans behind all lines of axes over time, without changing the limits."""
    limits = axes.get_xlim()
    for begin, end in dict.fromkeys((span.begin, span.end) for span in spans):
        axes.axvspan(begin, end, facecolor=FAULTY, edgecolor="none", zorder=0)
    axes.set_xlim(limits)


def in_legend(spans: Sequence[FaultSpan]) -> list[str]:
    """Return the legend entries of spans."""
    labels = list(dict.fromkeys(span.label for span in spans))
    return labels if len(labels) <= NAMED else [f"{len(labels)} faults"]


def shown_by(runs: Sequence[LabelledRun], names: Sequence[str], *, whole: bool = False) -> list[Panel]:
    """Return the panels that the names select, in order (see `panels_of`)."""
    return [panel for name in names for panel in panels_of(runs, name, whole=whole)]


def draw(
    runs: Sequence[LabelledRun],
    panels: Sequence[str] = OVERVIEW,
    *,
    title: str | None = None,
    changed: str | None = None,
    note: str | None = None,
) -> Figure:
    """Return a figure of the panels with all runs overlaid.

    Args:
        runs: the first is drawn first; the legend keeps the order.
        panels: names of panels, in order; those that no run has the signals for are omitted.
        title: default: the scenario's title.
        changed: overrides, shown below the title; default: as recorded in the runs. With a title that was
            made for these runs they are shown in the note.
        note: the line of provenance at the bottom; default: made from the runs' records.

    Raises:
        ResultsError: there is nothing to draw.
    """
    from matplotlib.lines import Line2D

    if early := [run for run in runs if run.results.time.size < 2]:
        raise ResultsError(nothing_recorded(early[0]), code="nothing-to-draw")
    selected = shown_by(runs, panels)
    if not selected:
        where = ", ".join(run.results.where for run in runs)
        raise ResultsError(
            f"{where}: nothing to draw, no run recorded any of {', '.join(panels)}.", code="nothing-to-draw"
        )
    size, spans = own_size(), spans_of(runs)
    rows = rows_of(selected, size[0] if size else WIDTH)
    with new_figure() as figure:
        heights = [max(panel.rows for panel in row) for row in rows]
        grid = figure.add_gridspec(len(rows), 2, height_ratios=heights)
        first: dict[str, Axes] = {}
        for i, row in enumerate(rows):
            for k, panel in enumerate(row):
                axes = figure.add_subplot(grid[i, :] if len(row) == 1 else grid[i, k])
                axes.set_label(panel.name)
                if panel.scale in first:
                    axes.sharey(first[panel.scale])
                elif panel.scale:
                    first[panel.scale] = axes
                panel.draw(axes)
                if panel.over_time and spans:
                    mark(axes, spans)
                below = rows[i + 1] if i + 1 < len(rows) else []
                if panel.over_time and below and below[0].over_time:
                    axes.set_xlabel("")  # the panel below has the same time axis
        overrides = changes_of(runs) if changed is None else changed
        foot = provenance(runs) if note is None else note
        if title is not None and changed is None and overrides:
            foot, overrides = f"{foot} · changed: {overrides}", ""
        legend = legend_of(runs, figure.axes)
        handles = [Line2D([], [], label=label, **style) for label, style in legend]
        frame(figure, ROW * sum(heights), handles, title or title_of(runs), foot, overrides)
    return figure


def minus(runs: Sequence[LabelledRun], baseline: LabelledRun) -> list[LabelledRun]:
    """Return the difference of each other run from a baseline, `B minus A`, as runs without references.

    The baseline is taken at the other run's times, straight between its rows. A difference has the signals
    that both recorded, and no value where the baseline has ended.
    """
    of, found = in_motion(baseline).results, []

    def numeric(values: np.ndarray) -> bool:
        return bool(np.issubdtype(values.dtype, np.number) or values.dtype == bool)

    for label, results in map(in_motion, (run for run in runs if run is not baseline)):
        references = {reference_of(results, name) for name in results.columns}
        columns = {
            name: values - np.interp(results.time, of.time, of[name], left=np.nan, right=np.nan)
            for name, values in results.columns.items()
            if name in of.columns and name not in references and numeric(values) and numeric(of[name])
        }
        difference = Difference(results.folder, results.time, columns, results.units, results.record)
        found.append(LabelledRun(f"{label} minus {baseline.label}", difference))
    return found


def within(runs: Sequence[LabelledRun], window: TimeWindow) -> list[LabelledRun]:
    """Return the rows of runs within a time span [s].

    Raises:
        ResultsError: a run has fewer than two there.
    """
    found = []
    for label, results in runs:
        rows = (results.time >= window[0]) & (results.time <= window[1])
        if np.count_nonzero(rows) < 2:
            raise ResultsError(
                f"{results.where}: nothing to draw{said_during(window)}: {_reach(results.time)}",
                code="nothing-to-draw",
            )
        columns = {name: values[rows] for name, values in results.columns.items()}
        found.append(LabelledRun(label, replace(results, time=results.time[rows], columns=columns)))
    return found


def _reach(times: np.ndarray) -> str:
    return f"it was recorded from {times[0]:g} to {times[-1]:g} s" if times.size else "nothing was recorded"


def nothing_recorded(run: LabelledRun) -> str:
    """Return the message on a run that ended before it recorded anything."""
    error = run.results.record.error
    why = f": {' '.join(error.message.split())}" if error and error.message else ""
    return f"{run.results.folder}: nothing to draw, this run ended at its start{why}."


def overview_of(runs: Sequence[LabelledRun]) -> Sequence[str]:
    """Return the panels of the papers, or of runs without a car the first signals that they recorded."""
    if shown_by(runs, OVERVIEW):
        return OVERVIEW
    signals = fold(list(dict.fromkeys(name.variable for run in runs for name in run.results.names.values())))
    return signals[:MOST_PANELS] or OVERVIEW


def rows_of(panels: Sequence[Panel], width: float) -> list[list[Panel]]:
    """Return the rows of panels in a figure of a width [inches]."""
    rows: list[list[Panel]] = []
    for panel in panels:
        if width >= NARROW and rows and len(rows[-1]) == 1 and _pair(rows[-1][0], panel):
            rows[-1].append(panel)
        else:
            rows.append([panel])
    return rows


def size_of_style(style: str, panels: Sequence[Panel]) -> tuple[float, float]:
    """Return the size of a figure [inches] in a style, which grows with the rows of its panels."""
    width, height = STYLES[style]["figure.figsize"]
    rows = sum(max(panel.rows for panel in row) for row in rows_of(panels, width))
    return width, max(height, rows * PANEL_LINES * STYLES[style]["font.size"] / 72)


def _pair(left: Panel, right: Panel) -> bool:
    """Return whether two panels may be placed side by side."""
    return not left.wide and not right.wide and left.over_time == right.over_time


def legend_of(runs: Sequence[LabelledRun], drawn: Iterable[Axes]) -> list[tuple[str, dict[str, Any]]]:
    """Return labels and line styles of a legend: runs if there are several, reference lines, fault spans."""
    styles = [(run.label, style_of_run(k, run.results)) for k, run in enumerate(runs) if len(runs) > 1]
    if label := reference_words(line for axes in drawn for line in axes.get_lines()):
        styles.append((label, reference_style()))
    return styles + [(label, SPAN) for label in in_legend(spans_of(runs))]


def title_of(runs: Sequence[LabelledRun]) -> str:
    """Return the title of the runs' scenario, or a general one if they have different ones."""
    titles = {run.results.record.title or "" for run in runs}
    return (titles.pop() if len(titles) == 1 else "") or "Comparison of runs"


def changes_of(runs: Sequence[LabelledRun]) -> str:
    """Return the overrides of the runs' scenarios, in words."""
    return changed_each([(run.label, run.results.record.overrides) for run in runs])


def changed_each(labelled: Sequence[tuple[str, Sequence[Override]]]) -> str:
    """Return the overrides of several runs (label, overrides) in words: common ones first, then by label.

    A swap is left out where the label of the run names the FMU already.
    """
    (_, first), *others = labelled or [("", ())]
    common = [change for change in first if all(_among(change, changes) for _, changes in others)]
    parts = [changed(common)]
    for label, changes in labelled:
        own = [change for change in changes if not _among(change, common) and not _in_label(change, label)]
        parts += [f"{label}: {changed(own)}"] if own else []
    return "; ".join(filter(None, parts))


def _in_label(change: Override, label: str) -> bool:
    return change.swaps and fmu_of(change) == label.rpartition("/")[2]


def _among(change: Override, changes: Iterable[Override]) -> bool:
    return any((other.target, other.value) == (change.target, change.value) for other in changes)


def provenance(runs: Sequence[LabelledRun]) -> str:
    """Return the provenance of a figure: version, source, algorithm, step, FMUs with their hashes."""
    records = [run.results.record for run in runs]
    sources = dict.fromkeys(str(record.scenario.get("source") or "") for record in records)
    parts = [f"yawbench {records[0].versions.get('yawbench', '')}".strip(), *filter(None, sources)]
    algorithms = dict.fromkeys(record.algorithm for record in records if record.algorithm)
    steps = dict.fromkeys(record.step_size for record in records if record.step_size)
    parts += [*algorithms, *(f"step {digits_of(1000 * step)} ms" for step in steps)]
    fmus = dict.fromkeys(f"{fmu.name} {fmu.sha256[:8]}" for record in records for fmu in record.fmus.values())
    parts += [f"FMUs: {', '.join(fmus)}"] if fmus else []
    completed = RunStatus.COMPLETED
    unfinished = [r.label for r in runs if r.results.ended or r.results.record.status is not completed]
    parts += [f"ended early: {', '.join(unfinished)}"] if unfinished else []
    return " · ".join(parts)

"""Panels of figures: what one pair of axes shows, of one run or of several overlaid.

The name of a panel selects what it shows: a signal (over its reference, where the run recorded one),
`<signal>_error`, `path`, one signal over another (`yaw_rate(sideslip)`), a sum or difference
(`yaw_rate - yaw_rate_ref`), or a signal of four wheels (`wheel_torque_*`: one panel with four lines for one
run, four panels for several). Panels whose signals no run has are omitted.

A line that goes much further than the others may leave the axes; a note then gives how far it goes. Lines of
sideslip and slip angles have a gap while the car stands.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import cut, fold, hint
from yawbench.metrics.expressions import columns_of, reference_of, while_moving
from yawbench.metrics.measures import variable_of, words
from yawbench.orchestrator.results.reader import Results
from yawbench.vehicles.motion import largest
from yawbench.vocabulary.wheels import WHEEL_NAMES, wheels

from .display import LabelledRun, digits_of, in_formula, shown_unit, unit_of_signal
from .phase_portrait import curves_of, draw_portrait, signals_of, spread_rows
from .style import ROW, WIDTH, line_style, literal, note_beyond, reference_style, style_of_run

if TYPE_CHECKING:
    from matplotlib.axes import Axes


POINTS = 1500
"""Number of buckets a line is thinned to; each keeps its smallest and its largest value."""

OFF_SCALE = 8.0
"""A line that exceeds the visible peak by this factor may leave the axes, if at most half the lines do."""

PATH_ROOM = (ROW - 0.75) / (WIDTH - 1.0)
"""Height over width of the axes of a path."""

SEEN_ERROR = 0.02
"""Error, relative to the reference's peak, below which axes are not magnified further."""


@dataclass(frozen=True)
class Panel:
    """One pair of axes: its name, whether it takes a whole row, and the function that draws it.

    Panels with the same `scale` get the same limits. A panel that is not over time keeps its axis label;
    it is `rows` rows high.
    """

    name: str
    wide: bool
    draw: Callable[[Axes], None]
    scale: str = ""
    over_time: bool = True
    rows: int = 1


class Difference(Results):
    """The difference of two runs; its angles have their gaps, which its speed could not tell."""


def in_motion(run: LabelledRun) -> LabelledRun:
    """Return a run whose angles of velocities have gaps while the car stands."""
    return LabelledRun(run.label, while_moving(run.results))


@np.errstate(all="ignore")
def panels_of(runs: Sequence[LabelledRun], name: str, *, whole: bool = False) -> list[Panel]:
    """Return the panels that a name selects: none if no run has the signals, four for wheels.

    `whole`: axes include all lines, however far they go.
    """
    runs = [run if isinstance(run.results, Difference) else in_motion(run) for run in runs]
    if name == "path":
        drawn = [run for run in runs if _path_columns(run)]
        return [Panel(name, True, lambda axes: draw_path(axes, runs), over_time=False)] if drawn else []
    if signals := signals_of(name):
        if not curves_of(runs, *signals):
            return []
        return [Panel(name, False, lambda axes: draw_portrait(axes, runs, *signals), over_time=False, rows=2)]
    if len(terms := re.split(r" ([-+]) ", name)) > 1:
        if all(_total(run.results, terms) is None for run in runs):
            return []
        return [Panel(name, False, lambda axes: _draw_total(axes, runs, terms))]
    if name.endswith("_error"):
        signal = name.removesuffix("_error")
        if all(_error(run, signal) is None for run in runs):
            return []
        return [Panel(name, False, lambda axes: _draw_error(axes, runs, signal, whole))]
    if not any(columns_of(run.results, name) for run in runs):
        return []
    if "*" in name and len(runs) == 1:
        return [Panel(name, False, lambda axes: _draw_wheels(axes, runs[0], name))]
    scale = name if "*" in name else ""
    return [
        Panel(wheel, False, partial(_draw_signal, runs=runs, name=wheel, whole=whole), scale)
        for wheel in wheels(name)
    ]


def check_panels(
    runs: Sequence[LabelledRun],
    names: Sequence[str],
    *,
    option: str = "--panel ",
    selected: Callable[[Sequence[LabelledRun], str], Sequence[object]] = panels_of,
) -> None:
    """Check that every name selects a panel of at least one run.

    Args:
        runs: the runs to draw.
        names: of panels.
        option: text before a name in messages.
        selected: returns what a name selects.

    Raises:
        ScenarioError: with a sentence for each name that selects nothing.
    """
    recorded = fold(list(dict.fromkeys(name.variable for run in runs for name in run.results.names.values())))
    errors = [f"{name}_error" for name in recorded if panels_of(runs, f"{name}_error")]
    known = [*recorded, *errors, "path"]
    problems = [
        f"{option}{cut(name)}: no run has recorded it{hint(name, known, lead='there are')}"
        for name in names
        if not selected(runs, name)
    ]
    if problems:
        raise ScenarioError(problems, code="signal-unknown")


def _draw_signal(axes: Axes, runs: Sequence[LabelledRun], name: str, whole: bool) -> None:
    """Draw a signal of all runs over its reference, with readable limits."""
    lines = []
    for number, run in enumerate(runs):
        columns = columns_of(run.results, name)
        if columns:
            reference = reference_of(run.results, columns[0])
            lines.append((number, run, columns[0], reference))
    followed = [(number, run, reference) for number, run, _, reference in lines if reference]
    references = [run.results[reference] for _, run, reference in followed]
    for group in _alike(references):
        number, run, reference = followed[group[0]]
        own = (
            {} if len(group) > 1 or len(lines) == 1 else {"color": line_style(number)["color"], "alpha": 0.28}
        )
        style = {**reference_style(), **own, "label": "reference"}
        _line(
            axes, run.results.time, references[group[0]], unit_of_signal(run.results.units[reference]), style
        )
    unit = ""
    for number, run, column, _ in lines:
        unit = unit_of_signal(run.results.units[column])
        _line(axes, run.results.time, run.results[column], unit, style_of_run(number, run.results))
    _finish(axes, name, unit)
    if references and not whole:
        peaks = [(run.label, _peak(run.results[column])) for _, run, column, _ in lines]
        wanted = max(_peak(reference) for reference in references)
        _limit(axes, max(wanted, min(peak for _, peak in peaks)), peaks, unit)


def _limit(axes: Axes, scale: float, lines: list[tuple[str, float]], unit: str) -> None:
    """Limit the axes where a diverging run would squash all other lines; note which lines leave them.

    `scale` is a peak that must be visible, `lines` the label and the peak of every line, in SI.
    """
    text, factor = shown_unit(unit)
    lost = [line for line in lines if line[1] > OFF_SCALE * scale]
    if not lost or 2 * len(lost) > len(lines) or scale == 0:
        return
    largest = 1.5 * factor * max(scale, *(peak for _, peak in lines if peak <= OFF_SCALE * scale))
    axes.set_ylim(-largest, largest)
    room = "\N{NO-BREAK SPACE}"  # a unit stays with its number
    note_beyond(axes, ((label, f"{digits_of(peak * factor)}{room}{text}") for label, peak in lost))


def _draw_error(axes: Axes, runs: Sequence[LabelledRun], signal: str, whole: bool) -> None:
    """Draw the tracking error in per cent of the reference's peak."""
    peaks = []
    for number, run in enumerate(runs):
        error = _error(run, signal)
        if error is not None:
            _line(axes, run.results.time, error, "%", style_of_run(number, run.results))
            peaks.append((run.label, _peak(error)))
    _finish(axes, signal, "", f", error in % of max|{in_formula(signal + '_ref')}|")
    if not whole:
        _limit(axes, max(SEEN_ERROR, min(peak for _, peak in peaks)), peaks, "%")


@np.errstate(all="ignore")
def _error(run: LabelledRun, signal: str) -> np.ndarray | None:
    columns = columns_of(run.results, signal)
    reference = reference_of(run.results, columns[0]) if columns else None
    if not reference or _peak(run.results[reference]) == 0:
        return None
    wanted = run.results[reference]
    error: np.ndarray = (run.results[columns[0]] - wanted) / _peak(wanted)
    return error


def _total(results: Results, terms: Sequence[str]) -> tuple[np.ndarray, str] | None:
    """Return values and unit of `a + b - c`, from its signals and signs; None if one was not recorded."""
    columns = [columns_of(results, name)[:1] for name in terms[::2]]
    if not all(columns):
        return None
    first, *others = (results[column] for (column,) in columns)
    for sign, values in zip(terms[1::2], others, strict=True):
        first = first + values if sign == "+" else first - values
    return first, unit_of_signal(results.units[columns[0][0]])


def _draw_total(axes: Axes, runs: Sequence[LabelledRun], terms: Sequence[str]) -> None:
    """Draw a sum or difference of signals."""
    unit = ""
    for number, run in enumerate(runs):
        if total := _total(run.results, terms):
            values, unit = total
            _line(axes, run.results.time, values, unit, style_of_run(number, run.results))
    signs = ({"+": "plus", "-": "minus"}[sign] for sign in terms[1::2])
    others = (words(variable_of(name)).lower() for name in terms[2::2])
    _finish(
        axes, terms[0], unit, "".join(f" {sign} {name}" for sign, name in zip(signs, others, strict=True))
    )


def _draw_wheels(axes: Axes, run: LabelledRun, name: str) -> None:
    columns = columns_of(run.results, name)
    unit = unit_of_signal(run.results.units[columns[0]])
    for k, (column, wheel) in enumerate(zip(columns, WHEEL_NAMES, strict=True)):
        _line(axes, run.results.time, run.results[column], unit, {**line_style(k), "label": wheel})
    _finish(axes, name, unit)
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, handlelength=2.4,
        columnspacing=1.2, borderpad=0.2,
    )  # fmt: skip


def _path_columns(run: LabelledRun) -> tuple[str, str] | None:
    x, y = columns_of(run.results, "position_x"), columns_of(run.results, "position_y")
    return (x[0], y[0]) if x and y else None


def draw_path(axes: Axes, runs: Sequence[LabelledRun], *, room: float = PATH_ROOM) -> None:
    """Draw the paths seen from above; the lateral axis is stretched as far as needed to show their shape.

    Args:
        axes: the axes to draw into.
        runs: those that recorded a position are drawn.
        room: height of the axes over their width.
    """
    drawn = [(k, run.results, c) for k, run in enumerate(runs) if (c := _path_columns(run))]
    for number, results, (x, y) in drawn:
        keep = spread_rows(results, POINTS)
        axes.plot(results[x][keep], results[y][keep], **style_of_run(number, results))
        axes.plot(results[x][-1:], results[y][-1:], "o", ms=3.5, color=line_style(number)["color"])
    length = _span([results[x] for _, results, (x, _) in drawn])
    breadth = _span([results[y] for _, results, (_, y) in drawn])
    stretch = _stretch(length, breadth, room=room)
    axes.set_aspect(stretch, adjustable="datalim")
    scale = (
        "both axes to the same scale" if stretch == 1 else f"lateral scale {stretch} times the longitudinal"
    )
    axes.set_title(f"Path seen from above ({scale}; a dot marks its end)")
    axes.set_xlabel("$x$ in m")
    axes.set_ylabel("$y$ in m")


def _stretch(length: float, breadth: float, *, room: float) -> int:
    """Return the factor on y with which a path fills most of a panel of height `room` times its width."""
    wanted = room * max(length, 1.0) / max(1.25 * breadth, 1.0)
    return max([k for k in (1, 2, 5, 10, 20, 50) if k <= wanted], default=1)


def _line(axes: Axes, t: np.ndarray, x: np.ndarray, unit: str, style: dict[str, Any]) -> None:
    t, x = thinned(t, x * shown_unit(unit)[1])
    if unit == "rad":  # interrupt the line where an angle wraps around
        turned = np.flatnonzero(np.abs(np.diff(x)) > 180.0) + 1
        t, x = np.insert(t, turned, t[turned]), np.insert(x, turned, np.nan)
    axes.plot(t, x, **style)
    axes.update_datalim([(t[0], 0.0), (t[-1], 0.0)], updatey=False)  # a gap at an end is part of the time


def thinned(t: np.ndarray, x: np.ndarray, buckets: int = POINTS) -> tuple[np.ndarray, np.ndarray]:
    """Return the samples that draw the same line: the smallest and largest of each bucket."""
    if x.size <= 2 * buckets + 2:
        return t, x
    edges = np.linspace(0, x.size, buckets + 1).astype(int)
    keep = {0, x.size - 1}
    for first, last in pairwise(edges):
        part = x[first:last]
        gap = np.isnan(part)
        ends = np.where(gap, np.inf, part).argmin(), np.where(gap, -np.inf, part).argmax(), gap.argmax()
        keep.update(first + int(end) for end in (ends if gap.any() else ends[:2]))
    chosen = np.array(sorted(keep))
    return t[chosen], x[chosen]


def _finish(axes: Axes, signal: str, unit: str, more: str = "") -> None:
    """Set the title of a panel over time: the signal, its symbol, its unit, and optional text."""
    text = shown_unit(unit)[0]
    formula = in_formula(signal)
    heading = literal(words(variable_of(signal))) + (more or f" {formula}".rstrip())
    comma = "" if formula or "," not in heading else ","
    axes.set_title(f"{heading}{comma} in {literal(text)}" if text else heading)
    axes.set_xlabel("$t$ in s")
    axes.locator_params(axis="x", nbins=9, steps=[1, 2, 5, 10])
    axes.margins(x=0.01)
    low, high = axes.get_ylim()
    if all(_span([np.asarray(line.get_ydata(), float)]) == 0 for line in axes.get_lines()):
        axes.set_ylim(min(low, -1.0), max(high, 1.0))


def _peak(x: np.ndarray) -> float:
    return largest(x) or 0.0


def _span(arrays: list[np.ndarray]) -> float:
    joined = np.concatenate(arrays)
    joined = joined[~np.isnan(joined)]
    return float(np.ptp(joined)) if joined.size else 0.0


def _alike(references: list[np.ndarray]) -> list[list[int]]:
    """Group references that lie within the width of one wide line, so that one line represents them."""
    allowed = 0.05 * max((_peak(r) for r in references), default=0.0)
    groups: list[list[int]] = []
    for i, curve in enumerate(references):
        for group in groups:
            first = references[group[0]]
            if first.shape == curve.shape and _peak(curve - first) <= allowed:
                group.append(i)
                break
        else:
            groups.append([i])
    return groups

"""Pictures of a ranking: who passes which condition, stability over intervention, single runs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import ResultsError
from ..evaluation.standard_tests import TESTS
from ..evaluation.trace import trace_of
from ..figures.display import shown
from ..figures.style import QUIET, frame, literal, new_figure, save
from ..results.read import load_results
from .ranking import SERIES
from .standings import Cell, Standing, deciding_digits

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .ranking_course import Ranked

COLOURS = {"passed": "#BFE5D8", "spun": "#F7E3A1", "failed": "#F6CDB4", "missing": "#FFFFFF"}
"""Of cells; words and signs tell them apart without."""
RUN = "sine_with_dwell"
"""Name of the figure of a run."""
TUNED = {"authors": ("o", "#0072B2"), "tuned": ("D", "#D55E00")}
ROW = 0.235
"""Height of a row of the matrix [inches]."""


def sign_of(cell: Cell) -> str:
    """Return what stands in the cell of a controller in a condition: a sign, or how many of its runs pass."""
    if cell.state == "missing":
        return "–"
    if cell.state == "passed":
        return "✓"
    passed = sum(one.passed for one in cell.runs)
    return f"{passed}/{len(cell.runs)}"


def place_words(one: Standing) -> str:
    """Return a place, `–` of an entry that lacks runs."""
    return str(one.place) if one.place else "–"


def draw_matrix(ranked: Ranked, note: str) -> Figure:
    """Return the picture of who passes which condition, a row per controller, the first place at the top."""
    from matplotlib.patches import Patch, Rectangle

    rows = ranked.standings
    conditions = ranked.ranking.conditions
    wide = len(conditions)
    digits = deciding_digits(rows)
    beside = ((-5.1, "right", "place"), (wide + 0.15, "left", "passed"), (wide + 2.05, "right", "runs"))
    with new_figure() as figure:
        axes = figure.subplots()
        for i, one in enumerate(rows):
            for k, name in enumerate(conditions):
                cell = one.cells[name]
                colour = COLOURS[cell.state]
                axes.add_patch(Rectangle((k, i), 1, 1, facecolor=colour, edgecolor="white", linewidth=1.2))
                axes.text(k + 0.5, i + 0.52, sign_of(cell), ha="center", va="center", fontsize=7.5)
            axes.text(-0.15, i + 0.52, literal(one.spec.title), va="center", ha="right", fontsize=8.5)
            counted = f"{one.count('passed')} of {wide}" if one.place else f"{one.missing} missing"
            share = shown(one.share, "%", digits=digits.share) if one.place else ""
            for (x, side, _), text in zip(beside, (place_words(one), counted, share), strict=True):
                weight = "bold" if x < 0 else "normal"
                axes.text(x, i + 0.52, text, va="center", ha=side, fontsize=8, weight=weight)
        for k, spec in enumerate(conditions.values()):
            axes.text(k + 0.35, -0.15, literal(spec.heading), rotation=40, va="bottom", fontsize=8)
        for x, side, text in beside:
            axes.text(x, -0.15, text, ha=side, va="bottom", fontsize=8, color=QUIET)
        axes.set(xlim=(-5.5, wide + 2.2), ylim=(len(rows) + 0.1, -4.2))
        axes.set_axis_off()
        handles = [
            Patch(facecolor=COLOURS["passed"], label="passed: all runs pass"),
            Patch(facecolor=COLOURS["spun"], label="spun: criteria met, but more than 20° of sideslip"),
            Patch(facecolor=COLOURS["failed"], label="failed; so many runs of all pass"),
        ]
        frame(figure, ROW * (len(rows) + 4.3), handles, ranked.ranking.spec.title, note)
    return figure


def draw_pareto(ranked: Ranked, note: str) -> Figure:
    """Return stability over intervention, a point per controller; those that none betters are joined.

    Who asks for no moment at all is told of below: a car without control is far from all others.

    Raises:
        ResultsError: there is no controller to draw.
    """
    every = [
        (1e-3 * x, y, one)
        for one in ranked.standings
        if (x := one.mean("intervention")) is not None and (y := one.mean("margin")) is not None
    ]
    points = [point for point in every if point[2].mean("effort")]
    left_out = [f"{one.spec.title}: {y:.0f} points" for _, y, one in every if not one.mean("effort")]
    if not points:
        raise ResultsError("nothing to draw: no controller that acts has all of its runs.")
    front = [
        point
        for point in sorted(points, key=lambda point: point[:2])
        if not any(x <= point[0] and y >= point[1] and (x, y) != point[:2] for x, y, _ in points)
    ]
    with new_figure() as figure:
        axes = figure.subplots()
        for x, y, one in points[::-1]:
            marker, colour = TUNED[one.spec.gains]
            axes.plot(
                [x], [y], marker, color=colour, markersize=13, zorder=3, markeredgecolor="white",
                label=f"gains: {one.spec.gains}",
            )  # fmt: skip
            axes.text(
                x, y, str(one.place), color="white", fontsize=7, weight="bold", ha="center", va="center",
                zorder=3,
            )  # fmt: skip
        best = [x for x, *_ in front], [y for _, y, _ in front]
        axes.plot(*best, color=QUIET, linewidth=1.0, zorder=1, label="none is better in both:")
        for _, _, one in front:
            axes.plot([], [], " ", label=f"{one.place}  {one.spec.title}")
        axes.set_xlabel("Intervention: ∫|torque| dt of the wheel that gets most, once steered, mean [kN·m·s]")
        axes.set_title("Stability margin: points of per cent below the limits, least of each condition, mean")
        handles = {str(line.get_label()): line for line in axes.get_lines()}
        title = "Stability over intervention; numbers are places"
        frame(figure, 4.9, list(handles.values()), title, " · ".join([*left_out, note]))
    return figure


def draw_run(folder: Path, angle: float, again: bool = False) -> None:
    """Draw a run of sine with dwell beside its results, unless that has been done; `angle`: A [rad].

    A run that has left no results is passed over.
    """
    if not again and (folder / f"{RUN}.svg").is_file():
        return
    try:
        trace = trace_of(load_results(folder))
        figure = TESTS[SERIES].draw(trace, TESTS[SERIES].evaluate(trace, angle))
    except ResultsError:
        return
    if figure:
        save(figure, folder / RUN)


def degrees(amplitude: float) -> str:
    """Return an amplitude in whole and tenths of degrees."""
    return f"{math.degrees(abs(amplitude)):.1f}°"

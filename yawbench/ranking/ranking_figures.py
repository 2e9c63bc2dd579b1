"""Figures of a ranking: which controller passes which condition, and stability over intervention."""

from __future__ import annotations

from typing import TYPE_CHECKING

from yawbench.figures.display import shown
from yawbench.figures.style import QUIET, frame, literal, new_figure
from yawbench.foundation.errors import ResultsError

from .ranking_scores import RankedState, RankingResult, deciding_digits
from .ranking_tables import place_words, sign_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {
    RankedState.PASSED: "#BFE5D8",
    RankedState.SPUN: "#F7E3A1",
    RankedState.FAILED: "#F6CDB4",
    RankedState.MISSING: "#FFFFFF",
}
"""Colours of cells, which their text also tells apart."""
TUNED = {"authors": ("o", "#0072B2"), "tuned": ("D", "#D55E00")}
ROW = 0.235
"""Height of a row of the matrix [inch]."""


def draw_matrix(ranked: RankingResult, note: str) -> Figure:
    """Draw which controller passes which condition: a row per controller, best at the top."""
    from matplotlib.patches import Patch, Rectangle

    rows = ranked.scores
    conditions = ranked.ranking.conditions
    wide = len(conditions)
    digits = deciding_digits(rows)
    beside = ((-5.1, "right", "place"), (wide + 0.15, "left", "passed"), (wide + 2.05, "right", "runs"))
    with new_figure() as figure:
        axes = figure.subplots()
        for i, score in enumerate(rows):
            for k, name in enumerate(conditions):
                cell = score.cells[name]
                colour = COLOURS[cell.state]
                axes.add_patch(Rectangle((k, i), 1, 1, facecolor=colour, edgecolor="white", linewidth=1.2))
                axes.text(k + 0.5, i + 0.52, sign_of(cell), ha="center", va="center", fontsize=7.5)
            axes.text(-0.15, i + 0.52, literal(score.spec.title), va="center", ha="right", fontsize=8.5)
            counted = (
                f"{score.count(RankedState.PASSED)} of {wide}" if score.place else f"{score.missing} missing"
            )
            share = shown(score.share, "%", digits=digits.share) if score.place else ""
            for (x, side, _), text in zip(beside, (place_words(score), counted, share), strict=True):
                weight = "bold" if x < 0 else "normal"
                axes.text(x, i + 0.52, text, va="center", ha=side, fontsize=8, weight=weight)
        for k, spec in enumerate(conditions.values()):
            axes.text(k + 0.35, -0.15, literal(spec.heading), rotation=40, va="bottom", fontsize=8)
        for x, side, text in beside:
            axes.text(x, -0.15, text, ha=side, va="bottom", fontsize=8, color=QUIET)
        axes.set(xlim=(-5.5, wide + 2.2), ylim=(len(rows) + 0.1, -4.2))
        axes.set_axis_off()
        handles = [
            Patch(facecolor=COLOURS[RankedState.PASSED], label="passed: all runs pass"),
            Patch(
                facecolor=COLOURS[RankedState.SPUN], label="spun: criteria met, but more than 20° of sideslip"
            ),
            Patch(facecolor=COLOURS[RankedState.FAILED], label="failed; runs that pass of all"),
        ]
        frame(figure, ROW * (len(rows) + 4.3), handles, ranked.ranking.spec.title, note)
    return figure


def draw_pareto(ranked: RankingResult, note: str) -> Figure:
    """Draw stability over intervention: a point per controller, the Pareto front as a line.

    Controllers that never act are listed in the note, since they lie far from all others.

    Raises:
        ResultsError: there is no controller to draw.
    """
    every = [
        (1e-3 * x, y, score)
        for score in ranked.scores
        if (x := score.mean("intervention")) is not None and (y := score.mean("headroom")) is not None
    ]
    points = [point for point in every if point[2].mean("effort")]
    left_out = [f"{score.spec.title}: {y:.0f} points" for _, y, score in every if not score.mean("effort")]
    if not points:
        raise ResultsError(
            "nothing to draw: no controller that acts has all of its runs.", code="nothing-to-draw"
        )
    front = [
        point
        for point in sorted(points, key=lambda point: point[:2])
        if not any(x <= point[0] and y >= point[1] and (x, y) != point[:2] for x, y, _ in points)
    ]
    with new_figure() as figure:
        axes = figure.subplots()
        for x, y, score in points[::-1]:
            marker, colour = TUNED[score.spec.gains]
            axes.plot(
                [x], [y], marker, color=colour, markersize=13, zorder=3, markeredgecolor="white",
                label=f"gains: {score.spec.gains}",
            )  # fmt: skip
            axes.text(
                x, y, str(score.rank), color="white", fontsize=7, weight="bold", ha="center", va="center",
                zorder=3,
            )  # fmt: skip
        best = [x for x, *_ in front], [y for _, y, _ in front]
        axes.plot(*best, color=QUIET, linewidth=1.0, zorder=1, label="none is better in both:")
        for _, _, score in front:
            axes.plot([], [], " ", label=f"{score.rank}  {score.spec.title}")
        axes.set_xlabel("Intervention: ∫|torque| dt of the wheel that gets most, once steered, mean [kN·m·s]")
        axes.set_title("Headroom: percentage points below the limits, least of each condition, mean")
        handles = {str(line.get_label()): line for line in axes.get_lines()}
        title = "Stability over intervention; numbers are ranks in the order"
        frame(figure, 4.9, list(handles.values()), title, " · ".join([*left_out, note]))
    return figure

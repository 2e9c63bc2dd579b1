"""Figures of a lane change: a run seen from above between its cones, and a series over the entry speed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vocabulary.lane_change import Lane, lanes_of

from ..figures.style import CHANGED, QUIET, frame, line_style, new_figure
from .dwell_drawing import MARKS
from .judgement import Judgement, Series, Verdict
from .lane_change_series import CLEAN
from .trace import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

EVERY = 5.0
"""Between outlines of the car [m]."""
AROUND = 12.0
"""Shown before the first cones and behind the last ones [m]."""


def draw_run(trace: Trace, judged: Judgement) -> Figure:
    """Return the figure of a run: the car between its cones, hand wheel, lateral acceleration, sideslip."""
    track = lanes_of(trace.facts)
    x = trace["position_x"]
    start = track[0].start if track else 0.0
    panels = [
        (name, says, factor)
        for name, says, factor in (
            ("steering_wheel_angle", "Hand-wheel angle [°]", 180.0 / np.pi),
            ("acceleration_y", "Lateral acceleration [m/s²]", 1.0),
            ("sideslip", "Sideslip angle [°]", 180.0 / np.pi),
            ("velocity_x", "Speed [km/h]", 3.6),
        )
        if name in trace
    ]
    heights = [1.5, *([0.8] * len(panels))]
    with new_figure() as figure:
        axes = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
        _from_above(axes[0], trace, track, start)
        for panel, (name, says, factor) in zip(axes[1:], panels, strict=True):
            panel.plot(x - start, factor * trace[name], **line_style(0))
            panel.set_title(says)
            if name != "velocity_x":
                panel.axhline(0.0, color="#444444", linewidth=0.7, zorder=1)
        for panel in axes:
            for lane in track:
                panel.axvspan(lane.start - start, lane.end - start, color="#F1F1F1", zorder=0)
        end = track[-1].end - start if track else float(x[-1]) - start
        axes[0].set_xlim(-AROUND, min(end + AROUND, float(x.max()) - start))
        axes[-1].set_xlabel("Distance from the first cones [m]")
        entry = judged["entry"]
        ruling = judged.rulings[CLEAN]
        speed = "" if entry is None else f", {3.6 * entry:.1f} km/h at the first cones"
        note = " · ".join([*filter(None, [trace.title, trace.name]), *judged.notes])
        frame(
            figure, 1.45 * sum(heights), [], f"Lane change{speed}: {ruling.verdict.value}, {ruling.why}", note
        )
    return figure


def _from_above(axes: Axes, trace: Trace, track: list[Lane], start: float) -> None:
    """Draw cones, the way of the centre of mass and outlines of the car."""
    x, y = trace["position_x"] - start, trace["position_y"]
    axes.plot(x, y, **line_style(0))
    axes.set_title("From above [m]; the scale across is larger")
    for lane in track:
        places = np.linspace(lane.start, lane.end, 2 + round((lane.end - lane.start) / 4.0)) - start
        for border in (lane.right, lane.left):
            axes.plot(places, np.full_like(places, border), "^", color=CHANGED, markersize=3.5, zorder=4)
    known = [trace.facts.get(name) for name in ("cg_to_front_end", "cg_to_rear_end", "vehicle_width")]
    if "yaw_angle" not in trace or not all(isinstance(value, (int, float)) for value in known):
        return
    front, rear, width = (float(value) for value in known)  # type: ignore[arg-type]
    body = np.array([[front, front, -rear, -rear, front], [0.5, -0.5, -0.5, 0.5, 0.5]])
    body[1] *= width
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    for k in np.searchsorted(way, np.arange(0.0, way[-1], EVERY)):
        c, s = np.cos(trace["yaw_angle"][k]), np.sin(trace["yaw_angle"][k])
        axes.plot(
            x[k] + c * body[0] - s * body[1], y[k] + s * body[0] + c * body[1],
            color=QUIET, linewidth=0.7, zorder=2,
        )  # fmt: skip
    highest = max([lane.left for lane in track] + [float(y.max())])
    lowest = min([lane.right for lane in track] + [float(y.min())])
    axes.set_ylim(max(lowest, -12.0) - 0.8, min(highest, 12.0) + 0.8)


def draw_series(series: Series, note: str) -> Figure:
    """Return the figure of a series: what is beyond the cones, and how hard the car is driven."""
    panels: list[tuple[str, str, float]] = [
        ("overrun", "Largest distance beyond the cones [m]", 1.0),
        ("acceleration", "Largest lateral acceleration [m/s²]", 1.0),
        ("sideslip", "Peak sideslip [°]", 180.0 / np.pi),
        ("exit", "Speed behind the last cones [km/h]", 3.6),
    ]
    with new_figure() as figure:
        grid = figure.subplots(2, 2, sharex=True, squeeze=False)
        for axes, (key, says, factor) in zip(grid.flat, panels, strict=True):
            for verdict, marker in ((Verdict.PASSED, "o"), (Verdict.FAILED, "X"), (Verdict.NOT_JUDGED, "s")):
                runs = [run for run in series.runs if run.rulings[CLEAN].verdict is verdict]
                points = [(3.6 * (run["entry"] or 0.0), run[key]) for run in runs]
                shown = [(v, factor * value) for v, value in points if value is not None]
                style: dict[str, Any] = {"color": MARKS[verdict], "markersize": 6.0, "linestyle": ""}
                axes.plot([v for v, _ in shown], [value for _, value in shown], marker=marker, **style)
            axes.set_title(says)
            if (highest := series.found["highest_clean_entry_speed"]) is not None:
                axes.axvline(3.6 * highest, color=CHANGED, linewidth=1.2)
        grid[0, 0].set_yscale("symlog", linthresh=0.1, linscale=0.5)
        grid[0, 0].set_ylim(-0.02, 2.0 * max([0.1, *(run["overrun"] or 0.0 for run in series.runs)]))
        grid[0, 0].set_yticks([0.0, 0.1, 1.0, 10.0][: 3 if grid[0, 0].get_ylim()[1] < 10.0 else 4])
        grid[0, 0].yaxis.set_major_formatter("{x:g}")
        for axes in grid[1]:
            axes.set_xlabel("Speed at the first cones [km/h]")
        frame(figure, 4.6, [], series.summary, f"round: clean; cross: cones touched · {note}")
    return figure

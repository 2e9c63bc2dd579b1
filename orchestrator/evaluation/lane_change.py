"""Double lane change between cones (ISO 3888): evaluation of a run, highest clean entry speed, figures.

A run is clean if no part of the body goes beyond a row of cones, which the driver reports as `cone_overrun`,
and all of it has passed the last cones. The score is the highest speed at the first cones at which the track
is driven clean. The search starts at the first speed and goes up in steps while runs are clean, else down
until one is; then it halves the interval between the last two speeds until they differ by no more than the
resolution. Anything else is not clean: a cone touched, a rollover, a record that ends too early.

Source: ISO 3888-1 and ISO 3888-2, Passenger cars - Test track for a severe lane-change manoeuvre. ISO 3888-2
leaves the score to the user; the highest clean entry speed is the common one.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vocabulary.lane_change import Lane, lanes_of

from ..figures.style import CHANGED, QUIET, frame, line_style, new_figure
from ..metrics.verdict import Status, apart, compare, not_judged
from .sine_with_dwell_figures import MARKS
from .standard_tests import Evaluation, SeriesDriver, SeriesRun, TestSeries, evaluation
from .trace import Trace, at, first_crossing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


CLEAN = "clean"
TOUCH = 1e-9
"""Overrun above which a cone counts as hit [m]."""


@evaluation
def evaluate_lane_change(judged: Evaluation, trace: Trace) -> None:
    """Evaluate a lane change: whether it is clean, speeds, overrun, sideslip and lateral acceleration."""
    t, over, x = trace.time, trace["cone_overrun"], trace["position_x"]
    track = lanes_of(trace.facts)
    start = track[0].start if track else trace.facts.get("track_start")
    instant = None
    if isinstance(start, (int, float)):
        front = trace.facts.get("cg_to_front_end", 0.0)
        instant = first_crossing(t, x, float(start) - float(front), float(t[0]))
    speed = None if instant is None else at(t, trace["velocity_x"], instant)
    judged.add("entry", "speed at the first cones", speed, "m/s", "of the front end")
    through = len(t) - 1
    if track:
        last = track[-1].end + float(trace.facts.get("cg_to_rear_end", 0.0))
        passed = np.flatnonzero(x >= last)
        through = int(passed[0]) if passed.size else -1
    ends = float(trace["velocity_x"][through])
    judged.add("exit", "speed behind the last cones", None if through < 0 else ends, "m/s", "of the rear end")
    worst = int(np.argmax(over))
    judged.add("overrun", "largest distance beyond the cones", float(over[worst]), "m")
    if over[worst] > TOUCH:
        distance = x[worst] - (start if isinstance(start, (int, float)) else 0.0)
        far = apart(float(over[worst]), 0.0, decimals=3)
        why = f"{far} m beyond the cones, {distance:.1f} m after the first cones"
        judged.rule(CLEAN, compare(float(over[worst]), "at_most", 0.0, "m", why=why))
    elif instant is None:
        judged.rule(CLEAN, not_judged("the car has not reached the first cones"))
    elif through < 0:
        judged.rule(CLEAN, not_judged("the record ends before the car has passed the last cones"))
    else:
        judged.rule(CLEAN, compare(0.0, "at_most", 0.0, "m", why="no cone was touched"))
    if "sideslip" in trace:
        judged.add("sideslip", "peak sideslip", float(np.abs(trace["sideslip"]).max()), "rad")
    a_y = float(np.abs(trace["acceleration_y"]).max())
    judged.add("acceleration", "largest lateral acceleration", a_y, "m/s2")
    if "steering_wheel_angle" in trace:
        hand = float(np.abs(trace["steering_wheel_angle"]).max())
        judged.add("hand", "largest hand-wheel angle", hand, "rad")


KMH = 1.0 / 3.6
SEARCH_STEP, RESOLUTION = 10.0 * KMH, 0.5 * KMH
"""Step of the coarse search for the entry speed, and its final resolution [m/s]."""
SLOWEST, FASTEST = 10.0 * KMH, 250.0 * KMH
"""Bounds of the search for the entry speed [m/s]."""


def drive_series(driver: SeriesDriver) -> TestSeries:
    """Search for the highest clean entry speed, from that of the scenario."""

    def clean(speed: float) -> bool:
        seconds = math.ceil(10.0 * driver.duration * driver.speed / speed) / 10.0  # for the same distance
        values = {"speed": speed, "stop_time": seconds}
        name = f"{speed / KMH:.2f}"
        run = SeriesRun(name, f"{name} km/h", values, partly=False)
        return any(map(is_clean, driver.make([run])))

    bounds = {"step": SEARCH_STEP, "resolution": RESOLUTION, "least": SLOWEST, "most": FASTEST}
    driver.search_highest(clean, first=driver.speed, **bounds)
    return judge_entry_speeds(driver.judged)


def judge_entry_speeds(runs: Sequence[Evaluation]) -> TestSeries:
    """Return the highest clean entry speed: no run at a lower speed touched a cone."""
    ordered = sorted((run for run in runs if run["entry"] is not None), key=lambda run: run["entry"] or 0.0)
    clean = list(itertools.takewhile(is_clean, ordered))
    highest = clean[-1]["entry"] if clean else None
    touched = ordered[len(clean)]["entry"] if len(clean) < len(ordered) else None
    summary = "No run is clean."
    if highest is not None:
        above = "" if touched is None else f"; not clean at {3.6 * touched:.1f} km/h"
        summary = f"Highest clean entry speed: {3.6 * highest:.1f} km/h{above}."
    return TestSeries(ordered, summary, {"highest_clean_entry_speed": highest, "lowest_not_clean": touched})


def is_clean(run: Evaluation) -> bool:
    """Return whether a run was driven without touching a cone."""
    return CLEAN in run.criteria and run.criteria[CLEAN].holds is True


EVERY = 5.0
"""Distance between the drawn outlines of the car [m]."""
AROUND = 12.0
"""Length of road drawn before the first and behind the last cones [m]."""


def draw_run(trace: Trace, judged: Evaluation) -> Figure:
    """Return the figure of a run: the car between the cones, hand wheel, lateral acceleration, sideslip."""
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
        clean = judged.criteria[CLEAN]
        speed = "" if entry is None else f", {3.6 * entry:.1f} km/h at the first cones"
        note = " · ".join([*filter(None, [trace.title, trace.name]), *map(str, judged.diagnostics)])
        title = f"Lane change{speed}: {clean.status.value}, {clean.why}"
        frame(figure, 1.45 * sum(heights), [], title, note)
    return figure


def _from_above(axes: Axes, trace: Trace, track: list[Lane], start: float) -> None:
    """Draw the cones, the path of the centre of mass and outlines of the car."""
    x, y = trace["position_x"] - start, trace["position_y"]
    axes.plot(x, y, **line_style(0))
    axes.set_title("From above [m]; the scale across is larger")
    for lane in track:
        distances = np.linspace(lane.start, lane.end, 2 + round((lane.end - lane.start) / 4.0)) - start
        for border in (lane.right, lane.left):
            axes.plot(
                distances, np.full_like(distances, border), "^", color=CHANGED, markersize=3.5, zorder=4
            )
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


def draw_series(series: TestSeries, note: str) -> Figure:
    """Return the figure of a series over entry speed: overrun, and how hard the car is driven."""
    panels: list[tuple[str, str, float]] = [
        ("overrun", "Largest distance beyond the cones [m]", 1.0),
        ("acceleration", "Largest lateral acceleration [m/s²]", 1.0),
        ("sideslip", "Peak sideslip [°]", 180.0 / np.pi),
        ("exit", "Speed behind the last cones [km/h]", 3.6),
    ]
    with new_figure() as figure:
        grid = figure.subplots(2, 2, sharex=True, squeeze=False)
        for axes, (key, says, factor) in zip(grid.flat, panels, strict=True):
            for status, marker in ((Status.PASSED, "o"), (Status.FAILED, "X"), (Status.NOT_JUDGED, "s")):
                runs = [run for run in series.runs if run.criteria[CLEAN].status is status]
                points = [(3.6 * (run["entry"] or 0.0), run[key]) for run in runs]
                shown = [(v, factor * value) for v, value in points if value is not None]
                style: dict[str, Any] = {"color": MARKS[status], "markersize": 6.0, "linestyle": ""}
                axes.plot([v for v, _ in shown], [value for _, value in shown], marker=marker, **style)
            axes.set_title(says)
            if (highest := series.data["highest_clean_entry_speed"]) is not None:
                axes.axvline(3.6 * highest, color=CHANGED, linewidth=1.2)
        grid[0, 0].set_yscale("symlog", linthresh=0.1, linscale=0.5)
        grid[0, 0].set_ylim(-0.02, 2.0 * max([0.1, *(run["overrun"] or 0.0 for run in series.runs)]))
        grid[0, 0].set_yticks([0.0, 0.1, 1.0, 10.0][: 3 if grid[0, 0].get_ylim()[1] < 10.0 else 4])
        grid[0, 0].yaxis.set_major_formatter("{x:g}")
        for axes in grid[1]:
            axes.set_xlabel("Speed at the first cones [km/h]")
        frame(figure, 4.6, [], series.summary, f"round: clean; cross: cones touched · {note}")
    return figure

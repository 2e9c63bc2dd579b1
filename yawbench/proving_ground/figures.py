"""Figures of standard tests: a run of sine with dwell or a lane change, and the series of its runs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from yawbench.figures.style import CHANGED, QUIET, frame, line_style, new_figure
from yawbench.metrics.verdict import NotJudged, Status, worded
from yawbench.vocabulary.lane_change import Lane, lanes_of

from .double_lane_change import CLEAN
from .sine_with_dwell import AT, FAR, RATIOS, DwellCourse, conclusion, course_of, percent
from .standard_tests import Evaluation, TestSeries
from .trace import Trace, at

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKS = {Status.PASSED: "#009E73", Status.FAILED: "#D55E00", Status.NOT_JUDGED: QUIET}
"""Colours of verdicts."""
RESPONSE = "responsiveness"


def draw_dwell_run(trace: Trace, judged: Evaluation) -> Figure | None:
    """Return the figure of a run: hand wheel, yaw rate with its ratios, displacement, sideslip.

    None if the run cannot be judged.
    """
    try:
        course = course_of(trace)
    except NotJudged:
        return None
    with new_figure() as figure:
        names = ["hand wheel", "yaw rate", "displacement", *(["sideslip"] if "sideslip" in trace else [])]
        heights = [1.0, 1.7, 1.0, 1.0][: len(names)]
        panels = figure.subplots(len(names), 1, sharex=True, height_ratios=heights)
        _hand_wheel(panels[0], course)
        _yaw_rate(panels[1], course, judged)
        _displaced(panels[2], course, judged, trace)
        if len(names) > 3:
            panels[3].plot(
                trace.time, np.degrees(course.side * trace.while_moving("sideslip")), **line_style(0)
            )
            panels[3].set_title("Sideslip angle [°]")
        late = min(float(course.time[-1]), course.end + RATIOS[-1][0] + 0.35)
        for axes in panels:
            axes.set_xlim(course.zeroed[0] - 0.1, late)
            for instant in (course.begin, course.end):
                axes.axvline(instant, color="#444444", linewidth=0.9, linestyle=(0, (4, 2)), zorder=1)
            axes.axhline(0.0, color="#444444", linewidth=0.7, zorder=1)
        panels[-1].set_xlabel("Time [s]")
        side = "left" if course.side > 0 else "right"
        title = f"Sine with dwell, {math.degrees(abs(judged['amplitude'] or 0)):.1f}°, {side} first"
        heading = f"{title}: {_verdicts(judged)}"
        note = " · ".join(
            [
                *filter(None, [trace.title, trace.name]),
                "first half wave positive, signals filtered and zeroed as in UN R140",
                *map(str, judged.diagnostics),
            ]
        )
        frame(figure, 2.0 * sum(heights), [], heading, note)
    return figure


def _verdicts(judged: Evaluation) -> str:
    return ", ".join(f"{name} {worded(verdict.status)}" for name, verdict in judged.criteria.items())


def _label(axes: Axes, x: float, y: float, text: str, offset: tuple[float, float], **more: Any) -> None:
    axes.annotate(text, (x, y), offset, textcoords="offset points", fontsize=8, annotation_clip=True, **more)


def _hand_wheel(axes: Axes, course: DwellCourse) -> None:
    axes.plot(course.time, np.degrees(course.angle), **line_style(0))
    axes.axvspan(*course.zeroed, color="#EDEDED", zorder=0)
    axes.set_title("Hand-wheel angle [°]")
    middle = 0.5 * sum(course.zeroed)
    top = float(np.degrees(course.angle).max())
    axes.text(middle, 0.55 * top, "zeroed here", ha="center", fontsize=8, color=QUIET)
    _label(axes, course.begin, top, f"BOS {course.begin:.3f} s", (-4, -8), ha="right")
    _label(axes, course.end, top, f"COS {course.end:.3f} s", (4, -8))


def _yaw_rate(axes: Axes, course: DwellCourse, judged: Evaluation) -> None:
    axes.plot(course.time, np.degrees(course.yaw_rate), **line_style(0))
    axes.set_title("Yaw rate [°/s]")
    if course.peak is None:
        axes.text(0.99, 0.06, "no peak after the reversal", transform=axes.transAxes, ha="right",
                  color=MARKS[Status.FAILED])  # fmt: skip
        return
    value = math.degrees(at(course.time, course.yaw_rate, course.peak))
    axes.plot([course.peak], [value], "o", color="#111111", markersize=5, zorder=4)
    _label(axes, course.peak, value, f"second peak {value:.1f} °/s", (8, -3))
    low, high = axes.get_ylim()
    axes.set_ylim(low - 0.12 * (high - low), high)
    for late, most in RATIOS:
        instant = course.end + late
        ratio = judged[f"ratio_{round(1000 * late)}"]
        axes.plot([instant - 0.22, instant], [most * value] * 2, color=CHANGED, linewidth=2.2, zorder=3)
        below: dict[str, Any] = {"va": "top", "ha": "right"}
        below["bbox"] = {"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.85}
        _label(axes, instant, most * value, f"limit {100 * most:g} %", (-2, -3), color=CHANGED, **below)
        axes.axvline(instant, color=QUIET, linewidth=0.8, linestyle=(0, (1, 2)), zorder=1)
        if ratio is None:
            continue
        good = ratio <= most
        colour = MARKS[Status.PASSED if good else Status.FAILED]
        axes.plot([instant], [ratio * value], "D", color=colour, markersize=5.5, zorder=4)
        text = f"{percent(ratio)} at\nCOS + {late:g} s"
        axes.text(instant, 0.97, text, transform=axes.get_xaxis_transform(), fontsize=8, color=colour,
                  ha="center", va="top", backgroundcolor="white")  # fmt: skip


def _displaced(axes: Axes, course: DwellCourse, judged: Evaluation, trace: Trace) -> None:
    shown = course.time <= course.end + 0.3
    axes.plot(course.time[shown], course.displacement[shown], **line_style(0))
    axes.set_title("Lateral displacement, double integral of the lateral acceleration [m]")
    displacement, instant = judged["displacement"], course.begin + AT
    if displacement is None:
        return
    verdict = judged.criteria.get(RESPONSE)
    colour = MARKS[verdict.status] if verdict else QUIET
    axes.axvline(instant, color=QUIET, linewidth=0.8, linestyle=(0, (1, 2)), zorder=1)
    axes.plot([instant], [displacement], "D", color=colour, markersize=5.5, zorder=4)
    remark = "" if verdict else ", not required at this amplitude"
    text = f"{displacement:.2f} m at BOS + {AT:g} s{remark}"
    _label(axes, instant, displacement, text, (-7, 4), color=colour, ha="right")
    if verdict and verdict.bound is not None:
        least = verdict.bound
        axes.plot([instant, instant + 0.35], [least] * 2, color=CHANGED, linewidth=2.2, zorder=3)
        _label(axes, instant + 0.35, least, f"at least {least:g} m", (4, -3), color=CHANGED)


def draw_dwell_series(series: TestSeries, note: str) -> Figure:
    """Return the figure of a series: ratios and displacement over amplitude, in both directions."""
    from matplotlib.lines import Line2D

    panels: list[tuple[str, str, float, float | None]]
    panels = [(f"ratio_{round(1000 * late)}", f"Yaw-rate ratio at COS + {late:g} s [%]", 100.0, 100 * most)
              for late, most in RATIOS]  # fmt: skip
    panels += [("displacement", f"Lateral displacement at BOS + {AT:g} s [m]", 1.0, None)]
    if any(run["sideslip"] is not None for run in series.runs):
        panels += [("sideslip", "Peak sideslip [°]", 180 / math.pi, None)]
    with new_figure() as figure:
        grid = figure.subplots(2, 2, sharex=True, squeeze=False)
        for axes, (key, says, factor, limit) in zip(grid.flat, panels, strict=False):
            for k, side in enumerate((1.0, -1.0)):
                runs = [run for run in series.runs if side * (run["amplitude"] or 0.0) > 0]
                x = [math.degrees(abs(run["amplitude"] or 0.0)) for run in runs]
                y = [math.nan if run[key] is None else factor * (run[key] or 0.0) for run in runs]
                marker = {"marker": "os"[k], "markersize": 6.5 - 2.5 * k}
                axes.plot(x, y, **line_style(k), **marker)
            axes.set_title(says)
            if limit is not None:
                axes.axhline(limit, color=CHANGED, linewidth=1.5)
                _label(
                    axes,
                    axes.get_xlim()[1],
                    limit,
                    f"at most {limit:g} %",
                    (-4, 3),
                    color=CHANGED,
                    ha="right",
                )
        required = [run for run in series.runs if RESPONSE in run.criteria]
        judged = [run for run in required if run.criteria[RESPONSE].holds is not None]
        if judged:
            x = [math.degrees(abs(run["amplitude"] or 0.0)) for run in judged]
            grid[1, 0].plot([min(x), max(x)], [FAR] * 2, color=CHANGED, linewidth=1.5)
            _label(grid[1, 0], max(x), FAR, f"at least {FAR:g} m", (-4, 4), color=CHANGED, ha="right")
        for axes in grid[1]:
            axes.set_xlabel("Amplitude of the hand wheel [°]")
        if len(panels) < 4:
            grid[1, 1].set_axis_off()
        handles = [
            Line2D([], [], label=name, marker="os"[k], **line_style(k))
            for k, name in enumerate(("left first", "right first"))
        ]
        verdicts = "; ".join(
            f"{name} {worded(verdict.status)}: {verdict.why}" for name, verdict in series.criteria.items()
        )
        angle = math.degrees(series.data["A"])
        title = f"Sine with dwell, A = {angle:.1f}°: the series has {conclusion(series.criteria)}"
        frame(figure, 5.0, handles, title, f"{verdicts} · {note}")
    return figure


EVERY = 5.0
"""Distance between the drawn outlines of the car [m]."""
AROUND = 12.0
"""Length of road drawn before the first and behind the last cones [m]."""


def draw_lane_change_run(trace: Trace, judged: Evaluation) -> Figure:
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
            values = trace.while_moving(name) if name == "sideslip" else trace[name]
            panel.plot(x - start, factor * values, **line_style(0))
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
        title = f"Lane change{speed}: {worded(clean.status)}, {clean.why}"
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


def draw_lane_change_series(series: TestSeries, note: str) -> Figure:
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

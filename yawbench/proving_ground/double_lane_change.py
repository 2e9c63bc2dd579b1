"""Double lane change between cones (ISO 3888): whether it is clean, and the highest clean entry speed.

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

import numpy as np

from yawbench.metrics.verdict import apart, compare, not_judged
from yawbench.vehicles.motion import largest
from yawbench.vocabulary.lane_change import lanes_of

from .standard_tests import Evaluation, SeriesDriver, SeriesRun, TestSeries, evaluation
from .trace import Trace, at, first_crossing

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
        judged.add("sideslip", "peak sideslip", largest(trace.while_moving("sideslip")), "rad")
    a_y = float(np.abs(trace["acceleration_y"]).max())
    judged.add("acceleration", "largest lateral acceleration", a_y, "m/s2")
    if "steering_wheel_angle" in trace:
        hand = float(np.abs(trace["steering_wheel_angle"]).max())
        judged.add("hand", "largest hand-wheel angle", hand, "rad")


KMH = 1.0 / 3.6
SEARCH_STEP, RESOLUTION = 10.0 * KMH, 0.5 * KMH
"""Step of the coarse search for the entry speed, and its final resolution [m/s]."""
LOWEST, HIGHEST = 10.0 * KMH, 250.0 * KMH
"""Bounds of the search for the entry speed [m/s]."""


def drive_lane_changes(driver: SeriesDriver) -> TestSeries:
    """Search for the highest clean entry speed, from that of the scenario."""

    def clean(speed: float) -> bool:
        seconds = math.ceil(10.0 * driver.duration * driver.speed / speed) / 10.0  # for the same distance
        values = {"speed": speed, "stop_time": seconds}
        name = f"{speed / KMH:.2f}"
        run = SeriesRun(name, f"{name} km/h", values, partly=False)
        return any(map(is_clean, driver.make([run])))

    bounds = {"step": SEARCH_STEP, "resolution": RESOLUTION, "least": LOWEST, "most": HIGHEST}
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

"""A gust of side wind while the hand wheel is held: how far the car is blown off its way.

From the wind's beginning on, while the hand wheel is held, relative to the way the car went before (means
over 0.5 s):

    after 2 s        distance from that line, yaw angle
    within 2 s       largest yaw rate and lateral acceleration, their instants, largest sideslip

Positive: to the left. The wind begins where the road unit tells a side force, in measurements the signal
`wind_force_y` likewise.

Source: after ISO 12021, Road vehicles - Sensitivity to lateral wind - Open-loop test method using wind
generator input, from memory of the standard: 100 km/h, a zone of wind of 25 m, the hand wheel held, evaluated
over 2 s.
"""

from __future__ import annotations

import math

import numpy as np

from .filters import at
from .judgement import Judgement, NotJudged, evaluation
from .trace import Trace

AFTER, BEFORE = 2.0, 0.5
"""Time over which is evaluated, and before the wind, of the means [s]."""
HELD = math.radians(1.0)
"""Range of the hand wheel beyond which it is not held [rad]; chosen: a loose grip."""


@evaluation
def evaluate_side_wind(judged: Judgement, trace: Trace) -> None:
    """Return what a gust does to a car within 2 s."""
    t, wind = trace.time, trace["wind_force_y"]
    x, y, psi = trace["position_x"], trace["position_y"], trace["yaw_angle"]
    blown = np.flatnonzero(wind != 0.0)
    if not blown.size:
        raise NotJudged("no wind blows")
    begin = float(t[blown[0]])
    before = (t >= begin - BEFORE) & (t < begin)
    if begin - BEFORE < t[0] or begin + AFTER > t[-1] or np.count_nonzero(before) < 5:
        raise NotJudged(f"the record has no {BEFORE:g} s before and {AFTER:g} s after {begin:.2f} s")
    during = (t >= begin) & (t <= begin + AFTER)
    judged.add("begin", "the wind's beginning", begin, "s")
    judged.add("speed", "speed there", at(t, trace["velocity_x"], begin), "m/s")
    strongest = int(np.argmax(np.abs(wind)))
    judged.add("force", "largest side force of the wind", float(wind[strongest]), "N")
    course = math.atan2(*(float(np.polyfit(t[before], line[before], 1)[0]) for line in (y, x)))
    off = (y - at(t, y, begin)) * math.cos(course) - (x - at(t, x, begin)) * math.sin(course)
    reading = f"{AFTER:g} s after the wind's beginning"
    judged.add("deviation", "lateral deviation", at(t, off, begin + AFTER), "m", reading)
    turned = at(t, psi, begin + AFTER) - float(psi[before].mean())
    judged.add("yaw_angle", "change of the yaw angle", turned, "rad", reading)
    for name, says, unit in (
        ("yaw_rate", "largest yaw rate", "rad/s"),
        ("acceleration_y", "largest lateral acceleration", "m/s2"),
        ("sideslip", "largest change of sideslip", "rad"),
    ):
        if name == "sideslip" and name not in trace:
            continue
        values = np.where(during, trace[name] - float(trace[name][before].mean()), 0.0)
        k = int(np.argmax(np.abs(values)))
        judged.add(name, says, float(values[k]), unit, f"within {AFTER:g} s")
        if name != "sideslip":
            judged.add(f"{name}_at", "its instant", float(t[k]) - begin, "s", "after the wind's beginning")
    if "steering_wheel_angle" in trace and np.ptp(trace["steering_wheel_angle"][during]) > HELD:
        turned_by = math.degrees(float(np.ptp(trace["steering_wheel_angle"][during])))
        judged.notes.append(f"the hand wheel is not held: it moves by {turned_by:.0f} degrees")

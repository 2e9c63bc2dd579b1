"""Braking or lifting off in a turn: what becomes of a steady turn while the hand wheel is held.

Steady state: means over the last 0.5 s before the action, with the radius R_0 = v_0 / r_0. 1 s after it:

    yaw rate ratio     r / (v / R_0)     1: still the same circle, more: turns in, less: pushes out
    a_y ratio          a_y / (v^2 / R_0)
    deceleration       mean over that second
    sideslip           change against the steady state

and the largest of the yaw rate ratio within that second.

Source: after ISO 7975, Passenger cars - Braking in a turn - Open-loop test method, and ISO 9816 (power-off
reactions), from memory of the standards.
"""

from __future__ import annotations

import math

import numpy as np

from .filters import at
from .judgement import Judgement, NotJudged, evaluation
from .signs import refuse_opposed
from .trace import Trace

BEFORE, AFTER = 0.5, 1.0
"""Stretch of the steady state before the action, and instant after it [s]."""
STEADY = 0.03
"""Range of the yaw rate over that stretch, over its mean, beyond which it is no steady turn; chosen."""


@evaluation
def evaluate_turn(judged: Judgement, trace: Trace, action: float | None = None) -> None:
    """Return the ratios at 1 s after the action [s], by default that which the driver unit tells."""
    t, v, r, a_y = trace.time, trace["velocity_x"], trace["yaw_rate"], trace["acceleration_y"]
    now = trace.told("action_time", "when the pedals change") if action is None else action
    before = (t >= now - BEFORE) & (t <= now)
    if now - BEFORE < t[0] or now + AFTER > t[-1] or np.count_nonzero(before) < 5:
        raise NotJudged(f"the record has no {BEFORE:g} s before and {AFTER:g} s after {now:g} s")
    v_0, r_0 = float(v[before].mean()), float(r[before].mean())
    if abs(r_0) < 1e-3 or np.ptp(r[before]) > STEADY * abs(r_0):
        raise NotJudged(f"the turn is not steady before {now:g} s")
    if "steering_wheel_angle" in trace:
        refuse_opposed(trace["steering_wheel_angle"][before], r[before], "yaw rate")
    side, radius = math.copysign(1.0, r_0), v_0 / abs(r_0)
    judged.add("radius", "radius of the steady turn", side * radius, "m", "v / r, positive: to the left")
    judged.add("speed", "speed of the steady turn", v_0, "m/s")
    judged.add("acceleration", "lateral acceleration of the steady turn", float(a_y[before].mean()), "m/s2")
    later = at(t, v, now + AFTER)
    judged.add("deceleration", f"mean deceleration over {AFTER:g} s", (at(t, v, now) - later) / AFTER, "m/s2")
    ratio = side * r * radius / np.maximum(v, 0.1)
    judged.add("yaw_ratio", f"yaw rate ratio after {AFTER:g} s", at(t, ratio, now + AFTER), "1", "r R_0 / v")
    during = (t >= now) & (t <= now + AFTER)
    judged.add(
        "yaw_ratio_peak", f"largest yaw rate ratio within {AFTER:g} s", float(ratio[during].max()), "1"
    )
    aside = side * at(t, a_y, now + AFTER) * radius / max(later, 0.1) ** 2
    judged.add("a_y_ratio", f"lateral acceleration ratio after {AFTER:g} s", aside, "1", "a_y R_0 / v^2")
    if "sideslip" in trace:
        change = at(t, trace["sideslip"], now + AFTER) - float(trace["sideslip"][before].mean())
        judged.add("sideslip", f"change of sideslip after {AFTER:g} s", change, "rad")
        peak = float(np.abs(trace["sideslip"][t >= now]).max())
        judged.add("sideslip_peak", "peak sideslip from the action on", peak, "rad")

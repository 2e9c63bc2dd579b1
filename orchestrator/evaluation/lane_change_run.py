"""A double lane change between cones: was it clean, and how fast.

Clean: no part of the body is beyond a row of cones, as the driver unit tells in `cone_overrun`, and all of
it has passed the last ones. What scores is the highest speed at the first cones at which the track is
driven clean (`lane_change_series`).

Source: ISO 3888-1 and ISO 3888-2, Passenger cars - Test track for a severe lane-change manoeuvre.
"""

from __future__ import annotations

import numpy as np

from vocabulary.lane_change import lanes_of

from .filters import at, first_crossing
from .judgement import Judgement, evaluation
from .trace import Trace

TOUCH = 1e-9
"""Overrun above which a cone is hit [m]."""


@evaluation
def evaluate_lane_change(judged: Judgement, trace: Trace) -> None:
    """Return speeds, largest overrun, sideslip and lateral acceleration, and whether it was clean."""
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
        place = x[worst] - (start if isinstance(start, (int, float)) else 0.0)
        said = f"{over[worst]:.3f} m beyond the cones, {place:.1f} m from the first ones"
        judged.rule("clean", False, said)
    elif instant is None:
        judged.rule("clean", None, "the car has not reached the first cones")
    elif through < 0:
        judged.rule("clean", None, "the record ends before the car has passed the last cones")
    else:
        judged.rule("clean", True, "no cone is touched")
    if "sideslip" in trace:
        judged.add("sideslip", "peak sideslip", float(np.abs(trace["sideslip"]).max()), "rad")
    a_y = float(np.abs(trace["acceleration_y"]).max())
    judged.add("acceleration", "largest lateral acceleration", a_y, "m/s2")
    if "steering_wheel_angle" in trace:
        hand = float(np.abs(trace["steering_wheel_angle"]).max())
        judged.add("hand", "largest hand-wheel angle", hand, "rad")

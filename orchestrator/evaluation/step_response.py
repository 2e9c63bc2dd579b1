"""Step steer: how quickly, how far and with how much overshoot a car answers a step of the hand wheel.

    time zero        the hand wheel has reached half of its final angle
    steady value     mean over the last second of the record
    response time    from time zero until 90 % of the steady value is reached
    peak time        from time zero to the largest value;  overshoot = largest value / steady value - 1
    gain             steady value over final hand-wheel angle

of yaw rate and lateral acceleration, and T_beta = peak time of the yaw rate times steady sideslip, in rad s.

Source: after ISO 7401, Road vehicles - Lateral transient response test methods - Open-loop test methods; the
definitions are from memory of the standard.
"""

from __future__ import annotations

import math

import numpy as np

from .filters import at, first_crossing
from .judgement import Judgement, NotJudged, evaluation
from .signs import refuse_opposed
from .trace import Trace

STEADY = 1.0
"""Stretch at the end of the record over which steady values are means [s]."""
LEVEL = 0.9
"""Of the steady value, which ends the response time."""
SETTLED = 0.02
"""Range over the steady stretch, over its mean, above which nothing is steady; chosen."""
ANSWERS = {"yaw_rate": ("yaw rate", "rad/s"), "acceleration_y": ("lateral acceleration", "m/s2")}
_GAINS = {"yaw_rate": "1/s", "acceleration_y": "m/(s2.rad)"}


@evaluation
def evaluate_step(judged: Judgement, trace: Trace) -> None:
    """Return gains, response times, overshoots of a step steer."""
    t = trace.time
    hand = trace["steering_wheel_angle"]
    if t.size < 3 or t[-1] - t[0] < 2.0 * STEADY:
        raise NotJudged(f"the record is shorter than {2.0 * STEADY:g} s")
    end = t >= t[-1] - STEADY
    step = float(hand[end].mean()) - float(hand[0])
    if abs(step) < math.radians(0.1):
        raise NotJudged("the hand wheel is not turned")
    side = math.copysign(1.0, step)
    zero = first_crossing(t, side * (hand - hand[0]), 0.5 * abs(step), float(t[0]))
    if zero is None or np.ptp(hand[end]) > SETTLED * abs(step):
        raise NotJudged("the hand wheel is still turned at the end of the record")
    for key, (name, _) in ANSWERS.items():
        refuse_opposed(hand - hand[0], trace[key] - trace[key][0], name)
    judged.add("step", "final hand-wheel angle", step, "rad")
    judged.add("zero", "time zero", zero, "s", "half of the final hand-wheel angle")
    if "velocity_x" in trace:
        judged.add("speed", "speed at time zero", at(t, trace["velocity_x"], zero), "m/s")
    for key, (name, unit) in ANSWERS.items():
        x = side * (trace[key] - trace[key][0])
        steady = float(x[end].mean())
        judged.add(f"{key}_steady", f"steady {name}", side * steady, unit, f"mean over the last {STEADY:g} s")
        judged.add(
            f"{key}_gain", f"gain of the {name}", steady / abs(step), _GAINS[key], "over the hand wheel"
        )
        if np.ptp(x[end]) > SETTLED * abs(steady):
            judged.notes.append(
                f"the {name} is not steady at the end: {100 * np.ptp(x[end]) / abs(steady):.1f} %"
            )
        answered = first_crossing(t, x, LEVEL * steady, float(t[0])) if steady > 0 else None
        judged.add(f"{key}_response", f"response time of the {name}", _since(answered, zero), "s", "to 90 %")
        largest = int(np.argmax(x))
        judged.add(f"{key}_peak", f"peak time of the {name}", float(t[largest]) - zero, "s")
        over = float(x[largest]) / steady - 1.0 if steady > 0 else None
        judged.add(f"{key}_overshoot", f"overshoot of the {name}", over, "%")
    if "sideslip" in trace:
        sideslip = float(trace["sideslip"][end].mean() - trace["sideslip"][0])
        judged.add("sideslip_steady", "steady sideslip", sideslip, "rad")
        peak = judged["yaw_rate_peak"]
        judged.add("t_beta", "T_beta", None if peak is None else peak * abs(sideslip), "rad.s")


def _since(instant: float | None, zero: float) -> float | None:
    return None if instant is None else instant - zero

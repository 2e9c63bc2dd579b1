"""Understeer gradient: how much more a car has to be steered with a_y than by its geometry.

    delta = L kappa + K_us a_y,        delta = delta_h / i_s,  kappa = r / v_x

K_us is the slope of delta - L r / v_x over a_y; so it does not matter whether the speed was held and the hand
wheel turned slowly, or the radius was held and the speed raised. Tyres lose stiffness with the square of
a_y, so the gradient of the linear range is that at zero of

    delta - L r / v_x = c_0 + K_us a_y + c_3 a_y^3                  fitted over 0.5 to 2 m/s2

and beyond it a local one, a straight line over 1 m/s2.

Source: after ISO 4138, Passenger cars - Steady-state circular driving behaviour - Open-loop test methods,
from memory of the standard, which fits a curve and differentiates it; the cubic and its range are ours.
"""

from __future__ import annotations

import math

import numpy as np

from .judgement import Judgement, NotJudged, evaluation
from .trace import Trace

WINDOW = (0.5, 2.0)
"""Lateral acceleration that the cubic is fitted over [m/s2]."""
LEVELS, HALF = (3.0, 4.0, 5.0, 6.0), 0.5
"""Lateral accelerations of local gradients and half their windows [m/s2]."""
FEWEST = 20
"""Samples in a window."""
UNIT = "rad.s2/m"


@evaluation
def evaluate_understeer(judged: Judgement, trace: Trace) -> None:
    """Return understeer gradients at the road wheels.

    The run has to tell `steering_ratio` and the wheelbase, `cg_to_front_axle` and `cg_to_rear_axle`.

    Raises:
        ResultsError: a signal is missing.
    """
    signals = [trace[name] for name in ("steering_wheel_angle", "yaw_rate", "velocity_x", "acceleration_y")]
    ratio, front, rear = (_told(trace, n) for n in ("steering_ratio", "cg_to_front_axle", "cg_to_rear_axle"))
    hand, r, v, a_y = signals
    side = math.copysign(1.0, float(a_y[np.argmax(np.abs(a_y))]))
    a_y = side * a_y
    extra = side * (hand / ratio - (front + rear) * r / np.maximum(v, 0.1))
    last = int(np.argmax(a_y))  # what comes after is not the slow rise any more
    a_y, extra = a_y[: last + 1], extra[: last + 1]
    gradient = slope(a_y, extra, *WINDOW, cubic=True)
    if gradient is None:
        raise NotJudged(
            f"lateral acceleration does not rise slowly through {WINDOW[0]:g} to {WINDOW[1]:g} m/s2"
        )
    reading = f"at zero of a cubic through {WINDOW[0]:g} to {WINDOW[1]:g} m/s2"
    judged.add("gradient", "understeer gradient at the road wheels", gradient, UNIT, reading)
    judged.add("gradient_hand", "understeer gradient at the hand wheel", gradient * ratio, UNIT, reading)
    if gradient > 0:
        speed = math.sqrt((front + rear) / gradient)
        judged.add("characteristic_speed", "characteristic speed", speed, "m/s", "sqrt(L / K_us)")
    for level in LEVELS:
        local = slope(a_y, extra, level - HALF, level + HALF)
        judged.add(
            f"gradient_{level:g}",
            f"understeer gradient at {level:g} m/s2",
            local,
            UNIT,
            "straight line over 1 m/s2",
        )
    judged.add("largest", "largest lateral acceleration", float(a_y.max()), "m/s2")


def slope(
    a_y: np.ndarray, extra: np.ndarray, low: float, high: float, *, cubic: bool = False
) -> float | None:
    """Return d extra / d a_y [rad.s2/m] from what lies between two a_y [m/s2]; None if that is too little.

    Args:
        a_y: rising [m/s2].
        extra: delta - L r / v_x [rad].
        low, high: of the straight line, or of the cubic whose slope at zero is meant.
        cubic: which of the two.
    """
    inside = (a_y >= low) & (a_y <= high)
    if a_y.max() < high or np.count_nonzero(inside) < FEWEST:
        return None
    a = a_y[inside]
    terms = [a, np.ones_like(a), *([a**3] if cubic else [])]
    return float(np.linalg.lstsq(np.column_stack(terms), extra[inside], rcond=None)[0][0])


def _told(trace: Trace, name: str) -> float:
    value = trace.facts.get(name)
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        raise NotJudged(f"the run does not tell {name}")
    return float(value)

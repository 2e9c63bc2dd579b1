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
from .signs import refuse_opposed
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
    """
    names = ("steering_wheel_angle", "yaw_rate", "velocity_x", "acceleration_y")
    hand, r, v, a_y = (trace[name] for name in names)
    ratio, front, rear = map(trace.told, ("steering_ratio", "cg_to_front_axle", "cg_to_rear_axle"))
    side = math.copysign(1.0, float(a_y[np.argmax(np.abs(a_y))]))
    a_y = side * a_y
    extra = side * (hand / ratio - (front + rear) * r / np.maximum(v, 0.1))
    last = int(np.argmax(a_y))  # what comes after is not the slow rise any more
    a_y, extra = a_y[: last + 1], extra[: last + 1]
    refuse_opposed(side * hand[: last + 1], a_y, "lateral acceleration")
    refuse_opposed(hand[: last + 1], r[: last + 1], "yaw rate")
    found = gradients(a_y, extra)
    gradient = found.pop(0.0)
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
    reading = f"straight line over {2 * HALF:g} m/s2"
    for level, local in found.items():
        judged.add(f"gradient_{level:g}", f"understeer gradient at {level:g} m/s2", local, UNIT, reading)
    judged.add("largest", "largest lateral acceleration", float(a_y.max()), "m/s2")


def gradients(a_y: np.ndarray, extra: np.ndarray) -> dict[float, float | None]:
    """Return lateral acceleration [m/s2] -> understeer gradient there [rad.s2/m], at 0 of the linear range.

    Where there is too little to tell, it is None.

    Args:
        a_y: rising [m/s2].
        extra: delta - L r / v_x [rad].
    """

    def slope(low: float, high: float, *powers: int) -> float | None:
        inside = (a_y >= low) & (a_y <= high)
        if a_y.max() < high or np.count_nonzero(inside) < FEWEST:
            return None
        terms = np.column_stack([a_y[inside] ** power for power in powers])
        return float(np.linalg.lstsq(terms, extra[inside], rcond=None)[0][0])

    local = {level: slope(level - HALF, level + HALF, 1, 0) for level in LEVELS}
    return {0.0: slope(*WINDOW, 1, 0, 3), **local}

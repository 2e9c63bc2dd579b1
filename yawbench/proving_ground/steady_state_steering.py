"""Evaluation of steering tests in a steady state: understeer gradient, slowly increasing steer.

**Understeer gradient**: how much more a car has to be steered with increasing a_y than its geometry requires.

    delta = L kappa + K_us a_y,        delta = delta_h / i_s,  kappa = r / v_x

K_us is the slope of delta - L r / v_x over a_y; so it does not matter whether the speed was held and the hand
wheel turned slowly, or the radius was held and the speed raised. Tyres lose stiffness with the square of
a_y, so the gradient of the linear range is that at a_y = 0 of

    delta - L r / v_x = c_0 + K_us a_y + c_3 a_y^3                  fitted over 0.5 to 2 m/s2

Above that range it is local, the slope of a straight line over 1 m/s2.

Source: after ISO 4138, Passenger cars - Steady-state circular driving behaviour - Open-loop test methods,
from memory of the standard, which fits a curve and differentiates it; the cubic and its range are ours.

**Slowly increasing steer**: the hand-wheel angle A at 0.3 g, which sets the amplitudes of sine with dwell.

    A = mean |delta_h| at a_y = 0.3 g over all runs, each from a straight line through 0.1 to 0.375 g

Each angle and the mean are rounded to 0.1 degrees. The regulation asks for three runs to the left and three
to the right; where runs do not scatter, one to each side gives the same.

Source: UN Regulation No. 140 and GTR 8, "slowly increasing steer test": 80 +- 2 km/h, 13.5 deg/s, linear
regression, 0.3 g. The window of the regression, 0.1 to 0.375 g, is NHTSA's (TP-126), from memory.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from yawbench.foundation.errors import ScenarioError, text_of
from yawbench.metrics.verdict import NotJudged
from yawbench.orchestrator.plan import Plan
from yawbench.orchestrator.signal_names import Target
from yawbench.vocabulary.motion import LEAST_SPEED

from .sine_with_dwell import AMPLITUDE
from .standard_tests import Evaluation, evaluation
from .trace import Trace, prepared, refuse_opposed

FIT_RANGE = (0.5, 2.0)
"""Range of lateral acceleration of the cubic fit [m/s2]."""
ACCELERATIONS, HALF = (3.0, 4.0, 5.0, 6.0), 0.5
"""Lateral accelerations of the local gradients, and half the width of their windows [m/s2]."""
FEWEST = 20
"""Least number of samples in a window."""
UNIT = "rad.s2/m"


@evaluation
def evaluate_understeer(judged: Evaluation, trace: Trace) -> None:
    """Evaluate understeer gradients at the road wheels.

    The run must provide `steering_ratio` and, for the wheelbase, `cg_to_front_axle` and `cg_to_rear_axle`.
    """
    names = ("steering_wheel_angle", "yaw_rate", "velocity_x", "acceleration_y")
    hand, r, v, a_y = (trace[name][~trace.standing] for name in names)  # curvature is r / v
    if not v.size:
        raise NotJudged(f"the car is never faster than {3.6 * LEAST_SPEED:.0f} km/h")
    ratio, front, rear = map(trace.parameter, ("steering_ratio", "cg_to_front_axle", "cg_to_rear_axle"))
    side = math.copysign(1.0, float(a_y[np.argmax(np.abs(a_y))]))
    a_y = side * a_y
    extra = side * (hand / ratio - (front + rear) * r / np.maximum(v, 0.1))
    last = int(np.argmax(a_y))  # the slow rise ends here
    a_y, extra = a_y[: last + 1], extra[: last + 1]
    refuse_opposed(side * hand[: last + 1], a_y, "lateral acceleration")
    refuse_opposed(hand[: last + 1], r[: last + 1], "yaw rate")
    slopes = gradients(a_y, extra)
    gradient = slopes.pop(0.0)
    if gradient is None:
        raise NotJudged(
            f"lateral acceleration does not rise slowly through {FIT_RANGE[0]:g} to {FIT_RANGE[1]:g} m/s2"
        )
    reading = f"at zero of a cubic through {FIT_RANGE[0]:g} to {FIT_RANGE[1]:g} m/s2"
    judged.add("gradient", "understeer gradient at the road wheels", gradient, UNIT, reading)
    judged.add("gradient_hand", "understeer gradient at the hand wheel", gradient * ratio, UNIT, reading)
    if gradient > 0:
        speed = math.sqrt((front + rear) / gradient)
        judged.add("characteristic_speed", "characteristic speed", speed, "m/s", "sqrt(L / K_us)")
    reading = f"straight line over {2 * HALF:g} m/s2"
    for acceleration, local in slopes.items():
        judged.add(
            f"gradient_{acceleration:g}",
            f"understeer gradient at {acceleration:g} m/s2",
            local,
            UNIT,
            reading,
        )
    judged.add("largest", "largest lateral acceleration", float(a_y.max()), "m/s2")


def gradients(a_y: np.ndarray, extra: np.ndarray) -> dict[float, float | None]:
    """Return lateral acceleration [m/s2] -> understeer gradient there [rad.s2/m]; key 0: the linear range.

    The gradient is None where there are too few samples.

    Args:
        a_y: increasing [m/s2].
        extra: delta - L r / v_x [rad].
    """

    def slope(low: float, high: float, *powers: int) -> float | None:
        inside = (a_y >= low) & (a_y <= high)
        if a_y.max() < high or np.count_nonzero(inside) < FEWEST:
            return None
        terms = np.column_stack([a_y[inside] ** power for power in powers])
        return float(np.linalg.lstsq(terms, extra[inside], rcond=None)[0][0])

    local = {
        acceleration: slope(acceleration - HALF, acceleration + HALF, 1, 0) for acceleration in ACCELERATIONS
    }
    return {0.0: slope(*FIT_RANGE, 1, 0, 3), **local}


G = 9.80665
"""Standard gravity [m/s2]."""
SLOW_STEER = "slowly_increasing_steer"
"""Scenario of slowly increasing steer, and the folder of its runs in a driven series."""
SLOW_STEER_ACCELERATION, SLOW_STEER_WINDOW = 0.3 * G, (0.1 * G, 0.375 * G)
"""Lateral acceleration of A, and the window of the regression [m/s2]."""


@evaluation
def evaluate_slow_steer(judged: Evaluation, trace: Trace) -> None:
    """Evaluate slowly increasing steer: the hand-wheel angle at 0.3 g, `angle` [rad], and the fitted line."""
    judged.add("angle", "hand-wheel angle at 0.3 g", None, "rad")
    signals = prepared(trace, ("steering_wheel_angle", "acceleration_y"))
    angle, acceleration = signals["steering_wheel_angle"], signals["acceleration_y"]
    refuse_opposed(angle, acceleration, "lateral acceleration")
    side = math.copysign(1.0, float(angle[np.argmax(np.abs(angle))]))
    a_y, delta = side * acceleration, side * angle
    beyond = np.flatnonzero(a_y > SLOW_STEER_WINDOW[1])
    if not beyond.size:
        raise NotJudged(
            f"lateral acceleration reaches {a_y.max() / G:.3f} g, not {SLOW_STEER_WINDOW[1] / G:g} g"
        )
    end = int(beyond[0])
    before = np.flatnonzero(a_y[:end] < SLOW_STEER_WINDOW[0])
    begin = int(before[-1]) + 1 if before.size else 0
    if end - begin < FEWEST:
        raise NotJudged(
            f"{end - begin} samples between {SLOW_STEER_WINDOW[0] / G:g} and {SLOW_STEER_WINDOW[1] / G:g} g"
        )
    slope, intercept = np.polyfit(a_y[begin:end], delta[begin:end], 1)
    magnitude = math.radians(round(math.degrees(intercept + slope * SLOW_STEER_ACCELERATION), 1))
    reading = "straight line through 0.1 to 0.375 g, rounded to 0.1 degrees"
    judged.add("angle", "hand-wheel angle at 0.3 g", side * magnitude, "rad", reading)
    judged.add("slope", "hand-wheel angle per lateral acceleration", slope, "rad.s2/m", "of that line")
    spread = delta[begin:end] - (intercept + slope * a_y[begin:end])
    judged.add("spread", "largest distance from the line", float(np.max(np.abs(spread))), "rad")
    if "velocity_x" in trace:
        speed = trace.even["velocity_x"][: end + 1]
        judged.add("speed", "lowest speed up to 0.375 g", float(speed.min()), "m/s")


def characteristic_angle(judged: Sequence[Evaluation]) -> float:
    """Return A [rad]: the mean of |angle| over all runs, rounded to 0.1 degrees.

    Raises:
        NotJudged: a run has no angle, or there are no runs.
    """
    without = next((run for run in judged if run["angle"] is None), None)
    if without or not judged:
        why = text_of(without.diagnostics) if without else "no runs"
        raise NotJudged(f"slowly increasing steer{f', {without.label}' if without else ''}: {why}")
    mean = float(np.mean([abs(run["angle"] or 0.0) for run in judged]))
    return math.radians(round(math.degrees(mean), 1))


def slow_steer_amplitude(plan: Plan, scenario: Path) -> float:
    """Return the absolute amplitude of the driver in a plan of slowly increasing steer [rad].

    Raises:
        ScenarioError: the driver has none; names the scenario.
    """
    target = Target.parse(AMPLITUDE)
    for instance in plan.instances:
        value = instance.parameter(target.variable) if instance.name == target.instance else None
        if isinstance(value, (int, float)) and value != 0:
            return abs(float(value))
    raise ScenarioError(
        f"{scenario}: {AMPLITUDE} must be a non-zero hand-wheel amplitude", code="fmu-wrong-kind"
    )

"""Slowly increasing steer: the hand-wheel angle A at 0.3 g, from which sine with dwell follows.

    A = mean |delta_h| at a_y = 0.3 g over all runs, each from a straight line through 0.1 to 0.375 g

Each angle and the mean are rounded to 0.1 degrees. The regulation asks for three runs to the left and three
to the right; where runs do not scatter one of each says the same.

Source: UN Regulation No. 140 and GTR 8, "slowly increasing steer test": 80 +- 2 km/h, 13.5 deg/s, linear
regression, 0.3 g. The window of the regression, 0.1 to 0.375 g, is NHTSA's (TP-126), from memory.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .filters import prepared
from .judgement import Judgement, NotJudged, evaluation
from .signs import refuse_opposed
from .trace import Trace

G = 9.80665
"""Standard gravity [m/s2]."""
LEVEL, WINDOW = 0.3 * G, (0.1 * G, 0.375 * G)
"""Lateral acceleration of A, and the window of the regression [m/s2]."""
FEWEST = 20
"""Samples in the window. Chosen: a tenth of a second at 200 Hz."""


@evaluation
def evaluate_slow_steer(judged: Judgement, trace: Trace) -> None:
    """Return the angle at 0.3 g, `angle` [rad], and the line that it lies on."""
    judged.add("angle", "hand-wheel angle at 0.3 g", None, "rad")
    signals = prepared(trace, ("steering_wheel_angle", "acceleration_y"))
    angle, acceleration = signals["steering_wheel_angle"], signals["acceleration_y"]
    refuse_opposed(angle, acceleration, "lateral acceleration")
    side = math.copysign(1.0, float(angle[np.argmax(np.abs(angle))]))
    a_y, delta = side * acceleration, side * angle
    beyond = np.flatnonzero(a_y > WINDOW[1])
    if not beyond.size:
        raise NotJudged(f"lateral acceleration reaches {a_y.max() / G:.3f} g, not {WINDOW[1] / G:g} g")
    end = int(beyond[0])
    before = np.flatnonzero(a_y[:end] < WINDOW[0])
    begin = int(before[-1]) + 1 if before.size else 0
    if end - begin < FEWEST:
        raise NotJudged(f"{end - begin} samples between {WINDOW[0] / G:g} and {WINDOW[1] / G:g} g")
    slope, intercept = np.polyfit(a_y[begin:end], delta[begin:end], 1)
    found = math.radians(round(math.degrees(intercept + slope * LEVEL), 1))
    reading = "straight line through 0.1 to 0.375 g, rounded to 0.1 degrees"
    judged.add("angle", "hand-wheel angle at 0.3 g", side * found, "rad", reading)
    judged.add("slope", "hand-wheel angle per lateral acceleration", slope, "rad.s2/m", "of that line")
    spread = delta[begin:end] - (intercept + slope * a_y[begin:end])
    judged.add("spread", "largest distance from the line", float(np.max(np.abs(spread))), "rad")
    if "velocity_x" in trace:
        speed = trace.even["velocity_x"][: end + 1]
        judged.add("speed", "lowest speed up to 0.375 g", float(speed.min()), "m/s")


def characteristic_angle(judged: Sequence[Judgement]) -> float:
    """Return A [rad]: the mean of |angle| over all runs, rounded to 0.1 degrees.

    Raises:
        NotJudged: a run has none, or there is none.
    """
    without = next((one for one in judged if one["angle"] is None), None)
    if without or not judged:
        why = "; ".join(without.notes) if without else "there is no run"
        raise NotJudged(f"slowly increasing steer{f', {without.label}' if without else ''}: {why}")
    mean = float(np.mean([abs(one["angle"] or 0.0) for one in judged]))
    return math.radians(round(math.degrees(mean), 1))

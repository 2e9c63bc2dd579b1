"""Evaluation of steering tests: understeer gradient, slow ramp, step and sweep, double lane change.

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

**Step steer**: how quickly, how far and with how much overshoot a car responds to a step of the hand wheel.

    time zero        the hand wheel has reached half of its final angle
    steady value     mean over the last second of the record
    response time    from time zero until 90 % of the steady value is reached
    peak time        from time zero to the largest value;  overshoot = largest value / steady value - 1
    gain             steady value over final hand-wheel angle

of yaw rate and lateral acceleration, and T_beta = peak time of the yaw rate times steady sideslip, in rad s.

Source: after ISO 7401, Road vehicles - Lateral transient response test methods - Open-loop test methods; the
definitions are from memory of the standard.

**Frequency response** of yaw rate and lateral acceleration to the hand wheel, from a sweep.

    H(f) = sum Y X* / sum |X|^2          over the lines of the spectra within 0.05 Hz of f

X is the spectrum of the hand wheel, Y that of the response; the record begins and ends at rest. Frequencies
at which the hand wheel has less than a hundredth of its largest power are left out.

Source: after ISO 7401, Road vehicles - Lateral transient response test methods, from memory of the standard:
gains and phases from 0.2 to 2 Hz. Ours: the width of the bands, and the bandwidth, at which the gain has
fallen to 70.7 % of that at 0.2 Hz.

**Double lane change** between cones (ISO 3888): whether it is clean, and the highest clean entry speed.

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
from pathlib import Path

import numpy as np

from yawbench.foundation.errors import ScenarioError, text_of
from yawbench.metrics.verdict import NotJudged, apart, compare, not_judged
from yawbench.orchestrator.plan import Plan
from yawbench.orchestrator.signal_names import Target
from yawbench.vehicles.motion import largest
from yawbench.vocabulary.lane_change import lanes_of
from yawbench.vocabulary.motion import LEAST_SPEED

from .sine_with_dwell import AMPLITUDE
from .standard_tests import Evaluation, SeriesDriver, SeriesRun, TestSeries, evaluation
from .trace import SLOWEST, Trace, at, first_crossing, known, opposed, prepared, refuse_opposed

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


STEADY = 1.0
"""Time at the end of the record over which steady values are averaged [s]."""
STEP_SHARE = 0.9
"""Fraction of the steady value at which the response time ends."""
SETTLED = 0.02
"""Largest range of a steady signal, relative to its mean; chosen."""
RESPONSES = {
    "yaw_rate": ("yaw rate", "rad/s", "1/s"),
    "acceleration_y": ("lateral acceleration", "m/s2", "m/(s2.rad)"),
}
"""Signal -> its words, its unit, and that of its gain over the hand wheel."""


@evaluation
def evaluate_step(judged: Evaluation, trace: Trace) -> None:
    """Evaluate a step steer: gains, response times, overshoots."""
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
    for key, (name, *_) in RESPONSES.items():
        refuse_opposed(hand - hand[0], trace[key] - trace[key][0], name)
    judged.add("step", "final hand-wheel angle", step, "rad")
    judged.add("zero", "time zero", zero, "s", "half of the final hand-wheel angle")
    if "velocity_x" in trace:
        judged.add("speed", "speed at time zero", at(t, trace["velocity_x"], zero), "m/s")
    for key, (name, unit, of_gain) in RESPONSES.items():
        x = side * (trace[key] - trace[key][0])
        steady = float(x[end].mean())
        judged.add(f"{key}_steady", f"steady {name}", side * steady, unit, f"mean over the last {STEADY:g} s")
        judged.add(f"{key}_gain", f"gain of the {name}", steady / abs(step), of_gain, "over the hand wheel")
        if np.ptp(x[end]) > SETTLED * abs(steady):
            judged.report(
                "response-not-steady",
                f"the {name} is not steady at the end: {100 * np.ptp(x[end]) / abs(steady):.1f} %",
            )
        answered = first_crossing(t, x, STEP_SHARE * steady, float(t[0])) if steady > 0 else None
        judged.add(f"{key}_response", f"response time of the {name}", _since(answered, zero), "s", "to 90 %")
        largest = int(np.argmax(x))
        judged.add(f"{key}_peak", f"peak time of the {name}", float(t[largest]) - zero, "s")
        over = float(x[largest]) / steady - 1.0 if steady > 0 else None
        judged.add(f"{key}_overshoot", f"overshoot of the {name}", over, "%")
    if "sideslip" in trace:
        moving = trace.while_moving("sideslip")
        sideslip = known(float(moving[end].mean() - moving[0]))
        judged.add("sideslip_steady", "steady sideslip", sideslip, "rad")
        peak = judged["yaw_rate_peak"]
        t_beta = None if peak is None or sideslip is None else peak * abs(sideslip)
        judged.add("t_beta", "T_beta", t_beta, "rad.s")


def _since(instant: float | None, zero: float) -> float | None:
    return None if instant is None else instant - zero


FREQUENCIES = (0.2, 0.5, 1.0, 1.5, 2.0)
"""Frequencies of the reported gains and phases [Hz]."""
GRID = np.arange(0.2, 3.001, 0.02)
HALF_BAND = 0.05
LEAST = 0.01
"""Power of the hand wheel, relative to its largest, below which a frequency is left out."""


def response(trace: Trace, answer: str) -> np.ndarray:
    """Return H at the frequencies of `GRID`, NaN where the hand wheel has too little power; (n,).

    Raises:
        NotJudged: the record is too short or too coarse.
        ResultsError: a signal is missing.
    """
    if trace.time.size < 2 or trace.time[-1] - trace.time[0] < 1.0 / HALF_BAND or trace.rate < SLOWEST:
        raise NotJudged(f"needs a record of {1.0 / HALF_BAND:g} s at {SLOWEST:g} Hz")
    even = trace.even
    frequency = np.fft.rfftfreq(even.time.size, 1.0 / even.rate)
    spectrum = [np.fft.rfft(even[name] - even[name][0]) for name in ("steering_wheel_angle", answer)]
    bands = [np.abs(frequency - f) <= HALF_BAND for f in GRID]
    power = np.array([np.mean(np.abs(spectrum[0][band]) ** 2) for band in bands])
    cross = np.array([np.mean(spectrum[1][band] * np.conj(spectrum[0][band])) for band in bands])
    known = power >= LEAST * max(float(power.max()), 1e-300)
    return np.where(known, cross / np.where(known, power, 1.0), np.nan)


@evaluation
def evaluate_sweep(judged: Evaluation, trace: Trace) -> None:
    """Evaluate a frequency sweep: gains, phases, largest gain and bandwidth."""
    responses = {key: response(trace, key) for key in RESPONSES}
    for key, (name, *_) in RESPONSES.items():
        if responses[key][0].real < 0.0:  # lags by over a quarter period at 0.2 Hz, or has the wrong sign
            raise opposed(name)
    for key, (name, _, unit) in RESPONSES.items():
        values = responses[key]
        gain, phase = np.abs(values), np.angle(values)
        for f in FREQUENCIES:
            k = int(np.argmin(np.abs(GRID - f)))
            there = bool(np.isfinite(gain[k]))
            judged.add(
                f"{key}_gain_{f:g}", f"gain of the {name} at {f:g} Hz", gain[k] if there else None, unit
            )
            judged.add(f"{key}_phase_{f:g}", f"its phase at {f:g} Hz", phase[k] if there else None, "rad")
        if not np.isfinite(gain[0]):
            continue
        most = int(np.nanargmax(gain))
        judged.add(
            f"{key}_peak", f"largest gain of the {name} over that at 0.2 Hz", gain[most] / gain[0], "1"
        )
        judged.add(f"{key}_peak_at", "its frequency", GRID[most], "Hz")
        below = np.flatnonzero(gain[most:] < math.sqrt(0.5) * gain[0])
        width = GRID[most + below[0]] if below.size else None
        judged.add(
            f"{key}_bandwidth", f"bandwidth of the {name}", width, "Hz", "70.7 % of the gain at 0.2 Hz"
        )


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

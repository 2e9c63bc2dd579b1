"""Evaluation of how a car responds to its hand wheel: step steer, frequency response.

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
"""

from __future__ import annotations

import math

import numpy as np

from yawbench.metrics.verdict import NotJudged

from .standard_tests import Evaluation, evaluation
from .trace import SLOWEST, Trace, at, first_crossing, known, opposed, refuse_opposed

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

"""Frequency response of yaw rate and lateral acceleration to the hand wheel, from a sweep.

    H(f) = sum Y X* / sum |X|^2          over the lines of the spectra within 0.05 Hz of f

X is the spectrum of the hand wheel, Y that of the answer; the record begins and ends at rest. Where the hand
wheel has less than a hundredth of its largest power nothing is told.

Source: after ISO 7401, Road vehicles - Lateral transient response test methods, from memory of the standard:
gains and phases from 0.2 to 2 Hz. Ours: the width of the bands, and as bandwidth where the gain has fallen to
70.7 % of that at 0.2 Hz.
"""

from __future__ import annotations

import math

import numpy as np

from .filters import SLOWEST
from .judgement import Judgement, NotJudged, evaluation
from .signs import opposed
from .trace import Trace

FREQUENCIES = (0.2, 0.5, 1.0, 1.5, 2.0)
"""At which gain and phase are told [Hz]."""
GRID = np.arange(0.2, 3.001, 0.02)
HALF_BAND = 0.05
LEAST = 0.01
"""Power of the hand wheel, over its largest, below which it says nothing of a frequency."""
ANSWERS = {"yaw_rate": ("yaw rate", "1/s"), "acceleration_y": ("lateral acceleration", "m/(s2.rad)")}


def response(trace: Trace, answer: str) -> np.ndarray:
    """Return H at the frequencies of `GRID`, NaN where the hand wheel says nothing; shape (frequencies,).

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
def evaluate_sweep(judged: Judgement, trace: Trace) -> None:
    """Return gains, phases, largest gain and bandwidth."""
    responses = {key: response(trace, key) for key in ANSWERS}
    for key, (name, _) in ANSWERS.items():
        if responses[key][0].real < 0.0:  # more than a quarter of a period late at 0.2 Hz, or turned round
            raise opposed(name)
    for key, (name, unit) in ANSWERS.items():
        found = responses[key]
        gain, phase = np.abs(found), np.angle(found)
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

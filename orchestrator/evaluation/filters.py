"""Signals prepared as regulations ask: even sampling, phaseless low pass, rates, instants in between.

Low pass: a Butterworth filter of sixth order, forth and back, which has twelve poles and no phase (at the
cut-off frequency the amplitude is halved). GTR 8 names "a 12-pole phaseless Butterworth filter"; that its
twelve poles are those of both directions together is our reading. Unfiltered signals change a yaw-rate ratio
of sine with dwell by up to 0.8 points, another order or cut-off by 0.1 points at most.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from .judgement import NotJudged

if TYPE_CHECKING:
    from .trace import Trace

ORDER = 6
CUT_OFF = {"steering_wheel_angle": 10.0, "yaw_rate": 6.0, "acceleration_y": 6.0}
"""Of the low pass [Hz]: GTR 8."""
SHORTEST = 1.0
"""Record without which there is nothing to filter [s]."""
SLOWEST = 50.0
"""Sampling rate below which nothing is judged [Hz]. Chosen: 2.5 times what a low pass of 10 Hz must have."""
UNEVEN = 1e-6
"""Relative difference of steps up to which sampling is even; chosen: rounding of times in files."""


def even_grid(time: np.ndarray) -> np.ndarray:
    """Return the times of even sampling, at the median step [s] where they are uneven; shape (rows,)."""
    steps = np.diff(time)
    step = float(np.median(steps))
    if np.all(np.abs(steps - step) <= UNEVEN * max(step, 1e-12) + 1e-9):
        return time
    return np.asarray(time[0] + step * np.arange(int((time[-1] - time[0]) / step + 1e-9) + 1))


def resample(grid: np.ndarray, time: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return x at the times of a grid by monotone cubic interpolation; x itself if they are its own."""
    if grid is time:
        return x
    from scipy.interpolate import PchipInterpolator

    return np.asarray(PchipInterpolator(time, x)(grid))


def prepared(trace: Trace, names: Iterable[str]) -> dict[str, np.ndarray]:
    """Return the signals of a trace behind their filters, and `time`.

    Raises:
        NotJudged: the record is too short or too coarse.
        ResultsError: a signal is missing.
    """
    wanted = [(name, trace[name]) for name in names]
    if trace.time.size < 2 or trace.time[-1] - trace.time[0] < SHORTEST:
        raise NotJudged(f"the record is shorter than {SHORTEST:g} s")
    if trace.rate < SLOWEST:
        raise NotJudged(f"sampled at {trace.rate:.3g} Hz; at least {SLOWEST:g} Hz are needed")
    even = trace.even
    filtered = {name: low_pass(even[name], CUT_OFF[name], even.rate) for name, _ in wanted}
    return {"time": even.time, **filtered}


def low_pass(x: np.ndarray, cut_off: float, rate: float) -> np.ndarray:
    """Return x behind the phaseless Butterworth filter.

    Args:
        x: shape (rows,), sampled evenly.
        cut_off: frequency [Hz].
        rate: of sampling [Hz].
    """
    from scipy.signal import butter, sosfiltfilt

    sections = butter(ORDER, cut_off, fs=rate, output="sos")
    edge = min(len(x) - 1, int(rate))
    return np.asarray(sosfiltfilt(sections, x, padlen=edge))


def running_mean(x: np.ndarray, width: float, rate: float) -> np.ndarray:
    """Return the centred mean over `width` [s]; at the ends over what there is of it."""
    half = round(0.5 * width * rate)
    total = np.concatenate([[0.0], np.cumsum(x)])
    first = np.maximum(np.arange(len(x)) - half, 0)
    last = np.minimum(np.arange(len(x)) + half + 1, len(x))
    return np.asarray((total[last] - total[first]) / (last - first))


def first_crossing(time: np.ndarray, x: np.ndarray, level: float, after: float) -> float | None:
    """Return the first instant [s] from `after` on at which x has risen to `level`; None if it never has.

    Between two samples x runs along a straight line.
    """
    reached = np.flatnonzero((x >= level) & (time >= after))
    if not reached.size:
        return None
    k = int(reached[0])
    if k == 0 or x[k - 1] >= level:
        return max(float(time[k - 1]) if k else float(time[0]), after)
    share = (level - x[k - 1]) / (x[k] - x[k - 1])
    return max(float(time[k - 1] + share * (time[k] - time[k - 1])), after)


def at(time: np.ndarray, x: np.ndarray, instant: float) -> float:
    """Return x at an instant [s] on a straight line between two samples."""
    return float(np.interp(instant, time, x))

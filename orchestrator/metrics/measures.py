"""The table of measures: a number for a signal, or for a signal and its reference.

All functions take time `t` [s] and samples of equal shape (n,), n >= 2, in SI units, and give SI
units. Integrals are taken by the trapezoidal rule, so uneven samples are right too. Measures of the
phase plane take the signal and its rate: the recorded one, else the difference quotient.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

SETTLING_BAND = 0.05
"""Half-width of the band a settled signal stays in, relative to the reference's peak."""

RETURN_RATE = 4.0
"""Slope of the lines that bound the stable strip in the plane of sideslip and its rate [1/s]."""
BOUNDARY = math.radians(24.0)
"""Sideslip rate at which these lines cross the axis [rad/s].

The strip |B1 beta + B2 dbeta/dt| < 1 is that of He, Crolla, Levesley, Manning, Coordination of active
steering, driveline, and braking for integrated vehicle dynamics, Proc. IMechE D 220 (2006). Chosen:
B1 = 4/24 and B2 = 1/24 s per degree, values in common use; they are not measured on these cars.
"""


JERK_WINDOW = 0.1
"""Over which a signal is averaged before its slope is taken [s]. Chosen: the bare difference quotient of an
acceleration is the jump at a controller's samples; people feel some 10 Hz at most."""


def integral(t: np.ndarray, x: np.ndarray) -> float:
    """Return the integral of x over t."""
    return float(np.sum(np.diff(t) * (x[1:] + x[:-1])) / 2)


def running_integral(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the integral of x from t[0] to every t."""
    return np.concatenate([[0.0], np.cumsum(np.diff(t) * (x[1:] + x[:-1]) / 2)])


def mean_error(t: np.ndarray, x: np.ndarray, x_ref: np.ndarray) -> float:
    """Return the mean absolute error over time."""
    return integral(t, np.abs(x - x_ref)) / float(t[-1] - t[0])


def rms_error(t: np.ndarray, x: np.ndarray, x_ref: np.ndarray) -> float:
    """Return the root of the mean squared error over time."""
    return math.sqrt(integral(t, (x - x_ref) ** 2) / float(t[-1] - t[0]))


def peak_error(t: np.ndarray, x: np.ndarray, x_ref: np.ndarray) -> float:
    """Return the largest absolute error."""
    return float(np.max(np.abs(x - x_ref)))


def _by_reference_peak(value: float, x_ref: np.ndarray) -> float:
    largest = float(np.max(np.abs(x_ref)))
    return value / largest if largest > 0 else math.nan


def relative_peak_error(t: np.ndarray, x: np.ndarray, x_ref: np.ndarray) -> float:
    """Return the largest absolute error over the reference's peak; NaN for a reference of zero."""
    return _by_reference_peak(peak_error(t, x, x_ref), x_ref)


def relative_rms_error(t: np.ndarray, x: np.ndarray, x_ref: np.ndarray) -> float:
    """Return the RMS error over the reference's peak; NaN for a reference of zero."""
    return _by_reference_peak(rms_error(t, x, x_ref), x_ref)


def relative_mean_error(t: np.ndarray, x: np.ndarray, x_ref: np.ndarray) -> float:
    """Return the mean absolute error over the reference's peak; NaN for a reference of zero."""
    return _by_reference_peak(mean_error(t, x, x_ref), x_ref)


def overshoot(t: np.ndarray, x: np.ndarray, x_ref: np.ndarray) -> float:
    """Return how far the signal's peak exceeds the reference's, relative to it; 0 if it does not."""
    return max(0.0, _by_reference_peak(peak(t, x), x_ref) - 1.0) if np.any(x_ref) else math.nan


def settling_time(t: np.ndarray, x: np.ndarray, x_ref: np.ndarray) -> float:
    """Return the time from t[0] after which the error stays in the settling band; inf if it does not."""
    band = SETTLING_BAND * float(np.max(np.abs(x_ref)))
    if band == 0:
        return math.nan
    outside = np.flatnonzero(np.abs(x - x_ref) > band)
    if outside.size == 0:
        return 0.0
    last = int(outside[-1])
    return math.inf if last == t.size - 1 else float(t[last + 1] - t[0])


def peak(t: np.ndarray, x: np.ndarray) -> float:
    """Return the largest absolute value."""
    return float(np.max(np.abs(x)))


def displacement(t: np.ndarray, x: np.ndarray) -> float:
    """Return the largest distance from the first value."""
    return float(np.max(np.abs(x - x[0])))


def changes(t: np.ndarray, x: np.ndarray) -> float:
    """Return 1 if the signal ever leaves its first value, else 0: the mean of repeats is the share."""
    return float(np.any(x != x[0]))


def change_time(t: np.ndarray, x: np.ndarray) -> float:
    """Return the time from t[0] until the signal leaves its first value; NaN if it never does."""
    left = np.flatnonzero(x != x[0])
    return float(t[left[0]] - t[0]) if left.size else math.nan


def final(t: np.ndarray, x: np.ndarray) -> float:
    """Return the last value."""
    return float(x[-1])


def effort(t: np.ndarray, x: np.ndarray) -> float:
    """Return the integral of the absolute value."""
    return integral(t, np.abs(x))


def total_variation(t: np.ndarray, x: np.ndarray) -> float:
    """Return the sum of the absolute changes from sample to sample."""
    return float(np.sum(np.abs(np.diff(x))))


def total_variation_rate(t: np.ndarray, x: np.ndarray) -> float:
    """Return the total variation per second: the measure of chatter."""
    return total_variation(t, x) / float(t[-1] - t[0])


def slope_variation_rate(t: np.ndarray, x: np.ndarray) -> float:
    """Return the total variation per second of the difference quotient dx/dt."""
    return float(np.sum(np.abs(np.diff(np.diff(x) / np.diff(t))))) / float(t[-1] - t[0])


def rms(t: np.ndarray, x: np.ndarray) -> float:
    """Return the root of the mean square over time."""
    return rms_error(t, x, np.zeros_like(x))


def phase_area(t: np.ndarray, x: np.ndarray, x_rate: np.ndarray) -> float:
    """Return the area that closed loops of (x, dx/dt) enclose: the integral of dx/dt over x, by time."""
    return integral(t, x_rate**2)


def stability_index(t: np.ndarray, x: np.ndarray, x_rate: np.ndarray) -> float:
    """Return how far the sideslip leaves the stable strip of the phase plane; up to 1 it is inside."""
    return float(np.max(np.abs(x_rate + RETURN_RATE * x))) / BOUNDARY


def time_beyond(t: np.ndarray, x: np.ndarray, x_rate: np.ndarray) -> float:
    """Return the share of the time that the sideslip is outside the stable strip, by whole samples."""
    outside = np.abs(x_rate + RETURN_RATE * x) > BOUNDARY
    return float(np.sum(np.diff(t)[outside[:-1]])) / float(t[-1] - t[0])


def grip_use(t: np.ndarray, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> float:
    """Return the root of the mean square of a tyre's force in the road's plane over its load.

    A wheel in the air, which has neither, uses nothing.
    """
    used = np.divide(x**2 + y**2, z**2, out=np.zeros_like(z), where=(z != 0.0) | (x != 0.0) | (y != 0.0))
    return math.sqrt(integral(t, used) / float(t[-1] - t[0]))


def jerk(t: np.ndarray, x: np.ndarray) -> float:
    """Return the RMS of the slope between means over two successive windows of `JERK_WINDOW`."""
    total = running_integral(t, x)
    begin = t[t <= t[-1] - 2 * JERK_WINDOW]
    if begin.size < 2:
        return math.nan
    first, middle, last = (np.interp(begin + k * JERK_WINDOW, t, total) for k in (0, 1, 2))
    return rms(begin, (last - 2 * middle + first) / JERK_WINDOW**2)


def relative_path_error(
    t: np.ndarray,
    y: np.ndarray,
    yaw_angle: np.ndarray,
    v_x: np.ndarray,
    yaw_rate_ref: np.ndarray,
    sideslip_ref: np.ndarray,
) -> float:
    """Return the RMS distance to the side from the path of a car that follows its reference.

    Relative to how far that path leads aside; that car begins where and as this one does, and is as fast.
    """
    course = yaw_angle[0] + running_integral(t, yaw_rate_ref) + sideslip_ref
    return relative_rms_error(t, y - y[0], running_integral(t, v_x * np.sin(course)))


@dataclass(frozen=True)
class Measure:
    """A row of the table of measures."""

    function: Callable[..., float]
    formula: str  # x the signal, x_ref its reference, T the duration
    definition: str
    unit: str  # "{x}" the signal's, "{x}/s" per second, "%" a ratio shown in per cent, or a unit
    needs_reference: bool = False
    needs_rate: bool = False
    beside: tuple[str, ...] = ()  # other signals that it takes, of the same wheel
    signal_unit: str | None = None  # the only unit of a signal that it means anything for
    signal: str | None = None  # the only signal, or one of each wheel


MEASURES: dict[str, Measure] = {
    "mean_error": Measure(mean_error, "1/T ∫|{x} - {x_ref}| dt", "mean absolute tracking error", "{x}", True),
    "rms_error": Measure(
        rms_error, "√(1/T ∫({x} - {x_ref})² dt)", "root mean square tracking error", "{x}", True
    ),
    "peak_error": Measure(peak_error, "max|{x} - {x_ref}|", "largest tracking error", "{x}", True),
    "relative_mean_error": Measure(
        relative_mean_error,
        "1/T ∫|{x} - {x_ref}| dt / max|{x_ref}|",
        "mean absolute tracking error over the reference's peak",
        "%",
        True,
    ),
    "relative_rms_error": Measure(
        relative_rms_error,
        "√(1/T ∫({x} - {x_ref})² dt) / max|{x_ref}|",
        "root mean square tracking error over the reference's peak",
        "%",
        True,
    ),
    "relative_peak_error": Measure(
        relative_peak_error,
        "max|{x} - {x_ref}| / max|{x_ref}|",
        "largest tracking error over the reference's peak",
        "%",
        True,
    ),
    "overshoot": Measure(
        overshoot, "max|{x}| / max|{x_ref}| - 1", "excess of the peak over the reference's peak", "%", True
    ),
    "settling_time": Measure(
        settling_time,
        "t: |{x} - {x_ref}| ≤ 5 % max|{x_ref}| from then on",
        "time from the start after which the error stays within 5 % of the reference's peak",
        "s",
        True,
    ),
    "peak": Measure(peak, "max|{x}|", "largest absolute value", "{x}"),
    "displacement": Measure(
        displacement, "max|{x} - {x}(0)|", "largest distance from the first value", "{x}"
    ),
    "changes": Measure(
        changes, "1 if {x} ≠ {x}(0) ever, else 0", "whether it ever leaves its first value", "%"
    ),
    "change_time": Measure(
        change_time, "t: {x} ≠ {x}(0) for the first time", "time until it leaves its first value", "s"
    ),
    "value": Measure(final, "{x}(t)", "value at a time", "{x}"),
    "final": Measure(final, "{x}(T)", "last value", "{x}"),
    "effort": Measure(effort, "∫|{x}| dt", "control effort: integral of the absolute value", "{x}.s"),
    "total_variation": Measure(
        total_variation, "Σ|Δ{x}|", "total variation: sum of the absolute changes", "{x}"
    ),
    "total_variation_rate": Measure(
        total_variation_rate, "Σ|Δ{x}| / T", "chatter: total variation per second", "{x}/s"
    ),
    "slope_variation_rate": Measure(
        slope_variation_rate,
        "Σ|Δ(d{x}/dt)| / T",
        "chatter of the rate: total variation per second of dx/dt",
        "{x}/s2",
    ),
    "rms": Measure(rms, "√(1/T ∫{x}² dt)", "root mean square", "{x}"),
    "jerk": Measure(
        jerk,
        "√(1/T ∫(Δ{x} / 0.1 s)² dt), {x} in means over 0.1 s",
        "comfort: root mean square of the slope between means over successive 0.1 s",
        "{x}/s",
    ),
    "grip_use": Measure(
        grip_use,
        "√(1/T ∫(F_x² + F_y²) / F_z² dt)",
        "root mean square of the tyre's force in the road's plane over its load",
        "1",
        beside=("tyre_force_y", "vertical_load"),
        signal="tyre_force_x",
    ),
    "relative_path_error": Measure(
        relative_path_error,
        "√(1/T ∫(y - y_ref)² dt) / max|y_ref|, y_ref = ∫v_x sin(∫r_ref dt + β_ref) dt",
        "root mean square distance to the side from the path of a car that follows its reference, over how "
        "far that path leads aside",
        "%",
        beside=("yaw_angle", "velocity_x", "yaw_rate_ref", "sideslip_ref"),
        signal="position_y",
    ),
    "phase_area": Measure(
        phase_area,
        "∫(d{x}/dt)² dt",
        "phase plane: area that loops of the signal and its rate enclose",
        "{x}2/s",
        needs_rate=True,
    ),
    "stability_index": Measure(
        stability_index,
        "max|d{x}/dt + 4 {x}/s| / (24 °/s)",
        "phase plane: largest distance from the middle of the stable strip; 1 is its edge",
        "1",
        needs_rate=True,
        signal_unit="rad",
    ),
    "time_beyond": Measure(
        time_beyond,
        "share of T with |d{x}/dt + 4 {x}/s| > 24 °/s",
        "phase plane: share of the time outside the stable strip",
        "%",
        needs_rate=True,
        signal_unit="rad",
    ),
}
"""All measures, the one table that definitions and units are taken from."""


@dataclass(frozen=True)
class Entry:
    """A measure as a table of the documentation shows it."""

    name: str
    definition: str
    formula: str  # of x, its reference x_ref, its duration T
    unit: str  # in words: "of the signal", "of the signal, per s"
    needs: str  # what it takes beside the signal, in words


_UNITS = {
    "{x}": "of the signal",
    "{x}/s": "of the signal, per s",
    "{x}/s2": "of the signal, per s2",
    "{x}.s": "of the signal, times s",
    "{x}2/s": "of the signal squared, per s",
}


def catalogue() -> list[Entry]:
    """Return all measures with their definitions, formulas and units."""
    return [
        Entry(
            name,
            one.definition,
            one.formula.replace("{x_ref}", "x_ref").replace("{x}", "x"),
            _UNITS.get(one.unit, one.unit),
            "a reference"
            if one.needs_reference
            else "its rate"
            if one.needs_rate
            else " and ".join(one.beside),
        )
        for name, one in MEASURES.items()
    ]

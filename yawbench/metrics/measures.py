"""Measures: functions from a signal, or a signal and its reference, to a number; their symbols and units.

All functions take time `t` [s] and samples of equal shape (n,), n >= 2, in SI units, and return SI units.
Integrals use the trapezoidal rule, so uneven samples are handled correctly. Measures of the phase plane take
the signal and its rate: the recorded one, else the difference quotient.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeVar

import numpy as np

from yawbench.orchestrator.scenario.quantities import conversion, measure_of, parse_unit
from yawbench.orchestrator.signal_names import SignalName
from yawbench.vehicles.motion import BACKWARDS, SPIN
from yawbench.vocabulary.signals import SIGNALS
from yawbench.vocabulary.wheels import WHEEL_NAMES

SETTLING_BAND = 0.05
"""Half-width of the band of a settled signal, relative to the reference's peak."""

RETURN_RATE = 4.0
"""Slope of the lines that bound the stable strip in the plane of sideslip and its rate [1/s]."""
BOUNDARY = math.radians(24.0)
"""Sideslip rate at which these lines cross the axis [rad/s].

The strip |B1 beta + B2 dbeta/dt| < 1 is that of He, Crolla, Levesley, Manning, Coordination of active
steering, driveline, and braking for integrated vehicle dynamics, Proc. IMechE D 220 (2006). Chosen:
B1 = 4/24 and B2 = 1/24 s per degree, values in common use; they are not measured on these cars.
"""
JERK_WINDOW = 0.1
"""Averaging time of a signal before its slope is taken [s]. Chosen: the plain difference quotient of an
acceleration is the jump at a controller's samples; people feel some 10 Hz at most."""

BRAKED = 20.0
"""Braking torque above which a wheel counts as braked [N.m]. Chosen: 1 bar at a front wheel."""

Function = Callable[..., Any]
F = TypeVar("F", bound=Function)


@dataclass(frozen=True)
class Measure:
    """A row of the table of measures: a function of time and of the signals that its other parameters name.

    These are a signal `x`, perhaps with its reference `x_ref` or its rate `x_rate`, or signals of the
    vocabulary: then the measure is one of the first of them, with the others recorded for the same wheel.
    """

    function: Function
    formula: str  # x the signal, x_ref its reference, T the duration
    definition: str
    unit: str  # "{x}": the signal's; "{x}/s": that per second; "%": a ratio shown in per cent; else a unit
    takes: tuple[str, ...]
    signal_unit: str | None = None  # the only unit that a signal may have
    of_changes: bool = False  # measures changes over time: an angle goes on where it wraps at 180 degrees
    whether: bool = False  # 1 if something happens in a run, else 0: of many runs the mean is a share

    @property
    def needs_reference(self) -> bool:
        return "x_ref" in self.takes

    @property
    def needs_rate(self) -> bool:
        return "x_rate" in self.takes

    @property
    def signal(self) -> str | None:
        """The signal that the measure is defined for, perhaps one per wheel; None: any."""
        return None if self.takes[0] == "x" else self.takes[0]

    @property
    def beside(self) -> tuple[str, ...]:
        """The further signals that it takes, of the same wheel."""
        return self.takes[1:] if self.signal else ()


MEASURES: dict[str, Measure] = {}
"""All measures by name, the only source of their definitions and units."""


def measure(
    formula: str,
    definition: str,
    unit: str,
    *,
    signal_unit: str | None = None,
    name: str = "",
    of_changes: bool = False,
    whether: bool = False,
) -> Callable[[F], F]:
    """Return a decorator that registers a function in the table, by default under its own name."""

    def enter(function: F) -> F:
        takes = tuple(inspect.signature(function).parameters)[1:]
        row = Measure(function, formula, definition, unit, takes, signal_unit, of_changes, whether)
        MEASURES[name or function.__name__] = row
        return function

    return enter


def integral(t: np.ndarray, x: np.ndarray) -> float:
    """Return the integral of x over t."""
    return float(np.sum(np.diff(t) * (x[1:] + x[:-1])) / 2)


def running_integral(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the integral of x from t[0] to every t."""
    return np.concatenate([[0.0], np.cumsum(np.diff(t) * (x[1:] + x[:-1]) / 2)])


def _mean(t: np.ndarray, x: np.ndarray) -> float:
    return integral(t, x) / float(t[-1] - t[0])


@measure("1/T ∫|{x} - {x_ref}| dt", "mean absolute tracking error", "{x}")
def mean_error(t: np.ndarray, x: np.ndarray, x_ref: np.ndarray) -> float:
    return _mean(t, np.abs(x - x_ref))


@measure("√(1/T ∫({x} - {x_ref})² dt)", "root mean square tracking error", "{x}")
def rms_error(t: np.ndarray, x: np.ndarray, x_ref: np.ndarray) -> float:
    return math.sqrt(_mean(t, (x - x_ref) ** 2))


@measure("max|{x} - {x_ref}|", "largest tracking error", "{x}")
def peak_error(t: np.ndarray, x: np.ndarray, x_ref: np.ndarray) -> float:
    return peak(t, x - x_ref)


def _relative(error: str) -> Callable[[np.ndarray, np.ndarray, np.ndarray], float]:
    """Register an error divided by the reference's peak; it is NaN for a reference of zero."""
    absolute = MEASURES[error]

    @measure(
        f"{absolute.formula} / max|{{x_ref}}|",
        f"{absolute.definition} over the reference's peak",
        "%",
        name=f"relative_{error}",
    )
    def relative(t: np.ndarray, x: np.ndarray, x_ref: np.ndarray) -> float:
        largest = peak(t, x_ref)
        return absolute.function(t, x, x_ref) / largest if largest > 0 else math.nan

    return relative


relative_mean_error, relative_rms_error, relative_peak_error = map(
    _relative, ("mean_error", "rms_error", "peak_error")
)


@measure("max|{x}| / max|{x_ref}| - 1", "excess of the peak over the reference's peak", "%")
def overshoot(t: np.ndarray, x: np.ndarray, x_ref: np.ndarray) -> float:
    return max(0.0, peak(t, x) / peak(t, x_ref) - 1.0) if np.any(x_ref) else math.nan


@measure(
    "t: |{x} - {x_ref}| ≤ 5 % max|{x_ref}| from then on",
    "time from the start after which the error stays within 5 % of the reference's peak",
    "s",
)
def settling_time(t: np.ndarray, x: np.ndarray, x_ref: np.ndarray) -> float:
    band = SETTLING_BAND * peak(t, x_ref)
    if band == 0:
        return math.nan
    outside = np.flatnonzero(np.abs(x - x_ref) > band)
    if outside.size == 0:
        return 0.0
    last = int(outside[-1])
    return math.inf if last == t.size - 1 else float(t[last + 1] - t[0])


@measure("max|{x}|", "largest absolute value", "{x}")
def peak(t: np.ndarray, x: np.ndarray) -> float:
    return float(np.max(np.abs(x)))


@measure("max|{x} - {x}(0)|", "largest distance from the first value", "{x}", of_changes=True)
def displacement(t: np.ndarray, x: np.ndarray) -> float:
    return peak(t, x - x[0])


@measure("1 if {x} ≠ {x}(0) ever, else 0", "whether it ever leaves its first value", "%", whether=True)
def changes(t: np.ndarray, x: np.ndarray) -> float:
    return float(np.any(x != x[0]))


@measure(
    f"1 if max|β| > {math.degrees(SPIN):g}°, else 0",
    "whether the car spins: as the event `car-spins`, from straight back if it begins to move backwards",
    "%",
    whether=True,
)
def spins(t: np.ndarray, sideslip: np.ndarray) -> float:
    backwards = abs(sideslip[0]) > BACKWARDS
    aside = np.pi - np.abs(sideslip) if backwards else np.abs(sideslip)
    if np.any(aside > SPIN):
        return 1.0
    return math.nan if np.isnan(aside).any() else 0.0


@measure("t: {x} ≠ {x}(0) for the first time", "time until it leaves its first value", "s")
def change_time(t: np.ndarray, x: np.ndarray) -> float:
    left = np.flatnonzero(x != x[0])
    return float(t[left[0]] - t[0]) if left.size else math.nan


@measure("{x}(T)", "last value", "{x}")
@measure("{x}(t)", "value at a time", "{x}", name="value")
def final(t: np.ndarray, x: np.ndarray) -> float:
    return float(x[-1])


@measure("∫|{x}| dt", "control effort: integral of the absolute value", "{x}.s")
def effort(t: np.ndarray, x: np.ndarray) -> float:
    return integral(t, np.abs(x))


@measure("Σ|Δ{x}|", "total variation: sum of the absolute changes", "{x}", of_changes=True)
def total_variation(t: np.ndarray, x: np.ndarray) -> float:
    return float(np.sum(np.abs(np.diff(x))))


@measure("Σ|Δ{x}| / T", "chatter: total variation per second", "{x}/s", of_changes=True)
def total_variation_rate(t: np.ndarray, x: np.ndarray) -> float:
    return total_variation(t, x) / float(t[-1] - t[0])


@measure(
    "Σ|Δ(d{x}/dt)| / T", "chatter of the rate: total variation per second of dx/dt", "{x}/s2", of_changes=True
)
def slope_variation_rate(t: np.ndarray, x: np.ndarray) -> float:
    return total_variation_rate(t, np.diff(x) / np.diff(t))


@measure("√(1/T ∫{x}² dt)", "root mean square", "{x}")
def rms(t: np.ndarray, x: np.ndarray) -> float:
    return math.sqrt(_mean(t, x**2))


@measure("max √(1/1 s ∫{x}² dt) over a second", "root mean square of the worst second", "{x}")
def worst_second(t: np.ndarray, x: np.ndarray) -> float:
    total = running_integral(t, x**2)
    begin = t[t <= t[-1] - 1.0]
    seconds = np.interp(begin + 1.0, t, total) - total[: begin.size]
    return math.sqrt(max(0.0, float(seconds.max()))) if begin.size else math.nan


@measure(
    "√(1/T ∫(Δ{x} / 0.1 s)² dt), {x} in means over 0.1 s",
    "comfort: root mean square of the slope between means over successive 0.1 s",
    "{x}/s",
    of_changes=True,
)
def jerk(t: np.ndarray, x: np.ndarray) -> float:
    total = running_integral(t, x)
    begin = t[t <= t[-1] - 2 * JERK_WINDOW]
    if begin.size < 2:
        return math.nan
    first, middle, last = (np.interp(begin + k * JERK_WINDOW, t, total) for k in (0, 1, 2))
    return rms(begin, (last - 2 * middle + first) / JERK_WINDOW**2)


@measure(
    "√(1/T ∫(F_x² + F_y²) / F_z² dt)",
    "root mean square of the tyre's force in the road's plane over its load",
    "1",
)
def grip_use(
    t: np.ndarray, tyre_force_x: np.ndarray, tyre_force_y: np.ndarray, vertical_load: np.ndarray
) -> float:
    force, load = tyre_force_x**2 + tyre_force_y**2, vertical_load**2
    in_the_air = (force == 0.0) & (load == 0.0)  # a wheel in the air uses no friction
    used = np.divide(force, load, out=np.zeros_like(load), where=~in_the_air)
    return math.sqrt(_mean(t, used))


@measure(
    "√(1/T ∫(y - y_ref)² dt) / max|y_ref|, y_ref = ∫v_x sin(∫r_ref dt + β_ref) dt",
    "root mean square distance to the side from the path of a car that follows its reference, over how "
    "far that path leads aside",
    "%",
)
def relative_path_error(
    t: np.ndarray,
    position_y: np.ndarray,
    yaw_angle: np.ndarray,
    velocity_x: np.ndarray,
    yaw_rate_ref: np.ndarray,
    sideslip_ref: np.ndarray,
) -> float:
    """Compare the path with that of a car which starts here, is as fast, and follows the references."""
    course = yaw_angle[0] + running_integral(t, yaw_rate_ref) + sideslip_ref
    wanted = running_integral(t, velocity_x * np.sin(course))
    return relative_rms_error(t, position_y - position_y[0], wanted)


@measure(
    "∫(d{x}/dt)² dt",
    "phase plane: area that loops of the signal and its rate enclose",
    "{x}2/s",
)
def phase_area(t: np.ndarray, x: np.ndarray, x_rate: np.ndarray) -> float:
    return integral(t, x_rate**2)  # of dx/dt over x, substituted to an integral over time


@measure(
    "max|d{x}/dt + 4 {x}/s| / (24 °/s)",
    "phase plane: largest distance from the middle of the stable strip; 1 is its edge",
    "1",
    signal_unit="rad",
)
def stability_index(t: np.ndarray, x: np.ndarray, x_rate: np.ndarray) -> float:
    return peak(t, x_rate + RETURN_RATE * x) / BOUNDARY


@measure(
    "share of T with |d{x}/dt + 4 {x}/s| > 24 °/s",
    "phase plane: share of the time outside the stable strip",
    "%",
    signal_unit="rad",
)
def time_beyond(t: np.ndarray, x: np.ndarray, x_rate: np.ndarray) -> float:
    outside = np.abs(x_rate + RETURN_RATE * x) > BOUNDARY  # counted in whole samples
    return float(np.sum(np.diff(t)[outside[:-1]])) / float(t[-1] - t[0])


@measure(
    "share of T with T_i < -20 N.m at any wheel",
    "share of the time in which any wheel is braked, by more than a pressure of 1 bar gives a front wheel",
    "%",
)
def braked_share(
    t: np.ndarray,
    wheel_torque_fl: np.ndarray,
    wheel_torque_fr: np.ndarray,
    wheel_torque_rl: np.ndarray,
    wheel_torque_rr: np.ndarray,
) -> float:
    least = np.minimum.reduce([wheel_torque_fl, wheel_torque_fr, wheel_torque_rl, wheel_torque_rr])
    braked = least < -BRAKED  # counted in whole samples
    return float(np.sum(np.diff(t)[braked[:-1]])) / float(t[-1] - t[0])


@dataclass(frozen=True)
class MeasureEntry:
    """A measure as a row of the table in the documentation."""

    name: str
    definition: str
    formula: str  # in terms of x, its reference x_ref, the duration T
    unit: str  # in words: "of the signal", "of the signal, per s"
    needs: str  # further signals that it takes, in words


_UNITS = {
    "{x}": "of the signal",
    "{x}/s": "of the signal, per s",
    "{x}/s2": "of the signal, per s2",
    "{x}.s": "of the signal, times s",
    "{x}2/s": "of the signal squared, per s",
    "%": "1, shown in %",
}
_NEEDS = {"x_ref": "a reference", "x_rate": "its rate"}


def catalogue() -> list[MeasureEntry]:
    """Return all measures with their definitions, formulas and units."""
    return [
        MeasureEntry(
            name,
            entry.definition,
            entry.formula.replace("{x_ref}", "x_ref").replace("{x}", "x"),
            _UNITS.get(entry.unit, entry.unit),
            " and ".join(_NEEDS.get(other, other) for other in entry.takes[1:]),
        )
        for name, entry in MEASURES.items()
    ]


SI = ("1", "s", "m", "kg", "N", "Pa", "rad", "m/s", "rad/s", "m/s2", "rad/s2", "N.m")
"""Units of the signals in the vocabulary."""


@cache
def si_of(unit: str) -> tuple[str, float]:
    """Return the vocabulary's unit of the same dimension, and the factor to it."""
    measure = measure_of(unit)
    for si in SI if measure is not None and unit not in SI else ():
        factors = conversion(measure, parse_unit(si))  # type: ignore[arg-type]
        if factors is not None and factors[1] == 0.0:
            return si, factors[0]
    return unit, 1.0


def si(unit: str) -> str:
    """Return the unit as written to files: "1" for a ratio, not per cent."""
    return "1" if unit == "%" else unit


def variable_of(signal: str) -> str:
    """Return the variable's name in `instance.variable`, or the name itself."""
    return SignalName.parse(signal).variable


def symbol(name: str) -> str:
    """Return the symbol of a variable, or its name if it has none."""
    if name.endswith("_ref"):
        return f"{symbol(name.removesuffix('_ref'))}_ref"
    return (SIGNALS[name].symbol if name in SIGNALS else "") or name


def words(name: str) -> str:
    """Return a variable in words, capitalized, with its wheel: "Wheel torque, front left"."""
    if name[-2:] in WHEEL_NAMES and name[-3:-2] == "_":
        return f"{words(f'{name[:-2]}*')}, {WHEEL_NAMES[name[-2:]]}"
    if name.removesuffix("_*").endswith("_ref"):
        return f"{words(name.removesuffix('_*').removesuffix('_ref'))} reference"
    known = SIGNALS[name].words if name in SIGNALS else ""
    return known or name.replace("_*", "").replace("_", " ").capitalize()

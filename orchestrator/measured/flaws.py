"""Flaws of recordings, found by signals that determine each other.

The lateral acceleration is that of the motion, a_y = dv_y/dt + r v_x, with v_y = v_x tan(beta). One flaw at a
time is assumed: a factor or sign of a signal, a lag of the accelerometer or the gyro, the position or zero
point of the accelerometer, the zero point of the yaw rate. The flaw that leaves the least residual is named
if it explains `EXPLAINED` of what remains without it; a recording without v_y and sideslip is examined for
factors and signs alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np

from ..errors import ScenarioError
from ..motion import ANGLES, standing
from .measurement import MEASURABLE, load_measurement
from .segment import LowPass, Segment, running_median

FACTORS = {"yaw_rate": 180.0 / np.pi, "acceleration_y": 9.80665, "velocity_x": 3.6}
"""Signal -> factor by which it is wrong if its unit is mistaken: deg for rad, g for m/s2, km/h for m/s."""
BAND = 3.0
"""Cut-off of the low pass before signals are compared [Hz]. Chosen: cars respond more slowly."""
EXPLAINED = 0.3
"""Part of the residual's power that a flaw must explain. Chosen: noise explains up to 0.15; a flaw
nearly all, unless the drive is smooth."""
ALIKE = 1.1
"""Ratio of what two flaws leave below which both are named as possible. Chosen: twice the usual difference of
a lag of the yaw rate and a position of the accelerometer while the speed changes by a tenth."""
NEAR = 0.25
"""Relative distance from a factor within which it is named. Chosen: the factors lie further apart."""
SPIKE = 12.0
"""Distance of a spike from its median, over that of 98 of 100 samples. Chosen: noise has less than 3."""
OF_POSITION = 1.0
"""Cut-off of the low pass of positions before they are differentiated [Hz]. Chosen: GPS is noisy."""
SLOWEST, WRONG_SPEED = 5.0, 0.03
"""Speed [m/s] above which it is compared with that of the position, and relative difference that is named.
Chosen: sideslip of 10 degrees is 1.5 % of it."""
EVEN = 0.05
"""Share of steps that may be uneven. Chosen: a single gap does not count as uneven sampling."""
CLEAR = 1.01
"""Ratio by which a lag of the gyro must explain more than all else. Chosen: at one speed it is a position."""


class FlawKind(str, Enum):
    """Kind of a flaw of a recording."""

    SIGN = "sign"
    FACTOR = "factor"
    LAG = "lag"
    POSITION = "position"  # of the accelerometer, ahead of the centre of mass
    ZERO = "zero"
    SPIKES = "spikes"
    UNEVEN_TIME = "uneven time"
    REFUSED = "refused"  # the recording cannot be read before it is corrected


Cause = tuple[FlawKind, str]
"""A kind of flaw and its signal."""
LEAST = {FlawKind.LAG: 0.004, FlawKind.POSITION: 0.1, FlawKind.SIGN: 0.0}
"""Least lag [s] and distance [m] that are named. Chosen: less does not harm a comparison."""
LEAST_ZERO = {"acceleration_y": 0.05, "yaw_rate": 0.002}
"""Likewise of zero points [m/s2, rad/s]."""


@dataclass(frozen=True)
class Flaw:
    """Flaw of a recording."""

    kind: FlawKind
    signal: str
    value: float  # the factor, the lag [s], the distance [m], the zero point in SI, the number of spikes
    text: str


def flaws_of(path: Path | str) -> tuple[Flaw, ...]:
    """Return the flaws of a measurement, none twice.

    Raises:
        ScenarioError: it cannot be read for a reason other than its times and the size of its values.
    """
    try:
        measurement = load_measurement(path, filtered=False)
    except ScenarioError as error:
        readable = ("measurement-time", "series-unreadable")
        if any(diagnostic.code not in readable for diagnostic in error.diagnostics):
            raise
        return tuple(Flaw(FlawKind.REFUSED, "", 0.0, item.message) for item in error.diagnostics)
    flaws: dict[Cause, Flaw] = {}
    for segment in measurement.segments:
        for flaw in _of_segment(segment):
            flaws.setdefault((flaw.kind, flaw.signal), flaw)
    return tuple(flaws.values())


def _of_segment(segment: Segment) -> list[Flaw]:
    flaws = [flaw for name, x in segment.signals.items() if (flaw := _spikes(name, x)) is not None]
    steps = np.diff(segment.time)
    uneven = float(np.mean(np.abs(steps / np.median(steps) - 1.0) > 0.1))
    if uneven > EVEN:
        words = f"{100.0 * uneven:.0f} % of its steps differ from their median by more than a tenth"
        flaws.append(Flaw(FlawKind.UNEVEN_TIME, "", uneven, words))
    if flaws:
        return flaws
    even = segment.even()
    contradiction = _contradiction(even) or _against_position(even)
    return [contradiction] if contradiction else []


def _spikes(name: str, x: np.ndarray) -> Flaw | None:
    off = np.abs(x - running_median(x))
    usual = float(np.quantile(off, 0.98))
    count = int(np.sum(off > SPIKE * max(usual, 1e-3 * float(np.ptp(x)))))
    if not count:
        return None
    unit = MEASURABLE[name].unit
    size = float(off.max())
    return Flaw(
        FlawKind.SPIKES,
        name,
        count,
        f"has {count} spikes up to {size:.3g} {unit}: 'spikes: {0.3 * size:.2g} {unit}'",
    )


def _contradiction(even: Segment) -> Flaw | None:
    """Return the flaw that explains why a_y does not match the motion."""
    if not {"yaw_rate", "acceleration_y", "velocity_x"} <= even.signals.keys() or even.rate < 3.0 * BAND:
        return None
    low, edge = LowPass(BAND), int(even.rate)
    stands = standing(even.signals)
    smooth = {
        name: low(x if stands is None or name not in ANGLES else np.where(stands, 0.0, x), even.rate)
        for name, x in even.signals.items()
    }
    r, a_y, v = (smooth[name] for name in ("yaw_rate", "acceleration_y", "velocity_x"))
    inner = slice(edge, -edge)
    if a_y[inner].size < 10 or np.std(a_y[inner]) < 0.1:
        return None
    turning = r * v
    ratio = float(np.sum((a_y * turning)[inner]) / np.sum((turning * turning)[inner]))
    if (flaw := _factor(ratio)) is not None:
        return flaw
    if ratio < 0.0:
        return _sign(smooth, inner)
    side = _lateral_velocity(smooth)
    if (flaw := _steering(smooth, inner)) is not None or side is None:
        return flaw
    a_y_rate, side_rate, r_rate = (np.gradient(x, even.time) for x in (a_y, side, r))
    name = "velocity_y" if "velocity_y" in smooth else "sideslip"
    return _single(
        (a_y - turning - side_rate)[inner],
        {
            (FlawKind.LAG, "acceleration_y"): -a_y_rate[inner],
            (FlawKind.LAG, "yaw_rate"): (v * r_rate)[inner],
            (FlawKind.POSITION, "acceleration_y"): r_rate[inner],
            (FlawKind.ZERO, "acceleration_y"): np.ones(a_y.size)[inner],
            (FlawKind.ZERO, "yaw_rate"): -v[inner],
            (FlawKind.SIGN, name): side_rate[inner],
        },
    )


def _against_position(even: Segment) -> Flaw | None:
    """Return the factor of a speed that is not that of the recorded position, such as of GPS."""
    signals = even.signals
    if not {"velocity_x", "position_x", "position_y"} <= signals.keys() or even.rate < 3.0 * OF_POSITION:
        return None
    low, edge = LowPass(OF_POSITION), int(even.rate / OF_POSITION)
    x, y, v = (low(signals[name], even.rate) for name in ("position_x", "position_y", "velocity_x"))
    inner = slice(edge, -edge)
    over_ground = np.hypot(np.gradient(x, even.time), np.gradient(y, even.time))[inner]
    moving = over_ground > SLOWEST
    if np.count_nonzero(moving) < 10:
        return None
    factor = float(np.median(v[inner][moving] / over_ground[moving]))
    if abs(factor - 1.0) < WRONG_SPEED:
        return None
    words = (
        f"is {factor:.3g} times the speed of the recorded position: 'gain: {1.0 / factor:.4g}', or its unit"
    )
    return Flaw(FlawKind.FACTOR, "velocity_x", factor, words)


def _lateral_velocity(smooth: Mapping[str, np.ndarray]) -> np.ndarray | None:
    if "velocity_y" in smooth:
        return smooth["velocity_y"]
    return smooth["velocity_x"] * np.tan(smooth["sideslip"]) if "sideslip" in smooth else None


def _factor(ratio: float) -> Flaw | None:
    """Return the signal whose unit explains the ratio of a_y to r v."""
    for name, factor in FACTORS.items():
        for wrong, of_ratio in (
            (factor, factor if name == "acceleration_y" else 1.0 / factor),
            (1.0 / factor, 1.0 / factor if name == "acceleration_y" else factor),
        ):
            if abs(abs(ratio) / of_ratio - 1.0) < NEAR:
                words = (
                    f"is {wrong:.3g} times what other signals imply: 'gain: {1.0 / wrong:.4g}', or its unit"
                )
                return Flaw(FlawKind.FACTOR, name, wrong, words)
    return None


def _sign(smooth: Mapping[str, np.ndarray], inner: slice) -> Flaw:
    """Return the flaw of a wrong sign: of yaw rate or acceleration, whichever is opposed to the steering."""
    hand = next((smooth[name] for name in ("steering_wheel_angle", "steer_angle") if name in smooth), None)
    name = "acceleration_y"
    if hand is not None and float(np.sum((hand * smooth["yaw_rate"])[inner])) < 0.0:
        name = "yaw_rate"
    return Flaw(FlawKind.SIGN, name, -1.0, _described(FlawKind.SIGN, name, -1.0))


def _steering(smooth: Mapping[str, np.ndarray], inner: slice) -> Flaw | None:
    for name in ("steering_wheel_angle", "steer_angle"):
        if name in smooth and float(np.sum((smooth[name] * smooth["yaw_rate"])[inner])) < 0.0:
            return Flaw(FlawKind.SIGN, name, -1.0, "is opposed to the yaw rate: 'sign: -1'")
    return None


def _single(residual: np.ndarray, effects: Mapping[Cause, np.ndarray]) -> Flaw | None:
    """Return the flaw whose effect explains most of a residual, if it explains enough and is large enough.

    The text names a second one that explains nearly as much.
    """
    power = float(np.sum(residual**2))
    sizes = {key: float(np.sum(residual * x) / np.sum(x * x)) for key, x in effects.items()}
    left = {
        key: float(np.sum((residual - sizes[key] * x) ** 2))
        for key, x in effects.items()
        if _possible(*key, sizes[key])
    }
    best = min(left, key=lambda key: left[key] * (CLEAR if key == (FlawKind.LAG, "yaw_rate") else 1.0))
    (kind, name), value = best, sizes[best]
    if left[best] > (1.0 - EXPLAINED) * power or abs(value) < _least(kind, name):
        return None
    others = [key for key, rest in left.items() if key != best and rest < ALIKE * left[best]]
    other = min(others, key=left.__getitem__, default=None)
    instead = f"; or {other[1]} {_described(*other, sizes[other])}" if other else ""
    value = -1.0 if kind is FlawKind.SIGN else value
    return Flaw(kind, name, value, _described(kind, name, value) + instead)


def _possible(kind: FlawKind, name: str, size: float) -> bool:
    """Return whether a flaw may have an effect of that size: gyros do not lead, turned signs count double."""
    if kind is FlawKind.SIGN:
        return abs(size / -2.0 - 1.0) < NEAR
    return not (kind is FlawKind.LAG and name == "yaw_rate" and size < 0.0)


def _least(kind: FlawKind, name: str) -> float:
    return LEAST_ZERO[name] if kind is FlawKind.ZERO else LEAST[kind]


def _described(kind: FlawKind, name: str, value: float) -> str:
    unit = MEASURABLE[name].unit
    if kind is FlawKind.SIGN:
        return "is opposed to the other signals: 'sign: -1'"
    if kind is FlawKind.LAG:
        return f"lags by {1000.0 * value:.1f} ms: 'delay: {1000.0 * value:.1f} ms'"
    if kind is FlawKind.POSITION:
        return f"is measured {value:.2f} m ahead of the centre of mass: 'at: {{x: {value:.2f} m}}'"
    return f"shows {value:.3g} {unit} at zero: 'offset: {value:.3g} {unit}'"

"""Flaws of recordings: gaps, spikes, uneven times, and signals that contradict each other.

The lateral acceleration is that of the motion, a_y = dv_y/dt + r v_x, with v_y = v_x tan(beta). One flaw at a
time is assumed: a factor or sign of a signal, a lag of the accelerometer or the gyro, the position or zero
point of the accelerometer, the zero point of the yaw rate. The flaw that leaves the least residual is named
if it explains `EXPLAINED` of what remains without it; a recording without v_y and sideslip is examined for
factors and signs alone. Two signals that contradict each other do not tell which of them is wrong: a sign is
that of one signal only where a third, the steering, agrees with the other.

Before signals are compared, spikes are taken out and uneven times made even, and stretches between gaps are
taken each by itself, so that none of these hides a contradiction.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path

import numpy as np

from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import counted, listed
from yawbench.measurements.measurement import MEASURABLE, Measurement, load_measurement
from yawbench.measurements.segment import LowPass, Segment, running_median, without_spikes
from yawbench.orchestrator.recordings.gaps import Gap, by_signals
from yawbench.proving_ground.trace import likeness
from yawbench.vehicles.motion import standing
from yawbench.vocabulary.motion import ANGLES

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
"""Share of steps that may be uneven. Chosen: a sample that is late now and then does not count."""
NAMED = 10
"""Gaps of a segment that are named one by one; chosen: of more, their number says enough."""
LIKE = 0.5
"""Normalized product of two signals from which they are compared. Chosen: in bends it is above 0.9; straight
ahead, and of a channel without a signal, about 0."""
LEAST_TURN = 0.1
"""Standard deviation of a_y from which it is compared [m/s2]. Chosen: less is the noise of sensors."""
STEERING = ("steering_wheel_angle", "steer_angle")
"""Signals that tell which of two others has the wrong sign."""
MOTION = ("yaw_rate", "acceleration_y", "velocity_x")
"""Signals that are compared."""
CLEAR = 1.01
"""Ratio by which a lag of the gyro must explain more than all else. Chosen: at one speed it is a position."""


class FlawKind(str, Enum):
    """Kind of a flaw of a recording."""

    GAP = "gap"
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
    signal: str  # several: separated by commas; "": all of the recording
    value: float  # factor, lag or length of a gap [s], distance [m], zero point in SI, number of spikes
    text: str
    gap: Gap | None = None  # of the kind gap: its begin and end


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
    flaws: dict[tuple[FlawKind, str, str], Flaw] = {}
    several = len(measurement.segments) > 1
    for segment in measurement.segments:
        for flaw in [*_gaps(segment, f"{segment.name}: " if several else ""), *_of_segment(segment)]:
            own = flaw.text if flaw.kind is FlawKind.GAP else ""  # each gap is a flaw of its own
            flaws.setdefault((flaw.kind, flaw.signal, own), flaw)
    return tuple(flaws.values())


def not_examined(measurement: Measurement) -> str:
    """Return why signals of a measurement were not compared with each other; "" if they were."""
    lacking = [name for name in MOTION if all(name not in one.signals for one in measurement.segments)]
    if lacking:
        missing = f"of {listed(MOTION)}, there is no {listed(lacking, last='and no')}"
        return f"signs, units and lags were not examined: {missing}"
    if any(_motion_of(segment) is not None for segment in measurement.segments):
        return ""
    return (
        "signs, units and lags were not examined: no part of the recording without a gap is longer than 2 s, "
        f"has {3.0 * BAND:g} samples per second and turns"
    )


def _gaps(segment: Segment, where: str) -> list[Flaw]:
    """Return the gaps of a segment; of many, the last flaw counts those that are not named."""
    found = by_signals(segment.gaps, segment.signals)
    flaws = [
        Flaw(FlawKind.GAP, names, gap.length, f"{where}no samples from {gap}: {_CUT}", gap)
        for names, gap in found[:NAMED]
    ]
    if rest := [gap for _, gap in found[NAMED:]]:
        length = sum(gap.length for gap in rest)
        more = counted(len(rest), "more stretch", "more stretches")
        flaws.append(Flaw(FlawKind.GAP, "", length, f"{where}no samples in {more}, {length:.3g} s in all"))
    return flaws


_CUT = "'segments: {by: gaps}' divides the recording there"


def _of_segment(segment: Segment) -> list[Flaw]:
    """Return the flaws of a segment other than its gaps."""
    limits = {name: _spike_limit(segment.parts(), name) for name in segment.signals}
    flaws = [flaw for name, limit in limits.items() if (flaw := _spikes(segment.parts(), name, limit))]
    if (uneven := _uneven(segment.parts())) is not None:
        flaws.append(uneven)
    clean = [
        replace(part, signals={
            name: without_spikes(part.time, x, limits[name]) for name, x in part.signals.items()
        })
        for part in segment.parts()
    ]  # fmt: skip
    contradiction = _contradiction(clean) or _against_position(clean)
    return [*flaws, contradiction] if contradiction else flaws


def _uneven(parts: Sequence[Segment]) -> Flaw | None:
    steps = np.concatenate([np.diff(part.time) for part in parts])
    usual = float(np.median(steps))
    uneven = float(np.mean(np.abs(steps / usual - 1.0) > 0.1))
    if uneven <= EVEN:
        return None
    words = (
        f"{100.0 * uneven:.0f} % of the steps of time differ by more than a tenth from their median, "
        f"{1000.0 * usual:.4g} ms (up to {1000.0 * float(steps.max()):.4g} ms): if the samples were taken "
        "evenly and only their times jitter, write even times into the column; if they were taken at these "
        "times, leave them: filters, tests and fits interpolate to even steps"
    )
    return Flaw(FlawKind.UNEVEN_TIME, "", uneven, words)


def _spike_limit(parts: Sequence[Segment], name: str) -> float:
    """Return the distance from the running median beyond which values are spikes."""
    off = np.concatenate([_off(part, name) for part in parts])
    low = min(float(part.signals[name].min()) for part in parts)
    high = max(float(part.signals[name].max()) for part in parts)
    return SPIKE * max(float(np.quantile(off, 0.98)), 1e-3 * (high - low))


def _off(part: Segment, name: str) -> np.ndarray:
    x = part.signals[name]
    return np.asarray(np.abs(x - running_median(x)))


def _spikes(parts: Sequence[Segment], name: str, limit: float) -> Flaw | None:
    off = np.concatenate([_off(part, name) for part in parts])
    count = int(np.sum(off > limit))
    if not count:
        return None
    unit = MEASURABLE[name].unit
    size = float(off.max())
    return Flaw(
        FlawKind.SPIKES,
        name,
        count,
        f"has {counted(count, 'spike')} up to {size:.3g} {unit}: 'spikes: {0.3 * size:.2g} {unit}'",
    )


@dataclass(frozen=True)
class _Motion:
    """Low-passed signals of all parts of a segment, without their edges: one array each, and their slopes.

    `side` is the lateral velocity, if it or the sideslip is recorded.
    """

    signals: Mapping[str, np.ndarray]
    slopes: Mapping[str, np.ndarray]


def _motion(parts: Sequence[Segment], names: Iterable[str], cut_off: float) -> _Motion | None:
    """Return signals below a cut-off [Hz]; None without one of them, or a part long and fine enough."""
    every: list[tuple[dict[str, np.ndarray], dict[str, np.ndarray]]] = []
    for part in parts:
        if not set(names) <= part.signals.keys() or part.rate < 3.0 * cut_off:
            continue
        even = part.even()
        edge = int(even.rate * max(1.0, 1.0 / cut_off))
        if even.time.size < 2 * edge + 10:
            continue
        low = LowPass(cut_off)
        stands = standing(even.signals)
        smooth = {
            name: low(x if stands is None or name not in ANGLES else np.where(stands, 0.0, x), even.rate)
            for name, x in even.signals.items()
        }
        if (side := _lateral_velocity(smooth)) is not None:
            smooth["side"] = side
        slopes = {name: np.gradient(x, even.time) for name, x in smooth.items()}
        inner = slice(edge, -edge)
        every.append(
            ({name: x[inner] for name, x in smooth.items()}, {name: x[inner] for name, x in slopes.items()})
        )
    if not every:
        return None
    signals, slopes = (
        {name: np.concatenate([one[k][name] for one in every]) for name in every[0][0]} for k in (0, 1)
    )
    return _Motion(signals, slopes)


def _motion_of(segment: Segment | Sequence[Segment]) -> _Motion | None:
    """Return the motion in which signals are compared; None if the car does not turn in it."""
    parts = segment.parts() if isinstance(segment, Segment) else segment
    motion = _motion(parts, MOTION, BAND)
    return None if motion is None or np.std(motion.signals["acceleration_y"]) < LEAST_TURN else motion


def _contradiction(parts: Sequence[Segment]) -> Flaw | None:
    """Return the flaw that explains why a_y does not match the motion."""
    motion = _motion_of(parts)
    if motion is None:
        return None
    signals, slopes = motion.signals, motion.slopes
    r, a_y, v = (signals[name] for name in MOTION)
    turning = r * v
    alike = likeness(a_y, turning)
    if abs(alike) < LIKE:
        return None
    if (flaw := _factor(float(np.sqrt(np.sum(a_y * a_y) / np.sum(turning * turning))))) is not None:
        return flaw
    if alike < 0.0:
        return _sign(signals)
    if (flaw := _steering(signals)) is not None or "side" not in signals:
        return flaw
    name = "velocity_y" if "velocity_y" in signals else "sideslip"
    return _single(
        a_y - turning - slopes["side"],
        {
            (FlawKind.LAG, "acceleration_y"): -slopes["acceleration_y"],
            (FlawKind.LAG, "yaw_rate"): v * slopes["yaw_rate"],
            (FlawKind.POSITION, "acceleration_y"): slopes["yaw_rate"],
            (FlawKind.ZERO, "acceleration_y"): np.ones(a_y.size),
            (FlawKind.ZERO, "yaw_rate"): -v,
            (FlawKind.SIGN, name): slopes["side"],
        },
    )


def _against_position(parts: Sequence[Segment]) -> Flaw | None:
    """Return the factor of a speed that is not that of the recorded position, such as of GPS."""
    motion = _motion(parts, ("velocity_x", "position_x", "position_y"), OF_POSITION)
    if motion is None:
        return None
    over_ground = np.hypot(motion.slopes["position_x"], motion.slopes["position_y"])
    moving = over_ground > SLOWEST
    if np.count_nonzero(moving) < 10:
        return None
    factor = float(np.median(motion.signals["velocity_x"][moving] / over_ground[moving]))
    if abs(factor - 1.0) < WRONG_SPEED:
        return None
    words = (
        f"is {factor:.3g} times the speed of the recorded position: if that is right, 'gain: "
        f"{1.0 / factor:.4g}', or its unit"
    )
    return Flaw(FlawKind.FACTOR, "velocity_x", factor, words)


def _lateral_velocity(smooth: Mapping[str, np.ndarray]) -> np.ndarray | None:
    if "velocity_y" in smooth:
        return smooth["velocity_y"]
    return smooth["velocity_x"] * np.tan(smooth["sideslip"]) if "sideslip" in smooth else None


def _factor(ratio: float) -> Flaw | None:
    """Return the signal whose unit explains the ratio of a_y to r v, of their rms."""
    for name, factor in FACTORS.items():
        for wrong, of_ratio in (
            (factor, factor if name == "acceleration_y" else 1.0 / factor),
            (1.0 / factor, 1.0 / factor if name == "acceleration_y" else factor),
        ):
            if abs(ratio / of_ratio - 1.0) < NEAR:
                words = (
                    f"is {wrong:.3g} times what other signals imply: 'gain: {1.0 / wrong:.4g}', or its unit"
                )
                return Flaw(FlawKind.FACTOR, name, wrong, words)
    return None


def _sign(signals: Mapping[str, np.ndarray]) -> Flaw:
    """Return the flaw of a wrong sign: of that of yaw rate and acceleration that is opposed to the steering.

    Without a steering that is like one of them, it is a flaw of both.
    """
    of_yaw_rate = (likeness(signals[name], signals["yaw_rate"]) for name in STEERING if name in signals)
    alike = next(of_yaw_rate, 0.0)
    if abs(alike) >= LIKE:
        name = "yaw_rate" if alike < 0.0 else "acceleration_y"
        return Flaw(FlawKind.SIGN, name, -1.0, _described(FlawKind.SIGN, name, -1.0))
    words = (
        "are opposed to each other: one of them needs 'sign: -1', and they alone do not tell which; a signal "
        f"of the steering ({listed(STEERING, last='or')}) would. Both are positive in a turn to the left"
    )
    return Flaw(FlawKind.SIGN, "yaw_rate, acceleration_y", -1.0, words)


def _steering(signals: Mapping[str, np.ndarray]) -> Flaw | None:
    for name in STEERING:
        if name in signals and likeness(signals[name], signals["yaw_rate"]) < -LIKE:
            words = (
                "is opposed to yaw_rate and acceleration_y: 'sign: -1', or the same for both of them; all "
                "are positive to the left"
            )
            return Flaw(FlawKind.SIGN, name, -1.0, words)
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

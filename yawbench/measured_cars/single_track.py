"""A single track with Fiala's tyres, simulated in all windows at once: the baseline of every fit.

    m (dv_y/dt + v_x r) = F_f cos(delta) + F_r,      I_z dr/dt = a F_f cos(delta) - b F_r
    F = -C t + C^2 |t| t / (3 mu F_z) - C^3 t^3 / (27 (mu F_z)^2),  t = tan(alpha),  |t| < 3 mu F_z / C
    F = -mu F_z sign(alpha)                                                           beyond

with steer angle and v_x as measured, static axle loads, and friction mu per axle: five parameters that any
car has. A richer model that is no better on held-out windows explains nothing more.

Driven like a recorded car, with typical values, it shows what a fit can identify (`effects_in`): a parameter
whose effect on yaw rate and lateral acceleration is below the noise of sensors cannot be found from the
recording.

Source: E. Fiala, Seitenkräfte am rollenden Luftreifen, VDI-Zeitschrift 96, 1954; in this form, with friction,
J. Pacejka, Tire and Vehicle Dynamics, 3rd edition, 2012, section 3.2.1 (brush model of parabolic pressure).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from yawbench.measurements.measurement import Measurement
from yawbench.measurements.segment import Segment
from yawbench.vehicles.motion import standing
from yawbench.vocabulary.gravity import G

from .least_squares import Simulated, Window

LEAST_SPEED = 3.0
"""Speed [m/s] below which slip angles refer to it; chosen: slower, tyre and step are stiff."""
STEP = 0.01
"""Longest step of the integration [s] (Runge-Kutta of fourth order); chosen: stable above `LEAST_SPEED`."""
CHANGE = 0.1
"""Relative change of a parameter; chosen: a difference that a fit should resolve."""
DURATION = 10.0
"""Length of a window [s]; chosen: a few bends."""
MOST = 12
"""Windows of a measurement; chosen: a second of simulation."""
SEEN = {"yaw_rate": np.radians(0.1), "acceleration_y": 0.05}
"""Rms of an effect that is seen, in SI; chosen: the noise of production sensors."""
FRICTIONS = ("friction_front", "friction_rear")
RESERVE = 1.15
"""Friction over the largest recorded a_y / g; chosen: no axle slides for long in the recording."""
NEEDED = ("mass", "cg_to_front_axle", "cg_to_rear_axle")
PARAMETERS = ("stiffness_front", "stiffness_rear", "friction_front", "friction_rear", "yaw_inertia")
UNITS = dict(zip(PARAMETERS, ("N/rad", "N/rad", "1", "1", "kg.m2"), strict=True))
SIGNALS = ("yaw_rate", "acceleration_y", "sideslip")
STIFFNESS_PER_LOAD = 12.0
"""Typical cornering stiffness of an axle over its load [1/rad]; chosen: a passenger car's tyres."""


def typical_values(mass: float, front: float, rear: float) -> dict[str, float]:
    """Return typical values of `PARAMETERS` for a mass [kg] and distances of the axles [m]."""
    weight = mass * G / (front + rear)
    stiffnesses = STIFFNESS_PER_LOAD * weight * rear, STIFFNESS_PER_LOAD * weight * front
    return dict(zip(PARAMETERS, (*stiffnesses, 1.0, 1.0, mass * front * rear), strict=True))


@dataclass(frozen=True)
class SingleTrackWindow:
    """Inputs of a window.

    Attributes:
        window: compared times and signals.
        times: of the inputs, evenly spaced [s], beyond the window's, as delays need.
        steer_angle, velocity_x: at these times [rad], [m/s].
        start: v_y [m/s] and r [rad/s] at the window's start.
    """

    window: Window
    times: np.ndarray
    steer_angle: np.ndarray
    velocity_x: np.ndarray
    start: tuple[float, float]


@dataclass(frozen=True)
class SingleTrack:
    """The model; mass [kg], distances of the axles from the centre of mass [m].

    Its parameters are `PARAMETERS`; `steer_angle.delay` [s] and `steer_angle.offset` [rad] of the measurement
    are zero unless a set has them.
    """

    windows: Sequence[SingleTrackWindow]
    mass: float
    front: float
    rear: float

    def __call__(self, sets: Sequence[Mapping[str, float]]) -> list[list[Simulated]]:
        """Simulate all windows for sets of values, those of equal length at once; see `Model`."""
        by_grid: dict[tuple[int, float], list[int]] = {}
        for i, inputs in enumerate(self.windows):
            times = inputs.window.times
            by_grid.setdefault((len(times), round(times[1] - times[0], 9)), []).append(i)
        simulated: list[list[Simulated]] = [[None] * len(self.windows) for _ in sets]
        for alike in by_grid.values():
            kept = self._simulate([self.windows[i] for i in alike], sets)
            for k, (at, i) in enumerate(itertools.product(range(len(sets)), alike)):
                if np.isfinite(kept[:, :, k]).all():
                    simulated[at][i] = dict(zip(SIGNALS, kept[:, :, k], strict=True))
        return simulated

    def _simulate(
        self, windows: Sequence[SingleTrackWindow], sets: Sequence[Mapping[str, float]]
    ) -> np.ndarray:
        """Return `SIGNALS` of windows of one grid, shape (3, times, sets * windows)."""
        n = len(windows[0].window.times) - 1
        step = windows[0].window.times[1] - windows[0].window.times[0]
        parts = max(1, int(np.ceil(step / STEP - 1e-9)))
        h = step / parts
        since = 0.5 * h * np.arange(2 * n * parts + 3)  # with the middle of each step, and one step more
        columns = len(sets) * len(windows)
        tangent, cosine, speed = (np.empty((len(since), columns)) for _ in range(3))
        for k, (values, inputs) in enumerate(itertools.product(sets, windows)):
            times = inputs.window.times[0] + since
            late, offset = (values.get(f"steer_angle.{name}", 0.0) for name in ("delay", "offset"))
            delta = np.interp(times + late, inputs.times, inputs.steer_angle) - offset
            tangent[:, k], cosine[:, k] = np.tan(delta), np.cos(delta)
            speed[:, k] = np.interp(times, inputs.times, inputs.velocity_x)
        c_f, c_r, mu_f, mu_r, inertia = (
            np.repeat([values[name] for values in sets], len(windows)) for name in PARAMETERS
        )
        load = self.mass * G / (self.front + self.rear)
        front, rear = Axle(c_f, mu_f * load * self.rear), Axle(c_r, mu_r * load * self.front)
        referred = np.maximum(speed, LEAST_SPEED)

        def rates(v_y: np.ndarray, r: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            """Return dv_y/dt [m/s2], dr/dt [rad/s2] and a_y [m/s2] at the k-th half step."""
            u = (v_y + self.front * r) / referred[k]
            f = front.force((u - tangent[k]) / (1.0 + u * tangent[k])) * cosine[k]
            q = rear.force((v_y - self.rear * r) / referred[k])
            a_y = (f + q) / self.mass
            return a_y - speed[k] * r, (self.front * f - self.rear * q) / inertia, a_y

        v_y, r = np.tile(np.array([window.start for window in windows]).T, (1, len(sets)))
        kept = np.empty((len(SIGNALS), n + 1, columns))
        with np.errstate(over="ignore", invalid="ignore"):  # windows with non-finite values are discarded
            for k in range(n * parts + 1):
                v_1, r_1, a_y = rates(v_y, r, 2 * k)
                if k % parts == 0:
                    kept[:, k // parts] = r, a_y, np.arctan2(v_y, speed[2 * k])
                v_2, r_2, _ = rates(v_y + 0.5 * h * v_1, r + 0.5 * h * r_1, 2 * k + 1)
                v_3, r_3, _ = rates(v_y + 0.5 * h * v_2, r + 0.5 * h * r_2, 2 * k + 1)
                v_4, r_4, _ = rates(v_y + h * v_3, r + h * r_3, 2 * k + 2)
                v_y = v_y + h / 6.0 * (v_1 + 2.0 * (v_2 + v_3) + v_4)
                r = r + h / 6.0 * (r_1 + 2.0 * (r_2 + r_3) + r_4)
        return kept


class Axle:
    """An axle with Fiala's tyres.

    Args:
        stiffness: cornering stiffness C [N/rad], one per column.
        grip: friction times load [N].
    """

    def __init__(self, stiffness: np.ndarray, grip: np.ndarray) -> None:
        self.minus_grip, self.per_tangent = -grip, stiffness / (3.0 * grip)

    def force(self, tangent: np.ndarray) -> np.ndarray:
        """Return the lateral force [N] at a slip angle with this tangent; with s = C |t| / (3 mu F_z) <= 1,
        F = -mu F_z sign(t) (3 s - 3 s^2 + s^3).
        """
        s = self.per_tangent * tangent
        left = 1.0 - np.minimum(np.abs(s), 1.0)
        force: np.ndarray = self.minus_grip * np.copysign(1.0 - left * left * left, s)
        return force


def start_states(segment: Segment, time: float) -> dict[str, float]:
    """Return parameters of plants that begin a run at a time [s] as the car was measured."""
    at = {name: float(np.interp(time, segment.time, x)) for name, x in segment.signals.items()}
    forward, sideways = at.get("velocity_x", at.get("speed")), at.get("velocity_y")
    sideslip = at.get("sideslip")
    if sideslip is None and sideways is not None and forward:
        sideslip = math.atan2(sideways, forward)
    if sideslip is not None and standing({name: np.array([x]) for name, x in at.items()}) is not None:
        sideslip = 0.0  # of a car at rest
    states = {"initial_yaw_rate": at.get("yaw_rate"), "initial_sideslip": sideslip}
    if forward is not None:
        along = math.cos(sideslip or 0.0) if "velocity_x" in at else 1.0
        states["initial_speed"] = forward / along
    return {name: value for name, value in states.items() if value is not None}


@dataclass(frozen=True)
class Effect:
    """Rms changes of signals by a parameter that is `CHANGE` larger, in SI."""

    parameter: str
    changes: dict[str, float]

    @property
    def seen(self) -> bool:
        """Whether one of them exceeds the noise of sensors."""
        return any(self.changes[name] > least for name, least in SEEN.items())


def effects_in(measurement: Measurement) -> list[Effect]:
    """Return the effect of each parameter of the single track in a measurement.

    Raises:
        ValueError: steering, speed, mass or axles are not known; the message says which.
    """
    car = [measurement.vehicle.get(name) for name in NEEDED]
    if missing := [name for name, value in zip(NEEDED, car, strict=True) if value is None]:
        raise ValueError(f"'vehicle:' lacks {', '.join(missing)}")
    mass, front, rear = (float(value or 0.0) for value in car)
    windows = [window for segment in measurement.segments for window in _windows(segment, measurement)]
    if not windows:
        raise ValueError("no part of its segments without a gap is as long as a window")
    chosen = windows[:: -(-len(windows) // MOST)]
    start = typical_values(mass, front, rear) | dict.fromkeys(FRICTIONS, _friction(measurement))
    moved = [start | {name: (1.0 + CHANGE) * value} for name, value in start.items()]
    plain, *others = SingleTrack(chosen, mass, front, rear)([start, *moved])
    return [
        Effect(name, {
            signal: float(np.sqrt(np.mean(np.concatenate([
                (before[signal] - after[signal]) ** 2
                for before, after in zip(plain, other, strict=True)
                if before is not None and after is not None
            ] or [np.zeros(1)]))))
            for signal in SEEN
        })
        for name, other in zip(start, others, strict=True)
    ]  # fmt: skip


def _friction(measurement: Measurement) -> float:
    """Return a friction with which the car stays on the road: what the recording uses, with a reserve."""
    used = [
        float(np.quantile(np.abs(segment.signals["acceleration_y"]), 0.999)) / G
        for segment in measurement.segments
        if "acceleration_y" in segment.signals
    ]
    return max([measurement.vehicle.get("friction", 1.0), *(RESERVE * share for share in used)])


def _windows(segment: Segment, measurement: Measurement) -> list[SingleTrackWindow]:
    """Return the windows of a segment, with the inputs of the single track.

    Raises:
        ValueError: steering or speed is not measured.
    """
    even = segment.even()
    if "velocity_x" not in even.signals:
        raise ValueError("velocity_x is not measured")
    if "steer_angle" in even.signals:
        steer_angle = even.signals["steer_angle"]
    elif "steering_wheel_angle" in even.signals and "steering_ratio" in measurement.vehicle:
        steer_angle = even.signals["steering_wheel_angle"] / measurement.vehicle["steering_ratio"]
    else:
        raise ValueError("neither steer_angle nor steering_wheel_angle with a steering_ratio is known")
    rows = max(2, round(min(DURATION * even.rate, even.time.size)))
    windows = []
    for first in range(0, even.time.size - rows + 1, rows):
        times = even.time[first : first + rows]
        gaps = itertools.chain.from_iterable(segment.gaps.values())
        if any(gap.overlaps(float(times[0]), float(times[-1])) for gap in gaps):
            continue
        states = start_states(even, float(times[0]))
        speed = states.get("initial_speed", 0.0)
        start = (
            speed * float(np.sin(states.get("initial_sideslip", 0.0))),
            states.get("initial_yaw_rate", 0.0),
        )
        window = Window(segment.name, times, {})
        windows.append(SingleTrackWindow(window, even.time, steer_angle, even.signals["velocity_x"], start))
    return windows

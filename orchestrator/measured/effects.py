"""Effects of a car's parameters in a recording: what a fit to it can identify.

A single track with Fiala's tyres (`single_track`), at values of a typical car of the recorded mass and axles,
is driven by the recorded steering and speed, and again with each parameter `CHANGE` larger. A parameter whose
effect on yaw rate and lateral acceleration is below the noise of sensors is not seen in the recording: the
friction of an axle, for example, unless tyres come near their limit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vocabulary.gravity import G

from .estimate import Window
from .measurement import Measurement
from .segment import Segment
from .single_track import SingleTrack, SingleTrackWindow, start_states, typical_values

CHANGE = 0.1
"""Relative change of a parameter; chosen: what a fit should tell apart."""
DURATION = 10.0
"""Of a window [s]; chosen: a few bends."""
MOST = 12
"""Windows of a measurement; chosen: a second of simulation."""
SEEN = {"yaw_rate": np.radians(0.1), "acceleration_y": 0.05}
"""Rms of an effect that is seen, in SI; chosen: the noise of production sensors."""
FRICTIONS = ("friction_front", "friction_rear")
RESERVE = 1.15
"""Friction over the largest recorded a_y / g; chosen: no axle slides for long in the recording."""
NEEDED = ("mass", "cg_to_front_axle", "cg_to_rear_axle")


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
        raise ValueError("its segments are shorter than a second")
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
    """Return a friction with which the car stays on the road: what it uses, and some more."""
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
        states = start_states(even, float(times[0]))
        speed = states.get("initial_speed", 0.0)
        start = (
            speed * float(np.sin(states.get("initial_sideslip", 0.0))),
            states.get("initial_yaw_rate", 0.0),
        )
        window = Window(segment.name, times, {})
        windows.append(SingleTrackWindow(window, even.time, steer_angle, even.signals["velocity_x"], start))
    return windows

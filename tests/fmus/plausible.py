"""Input values a unit may meet on the road, by signal."""

from __future__ import annotations

import random
from collections.abc import Iterable

from vocabulary.wheels import WHEELS

_RANGES = {
    "velocity_x": (15.0, 30.0),
    "velocity_y": (-1.0, 1.0),
    "yaw_rate": (-0.4, 0.4),
    "yaw_rate_ref": (-0.4, 0.4),
    "sideslip": (-0.05, 0.05),
    "sideslip_ref": (-0.05, 0.05),
    "sideslip_rate": (-0.3, 0.3),
    "sideslip_rate_ref": (-0.3, 0.3),
    "yaw_acceleration_ref": (-1.0, 1.0),
    "acceleration_x": (-4.0, 4.0),
    "acceleration_y": (-6.0, 6.0),
    "roll_angle": (-0.1, 0.1),
    "roll_rate": (-0.3, 0.3),
    "position_x": (0.0, 100.0),
    "position_y": (-3.0, 3.0),
    "yaw_angle": (-0.3, 0.3),
    "steer_angle": (-0.08, 0.08),
    "drive_force": (-3000.0, 3000.0),
    "friction": (0.3, 1.0),
    "friction_*": (0.3, 1.0),
    "yaw_moment": (-3000.0, 3000.0),
    "force_request_*": (-1500.0, 1500.0),
    "torque_request_*": (-400.0, 400.0),
    "wheel_torque_*": (-400.0, 400.0),
    "tyre_force_x_*": (-1000.0, 1000.0),
    "tyre_force_y_*": (-2500.0, 2500.0),
    "aligning_moment_*": (-50.0, 50.0),
    "slip_angle_*": (-0.1, 0.1),
    "slip_ratio_*": (-0.1, 0.1),
    "vertical_load_*": (1500.0, 4500.0),
    "wheel_speed_*": (45.0, 90.0),
    "wheel_velocity_*": (15.0, 30.0),
}


_SPEEDS = {"velocity_x", "wheel_speed_*", "wheel_velocity_*"}


def plausible(names: Iterable[str], source: random.Random, *, slow: bool = False) -> dict[str, float]:
    """Return a value for every name; a signal that is not in the list gets one from -1 to 1.

    With `slow`, the car is nearly standing.
    """
    values = {}
    for name in names:
        pattern = f"{name[:-2]}*" if name[-2:] in WHEELS and name[-3:-2] == "_" else name
        crawling = slow and pattern in _SPEEDS
        values[name] = source.uniform(*((0.0, 1.5) if crawling else _RANGES.get(pattern, (-1.0, 1.0))))
    return values

"""Usual ranges of signals of a moving car, for test inputs of components.

Smallest and largest value, in the unit of the signal. Chosen: a passenger car between 55 and 110 km/h, up
to the limit of its tyres on a dry road.
"""

from __future__ import annotations

from yawbench.vocabulary.wheels import WHEELS

_RANGES = {
    "velocity_x": (15.0, 30.0),
    "velocity_y": (-1.0, 1.0),
    "yaw_rate": (-0.4, 0.4),
    "yaw_rate_ref": (-0.4, 0.4),
    "sideslip": (-0.15, 0.15),
    "sideslip_ref": (-0.05, 0.05),
    "sideslip_rate": (-0.3, 0.3),
    "sideslip_rate_ref": (-0.3, 0.3),
    "yaw_acceleration_ref": (-1.0, 1.0),
    "acceleration_x": (-4.0, 4.0),
    "acceleration_y": (-6.0, 6.0),
    "roll_angle": (-0.1, 0.1),
    "roll_rate": (-0.3, 0.3),
    "pitch_angle": (-0.05, 0.05),
    "position_x": (0.0, 100.0),
    "position_y": (-3.0, 3.0),
    "yaw_angle": (-0.3, 0.3),
    "steer_angle": (-0.08, 0.08),
    "steering_wheel_angle": (-1.5, 1.5),
    "drive_force": (-3000.0, 3000.0),
    "friction": (0.3, 1.0),
    "friction_*": (0.3, 1.0),
    "yaw_moment": (-3000.0, 3000.0),
    "yaw_moment_wanted": (-3000.0, 3000.0),
    "force_request_*": (-1500.0, 1500.0),
    "torque_request_*": (-400.0, 400.0),
    "wheel_torque_*": (-400.0, 400.0),
    "tyre_force_x_*": (-1000.0, 1000.0),
    "tyre_force_y_*": (-2500.0, 2500.0),
    "aligning_moment_*": (-50.0, 50.0),
    "tyre_moment_z_*": (-50.0, 50.0),
    "overturning_moment_*": (-50.0, 50.0),
    "slip_angle_*": (-0.1, 0.1),
    "slip_ratio_*": (-0.1, 0.1),
    "tyre_slip_ratio_*": (-0.1, 0.1),
    "slip_stiffness_*": (20000.0, 80000.0),
    "inclination_angle_*": (-0.05, 0.05),
    "vertical_load_*": (1500.0, 4500.0),
    "wheel_speed_*": (45.0, 90.0),
    "wheel_velocity_*": (15.0, 30.0),
    "brake_pressure_*": (0.0, 5e6),
    "slope": (-0.1, 0.1),
    "bank": (-0.1, 0.1),
    "wind_force_y": (-1000.0, 1000.0),
    "wind_moment_z": (-500.0, 500.0),
}


def pattern_of(name: str) -> str:
    """Return a signal's name with the wheel suffix, if any, replaced by `*`."""
    return f"{name[:-2]}*" if name[-2:] in WHEELS and name[-3:-2] == "_" else name


def usual_range(name: str) -> tuple[float, float]:
    """Return the usual range of a signal, of `x_true` that of `x`; -1 to 1 if it is not listed."""
    return _RANGES.get(pattern_of(name.removesuffix("_true")), (-1.0, 1.0))

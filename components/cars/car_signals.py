"""What every car shows to the outside: its plane motion and its wheels, declared and computed once.

    beta = atan2(v_y, v_x)        dbeta/dt = (v_x a_y - v_y a_x) / (v_x^2 + v_y^2) - r

Front wheels turn with the steer angle, so their slips and velocities follow it at the same instant.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, sin
from typing import Any

from ..fmi.variables import output, signal
from .plane_body import Motion
from .wheel_kinematics import slip_angle, slip_ratio

INPUTS = (
    "steer_angle",
    "tyre_force_x_*",
    "tyre_force_y_*",
    "wheel_torque_*",
    signal("slip_stiffness_*", optional=True),
    signal("tyre_slip_ratio_*", optional=True),
)
"""Inputs of a car with wheel torques."""

MOTION = (
    "velocity_x",
    "velocity_y",
    "yaw_rate",
    "sideslip",
    "sideslip_rate",
    "acceleration_x",
    "acceleration_y",
    "position_x",
    "position_y",
    "yaw_angle",
)
"""Outputs that `motion_outputs` computes."""

WHEELS = (
    output("slip_angle_fl", "steer_angle"),
    output("slip_angle_fr", "steer_angle"),
    "slip_angle_rl",
    "slip_angle_rr",
    output("slip_ratio_fl", "steer_angle"),
    output("slip_ratio_fr", "steer_angle"),
    "slip_ratio_rl",
    "slip_ratio_rr",
    "vertical_load_*",
    "wheel_speed_*",
    output("wheel_velocity_fl", "steer_angle"),
    output("wheel_velocity_fr", "steer_angle"),
    "wheel_velocity_rl",
    "wheel_velocity_rr",
)
"""Outputs that `wheel_outputs` computes."""


def initial_motion(p: Any) -> Motion:
    """Return v_x, v_y [m/s], r [rad/s], x, y [m], psi [rad] from the parameters initial_*."""
    v_x = p.initial_speed * cos(p.initial_sideslip)
    v_y = p.initial_speed * sin(p.initial_sideslip)
    return v_x, v_y, p.initial_yaw_rate, 0.0, 0.0, 0.0


def motion_outputs(motion: Sequence[float], a_x: float, a_y: float, v_low: float) -> tuple[float, ...]:
    """Return the values of `MOTION` from the motion and the accelerations [m/s2].

    Below the speed `v_low` [m/s] the rate of the sideslip angle refers to that speed.
    """
    v_x, v_y, r, x, y, psi = motion
    turning = (v_x * a_y - v_y * a_x) / max(v_x * v_x + v_y * v_y, v_low * v_low)
    return v_x, v_y, r, atan2(v_y, v_x), turning - r, a_x, a_y, x, y, psi


def wheel_outputs(
    velocities: Sequence[float],
    spins: Sequence[float],
    loads: Sequence[float],
    *,
    radius: float,
    v_low: float,
) -> tuple[float, ...]:
    """Return the values of `WHEELS`.

    Args:
        velocities: of fl, fr, rl, rr in wheel axes, longitudinal, then lateral [m/s].
        spins: angular velocities [rad/s].
        loads: vertical loads [N].
        radius: wheel radius [m].
        v_low: speed below which slips refer to this speed [m/s].
    """
    v_fl, v_fr, v_rl, v_rr, side_fl, side_fr, side_rl, side_rr = velocities
    w_fl, w_fr, w_rl, w_rr = spins
    return (
        slip_angle(v_fl, side_fl, v_low),
        slip_angle(v_fr, side_fr, v_low),
        slip_angle(v_rl, side_rl, v_low),
        slip_angle(v_rr, side_rr, v_low),
        slip_ratio(w_fl * radius, v_fl, v_low),
        slip_ratio(w_fr * radius, v_fr, v_low),
        slip_ratio(w_rl * radius, v_rl, v_low),
        slip_ratio(w_rr * radius, v_rr, v_low),
        *loads,
        w_fl,
        w_fr,
        w_rl,
        w_rr,
        v_fl,
        v_fr,
        v_rl,
        v_rr,
    )

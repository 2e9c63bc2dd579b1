"""Plane motion of a car body under tyre forces.

Resultants of the tyre forces, with the same operations for left and right:

    X   = (F_xfl + F_xfr) cos(delta) - (F_yfl + F_yfr) sin(delta) + F_xrl + F_xrr
    Y_f = (F_xfl + F_xfr) sin(delta) + (F_yfl + F_yfr) cos(delta)        Y_r = F_yrl + F_yrr
    M   = a Y_f - b Y_r + d/2 [(F_yfl - F_yfr) sin(delta) + (F_xfr - F_xfl) cos(delta) + F_xrr - F_xrl]
          + M_zfl + M_zfr + M_zrl + M_zrr     where the tyres' own moments are connected

Motion under accelerations held in vehicle axes, a_x = dv_x/dt - v_y r, a_y = dv_y/dt + v_x r, dr/dt:
the yaw angle is a parabola in time, and the velocity in earth axes is the integral of the rotating
acceleration, taken by two-point Gauss quadrature. A step is thus of fourth order, and a body without
forces keeps its speed up to rounding.
"""

from collections.abc import Sequence
from math import cos, sin
from typing import Protocol

from yawbench.vocabulary.wheels import Four

Motion = tuple[float, float, float, float, float, float]
"""v_x, v_y [m/s], r [rad/s], x, y [m], psi [rad]."""

_GAUSS = 0.5 - 0.5 / 3.0**0.5


class Geometry(Protocol):
    """Positions of the wheels of a car: a, b and d [m], as in the parameters of every car."""

    @property
    def cg_to_front_axle(self) -> float: ...
    @property
    def cg_to_rear_axle(self) -> float: ...
    @property
    def track_width(self) -> float: ...


NO_MOMENTS: Four = (0.0, 0.0, 0.0, 0.0)
"""Zero aligning moments of the four tyres [N.m]."""


def sum_of(moments: Sequence[float]) -> float:
    """Return the sum over four wheels, in an order that is symmetric in left and right."""
    fl, fr, rl, rr = moments
    return (fl + fr) + (rl + rr)


def resultants(
    delta: float, f_x: Sequence[float], f_y: Sequence[float], p: Geometry, m_z: Sequence[float] = NO_MOMENTS
) -> Four:
    """Return X, Y_f, Y_r [N] and M [N.m] of the tyre forces, vehicle axes.

    Args:
        delta: steer angle of both front wheels [rad].
        f_x, f_y: forces of fl, fr, rl, rr, wheel axes [N].
        p: geometry of the car.
        m_z: moments of the tyres about their vertical axes [N.m].
    """
    x_fl, x_fr, x_rl, x_rr = f_x
    y_fl, y_fr, y_rl, y_rr = f_y
    c = cos(delta)
    s = sin(delta)
    x = x_fl + x_fr
    y = y_fl + y_fr
    front = x * s + y * c
    rear = y_rl + y_rr
    turn = (y_fl - y_fr) * s + (x_fr - x_fl) * c + (x_rr - x_rl)
    return (
        x * c - y * s + (x_rl + x_rr),
        front,
        rear,
        p.cg_to_front_axle * front - p.cg_to_rear_axle * rear + 0.5 * p.track_width * turn + sum_of(m_z),
    )


def move(motion: Motion, h: float, *, a_x: float, a_y: float, dr: float) -> Motion:
    """Return the motion after `h` [s] under held accelerations [m/s2], [rad/s2]."""
    v_x, v_y, r, x, y, psi = motion
    turned = (r + 0.5 * dr * h) * h
    t = _GAUSS * h
    early = (r + 0.5 * dr * t) * t
    t = h - t
    late = (r + 0.5 * dr * t) * t
    c = cos(turned)
    s = sin(turned)
    gained_c = 0.5 * h * (cos(early) + cos(late))
    gained_s = 0.5 * h * (sin(early) + sin(late))
    # Velocity at the end and distance, both in the vehicle axes of the start.
    w_x = v_x + (a_x * gained_c - a_y * gained_s)
    w_y = v_y + (a_y * gained_c + a_x * gained_s)
    half = 0.5 * h
    bend = h * h / 12.0
    along = half * (v_x + w_x) + bend * (a_x - (a_x * c - a_y * s))
    across = half * (v_y + w_y) + bend * (a_y - (a_y * c + a_x * s))
    c_0 = cos(psi)
    s_0 = sin(psi)
    return (
        w_x * c + w_y * s,
        w_y * c - w_x * s,
        r + dr * h,
        x + (along * c_0 - across * s_0),
        y + (across * c_0 + along * s_0),
        psi + turned,
    )

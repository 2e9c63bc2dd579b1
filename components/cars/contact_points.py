"""Contact points of the wheels of a sprung body: positions, forces and sliding velocities.

Contact points follow the roll and pitch of the body and, along the inclined path of the wheel, its travel:

    X_i = x_i - h theta          Y_i = y_i + h phi + p_i c_i          from the centre of mass
    v_xi = v_x - r Y_i - h dtheta          v_yi = v_y + r X_i + h dphi + p_i dc_i

Symbols as in `cars.ride`. X_i, Y_i and p_i are also the arms of the contact forces, so the power of the
forces at the contact points equals the power that body and wheels receive.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, sin

from .plane_body import NO_MOMENTS, Geometry, sum_of
from .ride import Contact, Ride
from .wheel_kinematics import Eight


def contact(
    delta: float, f_x: Sequence[float], f_y: Sequence[float], p: Geometry, m_z: Sequence[float] = NO_MOMENTS
) -> Contact:
    """Return the tyre forces in vehicle axes; arguments as in `plane_body.resultants`."""
    f_fl, f_fr, x_rl, x_rr = f_x
    g_fl, g_fr, y_rl, y_rr = f_y
    c = cos(delta)
    s = sin(delta)
    x_fl = f_fl * c - g_fl * s
    x_fr = f_fr * c - g_fr * s
    y_fl = f_fl * s + g_fl * c
    y_fr = f_fr * s + g_fr * c
    front = y_fl + y_fr
    rear = y_rl + y_rr
    moment = p.cg_to_front_axle * front - p.cg_to_rear_axle * rear
    moment += 0.5 * p.track_width * ((x_fr - x_fl) + (x_rr - x_rl)) + sum_of(m_z)
    x = (x_fl + x_fr) + (x_rl + x_rr)
    return Contact(x_fl, x_fr, x_rl, x_rr, y_fl, y_fr, y_rl, y_rr, x, front + rear, moment)


def contact_velocities(
    v_x: float, v_y: float, r: float, y: Sequence[float], *, delta: float, ride: Ride, p: Geometry
) -> Eight:
    """Return the velocities [m/s] of the contact points in wheel axes: four longitudinal, then four lateral.

    Args:
        v_x, v_y, r: of the centre of mass, vehicle axes [m/s], [rad/s].
        y: coordinates and their rates.
        delta: steer angle of both front wheels [rad].
        p: geometry of the car.
    """
    z, phi, theta, u_fl, u_fr, u_rl, u_rr, dz, dphi, dtheta, du_fl, du_fr, du_rl, du_rr = y
    t, h, p_f, p_r = ride.half_track, ride.h, ride.p_f, ride.p_r
    a_s, b_s = ride.a, ride.b
    side = t * phi
    front = z - a_s * theta
    rear = z + b_s * theta
    y_fl = p_f * (u_fl - front - side) + t
    y_fr = p_f * (u_fr - front + side) + t  # to the right
    y_rl = p_r * (u_rl - rear - side) + t
    y_rr = p_r * (u_rr - rear + side) + t
    side = t * dphi
    front = dz - a_s * dtheta
    rear = dz + b_s * dtheta
    shift = h * phi
    pitched = h * theta
    ahead = v_x - h * dtheta
    sway = v_y + h * dphi
    x_fl = ahead - r * (y_fl + shift)
    x_fr = ahead + r * (y_fr - shift)
    along = sway + r * (p.cg_to_front_axle - pitched)
    w_fl = along + p_f * (du_fl - front - side)
    w_fr = along - p_f * (du_fr - front + side)
    along = sway - r * (p.cg_to_rear_axle + pitched)
    c = cos(delta)
    s = sin(delta)
    return (
        x_fl * c + w_fl * s,
        x_fr * c + w_fr * s,
        ahead - r * (y_rl + shift),
        ahead + r * (y_rr - shift),
        w_fl * c - x_fl * s,
        w_fr * c - x_fr * s,
        along + p_r * (du_rl - rear - side),
        along - p_r * (du_rr - rear + side),
    )

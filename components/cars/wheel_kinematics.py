"""Wheel kinematics: velocities, slip angles, slip ratios and lever arms.

    v_x,i   = v_x -/+ r d/2          minus on the left, plus on the right
    v_y,f   = v_y + a r              v_y,r = v_y - b r
    v       =  v_x,i cos(delta_i) + v_y,i sin(delta_i)      wheel axes, longitudinal
    v_lat   = -v_x,i sin(delta_i) + v_y,i cos(delta_i)      wheel axes, lateral
    alpha   = atan2(v_lat, v)        kappa = (w R - v) / max(|w R|, |v|)

Both slips are ratios of speeds and undefined at rest. Below a low speed v_low they refer to that
speed instead: kappa = (w R - v) / v_low, sin(alpha) = v_lat / v_low. Thus a car at rest has no slip,
there is no division by zero, and above v_low the definitions hold exactly.

All expressions use the same operations for left and right: mirrored motion gives mirrored results
to the last bit.
"""

from math import atan2, cos, sin, sqrt

from yawbench.vocabulary.wheels import Four

from .plane_body import Geometry

Eight = tuple[float, float, float, float, float, float, float, float]


def wheel_velocities(v_x: float, v_y: float, *, r: float, delta: float, p: Geometry) -> Eight:
    """Return the velocities [m/s] of the wheel centres in wheel axes, front axle steered.

    Args:
        v_x, v_y: velocity of the centre of mass, vehicle axes [m/s].
        r: yaw rate [rad/s].
        delta: steer angle of both front wheels [rad].
        p: geometry of the car.

    Returns:
        Four longitudinal velocities (fl, fr, rl, rr), then four lateral ones.
    """
    across = r * (0.5 * p.track_width)
    left = v_x - across
    right = v_x + across
    front = v_y + p.cg_to_front_axle * r
    rear = v_y - p.cg_to_rear_axle * r
    c = cos(delta)
    s = sin(delta)
    inward = front * s
    along = front * c
    return left * c + inward, right * c + inward, left, right, along - left * s, along - right * s, rear, rear


def slip_angle(v: float, v_lat: float, v_low: float) -> float:
    """Return the slip angle alpha [rad] in (-pi, pi] from a wheel's velocity in wheel axes [m/s].

    A wheel that rolls backwards has |alpha| > pi/2; tyre models fold it to [-pi/2, pi/2] (`tyres.dugoff`).
    """
    if v > v_low or v * v + v_lat * v_lat >= v_low * v_low:
        return atan2(v_lat, v)
    return atan2(v_lat, sqrt(v_low * v_low - v_lat * v_lat))


def slip_ratio(rolling: float, v: float, v_low: float) -> float:
    """Return the longitudinal slip kappa [1] in [-2, 2], positive when driving.

    Args:
        rolling: circumferential speed w R of the wheel [m/s].
        v: longitudinal velocity of the wheel in wheel axes [m/s].
        v_low: reference speed of slip for slower wheels, > 0 [m/s].
    """
    if v > v_low and rolling >= 0.0:
        return (rolling - v) / (rolling if rolling > v else v)
    return (rolling - v) / max(abs(rolling), abs(v), v_low)


def lever_arms(delta: float, a: float, half_track: float) -> Four:
    """Return the yaw lever arms [m] of longitudinal wheel forces: M_z = sum(F_i arm_i).

    Paper A, equations (36)-(39), erratum: the front-left arm is a sin(delta) - d/2 cos(delta).
    """
    forward = a * sin(delta)
    across = half_track * cos(delta)
    return forward - across, forward + across, -half_track, half_track


def earth_velocity(v_x: float, v_y: float, psi: float) -> tuple[float, float]:
    """Return a velocity in earth axes [m/s] from vehicle axes at the yaw angle `psi` [rad]."""
    c = cos(psi)
    s = sin(psi)
    return v_x * c - v_y * s, v_x * s + v_y * c

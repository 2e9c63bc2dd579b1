"""The energy of a sprung body on its wheels, from which its equations of motion follow."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos

from yawbench.components.cars.ride import Ride


def energy(ride: Ride, r: float, y: Sequence[float]) -> float:
    """Return the energy [J] of yaw, roll, pitch and vertical motion beyond that at rest."""
    z, phi, theta, *wheels = y[:7]
    dz, dphi, dtheta, *speeds = y[7:]
    a, b, t = ride.a, ride.b, ride.half_track
    moving = 0.5 * ride.m_s * dz * dz + 0.5 * ride.yaw * r * r
    moving += (
        0.5 * ride.roll * (dphi - r * (theta + ride.tilt)) ** 2 + 0.5 * ride.pitch * (dtheta + r * phi) ** 2
    )
    moving -= ride.yaw_sprung * (r * phi * dtheta + 0.5 * r * r * (phi * phi + theta * theta))
    stored = ride.gravity_roll * (cos(phi) - 1.0) + ride.gravity_pitch * (cos(theta) - 1.0)
    travel: list[float] = []
    for u, du, x, side, m, load, k in zip(
        wheels,
        speeds,
        (a, a, -b, -b),
        (t, -t, t, -t),
        (ride.m_f, ride.m_f, ride.m_r, ride.m_r),
        (ride.load_f, ride.load_f, ride.load_r, ride.load_r),
        (ride.k_f, ride.k_f, ride.k_r, ride.k_r),
        strict=True,
    ):
        c = u - z - side * phi + x * theta
        travel.append(c)
        moving += 0.5 * m * du * du
        # Static forces: N_0 of the tyre holds the wheel's weight and the suspension's static force.
        lift = min(u, load / ride.k_t)
        stored += 0.5 * k * c * c + 0.5 * ride.k_t * lift * lift - load * lift + load * u
    fl, fr, rl, rr = travel
    return moving + stored + 0.5 * ride.s_f * (fl - fr) ** 2 + 0.5 * ride.s_r * (rl - rr) ** 2

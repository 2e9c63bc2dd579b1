"""Single-track model with saturating axles, driven by steer angle and yaw moment: the intended yaw rate.

    alpha_f = (v_y + a r) / v - delta, alpha_r = (v_y - b r) / v,  F = C alpha / sqrt(1 + (C alpha / mu N)^2)
    m (dv_y/dt + v r) = - F_f - F_r,   I dr/dt = b F_r - a F_f + M

Explicit Euler, with four substeps per step of the caller. The model starts straight ahead, uses no
measurements, and stays within the bounds below, so that it recovers after a slide.
"""

from math import sqrt
from typing import Any

from yawbench.vocabulary.gravity import G

SUBSTEPS = 4
"""Euler steps per step; chosen: stable above `SLOWEST`."""
SLIDING = 0.3
"""Largest sideslip of the model [rad]; chosen: above that of cars under control, so that it recovers."""
OF_THE_ROAD = 1.3
"""Largest yaw rate of the model over mu g / v; chosen: reached by cars for a moment."""


class SteeredTrack:
    """Single-track model: v_y [m/s], yaw rate [rad/s], lateral acceleration [m/s2], used share of the grip.

    Args:
        p: parameters with the car's names: mass, yaw_inertia, cg_to_front_axle, cg_to_rear_axle,
            cornering_stiffness_front and cornering_stiffness_rear.
    """

    def __init__(self, p: Any) -> None:
        self.p = p
        self.v_y = self.yaw_rate = 0.0
        self.acceleration = 0.0
        self.used = 0.0  # share of the grip, at the axle that uses most

    def advance(self, h: float, v: float, delta: float, mu: float, moment: float) -> None:
        """Advance the state by `h` [s]: speed v [m/s], steer angle [rad], friction, yaw moment [N.m]."""
        p = self.p
        weight = mu * p.mass * G / (p.cg_to_front_axle + p.cg_to_rear_axle)
        limits = weight * p.cg_to_rear_axle, weight * p.cg_to_front_axle
        front = rear = 0.0
        for _ in range(SUBSTEPS):
            front = p.cornering_stiffness_front * (
                (self.v_y + p.cg_to_front_axle * self.yaw_rate) / v - delta
            )
            rear = p.cornering_stiffness_rear * (self.v_y - p.cg_to_rear_axle * self.yaw_rate) / v
            f, q = saturated(front, limits[0]), saturated(rear, limits[1])
            self.acceleration = -(f + q) / p.mass
            self.v_y += h / SUBSTEPS * (self.acceleration - v * self.yaw_rate)
            turning = p.cg_to_rear_axle * q - p.cg_to_front_axle * f + moment
            self.yaw_rate += h / SUBSTEPS * turning / p.yaw_inertia
        self.v_y = limited(self.v_y, SLIDING * v)
        self.yaw_rate = limited(self.yaw_rate, OF_THE_ROAD * mu * G / v)
        self.used = max(abs(front) / limits[0], abs(rear) / limits[1])


def saturated(linear: float, limit: float) -> float:
    """Return the axle force, linear for small slip and saturating."""
    return linear / sqrt(1.0 + (linear / limit) ** 2)


def limited(x: float, limit: float) -> float:
    """Return x within +- limit."""
    return min(max(x, -limit), limit)

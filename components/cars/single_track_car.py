"""Linear single-track model, the basis of references, estimators and linear controllers.

    m v (dbeta/dt + r) = -(C_f + C_r) beta - (a C_f - b C_r) r / v + C_f delta
    I_z dr/dt          = -(a C_f - b C_r) beta - (a^2 C_f + b^2 C_r) r / v + a C_f delta

    steady state:  r / delta    = v / (L (1 + K v^2))          K = m / L^2 (b / C_f - a / C_r)
                   beta / delta = (b - m a v^2 / (C_r L)) / (L (1 + K v^2))

with positive axle stiffnesses C_f, C_r and the wheelbase L = a + b. Paper B, equation (16); paper A,
equations (1)-(4) with their errata; paper D, equation (3).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

SMALLEST = 1e-3
"""Lower bound of 1 + K v^2, reached by an oversteering car above its critical speed."""


@dataclass(frozen=True)
class SingleTrackCar:
    """Single-track car: m [kg], yaw inertia I_z [kg.m2], arms a, b [m], axle stiffnesses C_f, C_r [N/rad]."""

    m: float
    i_z: float
    a: float
    b: float
    c_f: float
    c_r: float

    @classmethod
    def of(cls, p: Any, yaw_inertia: float = 1.0) -> SingleTrackCar:
        """Return the car with these parameters; the yaw inertia does not matter in a steady turn."""
        return cls(
            p.mass,
            yaw_inertia,
            p.cg_to_front_axle,
            p.cg_to_rear_axle,
            p.cornering_stiffness_front,
            p.cornering_stiffness_rear,
        )

    def stability_factor(self) -> float:
        """Return K [s2/m2], positive for an understeering car."""
        return self.m / (self.a + self.b) ** 2 * (self.b / self.c_f - self.a / self.c_r)

    def gains(self, v: float) -> tuple[float, float]:
        """Return steady-state r / delta [1/s] and beta / delta [1] at the speed `v` [m/s]."""
        wheelbase = self.a + self.b
        base = wheelbase * max(1.0 + self.stability_factor() * v * v, SMALLEST)
        return v / base, (self.b - self.m * self.a * v * v / (self.c_r * wheelbase)) / base

    def derivatives(self, beta: float, r: float, *, delta: float, v: float) -> tuple[float, float]:
        """Return (dbeta/dt [rad/s], dr/dt [rad/s2]) at the speed `v` > 0 [m/s]."""
        front = self.c_f * (delta - beta - self.a * r / v)
        rear = self.c_r * (self.b * r / v - beta)
        return (front + rear) / (self.m * v) - r, (self.a * front - self.b * rear) / self.i_z

"""Linear tyre: forces proportional to slip, on request limited by friction.

    F_x = C_x kappa        F_y = -C_y alpha
    limited:  F scaled by mu F_z / |F| where |F| > mu F_z

For comparison with linear theory. A wheel that rolls backwards has its slip angle folded back to
[-pi/2, pi/2], so that the force still opposes the lateral sliding. No load, no force.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

from ..fmi.component import Component
from ..fmi.variables import output, parameter


@dataclass(frozen=True)
class LinearTyreParameters:
    """Of one tyre; all four are equal."""

    longitudinal_stiffness: float = parameter(
        40000.0, "N", "Longitudinal stiffness C_x of one tyre per unit slip; paper A, table 1", minimum=0.0
    )
    cornering_stiffness: float = parameter(
        50000.0, "N/rad", "Cornering stiffness C_y of one tyre; paper A, table 1", minimum=0.0
    )
    limited: bool = parameter(False, None, "Limit the force to mu F_z; chosen: off, a truly linear tyre")


def linear_tyre(alpha: float, kappa: float, *, f_z: float, c_x: float, c_y: float) -> tuple[float, float]:
    """Return (F_x, F_y) [N] in wheel axes from slip angle [rad] and longitudinal slip [1].

    Args:
        f_z: vertical load [N]; no force unless positive.
        c_x, c_y: stiffnesses [N], [N/rad].
    """
    if not f_z > 0.0:
        return 0.0, 0.0
    if alpha > 0.5 * pi:
        alpha = pi - alpha
    elif alpha < -0.5 * pi:
        alpha = -pi - alpha
    return c_x * kappa, -c_y * alpha


def limit_to_friction(f_x: float, f_y: float, grip: float) -> tuple[float, float]:
    """Return the force [N] scaled down to the circle of radius `grip` = mu F_z [N]."""
    size = sqrt(f_x * f_x + f_y * f_y)
    if size <= grip:
        return f_x, f_y
    scale = max(grip, 0.0) / size
    return scale * f_x, scale * f_y


def limited_slip_stiffness(f_x: float, f_y: float, grip: float, c_x: float) -> float:
    """Return dF_x/dkappa [N] of the limited force, from the unlimited force [N] and C_x [N]."""
    square = f_x * f_x + f_y * f_y
    if square <= grip * grip:
        return c_x
    return max(grip, 0.0) * c_x * f_y * f_y / (square * sqrt(square))


class LinearTyre(Component):
    """Linear tyres on four wheels, without or with a friction limit."""

    Parameters = LinearTyreParameters
    inputs = ("slip_angle_*", "slip_ratio_*", "vertical_load_*", "friction_*")
    outputs = (
        output("tyre_force_x_*", "slip_angle_*", "slip_ratio_*", "vertical_load_*", "friction_*"),
        output("tyre_force_y_*", "slip_angle_*", "slip_ratio_*", "vertical_load_*", "friction_*"),
        output("slip_stiffness_*", "slip_angle_*", "slip_ratio_*", "vertical_load_*", "friction_*"),
        output("tyre_slip_ratio_*", "slip_ratio_*"),
    )

    def output(self, t, u):
        p = self.p
        c_x = p.longitudinal_stiffness
        c_y = p.cornering_stiffness
        forces = [linear_tyre(u[i], u[4 + i], f_z=u[8 + i], c_x=c_x, c_y=c_y) for i in range(4)]
        stiffness = [c_x if u[8 + i] > 0.0 else 0.0 for i in range(4)]
        if p.limited:
            stiffness = [
                limited_slip_stiffness(x, y, u[12 + i] * u[8 + i], stiffness[i])
                for i, (x, y) in enumerate(forces)
            ]
            forces = [limit_to_friction(x, y, u[12 + i] * u[8 + i]) for i, (x, y) in enumerate(forces)]
        (x_fl, y_fl), (x_fr, y_fr), (x_rl, y_rl), (x_rr, y_rr) = forces
        return x_fl, x_fr, x_rl, x_rr, y_fl, y_fr, y_rl, y_rr, *stiffness, *u[4:8]

"""Linear tyre: forces proportional to slip, optionally limited by friction.

    F_x = C_x kappa        F_y = -C_y alpha
    limited:  F scaled by mu F_z / |F| if |F| > mu F_z; zero without friction

C_y is half the cornering stiffness of the axle if given, else that of a tyre, equal for all four; mu is the
friction of the road times the grip of the axle (`tyre_models.axles`).

For comparison with linear theory. The slip angle of a wheel that rolls backwards is folded to [-pi/2, pi/2],
so that the force still opposes the lateral sliding. Without load the force is zero.
"""

from dataclasses import dataclass
from math import pi, sqrt

from ..fmi.variables import parameter
from ..tyre_models.axles import AxleParameters, of_axle
from ..tyre_models.tyre import Tyre


@dataclass(frozen=True)
class LinearTyreParameters(AxleParameters):
    """Parameters of a tyre, and of axles that differ."""

    longitudinal_stiffness: float = parameter(
        40000.0, "N", "Longitudinal stiffness C_x of one tyre per unit slip", "paper A, table 1", minimum=0.0
    )
    cornering_stiffness: float = parameter(
        50000.0, "N/rad", "Cornering stiffness C_y of one tyre", "paper A, table 1", minimum=0.0
    )
    limited: bool = parameter(False, None, "Limit the force to mu F_z", "chosen: off, a truly linear tyre")


LinearAxle = tuple[float, float, float, bool]
"""Longitudinal [N] and cornering stiffness [N/rad], grip [1], and whether friction limits the force."""


class LinearTyre(Tyre):
    """Linear tyres on four wheels, optionally limited by friction."""

    Parameters = LinearTyreParameters

    @staticmethod
    def axle(p: LinearTyreParameters, name: str) -> LinearAxle:
        c_y, grip = of_axle(p, name, p.cornering_stiffness)
        return p.longitudinal_stiffness, c_y, grip, p.limited

    @staticmethod
    def wheel(kappa: float, alpha: float, f_z: float, mu: float, axle: LinearAxle) -> tuple[float, ...]:
        if not f_z > 0.0:
            return 0.0, 0.0, 0.0
        if alpha > 0.5 * pi:
            alpha = pi - alpha
        elif alpha < -0.5 * pi:
            alpha = -pi - alpha
        c_x, c_y, of_tyre, limited = axle
        f_x, f_y = c_x * kappa, -c_y * alpha
        if not limited:
            return f_x, f_y, c_x
        grip, square = mu * of_tyre * f_z, f_x * f_x + f_y * f_y
        if not grip > 0.0:
            return 0.0, 0.0, 0.0
        size = sqrt(square)
        if size <= grip:
            return f_x, f_y, c_x
        return grip / size * f_x, grip / size * f_y, grip * c_x * f_y * f_y / (square * size)

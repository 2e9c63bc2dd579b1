"""Dugoff tyre: combined slip with a friction limit, from two stiffnesses.

    F_x = C_x kappa / (1 + kappa) f(s)          F_y = -C_y tan(alpha) / (1 + kappa) f(s)     (9), (10)
    f(s) = s (2 - s) for s < 1, else 1                                                   (11)
    s = mu F_z (1 + kappa) / (2 sqrt((C_x kappa)^2 + (C_y tan(alpha))^2))                (12)

Evaluated without the poles at kappa = -1 and |alpha| = 90 degrees: with g = 1 + kappa,
c = |cos(alpha)|, q_x = C_x kappa c, q_y = -C_y sin(alpha), n = sqrt(q_x^2 + q_y^2),

    s = mu F_z g c / 2n;    s < 1:  F = mu F_z (1 - s/2) q / n;    else:  F = q / (g c)

so a locked or sideways sliding wheel has exactly the force mu F_z against its sliding, and a wheel that turns
against its direction of travel (kappa < -1) slides like a locked wheel. c is also positive for a wheel that
rolls backwards, |alpha| > 90 degrees.

C_y is half the cornering stiffness of the axle if given, else that of a tyre, equal for all four; mu is the
friction of the road times the grip of the axle (`tyre_models.axles`).

Source: paper A, equations (9)-(12); H. Dugoff, P. S. Fancher, L. Segel, SAE 700377, 1970. Erratum: (10)
prints cos(alpha) for tan(alpha); slip is positive when driving, as (9) needs.
"""

from dataclasses import dataclass
from math import cos, sin, sqrt

from ..fmi.variables import parameter
from ..tyre_models.axles import AxleParameters, of_axle
from ..tyre_models.tyre import Curve, Tyre


@dataclass(frozen=True)
class DugoffParameters(AxleParameters):
    """Parameters of a tyre, and of axles that differ."""

    longitudinal_stiffness: float = parameter(
        40000.0, "N", "Longitudinal stiffness C_x of one tyre per unit slip", "paper A, table 1", minimum=1.0
    )
    cornering_stiffness: float = parameter(
        50000.0, "N/rad", "Cornering stiffness C_y of one tyre", "paper A, table 1", minimum=1.0
    )


def dugoff(
    alpha: float, kappa: float, f_z: float, mu: float, c_x: float, c_y: float
) -> tuple[float, float, float]:
    """Return F_x, F_y, dF_x/dkappa [N] in wheel axes; equations (9)-(12), finite for every slip.

    dF_x/dkappa, at constant slip angle, is C_x / (1 + kappa)^2 while the tyre grips; while it slides, with
    q_x' = C_x c and s' = ds/dkappa, mu F_z ((1 - s/2) q_x' q_y^2 / n^3 - s' q_x / 2n).

    Args:
        alpha, kappa: slip angle [rad] and longitudinal slip [1].
        f_z, mu: vertical load [N] and friction coefficient [1]; zero force unless both are positive.
        c_x, c_y: stiffnesses [N], [N/rad], positive.
    """
    if f_z <= 0.0 or mu <= 0.0:
        return 0.0, 0.0, 0.0
    grip = mu * f_z
    c = abs(cos(alpha))
    slope = c_x * c
    q_x = c_x * kappa * c
    q_y = -c_y * sin(alpha)
    n_2 = q_x * q_x + q_y * q_y
    n = sqrt(n_2)
    rolling = (1.0 + kappa) * c
    s = turn = 0.0
    if rolling > 0.0:
        s = 0.5 * grip * rolling
        if not s < n:
            return q_x / rolling, q_y / rolling, slope * c / (rolling * rolling)
        s /= n
        turn = s * c / rolling - s * slope * q_x / n_2
    kept = 1.0 - 0.5 * s
    scale = grip * kept / n
    stiffness = grip / n * (kept * slope * q_y * q_y / n_2 - 0.5 * turn * q_x)
    return scale * q_x, scale * q_y, stiffness


class Dugoff(Tyre):
    """Dugoff tyres on four wheels: combined slip, friction per wheel."""

    Parameters = DugoffParameters

    @staticmethod
    def axle(p: DugoffParameters, name: str) -> tuple[float, float, float]:
        c_y, grip = of_axle(p, name, p.cornering_stiffness)
        return p.longitudinal_stiffness, c_y, grip

    @staticmethod
    def wheel(
        kappa: float, alpha: float, f_z: float, mu: float, axle: tuple[float, float, float]
    ) -> tuple[float, ...]:
        c_x, c_y, grip = axle
        return dugoff(alpha, kappa, f_z, mu * grip, c_x, c_y)

    @classmethod
    def curve(cls, alpha: float, f_z: float, mu: float, axle: tuple[float, float, float]) -> Curve:
        c_x, c_y, grip = axle
        return lambda kappa: dugoff(alpha, kappa, f_z, mu * grip, c_x, c_y)[0], mu * grip * f_z / c_x

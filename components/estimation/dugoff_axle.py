"""Lateral force of an axle by Dugoff's tyre model without longitudinal slip, and its derivatives.

    s = mu F_z / (2 C |tan(alpha)|)         F = -C tan(alpha)                          s >= 1
                                            F = -mu F_z (1 - s/2) sign(alpha)          s < 1

Source: as `tyres.dugoff`, equations (10)-(12) with kappa = 0.
"""

from math import tan


def axle_force(alpha: float, f_z: float, mu: float, stiffness: float) -> tuple[float, float, float]:
    """Return F_y [N], dF_y/dalpha [N/rad], dF_y/dmu [N].

    Args:
        alpha: slip angle [rad].
        f_z, mu: load [N] and friction coefficient [1], positive.
        stiffness: cornering stiffness C [N/rad].
    """
    side = tan(min(max(alpha, -1.4), 1.4))
    grip = mu * f_z
    linear = stiffness * abs(side)
    if 2.0 * linear <= grip:
        return -stiffness * side, -stiffness, 0.0
    s = grip / (2.0 * linear)
    sign = -1.0 if side > 0.0 else 1.0
    return sign * grip * (1.0 - 0.5 * s), -stiffness * s * s, sign * f_z * (1.0 - s)

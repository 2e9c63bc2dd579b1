"""Slopes of a tyre's forces by central differences."""

from __future__ import annotations

from collections.abc import Callable

_STEP = 1e-6  # truncation and rounding both below 1e-8 of a tyre's stiffness


def slip_stiffness(
    forces: Callable[[float, float], tuple[float, ...]], kappa: float, alpha: float
) -> tuple[float, float, float, float]:
    """Return dF_x/dkappa [N], dF_x/dalpha [N/rad], dF_y/dkappa [N], dF_y/dalpha [N/rad].

    Args:
        forces: F_x, F_y [N], and perhaps more, of kappa [1] and alpha [rad]; differenced centrally.
        kappa, alpha: where; kappa well inside (-1, 1), alpha inside (-pi/2, pi/2).
    """
    x_1, y_1 = forces(kappa - _STEP, alpha)[:2]
    x_2, y_2 = forces(kappa + _STEP, alpha)[:2]
    x_3, y_3 = forces(kappa, alpha - _STEP)[:2]
    x_4, y_4 = forces(kappa, alpha + _STEP)[:2]
    per_step = 0.5 / _STEP
    return (x_2 - x_1) * per_step, (x_4 - x_3) * per_step, (y_2 - y_1) * per_step, (y_4 - y_3) * per_step

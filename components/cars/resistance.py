"""What slows a car besides its tyres' slip: air and rolling resistance, as one force on the body."""

from __future__ import annotations


def resistance(v_x: float, *, drag: float, rolling: float, fade: float) -> float:
    """Return the resisting force [N] along x at the speed `v_x` [m/s]; it has the sign of v_x.

    Args:
        drag: force over speed squared, 1/2 rho C_D A [kg/m].
        rolling: rolling resistance f m g [N]; it fades linearly below `fade` [m/s], so a car at rest
            stays at rest.
    """
    share = v_x / fade
    if share > 1.0:
        share = 1.0
    elif share < -1.0:
        share = -1.0
    return drag * v_x * abs(v_x) + rolling * share

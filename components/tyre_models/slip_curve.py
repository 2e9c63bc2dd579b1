"""Inverse of a tyre's force curve: the slip that gives a force.

The stable branch of F_x(kappa), at fixed slip angle, load and friction, extends from zero slip to the first
optimum kappa_opt on either side; it may be flat near zero. The search uses only values of the curve, no
derivatives: an evaluation costs about a microsecond, so neither a table nor results of earlier samples are
needed.

The optimum is only searched for if it matters. A slip kappa is within a share q of it if and only if the
curve still rises at kappa / q, so a force far below the limit is recognized with two evaluations.
"""

from collections.abc import Callable
from math import sqrt

GROWTH = 1.6
"""Ratio of successive slips in the search for the optimum. Some tyres' curves (large slip angle at low
friction) have two optima with a shallow dip between; a dip narrower than this factor is skipped."""
FORCE_TOLERANCE = 1e-5
"""Relative error of the force at the result."""
SMALLEST_FORCE = 1e-6
"""Absolute error [N] of the force at the result, for forces near zero."""
SLIP_TOLERANCE = 1e-3
"""Relative error of the optimum."""
_GOLDEN = 0.5 * (sqrt(5.0) - 1.0)


def slip_for_force(
    force: float, curve: Callable[[float], float], *, first: float, cap: float, share: float
) -> float:
    """Return the longitudinal slip kappa [1] on the stable branch whose force is nearest to `force` [N].

    Args:
        force: requested longitudinal tyre force, negative for braking.
        curve: F_x [N] of kappa.
        first: initial |kappa| [1], on the stable branch and of its order of magnitude.
        cap: largest |kappa| [1].
        share: largest |kappa| / |kappa_opt| [1], below 1.

    Returns:
        The slip with `curve(kappa) == force` to `FORCE_TOLERANCE`, or, if that would exceed a limit,
        the limit: the smaller of `cap` and `share` times kappa_opt, with the sign of the force's branch.
    """
    at_low = curve(0.0) - force
    if at_low == 0.0:
        return 0.0
    sign = 1.0 if at_low < 0.0 else -1.0
    at_low *= sign

    def rise(x: float) -> float:  # rises from x = 0; its root is the result
        return sign * (curve(sign * x) - force)

    end = min(cap / share, 1.0)
    low, high = 0.0, min(max(first, 1e-6), end)
    at_high = rise(high)
    before, at_before = low, at_low
    optimum = 0.0  # unknown
    while at_high < 0.0:
        if at_high < at_low or (high == end and at_high < rise(end * (1.0 - SLIP_TOLERANCE))):
            optimum = high = _optimum(rise, before, high)
            at_high = rise(high)
            if at_high < 0.0:
                return sign * min(cap, share * optimum)
            low, at_low = before, at_before
            break
        if not high < end:  # the end, or NaN
            return sign * cap
        before, at_before = low, at_low
        low, at_low = high, at_high
        high = min(GROWTH * high, end)
        at_high = rise(high)
    kappa = _root(rise, low, at_low, high, at_high, FORCE_TOLERANCE * abs(force) + SMALLEST_FORCE)
    if not optimum:
        outer = min(kappa / share, end)
        if rise(outer) >= rise(outer * (1.0 - SLIP_TOLERANCE)):
            return sign * min(kappa, cap)
        optimum = _optimum(rise, kappa, outer)
    return sign * min(kappa, cap, share * optimum)


def _root(
    rise: Callable[[float], float], low: float, at_low: float, high: float, at_high: float, tolerance: float
) -> float:
    """Return the root between `low` and `high` by false position with the weights of Anderson and Bjorck."""
    x = high
    for _ in range(100):
        if not at_high > at_low:
            return x
        x = (low * at_high - high * at_low) / (at_high - at_low)
        y = rise(x)
        if abs(y) <= tolerance:
            return x
        if y > 0.0:
            weight = 1.0 - y / at_high
            at_low *= weight if weight > 0.0 else 0.5
            high, at_high = x, y
        else:
            weight = 1.0 - y / at_low
            at_high *= weight if weight > 0.0 else 0.5
            low, at_low = x, y
    return x


def _optimum(rise: Callable[[float], float], low: float, high: float) -> float:
    """Return the slip between `low` and `high` at which `rise` is largest, by golden section."""
    inner, outer = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_inner, at_outer = rise(inner), rise(outer)
    while high - low > SLIP_TOLERANCE * high:
        if at_inner > at_outer:
            high, outer, at_outer = outer, inner, at_inner
            inner = high - _GOLDEN * (high - low)
            at_inner = rise(inner)
        else:
            low, inner, at_inner = inner, outer, at_outer
            outer = low + _GOLDEN * (high - low)
            at_outer = rise(outer)
    return 0.5 * (low + high)

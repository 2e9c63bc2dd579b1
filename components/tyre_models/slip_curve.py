"""The question to a tyre's force curve which slip gives a force.

The stable branch of F_x(kappa), at fixed slip angle, load and friction, goes from zero slip to the first
optimum kappa_opt on either side; it may be flat near zero. Nothing else of the tyre is known here, no
derivative either: a force costs about a microsecond, so the search needs no table and no memory of
earlier samples.

The optimum itself is only looked for when it matters. A slip kappa lies within a share q of it exactly
if the curve still rises at kappa / q, so a force far below the limit needs two evaluations to be
known as such.
"""

from collections.abc import Callable
from math import sqrt

GROWTH = 1.6
"""Factor from one slip to the next on the way to the optimum. Some tyres' curves (large slip angle on
low friction) have two optima with a shallow dip between; one narrower than this factor is passed over."""
FORCE_TOLERANCE = 1e-5
"""Relative error of the force at the slip found."""
SMALLEST_FORCE = 1e-6
"""Absolute error [N] of the force at the slip found, for forces near zero."""
SLIP_TOLERANCE = 1e-3
"""Relative error of the optimum found."""
_GOLDEN = 0.5 * (sqrt(5.0) - 1.0)


def slip_for_force(
    force: float, curve: Callable[[float], float], *, first: float, cap: float, share: float
) -> float:
    """Return the longitudinal slip kappa [1] on the stable branch whose force is nearest to `force` [N].

    Args:
        force: longitudinal tyre force wanted, negative for braking.
        curve: F_x [N] of kappa.
        first: |kappa| [1] at which to begin, surely on the stable branch, of its order of size.
        cap: largest |kappa| [1].
        share: largest |kappa| / |kappa_opt| [1], below 1.

    Returns:
        The slip with `curve(kappa) == force` to `FORCE_TOLERANCE`, or, where that would exceed a limit,
        the limit: the smaller of `cap` and `share` times kappa_opt, with the sign of the force's branch.
    """
    at_low = curve(0.0) - force
    if at_low == 0.0:
        return 0.0
    sign = 1.0 if at_low < 0.0 else -1.0
    at_low *= sign

    def rise(x: float) -> float:  # turned so that it rises from x = 0, less the force: a root is sought
        return sign * (curve(sign * x) - force)

    end = min(cap / share, 1.0)
    low, high = 0.0, min(max(first, 1e-6), end)
    at_high = rise(high)
    before, at_before = low, at_low
    optimum = 0.0  # not known
    while at_high < 0.0:
        if at_high < at_low or (high == end and at_high < rise(end * (1.0 - SLIP_TOLERANCE))):
            optimum = high = _optimum(rise, before, high)
            at_high = rise(high)
            if at_high < 0.0:
                return sign * min(cap, share * optimum)
            low, at_low = before, at_before
            break
        if not high < end:  # the end, or no number
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

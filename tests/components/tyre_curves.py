"""Force over slip of the tyres that slip control knows, for tests, and its limits by plain scanning."""

from __future__ import annotations

from itertools import pairwise

from yawbench.components.wheel_controls.slip import TYRES as KNOWN
from yawbench.components.wheel_controls.slip import SlipParameters

CAP, SHARE = 0.25, 0.95
SHALLOW = 0.01  # a dip that the search may pass over


def curve_of(p, axle, alpha=0.0, f_z=4000.0, mu=1.0):
    tyre = KNOWN[p.tyre]
    return tyre.curve(alpha, f_z, mu, tyre.for_curve(p)[0 if axle == "front" else 2])


def tyre_curve(alpha, f_z, mu, **given):
    p = SlipParameters(**given)
    return curve_of(p, "front", alpha, f_z, mu)


def slip_limits(force, sign):
    """Return the limits that plain scanning allows, and its grid; see `SHALLOW`.

    `SHARE` times each slip from which the force falls, up to the first from which it falls by more than
    `SHALLOW`; `CAP` if there is none of those.
    """
    n = 4000
    grid = CAP / SHARE / n
    forces = [sign * force(sign * i * grid) for i in range(n + 1)]
    limits = []
    top, rising = forces[0], True
    for i, (before, now) in enumerate(pairwise(forces)):
        falling = now < before - 1e-12 * abs(before)
        if falling and rising:
            limits.append(min(CAP, SHARE * i * grid))
        rising = not falling
        top = max(top, now)
        if now < top - SHALLOW * abs(top):
            return limits, grid
    return [*limits, CAP], grid

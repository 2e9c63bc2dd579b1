"""Stability in the phase plane of sideslip angle and its rate: a strip between two parallel lines.

    |beta + T dbeta/dt| <= beta_s,      beta_s = min(mu, 1) boundary

Outside of it, oversteer grows by itself. beta + T dbeta/dt is the sideslip angle as it will be after T if its
rate lasts. Boundary and T are those of the stability index |1/24 dbeta/dt + 4/24 beta| < 1, in degrees: 6
degrees and 0.25 s. It is known to us from papers that quote it (in radians, 2.39 and 9.55); the paper itself,
J. He, D. A. Crolla, M. C. Levesley, W. J. Manning, Coordination of active steering, driveline, and braking
for integrated vehicle dynamics control, Proc. IMechE Part D 220(10), 2006, 1401-1421, could not be read, nor
could S. Inagaki, I. Kushiro, M. Yamamoto, Analysis on vehicle stability in critical cornering using
phase-plane method, AVEC 1994 (JSAE Review 16, 1995, 216), from which the plane comes. Ours: the boundary
falls with friction.
"""

from dataclasses import dataclass
from typing import Any

from ..fmi.variables import parameter


@dataclass(frozen=True)
class PhasePlaneParameters:
    """Parameters of the strip."""

    boundary: float = parameter(
        0.105,
        "rad",
        "Half width beta_s of the stable strip at friction 1",
        "He et al.: 6 degrees",
        minimum=1e-3,
    )
    lead_time: float = parameter(
        0.25,
        "s",
        "Time T for which the rate of the sideslip is extrapolated",
        "He et al.: 6 / 24 s",
        minimum=0.0,
    )


def beyond(value: float, threshold: float) -> float:
    """Return the excess of `value` over +-`threshold`, with its sign."""
    return value - threshold if value > threshold else value + threshold if value < -threshold else 0.0


def excess(beta: float, rate: float, mu: float, p: Any, share: float = 1.0) -> float:
    """Return by how much beta + T dbeta/dt lies outside of the strip [rad], with its sign; 0 inside.

    Args:
        beta, rate: sideslip angle [rad] and its rate [rad/s].
        mu: friction [1].
        p: parameters of `PhasePlaneParameters`.
        share: of the strip's width [1].
    """
    return beyond(beta + p.lead_time * rate, share * p.boundary * min(max(mu, 0.0), 1.0))

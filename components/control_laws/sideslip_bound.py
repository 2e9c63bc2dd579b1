"""Largest sideslip angle at which a driver can still control the car, depending on friction.

    beta_max = atan(c mu),      c = 0.02 s2/m g

Source: R. Rajamani, Vehicle Dynamics and Control, 2nd edition, equation (8.14), a rule of thumb for the angle
up to which tyres respond to steering; equation (18) of paper B is the same.
"""

from math import atan

from yawbench.vocabulary.gravity import G

PER_FRICTION = 0.02 * G
"""c [1]."""


def sideslip_bound(mu: float, per_friction: float = PER_FRICTION) -> float:
    """Return the largest sideslip angle [rad] at friction `mu` [1], with `per_friction` = c [1]."""
    return atan(per_friction * max(mu, 0.0))

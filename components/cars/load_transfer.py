"""Quasi-static wheel loads of a rigid car.

    F_zf = m g b / 2L - m h a_x / 2L -/+ b m h a_y / (L d)        minus left, plus right
    F_zr = m g a / 2L + m h a_x / 2L -/+ a m h a_y / (L d)

a_x, a_y are the accelerations by the tyre forces. A lifted wheel has no load; the other wheel of its axle
then carries the load of the axle, so that the loads always add up to m g.
"""

from typing import Protocol

from yawbench.vocabulary.gravity import G
from yawbench.vocabulary.wheels import Four

from .plane_body import Geometry


class Weight(Geometry, Protocol):
    """Geometry, mass m [kg] and height h [m] of the centre of mass of a car."""

    @property
    def mass(self) -> float: ...
    @property
    def cg_height(self) -> float: ...


def quasi_static_loads(a_x: float, a_y: float, p: Weight, gravity: float = G) -> Four:
    """Return F_z [N] of fl, fr, rl, rr.

    Args:
        a_x, a_y: accelerations by the tyre forces, X / m and Y / m [m/s2].
        p: the car.
        gravity: component normal to the road [m/s2].
    """
    a, b = p.cg_to_front_axle, p.cg_to_rear_axle
    weight = p.mass * gravity
    lift = p.mass * p.cg_height
    across = lift * a_y / ((a + b) * p.track_width)
    return loads_of_axles((weight * b - lift * a_x) / (a + b), weight, b * across, a * across)


def loads_of_axles(front: float, weight: float, front_across: float, rear_across: float) -> Four:
    """Return F_z [N] of fl, fr, rl, rr, never negative and with the sum `weight`.

    Args:
        front, weight: load of the front axle and of both axles [N].
        front_across, rear_across: load transfer from the left to the right wheel of an axle [N].
    """
    front = min(max(front, 0.0), weight)
    rear = 0.5 * (weight - front)
    front *= 0.5
    front_across = min(max(front_across, -front), front)
    rear_across = min(max(rear_across, -rear), rear)
    return front - front_across, front + front_across, rear - rear_across, rear + rear_across

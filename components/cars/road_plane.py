"""Accelerations of a car due to an inclined road and wind.

    e_x = -g sin(slope)              e_y = F_w / m - g sin(bank)              [m/s2], vehicle axes
    g_n = g sqrt(1 - sin^2(slope) - sin^2(bank))        gravity towards the road
    a_x = X / m + e_x,  a_y = Y / m + e_y,  dr = (M + M_w) / I_z              X, Y, M of the tyres

The motion is that in the plane of the road. e_x and e_y act on every part of the car alike, so relative
motion (springs, loads, roll) follows from the tyre forces as on a level road: on a bank as in a bend with the
same side force. Loads add up to m g_n. The wind F_w is assumed to act likewise, at the height of the centre
of mass and M_w / F_w ahead of it.
"""

from collections.abc import Sequence
from math import sin, sqrt
from typing import NamedTuple

from yawbench.vocabulary.gravity import G

from ..fmi.variables import signal

INPUTS = tuple(signal(name, optional=True) for name in ("slope", "bank", "wind_force_y", "wind_moment_z"))


class Pull(NamedTuple):
    """Effect of road and wind: e_x, e_y [m/s2], g - g_n [m/s2] and M_w [N.m]."""

    x: float
    y: float
    lighter: float
    turn: float


LEVEL = Pull(-0.0, -0.0, -0.0, -0.0)  # adding -0.0 changes no bit of any number
"""Level road without wind."""


def pull_of(signals: Sequence[float], mass: float) -> Pull:
    """Return the effect of slope, bank [rad], wind force [N] and moment [N.m] on a car of `mass` [kg]."""
    slope, bank, force, moment = signals
    if slope == bank == force == moment == 0.0:
        return LEVEL
    up, aside = sin(slope), sin(bank)
    normal = sqrt(max(1.0 - up * up - aside * aside, 0.0))
    return Pull(-G * up, force / mass - G * aside, G - G * normal, moment)

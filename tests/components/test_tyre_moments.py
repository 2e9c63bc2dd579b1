"""Moments of the tyres about their vertical axes on every plant."""

from __future__ import annotations

import pytest

from yawbench.components.plants.eight_dof import EightDof
from yawbench.components.plants.fourteen_dof import FourteenDof
from yawbench.components.plants.seven_dof import SevenDof
from yawbench.components.plants.two_dof import TwoDof
from yawbench.vocabulary.wheels import wheels

from .stand import Stand


@pytest.mark.parametrize("plant", [TwoDof, SevenDof, EightDof, FourteenDof])
def test_moments_of_the_tyres_turn_the_car_and_do_nothing_else_at_first(plant):
    """Held for a millisecond on a car that rolls straight on; without them nothing turns it."""
    turned = {}
    for moment in (0.0, 30.0):
        stand = Stand(plant)
        stand.start()
        y = stand.step(0.001, **dict.fromkeys(wheels("tyre_moment_z_*"), moment))
        turned[moment] = y["yaw_rate"], y["velocity_x"]
    assert turned[0.0][0] == 0.0
    assert turned[30.0][0] == pytest.approx(0.001 * 4 * 30.0 / stand.unit.p.yaw_inertia, rel=0.01)
    assert turned[30.0][1] == pytest.approx(turned[0.0][1], rel=1e-9)

"""Forces carried to the end of a step: straight lines exactly, jumps never beyond what was measured."""

from __future__ import annotations

import random

import numpy as np
import pytest

from yawbench.components.drivers.sine import Sine
from yawbench.components.mathematics.carry import Carried, limited
from yawbench.components.plants.eight_dof import EightDof
from yawbench.components.plants.fourteen_dof import FourteenDof
from yawbench.components.plants.seven_dof import SevenDof
from yawbench.components.tyres.dugoff import Dugoff

from .loop import Loop
from .stand import Stand, four
from .test_plants import free

PLANTS = (SevenDof, EightDof, FourteenDof)


@pytest.mark.parametrize("steps", [[0.001], [0.001, 0.004, 0.0005]])
def test_a_jump_is_carried_no_further_than_it_went(steps):
    carried = Carried([0.0])
    for k in range(12):
        value = 0.0 if k < 3 else 1.0
        (end,) = carried.to_end(steps[k % len(steps)], [value])
        assert 0.0 <= end <= value
    assert end == 1.0


@pytest.mark.parametrize("ratio", [0.05, 0.3, 0.5, 0.8, 0.98])
def test_a_value_that_settles_is_not_carried_beyond_where_it_settles(ratio):
    carried = Carried([0.0])
    for _ in range(3):
        carried.to_end(0.001, [0.0])
    ends = [carried.to_end(0.001, [1.0 - ratio**k])[0] for k in range(1, 400)]
    assert max(ends) <= 1.0 + 1e-12


def test_what_is_added_changes_without_jumps():
    added = [limited((x + 5.0) / 12.0, x, 1.0) for x in np.linspace(-3.0, 3.0, 60001)]
    assert np.abs(np.diff(added)).max() < 5e-4
    assert limited(0.5, 1.0, 1.0) == 0.5


@pytest.mark.parametrize("plant", PLANTS)
def test_after_a_step_of_the_forces_no_acceleration_goes_beyond_its_settled_value(plant):
    force, mass = -800.0, plant.Parameters().mass
    stand = Stand(plant, initial_speed=25.0, **free(plant))
    stand.start()
    stand.step(0.001)
    found = [stand.step(0.001, **four("tyre_force_x", force))["acceleration_x"] for _ in range(20)]
    assert found == pytest.approx([4.0 * force / mass] * 20, rel=1e-12)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("begins", [1, 10])
def test_after_a_step_of_the_torque_no_acceleration_goes_beyond_its_settled_value(plant, begins):
    mu, torque = 0.05, -400.0  # locks the wheels, within milliseconds
    constants = four("friction", mu) | four("wheel_torque", 0.0)
    units = [(Sine, {"amplitude": 0.0}), (plant, {"initial_speed": 25.0, **free(plant)}), (Dugoff, {})]
    loop = Loop(units, algorithm="extrapolated", constants=constants)
    found = []
    for k in range(800):
        if k == begins:
            loop.constants |= four("wheel_torque", torque)
        loop.step(0.001)
        found.append(loop["acceleration_x"])
    settled = -mu * 9.81
    assert found[begins + 3] < 0.85 * settled
    assert found[-1] == pytest.approx(settled, rel=2e-3)
    # The master hands over forces a little further on, and one of the cars pitches.
    assert min(found) >= settled * (1.0 + (1e-3 if plant is FourteenDof else 1e-6))


def test_the_loop_of_loads_and_forces_is_calm_down_to_a_gain_of_minus_0_65():
    for seed in range(5):
        chance = random.Random(seed)
        carried, force, before = Carried([0.0]), 0.0, 0.0
        ends = []
        for k in range(3000):
            pushed = chance.gauss(0.0, 1.0 if k < 100 else 0.0)
            (end,) = carried.to_end(0.001, [1.5 * force - 0.5 * before + pushed])
            before, force = force, -0.65 * end  # as `extrapolated` hands it to the next step
            ends.append(abs(end))
        assert max(ends[-100:]) < 1e-6

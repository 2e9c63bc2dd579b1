"""Wheels that lean with the body, and what tyres make of it."""

from __future__ import annotations

import pytest

from tests.components.test_transient_tyre import SYMMETRIC
from yawbench.components.plants.eight_dof import EightDof
from yawbench.components.plants.fourteen_dof import FourteenDof
from yawbench.components.tyres.magic_formula_62 import MagicFormula62
from yawbench.vocabulary.wheels import WHEELS, wheels

from .loop import Loop
from .stand import Stand, wheel_values

PLANTS = pytest.mark.parametrize("plant", [EightDof, FourteenDof])


@PLANTS
def test_wheels_lean_by_their_axles_share_of_the_roll_to_the_outside_of_the_turn(plant):
    stand = Stand(plant, roll_camber_front=0.8, roll_camber_rear=0.3)
    to_the_left = dict.fromkeys(wheels("tyre_force_y_*"), 1500.0)
    stand.start()
    for _ in range(300):
        y = stand.step(0.005, **to_the_left)
    assert y["roll_angle"] > 0.01  # the left side rises, tops of the wheels go to the right
    told = wheel_values(y, "inclination_angle")
    assert told == pytest.approx([share * y["roll_angle"] for share in (0.8, 0.8, 0.3, 0.3)], rel=1e-12)


def steady_turn(plant, e_f, e_r):
    """Return a loop of plant and tyres in a slow turn to the left, and its steer angle."""
    steer = 0.002
    given = {"roll_camber_front": e_f, "roll_camber_rear": e_r, "initial_speed": 20.0}
    constants = dict.fromkeys(wheels("friction_*"), 1.0) | {"steer_angle": steer}
    loop = Loop([(plant, given), (MagicFormula62, SYMMETRIC)], algorithm="extrapolated", constants=constants)
    loop.run(2.5, 1250, lambda _: None)
    return loop, steer


@PLANTS
@pytest.mark.sampled(1)
def test_the_understeer_that_camber_adds_is_that_of_the_tyres_camber_stiffness(plant):
    """delta - L r / v grows by phi (e_f C_gf / C_f - e_r C_gr / C_r), C_g the slope of -F_y over camber."""
    added = {}
    for shares in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)):
        loop, steer = steady_turn(plant, *shares)
        p = loop.units[0].slave.p
        wheelbase = p.cg_to_front_axle + p.cg_to_rear_axle
        a_y = loop["yaw_rate"] * loop["velocity_x"]
        assert a_y > 0.1
        added[shares] = (steer - wheelbase * loop["yaw_rate"] / loop["velocity_x"]) / a_y
        roll = loop["roll_angle"] / a_y
    loads = {f"vertical_load_{wheel}": loop[f"vertical_load_{wheel}"] for wheel in WHEELS}
    still = loads | dict.fromkeys(wheels("friction_*"), 1.0)
    slopes = []
    for name in ("slip_angle_*", "inclination_angle_*"):
        stand = Stand(MagicFormula62, **SYMMETRIC)
        y = stand.start(**still, **dict.fromkeys(wheels(name), 1e-5))
        slopes.append([-(y[f"tyre_force_y_{a}l"] + y[f"tyre_force_y_{a}r"]) / 2e-5 for a in "fr"])
    thrust = [c_gamma / c_alpha for c_alpha, c_gamma in zip(*slopes, strict=True)]
    assert min(thrust) > 0.01
    bare = added[0.0, 0.0]
    assert added[1.0, 0.0] - bare == pytest.approx(roll * thrust[0], rel=0.02)
    assert added[0.0, 1.0] - bare == pytest.approx(-roll * thrust[1], rel=0.02)

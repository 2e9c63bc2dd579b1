"""Steer and camber of wheels by roll, travel and side force, and the lag of slip angles."""

from __future__ import annotations

import math
from functools import cache

import pytest

from yawbench.components.plants.eight_dof import EightDof
from yawbench.components.plants.fourteen_dof import FourteenDof
from yawbench.components.plants.seven_dof import SevenDof
from yawbench.components.plants.two_dof import TwoDof
from yawbench.components.tyres.magic_formula import MagicFormula
from yawbench.components.tyres.magic_formula_62 import MagicFormula62
from yawbench.vocabulary.wheels import WHEELS, wheels

from .loop import Loop
from .stand import Stand, wheel_values
from .test_transient_tyre import SYMMETRIC

ROLLING = pytest.mark.parametrize("plant", [EightDof, FourteenDof])
EVERY = pytest.mark.parametrize("plant", [TwoDof, SevenDof, EightDof, FourteenDof])
STEER = 0.002


@cache
def turn(plant, tyre=MagicFormula, **given):
    """Return a loop of plant and tyres in a slow steady turn to the left at 20 m/s."""
    constants = dict.fromkeys(wheels("friction_*"), 1.0) | {"steer_angle": STEER}
    tyres = SYMMETRIC if tyre is MagicFormula62 else {}
    units = [(plant, {"initial_speed": 20.0, **given}), (tyre, tyres)]
    loop = Loop(units, algorithm="extrapolated", constants=constants)
    loop.run(2.5, 1250, lambda _: None)
    return loop


def understeer(loop):
    """Return steer beyond that of the geometry over a_y [rad s2/m], and a_y [m/s2]."""
    p = loop.units[0].slave.p
    r, v = loop["yaw_rate"], loop["velocity_x"]
    return (STEER - (p.cg_to_front_axle + p.cg_to_rear_axle) * r / v) / (r * v), r * v


@ROLLING
@pytest.mark.parametrize(("axle", "given"), [("front", 0.1), ("rear", -0.1)])
def test_roll_steer_adds_its_share_of_the_roll_gradient_to_the_understeer(plant, axle, given):
    plain, _ = understeer(turn(plant))
    steered = turn(plant, **{f"roll_steer_{axle}": given})
    gradient, a_y = understeer(steered)
    if plant is EightDof:
        roll = steered["roll_angle"]
    else:  # wheels on tyre springs: roll against the wheels
        p, body = steered.units[0].slave.p, steered.units[0].slave.body
        left, right = (3, 4) if axle == "front" else (5, 6)
        roll = body[1] - (body[left] - body[right]) / p.track_width
    assert roll > 0.0
    assert gradient - plain == pytest.approx(given * roll / a_y, rel=0.02)


@EVERY
@pytest.mark.parametrize("axle, sign", [("front", 1.0), ("rear", -1.0)])
def test_an_axle_that_yields_steers_by_its_side_force_over_its_stiffness(plant, axle, sign):
    plain, _ = understeer(turn(plant))
    loop = turn(plant, **{f"steer_stiffness_{axle}": 5e5})
    gradient, a_y = understeer(loop)
    force = sum(loop[f"tyre_force_y_{axle[0]}{side}"] for side in "lr")
    assert gradient - plain == pytest.approx(sign * force / 5e5 / a_y, rel=0.02)


@EVERY
def test_slip_angles_lag_over_their_relaxation_length(plant):
    stand = Stand(plant, initial_speed=20.0, slip_angle_relaxation=0.5)
    plain = Stand(plant, initial_speed=20.0)
    still, moved = {"steer_angle": 0.0}, {"steer_angle": 0.02}
    for one in (stand, plain):
        one.start(**still)
        one.step(0.001, **still)
    for _ in range(25):  # 0.5 m
        late, now = stand.step(0.001, **moved), plain.step(0.001, **moved)
    share = 1.0 - math.exp(-1.0)
    for wheel in WHEELS[:2]:
        assert late[f"slip_angle_{wheel}"] == pytest.approx(share * now[f"slip_angle_{wheel}"], rel=0.02)


def test_wheels_steer_in_bump_as_in_roll():
    """Both front wheels toe out, both rear wheels in, where the body sinks."""
    sunk = {"initial_speed": 20.0, "initial_heave": -0.02}
    stand, plain = (
        Stand(FourteenDof, roll_steer_front=0.1, roll_steer_rear=0.1, **sunk),
        Stand(FourteenDof, **sunk),
    )
    for one in (stand, plain):
        one.start()
    for _ in range(100):
        steered, straight = stand.step(0.001), plain.step(0.001)
    body, half = stand.unit.body, 0.5 * stand.unit.p.track_width
    travel = body[3] - (body[0] - stand.unit.ride.a * body[2])
    assert abs(travel) > 1e-3
    toe = {w: straight[f"slip_angle_{w}"] - steered[f"slip_angle_{w}"] for w in WHEELS}
    assert toe["fl"] == pytest.approx(0.1 * travel / half, rel=1e-6)
    assert toe["fr"] == -toe["fl"]
    assert toe["rl"] == -toe["rr"]
    assert toe["rl"] * toe["fl"] < 0.0


@ROLLING
def test_wheels_lean_by_their_axles_share_of_the_roll_to_the_outside_of_the_turn(plant):
    stand = Stand(plant, roll_camber_front=0.8, roll_camber_rear=0.3)
    to_the_left = dict.fromkeys(wheels("tyre_force_y_*"), 1500.0)
    stand.start()
    for _ in range(300):
        y = stand.step(0.005, **to_the_left)
    assert y["roll_angle"] > 0.01  # the left side rises, tops of the wheels go to the right
    told = wheel_values(y, "inclination_angle")
    assert told == pytest.approx([share * y["roll_angle"] for share in (0.8, 0.8, 0.3, 0.3)], rel=1e-12)


@ROLLING
@pytest.mark.sampled(1)
def test_the_understeer_that_camber_adds_is_that_of_the_tyres_camber_stiffness(plant):
    """delta - L r / v grows by phi (e_f C_gf / C_f - e_r C_gr / C_r), C_g the slope of -F_y over camber."""
    bare, front, rear = (
        turn(plant, MagicFormula62, roll_camber_front=e_f, roll_camber_rear=e_r)
        for e_f, e_r in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
    )
    loads = {name: rear[name] for name in wheels("vertical_load_*")}
    slopes = []
    for name in ("slip_angle_*", "inclination_angle_*"):
        small = dict.fromkeys(wheels("friction_*"), 1.0) | dict.fromkeys(wheels(name), 1e-5)
        y = Stand(MagicFormula62, **SYMMETRIC).start(**loads, **small)
        slopes.append([-(y[f"tyre_force_y_{a}l"] + y[f"tyre_force_y_{a}r"]) / 2e-5 for a in "fr"])
    thrust = [c_gamma / c_alpha for c_alpha, c_gamma in zip(*slopes, strict=True)]
    assert min(thrust) > 0.01
    plain, roll = understeer(bare)[0], rear["roll_angle"] / understeer(rear)[1]
    assert understeer(front)[0] - plain == pytest.approx(roll * thrust[0], rel=0.02)
    assert understeer(rear)[0] - plain == pytest.approx(-roll * thrust[1], rel=0.02)

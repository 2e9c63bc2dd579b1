"""Every plant alone: its start, loads at rest, slips, lever arms, and motion without forces."""

from __future__ import annotations

from math import atan2, cos, sin

import pytest

from yawbench.components.cars.resistance import ResistanceParameters
from yawbench.components.cars.wheel_spin import spin
from yawbench.components.plants.eight_dof import EightDof
from yawbench.components.plants.fourteen_dof import FourteenDof
from yawbench.components.plants.seven_dof import SevenDof
from yawbench.components.plants.two_dof import TwoDof
from yawbench.vocabulary.gravity import G
from yawbench.vocabulary.wheels import WHEELS, wheels

from .stand import Stand, four, wheel_values

PLANTS = (TwoDof, SevenDof, EightDof, FourteenDof)
every = pytest.mark.parametrize("plant", PLANTS)


def free(plant):
    """Parameters that take rolling and air resistance off a plant that has them."""
    resisting = issubclass(plant.Parameters, ResistanceParameters)
    return {"drag_coefficient": 0.0, "rolling_resistance": 0.0} if resisting else {}


def places(p):
    """Return x and y [m] of the wheels in the car."""
    a, b, half = p.cg_to_front_axle, p.cg_to_rear_axle, 0.5 * p.track_width
    return (a, half), (a, -half), (-b, half), (-b, -half)


@pytest.mark.parametrize(
    ("plant", "given"),
    [
        *((plant, {}) for plant in PLANTS),
        (FourteenDof, {"front_unsprung_share": 0.6, "sprung_mass": 1500.0, "cg_to_front_axle": 1.1}),
    ],
)
def test_at_rest_wheels_have_the_loads_of_the_lever_rule(plant, given):
    p = plant.Parameters(**given)
    expected = [0.5 * p.mass * G * abs(other[0]) for other in reversed(places(p))]
    wheelbase = p.cg_to_front_axle + p.cg_to_rear_axle
    stand = Stand(plant, initial_speed=0.0, **given)
    for y in (stand.start(), stand.step(0.01), stand.step(1.0)):
        assert wheel_values(y, "vertical_load") == pytest.approx([x / wheelbase for x in expected], rel=1e-12)


@every
def test_wheels_roll_freely_at_the_start_at_the_slip_angles_of_their_velocities(plant):
    speed, r, beta, steer = 20.0, 0.5, -0.1, 0.1
    stand = Stand(plant, initial_speed=speed, initial_yaw_rate=r, initial_sideslip=beta)
    y = stand.start(steer_angle=steer)
    assert y["sideslip"] == pytest.approx(beta)
    assert y["velocity_x"] ** 2 + y["velocity_y"] ** 2 == pytest.approx(speed**2)
    assert wheel_values(y, "slip_ratio") == pytest.approx([0.0] * 4, abs=1e-15)
    p, v_x, v_y = plant.Parameters(), speed * cos(beta), speed * sin(beta)
    expected = [
        atan2(v_y + r * x, v_x - r * side) - angle
        for (x, side), angle in zip(places(p), (steer, steer, 0.0, 0.0), strict=True)
    ]
    assert wheel_values(y, "slip_angle") == pytest.approx(expected, rel=1e-12)
    if plant is not TwoDof:
        rolling = [w * p.wheel_radius for w in wheel_values(y, "wheel_speed")]
        assert rolling == pytest.approx(wheel_values(y, "wheel_velocity"), rel=1e-14)


@every
@pytest.mark.parametrize("wheel", WHEELS)
def test_each_force_turns_the_straight_car_with_its_lever_arm(plant, wheel):
    p = plant.Parameters()
    x, side = places(p)[WHEELS.index(wheel)]
    for name, arm in (("tyre_force_x", 0.0 if plant is TwoDof else -side), ("tyre_force_y", x)):
        stand = Stand(plant)
        stand.start()
        y = stand.step(0.001, **{f"{name}_{wheel}": 500.0})
        rel = 1e-11 if plant in (TwoDof, SevenDof) else 0.01  # the others roll
        assert y["yaw_rate"] * p.yaw_inertia / 0.001 == pytest.approx(500.0 * arm, rel=rel, abs=1e-9)


@pytest.mark.parametrize("plant", [SevenDof, EightDof, FourteenDof])
def test_without_forces_a_spinning_car_keeps_speed_spin_and_course(plant):
    speed, r, beta = 22.0, 0.8, -0.3
    start = {"initial_speed": speed, "initial_yaw_rate": r, "initial_sideslip": beta}
    body = {"roll_arm": 0.0} if plant is EightDof else {}
    stand = Stand(plant, **start, **free(plant), **body)
    stand.start()
    for _ in range(500):
        y = stand.step(0.004)
    psi, v = y["yaw_angle"], complex(speed * cos(beta), speed * sin(beta))
    found = complex(y["velocity_x"], y["velocity_y"]) * complex(cos(psi), sin(psi))
    assert (found.real, found.imag) == pytest.approx((v.real, v.imag), rel=1e-9)
    assert (y["position_x"], y["position_y"]) == pytest.approx((2.0 * v.real, 2.0 * v.imag), rel=1e-8)
    if plant is not FourteenDof:  # the wheels' spin turns its body
        assert (psi, y["yaw_rate"]) == pytest.approx((2.0 * r, r), rel=1e-12)
        assert y["sideslip_rate"] == pytest.approx(-r, rel=1e-9)  # the course stays, the car turns


@every
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


@pytest.mark.parametrize("plant", [SevenDof, EightDof, FourteenDof])
def test_wheels_turn_as_their_equation_says_with_the_slip_stiffness_that_tyres_tell(plant):
    stand, h = Stand(plant, **free(plant)), 2e-3
    before = stand.start(**four("tyre_force_x", -2000.0))
    told = {"tyre_force_x": -2000.0, "slip_stiffness": 8e4, "tyre_slip_ratio": -0.02, "wheel_torque": -700.0}
    y = stand.step(h, **{f"{name}_{wheel}": x for name, x in told.items() for wheel in WHEELS})
    p = stand.unit.p
    expected = spin(
        before["wheel_speed_fl"], h, torque=-700.0, resistance=0.0, f_x=-2000.0, slip_stiffness=8e4,
        tyre_slip=-0.02, v=before["wheel_velocity_fl"], v_end=y["wheel_velocity_fl"], stiffness=0.0,
        radius=p.wheel_radius, inertia=p.wheel_inertia, v_low=p.low_speed,
    )  # fmt: skip
    assert y["wheel_speed_fl"] == pytest.approx(expected, rel=1e-9)

"""Allocators: forces that give the moment asked for, the driver's on top; shares, choices, limits of each."""

from __future__ import annotations

import random
from math import atan

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from yawbench.components.allocators.fixed_share import FixedShare
from yawbench.components.allocators.load_proportional import LoadProportional
from yawbench.components.allocators.releasing import release_and_brake
from yawbench.components.allocators.side_share import SideShare
from yawbench.components.allocators.single_wheel import FL, FR, RL, RR, SingleWheel
from yawbench.components.allocators.weighted_least_squares import WeightedLeastSquares
from yawbench.components.cars.wheel_kinematics import lever_arms
from yawbench.components.control_laws.side_forces import SIDE_FORCES
from yawbench.components.mathematics.bounded_least_squares import bounded

from .stand import Stand, four, wheel_values

A, HALF = 1.256, 0.825
LEVEL = (2800.0, 2800.0, 2600.0, 2600.0)
DEAD_ANGLE = atan(HALF / A)  # the front-left wheel has no arm there
SHARING = [
    *((LoadProportional, reading) for reading in ("all_wheels", *SIDE_FORCES)),
    (FixedShare, None),
    *((SideShare, reading) for reading in SIDE_FORCES),
]
"""Allocators that share the moment among wheels, and how sides are read."""


def forces(component, moment, *, delta=0.0, drive=0.0, loads=LEVEL, **parameters):
    """Return the requested forces [N] of fl, fr, rl, rr; other inputs stand among the parameters."""
    stand = Stand(component, **{name: x for name, x in parameters.items() if name not in INPUTS})
    inputs = {"yaw_moment": moment, "steer_angle": delta, "drive_force": drive} | four(
        "vertical_load", *loads
    )
    inputs |= {name: x for name, x in parameters.items() if name in INPUTS}
    y = stand.start(**{name: float(x) for name, x in inputs.items() if name in stand.reference})
    return np.array(wheel_values(y, "force_request"))


INPUTS = ("yaw_rate", "yaw_rate_ref", "friction")


def arms_of(component, delta):
    p = component.Parameters()
    return np.array(lever_arms(delta, p.cg_to_front_axle, 0.5 * p.track_width))


@pytest.mark.parametrize(("component", "reading"), SHARING)
def test_the_forces_give_the_moment_asked_for_at_every_steer_angle_whatever_the_shares(component, reading):
    rng = random.Random(3)
    declared = {v.name for v in component.variables}
    shares = {"left_share", "front_share_left", "front_share_right"} & declared
    for _ in range(100):
        given = {} if reading is None else {"side_forces": reading}
        given |= {name: rng.choice((0.0, 0.25, rng.random(), 1.0)) for name in sorted(shares)}
        moment, delta = rng.uniform(-1e4, 1e4), rng.uniform(-0.3, 0.3)
        loads = [rng.uniform(0.0, 6000.0) for _ in range(4)]
        found = forces(component, moment, delta=delta, loads=loads, **given)
        assert found @ arms_of(component, delta) == pytest.approx(moment, rel=1e-12)
        if component is LoadProportional and reading != "all_wheels":
            assert found[2] * loads[0] == pytest.approx(found[0] * loads[2], rel=1e-9, abs=1e-6)
            assert found[3] * loads[1] == pytest.approx(found[1] * loads[3], rel=1e-9, abs=1e-6)


def test_each_wheel_carries_the_part_of_the_moment_that_its_load_is_of_the_weight():
    loads = (1000.0, 4000.0, 2000.0, 3000.0)
    found = forces(LoadProportional, 1200.0, delta=0.1, loads=loads) * arms_of(LoadProportional, 0.1)
    assert found / 1200.0 == pytest.approx(np.divide(loads, sum(loads)), rel=1e-12)


@pytest.mark.parametrize("component", [LoadProportional, FixedShare])
def test_a_wheel_without_an_arm_is_left_out_without_a_jump_and_the_others_carry_the_moment(component):
    fl, *_ = forces(component, 1000.0, delta=DEAD_ANGLE)
    assert fl == pytest.approx(0.0, abs=1e-9)
    angles = np.linspace(DEAD_ANGLE - 0.3, DEAD_ANGLE + 0.3, 601).tolist()
    found = np.array([forces(component, 1000.0, delta=angle) for angle in angles])
    for row, angle in zip(found, angles, strict=True):
        assert row @ arms_of(component, angle) == pytest.approx(1000.0, rel=1e-12)
    assert np.abs(found).max() < 1000.0 / (0.25 * HALF)
    assert np.abs(np.diff(found, axis=0)).max() < 60.0


def test_a_lifted_wheel_gets_no_force_and_a_car_in_the_air_none_at_all():
    for lifted in (0.0, -100.0):
        found = forces(LoadProportional, 1000.0, loads=(lifted, 4000.0, lifted, 4000.0))
        assert found[0] == found[2] == 0.0
        assert found @ arms_of(LoadProportional, 0.0) == pytest.approx(1000.0, rel=1e-12)
    assert not forces(LoadProportional, 1000.0, loads=(0.0,) * 4, drive=500.0).any()
    side = forces(LoadProportional, 1000.0, loads=(0.0, 5e3, 0.0, 4e3), side_forces="one_side_braked")
    assert side == pytest.approx(np.array([-0.5, 0.0, -0.5, 0.0]) * 1000.0 / HALF)  # split in halves


def test_the_only_loaded_wheel_is_not_asked_for_more_than_it_can_turn_the_car_with():
    angles = np.linspace(DEAD_ANGLE - 0.3, DEAD_ANGLE + 0.3, 301).tolist()
    found = [forces(LoadProportional, 1000.0, delta=x, loads=(4000.0, 0.0, 0.0, 0.0))[0] for x in angles]
    assert max(map(abs, found)) < 5 * 1000.0 / (0.25 * HALF)
    assert forces(LoadProportional, 1000.0, delta=DEAD_ANGLE, loads=(4000.0, 0.0, 0.0, 0.0))[0] == (
        pytest.approx(0.0, abs=1e-9)
    )


@pytest.mark.parametrize(
    ("reading", "moment", "parts"),
    [
        ("opposite_halves", 2000.0, (-0.25, 0.75, -0.75, 0.25)),
        ("one_side_braked", 2000.0, (-0.5, 0.0, -1.5, 0.0)),
        ("one_side_braked", -2000.0, (0.0, -1.5, 0.0, -0.5)),
    ],
)
def test_straight_ahead_sides_have_the_moment_over_the_track_or_one_side_twice_that(reading, moment, parts):
    shares = {"front_share_left": 0.25, "front_share_right": 0.75}
    found = forces(SideShare, moment, side_forces=reading, **shares)
    assert found == pytest.approx(np.array(parts) * 2000.0 / SideShare.Parameters().track_width, rel=1e-12)


def test_opposite_halves_of_a_steered_car_neither_drive_nor_brake():
    shares = {"front_share_left": 0.3, "front_share_right": 0.8, "side_forces": "opposite_halves"}
    assert sum(forces(SideShare, 3000.0, delta=0.2, **shares)) == pytest.approx(0.0, abs=1e-9)


REAR_DRIVE = {"drive_front_share": 0.0, "brake_front_share": 0.6}


@pytest.mark.parametrize(
    ("component", "drive", "given", "front"),
    [
        (LoadProportional, -2000.0, {"loads": (1000.0, 2000.0, 500.0, 500.0)}, 0.75),
        (FixedShare, 1000.0, {"drive_front_share": 0.8}, 0.8),
        (FixedShare, 1000.0, REAR_DRIVE, 0.0),
        (FixedShare, -1000.0, REAR_DRIVE, 0.6),
        (SideShare, -800.0, {"drive_front_share": 0.25}, 0.25),
        (SingleWheel, 600.0, {"yaw_rate": -0.1}, 0.0),
    ],
)
def test_the_drivers_force_comes_on_top_equal_left_and_right(component, drive, given, front):
    """Its front part is that of the front wheels' loads, or as told."""
    bare, driven = (forces(component, 900.0, delta=0.05, drive=x, **given) for x in (0.0, drive))
    parts = 0.5 * np.array([front, front, 1.0 - front, 1.0 - front])
    assert driven - bare == pytest.approx(drive * parts, rel=1e-12, abs=1e-9)


# One wheel: the four rows of the rule, its guard, its dead band


def single(moment, delta, dr, **parameters):
    return forces(SingleWheel, moment, delta=delta, yaw_rate=dr, yaw_rate_ref=0.0, **parameters)


def test_straight_ahead_left_and_right_are_alike_but_as_printed():
    for choice in ("guarded", "moment"):
        braked = [single(-900.0 * side, 0.0, 0.1 * side, wheel_choice=choice) for side in (1.0, -1.0)]
        assert [[i for i, f in enumerate(found) if f] for found in braked] == [[FR], [FL]]
        assert braked[0][FR] == braked[1][FL] < 0.0
    assert single(-900.0, 0.0, 0.1, wheel_choice="printed")[RR] < 0.0
    assert single(900.0, 0.0, -0.1, wheel_choice="printed")[FL] < 0.0


@pytest.mark.parametrize(
    "moment, delta, dr, wheel",
    [(-900.0, 0.05, 0.1, FR), (900.0, 0.05, -0.1, RL), (-900.0, -0.05, 0.1, RR), (900.0, -0.05, -0.1, FL)],
)
def test_the_chosen_wheel_alone_gives_the_moment(moment, delta, dr, wheel):
    found = single(moment, delta, dr)
    assert [i for i, f in enumerate(found) if f] == [wheel]
    assert found[wheel] < 0.0
    assert found[wheel] * lever_arms(delta, 1.4, 0.8)[wheel] == pytest.approx(moment, rel=1e-12)


def test_a_wheel_that_turns_the_car_the_other_way_is_left_alone():
    case = 900.0, 0.05, 0.1
    assert not single(*case).any()
    assert single(*case, wheel_choice="printed")[FR] < 0.0  # and turns the car against the moment
    assert single(*case, wheel_choice="moment")[RL] < 0.0


def test_braking_has_a_dead_band_with_hysteresis():
    stand = Stand(SingleWheel)
    rest = {"steer_angle": 0.05, "yaw_rate": -0.1, "yaw_rate_ref": 0.0}
    stand.start(yaw_moment=0.0, **rest)
    found = [stand.step(0.01, yaw_moment=m, **rest)["force_request_rl"] for m in (190, 210, 110, 90, 190)]
    assert [f != 0.0 for f in found] == [False, True, True, False, False]


# Weighted least squares: against scipy's bounded least squares, and what tyres can give

GRIP = np.array([3000.0, 6500.0, 2500.0, 5500.0])


def weighted(moment, **given):
    return forces(WeightedLeastSquares, moment, loads=GRIP.tolist(), **{"friction": 0.9} | given)


def test_the_solution_is_that_of_scipys_bounded_least_squares():
    rng = np.random.default_rng(0)
    for _ in range(200):
        w, d = rng.uniform(0.5, 2.0, 4), rng.normal(size=4)
        b, v, c = rng.normal(size=(2, 4)), rng.uniform(1.0, 300.0, 2), 3.0 * rng.normal(size=2)
        low = rng.normal(size=4) - 0.5
        high = low + rng.uniform(0.0, 2.0, 4) + 1e-6
        a = np.vstack([np.diag(np.sqrt(w)), np.sqrt(v)[:, None] * b])
        y = np.concatenate([np.sqrt(w) * d, np.sqrt(v) * c])
        exact = lsq_linear(a, y, (low, high), method="bvls", tol=1e-14).x
        assert bounded(w, d, b.tolist(), v, c, low, high) == pytest.approx(exact, abs=1e-7)


@pytest.mark.parametrize(("moment", "delta"), [(800.0, 0.0), (-3000.0, 0.1), (-3000.0, -0.2)])
def test_a_moment_that_the_tyres_can_give_is_given_by_braking_alone(moment, delta):
    x = weighted(moment, delta=delta)
    assert x @ arms_of(WeightedLeastSquares, delta) == pytest.approx(moment, rel=0.02)
    assert max(x) <= 0.0
    assert all(x >= -0.9 * GRIP - 1e-9)


def test_more_than_the_tyres_can_give_is_all_of_the_grip_on_the_side_that_turns():
    assert weighted(-50000.0) == pytest.approx(-0.9 * GRIP * [0, 1, 0, 1])


def test_wheels_share_a_small_moment_by_the_squares_of_their_loads():
    x = weighted(-1000.0)
    assert x[1] / x[3] == pytest.approx((6500.0 / 5500.0) ** 2, rel=1e-6)
    assert x[0] == x[2] == 0.0


def test_motors_turn_a_car_without_slowing_it():
    x = weighted(2000.0, motors=True, force_weight=1e4)
    assert sum(x) == pytest.approx(0.0, abs=60.0)
    assert min(x) < 0.0 < max(x)


def test_the_drivers_force_stays_and_the_moment_is_added_to_it():
    x, alone = (weighted(moment, drive=-4000.0, drive_front_share=0.6) for moment in (1500.0, 0.0))
    assert alone == pytest.approx([-1200.0, -1200.0, -800.0, -800.0])
    assert (x - alone) @ arms_of(WeightedLeastSquares, 0.0) == pytest.approx(1500.0, rel=0.02)


# Release of the driver's brakes

CAR = {"a": 1.4, "half_track": 0.8}


def shared(moment, drive, *, delta=0.0, front_share=0.67, limit=0.8):
    return release_and_brake(moment, drive, delta=delta, front_share=front_share, limit=limit, **CAR)


def test_a_moment_within_reach_is_made_by_release_alone():
    kept, made = shared(0.0, -10000.0), shared(3000.0, -10000.0)  # to the left: the right side brakes less
    assert kept == pytest.approx((-3350.0, -3350.0, -1650.0, -1650.0))
    assert made[0::2] == kept[0::2]
    assert made[1::2] == pytest.approx([0.25 * f for f in kept[1::2]])
    assert shared(-3000.0, -10000.0)[1::2] == kept[1::2]


def test_what_release_may_not_give_the_other_side_brakes():
    made = shared(3000.0, -10000.0, limit=0.5)
    assert made[1::2] == pytest.approx((0.5 * -3350.0, 0.5 * -1650.0))
    assert made[0] < -3350.0
    assert made[2] < -1650.0


def test_a_car_that_its_driver_does_not_brake_is_braked_on_one_side():
    for drive in (0.0, 2000.0):
        pedal, made = shared(0.0, drive), shared(-1200.0, drive)
        assert made[0::2] == pedal[0::2]
        assert np.subtract(made, pedal)[1::2] == pytest.approx([-1005.0, -495.0])


def test_the_moment_asked_for_comes_on_top_of_what_the_pedal_gives_whatever_is_steered():
    rng = random.Random(3)
    for _ in range(200):
        delta, moment = rng.uniform(-0.15, 0.15), rng.uniform(-6000.0, 6000.0)
        drive, limit = rng.uniform(-16000.0, 0.0), rng.uniform(0.0, 1.0)
        made, pedal = (np.array(shared(m, drive, delta=delta, limit=limit)) for m in (moment, 0.0))
        assert (made - pedal) @ lever_arms(delta, **CAR) == pytest.approx(moment, abs=1e-8)
        assert max(made) <= 0.0
        assert all(made - pedal <= -limit * pedal + 1e-9)

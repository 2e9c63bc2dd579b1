"""Properties of both moment allocators."""

from __future__ import annotations

from math import atan

import numpy as np
import pytest

from yawbench.components.allocators.fixed_share import FixedShare
from yawbench.components.allocators.load_proportional import LoadProportional
from yawbench.components.cars.wheel_kinematics import lever_arms
from yawbench.vocabulary.wheels import WHEELS

from .stand import Stand

A, HALF = 1.256, 0.825
LEVEL = (2800.0, 2800.0, 2600.0, 2600.0)
DEAD_ANGLE = atan(HALF / A)  # the front-left wheel has no arm there


def forces(component, moment, *, delta=0.0, drive=0.0, loads=LEVEL, **parameters):
    inputs = {"yaw_moment": moment, "steer_angle": delta, "drive_force": drive}
    if component is LoadProportional:
        inputs |= {f"vertical_load_{w}": float(x) for w, x in zip(WHEELS, loads, strict=True)}
    return list(Stand(component, **parameters).start(**inputs).values())


def moment_of(found, delta):
    return sum(f * arm for f, arm in zip(found, lever_arms(delta, A, HALF), strict=True))


def cases(n, seed):
    random = np.random.default_rng(seed)
    return zip(
        random.uniform(-5000, 5000, n).tolist(),
        random.uniform(-0.5, 0.5, n).tolist(),
        random.uniform(0, 6000, (n, 4)).tolist(),
        random.uniform(0, 1, (n, 3)).tolist(),
        strict=True,
    )


def test_forces_in_proportion_to_load_give_the_moment_asked_for():
    for moment, delta, loads, _ in cases(300, 1):
        found = forces(LoadProportional, moment, delta=delta, loads=loads)
        assert moment_of(found, delta) == pytest.approx(moment, rel=1e-12)


def test_forces_in_fixed_shares_give_the_moment_asked_for():
    for moment, delta, _, (left, n_l, n_r) in cases(300, 2):
        shares = {"left_share": left, "front_share_left": n_l, "front_share_right": n_r}
        found = forces(FixedShare, moment, delta=delta, **shares)
        assert moment_of(found, delta) == pytest.approx(moment, rel=1e-12)


def test_each_wheel_carries_the_part_of_the_moment_that_its_load_is_of_the_weight():
    loads = (1000.0, 4000.0, 2000.0, 3000.0)
    found = forces(LoadProportional, 1200.0, delta=0.1, loads=loads)
    parts = [f * arm / 1200.0 for f, arm in zip(found, lever_arms(0.1, A, HALF), strict=True)]
    assert parts == pytest.approx([0.1, 0.4, 0.2, 0.3], rel=1e-12)


@pytest.mark.parametrize("component", [LoadProportional, FixedShare])
def test_a_wheel_without_an_arm_is_left_out_without_a_jump_and_the_others_carry_the_moment(component):
    fl, *_ = forces(component, 1000.0, delta=DEAD_ANGLE)
    assert fl == pytest.approx(0.0, abs=1e-9)
    angles = np.linspace(DEAD_ANGLE - 0.3, DEAD_ANGLE + 0.3, 1201).tolist()
    found = np.array([forces(component, 1000.0, delta=angle) for angle in angles])
    for row, angle in zip(found, angles, strict=True):
        assert moment_of(row, angle) == pytest.approx(1000.0, rel=1e-12)
    assert np.abs(found).max() < 1000.0 / (0.25 * HALF)
    assert np.abs(np.diff(found, axis=0)).max() < 30.0


def test_a_lifted_wheel_gets_no_force():
    for lifted in (0.0, -100.0):
        found = forces(LoadProportional, 1000.0, loads=(lifted, 4000.0, lifted, 4000.0))
        assert found[0] == found[2] == 0.0
        assert moment_of(found, 0.0) == pytest.approx(1000.0, rel=1e-12)


def test_a_car_in_the_air_gets_no_force():
    assert forces(LoadProportional, 1000.0, loads=(0.0,) * 4, drive=500.0) == [0.0] * 4


def test_the_only_loaded_wheel_is_not_asked_for_more_than_it_can_turn_the_car_with():
    angles = np.linspace(DEAD_ANGLE - 0.3, DEAD_ANGLE + 0.3, 301).tolist()
    found = [forces(LoadProportional, 1000.0, delta=x, loads=(4000.0, 0.0, 0.0, 0.0))[0] for x in angles]
    assert max(map(abs, found)) < 5 * 1000.0 / (0.25 * HALF)
    assert forces(LoadProportional, 1000.0, delta=DEAD_ANGLE, loads=(4000.0, 0.0, 0.0, 0.0))[0] == (
        pytest.approx(0.0, abs=1e-9)
    )


def test_the_drive_force_is_added_in_full_and_equal_on_both_sides():
    for component in (LoadProportional, FixedShare):
        without = forces(component, 700.0, delta=0.05)
        extra = [
            b - a for a, b in zip(without, forces(component, 700.0, delta=0.05, drive=-2000.0), strict=True)
        ]
        assert sum(extra) == pytest.approx(-2000.0, rel=1e-12)
        assert extra[0] == pytest.approx(extra[1]) and extra[2] == pytest.approx(extra[3])


def test_the_drive_force_is_shared_between_the_axles_like_their_loads_or_as_told():
    fl, fr, rl, rr = forces(LoadProportional, 0.0, drive=1000.0, loads=(1000.0, 2000.0, 500.0, 500.0))
    assert (fl, fr, rl, rr) == pytest.approx((375.0, 375.0, 125.0, 125.0))
    found = forces(FixedShare, 0.0, drive=1000.0, drive_front_share=0.8)
    assert found == pytest.approx([400.0, 400.0, 100.0, 100.0])
    rear_drive = {"drive_front_share": 0.0, "brake_front_share": 0.6}
    found = forces(FixedShare, 0.0, drive=1000.0, **rear_drive)
    assert found == pytest.approx([0.0, 0.0, 500.0, 500.0])
    found = forces(FixedShare, 0.0, drive=-1000.0, **rear_drive)
    assert found == pytest.approx([-300.0, -300.0, -200.0, -200.0])

"""Checks of the allocator that releases the driver's brakes."""

from __future__ import annotations

import random

import pytest

from yawbench.components.allocators.releasing import release_and_brake
from yawbench.components.cars.wheel_kinematics import lever_arms

CAR = {"a": 1.4, "half_track": 0.8}


def shared(moment, drive, *, delta=0.0, front_share=0.67, limit=0.8):
    return release_and_brake(moment, drive, delta=delta, front_share=front_share, limit=limit, **CAR)


def turning(forces, delta):
    return sum(f * arm for f, arm in zip(forces, lever_arms(delta, **CAR), strict=True))


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
    assert turning(made, 0.0) == pytest.approx(3000.0)


def test_a_car_that_its_driver_does_not_brake_is_braked_on_one_side():
    for drive in (0.0, 2000.0):
        pedal, made = shared(0.0, drive), shared(-1200.0, drive)
        assert made[0::2] == pedal[0::2]
        assert [m - p for m, p in zip(made, pedal, strict=True)][1::2] == pytest.approx([-1005.0, -495.0])


def test_the_moment_asked_for_comes_on_top_of_what_the_pedal_gives_whatever_is_steered():
    rng = random.Random(3)
    for _ in range(200):
        delta, moment = rng.uniform(-0.15, 0.15), rng.uniform(-6000.0, 6000.0)
        drive, limit = rng.uniform(-16000.0, 0.0), rng.uniform(0.0, 1.0)
        made = shared(moment, drive, delta=delta, limit=limit)
        pedal = shared(0.0, drive, delta=delta)
        assert turning(made, delta) - turning(pedal, delta) == pytest.approx(moment, abs=1e-8)
        assert max(made) <= 0.0
        assert all(m - p <= -limit * p + 1e-9 for m, p in zip(made, pedal, strict=True))

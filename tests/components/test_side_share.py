"""Side forces: their moment is the one asked for, in both readings, with fixed shares and by load."""

from __future__ import annotations

import random

import pytest

from yawbench.components.allocators.load_proportional import LoadProportional
from yawbench.components.allocators.side_share import SideShare
from yawbench.components.cars.wheel_kinematics import lever_arms
from yawbench.components.control_laws.side_forces import SIDE_FORCES

from .stand import Stand, four, wheel_values

D = 1.48
GEOMETRY = {"cg_to_front_axle": 1.04, "track_width": D}


def forces(stand: Stand, **inputs: float) -> list[float]:
    y = stand.step(0.005, **inputs)
    return wheel_values(y, "force_request")


def moment_of(f: list[float], delta: float) -> float:
    return sum(x * arm for x, arm in zip(f, lever_arms(delta, 1.04, 0.5 * D), strict=True))


@pytest.mark.parametrize("reading", SIDE_FORCES)
def test_the_forces_give_the_moment_asked_for_at_every_steer_angle(reading):
    rng = random.Random(3)
    for _ in range(200):
        stand = Stand(
            SideShare,
            front_share_left=rng.choice((0.0, 0.25, 0.5, rng.random(), 1.0)),
            front_share_right=rng.choice((0.0, 0.25, 0.5, rng.random(), 1.0)),
            side_forces=reading,
        )
        moment, delta = rng.uniform(-1e4, 1e4), rng.uniform(-0.3, 0.3)
        stand.start()
        f = forces(stand, yaw_moment=moment, steer_angle=delta)
        assert moment_of(f, delta) == pytest.approx(moment, rel=1e-12)


@pytest.mark.parametrize("reading", SIDE_FORCES)
def test_sharing_by_load_gives_the_moment_asked_for_at_every_steer_angle(reading):
    rng = random.Random(4)
    stand = Stand(LoadProportional, side_forces=reading, **GEOMETRY)
    stand.start()
    for _ in range(200):
        moment, delta = rng.uniform(-1e4, 1e4), rng.uniform(-0.3, 0.3)
        carried = [rng.uniform(0.0, 6000.0) for _ in range(4)]
        f = forces(stand, yaw_moment=moment, steer_angle=delta, **four("vertical_load", *carried))
        assert moment_of(f, delta) == pytest.approx(moment, rel=1e-12)
        for front, rear in ((0, 2), (1, 3)):
            ratio = carried[rear] / carried[front]
            assert f[rear] == pytest.approx(f[front] * ratio, rel=1e-9, abs=1e-9)


def test_opposite_halves_straight_ahead_are_the_moment_over_the_track():
    stand = Stand(SideShare, side_forces="opposite_halves", front_share_left=0.25, front_share_right=0.75)
    stand.start()
    side = 2000.0 / D
    assert forces(stand, yaw_moment=2000.0) == pytest.approx(
        [-0.25 * side, 0.75 * side, -0.75 * side, 0.25 * side], rel=1e-12
    )


@pytest.mark.parametrize(
    "moment, braked", [(2000.0, (-0.25, 0.0, -0.75, 0.0)), (-2000.0, (0.0, -0.25, 0.0, -0.75))]
)
def test_one_side_is_braked_with_twice_the_moment_over_the_track(moment, braked):
    stand = Stand(SideShare, front_share_left=0.25, front_share_right=0.25)
    stand.start()
    f = [wheel * D / 4000.0 for wheel in forces(stand, yaw_moment=moment)]
    assert f == pytest.approx(braked, rel=1e-12)


def test_opposite_halves_of_a_steered_car_neither_drive_nor_brake():
    stand = Stand(SideShare, side_forces="opposite_halves", front_share_left=0.3, front_share_right=0.8)
    stand.start()
    assert sum(forces(stand, yaw_moment=3000.0, steer_angle=0.2)) == pytest.approx(0.0, abs=1e-9)


def test_the_drivers_force_comes_on_top_equal_left_and_right():
    stand = Stand(SideShare, drive_front_share=0.25)
    stand.start()
    bare = forces(stand, yaw_moment=1500.0, steer_angle=0.05)
    driven = forces(stand, yaw_moment=1500.0, steer_angle=0.05, drive_force=-800.0)
    added = [d - b for d, b in zip(driven, bare, strict=True)]
    assert added == pytest.approx([-100.0, -100.0, -300.0, -300.0], rel=1e-12)


def test_a_side_in_the_air_is_split_in_halves():
    stand = Stand(LoadProportional, side_forces="one_side_braked", **GEOMETRY)
    stand.start()
    f = forces(stand, yaw_moment=1000.0, **four("vertical_load", 0.0, 5000.0, 0.0, 4000.0))
    assert f == pytest.approx([-1000.0 / D, 0.0, -1000.0 / D, 0.0], rel=1e-12)

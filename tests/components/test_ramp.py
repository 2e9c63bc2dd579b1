"""Steering through a ratio, and holding the speed."""

from __future__ import annotations

import pytest

from yawbench.components.drivers.ramp import Ramp
from yawbench.components.drivers.sine import Sine

from .stand import Stand


@pytest.mark.parametrize("t, hand", [(0.5, 0.0), (1.0, 0.0), (2.0, 0.75), (3.0, 1.5), (9.0, 1.5)])
def test_the_ramp_rises_in_a_straight_line_and_stays(t, hand):
    stand = Stand(Ramp)
    stand.start(velocity_x=25.0)
    found = stand.step(t, velocity_x=25.0)
    assert found["steering_wheel_angle"] == pytest.approx(hand, abs=1e-15)
    assert found["steer_angle"] == found["steering_wheel_angle"] / 17.0


def test_a_ramp_without_duration_is_a_step():
    stand = Stand(Ramp, ramp_time=0.0, start_time=0.0)
    stand.start(velocity_x=25.0)
    assert stand.step(1e-6, velocity_x=25.0)["steering_wheel_angle"] == 1.5


def test_the_sine_of_the_hand_wheel_goes_through_the_steering_ratio():
    stand = Stand(Sine, amplitude=1.5, steering_ratio=15.0, frequency=0.2, start_time=0.0)
    stand.start()
    found = stand.step(1.25)
    assert found["steering_wheel_angle"] == pytest.approx(1.5)
    assert found["steer_angle"] == pytest.approx(0.1)


def test_the_sine_drives_with_its_constant_force_alone_unless_told_to_hold_the_speed():
    stand = Stand(Sine, constant_drive_force=300.0)
    stand.start(velocity_x=10.0)
    assert stand.step(1.0, velocity_x=10.0)["drive_force"] == 300.0


def hold(seconds, *, mass=1830.0, resistance=400.0, start=24.0):
    """Return speed [m/s] and force [N] of a point mass driven by the ramp's driver."""
    stand = Stand(Ramp, target_speed=25.0)
    v, h = start, 0.005
    force = stand.start(velocity_x=v)["drive_force"]
    for _ in range(round(seconds / h)):
        v += h * (force - resistance) / mass
        force = stand.step(h, velocity_x=v)["drive_force"]
        assert 0.0 <= force <= 3000.0
    return v, force


def test_the_held_speed_is_reached_and_the_force_balances_the_resistance():
    v, force = hold(30.0)
    assert v == pytest.approx(25.0, abs=1e-3)
    assert force == pytest.approx(400.0, abs=1.0)


def test_a_driver_who_is_too_fast_lets_go():
    assert hold(2.0, start=30.0)[1] == 0.0

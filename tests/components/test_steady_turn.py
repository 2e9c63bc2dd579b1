"""The driver who holds a circle, then the hand wheel."""

from __future__ import annotations

from math import exp

import pytest

from yawbench.components.drivers.steady_turn import SteadyTurn

from .stand import Stand


def drive(seconds, *, share=1.0, v=20.0, h=0.005, **parameters):
    """Return the last outputs and curvature [1/m] of a car with `share` of the linear car's yaw gain."""
    stand = Stand(SteadyTurn, target_speed=v, **parameters)
    found = stand.start(velocity_x=v)
    r = 0.0
    for _ in range(round(seconds / h)):
        gain, _ = stand.unit.car.gains(v)
        r += (share * gain * found["steer_angle"] - r) * h / 0.15
        found = stand.step(h, velocity_x=v, yaw_rate=r)
    return found, r / v


@pytest.mark.parametrize("share", [0.7, 1.0, 1.2])
@pytest.mark.parametrize("radius", [80.0, -120.0])
def test_the_circle_is_found_whatever_the_car_gives_of_the_linear_yaw_rate(share, radius):
    found, curvature = drive(9.0, share=share, radius=radius)
    assert curvature == pytest.approx(1.0 / radius, rel=0.002)
    assert found["steering_wheel_angle"] == pytest.approx(17.0 * found["steer_angle"])


def test_from_the_action_on_the_wheel_is_held_and_the_pedals_change_at_any_step_size():
    def at(t, h):
        return drive(t, share=0.8, h=h, action_time=6.003, deceleration=5.0, constant_drive_force=400.0)[0]

    held = at(6.01, 0.005)["steer_angle"]
    assert at(8.0, 0.005)["steer_angle"] == held
    force = at(6.5, 0.005)["drive_force"]
    # the constant part fades with the lag of 0.2 s, the brake is pressed
    assert force == pytest.approx(400.0 * exp(-(6.5 - 6.003) / 0.2) - 1830.0 * 5.0, rel=1e-9)
    assert at(6.5, 0.1)["drive_force"] == pytest.approx(force, rel=1e-9)
    assert drive(8.0, action_time=6.0)[0]["drive_force"] == pytest.approx(0.0, abs=1e-9)  # lift-off

"""Drivers whose steering and pedals are functions of time or hold a speed and a circle."""

from __future__ import annotations

from math import exp, pi, sin

import pytest

from yawbench.components.drivers.force_pulse import ForcePulse, ForcePulseParameters, held_steer, pulse_force
from yawbench.components.drivers.ramp import Ramp
from yawbench.components.drivers.sine import Sine, SineParameters, sine_steer
from yawbench.components.drivers.sine_sweep import SineSweepParameters, sweep
from yawbench.components.drivers.sine_with_dwell import (
    SineWithDwell,
    SineWithDwellParameters,
    sine_with_dwell,
)
from yawbench.components.drivers.steady_turn import SteadyTurn

from .stand import Stand

SINE = SineParameters(amplitude=0.04, frequency=0.5, start_time=1.0, periods=2.0)


def test_the_wheel_is_straight_before_and_after():
    assert [sine_steer(t, SINE) for t in (-1.0, 0.0, 1.0, 5.0, 5.001, 100.0)] == [0.0] * 6


def test_inside_it_is_the_sine():
    for t in (1.001, 1.5, 2.2, 3.0, 4.999):
        assert sine_steer(t, SINE) == pytest.approx(0.04 * sin(pi * (t - 1.0)), abs=1e-16)


DWELL = SineWithDwellParameters(amplitude=2.0, start_time=1.0)


@pytest.mark.parametrize(
    "after, hand",
    [
        (-0.1, 0.0),
        (0.25 / 0.7, 2.0),
        (0.5 / 0.7, 0.0),
        (0.75 / 0.7, -2.0),
        (0.75 / 0.7 + 0.3, -2.0),
        (0.75 / 0.7 + 0.5, -2.0),
        (0.875 / 0.7 + 0.5, -2.0 * sin(pi / 4)),
        (1.0 / 0.7 + 0.5, 0.0),
        (9.0, 0.0),
    ],
)
def test_the_sine_with_dwell_pauses_at_its_second_peak(after, hand):
    assert sine_with_dwell(1.0 + after, DWELL) == pytest.approx(hand, abs=1e-12)


def test_the_accelerator_is_let_go_before_the_steering_at_any_step_size():
    """The constant part of the force goes with the rest, through the lag of 0.2 s."""

    def force(h: float) -> float:
        stand = Stand(SineWithDwell, constant_drive_force=400.0, start_time=1.6, target_speed=20.0)
        stand.start(velocity_x=20.0)
        for _ in range(round(0.8 / h)):
            found = stand.step(h, velocity_x=20.0)["drive_force"]
        return found

    assert force(0.01) == pytest.approx(400.0 * exp(-0.3 / 0.2), rel=1e-9)
    assert force(0.4) == pytest.approx(force(0.01), rel=1e-9)  # let go within a step


def test_the_sweep_rises_in_frequency_and_ends():
    p = SineSweepParameters(
        amplitude=1.0, first_frequency=0.5, last_frequency=2.5, duration=4.0, start_time=1.0
    )
    assert [sweep(t, p) for t in (0.0, 1.0, 5.0, 9.0)] == [0.0] * 4
    for s in (0.3, 1.0, 3.7):  # turns are the integral of the frequency: 0.5 s + s^2 / 4
        assert sweep(1.0 + s, p) == pytest.approx(sin(2 * pi * (0.5 * s + 0.25 * s * s)), abs=1e-12)


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


PULSE = ForcePulseParameters(
    force=-6000.0, start_time=0.5, duration=1.5, final_steer_angle=0.03, steer_start_time=1.0, steer_time=0.2
)


def test_the_force_is_there_from_the_start_time_for_the_duration():
    assert [pulse_force(t, PULSE) for t in (-1.0, 0.0, 0.499999)] == [0.0, 0.0, 0.0]
    assert [pulse_force(t, PULSE) for t in (0.5, 1.0, 1.999999)] == [-6000.0, -6000.0, -6000.0]
    assert [pulse_force(t, PULSE) for t in (2.0, 9.0)] == [0.0, 0.0]


def test_the_wheel_is_turned_at_a_steady_rate_and_held():
    assert [held_steer(t, PULSE) for t in (0.0, 1.0, 1.05, 1.2, 7.0)] == pytest.approx(
        [0.0, 0.0, 0.0075, 0.03, 0.03], abs=1e-15
    )


def test_a_steer_time_of_zero_is_a_step():
    p = ForcePulseParameters(final_steer_angle=0.03, steer_start_time=1.0, steer_time=0.0)
    assert [held_steer(t, p) for t in (0.999, 1.0, 1.001)] == [0.0, 0.0, 0.03]


def test_the_unit_gives_both_at_every_instant_however_it_got_there():
    one, many = Stand(ForcePulse, final_steer_angle=0.03), Stand(ForcePulse, final_steer_angle=0.03)
    assert one.start() == many.start() == {"steer_angle": 0.0, "drive_force": 0.0}
    for _ in range(5):
        last = many.step(0.125)
    assert one.step(0.625) == last == {"steer_angle": 0.03, "drive_force": -6000.0}


def circle(seconds, *, share=1.0, v=20.0, h=0.005, **parameters):
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
    found, curvature = circle(9.0, share=share, radius=radius)
    assert curvature == pytest.approx(1.0 / radius, rel=0.002)
    assert found["steering_wheel_angle"] == pytest.approx(17.0 * found["steer_angle"])


def test_from_the_action_on_the_wheel_is_held_and_the_pedals_change_at_any_step_size():
    def at(t, h):
        return circle(t, share=0.8, h=h, action_time=6.003, deceleration=5.0, constant_drive_force=400.0)[0]

    held = at(6.01, 0.005)["steer_angle"]
    assert at(8.0, 0.005)["steer_angle"] == held
    force = at(6.5, 0.005)["drive_force"]
    # the constant part fades with the lag of 0.2 s, the brake is pressed
    assert force == pytest.approx(400.0 * exp(-(6.5 - 6.003) / 0.2) - 1830.0 * 5.0, rel=1e-9)
    assert at(6.5, 0.1)["drive_force"] == pytest.approx(force, rel=1e-9)
    assert circle(8.0, action_time=6.0)[0]["drive_force"] == pytest.approx(0.0, abs=1e-9)  # lift-off

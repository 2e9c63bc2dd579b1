"""The steering sine."""

from __future__ import annotations

from math import pi, sin

import pytest

from components.drivers.sine import Sine, SineParameters, sine_steer

from .stand import Stand

P = SineParameters(amplitude=0.04, frequency=0.5, start_time=1.0, periods=2.0)


def test_the_wheel_is_straight_before_and_after():
    assert [sine_steer(t, P) for t in (-1.0, 0.0, 1.0, 5.0, 5.001, 100.0)] == [0.0] * 6


def test_inside_it_is_the_sine():
    for t in (1.001, 1.5, 2.2, 3.0, 4.999):
        assert sine_steer(t, P) == pytest.approx(0.04 * sin(pi * (t - 1.0)), abs=1e-16)


def test_the_first_quarter_is_to_the_left_with_the_full_amplitude():
    assert sine_steer(1.5, P) == pytest.approx(0.04, rel=1e-15)


def test_mean_steer_angle_over_whole_periods_is_zero():
    n = 4000
    assert abs(sum(sine_steer(1.0 + 4.0 * k / n, P) for k in range(n))) / n < 1e-16


def test_the_value_does_not_depend_on_how_time_was_reached():
    one, many = Stand(Sine, frequency=0.5), Stand(Sine, frequency=0.5)
    one.start()
    many.start()
    for _ in range(16):
        last = many.step(0.09375)
    assert one.step(1.5) == last


def test_the_drive_force_is_constant():
    stand = Stand(Sine, constant_drive_force=-300.0)
    assert stand.start()["drive_force"] == -300.0
    assert stand.step(1.25)["drive_force"] == -300.0

"""The steering sine, also with dwell."""

from __future__ import annotations

from math import exp, pi, sin

import pytest

from yawbench.components.drivers.sine import SineParameters, sine_steer
from yawbench.components.drivers.sine_sweep import SineSweepParameters, sweep
from yawbench.components.drivers.sine_with_dwell import (
    SineWithDwell,
    SineWithDwellParameters,
    sine_with_dwell,
)

from .stand import Stand

P = SineParameters(amplitude=0.04, frequency=0.5, start_time=1.0, periods=2.0)


def test_the_wheel_is_straight_before_and_after():
    assert [sine_steer(t, P) for t in (-1.0, 0.0, 1.0, 5.0, 5.001, 100.0)] == [0.0] * 6


def test_inside_it_is_the_sine():
    for t in (1.001, 1.5, 2.2, 3.0, 4.999):
        assert sine_steer(t, P) == pytest.approx(0.04 * sin(pi * (t - 1.0)), abs=1e-16)


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

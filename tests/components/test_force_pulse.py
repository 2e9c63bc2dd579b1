"""The driver who brakes or drives hard for a while."""

from __future__ import annotations

import pytest

from yawbench.components.drivers.force_pulse import ForcePulse, ForcePulseParameters, held_steer, pulse_force

from .stand import Stand

P = ForcePulseParameters(
    force=-6000.0, start_time=0.5, duration=1.5, final_steer_angle=0.03, steer_start_time=1.0, steer_time=0.2
)


def test_the_force_is_there_from_the_start_time_for_the_duration():
    assert [pulse_force(t, P) for t in (-1.0, 0.0, 0.499999)] == [0.0, 0.0, 0.0]
    assert [pulse_force(t, P) for t in (0.5, 1.0, 1.999999)] == [-6000.0, -6000.0, -6000.0]
    assert [pulse_force(t, P) for t in (2.0, 9.0)] == [0.0, 0.0]


def test_the_wheel_is_turned_at_a_steady_rate_and_held():
    assert [held_steer(t, P) for t in (0.0, 1.0, 1.05, 1.2, 7.0)] == pytest.approx(
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

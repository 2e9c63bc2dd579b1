"""Superposition steering: the driver's angle passes untouched, the added one lags within rate and range."""

from __future__ import annotations

from math import exp

import pytest

from yawbench.components.steering_actuators.superposition import Superposition

from .stand import Stand


@pytest.mark.parametrize("h", [1e-3, 5e-3])
def test_the_added_angle_is_a_delayed_exponential(h):
    stand = Stand(Superposition, rate_limit=100.0, delay=0.0033)
    stand.start()
    for k in range(40):
        y = stand.step(h, steer_angle=0.1, added_steer_angle_request=0.02)
        late = max((k + 1) * h - 0.0033, 0.0)
        assert y["added_steer_angle"] == pytest.approx(0.02 * (1.0 - exp(-late / 0.016)), abs=1e-12)
        assert y["total_steer_angle"] == 0.1 + y["added_steer_angle"]


def test_without_a_request_the_total_is_the_drivers_angle_to_the_last_bit():
    stand = Stand(Superposition)
    stand.start(steer_angle=0.123)
    for k in range(20):
        assert stand.step(1e-3, steer_angle=0.01 * k / 7.0)["total_steer_angle"] == 0.01 * k / 7.0


def test_rate_and_range_hold():
    stand = Stand(Superposition, rate_limit=0.5, range=0.05)
    stand.start()
    before = 0.0
    for _ in range(200):
        added = stand.step(1e-3, added_steer_angle_request=1.0)["added_steer_angle"]
        assert added - before <= 0.5e-3 * (1.0 + 1e-9)
        before = added
    assert before == pytest.approx(0.05, abs=1e-5)

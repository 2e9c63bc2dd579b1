"""PID control in samples: closed forms, the limit, and the controllers of papers C and D."""

from __future__ import annotations

import math

import pytest

from yawbench.components.controllers.fuzzy_feedback import FuzzyFeedback
from yawbench.components.controllers.fuzzy_pid import FuzzyPid, FuzzyPidParameters, GainSchedule
from yawbench.components.controllers.pid import PidController
from yawbench.components.mathematics.pid_loop import Gains, Pid

from .stand import Stand

H = 0.01
REST = {
    "yaw_rate_ref": 0.0, "yaw_rate": 0.0, "sideslip_ref": 0.0, "sideslip": 0.0, "velocity_x": 25.0,
}  # fmt: skip


def test_the_integral_of_a_ramp_is_exact():
    loop, gains = Pid(), Gains(0.0, 3.0, 0.0)
    for k in range(1, 101):
        loop.see(0.2 * k * H, H)
        loop.integrate(gains, loop.value(gains), -math.inf, math.inf)
    assert loop.integral == pytest.approx(3.0 * 0.5 * 0.2, rel=1e-12)


def test_the_filtered_derivative_of_a_ramp_settles_like_a_lag():
    loop = Pid(tau=0.05)
    for k in range(1, 6):
        loop.see(2.0 * k * H, H)
    assert loop.slope == pytest.approx(2.0 * (1.0 - math.exp(-5 * H / 0.05)), rel=1e-12)


def test_without_a_filter_the_derivative_is_the_backward_difference():
    loop = Pid()
    loop.see(0.3, H)
    assert loop.slope == pytest.approx(30.0)


def test_the_integral_stops_at_the_limit_and_leaves_it_at_once():
    loop, gains = Pid(), Gains(0.0, 100.0, 0.0)
    for _ in range(500):
        loop.see(1.0, H)
        total = loop.value(gains)
        loop.integrate(gains, total, -5.0, 5.0)
    assert loop.integral == pytest.approx(5.0)
    loop.see(-1.0, H)
    loop.see(-1.0, H)
    loop.integrate(gains, loop.value(gains), -5.0, 5.0)
    assert loop.integral == pytest.approx(4.0)


def moment(component, **inputs):
    stand = Stand(component)
    stand.start(**REST)
    return stand.step(H, **{**REST, **inputs})["yaw_moment"]


@pytest.mark.parametrize("component", [PidController, FuzzyPid])
def test_too_little_yaw_rate_asks_for_a_positive_moment_and_too_little_sideslip_for_a_negative(component):
    assert moment(component, yaw_rate_ref=0.01) > 50.0
    assert moment(component, sideslip_ref=0.01) < -25.0


def schedule(reading="mirrored", derivative=100.0):
    p = FuzzyPidParameters(
        table_reading=reading,
        yaw_rate_error_range=0.05,
        yaw_rate_error_rate_range=1.0,
        yaw_rate_proportional_gain=8e3,
        yaw_rate_integral_gain=0.0,
        yaw_rate_derivative_gain=derivative,
        yaw_rate_proportional_range=3e4,
        yaw_rate_integral_range=0.0,
        yaw_rate_derivative_range=100.0,
    )
    return GainSchedule(p, "yaw_rate")


def test_the_printed_table_treats_left_and_right_differently():
    schedules = {reading: schedule(reading) for reading in ("mirrored", "printed")}
    mirrored = schedules["mirrored"]
    assert mirrored.gains(0.04, 0.3) == mirrored.gains(-0.04, -0.3)
    printed = schedules["printed"]
    assert printed.gains(-0.04, -0.3) == mirrored.gains(-0.04, -0.3)
    assert printed.gains(0.04, 0.3).p < printed.gains(-0.04, -0.3).p


def test_gains_grow_with_the_error_and_are_never_negative():
    gains_at = schedule(derivative=0.0).gains
    assert gains_at(0.05, 0.0).p == pytest.approx(8e3 + 3e4 * 2 / 3)  # PM: its set's own peak
    assert gains_at(0.05, 1.0).p == pytest.approx(8e3 + 3e4 * 8 / 9)  # PB: its set's centroid
    grid = [gains_at(e / 500, r / 5) for e in range(-30, 31) for r in range(-6, 7)]
    assert min(min(gains) for gains in grid) == 0.0


def feedback(**inputs):
    stand = Stand(FuzzyFeedback)
    still = {**REST, "sideslip_ref": 0.0, "sideslip_rate_ref": 0.0, "sideslip_rate": 0.0}
    stand.start(**still)
    return stand.step(H, **{**still, **inputs})


def test_each_fuzzy_system_alone_pushes_the_right_way():
    assert feedback(yaw_rate_ref=0.02)["yaw_rate_part"] > 1000.0
    assert feedback(yaw_rate_ref=0.02)["sideslip_part"] == 0.0
    assert feedback(sideslip=-0.05)["sideslip_part"] < -500.0  # a positive moment lowers the sideslip
    assert feedback(sideslip=-0.05)["yaw_rate_part"] == 0.0


def test_the_fuzzy_moment_is_the_limited_sum_of_its_parts():
    both = feedback(yaw_rate_ref=0.01, sideslip=0.02)
    assert both["yaw_moment"] == both["yaw_rate_part"] + both["sideslip_part"]
    large = feedback(yaw_rate_ref=9.0, sideslip=9.0)
    assert large["yaw_rate_part"] + large["sideslip_part"] > 6700.0 == large["yaw_moment"]

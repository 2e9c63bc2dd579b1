"""Braking on split friction, over a jump of it, a gust of side wind: closed forms at several samplings."""

from __future__ import annotations

from math import cos, exp, pi, radians, sin

import numpy as np
import pytest

from tests.proving_ground.test_sine_with_dwell import SAMPLING, as_sampled
from tests.refusals import each_mentions, mentions, refused
from yawbench.foundation.errors import ResultsError
from yawbench.proving_ground.braking_and_wind import evaluate_braking, evaluate_side_wind
from yawbench.proving_ground.trace import Trace

BEGIN, V_0, SLOWING = 1.0, 20.0, 5.0
"""The brake's beginning [s], speed [m/s], deceleration [m/s2]: stops at 5 s, after 40 m."""
COURSE = radians(30.0)
YAW, FADES, HAND, RISES = 0.5, 0.4, 1.2, 0.25  # yaw rate YAW s/FADES exp(1 - s/FADES), hand wheel [rad], [s]


def braked(sampling, last=7.0, **other) -> Trace:
    """Return a car that stops at an even deceleration, yaws once, and is steered against it."""
    t = sampling(last)
    s = np.clip(t - BEGIN, 0.0, V_0 / SLOWING)
    late = np.maximum(t - BEGIN, 0.0)
    gone = V_0 * np.minimum(t, BEGIN) + V_0 * s - 0.5 * SLOWING * s**2
    aside = 0.3 * (1.0 - np.exp(-late))
    turned = YAW * FADES * exp(1.0) * (1.0 - (1.0 + late / FADES) * np.exp(-late / FADES))
    signals = {
        "velocity_x": V_0 - SLOWING * s,
        "acceleration_x": np.where((t > BEGIN) & (s < V_0 / SLOWING), -SLOWING, 0.0),
        "drive_force": np.where(t >= BEGIN, -16000.0, 0.0),
        "yaw_rate": -YAW * late / FADES * np.exp(1.0 - late / FADES),
        "yaw_angle": COURSE - turned,
        "position_x": gone * cos(COURSE) + aside * sin(COURSE),
        "position_y": gone * sin(COURSE) - aside * cos(COURSE),
        "steering_wheel_angle": HAND * (1.0 - np.exp(-late / RISES)) + 0.1,
        "sideslip": np.where(t > BEGIN + 3.5, radians(90.0), radians(2.0)),  # at less than 10 km/h
    }
    return Trace("braked", t, signals | other)


@as_sampled
def test_split_friction_gives_distance_deceleration_yaw_and_correction_of_its_closed_forms(sampling):
    judged = evaluate_braking(braked(sampling))
    assert judged.diagnostics == []
    assert judged["speed"] == pytest.approx(V_0, rel=2e-3)
    assert judged["distance"] == pytest.approx(V_0**2 / (2 * SLOWING), rel=3e-3)  # a sample of 5 ms is 0.1 m
    assert judged["deceleration"] == pytest.approx(SLOWING, rel=1e-3)
    assert judged["yaw_rate"] == pytest.approx(YAW, rel=1e-3)
    assert judged["yaw_rate_first"] == judged["yaw_rate"]  # after 0.4 s
    assert judged["yaw_angle"] == pytest.approx(YAW * FADES * exp(1.0), rel=2e-3)
    assert judged["deviation"] == pytest.approx(0.3 * (1.0 - exp(-4.0)), rel=5e-3)
    assert judged["hand"] == pytest.approx(HAND, rel=0.01)  # at 5 ms a sample is 2 % of it
    # the mean over 0.1 s of HAND/RISES exp(-s/RISES) is largest from the beginning on
    assert judged["hand_rate"] == pytest.approx(HAND * (1.0 - exp(-0.1 / RISES)) / 0.1, rel=0.03)
    assert judged["sideslip"] == pytest.approx(radians(2.0))
    assert judged["jump"] is None


def test_without_a_pedal_the_deceleration_tells_the_beginning_and_a_moving_car_has_no_distance():
    made = braked(SAMPLING["1 kHz"])
    del made.signals["drive_force"]
    assert evaluate_braking(made)["begin"] == pytest.approx(BEGIN, abs=0.0011)
    early = evaluate_braking(braked(SAMPLING["1 kHz"], last=4.0))
    assert early["distance"] is None
    assert each_mentions(early.diagnostics, ("4.00 s", "18 km/h", "car"))
    del made.signals["acceleration_x"]
    assert mentions(evaluate_braking(made).diagnostics[0], "drive_force", "acceleration_x")
    free = braked(SAMPLING["1 kHz"], drive_force=np.zeros(7000))
    assert each_mentions(evaluate_braking(free).diagnostics, ("car",))
    del made.signals["yaw_rate"]
    with refused(ResultsError, names=("yaw_rate",)):
        evaluate_braking(made)


@as_sampled
def test_a_jump_of_friction_gives_both_decelerations_and_the_time_of_adaptation(sampling):
    jump, lag, low, high = 2.0, 0.15, 2.0, 6.0
    t = sampling(4.0)
    after = np.maximum(t - jump, 0.0)
    slowing = np.where(t < BEGIN, 0.0, np.where(t < jump, high, low + (high - low) * np.exp(-after / lag)))
    signals = {
        "velocity_x": 30.0
        - np.concatenate([[0.0], np.cumsum(np.diff(t) * 0.5 * (slowing[1:] + slowing[:-1]))]),
        "acceleration_x": -slowing,
        "drive_force": np.where(t >= BEGIN, -1.0, 0.0),
        "yaw_rate": np.where(t >= jump, 0.1 * np.sin(pi * after), 0.3),
        "friction_fl": np.where(t >= jump, 0.3, 0.8),
        "friction_fr": np.where(t >= jump, 0.3, 0.8),
    }
    judged = evaluate_braking(Trace("jump", t, signals))
    assert judged["jump"] == pytest.approx(jump, abs=0.006)
    assert judged["jump_speed"] == pytest.approx(24.0, abs=0.06)
    assert judged["deceleration_before"] == pytest.approx(high, rel=1e-3)
    mean = low + (high - low) * lag * (exp(-0.5 / lag) - exp(-1.0 / lag)) / 0.5
    assert judged["deceleration_after"] == pytest.approx(mean, rel=0.01)
    # 0.9 of the way from `high` to that mean, of a mean over 0.1 s
    level = high - 0.9 * (high - mean)
    smooth = (exp(0.05 / lag) - exp(-0.05 / lag)) * lag / 0.1
    assert judged["adaptation"] == pytest.approx(
        lag * np.log(smooth * (high - low) / (level - low)), abs=0.01
    )
    assert judged["jump_yaw_rate"] == pytest.approx(0.1, rel=1e-3)
    split = Trace("split", t, signals | {"friction_fl": np.full_like(t, 0.8)})
    assert evaluate_braking(split)["jump"] is None


@as_sampled
def test_a_gust_gives_deviation_and_peaks_of_its_closed_forms(sampling):
    t, begin, v = sampling(6.0), 1.5, 25.0
    s = np.clip(t - begin, 0.0, None)
    aside = 0.4 * s**2 * np.exp(-s / 3.0)
    signals = {
        "wind_force_y": np.where((t >= begin) & (t < 2.5), -1200.0 * np.sin(pi * s), 0.0),
        "velocity_x": np.full_like(t, v),
        "position_x": v * t * cos(COURSE) + aside * sin(COURSE),
        "position_y": v * t * sin(COURSE) - aside * cos(COURSE),
        "yaw_angle": COURSE - 0.05 * (1.0 - np.exp(-s)),
        "yaw_rate": 0.01 - 0.06 * s / 0.5 * np.exp(1.0 - s / 0.5),
        "acceleration_y": -1.5 * s / 0.8 * np.exp(1.0 - s / 0.8),
        "steering_wheel_angle": np.full_like(t, 0.02),
    }
    signals["wind_force_y"][t == begin] = -1e-9  # the sine begins with a zero
    judged = evaluate_side_wind(Trace("gust", t, signals))
    assert judged.diagnostics == []
    assert judged["begin"] == pytest.approx(begin, abs=0.006)
    assert judged["force"] == pytest.approx(-1200.0, rel=1e-3)
    assert judged["deviation"] == pytest.approx(-0.4 * 4.0 * exp(-2.0 / 3.0), rel=0.01)
    assert judged["yaw_angle"] == pytest.approx(-0.05 * (1.0 - exp(-2.0)), rel=0.01)
    assert judged["yaw_rate"] == pytest.approx(-0.06, rel=1e-3)
    assert judged["yaw_rate_at"] == pytest.approx(0.5, abs=0.02)
    assert judged["acceleration_y"] == pytest.approx(-1.5, rel=1e-3)
    assert judged["sideslip"] is None
    signals["steering_wheel_angle"] += 0.1 * s
    assert mentions(evaluate_side_wind(Trace("gust", t, signals)).diagnostics[0], "hand", "wheel", "held")
    calm = Trace("calm", t, signals | {"wind_force_y": np.zeros_like(t)})
    assert each_mentions(evaluate_side_wind(calm).diagnostics, ("side", "wind"))

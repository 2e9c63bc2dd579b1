"""Estimators against closed forms: steady turns, slopes, zero points, locking wheels, and what may not be."""

from __future__ import annotations

from math import atan2, sin

import pytest

from yawbench.components.estimation.dugoff_axle import axle_force
from yawbench.components.estimators.kinematic import Kinematic
from yawbench.components.estimators.observer import Observer
from yawbench.components.estimators.told import Told
from yawbench.components.mathematics.low_pass import LowPass
from yawbench.components.tyres.dugoff import dugoff
from yawbench.vocabulary.wheels import WHEELS

from .stand import Stand, four

V = 25.0
RADIUS = 0.313
ROLLING = four("wheel_speed", V / RADIUS)
AXLES = {"cornering_stiffness_front": 91600.0, "cornering_stiffness_rear": 67800.0}
both = pytest.mark.parametrize("estimator", [Kinematic, Observer])


def turning(r: float, half_track: float = 0.74) -> dict[str, float]:
    """Return the wheel speeds [rad/s] of wheels that roll in a turn at V, steered by nothing."""
    sides = {"fl": -1, "fr": 1, "rl": -1, "rr": 1}
    return {f"wheel_speed_{w}": (V + side * half_track * r) / RADIUS for w, side in sides.items()}


@pytest.mark.parametrize("alpha", [0.01, -0.06, 0.3])
def test_an_axles_force_is_that_of_dugoffs_tyre_and_its_slopes_are_its_derivatives(alpha):
    force, by_alpha, by_mu = axle_force(alpha, 7000.0, 0.5, 8e4)
    assert force == pytest.approx(dugoff(alpha, 0.0, 7000.0, 0.5, 1.0, 8e4)[1], rel=1e-3)
    near = [axle_force(alpha, 7000.0, 0.5 + e, 8e4)[0] for e in (-1e-6, 1e-6)]
    assert by_mu == pytest.approx((near[1] - near[0]) / 2e-6, abs=1e-3)
    near = [axle_force(alpha + e, 7000.0, 0.5, 8e4)[0] for e in (-1e-6, 1e-6)]
    assert by_alpha == pytest.approx((near[1] - near[0]) / 2e-6, rel=0.1)


def test_in_a_steady_turn_with_grip_the_sideslip_is_that_of_the_single_track_and_friction_stays():
    a, b, m, r = 1.04, 1.56, 1350.0, 0.08
    a_y = V * r
    beta = b * r / V - m * a_y * a / ((a + b) * AXLES["cornering_stiffness_rear"])
    delta = beta + a * r / V + m * a_y * b / ((a + b) * AXLES["cornering_stiffness_front"])
    stand = Stand(Observer, signal_delay=0.0)
    turn = {"yaw_rate": r, "acceleration_y": a_y, "steer_angle": delta, **turning(r)}
    stand.start(**turn)
    for _ in range(300):
        y = stand.step(0.01, **turn)
    assert y["sideslip"] == pytest.approx(beta, rel=0.02)
    assert y["friction"] == pytest.approx(0.6, abs=0.01)
    assert y["velocity_x"] == pytest.approx(V, rel=1e-3)
    assert abs(y["sideslip_rate"]) < 1e-3


def weave(**parameters: float) -> float:
    """Return the largest error of v_y [m/s] in a weave with grip that inertial sensors tell 11 ms late."""
    a, b, m, i_z, c_f, c_r = 1.04, 1.56, 1350.0, 1343.1, *AXLES.values()
    stand = Stand(Observer, initial_friction=1.2, **parameters)
    stand.start(**ROLLING)
    filters = LowPass(21.0, 0.0), LowPass(21.0, 0.0)
    beta = r = last_r = last_a = worst = 0.0
    for k in range(1, 300):
        for j in range(20):
            delta = 0.02 * sin(6.0 * (k - 1 + j / 20) * 0.01)
            front, rear = c_f * (delta - beta - a * r / V), c_r * (b * r / V - beta)
            a_y = (front + rear) / m
            beta, r = beta + 5e-4 * (a_y / V - r), r + 5e-4 * (a * front - b * rear) / i_z
        for low, before, now in zip(filters, (last_r, last_a), (r, a_y), strict=True):
            low.advance(0.01, before, now)
        last_r, last_a = r, a_y
        felt = {"yaw_rate": filters[0].x, "acceleration_y": filters[1].x}
        y = stand.step(0.01, steer_angle=0.02 * sin(0.06 * k), **felt, **turning(r))
        worst = max(worst, abs(y["velocity_y"] - V * beta))
    return worst


def test_signals_of_one_time_tell_the_sideslip_better_than_a_hand_wheel_ahead_of_the_others():
    believing = {"signal_delay": 0.0107, "velocity_wander": 2.0}  # a_y, as it is measured
    aligned, ahead = weave(**believing), weave(**believing, inertial_bandwidth=0.0)
    assert aligned < 0.4 * ahead
    assert aligned < 0.015


@pytest.mark.parametrize("begin", [0.5, 0.8])
@pytest.mark.parametrize("mu", [0.3, 0.65])
def test_friction_is_found_where_all_of_it_is_used(mu, begin):
    """Both axles slide in a turn of large slip angles: a_y is that of the axles' law at this friction."""
    m, b, a, beta = 1350.0, 1.56, 1.04, -0.15
    r = 0.9 * mu * 9.81 / V
    loads = m * 9.81 * b / (a + b), m * 9.81 * a / (a + b)
    delta = 0.02
    alphas = atan2(V * beta + a * r, V) - delta, atan2(V * beta - b * r, V)
    a_y = sum(axle_force(x, z, mu, c)[0] for x, z, c in zip(alphas, loads, AXLES.values(), strict=True)) / m
    stand = Stand(Observer, initial_friction=begin, measured_share=1.0, velocity_wander=0.01)
    stand.start(**ROLLING)
    stand.unit.v_y = stand.unit.filter.v_y = V * beta
    for _ in range(60):
        y = stand.step(0.01, yaw_rate=a_y / V, acceleration_y=a_y, steer_angle=delta, **turning(a_y / V))
    assert y["friction"] == pytest.approx(mu, rel=0.15)


def test_friction_is_never_less_than_what_is_used():
    stand = Stand(Observer, initial_friction=0.2)
    stand.start(**ROLLING)
    for _ in range(10):
        y = stand.step(0.01, acceleration_y=8.0, yaw_rate=8.0 / V, steer_angle=0.05, **turning(8.0 / V))
    assert y["friction"] >= 0.95 * 8.0 / 9.81 - 1e-9


def test_the_kinematic_estimator_integrates_and_washes_out():
    stand = Stand(Kinematic, washout=2.0, signal_delay=0.0)
    stand.start(**ROLLING)
    for _ in range(200):
        y = stand.step(0.01, acceleration_y=1.0, steer_angle=0.01, **ROLLING)
    assert y["velocity_y"] == pytest.approx(2.0 * (1.0 - 0.995**200), rel=1e-9)


@both
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_zero_points_are_learned_straight_ahead(estimator, sign):
    stand = Stand(estimator)
    zero = {"yaw_rate": 0.005 * sign, "acceleration_y": 0.2}
    stand.start(**zero, **ROLLING)
    for _ in range(50):
        y = stand.step(0.01, **zero, **ROLLING)
    assert (stand.unit.zeros.yaw_rate, stand.unit.zeros.acceleration) == pytest.approx((0.005 * sign, 0.2))
    assert abs(y["sideslip"]) < 1e-4


@both
@pytest.mark.parametrize("slipping", [0.0, 1.8])
@pytest.mark.parametrize("wheels", [WHEELS[:1], WHEELS[2:], WHEELS])
def test_the_speed_stays_when_wheels_lock_or_spin(estimator, slipping, wheels):
    """One wheel, an axle or all four lock, or spin, in 0.1 s while the car brakes, or drives, at 3 m/s2."""
    a_x = -3.0 if slipping < 1.0 else 3.0
    stand = Stand(estimator, slip_stiffness_per_load=1e6)
    stand.start(**ROLLING)
    worst = 0.0
    for k in range(1, 200):
        v = V + a_x * 0.01 * k
        part = 1.0 + (slipping - 1.0) * min(0.1 * k, 1.0)
        speeds = {f"wheel_speed_{w}": (part if w in wheels else 1.0) * v / RADIUS for w in WHEELS}
        y = stand.step(0.01, acceleration_x=a_x, **speeds)
        worst = max(worst, abs(y["velocity_x"] - v))
    assert worst < 0.3
    assert abs(V - v) > 5.0


@both
def test_a_body_that_rolls_is_compensated(estimator):
    """The sensor feels g sin(phi) more; both estimates are those of the car that does not roll."""
    phi = 0.08
    upright, leaning = Stand(estimator), Stand(estimator, roll_at_1_g=phi)
    for stand in (upright, leaning):
        stand.start(**ROLLING)
    for k in range(100):
        a_y = 3.0 * sin(0.05 * k)
        turn = {"yaw_rate": a_y / V, "steer_angle": 0.01 * sin(0.05 * k), **turning(a_y / V)}
        one = upright.step(0.01, acceleration_y=a_y, **turn)
        other = leaning.step(0.01, acceleration_y=a_y * (1 + phi), **turn)
    assert other["sideslip"] == pytest.approx(one["sideslip"], rel=1e-9)


@both
def test_no_output_would_drive_a_tyre_by_its_name(estimator):
    outputs = {v.name for v in estimator.variables if v.causality == "output"}
    assert not outputs & {f"friction_{w}" for w in WHEELS}


def test_one_that_is_told_the_truth_repeats_it_by_the_message_and_late():
    stand = Stand(Told, sample_time=0.01, latency=0.005)
    at_once = Stand(Told, sample_time=0.0)
    truth = {f"{name}_true": 0.0 for name in ("velocity_x", "sideslip", "friction")}
    for one in (stand, at_once):
        one.start(**truth)
    for k in range(1, 40):
        truth = {"velocity_x_true": 20.0, "sideslip_true": 0.001 * k, "friction_true": 0.3}
        said, known = (one.step(0.001, **truth) for one in (stand, at_once))
        assert known["sideslip"] == 0.001 * k
        last = (k - 5) // 10 * 10  # the last message that has arrived by now
        assert said["sideslip"] == pytest.approx(0.001 * max(last, 0))
    assert (said["friction"], said["velocity_x"], said["slip_angle_fl"]) == (0.3, 20.0, 0.0)

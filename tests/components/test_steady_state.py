"""The steady-state reference."""

from __future__ import annotations

from itertools import pairwise
from math import isfinite, pi, sin

import pytest

from yawbench.components.cars.single_track_car import SingleTrackCar
from yawbench.components.references.single_track import SingleTrack
from yawbench.components.references.steady_state import SteadyState, SteadyStateParameters, steady_state

from .stand import Stand


def stability_factor(p):
    return SingleTrackCar.of(p).stability_factor()


P = SteadyStateParameters()
FREE = SteadyStateParameters(limited=False)
A, B, M, C = P.cg_to_front_axle, P.cg_to_rear_axle, P.mass, P.cornering_stiffness_rear
L = A + B
K = stability_factor(P)
RATES = ("yaw_acceleration_ref", "sideslip_rate_ref")


def reference(delta, v_x, mu=1.0, p=P):
    return steady_state(delta, v_x, mu=mu, k=stability_factor(p), p=p)


@pytest.mark.parametrize("v_x", [5.0, 15.0, 25.0, 40.0])
def test_the_unlimited_reference_is_a_state_of_rest_of_the_single_track_equations(v_x):
    delta = 0.02
    r, beta = reference(delta, v_x, p=FREE)
    front = -C * (beta + A * r / v_x - delta)
    rear = -C * (beta - B * r / v_x)
    assert front + rear == pytest.approx(M * v_x * r, rel=1e-12)
    assert A * front - B * rear == pytest.approx(0.0, abs=1e-9)


def test_the_reference_within_the_limits_is_that_without():
    assert reference(0.01, 15.0) == reference(0.01, 15.0, p=FREE)


def test_the_yaw_rate_is_limited_to_what_friction_allows():
    for delta, sign in ((0.2, 1.0), (-0.2, -1.0)):
        assert reference(delta, 25.0, 0.65)[0] == pytest.approx(sign * 0.65 * 9.81 / 25.0, rel=1e-14)
    half = SteadyStateParameters(friction_share=0.5)
    assert reference(0.2, 25.0, 0.65, half)[0] == pytest.approx(0.5 * 0.65 * 9.81 / 25.0, rel=1e-14)


def test_the_sideslip_is_limited_to_that_of_the_limited_yaw_rate():
    v = 25.0
    r, beta = reference(0.2, v, 0.65)
    assert beta == pytest.approx(r * (B / v - M * A * v / (C * L)), rel=1e-12)
    assert beta < 0.0  # above 16 m/s the tail hangs out of the turn


def test_the_sideslip_never_exceeds_its_own_limit():
    assert reference(0.5, 1.0)[1] == P.sideslip_limit
    assert reference(-0.5, 1.0)[1] == -P.sideslip_limit


def test_a_car_rolling_backwards_turns_the_other_way():
    forwards, backwards = reference(0.05, 5.0), reference(0.05, -5.0)
    assert backwards == (-forwards[0], forwards[1])
    assert reference(0.5, -25.0, 0.65)[0] == pytest.approx(-0.65 * 9.81 / 25.0)


def test_the_reference_is_finite_for_any_speed_friction_and_car():
    oversteering = SteadyStateParameters(cornering_stiffness_rear=40000.0)
    assert stability_factor(oversteering) < 0.0
    critical = (-1.0 / stability_factor(oversteering)) ** 0.5
    for p in (P, oversteering):
        for v in (0.0, 1e-300, 1e-9, 16.13, critical, 2 * critical, 1e4):
            for mu in (-0.1, 0.0, 1e-9, 1.2):
                r, beta = reference(0.3, v, mu, p)
                assert isfinite(r) and isfinite(beta)
                assert abs(r * v) <= max(mu, 0.0) * 9.81 * (1 + 1e-12)
                assert abs(beta) <= p.sideslip_limit


def test_rates_are_zero_at_the_start_and_then_differences_over_the_units_own_step():
    stand = Stand(SteadyState, rate_time_constant=0.0)
    first = stand.start(steer_angle=0.01, velocity_x=20.0, friction=0.8)
    assert (first["yaw_acceleration_ref"], first["sideslip_rate_ref"]) == (0.0, 0.0)
    for h, angle in ((0.002, 0.011), (0.005, 0.008)):
        y = stand.step(h, steer_angle=angle)
        assert y["yaw_acceleration_ref"] == (y["yaw_rate_ref"] - first["yaw_rate_ref"]) / h
        assert y["sideslip_rate_ref"] == (y["sideslip_ref"] - first["sideslip_ref"]) / h
        first = y


@pytest.mark.parametrize("component", [SteadyState, SingleTrack])
@pytest.mark.parametrize("tau", [0.0, 0.005])
def test_a_last_step_as_short_as_a_rounding_error_leaves_the_rates_as_they_are(component, tau):
    stand = Stand(component, rate_time_constant=tau)
    stand.start(steer_angle=0.0, velocity_x=25.0)
    before = stand.step(0.001, steer_angle=0.001, velocity_x=25.0)
    after = stand.step(1e-12, steer_angle=0.002, velocity_x=25.0)
    assert after["yaw_rate_ref"] > 1.9 * before["yaw_rate_ref"] > 0.0
    for name in RATES:
        assert after[name] == before[name]
    # What was left out counts in the next step: the mean slope over both is that of the whole change.
    last = stand.step(0.001, steer_angle=0.003, velocity_x=25.0)
    if tau == 0.0:
        for name, value in zip(RATES, ("yaw_rate_ref", "sideslip_ref"), strict=True):
            assert last[name] == pytest.approx((last[value] - before[value]) / 0.001, rel=1e-8)


def varying(quantum, **parameters):
    """Return the variation [rad/s2] of the yaw acceleration asked for in one sine of steering."""
    stand = Stand(SteadyState, **parameters)
    stand.start(steer_angle=0.0, velocity_x=25.0)
    given = []
    for k in range(1, 5001):
        delta = 0.0325 * sin(2.0 * pi * 0.2 * 0.001 * k)
        delta = quantum * round(delta / quantum) if quantum else delta
        given.append(stand.step(0.001, steer_angle=delta, velocity_x=25.0)["yaw_acceleration_ref"])
    return sum(abs(b - a) for a, b in pairwise(given))


def test_a_steering_angle_in_steps_of_a_sensor_shakes_the_rates_a_fifth_as_much_as_its_differences():
    quantum = 1.1e-4  # 0.1 degrees of the hand wheel
    assert varying(quantum, rate_time_constant=0.0) > 100.0 * varying(0.0)
    assert varying(quantum) < 0.2 * varying(quantum, rate_time_constant=0.0)
    assert varying(quantum, rate_time_constant=0.02) < 0.055 * varying(quantum, rate_time_constant=0.0)


def test_friction_is_one_until_somebody_sets_it():
    stand = Stand(SteadyState)
    assert stand["friction"] == 1.0
    assert stand.start(steer_angle=0.5, velocity_x=25.0)["yaw_rate_ref"] == pytest.approx(9.81 / 25.0)

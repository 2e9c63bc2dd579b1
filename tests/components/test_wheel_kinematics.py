"""Wheel velocities, slips and lever arms against geometry."""

from __future__ import annotations

from math import atan2, cos, hypot, isfinite, pi, radians, sin

import numpy as np
import pytest

from yawbench.components.cars.wheel_kinematics import (
    earth_velocity,
    lever_arms,
    slip_angle,
    slip_ratio,
    wheel_velocities,
)
from yawbench.components.plants.seven_dof import SevenDofParameters

CAR = SevenDofParameters()
A, B, HALF = CAR.cg_to_front_axle, CAR.cg_to_rear_axle, 0.5 * CAR.track_width
PLACES = ((A, HALF), (A, -HALF), (-B, HALF), (-B, -HALF))
LOW = 0.5


def velocities(v_x, v_y, r, delta):
    return wheel_velocities(v_x, v_y, r=r, delta=delta, p=CAR)


def test_wheel_velocities_are_those_of_a_turning_rigid_body_in_wheel_axes():
    v_x, v_y, r, delta = 17.0, -2.0, 0.6, 0.2
    found = velocities(v_x, v_y, r, delta)
    for i, ((x, y), angle) in enumerate(zip(PLACES, (delta, delta, 0.0, 0.0), strict=True)):
        wheel = complex(v_x - r * y, v_y + r * x) * complex(cos(angle), -sin(angle))
        assert found[i] == pytest.approx(wheel.real, rel=1e-14)
        assert found[4 + i] == pytest.approx(wheel.imag, rel=1e-14)


def test_a_turn_about_the_rear_axle_without_slip_needs_the_ackermann_angle():
    radius = 20.0
    r = 5.0 / radius
    v_y = B * r  # the rear axle moves straight ahead
    middle = 0.5 * sum(velocities(5.0, v_y, r, 0.0)[4:6]) / 5.0
    assert middle == pytest.approx((A + B) / radius, rel=1e-14)
    assert velocities(5.0, v_y, r, 0.0)[6:] == (0.0, 0.0)


def test_the_slip_angle_is_the_direction_of_travel_in_all_four_quadrants():
    for degrees in range(-175, 181, 5):
        angle = radians(degrees)
        assert slip_angle(8.0 * cos(angle), 8.0 * sin(angle), LOW) == pytest.approx(angle, abs=1e-14)


@pytest.mark.parametrize(
    ("rolling", "v", "kappa"),
    [(11.0, 10.0, 1 / 11), (9.0, 10.0, -0.1), (0.0, 10.0, -1.0), (10.0, 0.0, 1.0), (10.0, 10.0, 0.0)],
)
def test_slip_ratio_is_relative_to_the_larger_speed(rolling, v, kappa):
    assert slip_ratio(rolling, v, LOW) == pytest.approx(kappa, abs=1e-15)
    assert slip_ratio(-rolling, -v, LOW) == pytest.approx(-kappa, abs=1e-15)


def test_a_wheel_that_turns_against_its_travel_slips_by_more_than_one():
    assert slip_ratio(-4.0, 10.0, LOW) == pytest.approx(-1.4)
    assert slip_ratio(-10.0, 10.0, LOW) == -2.0


def test_a_wheel_at_rest_has_no_slip():
    assert slip_angle(0.0, 0.0, LOW) == 0.0
    assert slip_ratio(0.0, 0.0, LOW) == 0.0


def test_slips_are_continuous_where_the_low_speed_begins():
    for degrees in (-80, -30, 0, 10, 89):
        v, v_lat = LOW * cos(radians(degrees)), LOW * sin(radians(degrees))
        outside = slip_angle(1.000001 * v, 1.000001 * v_lat, LOW)
        assert slip_angle(0.999999 * v, 0.999999 * v_lat, LOW) == pytest.approx(outside, abs=1e-4)
    assert slip_ratio(0.3, LOW, LOW) == pytest.approx(slip_ratio(0.3, LOW * 1.000001, LOW), abs=1e-5)


def test_below_the_low_speed_slip_is_proportional_to_the_sliding_speed():
    assert sin(slip_angle(1e-3, 2e-3, LOW)) == pytest.approx(2e-3 / LOW, rel=1e-12)
    assert slip_ratio(3e-3, 1e-3, LOW) == pytest.approx(2e-3 / LOW, rel=1e-12)


def test_slips_are_finite_and_bounded_for_any_motion():
    random = np.random.default_rng(1)
    for size in (0.0, 1e-300, 1e-9, 1.0, 1e3):
        for v, v_lat, rolling in (size * random.uniform(-1, 1, (200, 3))).tolist():
            alpha, kappa = slip_angle(v, v_lat, LOW), slip_ratio(rolling, v, LOW)
            assert isfinite(alpha) and abs(alpha) <= pi
            assert isfinite(kappa) and abs(kappa) <= 2.0


def test_lever_arms_are_those_of_the_cross_product():
    for delta in (-0.5, 0.0, 0.3):
        expected = [x * sin(d) - y * cos(d) for (x, y), d in zip(PLACES, (delta, delta, 0, 0), strict=True)]
        assert lever_arms(delta, A, HALF) == pytest.approx(expected, rel=1e-14)


def test_earth_velocity_keeps_the_speed_and_turns_by_the_yaw_angle():
    x, y = earth_velocity(3.0, 4.0, 0.7)
    assert hypot(x, y) == pytest.approx(5.0)
    assert atan2(y, x) == pytest.approx(atan2(4.0, 3.0) + 0.7)

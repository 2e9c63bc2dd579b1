"""The single-track reference: its linear model, its limits, and rates that belong to what it shows."""

from __future__ import annotations

from math import atan, pi, sin

import numpy as np
import pytest
from scipy.linalg import expm

from yawbench.components.cars.single_track_car import SingleTrackCar
from yawbench.components.references.single_track import G, SingleTrack, SingleTrackParameters

from .stand import Stand

P = SingleTrackParameters()
M, I_Z, A, B, C_F, C_R = 1350.0, 1343.1, 1.04, 1.56, 91600.0, 67800.0
CAR = SingleTrackCar(M, I_Z, A, B, C_F, C_R)
UNLIMITED = {"limit_yaw_rate": False, "limit_sideslip": False}


def matrices(v: float) -> tuple[np.ndarray, np.ndarray]:
    """Equation (16): d(beta, r)/dt = system (beta, r) + entry delta."""
    system = np.array(
        [
            [-(C_F + C_R) / (M * v), -(A * C_F - B * C_R) / (M * v * v) - 1.0],
            [-(A * C_F - B * C_R) / I_Z, -(A * A * C_F + B * B * C_R) / (I_Z * v)],
        ]
    )
    return system, np.array([C_F / (M * v), A * C_F / I_Z])


@pytest.mark.parametrize("v", [5.0, 22.2, 40.0])
@pytest.mark.parametrize("mode", ["steady_state", "dynamic"])
def test_it_settles_at_the_steady_state_of_the_printed_equations(mode, v):
    system, entry = matrices(v)
    beta, r = np.linalg.solve(system, -entry * 0.01)
    stand = Stand(SingleTrack, mode=mode, **UNLIMITED)
    stand.start(velocity_x=v)
    for _ in range(800):
        y = stand.step(0.01, steer_angle=0.01, velocity_x=v)
    assert y["yaw_rate_ref"] == pytest.approx(r, rel=1e-9)
    assert y["sideslip_ref"] == pytest.approx(beta, rel=1e-9)
    assert y["yaw_acceleration_ref"] == pytest.approx(0.0, abs=1e-9)


def test_the_dynamic_model_answers_a_ramp_as_the_matrix_exponential():
    v, slope = 25.0, 0.1
    system, entry = matrices(v)
    whole = np.zeros((4, 4))
    whole[:2, :2], whole[:2, 2], whole[2, 3] = system, entry, 1.0
    stand = Stand(SingleTrack, mode="dynamic", **UNLIMITED)
    stand.start(velocity_x=v)
    for k in range(50):
        y = stand.step(0.01, steer_angle=slope * 0.01 * (k + 1), velocity_x=v)
        beta, r = (expm(whole * 0.01 * (k + 1)) @ np.array([0.0, 0.0, 0.0, slope]))[:2]
        assert y["yaw_rate_ref"] == pytest.approx(r, abs=2e-6)
        assert y["sideslip_ref"] == pytest.approx(beta, abs=2e-6)


@pytest.mark.parametrize("mode", ["steady_state", "dynamic"])
@pytest.mark.parametrize("delta", [0.3, -0.3])
def test_outputs_are_limited_to_the_friction_and_keep_the_linear_sign(mode, delta):
    stand = Stand(SingleTrack, mode=mode, friction_share=0.85)
    stand.start(velocity_x=25.0, friction=0.3)
    for _ in range(300):
        y = stand.step(0.01, steer_angle=delta, velocity_x=25.0, friction=0.3)
    side = 1.0 if delta > 0.0 else -1.0
    assert y["yaw_rate_ref"] == pytest.approx(side * 0.85 * 0.3 * G / 25.0, rel=1e-12)
    # At 25 m/s the tail hangs out: sideslip against the steer angle.
    assert y["sideslip_ref"] == pytest.approx(-side * atan(0.02 * 0.3 * G), rel=1e-12)


@pytest.mark.parametrize("mode", ["steady_state", "dynamic"])
def test_a_limited_steer_angle_keeps_yaw_rate_and_sideslip_of_one_turn(mode):
    v, mu = 25.0, 0.5
    stand = Stand(SingleTrack, mode=mode, limit_steer_angle=True, limit_sideslip=False)
    stand.start(velocity_x=v, friction=mu)
    for _ in range(400):
        y = stand.step(0.01, steer_angle=0.14, velocity_x=v, friction=mu)
    r_gain, beta_gain = CAR.gains(v)
    assert y["yaw_rate_ref"] == pytest.approx(mu * G / v, rel=1e-6)
    assert y["sideslip_ref"] / y["yaw_rate_ref"] == pytest.approx(beta_gain / r_gain, rel=1e-6)
    # Limited outputs alone are of two turns.
    other = Stand(SingleTrack, limit_sideslip=False).start(steer_angle=0.14, velocity_x=v, friction=mu)
    assert abs(other["sideslip_ref"] / other["yaw_rate_ref"]) > 2 * abs(beta_gain / r_gain)


@pytest.mark.parametrize("mode", ["steady_state", "dynamic"])
def test_rates_are_those_of_the_limited_outputs(mode):
    stand = Stand(SingleTrack, mode=mode, rate_time_constant=0.0)
    h, v = 0.001, 22.0
    before = stand.start(velocity_x=v, friction=0.5)
    total = [0.0, 0.0]
    for k in range(3000):
        y = stand.step(h, steer_angle=0.09 * sin(2 * pi * 0.4 * (k + 1) * h), velocity_x=v, friction=0.5)
        total[0] += h * y["yaw_acceleration_ref"]
        total[1] += h * y["sideslip_rate_ref"]
        assert total[0] == pytest.approx(y["yaw_rate_ref"] - before["yaw_rate_ref"], abs=1e-12)
        assert total[1] == pytest.approx(y["sideslip_ref"] - before["sideslip_ref"], abs=1e-12)
        if abs(y["yaw_rate_ref"]) == 0.5 * G / v and k % 100 == 50:
            assert y["yaw_acceleration_ref"] == pytest.approx(0.0, abs=1e-9)


def test_the_rates_lag_by_their_time_constant_and_keep_the_area_of_a_jump():
    tau, h = 0.02, 0.001
    stand = Stand(SingleTrack, rate_time_constant=tau)
    stand.start(velocity_x=20.0)
    r_gain, _ = CAR.gains(20.0)
    area = 0.0
    for k in range(400):
        y = stand.step(h, steer_angle=0.01, velocity_x=20.0)
        area += h * y["yaw_acceleration_ref"]
        if k == 20:
            assert y["yaw_acceleration_ref"] > 0.0
    assert area == pytest.approx(0.01 * r_gain, rel=1e-6)


@pytest.mark.parametrize("mode", ["steady_state", "dynamic"])
@pytest.mark.parametrize("limited", [False, True])
def test_a_car_at_rest_or_rolling_backwards_is_asked_for_no_yaw_rate(mode, limited):
    stand = Stand(SingleTrack, mode=mode, limit_steer_angle=limited)
    stand.start()
    for v in (0.0, -3.0):
        for _ in range(100):
            y = stand.step(0.01, steer_angle=0.3, velocity_x=v)
        assert y["yaw_rate_ref"] == 0.0
        assert all(np.isfinite(list(y.values())))


def test_an_oversteering_car_beyond_its_critical_speed_is_held_by_the_limits():
    oversteer = {"cornering_stiffness_front": 120000.0, "cornering_stiffness_rear": 60000.0}
    for mode in ("steady_state", "dynamic"):
        stand = Stand(SingleTrack, mode=mode, **oversteer)
        stand.start(velocity_x=45.0, friction=0.8)
        for _ in range(100):
            y = stand.step(0.01, steer_angle=0.02, velocity_x=45.0, friction=0.8)
        assert y["yaw_rate_ref"] == pytest.approx(0.8 * G / 45.0, rel=1e-12)
        assert abs(y["sideslip_ref"]) == pytest.approx(atan(0.02 * 0.8 * G), rel=1e-12)


@pytest.mark.parametrize("mode", ["steady_state", "dynamic"])
def test_with_the_initial_speed_a_car_that_slows_down_has_the_reference_of_one_that_does_not(mode):
    slowing, steady = Stand(SingleTrack, mode=mode, speed="initial"), Stand(SingleTrack, mode=mode)
    for stand in (slowing, steady):
        stand.start(velocity_x=25.0, friction=0.6)
    for k in range(200):
        given = {"steer_angle": 0.08 * sin(0.03 * k), "friction": 0.6}
        found = slowing.step(0.005, velocity_x=25.0 - 0.1 * k, **given)
        assert found == steady.step(0.005, velocity_x=25.0, **given)

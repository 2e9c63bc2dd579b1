"""The baselines beside the papers: LQR, model-predictive control, dead band."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_are, solve_discrete_are
from scipy.optimize import nnls

from yawbench.components.cars.single_track_car import SingleTrackCar
from yawbench.components.control_laws.linear_feedback import error_dynamics, optimal_gains
from yawbench.components.control_laws.phase_plane import beyond
from yawbench.components.control_laws.predictive_law import CostWeights, PredictiveLaw, discrete
from yawbench.components.control_laws.sideslip_bound import sideslip_bound
from yawbench.components.controllers.dead_band import DeadBand
from yawbench.components.controllers.mpc import Mpc
from yawbench.components.mathematics.quadratic_program import multipliers

from .stand import Stand

CARS = {
    "neutral": SingleTrackCar(1100.0, 1249.0, 1.256, 1.368, 1e5, 1e5),
    "understeering": SingleTrackCar(1830.0, 3234.0, 1.4, 1.65, 62618.0, 110185.0),
    "oversteering": SingleTrackCar(1500.0, 2500.0, 1.5, 1.2, 9e4, 7e4),
}
SCALES = {"beta_0": 0.02, "r_0": 0.2, "moment_0": 5000.0}


@pytest.mark.parametrize("car", CARS.values(), ids=CARS)
@pytest.mark.parametrize("v", [8.0, 15.0, 25.0, 40.0])
def test_the_gains_are_those_of_the_riccati_equation(car, v):
    a = np.array(error_dynamics(car, v))
    b = np.array([[0.0], [1.0 / car.i_z]])
    q = np.diag([SCALES["beta_0"] ** -2, SCALES["r_0"] ** -2])
    p = solve_continuous_are(a, b, q, [[SCALES["moment_0"] ** -2]])
    expected = (SCALES["moment_0"] ** 2 * b.T @ p)[0]
    assert optimal_gains(error_dynamics(car, v), car.i_z, **SCALES) == pytest.approx(expected, rel=1e-6)


def test_gains_stay_finite_where_the_yaw_rate_does_not_reach_the_sideslip():
    at_rest, behind, before = (
        optimal_gains(((-5.0, a_12), (2.0, -4.0)), 3000.0, **SCALES) for a_12 in (0.0, 1e-4, -1e-4)
    )
    assert at_rest == pytest.approx(behind, rel=0.01)
    assert at_rest == pytest.approx(before, rel=0.01)


@pytest.mark.parametrize("speed", [25.0, 0.5])  # the slow car is stiff
def test_the_discrete_model_is_that_of_the_matrix_exponential(speed):
    a = np.array(error_dynamics(CARS["oversteering"], speed))
    phi, gamma = discrete(tuple(map(tuple, a)), 3.0, 0.02)
    whole = expm(np.vstack([np.column_stack([a, [0.0, 3.0]]), np.zeros(3)]) * 0.02)
    assert np.allclose(phi, whole[:2, :2], rtol=1e-13, atol=1e-15 if speed == 25.0 else 1e-10)
    assert np.allclose(gamma, whole[:2, 2], rtol=1e-12, atol=1e-15 if speed == 25.0 else 1e-10)


def test_multipliers_are_those_of_nonnegative_least_squares():
    """With P = L L', the dual is the problem of least squares |L' y + L^-1 d|, which nnls solves exactly."""
    rng = np.random.default_rng(4)
    for _ in range(50):
        root = rng.normal(size=(8, 8))
        p = root @ root.T + 0.3 * np.eye(8)
        d = rng.normal(size=8)
        lower = np.linalg.cholesky(p)
        exact, _ = nnls(lower.T, -np.linalg.solve(lower, d))
        assert np.allclose(multipliers(p.tolist(), d.tolist()), exact, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("car", CARS.values(), ids=CARS)
@pytest.mark.sampled(1)
def test_far_from_limits_a_long_prediction_is_the_regulator_of_the_sampled_car(car):
    a, step = error_dynamics(car, 25.0), 0.05
    weights = CostWeights(**SCALES, penalty=1.0, step=step, moves=45, steps_per_move=1)
    law = PredictiveLaw(a, car.i_z, weights)
    phi, gamma = discrete(a, weights.moment_0 / car.i_z, step)
    b = np.array(gamma).reshape(2, 1)
    q = np.diag([SCALES["beta_0"] ** -2, SCALES["r_0"] ** -2])
    p = solve_discrete_are(phi, b, q, [[1.0]])
    gains = np.linalg.solve(1.0 + b.T @ p @ b, b.T @ p @ phi)[0]
    moment = law.moment(-1e-3, 2e-3, 0.0, 0.0, most=1e6, bound=1.0)
    assert moment / weights.moment_0 == pytest.approx(gains @ [1e-3, -2e-3], rel=1e-6)


def test_the_moments_of_the_program_are_the_best_that_are_allowed():
    """Against all moments of a fine grid, by simulating the prediction."""
    car = CARS["understeering"]
    w = CostWeights(**SCALES, penalty=10.0, step=0.02, moves=2, steps_per_move=5)
    a, b = error_dynamics(car, 25.0), w.moment_0 / car.i_z
    phi, gamma = map(np.array, discrete(a, b, w.step))
    most, bound, beta_ref = 3000.0, 0.05, 0.01

    grid = np.linspace(-most, most, 121) / w.moment_0

    def best(e):
        """Return the first of the two moments that cost least, of all pairs at once."""
        total, e = 0.0, e[:, None, None]
        for z in (grid[:, None], grid[None, :]):
            for _ in range(w.steps_per_move):
                e = np.tensordot(phi, e, 1) + gamma[:, None, None] * z
                total = total + (e[0] / w.beta_0) ** 2 + (e[1] / w.r_0) ** 2 + z * z
            total = total + w.penalty * (np.maximum(np.abs(beta_ref + e[0]) - bound, 0.0) / w.beta_0) ** 2
        return grid[np.unravel_index(np.argmin(total), total.shape)[0]]

    for beta, r in ((0.08, -0.1), (-0.1, 0.02), (0.0, 0.06), (0.2, 0.3)):
        e = np.array([beta - beta_ref, r])
        first = PredictiveLaw(a, car.i_z, w).moment(beta, r, beta_ref, 0.0, most=most, bound=bound)
        assert abs(first - best(e) * w.moment_0) <= 1.01 * (grid[1] - grid[0]) * w.moment_0
        assert abs(first) <= most * (1.0 + 1e-9)


def test_it_does_nothing_within_its_dead_band_and_limit():
    stand = Stand(DeadBand)
    stand.start(velocity_x=25.0)
    calm = {"yaw_rate_ref": 0.3, "yaw_rate": 0.3 - 0.06, "sideslip": 0.15, "velocity_x": 25.0}
    assert stand.step(0.005, **calm)["yaw_moment"] == 0.0
    assert stand.step(0.005, **calm | {"yaw_rate": 0.23})["yaw_moment"] == pytest.approx(
        0.5 * 40000.0 * 0.005
    )
    assert stand.step(0.005, **calm | {"yaw_rate": 0.37})["yaw_moment"] == pytest.approx(-40000.0 * 0.005)
    beta = sideslip_bound(1.0) + 0.01
    assert stand.step(0.005, **calm | {"sideslip": beta})["yaw_moment"] == pytest.approx(600.0)


def test_the_program_is_scheduled_down_to_the_slowest_speed_it_has_a_car_for():
    stand = Stand(Mpc, scheduling_speed=0.1)
    stand.start(velocity_x=25.0)
    assert stand.step(0.005, velocity_x=0.1, yaw_rate=0.5)["yaw_moment"] < 0.0


def test_parameters_set_after_outputs_were_read_change_the_law_that_is_kept():
    at_its_grid_point = {"velocity_x": 6.0, "yaw_rate": 0.1}
    late = Stand(Mpc, scheduling_speed=6.0)
    late.set(**at_its_grid_point)
    before = late.outputs()["yaw_moment"]
    late.set(yaw_rate_scale=0.01)
    fresh = Stand(Mpc, scheduling_speed=6.0, yaw_rate_scale=0.01)
    after = [stand.start(**at_its_grid_point)["yaw_moment"] for stand in (late, fresh)]
    assert after[0] == after[1] != before


def test_what_is_beyond_a_threshold_has_its_sign():
    assert [beyond(x, 2.0) for x in (-3.0, -2.0, 0.0, 2.0, 5.0)] == [-1.0, 0.0, 0.0, 0.0, 3.0]
    assert sideslip_bound(0.9) == pytest.approx(math.radians(10.0), rel=0.02)

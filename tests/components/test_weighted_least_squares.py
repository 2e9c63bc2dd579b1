"""Allocation by weighted least squares: against scipy's bounded least squares, and what tyres can give."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from yawbench.components.allocators.weighted_least_squares import WeightedLeastSquares
from yawbench.components.cars.wheel_kinematics import lever_arms
from yawbench.components.mathematics.bounded_least_squares import bounded

from .stand import Stand

LOADS = {
    "vertical_load_fl": 3000.0,
    "vertical_load_fr": 6500.0,
    "vertical_load_rl": 2500.0,
    "vertical_load_rr": 5500.0,
}


def forces(
    moment: float, *, friction: float = 0.9, delta: float = 0.0, drive: float = 0.0, **parameters: object
):
    """Return the requested forces [N] of fl, fr, rl, rr."""
    stand = Stand(WeightedLeastSquares, **parameters)
    y = stand.start(yaw_moment=moment, drive_force=drive, steer_angle=delta, friction=friction, **LOADS)
    return np.array([y[f"force_request_{wheel}"] for wheel in ("fl", "fr", "rl", "rr")])


@pytest.mark.parametrize("seed", range(5))
def test_the_solution_is_that_of_scipys_bounded_least_squares(seed):
    rng = np.random.default_rng(seed)
    for _ in range(100):
        w, d = rng.uniform(0.5, 2.0, 4), rng.normal(size=4)
        b, v, c = rng.normal(size=(2, 4)), rng.uniform(1.0, 300.0, 2), 3.0 * rng.normal(size=2)
        low = rng.normal(size=4) - 0.5
        high = low + rng.uniform(0.0, 2.0, 4) + 1e-6
        a = np.vstack([np.diag(np.sqrt(w)), np.sqrt(v)[:, None] * b])
        y = np.concatenate([np.sqrt(w) * d, np.sqrt(v) * c])
        exact = lsq_linear(a, y, (low, high), method="bvls", tol=1e-14).x
        assert bounded(w, d, b.tolist(), v, c, low, high) == pytest.approx(exact, abs=1e-7)


@pytest.mark.parametrize("delta", [0.0, 0.1, -0.2])
@pytest.mark.parametrize("moment", [800.0, -3000.0])
def test_a_moment_that_the_tyres_can_give_is_given_by_braking_alone(moment, delta):
    x = forces(moment, delta=delta)
    arms = lever_arms(delta, 1.4, 0.8)
    assert x @ arms == pytest.approx(moment, rel=0.02)
    assert max(x) <= 0.0
    assert all(x >= -0.9 * np.array([*LOADS.values()]) - 1e-9)


def test_more_than_the_tyres_can_give_is_all_of_the_grip_on_the_side_that_turns():
    x = forces(-50000.0)
    assert x == pytest.approx([0.0, -0.9 * 6500.0, 0.0, -0.9 * 5500.0])


def test_wheels_share_a_small_moment_by_the_squares_of_their_loads():
    x = forces(-1000.0)
    assert x[1] / x[3] == pytest.approx((6500.0 / 5500.0) ** 2, rel=1e-6)
    assert x[0] == x[2] == 0.0


def test_motors_turn_a_car_without_slowing_it():
    x = forces(2000.0, motors=True, force_weight=1e4)
    assert sum(x) == pytest.approx(0.0, abs=60.0)
    assert min(x) < 0.0 < max(x)


def test_the_drivers_force_stays_and_the_moment_is_added_to_it():
    x = forces(1500.0, drive=-4000.0, drive_front_share=0.6)
    alone = forces(0.0, drive=-4000.0, drive_front_share=0.6)
    arms = lever_arms(0.0, 1.4, 0.8)
    assert alone == pytest.approx([-1200.0, -1200.0, -800.0, -800.0])
    assert (x - alone) @ arms == pytest.approx(1500.0, rel=0.02)

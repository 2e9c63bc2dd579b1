"""The driver of the proving ground's lane changes: optimal path, optimal preview, what tyres need."""

from __future__ import annotations

import math
from array import array

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from yawbench.components.cars.single_track_car import SingleTrackCar
from yawbench.components.drivers.optimal_preview import (
    MOST,
    OptimalPreview,
    OptimalPreviewParameters,
    lane_dynamics,
    planned,
)
from yawbench.components.driving import lane_path
from yawbench.components.driving.track import Track
from yawbench.components.mathematics.linear_equations import solve
from yawbench.components.mathematics.preview_control import TrackingLaw, discrete
from yawbench.vocabulary.gravity import G

from .stand import Stand

P = OptimalPreviewParameters
PART_2 = {"track_standard": "iso_3888_2", "coasting_after": 2.0}
CAR = SingleTrackCar.of(P(), P().yaw_inertia)
FIRST = (1.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("v, h", [(2.0, 0.03), (17.0, 0.03), (40.0, 0.5)])
def test_held_inputs_are_carried_as_by_the_matrix_exponential(v, h):
    a, b = lane_dynamics(CAR, v, 17.0)
    whole = np.zeros((6, 6))
    whole[:5, :5], whole[:5, 5] = a, b
    exact = expm(h * whole)
    phi, gamma = discrete(a, b, h)
    np.testing.assert_allclose(phi, exact[:5, :5], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(gamma, exact[:5, 5], rtol=1e-9, atol=1e-12)


def test_the_gains_are_those_of_the_riccati_equation_and_of_the_best_inputs_for_a_known_path():
    phi, gamma = discrete(*lane_dynamics(CAR, 17.0, 17.0), 0.03)
    weight, steps = 0.02**-2, 60
    law = TrackingLaw(phi, gamma, FIRST, weight)
    gains, ahead, line = law.gains, [], law.line
    for _ in range(steps):
        ahead.append(law.gain_ahead(line))
        line = law.further(line)
    a, b = np.array(phi), np.array(gamma).reshape(5, 1)
    p = solve_discrete_are(a, b, np.diag([weight, 0, 0, 0, 0]), np.eye(1))
    np.testing.assert_allclose(gains, (np.linalg.solve(1 + b.T @ p @ b, b.T @ p @ a)).ravel(), rtol=1e-6)

    horizon = 200  # least squares over all inputs, the target zero again after `steps`
    rng = np.random.default_rng(1)
    target = np.concatenate([rng.normal(size=steps), np.zeros(horizon - steps)])
    start = np.array([0.3, 0.05, 0.4, -0.1, 0.2])
    answers, free, x = np.zeros((horizon, horizon)), np.zeros(horizon), start
    impulse = b.ravel()
    for k in range(horizon):
        x = a @ x
        free[k] = x[0]
        for i in range(horizon - k):
            answers[i + k, i] = impulse[0]
        impulse = a @ impulse
    rows = np.vstack([math.sqrt(weight) * answers, np.eye(horizon)])
    wanted = np.concatenate([math.sqrt(weight) * (target - free), np.zeros(horizon)])
    best = np.linalg.lstsq(rows, wanted, rcond=None)[0][0]
    assert -np.dot(gains, start) + np.dot(ahead, target[:steps]) == pytest.approx(best, rel=1e-5)


@pytest.mark.parametrize("n", [1, 5, 40])
def test_linear_equations_have_the_solution_of_numpy(n):
    rng = np.random.default_rng(n)
    a = rng.normal(size=(n, n))
    h, g = a @ a.T + np.eye(n), rng.normal(size=n)
    z = array("d", g)
    solve(array("d", h.ravel()), z, n)
    np.testing.assert_allclose(z, np.linalg.solve(h, g), rtol=1e-9)


def test_a_matrix_with_a_pivot_of_zero_is_an_error():
    with pytest.raises(ZeroDivisionError):
        solve(array("d", [0.0, 0.0, 0.0, 1.0]), array("d", [1.0, 1.0]), 2)


@pytest.mark.parametrize("more", [{}, PART_2], ids=["part 1", "part 2"])
def test_no_other_path_costs_less(more, monkeypatch):
    """The cost is convex, so where its slope by finite differences is zero it is least."""
    seen = []
    solved = lane_path.PathProgram.solved
    monkeypatch.setattr(
        lane_path.PathProgram, "solved", lambda self: seen.append((self, solved(self))) or seen[0][1]
    )
    planned.__wrapped__(P(target_speed=17.0, **more))
    (program, z), h = seen[0], 1e-5
    slopes = []
    for k in range(len(z)):
        up, down = ([v + sign * h * (i == k) for i, v in enumerate(z)] for sign in (1.0, -1.0))
        slopes.append((program.cost(up) - program.cost(down)) / (2 * h))
    n = len(z)
    slope, hessian = array("d", [0.0] * n), array("d", [0.0] * (n * n))
    program.derive([0.0] * n, slope, hessian)
    assert max(map(abs, slopes)) < 1e-3 * max(map(abs, slope))
    program.derive(z, slope, hessian)
    assert np.linalg.eigvalsh(np.reshape(hessian, (n, n))).min() > 0.0
    assert max(map(abs, z)) > 0.1  # there is something to be done


def test_a_slow_car_has_the_margin_all_along_and_a_fast_one_less_force_for_less_margin():
    def clearance_and_force(v):
        p = P(target_speed=v, **PART_2)
        path, track, (yaw_gain, slip_gain) = planned(p), Track(p), CAR.gains(v)
        least = math.inf
        half, front, rear = 0.5 * p.vehicle_width, p.cg_to_front_end, p.cg_to_rear_end
        for x in np.arange(15.0, 100.0, 0.25):
            slope = (path(x + 0.05) - path(x - 0.05)) / 0.1
            bend = (path(x + 0.05) - 2.0 * path(x) + path(x - 0.05)) / 0.05**2
            psi = slope - slip_gain * v / yaw_gain * bend
            for lane in track.lanes:
                for s in (-rear, front):
                    if lane.start <= x + s <= lane.end:
                        y = path(x) + s * psi
                        least = min(least, lane.left - y - half, y - half - lane.right)
        return least, v * v * max(abs(bend) for bend in path.bends)

    slow, fast = clearance_and_force(8.0), clearance_and_force(17.0)
    assert slow[0] > 0.06  # 0.1 m are aimed at, at the cones themselves
    assert 0.0 < fast[0] < slow[0]
    assert fast[1] < 0.95 * 0.9 * G


def on_the_move(**motion):
    zero = dict.fromkeys(("velocity_y", "yaw_rate", "position_x", "position_y", "yaw_angle"), 0.0)
    return {"velocity_x": 20.0, **zero, **motion}


@pytest.mark.parametrize("share", [0.01, -0.5, 0.9, 5.0])
def test_front_tyres_after_fiala_give_what_the_linear_car_asks_for_and_no_more_than_they_have(share):
    stand = Stand(OptimalPreview)
    stand.start(**on_the_move())
    p, unit = stand.unit.p, stand.unit
    largest = p.grip_share * 0.9 * p.mass * G * p.cg_to_rear_axle / (p.cg_to_front_axle + p.cg_to_rear_axle)
    u = [20.0, 0.3, 0.2, 0.0, 0.0, 0.0]
    eta = (u[1] + p.cg_to_front_axle * u[2]) / u[0]
    stiffness = p.cornering_stiffness_front
    unit.linear = p.steering_ratio * (eta + share * largest / stiffness)
    alpha = unit._hand(u) / p.steering_ratio - eta
    force = largest * (1.0 - (1.0 - stiffness * abs(alpha) / (3.0 * largest)) ** 3)
    assert math.copysign(force, alpha) == pytest.approx(max(min(share, MOST), -MOST) * largest, rel=1e-9)


def test_beside_a_straight_path_the_wheel_turns_back_to_it_within_its_limits():
    stand = Stand(OptimalPreview, lane_offset=0.0)
    limit = P().steering_wheel_rate_limit
    off = on_the_move(position_y=0.5)
    last = stand.start(**off)["steering_wheel_angle"]
    assert last == 0.0
    for _ in range(50):
        now = stand.step(0.01, **off)["steering_wheel_angle"]
        assert -limit * 0.01 - 1e-12 <= now - last <= 0.0
        last = now
    assert last < -0.5
    on = Stand(OptimalPreview, lane_offset=0.0)
    on.start(**on_the_move())
    assert on.step(0.01, **on_the_move())["steering_wheel_angle"] == 0.0

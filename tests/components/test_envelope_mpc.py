"""Envelope control: its program against scipy's optimizer on a simulated prediction, its tyre, its effect."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq, minimize

from yawbench.components.cars.single_track_car import SingleTrackCar
from yawbench.components.control_laws.brush_axle import BrushAxle
from yawbench.components.control_laws.envelope_law import Envelope, axles_of
from yawbench.components.controllers.envelope_mpc import EnvelopeMpc

from .stand import Stand

CAR = SingleTrackCar(1830.0, 3234.0, 1.4, 1.65, 81987.0, 94256.0)
HORIZON = {"step": 0.02, "moves": 5, "steps_per_move": 4}


def best(e: Envelope, *, unit: float, low: float, high: float, penalty: float) -> float:
    """Return the first input of least cost, by simulating the prediction and a general optimizer."""
    whole = np.zeros((4, 4))
    whole[:2, :2], whole[:2, 2], whole[:2, 3] = e.dynamics, e.drift, np.multiply(unit, e.push)
    phi = expm(whole * HORIZON["step"])
    rows, bounds = np.array(e.rows), np.array(e.bounds)

    def cost(z):
        state, total = np.array([*e.state, 1.0, 0.0]), 0.0
        for value in z:
            state[3] = value
            for _ in range(HORIZON["steps_per_move"]):
                state = phi @ state
            excess = np.maximum(np.abs(rows @ state[:2]) / bounds - 1.0, 0.0)
            total += value * value + penalty * excess @ excess
        return total

    limits = [(low / unit, high / unit)] * HORIZON["moves"]
    start = np.clip(np.zeros(HORIZON["moves"]), low / unit, high / unit)
    found = minimize(cost, start, bounds=limits, method="L-BFGS-B", options={"ftol": 1e-15, "gtol": 1e-9})
    return unit * found.x[0]


@pytest.mark.parametrize("steering", [True, False])
@pytest.mark.parametrize(
    ("beta", "r", "delta"), [(-0.12, 0.5, 0.05), (0.15, 0.1, -0.1), (-0.02, 0.55, 0.1), (0.2, -0.6, -0.08)]
)
def test_the_program_has_the_solution_of_a_general_optimizer(steering, beta, r, delta):
    axles = axles_of(CAR, 0.9)
    e = Envelope(CAR, axles, v=22.0, mu=0.9, beta=beta, r=r, delta=delta, steering=steering)
    force = axles[0].force(beta + CAR.a * r / 22.0 - delta)
    most = axles[0].grip
    limits = (most, -most - force, most - force) if steering else (5000.0, -5000.0, 5000.0)
    limits = dict(zip(("unit", "low", "high"), limits, strict=True)) | {"penalty": 300.0}
    first = e.first(**limits, **HORIZON)
    assert first == pytest.approx(best(e, **limits), abs=2e-3 * limits["unit"])
    assert limits["low"] - 1e-6 * most <= first <= limits["high"] + 1e-6 * most


def test_inside_the_envelope_the_driver_is_left_alone_and_outside_the_yaw_is_slowed():
    for actuation in ("steering", "moment"):
        stand = Stand(EnvelopeMpc, actuation=actuation)
        calm = {"yaw_rate": 0.1, "sideslip": 0.01, "steer_angle": 0.02, "velocity_x": 20.0, "friction": 0.9}
        assert set(stand.start(**calm).values()) == {0.0}
        spin = stand.step(0.005, **calm | {"yaw_rate": 0.8, "sideslip": -0.2})
        acting, idle = ("added_steer_angle_request", "yaw_moment")[:: 1 if actuation == "steering" else -1]
        assert spin[acting] < 0.0 == spin[idle]


def test_steering_by_the_program_brings_back_a_car_that_is_lost_without_it():
    """The car of the test has the law's own tyres; the driver holds a small angle."""
    front, rear = axles_of(CAR, 0.9)
    stand = Stand(
        EnvelopeMpc, mass=CAR.m, yaw_inertia=CAR.i_z, cg_to_front_axle=CAR.a, cg_to_rear_axle=CAR.b,
        cornering_stiffness_front=CAR.c_f, cornering_stiffness_rear=CAR.c_r, added_angle_limit=0.3,
    )  # fmt: skip
    v, delta = 30.0, 0.03
    stand.start(velocity_x=v)

    def motion(y, angle):
        f_f = front.force(y[0] + CAR.a * y[1] / v - angle)
        f_r = rear.force(y[0] - CAR.b * y[1] / v)
        return [(f_f + f_r) / (CAR.m * v) - y[1], (CAR.a * f_f - CAR.b * f_r) / CAR.i_z]

    def end(law) -> float:
        y = np.array([-0.14, 0.5])
        for _ in range(200):
            angle = delta + law(y)
            y = solve_ivp(lambda t, y, d=angle: motion(y, d), (0.0, 0.01), y).y[:, -1]
            if abs(y[0]) > 1.0:
                break
        return abs(y[0])

    assert end(lambda y: 0.0) > 0.3
    assert end(lambda y: stand.unit.output(0.0, [y[1], y[0], v, 0.9, delta])[1]) < 0.06


@pytest.mark.parametrize("force", [-8000.0, -500.0, 0.0, 3000.0])
def test_the_slip_angle_for_a_force_gives_it(force):
    axle = BrushAxle(80000.0, 9000.0)
    assert axle.force(axle.slip_for(force)) == pytest.approx(force, abs=1e-6)
    alpha = brentq(lambda alpha: axle.force(alpha) - force, -axle.sliding(), axle.sliding())
    assert axle.slip_for(force) == pytest.approx(alpha, abs=1e-9)
    step = 1e-6
    slope = (axle.force(alpha - step) - axle.force(alpha + step)) / (2.0 * step)
    assert axle.slope(alpha) == pytest.approx(slope, rel=1e-5)


def test_beyond_sliding_the_force_is_the_grip():
    axle = BrushAxle(80000.0, 9000.0)
    assert [axle.force(x) for x in (0.5, -0.5, 2.0)] == [-9000.0, 9000.0, -9000.0]
    assert axle.slip_for(20000.0) == pytest.approx(-axle.sliding())

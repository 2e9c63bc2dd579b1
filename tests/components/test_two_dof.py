"""The car with two degrees of freedom: linear theory, closed forms, symmetry, an independent solution."""

from __future__ import annotations

from functools import cache
from math import atan2, cos, log2, pi, sin

import numpy as np
import pytest

from tests.evidence import measured
from yawbench.components.cars.load_transfer import quasi_static_loads
from yawbench.components.drivers.sine import Sine
from yawbench.components.plants.two_dof import TwoDof, TwoDofParameters
from yawbench.components.tyre_models.bakker_1987 import (
    MagicFormula1987Parameters,
    coefficients_1987,
    loaded_tyre,
)
from yawbench.components.tyres.linear import LinearTyre
from yawbench.components.tyres.magic_formula_1987 import MagicFormula1987

from . import monolith
from .loop import Hold, drive_on
from .magic import forces_1987
from .stand import Stand, four, wheel_values

P = TwoDofParameters()
M, I_Z, A, B, D, H = P.mass, P.yaw_inertia, P.cg_to_front_axle, P.cg_to_rear_axle, P.track_width, P.cg_height
L = A + B
SPEED, G = 25.0, 9.81


def drive(tyre=MagicFormula1987, *, mu=0.5, until=3.0, h=1e-3, record, driver=None, **tyres):
    """Return the recorded signals (rows) of driver, car and tyre in a loop."""
    sine = Sine, {"amplitude": 0.05, "frequency": 0.5, "start_time": 0.5}
    return drive_on([driver or sine, (TwoDof, {}), (tyre, tyres)], until=until, h=h, record=record, mu=mu)


# ---- linear theory


def test_steady_state_yaw_rate_matches_the_understeer_formula():
    c = 40000.0  # per tyre
    record = ["yaw_rate", "sideslip"]
    r, beta = drive(
        LinearTyre,
        driver=(Hold, {"angle": 1e-4}),
        until=8.0,
        h=4e-3,
        record=record,
        cornering_stiffness=c,
    )[:, -1]
    k = M / L**2 * (B - A) / (2 * c)
    gain = 1e-4 / (L * (1 + k * SPEED**2))
    assert r == pytest.approx(SPEED * gain, rel=1e-6)
    assert beta == pytest.approx((B - M * A * SPEED**2 / (2 * c * L)) * gain, rel=1e-6)


# ---- closed forms


def test_under_a_yaw_moment_alone_the_car_turns_with_the_moment_over_its_inertia():
    stand = Stand(TwoDof)
    stand.start()
    for _ in range(100):
        y = stand.step(0.01, yaw_moment=1000.0)
    assert y["yaw_rate"] == pytest.approx(1000.0 / I_Z, rel=1e-12)
    assert y["yaw_angle"] == pytest.approx(500.0 / I_Z, rel=1e-12)
    # No force: dv_y/dt = -v_x r.
    assert y["velocity_y"] == pytest.approx(-SPEED * 500.0 / I_Z, rel=1e-12)
    assert y["velocity_x"] == SPEED


def test_a_steered_front_force_has_a_part_along_the_track():
    stand = Stand(TwoDof)
    stand.start(steer_angle=0.3)
    y = stand.step(0.01, tyre_force_y_fl=500.0)
    moment = 500.0 * (A * cos(0.3) + 0.5 * D * sin(0.3))
    assert y["yaw_rate"] == pytest.approx(0.01 * moment / I_Z, rel=1e-12)


def test_longitudinal_tyre_forces_do_nothing():
    one, other = Stand(TwoDof), Stand(TwoDof)
    one.start(steer_angle=0.1)
    other.start(steer_angle=0.1)
    assert one.step(0.01, **four("tyre_force_x", -900.0)) == other.step(0.01)


def test_wheel_loads_carry_the_moment_of_the_lateral_acceleration_and_no_more():
    stand = Stand(TwoDof)
    y = stand.start(**four("tyre_force_y", 1000.0, 1200.0, 900.0, 1100.0))
    fl, fr, rl, rr = wheel_values(y, "vertical_load")
    assert fl + fr == pytest.approx(M * G * B / L, rel=1e-14)
    assert rl + rr == pytest.approx(M * G * A / L, rel=1e-14)
    assert 0.5 * D * (fr - fl + rr - rl) == pytest.approx(4200.0 * H, rel=1e-12)
    assert (fl, fr, rl, rr) == pytest.approx(quasi_static_loads(0.0, 4200.0 / M, P))


def test_a_wheel_that_lifts_leaves_its_load_to_the_other():
    y = Stand(TwoDof, cg_height=1.2).start(**four("tyre_force_y", 4500.0))
    assert (y["vertical_load_fl"], y["vertical_load_rl"]) == (0.0, 0.0)
    assert y["vertical_load_fr"] == pytest.approx(M * G * B / L)


# ---- an independent solution


@cache
def exact(mu, until=3.0):
    """v_y, r, x, y, psi (rows) every 4 ms: equations (1), (2) with the load loop solved, by scipy."""
    c = coefficients_1987(MagicFormula1987Parameters())
    places = ((A, D / 2), (A, -D / 2), (-B, D / 2), (-B, -D / 2))

    def derivatives(t, state):
        v_y, r, _, _, psi = state
        delta = 0.05 * sin(pi * (t - 0.5)) if 0.5 < t < 2.5 else 0.0
        angles = (delta, delta, 0.0, 0.0)
        a_y = 0.0
        for _ in range(200):
            y = moment = 0.0
            shift = M * H * a_y / (L * D)
            loads = [M * G * B / (2 * L) - B * shift, M * G * B / (2 * L) + B * shift]
            loads += [M * G * A / (2 * L) - A * shift, M * G * A / (2 * L) + A * shift]
            for (x, side), angle, load in zip(places, angles, loads, strict=True):
                alpha = atan2(v_y + r * x, SPEED - r * side) - angle
                f_y = forces_1987(0.0, alpha, loaded_tyre(load, mu, c))[1]
                y += f_y * cos(angle)
                moment += x * f_y * cos(angle) + side * f_y * sin(angle)
            if abs(y / M - a_y) < 1e-13:
                break
            a_y = y / M
        return [
            a_y - SPEED * r,
            moment / I_Z,
            SPEED * cos(psi) - v_y * sin(psi),
            SPEED * sin(psi) + v_y * cos(psi),
            r,
        ]

    times = np.linspace(0.0, until, round(until / 4e-3) + 1)
    return monolith.pieces(derivatives, np.zeros(5), times, kinks=[0.5, 2.5], tolerance=1e-10, scale=0.1)


def errors(h, mu=0.5):
    record = ["velocity_y", "yaw_rate", "position_x", "position_y", "yaw_angle"]
    found = drive(record=record, mu=mu, h=h)[:, :: round(4e-3 / h)]
    return np.abs(found - exact(mu)).max(axis=1) / np.abs(exact(mu)).max(axis=1)


def test_the_coupled_car_agrees_with_an_independent_solution_to_second_order():
    coarse, fine = errors(4e-3), errors(1e-3)
    assert np.abs(exact(0.5)[1]).max() * SPEED > 4.0  # near the limit of 4.9 m/s2
    car, scipy = "plant_two_dof, tyre_magic_formula_1987", "scipy, one system of equations"
    measured("cars", car, scipy, fine.max(), at_most=1e-4)
    measured("order", f"`extrapolated`, {car}", scipy, log2(coarse[1] / fine[1]) / 2, at_least=1.8)

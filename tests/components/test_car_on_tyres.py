"""Driver, 7-DOF car and tyres in a loop: against linear theory, an independent solution, common sense."""

from __future__ import annotations

from functools import cache
from math import log2

import numpy as np
import pytest

from tests.evidence import measured
from yawbench.components.drivers.sine import Sine
from yawbench.components.plants.seven_dof import SevenDof, SevenDofParameters
from yawbench.components.tyres.dugoff import Dugoff
from yawbench.components.tyres.linear import LinearTyre
from yawbench.vocabulary.wheels import WHEELS

from . import monolith
from .loop import Hold, drive_on
from .stand import four

pytestmark = pytest.mark.sampled(1)

P = SevenDofParameters()
A, B, M, I_Z = P.cg_to_front_axle, P.cg_to_rear_axle, P.mass, P.yaw_inertia
C_F = C_R = 100000.0
L = A + B
SPEED = 25.0


def drive(units, *, mu=0.65, until=6.0, read=("yaw_rate",), **more):
    return drive_on(units, until=until, record=read, mu=mu, **more).T


# ---- linear theory


@pytest.mark.parametrize("speed", [10.0, 25.0, 40.0])
def test_steady_state_yaw_rate_and_sideslip_match_the_understeer_formulas(speed):
    units = [(Hold, {}), (SevenDof, {"initial_speed": speed}), (LinearTyre, {})]
    read = ("yaw_rate", "sideslip", "velocity_x")
    r, beta, v = drive(units, until=5.0, h=0.002, read=read)[-1]
    k = M / L**2 * (B / C_F - A / C_R)
    gain = 1e-4 / (L * (1.0 + k * v * v))
    assert k > 0.0
    assert r == pytest.approx(v * gain, rel=1e-6)
    assert beta == pytest.approx((B - M * A * v * v / (C_R * L)) * gain, rel=1e-5)


# ---- an independent solution of the same equations


SCIPY = "scipy, one system of equations"


@cache
def exact(start, until=6.0, step=0.004):
    """The monolithic solution for one period of 0.05 rad at 0.25 Hz from `start` [s], every 4 ms."""
    times = np.linspace(0.0, until, round(until / step) + 1)
    steer = monolith.sine(0.05, 0.25, start, 1.0)
    return monolith.solve(times, steer=steer, speed=SPEED, mu=[0.65] * 4, kinks=[start, start + 4.0])


FURTHER = ["acceleration_x", "acceleration_y", *(f"vertical_load_{w}" for w in WHEELS)]
FURTHER += ["position_x", "position_y", "yaw_angle", *(f"wheel_speed_{w}" for w in WHEELS)]


@cache
def sine_run(algorithm, h, start):
    """Return yaw rate, sideslip and what is read further, every 4 ms."""
    sine = {"amplitude": 0.05, "frequency": 0.25, "start_time": start}
    units = [(Sine, sine), (SevenDof, {"initial_speed": SPEED}), (Dugoff, {})]
    found = drive(units, algorithm=algorithm, h=h, read=("yaw_rate", "sideslip", *FURTHER))
    return found[:: round(0.004 / h)]


def errors(algorithm, h, start):
    """Return the largest errors of yaw rate and sideslip, relative to their peaks."""
    v_x, v_y, r = exact(start)[:3]
    found = sine_run(algorithm, h, start)
    beta = np.arctan2(v_y, v_x)
    return tuple(np.abs(found[:, i] - y).max() / np.abs(y).max() for i, y in enumerate((r, beta)))


@pytest.mark.parametrize("start", [0.5, 0.0])
def test_extrapolated_is_within_a_ten_thousandth_of_the_exact_solution_at_1_ms(start):
    found = max(errors("extrapolated", 0.001, start))
    measured("cars", f"plant_seven_dof, tyre_dugoff, sine from {start} s", SCIPY, found, at_most=1e-4)


@pytest.mark.parametrize("start", [0.5, 0.0])
def test_extrapolated_is_of_second_order(start):
    orders = []
    for coarse, fine in zip(
        errors("extrapolated", 0.004, start), errors("extrapolated", 0.001, start), strict=True
    ):
        orders.append(log2(coarse / fine) / 2)
    assert max(orders) < 2.1
    measured("order", f"`extrapolated`, sine from {start} s", SCIPY, min(orders), at_least=1.9)


@pytest.mark.parametrize("algorithm", ["gauss_seidel", "jacobi"])
def test_held_inputs_are_of_first_order(algorithm):
    pairs = zip(errors(algorithm, 0.002, 0.5), errors(algorithm, 0.001, 0.5), strict=True)
    orders = [log2(coarse / fine) for coarse, fine in pairs]
    assert max(orders) < 1.1
    measured("order", f"`{algorithm}`, held inputs", SCIPY, min(orders), at_least=0.9)


def test_wheel_loads_accelerations_and_path_are_of_second_order_too():
    start = 0.5
    solution = exact(start)
    steer = monolith.sine(0.05, 0.25, start, 1.0)
    times = np.linspace(0.0, 6.0, solution.shape[1])[::25]
    balances = [
        monolith.balance(x, steer(t), [0.65] * 4) for x, t in zip(solution.T[::25], times, strict=True)
    ]
    expected = np.array([[b[0], b[1], *b[4]] for b in balances])
    expected = np.column_stack([expected, solution[3:6].T[::25], solution[6:10].T[::25]])
    worst = {}
    for h in (0.004, 0.001):
        found = sine_run("extrapolated", h, start)[::25, 2:]
        worst[h] = np.abs(found - expected).max(axis=0) / np.abs(expected).max(axis=0)
    for name, coarse, fine in zip(FURTHER, worst[0.004], worst[0.001], strict=True):
        assert fine < 4e-4, name
        assert log2(coarse / fine) / 2 > 1.8, name


# ---- common sense


def test_the_mirrored_manoeuvre_gives_the_mirrored_motion_to_the_last_bit():
    def run(sign):
        sine = {"amplitude": sign * 0.06, "frequency": 0.5, "start_time": 0.1}
        units = [(Sine, sine), (SevenDof, {"initial_speed": SPEED}), (Dugoff, {})]
        return drive(units, until=1.5, read=("yaw_rate", "sideslip", "velocity_x", "position_y"))

    left, right = run(1.0), run(-1.0)
    difference = np.abs(left - right * [-1.0, -1.0, 1.0, -1.0]).max()
    measured("mirror", "plant_seven_dof, tyre_dugoff, a sine", "its mirror image", difference, at_most=0.0)
    assert np.abs(left[:, 0]).max() > 0.3


def test_freely_rolling_cornering_only_ever_loses_energy():
    read = ("velocity_x", "velocity_y", "yaw_rate", *(f"wheel_speed_{w}" for w in WHEELS))
    sine = {"amplitude": 0.08, "frequency": 0.4, "start_time": 0.1}
    found = drive([(Sine, sine), (SevenDof, {"initial_speed": SPEED}), (Dugoff, {})], until=3.0, read=read)
    weights = 0.5 * np.array([M, M, I_Z, *[P.wheel_inertia] * 4])
    energy = (found**2) @ weights
    gained = max(np.diff(energy).max() / energy[0], 0.0)
    measured("energy", "plant_seven_dof, tyre_dugoff", "rolling freely, only lost", gained, at_most=1e-7)
    assert energy[-1] < 0.98 * energy[0]


def test_loads_stay_calm_when_locked_rear_wheels_brake_on_dry_road():
    units = [(Hold, {"angle": 0.0}), (SevenDof, {"initial_speed": SPEED, "cg_height": 0.9}), (Dugoff, {})]
    torque = {"wheel_torque_rl": -2000.0, "wheel_torque_rr": -2000.0}
    a_x = drive(units, mu=1.2, until=1.0, read=("acceleration_x",), **torque)[:, 0]
    assert np.abs(np.diff(a_x[-300:])).max() < 1e-9
    # (m + 2 J / R^2) a_x = -mu F_zr with F_zr = m g a / L + m h a_x / L; the front wheels roll freely
    inertia = M + 2 * P.wheel_inertia / P.wheel_radius**2
    assert a_x[-1] == pytest.approx(-1.2 * M * 9.81 * A / (inertia * L + 1.2 * M * 0.9), rel=3e-4)


def test_driving_off_from_rest_gives_the_acceleration_of_the_torque():
    units = [(Hold, {"angle": 0.0}), (SevenDof, {"initial_speed": 0.0}), (Dugoff, {})]
    torque = four("wheel_torque", 100.0)
    v, w = drive(units, mu=0.8, until=4.0, h=0.002, read=("velocity_x", "wheel_speed_fl"), **torque)[-1]
    inertia = M + 4 * P.wheel_inertia / P.wheel_radius**2
    assert v == pytest.approx(4.0 * 400.0 / P.wheel_radius / inertia, rel=0.01)
    assert w * P.wheel_radius == pytest.approx(v, rel=0.02)

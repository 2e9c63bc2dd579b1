"""The 7-DOF car alone, under forces given from outside."""

from __future__ import annotations

from math import cos, sin

import numpy as np
import pytest

from yawbench.components.cars.load_transfer import quasi_static_loads
from yawbench.components.plants.seven_dof import SevenDof, SevenDofParameters

from .stand import Stand, four, wheel_values

P = SevenDofParameters()
WEIGHT = P.mass * 9.81
L = P.cg_to_front_axle + P.cg_to_rear_axle


def car(**parameters):
    return Stand(SevenDof, **parameters)


def pushed(f_x=(0, 0, 0, 0), f_y=(0, 0, 0, 0), torque=(0, 0, 0, 0), delta=0.0):
    return {
        "steer_angle": delta,
        **four("tyre_force_x", *map(float, f_x)),
        **four("tyre_force_y", *map(float, f_y)),
        **four("wheel_torque", *map(float, torque)),
    }


HARD = pushed((300, -200, 150, -90), (-2000, -3000, -1500, -2500), (80, -60, 40, -20), 0.04)


def kinetic_energy(y, p=P):
    body = (
        0.5 * p.mass * (y["velocity_x"] ** 2 + y["velocity_y"] ** 2)
        + 0.5 * p.yaw_inertia * y["yaw_rate"] ** 2
    )
    return body + sum(0.5 * p.wheel_inertia * w**2 for w in wheel_values(y, "wheel_speed"))


# ---- rest and straight running


def test_the_start_may_be_computed_again_and_again_until_forces_and_loads_agree():
    stand = car(initial_speed=20.0)
    stand.set(**HARD)
    stand.unit.enter_initialization_mode()
    stand.set(**pushed(f_y=(0, 0, 0, -400)))
    first = stand.outputs()
    stand.set(**HARD)
    stand.outputs()
    stand.set(**pushed(f_y=(0, 0, 0, -400)))
    assert stand.outputs() == first
    stand.unit.exit_initialization_mode()
    assert stand.outputs() == first == car(initial_speed=20.0).start(**pushed(f_y=(0, 0, 0, -400)))


# ---- conservation


def test_work_of_tyre_forces_and_torques_is_the_change_of_kinetic_energy_with_the_wheels():
    stand = car(initial_speed=15.0, initial_yaw_rate=0.3)
    before = stand.start(**HARD)
    first = kinetic_energy(before)
    h, steps, work = 1e-4, 5000, 0.0

    def power(y):
        a, b, half, delta = P.cg_to_front_axle, P.cg_to_rear_axle, 0.5 * P.track_width, 0.04
        total = 0.0
        for wheel, x, side, steer in (
            ("fl", a, half, delta), ("fr", a, -half, delta), ("rl", -b, half, 0.0), ("rr", -b, -half, 0.0)
        ):  # fmt: skip
            u, v = y["velocity_x"] - y["yaw_rate"] * side, y["velocity_y"] + y["yaw_rate"] * x
            f_x, f_y = HARD[f"tyre_force_x_{wheel}"], HARD[f"tyre_force_y_{wheel}"]
            w = y[f"wheel_speed_{wheel}"]
            total += f_x * (u * cos(steer) + v * sin(steer) - w * P.wheel_radius)
            total += f_y * (v * cos(steer) - u * sin(steer)) + HARD[f"wheel_torque_{wheel}"] * w
        return total

    last = power(before)
    for _ in range(steps):
        y = stand.step(h, **HARD)
        now = power(y)
        work += 0.5 * h * (last + now)
        last = now
    assert abs(kinetic_energy(y) - first) > 1e4
    assert kinetic_energy(y) - first == pytest.approx(work, rel=1e-7)


# ---- wheel loads


def test_the_loads_always_add_up_to_the_weight():
    for a_x, a_y in np.random.default_rng(2).uniform(-40, 40, (500, 2)):
        loads = quasi_static_loads(a_x, a_y, P)
        assert sum(loads) == pytest.approx(WEIGHT, rel=1e-14)
        assert min(loads) >= 0.0


def test_a_wheel_lifts_at_the_rollover_limit_and_the_other_then_carries_its_axle():
    limit = 9.81 * P.track_width / (2 * P.cg_height)
    assert min(quasi_static_loads(0.0, 0.999 * limit, P)) > 0.0
    fl, fr, rl, rr = quasi_static_loads(0.0, 1.001 * limit, P)
    assert (fl, rl) == (0.0, 0.0)
    assert fr == pytest.approx(WEIGHT * P.cg_to_rear_axle / L)
    assert rr == pytest.approx(WEIGHT * P.cg_to_front_axle / L)


def test_an_axle_lifts_under_extreme_braking_and_the_other_carries_the_car():
    assert quasi_static_loads(-100.0, 0.0, P) == pytest.approx((WEIGHT / 2, WEIGHT / 2, 0.0, 0.0))
    assert quasi_static_loads(100.0, 0.0, P) == pytest.approx((0.0, 0.0, WEIGHT / 2, WEIGHT / 2))


@pytest.mark.parametrize("steps", [(0.001,) * 6, (0.001, 0.004, 0.002, 0.0005, 0.003), (0.01, 0.0001, 0.02)])
def test_accelerations_that_grow_linearly_are_carried_to_the_end_of_any_step_exactly(steps):
    stand = car()
    t = 0.0
    stand.start(**pushed(f_y=(100, 100, 100, 100)))
    for h in steps:
        force = 100.0 + 5000.0 * (t + 0.5 * h)  # at the middle of the step
        y = stand.step(h, **pushed(f_y=(force,) * 4))
        t += h
        assert y["acceleration_y"] == pytest.approx(4 * (100.0 + 5000.0 * t) / P.mass, rel=1e-12)


def test_steering_during_the_step_is_right_to_at_least_the_third_power_of_the_step():
    def error(h):
        one, many = car(initial_speed=25.0), car(initial_speed=25.0)
        start = {**HARD, "steer_angle": 0.0}
        one.start(**start)
        many.start(**start)
        whole = one.step(h, **{**HARD, "steer_angle": 4.0 * h})
        for k in range(1, 101):
            fine = many.step(h / 100, **{**HARD, "steer_angle": 4.0 * h * k / 100})
        return abs(whole["velocity_x"] - fine["velocity_x"]), abs(whole["velocity_y"] - fine["velocity_y"])

    for coarse, fine in zip(error(0.01), error(0.005), strict=True):
        assert fine < 2e-6
        assert coarse / fine > 7.0


def test_a_step_of_no_length_moves_nothing():
    stand = car()
    stand.start(**HARD)
    before = stand.step(0.001, **HARD)
    assert stand.step(0.0, **HARD) == before

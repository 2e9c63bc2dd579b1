"""The wheel's own equation: against its exact solution, at any stiffness, to standstill."""

from __future__ import annotations

from math import exp

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from yawbench.components.cars.wheel_spin import spin

R, J, LOW = 0.31, 2.0, 0.5
WHEEL = {"radius": R, "inertia": J, "stiffness": 0.0, "v_low": LOW, "resistance": 0.0}


def slip(w, v):
    return (w * R - v) / max(abs(w * R), abs(v), LOW)


def linear(w, v, stiffness, offset=0.0, at=None):
    """Return what a tyre F_x = C kappa + offset says at a slip `at` (its own if None)."""
    at = slip(w, v) if at is None else at
    return {"f_x": stiffness * at + offset, "slip_stiffness": stiffness, "tyre_slip": at}


@pytest.mark.parametrize("h", [1e-4, 1e-3, 0.01, 0.3])
@pytest.mark.parametrize("at", [None, -0.3, 0.0, 0.2])
def test_a_linear_tyre_at_constant_speed_is_solved_exactly_whatever_the_step(h, at):
    w, v, stiffness, torque = 60.0, 20.0, 8e4, -300.0  # the slip stays below zero: braking
    found = spin(w, h, torque=torque, v=v, v_end=v, **linear(w, v, stiffness, at=at), **WHEEL)
    rate = stiffness * R * R / (J * v)
    rest = v / R + torque * v / (stiffness * R * R)
    assert found == pytest.approx(rest + (w - rest) * exp(-rate * h), rel=1e-12)


def test_where_the_force_was_taken_does_not_matter_if_the_tyre_is_linear():
    ends = [
        spin(60.0, 2e-3, torque=200.0, v=19.0, v_end=18.9, **linear(60.0, 19.0, 7e4, at=at), **WHEEL)
        for at in (None, -0.5, 0.4)
    ]
    assert ends[0] == pytest.approx(ends[1], rel=1e-13) == pytest.approx(ends[2], rel=1e-13)


CASES = [
    pytest.param(60.0, 20.0, -5.0, -400.0, id="braking"),
    pytest.param(75.0, 20.0, 3.0, 400.0, id="driving"),
    pytest.param(1.0, 0.2, -0.6, 10.0, id="below the low speed"),
    pytest.param(-60.0, -20.0, 4.0, 0.0, id="backwards"),
    pytest.param(-75.0, -20.0, 4.0, -50.0, id="backwards, spinning"),
    pytest.param(30.0, 0.1, 1.0, 100.0, id="spinning on the spot"),
]


@pytest.mark.parametrize("w, v, acceleration, torque", CASES)
def test_one_step_on_a_real_tyre_is_right_to_the_third_power_of_the_step(w, v, acceleration, torque):
    def force(kappa):
        return 4000.0 * np.tanh(12.0 * kappa)

    def error(h):
        friction = -torque if torque < 0.0 and w < 0.0 else torque
        # What a second-order master hands over: force, slope and slip in the middle of the step.
        middle, exact = solve_ivp(
            lambda t, y: [(friction - R * force(slip(y[0], v + acceleration * t))) / J],
            (0.0, h),
            [w],
            t_eval=(h / 2, h),
            rtol=1e-12,
            atol=1e-12,
        ).y[0]
        kappa = slip(middle, v + acceleration * h / 2)
        found = spin(
            w,
            h,
            torque=torque,
            f_x=force(kappa),
            slip_stiffness=48000.0 / np.cosh(12.0 * kappa) ** 2,
            tyre_slip=kappa,
            v=v,
            v_end=v + acceleration * h,
            **WHEEL,
        )
        return abs(found - exact)

    longest = 0.1 * J * max(abs(w * R), abs(v), LOW) / (48000.0 * R * R)  # a tenth of the slip's own time
    coarse, fine = error(longest), error(longest / 2)
    assert fine < 2e-5
    assert coarse < 1e-11 or coarse / fine > 6.5


@pytest.mark.parametrize("v, h", [(20.0, 0.05), (1.0, 1e-3), (0.0, 1e-3), (0.3, 0.1)])
def test_a_stiff_wheel_goes_to_the_slip_that_balances_the_torque(v, h):
    stiffness, torque = 5e5, 60.0
    w = v / R
    for _ in range(40):
        w = spin(w, h, torque=torque, v=v, v_end=v, **linear(w, v, stiffness), **WHEEL)
    assert stiffness * slip(w, v) * R == pytest.approx(torque, rel=1e-6)


def test_a_slowing_car_takes_its_stiff_wheel_along_at_the_slip_of_the_whole_equation():
    stiffness, torque, v, deceleration, h = 8e4, -600.0, 1.5, 5.0, 1e-3
    w = v / R
    for _ in range(150):
        told = linear(w, v, stiffness)
        w = spin(w, h, torque=torque, v=v, v_end=v - deceleration * h, **told, **WHEEL)
        v -= deceleration * h
    # J dw/dt = T - F R with dw/dt = (1 + kappa) dv/dt / R and the slip steady
    balance = (torque + J * deceleration * (1 + slip(w, v)) / R) / R
    assert stiffness * slip(w, v) == pytest.approx(balance, rel=1e-3)


@pytest.mark.parametrize("torque", [0.0, -200.0])
@pytest.mark.parametrize(
    "w, v, v_end", [(60.0, 20.0, 19.9), (70.0, 20.0, 20.1), (0.5, 0.2, 0.19), (0.0, 3.0, 2.9)]
)
def test_driving_backwards_is_the_mirror_of_driving_forwards(w, v, v_end, torque):
    there = spin(w, 1e-3, torque=torque, v=v, v_end=v_end, **linear(w, v, 8e4, 100.0), **WHEEL)
    back = spin(-w, 1e-3, torque=torque, v=-v, v_end=-v_end, **linear(-w, -v, 8e4, -100.0), **WHEEL)
    assert back == -there


def test_a_brake_stops_the_wheel_and_does_not_reverse_it():
    for w in (3.0, -3.0, 1e-9):
        assert spin(w, 0.01, torque=-5000.0, v=0.0, v_end=0.0, **linear(w, 0.0, 1e3), **WHEEL) == 0.0


def test_resistance_slows_a_wheel_either_way_holds_it_at_rest_and_never_turns_it_back():
    resisting = WHEEL | {"f_x": 0.0, "v": 0.0, "v_end": 0.0, "resistance": 20.0}
    for sign in (1.0, -1.0):
        assert spin(sign, 0.01, torque=0.0, **resisting) == pytest.approx(0.9 * sign, rel=1e-14)
        assert spin(0.05 * sign, 0.01, torque=0.0, **resisting) == 0.0
    assert spin(1.0, 0.01, torque=50.0, **resisting) == pytest.approx(1.15, rel=1e-14)
    assert spin(1.0, 0.01, torque=-50.0, **resisting) == pytest.approx(0.65, rel=1e-14)
    assert spin(0.0, 0.01, torque=15.0, **resisting) == 0.0
    assert spin(0.0, 0.01, torque=25.0, **resisting) == pytest.approx(0.025, rel=1e-14)


def test_a_locked_wheel_stays_locked_until_the_tyre_overcomes_the_brake():
    told = {"f_x": -3000.0, "slip_stiffness": 10.0, "tyre_slip": -1.0}  # 930 N.m
    assert spin(0.0, 1e-3, torque=-1000.0, v=10.0, v_end=10.0, **told, **WHEEL) == 0.0
    found = spin(0.0, 1e-3, torque=-900.0, v=10.0, v_end=10.0, **told, **WHEEL)
    assert found == pytest.approx(1e-3 * 30.0 / J, rel=1e-3)


@pytest.mark.parametrize("stiffness", [0.0, -5000.0])
def test_without_a_positive_stiffness_the_force_is_held(stiffness):
    found = spin(
        60.0,
        1e-3,
        torque=100.0,
        f_x=500.0,
        v=20.0,
        v_end=20.0,
        slip_stiffness=stiffness,
        tyre_slip=0.3,
        **WHEEL,
    )
    assert found == pytest.approx(60.0 + 1e-3 * (100.0 - 500.0 * R) / J, rel=1e-14)


def test_nothing_is_ever_undefined():
    random = np.random.default_rng(11)
    for _ in range(3000):
        w, v, change = random.uniform(-1, 1, 3) * 10.0 ** random.uniform(-8, 2, 3)
        found = spin(
            w,
            10.0 ** random.uniform(-5, 0),
            torque=random.uniform(-1, 1) * 1e4,
            f_x=random.uniform(-1, 1) * 1e4,
            v=v,
            v_end=random.choice([v, v + change, -v, 0.0]),
            slip_stiffness=10.0 ** random.uniform(-3, 7),
            tyre_slip=random.uniform(-2, 2),
            **WHEEL,
        )
        assert np.isfinite(found)

"""Actuators: torque from force, motors and brakes that lag and are limited, added steering."""

from __future__ import annotations

from math import exp

import pytest

from yawbench.components.actuators.lag import Lag, blend
from yawbench.components.mathematics.first_order_lag import relax
from yawbench.components.steering_actuators.superposition import Superposition
from yawbench.components.wheel_controls.direct import Direct

from .stand import Stand, four


def request(value: float) -> dict[str, float]:
    return four("torque_request", value)


def response(value: float, *, h: float, until: float, **parameters: float) -> list[tuple[float, dict]]:
    """Return (time, outputs) after each step of a request held from the start."""
    stand = Stand(Lag, **parameters)
    stand.start()
    results = []
    for k in range(round(until / h)):
        y = stand.step(h, **request(value))
        results.append(((k + 1) * h, y))
    return results


@pytest.mark.parametrize("h", [1e-3, 0.7e-3, 5e-3])
def test_the_motors_step_response_is_a_delayed_exponential(h):
    for t, y in response(500.0, h=h, until=0.07, motor_delay=0.0033):
        late = max(t - 0.0033, 0.0)
        assert y["motor_torque_fl"] == pytest.approx(500.0 * (1 - exp(-late / 0.015)), abs=1e-9)
        assert y["wheel_torque_rr"] == y["motor_torque_fl"]
        assert y["brake_torque_fl"] == 0.0


@pytest.mark.parametrize("h", [1e-3, 4e-3])
def test_the_brakes_step_response_is_a_delayed_exponential(h):
    for t, y in response(-1800.0, h=h, until=0.4):
        late = max(t - 0.015, 0.0)
        assert y["brake_torque_rl"] == pytest.approx(-1000.0 * (1 - exp(-late / 0.08)), abs=1e-9)


def test_a_delay_that_is_no_multiple_of_the_step_is_kept_to_the_last_digit():
    for t, y in response(100.0, h=1e-3, until=0.02, motor_delay=0.01037, motor_time_constant=0.0):
        assert y["motor_torque_fl"] == (100.0 if t > 0.01037 else 0.0)


@pytest.mark.parametrize(
    "asked, motor, brake",
    [
        (300.0, 300.0, 0.0),
        (2000.0, 800.0, 0.0),
        (-300.0, -300.0, 0.0),
        (-1000.0, -800.0, -200.0),
        (-9000.0, -800.0, -2500.0),
        (0.0, 0.0, 0.0),
    ],
)
def test_the_motor_takes_what_it_can_and_friction_the_rest(asked, motor, brake):
    assert blend(asked, 800.0, 2500.0) == (motor, brake)
    _, y = response(asked, h=0.01, until=3.0)[-1]
    assert y["motor_torque_fr"] == pytest.approx(motor, abs=1e-9)
    assert y["brake_torque_fr"] == pytest.approx(brake, abs=1e-9)
    assert y["wheel_torque_fr"] == pytest.approx(motor + brake, abs=1e-9)


def test_a_rate_limit_is_a_straight_line_until_the_lag_is_slower():
    tau, rate, target = 0.08, 5000.0, -1000.0
    line = (1000.0 - rate * tau) / rate
    assert relax(0.0, target, line / 2, tau=tau, rate=rate) == pytest.approx(-rate * line / 2)
    for h in (line, 0.2, 0.5):
        expected = target + rate * tau * exp(-(h - line) / tau)
        assert relax(0.0, target, h, tau=tau, rate=rate) == pytest.approx(expected, rel=1e-12)
    assert relax(0.0, target, 1.0, tau=0.0, rate=rate) == target


def test_the_torque_never_changes_faster_than_its_limit():
    last = 0.0
    for _, y in response(-5000.0, h=1e-3, until=0.3, brake_rate_limit=10000.0):
        assert abs(y["brake_torque_fl"] - last) <= 10.0 + 1e-9
        last = y["brake_torque_fl"]
    assert last < -2000.0


def test_wheels_are_independent_and_alike():
    stand = Stand(Lag)
    stand.start()
    for k in range(40):
        y = stand.step(
            1e-3, torque_request_fl=100.0 * k, torque_request_rr=100.0 * k, torque_request_fr=-50.0
        )
    assert y["wheel_torque_fl"] == y["wheel_torque_rr"] > 0.0
    assert y["wheel_torque_fr"] < 0.0
    assert y["wheel_torque_rl"] == 0.0


def test_actuators_start_without_torque():
    y = Stand(Lag).start(**request(-500.0))
    assert set(y.values()) == {0.0}


def test_old_requests_are_forgotten():
    stand = Stand(Lag)
    stand.start()
    for k in range(2000):
        stand.step(1e-3, **request(float(k % 7)))
    assert len(stand.unit.brakes[0].history) <= 20
    assert len(stand.unit.motors[0].history) <= 6


def torques(*forces, **parameters):
    stand = Stand(Direct, **parameters)
    inputs = dict(zip(("fl", "fr", "rl", "rr"), forces, strict=True))
    return list(stand.start(**{f"force_request_{w}": f for w, f in inputs.items()}).values())


def test_torque_is_force_times_radius():
    assert torques(100.0, -200.0, 0.0, 1000.0, wheel_radius=0.25) == [25.0, -50.0, 0.0, 250.0]


def test_torque_stops_at_the_limit_on_both_sides_of_zero():
    assert torques(1e5, -1e5, 401.0, -401.0, wheel_radius=1.0) == [400.0, -400.0, 400.0, -400.0]
    assert torques(1e5, -1e5, 1.0, -1.0, torque_limit=0.0) == [0.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize("h", [1e-3, 5e-3])
def test_the_added_angle_is_a_delayed_exponential(h):
    stand = Stand(Superposition, rate_limit=100.0, delay=0.0033)
    stand.start()
    for k in range(40):
        y = stand.step(h, steer_angle=0.1, added_steer_angle_request=0.02)
        late = max((k + 1) * h - 0.0033, 0.0)
        assert y["added_steer_angle"] == pytest.approx(0.02 * (1.0 - exp(-late / 0.016)), abs=1e-12)
        assert y["total_steer_angle"] == 0.1 + y["added_steer_angle"]


def test_without_a_request_the_total_is_the_drivers_angle_to_the_last_bit():
    stand = Stand(Superposition)
    stand.start(steer_angle=0.123)
    for k in range(20):
        assert stand.step(1e-3, steer_angle=0.01 * k / 7.0)["total_steer_angle"] == 0.01 * k / 7.0


def test_rate_and_range_hold():
    stand = Stand(Superposition, rate_limit=0.5, range=0.05)
    stand.start()
    before = 0.0
    for _ in range(200):
        added = stand.step(1e-3, added_steer_angle_request=1.0)["added_steer_angle"]
        assert added - before <= 0.5e-3 * (1.0 + 1e-9)
        before = added
    assert before == pytest.approx(0.05, abs=1e-5)

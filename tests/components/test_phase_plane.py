"""The stable strip of sideslip and its rate, and the laws that use it, against a car integrated by scipy."""

from __future__ import annotations

from math import atan, radians, tan, tanh

import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from yawbench.components.control_laws.phase_plane import PhasePlaneParameters, excess
from yawbench.components.controllers.phase_plane import PhasePlane
from yawbench.components.controllers.steering_and_braking import SteeringAndBraking, within_grip

from .stand import Stand

M, I_Z, A, B, C_F, C_R = 1830.0, 3234.0, 1.4, 1.65, 81987.0, 94256.0  # the car `hard`
STRIP = PhasePlaneParameters()


def settles(
    beta: float, rate: float, *, mu: float = 0.9, v: float = 22.2, moment=lambda beta, rate: 0.0
) -> bool:
    """Return whether a car on two tyres that saturate, straight steered, comes back to its course."""

    def axle(alpha: float, c: float, load: float) -> float:
        return -mu * load * tanh(c * tan(alpha) / (mu * load))

    def forces(beta: float, r: float) -> tuple[float, float]:
        weight = 9.81 * M / (A + B)
        return axle(atan(beta + A * r / v), C_F, weight * B), axle(atan(beta - B * r / v), C_R, weight * A)

    def slope(beta: float, r: float) -> float:
        return sum(forces(beta, r)) / (M * v) - r

    def motion(t: float, y) -> list[float]:
        front, rear = forces(*y)
        return [slope(*y), (A * front - B * rear + moment(y[0], slope(*y))) / I_Z]

    def spun(t: float, y) -> float:
        return abs(y[0]) - 1.2

    spun.terminal = True
    r = brentq(lambda r: slope(beta, r) - rate, -20.0, 20.0)
    return abs(solve_ivp(motion, (0.0, 4.0), [beta, r], events=spun, rtol=1e-6).y[0, -1]) < 0.02


STATES = [(0.05 * i, 0.2 * k) for i in range(-7, 8) for k in range(-6, 7)]


def test_the_strip_holds_nothing_unstable_on_a_dry_road_and_less_than_all_that_is_stable():
    inside = [state for state in STATES if excess(*state, 0.9, STRIP) == 0.0]
    assert len(inside) > 30
    assert all(settles(*state) for state in inside)
    outside = [state for state in STATES[::5] if state not in inside]
    assert 0 < sum(settles(*state) for state in outside) < len(outside)


def test_the_moment_brings_back_states_that_are_lost_without_it():
    stand = Stand(PhasePlane, moment_limit=10000.0)
    stand.start(velocity_x=22.2)

    def moment(beta: float, rate: float) -> float:
        seen = {"sideslip": beta, "sideslip_rate": rate, "velocity_x": 22.2, "friction": 0.9}
        return stand.unit.output(0.0, [0.0, 0.0, *seen.values()])[0]

    lost = [state for state in STATES[::5] if not settles(*state)]
    saved = [state for state in lost if settles(*state, moment=moment)]
    assert len(saved) > len(lost) / 2


def test_the_boundary_is_that_of_the_index_in_degrees():
    for beta, rate in ((5.9, 0.0), (0.0, 23.9), (-7.0, 4.1)):
        assert abs(rate / 24.0 + 4.0 * beta / 24.0) < 1.0
        assert excess(radians(beta), radians(rate), 1.0, STRIP) == 0.0
    for beta, rate in ((6.1, 0.0), (0.0, 24.2), (-7.0, 3.6)):
        assert abs(rate / 24.0 + 4.0 * beta / 24.0) > 1.0
        assert excess(radians(beta), radians(rate), 1.0, STRIP) != 0.0
    assert excess(0.1, 0.0, 0.5, STRIP) == pytest.approx(0.1 - 0.0525)


def test_drift_out_is_countered_only_inside_of_the_strip_and_oversteer_there_not_at_all():
    stand = Stand(PhasePlane)
    stand.start(velocity_x=20.0)
    turn = {"yaw_rate_ref": 0.3, "velocity_x": 20.0}
    assert stand.step(0.005, yaw_rate=0.2, **turn)["yaw_moment"] == pytest.approx(20000.0 * (0.1 - 0.065))
    assert stand.step(0.005, yaw_rate=0.5, **turn)["yaw_moment"] == 0.0
    out = stand.step(0.005, yaw_rate=0.2, sideslip=-0.15, **turn)
    assert out["yaw_moment"] == pytest.approx(-60000.0 * (0.15 - 0.105))


def test_steering_follows_the_yaw_rate_and_brakes_wait_for_the_strip():
    stand = Stand(SteeringAndBraking, yaw_inertia=I_Z, cg_to_front_axle=A, cornering_stiffness_front=C_F)
    stand.start(velocity_x=20.0)
    calm = {"yaw_rate_ref": 0.1, "yaw_rate": 0.08, "velocity_x": 20.0, "steer_angle": 0.02, "friction": 1.0}
    y = stand.step(0.005, **calm)
    assert y["yaw_moment"] == 0.0
    assert y["added_steer_angle_request"] * A * C_F / I_Z == pytest.approx(5.0 * 0.02)  # yaw acceleration
    spin = stand.step(0.005, **calm | {"sideslip": -0.1, "sideslip_rate": -0.2, "yaw_rate": 0.5})
    assert spin["yaw_moment"] == pytest.approx(-60000.0 * (0.15 - 0.8 * 0.105))
    assert spin["added_steer_angle_request"] * A * C_F / I_Z == pytest.approx(5.0 * -0.4)


@pytest.mark.parametrize(
    ("added", "delta", "slip", "expected"),
    [
        (0.05, 0.1, 0.0, 0.04),  # up to the limit of 0.14
        (0.05, 0.2, 0.0, 0.0),  # the driver is beyond it
        (-0.05, 0.2, 0.0, -0.05),  # less slip is always allowed
        (-0.05, -0.1, 0.0, -0.04),
    ],
)
def test_no_angle_is_added_where_front_tyres_have_no_more_to_give(added, delta, slip, expected):
    assert within_grip(added, delta, slip, 0.14) == pytest.approx(expected)

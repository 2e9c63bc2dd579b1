"""Hydraulic brakes: pressure that lags and is limited, and its release from wheels that slip."""

from __future__ import annotations

import math

import pytest

from yawbench.components.tyres.magic_formula import MagicFormula
from yawbench.components.wheel_controls.hydraulic import Hydraulic, HydraulicParameters, asked_pressure

from .stand import Stand


def test_a_pressure_step_answers_with_the_lag_below_the_rate_limit():
    p = HydraulicParameters()
    force = -5e5 * p.brake_factor_front / p.wheel_radius  # 5 bar: slower than the pump
    inputs = {"force_request_fl": force, "wheel_velocity_fl": 25.0}
    stand = Stand(Hydraulic)
    stand.start(**inputs)
    for _ in range(40):
        found = stand.step(0.002, **inputs)
    expected = 5e5 * (1.0 - math.exp(-0.08 / p.pressure_lag))
    assert found["brake_pressure_fl"] == pytest.approx(expected, rel=1e-9)
    assert found["torque_request_fl"] == pytest.approx(-expected * p.brake_factor_front, rel=1e-9)
    assert found["brake_pressure_fr"] == 0.0


def test_pressure_is_limited_in_size_and_rate():
    stand = Stand(Hydraulic)
    inputs = {"force_request_rr": -1e6, "wheel_velocity_rr": 25.0}
    last = stand.start(**inputs)["brake_pressure_rr"]
    for _ in range(2000):
        now = stand.step(0.001, **inputs)["brake_pressure_rr"]
        assert now - last <= 2e7 * 0.001 * (1 + 1e-9)
        last = now
    assert last == pytest.approx(1e7, rel=1e-3)


def test_a_slipping_wheel_is_released_and_a_creeping_one_held():
    p = HydraulicParameters()
    slips = (p.release_slip, p.full_release_slip)
    ask = {"factor": p.brake_factor_front, "p": p, "most": p.pressure_limit, "slips": slips}
    full = asked_pressure(-2000.0, 0.0, 25.0, **ask)
    assert asked_pressure(-2000.0, -0.05, 25.0, **ask) == full > 0.0
    assert asked_pressure(-2000.0, -0.075, 25.0, **ask) == pytest.approx(0.5 * full)
    assert asked_pressure(-2000.0, -0.2, 25.0, **ask) == 0.0
    assert asked_pressure(-2000.0, -1.0, 0.5, **ask) == full  # a parked wheel stays braked
    assert asked_pressure(2000.0, 0.0, 25.0, **ask) == 0.0


def test_a_release_that_ends_before_it_begins_is_refused():
    with pytest.raises(AssertionError, match=r"full_release_slip .*release_slip = 0\.05"):
        Stand(Hydraulic, full_release_slip=0.01).start()
    Stand(Hydraulic, full_release_slip=0.05).start()  # a switch


@pytest.mark.parametrize("friction", [0.9, 0.3])
@pytest.mark.parametrize("angle", [0.0, 4.0, 8.0])
def test_pressure_is_released_about_the_optimum_of_the_tyre_at_the_slip_angle(angle, friction):
    """The optimum is that of a search by brute force over the tyre model itself."""
    alpha, load, p = math.radians(angle), 4500.0, HydraulicParameters()
    axle = MagicFormula.for_curve(MagicFormula.Parameters())[0]
    slips = [0.0005 * k for k in range(1, 2001)]
    best = max(slips, key=lambda k: -MagicFormula.wheel(-k, alpha, load, friction, axle)[0])
    best = min(best, p.largest_release_slip)
    state = {
        "force_request_fl": -1e4, "wheel_velocity_fl": 25.0, "slip_angle_fl": alpha, "vertical_load_fl": load,
        "friction_fl": friction,
    }  # fmt: skip
    settled = []
    for share in (p.release_share, 0.5 * (p.release_share + p.full_release_share), p.full_release_share):
        stand = Stand(Hydraulic)
        stand.start(**state, slip_ratio_fl=-share * best)
        for _ in range(100):
            found = stand.step(0.02, **state, slip_ratio_fl=-share * best)
        settled.append(found["brake_pressure_fl"])
    whole = min(1e4 * p.wheel_radius / p.brake_factor_front, p.pressure_limit)
    assert settled == pytest.approx([whole, 0.5 * whole, 0.0], rel=0.02, abs=0.02 * whole)


def test_a_load_sensing_valve_limits_the_force_of_a_rear_brake_to_its_share_of_the_load():
    stand = Stand(Hydraulic, rear_braking_per_load=0.5, release="slip")
    inputs = {f"{name}_{wheel}": x for name, x in (("force_request", -4000.0), ("wheel_velocity", 25.0),
              ("vertical_load", 3000.0)) for wheel in ("fl", "rl")}  # fmt: skip
    stand.start(**inputs)
    for _ in range(200):
        found = stand.step(0.01, **inputs)
    radius = HydraulicParameters().wheel_radius
    assert found["torque_request_rl"] == pytest.approx(-0.5 * 3000.0 * radius, rel=1e-3)
    assert found["torque_request_fl"] == pytest.approx(-4000.0 * radius, rel=1e-3)


def test_the_drive_part_of_a_request_is_kept():
    stand = Stand(Hydraulic)
    assert stand.start(force_request_rl=1000.0)["torque_request_rl"] == pytest.approx(
        1000.0 * HydraulicParameters().wheel_radius
    )

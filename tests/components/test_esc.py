"""A production-like stability control: each unit by itself on a stand, then the wheel on the road."""

from __future__ import annotations

import pytest

from yawbench.components.control_laws.brake_hydraulics import (
    FULL,
    BrakeHydraulics,
    BrakeHydraulicsParameters,
    caliper_volume,
    line_pressure,
)
from yawbench.components.control_laws.known_tyre import TYRES, optimum_slip
from yawbench.components.controllers.esc import OFF, OVERSTEER, UNDERSTEER, EscController, EscParameters
from yawbench.components.references.esc import EscReference
from yawbench.components.wheel_controls.esc import RELEASE, EscBrakes
from yawbench.vocabulary.gravity import G
from yawbench.vocabulary.wheels import wheels

from .stand import Stand

P = BrakeHydraulicsParameters()
FRONT = {
    "clearance": P.clearance_volume_front,
    "volume": P.caliper_volume_front,
    "filled": P.clearance_pressure,
}


def volumes(hydraulics):
    return [
        caliper_volume(pressure, clearance=clearance, volume=volume, filled=P.clearance_pressure)
        for pressure, (clearance, volume) in zip(hydraulics.pressures, hydraulics.volumes, strict=True)
    ]


def pumped(*braked, until, h=0.001, p=P):
    """Return hydraulics, and pressures of a front brake over time, with wheels supplied by the pump."""
    hydraulics = BrakeHydraulics(p)
    inlets = [1.0 if i in braked else 0.0 for i in range(4)]
    pressures = [0.0]
    for _ in range(round(until / h)):
        hydraulics.advance(
            h,
            master=0.0,
            inlets=inlets,
            outlets=[0.0] * 4,
            boosted=[i in braked for i in range(4)],
            pumping=True,
            filling=True,
            p=p,
        )
        pressures.append(hydraulics.pressures[braked[0]])
    return hydraulics, pressures


def rise(pressures, h=0.001, begin=0.0):
    """Return the mean rise [Pa/s] from a pressure to 10 MPa."""
    first, last = (next(k for k, x in enumerate(pressures) if x >= level) for level in (begin, FULL))
    return (FULL - begin) / (h * (last - first))


def test_a_caliper_takes_what_the_pump_gives():
    hydraulics, _ = pumped(1, until=0.3)
    full_from = volumes(hydraulics)[1]
    hydraulics, _ = pumped(1, until=0.4)
    assert volumes(hydraulics)[1] - full_from == pytest.approx(0.1 * P.pump_flow, rel=0.01)


def test_one_front_brake_rises_as_fast_as_the_brakes_of_the_ranking():
    _, pressures = pumped(1, until=0.8)
    assert 1.7e7 < rise(pressures) < 2.2e7  # wheel_control_hydraulic: 20 MPa/s


def test_wheels_share_the_pump():
    _, alone = pumped(1, until=0.8)
    _, together = pumped(1, 0, until=1.6)
    assert rise(alone, begin=2e6) == pytest.approx(2.0 * rise(together, begin=2e6), rel=0.02)
    hydraulics, _ = pumped(0, 1, 2, 3, until=0.5)
    fl, fr, rl, rr = hydraulics.pressures
    assert fl == fr
    assert rl == rr
    assert rl > fl  # a smaller caliper


def test_the_line_pressure_gives_the_flow_of_the_pump_until_the_relief_valve_opens():
    pressures, openings = [1e6, 4e6, 0.0, 0.0], [1.5e-5, 1.5e-5, 0.0, 0.0]
    line = line_pressure(6e-6, pressures, openings, 1.5e7)
    taken = sum(o * (max(line - p, 0.0) / FULL) ** 0.5 for p, o in zip(pressures, openings, strict=True))
    assert taken == pytest.approx(6e-6, rel=1e-6)
    assert line_pressure(6e-6, [1.5e7 - 1.0], [1.5e-5], 1.5e7) == pytest.approx(1.5e7)
    _, pressures = pumped(1, until=2.0)
    assert pressures[-1] == pytest.approx(P.relief_pressure, rel=1e-3)


def test_half_the_step_changes_pressures_by_less_than_a_hundredth():
    for until in (0.1, 0.3):
        coarse, fine = pumped(1, until=until)[1][-1], pumped(1, until=until, h=0.0005)[1][-1]
        assert coarse == pytest.approx(fine, rel=0.01)


def test_pre_charge_saves_time():
    _, helped = pumped(1, until=0.8)
    _, alone = pumped(1, until=1.2, p=BrakeHydraulicsParameters(precharge_pressure=0.0))
    assert alone[100] < 0.7 * helped[100]


def test_a_full_accumulator_takes_only_what_the_pump_returns():
    hydraulics = BrakeHydraulics(BrakeHydraulicsParameters(accumulator_volume=1e-6))
    hydraulics.pressures = [8e6] * 4
    before = sum(volumes(hydraulics))
    for _ in range(100):
        hydraulics.advance(
            0.001,
            master=8e6,
            inlets=[0.0] * 4,
            outlets=[1.0] * 4,
            boosted=[False] * 4,
            pumping=False,
            filling=False,
            p=BrakeHydraulicsParameters(accumulator_volume=1e-6, valve_lag=0.0),
        )
    assert hydraulics.stored == pytest.approx(1e-6)
    assert before - sum(volumes(hydraulics)) == pytest.approx(1e-6, rel=0.02)


# ---- supervisor


CALM = {"yaw_rate_ref": 0.2, "yaw_rate": 0.2, "sideslip": 0.0, "velocity_x": 22.0, "acceleration_y": 4.4}


def supervised(seconds, stand=None, h=0.005, **inputs):
    if stand is None:
        stand = Stand(EscController)
        stand.start(**CALM)
    for _ in range(round(seconds / h)):
        y = stand.step(h, **{**CALM, **inputs})
    return stand, y


def test_below_the_threshold_nothing_is_done_and_between_the_thresholds_what_was_begun_goes_on():
    p = EscParameters()
    entry = p.yaw_rate_threshold + p.yaw_rate_threshold_share * 0.2
    stand, y = supervised(1.0, yaw_rate=0.2 + 0.95 * entry, acceleration_y=22.0 * (0.2 + 0.95 * entry))
    assert (y["stability_state"], y["yaw_moment"], y["brake_preparation"]) == (OFF, 0.0, 1.0)
    over = {"yaw_rate": 0.2 + 1.1 * entry, "acceleration_y": 22.0 * (0.2 + 1.1 * entry)}
    stand, y = supervised(0.1, stand, **over)
    assert y["stability_state"] == OVERSTEER
    assert y["yaw_moment"] < 0.0
    between = {"yaw_rate": 0.2 + 0.8 * entry, "acceleration_y": 22.0 * (0.2 + 0.8 * entry)}
    stand, y = supervised(1.0, stand, **between)
    assert y["stability_state"] == OVERSTEER
    stand, y = supervised(1.0, stand)
    assert (y["stability_state"], y["yaw_moment"], y["engine_reduction"]) == (OFF, 0.0, 0.0)


def test_a_bump_shorter_than_the_confirmation_is_none():
    _, y = supervised(0.01, yaw_rate=0.5)
    assert y["stability_state"] == OFF


def test_understeer_is_countered_more_softly_and_takes_torque_from_the_engine():
    _, over = supervised(0.3, yaw_rate=0.4, acceleration_y=8.8)
    _, under = supervised(0.3, yaw_rate=0.0, acceleration_y=0.0)
    assert (over["stability_state"], under["stability_state"]) == (OVERSTEER, UNDERSTEER)
    assert under["yaw_moment"] == pytest.approx(-EscParameters().understeer_share * over["yaw_moment"])
    assert under["engine_reduction"] == 1.0


def test_sideslip_and_its_rate_are_oversteer():
    _, slow = supervised(0.1, sideslip=-0.05)
    _, coming = supervised(
        0.1, sideslip=-0.05, acceleration_y=22.0 * -0.2
    )  # the car turns faster than its path
    assert slow["stability_state"] == OFF
    assert coming["stability_state"] == OVERSTEER
    assert coming["yaw_moment"] < 0.0


@pytest.mark.parametrize("speed", [3.0, -22.0])
def test_at_walking_pace_and_in_reverse_it_is_off(speed):
    stand, y = supervised(0.1, yaw_rate=0.6, acceleration_y=13.0)
    assert y["stability_state"] == OVERSTEER
    _, y = supervised(1.0, stand, yaw_rate=0.6, velocity_x=speed)
    assert (y["stability_state"], y["yaw_moment"], y["engine_reduction"]) == (OFF, 0.0, 0.0)


def test_at_20_km_h_it_works():
    _, y = supervised(0.1, yaw_rate=0.6, velocity_x=20 / 3.6, acceleration_y=3.3)
    assert y["yaw_moment"] < -1000.0


# ---- intent


def intended(a_y, *, steer_angle=0.15, v=22.0, seconds=3.0):
    stand = Stand(EscReference)
    stand.start(steer_angle=0.0, velocity_x=v, acceleration_y=0.0)
    for _ in range(round(seconds / 0.01)):
        y = stand.step(0.01, steer_angle=steer_angle, velocity_x=v, acceleration_y=a_y)
    return stand, y


def test_the_yaw_rate_asked_for_is_limited_by_what_the_car_has_shown():
    for a_y in (2.0, 4.0, 6.0):
        stand, y = intended(a_y)
        p = stand.unit.p
        shown = a_y / G + p.friction_margin
        assert y["yaw_rate_ref"] == pytest.approx(shown * G / 22.0, rel=0.02)
        assert y["friction_shown"] == pytest.approx(shown / p.friction_share, rel=0.02)


def test_a_car_that_follows_keeps_the_friction_of_a_dry_road():
    stand, _ = intended(0.0, steer_angle=0.0)
    gain, _ = stand.unit.car.gains(22.0)
    _, y = intended(22.0 * gain * 0.02, steer_angle=0.02)
    assert y["friction_shown"] == stand.unit.p.dry_friction


# ---- brakes


def request(**given):
    zero = dict.fromkeys((v.name for v in EscBrakes.variables if v.causality == "input"), 0.0)
    for name, value in (("vertical_load_*", 4500.0), ("wheel_speed_*", 60.0), ("wheel_velocity_*", 20.0)):
        zero |= dict.fromkeys(wheels(name), value)
    return zero | dict.fromkeys(wheels("friction_*"), 0.9) | given


def braked(seconds, stand=None, h=0.001, **given):
    if stand is None:
        stand = Stand(EscBrakes)
        stand.start(**request())
    for _ in range(round(seconds / h)):
        y = stand.step(h, **request(**given))
    return stand, y


def test_a_request_becomes_pressure_in_its_wheel_alone():
    stand, y = braked(1.0, force_request_fr=-4000.0)
    p = stand.unit.p
    wanted = 4000.0 * p.wheel_radius / p.brake_factor_front
    assert y["brake_pressure_fr"] == pytest.approx(wanted, abs=p.pressure_tolerance)
    assert y["torque_request_fr"] == -p.brake_factor_front * y["brake_pressure_fr"]
    assert [y[f"brake_pressure_{w}"] for w in ("fl", "rl", "rr")] == [0.0, 0.0, 0.0]
    _, y = braked(1.0, stand)
    assert y["brake_pressure_fr"] < 1e4


def test_the_driver_brakes_without_the_pump_and_the_control_adds_to_it():
    share = {"force_request_fl": -2000.0, "force_request_fr": -2000.0}
    share |= {"force_request_rl": -1000.0, "force_request_rr": -1000.0}
    stand, y = braked(1.0, drive_force=-6000.0, **share)
    assert y["pump_share"] == 0.0
    assert y["brake_pressure_fl"] == pytest.approx(y["master_pressure"], rel=1e-3)
    torques = sum(y[name] for name in wheels("torque_request_*"))
    assert torques == pytest.approx(-6000.0 * stand.unit.p.wheel_radius, rel=1e-3)
    _, y = braked(1.0, stand, drive_force=-6000.0, **(share | {"force_request_fr": -5000.0}))
    assert y["pump_share"] > 0.99
    assert y["brake_pressure_fr"] > 2.0 * y["brake_pressure_fl"]


@pytest.mark.parametrize("alpha", [0.0, 0.14])
def test_pressure_is_released_where_the_tyre_has_its_optimum(alpha):
    given = {"force_request_fr": -6000.0, "slip_angle_fr": alpha}
    stand, y = braked(0.5, **given)
    p = stand.unit.p
    curve = TYRES[p.tyre].curve(alpha, 4500.0, 0.9, stand.unit.axles[1])
    limit = p.optimum_share * optimum_slip(curve, driving=False, cap=1.0)
    assert y["slip_limit_fr"] == pytest.approx(limit, rel=1e-3)
    assert y["valve_state_fr"] != RELEASE
    before = y["brake_pressure_fr"]
    stand, y = braked(0.05, stand, **given, slip_ratio_fr=-0.95 * limit)
    assert y["brake_pressure_fr"] == pytest.approx(before, rel=0.02)  # held; a valve takes some milliseconds
    _, y = braked(0.05, stand, **given, slip_ratio_fr=-1.05 * limit)
    assert y["valve_state_fr"] == RELEASE
    assert y["brake_pressure_fr"] < 0.8 * before


def test_after_a_release_pressure_rises_in_pulses():
    given = {"force_request_fr": -6000.0, "drive_force": -30000.0}  # from the master cylinder
    free, low = braked(0.05, **given)
    _, high = braked(0.02, free, **given)
    slipped, _ = braked(0.05, **given)
    _, released = braked(0.03, slipped, **given, slip_ratio_fr=-0.5)
    _, after = braked(0.02, slipped, **given)
    once, again = (
        b["brake_pressure_fr"] - a["brake_pressure_fr"] for a, b in ((low, high), (released, after))
    )
    assert 0.0 < again < 0.6 * once


def test_the_engine_is_cut_by_what_the_supervisor_says():
    _, y = braked(0.1, force_request_rl=800.0, engine_reduction=0.75)
    assert y["torque_request_rl"] == pytest.approx(0.25 * 800.0 * Stand(EscBrakes)["wheel_radius"])


def test_a_hot_brake_is_left_to_the_driver_until_it_has_cooled():
    stand = Stand(EscBrakes, brake_energy_limit=2e4, cooling_time=0.5)
    stand.start(**request())
    pressures = [braked(0.02, stand, force_request_fr=-4000.0)[1]["brake_pressure_fr"] for _ in range(60)]
    top = max(pressures[:30])
    left = min(pressures[pressures.index(top) :])
    assert top > 3e6
    assert left < 2e5
    assert max(pressures[pressures.index(left) :]) > 1e6  # it brakes again

"""A monitor in the loop: what a faulty signal does to a car with it and without, and no false alarm."""

from __future__ import annotations

import numpy as np
import pytest

import yawbench as yb

NEVER = {"monitor.fade_time": 1e9}
"""Lets the monitor watch alone."""


def driven(*fault, settings=None, **swaps):
    """Return the peak of the sideslip angle [deg]; the fault that was found and when [s], or None."""
    scenario = yb.load("fuzzy_sliding_mode/monitored").swap(**swaps).set(settings or {})
    if fault:
        place, kind, start, value = fault
        scenario = scenario.fault(place, kind=kind, start=start, value=value)
    run = scenario.run()
    found = np.flatnonzero(run["monitor.fault"])
    first = (run["monitor.fault"][found[0]], run.time[found[0]]) if found.size else None
    return np.degrees(run.metric("peak(plant.sideslip)")), first


@pytest.mark.exhaustive
def test_with_the_monitor_a_frozen_gyro_is_no_worse_than_no_control():
    off, _ = driven(controller="controller_off")
    healthy, alarm = driven()
    assert alarm is None
    assert healthy < 0.1 * off
    for start, within in ((1.0, 0.8), (1.5, 0.3)):
        frozen = ("sensor.yaw_rate", "freeze", start, None)
        watched, found = driven(*frozen)
        blind, _ = driven(*frozen, settings=NEVER)
        assert found[0] == 1.0
        assert start < found[1] < start + within
        assert watched < off < blind
    zero = ("sensor.yaw_rate", "value", 1.0, 0.0)
    assert driven(*zero)[1] == (1.0, pytest.approx(1.0, abs=0.02))
    assert driven(*zero)[0] < 1.1 * off < driven(*zero, settings=NEVER)[0]


@pytest.mark.exhaustive
def test_a_fault_of_what_the_law_does_not_need_is_told_and_changes_nothing():
    healthy, _ = driven()
    for place, number, within in (("sensor.acceleration_y", 2.0, 0.03), ("sensor.wheel_speed_fl", 4.0, 0.4)):
        peak, found = driven(place, "value", 1.0, 0.0)
        assert found[0] == number
        assert found[1] < 1.0 + within
        assert peak == pytest.approx(healthy, rel=0.1)
    blind, found = driven("sensor.steer_angle", "freeze", 1.0, None)
    assert found[0] == 3.0
    assert 1.0 < found[1] < 2.5
    assert healthy < blind < 5.0


@pytest.mark.exhaustive
def test_no_seed_of_the_noise_gives_a_false_alarm():
    for seed in range(1, 11):
        assert driven(settings={"sensor.seed": seed})[1] is None

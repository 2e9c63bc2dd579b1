"""A monitor in the loop: what a faulty signal does to a car with it and without, and no false alarm."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

import yawbench as yb
from tests.checkout import ROOT
from tests.markdown import table_in
from tests.refusals import sentence_has

NEVER = {"monitor.fade_time": 1e9}
"""Lets the monitor watch alone."""
SWITCHED_OFF = {"monitor.uses_steer_angle": True}
"""Lets it fade the yaw moment for a faulty hand wheel, too."""
FAULTS = {
    "gyro frozen": ("sensor.yaw_rate", "freeze", 1.0, None),
    "gyro frozen from 1.5 s on": ("sensor.yaw_rate", "freeze", 1.5, None),
    "gyro at zero": ("sensor.yaw_rate", "value", 1.0, 0.0),
    "gyro 10 °/s too high": ("sensor.yaw_rate", "bias", 1.0, "10 deg/s"),
    "accelerometer at zero (not needed)": ("sensor.acceleration_y", "value", 1.0, 0.0),
    "a wheel speed at zero (not needed)": ("sensor.wheel_speed_fl", "value", 1.0, 0.0),
    "hand wheel frozen (the law is kept)": ("sensor.steer_angle", "freeze", 1.0, None),
}
"""Row in docs/faults.md -> signal, kind, start [s], value."""
HEALTHY = "nothing is wrong (no alarm with ten seeds of the noise)"
NUMBERS = {"gyro": 1.0, "accelerometer": 2.0, "hand wheel": 3.0, "a wheel speed": 4.0}
"""Signal -> its number at the monitor's output."""


class Driven(NamedTuple):
    """Peak of the sideslip angle [deg]; number of the fault that was detected and when [s], or None."""

    peak: float
    detected: tuple[float, float] | None


def driven(*fault, settings=None, **swaps) -> Driven:
    scenario = yb.load("fuzzy_sliding_mode/monitored").swap(**swaps).set(settings or {})
    if fault:
        place, kind, start, value = fault
        scenario = scenario.fault(place, kind=kind, start=start, value=value)
    run = scenario.run()
    found = np.flatnonzero(run["monitor.fault"])
    first = (run["monitor.fault"][found[0]], run.time[found[0]]) if found.size else None
    return Driven(np.degrees(run.metric("peak(plant.sideslip)")), first)


def angle(peak: float) -> str:
    return f"{peak:.{0 if peak >= 100 else 1}f} °"


@pytest.fixture(scope="module")
def page() -> str:
    return (ROOT / "docs" / "faults.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def table(page) -> dict[str, list[str]]:
    return {name: cells for name, *cells in table_in(page.partition("## A monitor")[2]) if len(cells) == 3}


def test_the_table_has_every_fault(table):
    assert list(table)[1:] == [HEALTHY, "no control at all", *FAULTS]


def test_without_faults_the_monitor_is_silent_and_the_car_needs_its_control(table):
    healthy, off = driven(), driven(controller="controller_off")
    assert table[HEALTHY] == ["-", angle(healthy.peak), angle(driven(settings=NEVER).peak)]
    assert table["no control at all"] == ["", "", angle(off.peak)]
    assert healthy.detected is None
    assert healthy.peak < 0.1 * off.peak


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", FAULTS)
def test_the_table_says_what_a_fault_does_with_the_monitor_and_without(name, table):
    (place, kind, start, value), signal = FAULTS[name], next(x for x in NUMBERS if name.startswith(x))
    watched = driven(place, kind, start, value)
    blind = driven(place, kind, start, value, settings=NEVER)
    assert watched.detected is not None
    number, time = watched.detected
    after = time - start
    assert number == NUMBERS[signal]
    assert table[name] == [
        f"{after:.2g} s" if after > 0.005 else "at once", angle(watched.peak), angle(blind.peak)
    ]  # fmt: skip


def test_the_sentences_below_the_table_follow_from_it(page, table):
    text = " ".join(page.split())
    _, watched, blind = table["gyro 10 °/s too high"]
    assert sentence_has(text, watched, blind, "constant", "offset")
    kept, given_up = (
        table["hand wheel frozen (the law is kept)"][1],
        driven(*FAULTS["hand wheel frozen (the law is kept)"], settings=SWITCHED_OFF),
    )
    assert sentence_has(text, kept, f"{given_up.peak:.0f}", "better", "table")


@pytest.mark.sampled(1)
@pytest.mark.parametrize("seed", range(1, 11))
def test_no_seed_of_the_noise_gives_a_false_alarm(seed):
    assert driven(settings={"sensor.seed": seed}).detected is None

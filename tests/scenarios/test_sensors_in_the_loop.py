"""Sensors in the papers' loops: ideal ones change nothing, noise is repeatable."""

from __future__ import annotations

import numpy as np
import pytest

import yawbench as yb

from .real_signals import with_units


@pytest.mark.parametrize(
    ("name", "until"),
    [
        ("fnn_sideslip/25mps", 2.0),
        pytest.param("fuzzy_sliding_mode/high_friction", 5.0, marks=pytest.mark.exhaustive),
        pytest.param("fuzzy_pid/sine", 9.0, marks=pytest.mark.exhaustive),
    ],
)
def test_with_ideal_sensors_a_run_is_the_exact_one_to_the_bit(name, until, tmp_path):
    exact = yb.load(name).set({"stop_time": until}).run()
    sensed = (
        yb.load(with_units(name, tmp_path, sensor={"fmu": "sensor_ideal"})).set({"stop_time": until}).run()
    )
    assert {c for c in exact if not np.array_equal(exact[c], sensed[c])} == set()
    assert np.ptp(sensed["sensor.yaw_rate"]) > 0.05


@pytest.mark.exhaustive
def test_the_same_seed_gives_the_same_bytes_on_any_number_of_workers(tmp_path):
    file = with_units("fnn_sideslip/25mps", tmp_path, sensor={"fmu": "sensor_production"})
    scenario = yb.load(file).set({"stop_time": 2.0})
    made = yb.experiment(scenario, {"sensor.seed": [1, 2, 3]}, metrics=["peak(sensor.yaw_rate)"])
    alone, together = (made.run(workers=workers).table for workers in (1, 2))
    assert alone.equals(together)
    assert alone["peak(sensor.yaw_rate)"].nunique() == 3

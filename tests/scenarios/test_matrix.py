"""Any controller on any plant on any tyre: only `--swap` between them, two seconds of a lane change each."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest

from tests.cars import load_scenario, make_plan
from tests.changed import changed
from yawbench.orchestrator.master.simulate import simulate
from yawbench.orchestrator.results.reader import load_results

SCENARIO = Path(__file__).parents[2] / "scenarios" / "fuzzy_sliding_mode" / "high_friction.yaml"
CONTROLLERS = (
    "off", "fuzzy_sideslip", "fnn", "sliding_mode", "fuzzy_sliding_mode", "pid", "fuzzy_pid",
    "fuzzy_feedback", "lqr", "mpc", "dead_band",
)  # fmt: skip
PLANTS = ("seven_dof", "eight_dof", "fourteen_dof")
TYRES = ("dugoff", "linear", "magic_formula", "magic_formula_62", "magic_formula_1987")
CAR = SCENARIO.parents[1] / "vehicles" / "large_saloon.yaml"
"""A car that is described for every plant."""
STEERED = ("driver.steering_ratio=1", "driver.amplitude=0.12")
"""Road wheels, so far [rad] that the dead band of a controller is left on every tyre."""
UNITS = (
    "driver_sine", "reference_single_track", "allocator_load_proportional", "wheel_control_slip",
    "actuator_lag",
    *(f"controller_{name}" for name in CONTROLLERS),
    *(f"plant_{name}" for name in PLANTS),
    *(f"tyre_{name}" for name in TYRES),
)  # fmt: skip
ON_THE_ROAD = {"plant.sideslip": 0.5, "plant.yaw_rate": 1.5}
"""Bounds within which a car stays that has not been lost: rad, rad/s."""


@pytest.mark.sampled(12)  # with every controller, car and tyre among them
@pytest.mark.parametrize(("plant", "tyre", "controller"), [*product(PLANTS, TYRES, CONTROLLERS)])
def test_every_controller_runs_on_every_car_and_tyre(fmus, tmp_path, plant, tyre, controller):
    swaps = (f"controller=controller_{controller}", f"plant=plant_{plant}", f"tyre=tyre_{tyre}")
    plan = make_plan(
        load_scenario(SCENARIO, changes=changed(swaps, STEERED, stop_time=2.0, vehicle=str(CAR))),
        fmus=fmus,
    )
    simulate(plan, tmp_path)
    results = load_results(tmp_path)
    assert results.record.status == "completed", results.record.error
    assert results.time[-1] == 2.0
    for name, column in results.columns.items():
        assert np.all(np.isfinite(column)), name
    moment = np.max(np.abs(results["controller.yaw_moment"]))
    assert (moment == 0.0) if controller == "off" else (100.0 < moment < 1e5), moment
    if controller != "off":
        for name, limit in ON_THE_ROAD.items():
            assert np.max(np.abs(results[name])) < limit, name

"""A scenario as one FMU, run here and by fmpy, beside the scenario itself."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from tests.cars import make_plan
from tests.changed import changed
from tests.command_line import status_of
from tests.refusals import mentions
from yawbench.interop.second_opinion import Request, run_own
from yawbench.interop.ssp_write import write_ssp
from yawbench.orchestrator.results.reader import load_results
from yawbench.orchestrator.scenario.loader import load_scenario

UNITS = (
    "driver_sine", "plant_seven_dof", "reference_steady_state", "controller_fnn",
    "allocator_load_proportional", "wheel_control_direct", "tyre_dugoff",
)  # fmt: skip
SCENARIO = Path(__file__).parents[2] / "scenarios" / "fnn_sideslip" / "25mps.yaml"
STOP = 1.6  # s: the car moves
SAME = 1e-12  # of a signal's range: the container counts time by adding steps
ONE_STEP = [f"{unit}.step_size=0.001" for unit in ("controller", "allocator", "wheel_control")]

pytest.importorskip("fmu_manipulation_toolbox")
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="its units are tested on Linux")


@pytest.fixture(scope="module")
def both(fmus, tmp_path_factory):
    """The FMU of a scenario, and what the scenario gives with `jacobi` and one step: names, values."""
    folder = tmp_path_factory.mktemp("one")
    file, settings = folder / "car.fmu", [f"--set={one}" for one in ONE_STEP]
    options = ("--set", f"stop_time={STOP}", "--out", file)
    assert status_of("export-fmu", SCENARIO, "--fmus", fmus, *settings, *options) == 0
    changes = changed(settings=ONE_STEP, stop_time=STOP)
    plan = make_plan(load_scenario(SCENARIO, changes=changes), fmus=fmus)
    write_ssp(plan, folder / "car.ssp")
    columns = [tuple(name) for name in plan.record]
    request = Request(str(folder / "car.ssp"), float(plan.step), plan.n_steps, columns)
    return file, request.names, run_own(request).values


def largest(theirs, ours):
    """Return the largest difference relative to the range of each signal that moves, and their number."""
    ranges = np.ptp(ours, axis=0)
    moving = ranges > 0
    return np.max(np.abs(theirs - ours).max(axis=0)[moving] / ranges[moving]), moving.sum()


def by_fmpy(file, names, **start_values):
    options = {"stop_time": STOP, "step_size": 1e-3, "output_interval": 1e-3, "start_values": start_values}
    rows = simulate_fmu(str(file), output=names, **options)
    return np.array([rows[name] for name in names]).T


def test_one_fmu_is_valid_and_gives_what_its_scenario_gives(both):
    file, names, ours = both
    assert validate_fmu(str(file)) == []
    difference, moving = largest(by_fmpy(file, names), ours)
    assert difference < SAME
    assert moving > 40


def test_its_parameters_are_those_of_its_units(both):
    file, names, ours = both
    yaw_rate = names.index("plant.yaw_rate")
    small = by_fmpy(file, names, **{"driver.amplitude": 0.01})
    assert np.abs(small[:, yaw_rate]).max() < 0.7 * np.abs(ours[:, yaw_rate]).max()


def test_it_runs_here_although_it_logs_an_error_and_returns_ok(both, tmp_path, yawbench):
    file, names, ours = both
    scenario = tmp_path / "one.yaml"
    units = {"car": {"fmu": str(file)}}
    data = {"stop_time": STOP, "step_size": 0.001, "units": units, "record": [f"car.{n}" for n in names]}
    scenario.write_text(json.dumps(data), encoding="utf-8")
    status, _, said = yawbench("run", scenario, "--out", tmp_path / "out")
    assert status == 0, said
    assert mentions(said, "warning", "car at t = 0 s", "Error")
    results = load_results(tmp_path / "out")
    assert largest(np.array([results[f"car.{n}"] for n in names]).T, ours)[0] < SAME


WIRE = {"from": "driver.steer_angle", "to": "plant.steer_angle"}


@pytest.mark.parametrize(
    ("connections", "inputs", "names"),
    [
        ([{**WIRE, "gain": 2}], {}, ("gain", "driver.steer_angle to plant.steer_angle")),
        ([{**WIRE, "delay": "1 step"}], {}, ("delay", "plant.steer_angle")),
        ([], {"plant.slope": {"file": "slope.csv"}}, ("time series", "plant.slope")),
    ],
)
def test_what_a_container_lacks_is_refused(fmus, tmp_path, yawbench, connections, inputs, names):
    (tmp_path / "slope.csv").write_text("time,slope\n0,0\n10,0.1\n", encoding="utf-8")
    before = load_scenario(SCENARIO).as_run()
    data = {key: before[key] for key in ("units", "friction", "speed")}
    data |= {"stop_time": 1, "step_size": 0.001, "vehicle": str(SCENARIO.parent / before["vehicle"])}
    data |= {"connections": [*before["connections"], *connections], "inputs": inputs}
    (tmp_path / "s.yaml").write_text(json.dumps(data, default=str), encoding="utf-8")
    status, _, said = yawbench("export-fmu", tmp_path / "s.yaml", "--fmus", fmus, "--out", tmp_path / "s.fmu")
    assert status == 2 and mentions(said, "s.fmu", *names)
    assert not (tmp_path / "s.fmu").exists()

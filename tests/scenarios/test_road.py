"""The scenarios on roads of patches: split friction to a standstill, who is told what of friction."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.cars import load_scenario, make_plan
from tests.changed import changed
from tests.fmu_copies import put_fmus
from yawbench.orchestrator.master.simulate import simulate_in_memory
from yawbench.orchestrator.results.reader import found_runs, load_results
from yawbench.studies.listings import runs_table

FOLDER = Path(__file__).parents[2] / "scenarios" / "road"
UNITS = (
    "driver_double_lane_change", "driver_force_pulse", "driver_sine", "reference_single_track",
    "controller_off", "controller_pid", "controller_fuzzy_sliding_mode", "allocator_releasing",
    "allocator_load_proportional",
    "wheel_control_hydraulic", "wheel_control_slip", "actuator_lag", "plant_fourteen_dof", "plant_eight_dof",
    "tyre_magic_formula", "tyre_magic_formula_62_transient", "road_patchwork",
)  # fmt: skip
AT_REST = 0.05
"""Speed [m/s] below which a car has stopped."""
SETTLED = ("plant.velocity_x", "plant.velocity_y", "plant.yaw_rate")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Return the results of a scenario after swaps and with other values."""
    fmus = tmp_path_factory.mktemp("road") / "fmus"
    put_fmus(fmus, components=UNITS)

    def run(name, *swaps, **values):
        scenario = load_scenario(FOLDER / f"{name}.yaml", changes=changed(swaps, **values))
        return simulate_in_memory(make_plan(scenario, fmus=fmus))

    return run


def stopping_distance(results):
    """Return the way [m] from the brake's beginning to the standstill."""
    slow = results["plant.velocity_x"] < AT_REST
    assert slow.any()
    x = results["plant.position_x"]
    return x[np.argmax(slow)] - x[np.argmax(results["pedal.drive_force"] < 0.0)]


def assert_comes_to_rest(results, *, within):
    """A second after the stop, and from second to second, what still rocks gets smaller: no limit cycle."""
    stop = results.time[np.argmax(results["plant.velocity_x"] < AT_REST)]
    seconds = np.arange(np.ceil(stop), results.time[-1] - 0.99)
    assert seconds.size >= 2
    for name in SETTLED:
        swings = [np.ptp(results[name][(results.time >= t) & (results.time <= t + 1.0)]) for t in seconds]
        assert swings[-1] < within, name
        assert swings[-1] < 0.5 * swings[0], name


@pytest.fixture(scope="module")
def stops(run):
    """Braking on split friction, free and controlled."""
    return [run("split_braking", *swaps, stop_time=10.0) for swaps in (("controller=controller_off",), ())]


def test_on_split_friction_the_controller_lowers_the_peak_yaw_at_a_tenth_more_of_way(stops):
    free, held = stops
    assert set(free["road.friction_fl"][:500]) | set(free["road.friction_fr"][:500]) == {0.2, 0.8}
    peaks = [np.abs(results["plant.yaw_rate"]).max() for results in stops]
    angles = [np.abs(results["plant.yaw_angle"]).max() for results in stops]
    assert peaks[1] < 0.6 * peaks[0]
    assert angles[1] < 0.8 * angles[0]
    assert 1.0 < stopping_distance(held) / stopping_distance(free) <= 1.1


def test_on_split_friction_cars_stop_and_stand_at_1_ms(stops):
    for results in stops:
        assert_comes_to_rest(results, within=1e-3)


@pytest.mark.exhaustive
@pytest.mark.parametrize("controller", ["controller_off", "controller_pid"])
def test_they_do_so_on_tyres_with_relaxation_lengths(run, controller):
    tyre = "tyre=tyre_magic_formula_62_transient"
    results = run("split_braking", tyre, f"controller={controller}", stop_time=14.0)
    assert_comes_to_rest(results, within=2e-3)
    assert results["plant.velocity_x"].min() > -0.4  # carcasses spring back, not a relaxation length


@pytest.mark.exhaustive
def test_without_release_braking_more_on_one_side_is_no_remedy(run, stops):
    added = run("split_braking", stop_time=4.0, **{"allocator.release_limit": 0.0})
    peaks = [np.abs(results["plant.yaw_rate"]).max() for results in (added, *stops)]
    assert peaks[0] > 0.9 * peaks[1] > peaks[2]


def test_the_reference_is_told_the_jump_late_and_the_tyres_at_once(run):
    results = run("friction_jump", stop_time=2.5)
    road, told = results["road.friction"], results["road.friction_delayed"]
    at, late = (results.time[np.argmax(column < 0.9)] for column in (road, told))
    assert late - at == pytest.approx(0.3, abs=0.002)
    assert results["road.friction_fl"].min() == 0.4


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["chequerboard", "crosswind"])
def test_the_other_roads_are_driven_to_their_end(run, name):
    results = run(name, stop_time=9.0)
    assert np.abs(results["plant.position_y"]).max() < 1.0
    if name == "chequerboard":
        assert set(results["road.friction"].round(9)) <= {0.3, 0.425, 0.55, 0.675, 0.8}
        assert_comes_to_rest(results, within=1e-3)
    else:
        assert results["road.wind_force_y"].min() == -1500.0
        assert np.abs(results["plant.position_y"]).max() > 0.05


def test_a_car_that_brakes_straight_to_rest_does_not_spin(tmp_path, yawbench):
    call = ("run", "proving_ground/friction_jump_braking", "--set", "stop_time=6", "--out", tmp_path / "jump")
    status, out, said = yawbench(*call, "--metric", "peak(sideslip)", "--json")
    assert status == 0 and "spins" not in said
    assert json.loads(out)["metrics"]["peak(sideslip)"]["value"] == pytest.approx(0.0, abs=1e-6)
    status, out, said = yawbench("run", "road/split_braking", "--metric", "peak(sideslip)", "--json",
                                 "--out", tmp_path / "split")  # fmt: skip
    assert status == 0 and "spins" not in said
    assert 4.0 < np.degrees(json.loads(out)["metrics"]["peak(sideslip)"]["value"]) < 7.0
    recorded = load_results(tmp_path / "split")
    assert np.degrees(np.max(np.abs(recorded["plant.sideslip"]))) > 90.0  # what the plant gave stays
    peaks = {Path(row[0]).name: row[5].number for row in runs_table(found_runs(tmp_path)).rows}
    assert np.degrees(peaks["split"]) < 7.0 and peaks["jump"] == pytest.approx(0.0, abs=1e-6)


def test_a_turn_that_ends_at_rest_is_evaluated_while_the_car_moves(tmp_path, yawbench):
    folder = tmp_path / "turn"
    call = ("run", "proving_ground/braking_in_turn", "--set", "stop_time=16", "--out", folder)
    status, _, said = yawbench(*call)
    assert status == 0 and "spins" not in said
    status = yawbench("evaluate", "turn-response", folder)[0]
    assert status == 0
    (run,) = json.loads((folder / "evaluation.json").read_text())["runs"]
    assert 1.0 < np.degrees(run["quantities"]["sideslip_peak"]["value"]) < 4.0

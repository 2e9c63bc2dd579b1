"""Scenarios, studies and sweeps by name, and folders in their place."""

from __future__ import annotations

import os
import re
import shutil
import sys
from pathlib import Path

import pytest

import yawbench as yb
from tests.fmu_copies import put_fmus
from tests.refusals import mentions, refused
from yawbench.foundation.errors import ScenarioError
from yawbench.orchestrator.scenario import catalogue
from yawbench.studies.load_experiment import load_experiment

SCENARIOS = Path(__file__).parents[2] / "scenarios"
NAME = "fuzzy_feedback/single_sine"


@pytest.fixture
def yawbench(yawbench, tmp_path, monkeypatch):
    """Run the command line in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return yawbench


def test_a_scenario_that_comes_along_is_run_by_its_name_from_any_folder(yawbench, tmp_path):
    status, _, told = yawbench("run", NAME, "--set", "stop_time=0.01")
    assert (status, told.splitlines()[-1].split(":")[0]) == (0, f"results/{NAME},stop_time=0.01")
    assert (tmp_path / f"results/{NAME},stop_time=0.01/run.json").is_file()


def test_the_nearest_folder_of_scenarios_comes_before_the_one_that_comes_along(tmp_path, monkeypatch):
    own = tmp_path / "scenarios" / NAME
    own.parent.mkdir(parents=True)
    own.with_suffix(".yaml").write_text("units: {}\n")
    below = tmp_path / "deep" / "er"
    below.mkdir(parents=True)
    monkeypatch.chdir(below)
    assert catalogue.find(NAME, "a scenario") == own.with_suffix(".yaml")
    assert catalogue.names("a scenario").count(NAME) == 1
    monkeypatch.chdir(tmp_path)
    assert catalogue.find(NAME, "a scenario") == Path("scenarios", f"{NAME}.yaml")


def test_the_library_knows_the_names_that_the_commands_know(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert yb.load(NAME).path == SCENARIOS / f"{NAME}.yaml"


@pytest.mark.parametrize(
    ("kind", "folder", "names"),
    [
        ("a scenario", SCENARIOS / "fnn_sideslip", ("fnn_sideslip/15mps.yaml", "fnn_sideslip/25mps.yaml")),
        (
            "a scenario",
            "fnn_sideslip",
            ("scenarios/fnn_sideslip/15mps.yaml", "scenarios/fnn_sideslip/40mps.yaml"),
        ),
        ("a scenario", SCENARIOS, ("fuzzy_pid/sine.yaml",)),
        ("a study file", SCENARIOS / "fuzzy_sliding_mode", ("distribution.yaml", "study.yaml")),
        ("a sweep file", SCENARIOS / "fnn_sideslip", ("sweep_slip_control.yaml",)),
        ("a sweep file", SCENARIOS / "fuzzy_pid", ("without", "'yawbench run'")),
        ("a scenario", SCENARIOS / "vehicles", ("without", "feedforward_pi/step_steer")),
    ],
)
def test_a_folder_in_place_of_a_file_names_the_files_in_it(kind, folder, names):
    with refused(ScenarioError, "scenario-unknown", names=(f"{folder}: ", kind, *names)) as caught:
        catalogue.find(folder, kind)
    assert ("study.yaml" in str(caught.value)) == (kind == "a study file")


def test_a_vehicle_file_goes_by_its_name_with_or_without_its_folder():
    van = catalogue.find("van", "a vehicle file")
    assert van == catalogue.find("vehicles/van", "a vehicle file")
    assert van.samefile(SCENARIOS / "vehicles" / "van.yaml")


def test_a_scenario_with_the_name_of_a_vehicle_file_is_not_taken_for_it(tmp_path, monkeypatch):
    own = tmp_path / "scenarios"
    for file in (own / "van.yaml", own / "vehicles" / "van.yaml"):
        file.parent.mkdir(exist_ok=True)
        file.write_text("title: a van\n")
    monkeypatch.chdir(tmp_path)
    assert catalogue.find("van", "a vehicle file").samefile(own / "vehicles" / "van.yaml")
    assert catalogue.find("van", "a scenario").samefile(own / "van.yaml")
    vehicle = catalogue.beside(own / "deep" / "sine.yaml", "van", "a vehicle file")
    assert vehicle.samefile(own / "vehicles" / "van.yaml")
    for near in ("scenarios/van", "./scenarios/van"):  # a path leads to the file that it names
        assert catalogue.find(near, "a vehicle file").samefile(own / "van.yaml")
    assert catalogue.beside(own / "deep" / "sine.yaml", "../van", "a vehicle file").samefile(own / "van.yaml")


@pytest.mark.parametrize(
    ("name", "kind", "likely"),
    [
        ("large_salon", "a vehicle file", "'large_saloon'"),
        ("25mps", "a scenario", "fnn_sideslip/25mps"),
        ("fuzy_feedback/single_sine", "a scenario", "'fuzzy_feedback/single_sine'"),
    ],
)
def test_a_name_of_nothing_is_refused_with_a_likely_one(name, kind, likely):
    with refused(ScenarioError, "scenario-unknown", names=(f"'{name}'", likely)):
        catalogue.find(name, kind)


def test_the_glance_at_a_file_sees_the_kind_that_its_schema_sees():
    kinds = {path.name: kind for path, kind in catalogue.files(SCENARIOS / "fnn_sideslip", list(KINDS))}
    assert kinds == {
        **dict.fromkeys(("15mps.yaml", "25mps.yaml", "40mps.yaml"), "a scenario"),
        **dict.fromkeys((f"{speed}mps_actuators.yaml" for speed in (15, 25, 40)), "a scenario"),
        "tuning.yaml": "a tuning file", "tuning_with_actuators.yaml": "a tuning file",
        "laws.yaml": "a study file", "study.yaml": "a study file", "sweep.yaml": "a sweep file",
        "sweep_slip_control.yaml": "a sweep file",
    }  # fmt: skip


KINDS = ("a scenario", "a study file", "a sweep file", "a tuning file", "a vehicle file")


@pytest.mark.parametrize(
    ("words", "completed"),
    [
        ("run fuzzy_pid/", ["fuzzy_pid/double_lane_change", "fuzzy_pid/ramp", "fuzzy_pid/sine"]),
        ("sweep fnn", ["fnn_sideslip/sweep", "fnn_sideslip/sweep_slip_control"]),
        ("second", ["second-opinion"]),
        ("run x --vehicle la", ["large_saloon"]),
        ("run x --set vehicle.unsprung_mass_f", ["vehicle.unsprung_mass_front="]),
        ("run x --swap contr", ["controller="]),
        ("run x --swap estimator=estimator_k", ["estimator=estimator_kinematic"]),
        ("run x --fault plant.yaw_ra", ["plant.yaw_rate", "plant.yaw_rate_ref"]),
        ("run x --metric rms_", ["rms_error("]),
        ("plot x --panel yaw_ra", ["yaw_rate", "yaw_rate_ref"]),
    ],
)
def test_the_shell_completes_names(yawbench, monkeypatch, words, completed):
    monkeypatch.setattr(sys, "argv", ["yawbench"])
    monkeypatch.setattr(sys.modules["__main__"], "__package__", "", raising=False)  # not run by `python -m`
    monkeypatch.setenv("_YAWBENCH_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", f"yawbench {words}")
    monkeypatch.setenv("COMP_CWORD", str(len(words.split())))
    assert yawbench()[1].split() == completed


def test_files_name_others_by_names_and_commands_take_another_car(yawbench, tmp_path):
    text = (SCENARIOS / "fnn_sideslip/25mps.yaml").read_text()
    Path("mine.yaml").write_text(re.sub("vehicle: .*", "vehicle: suv", text))
    masses = {}
    for car in ("suv", "van"):
        plan = yb.load("mine.yaml").set({"vehicle": SCENARIOS / f"vehicles/{car}.yaml"}).plan()
        plant = next(instance for instance in plan.instances if instance.name == "plant")
        masses[car] = plant.parameters["mass"]
    assert f"{masses['van']:g} kg" in yawbench("check", "mine.yaml", "--vehicle", "van")[1]
    assert f"{masses['suv']:g} kg" in yawbench("check", "mine.yaml")[1]
    runs = "runs: [{name: a, scenario: fnn_sideslip/25mps}]\nmetrics: {m: {metric: peak(sideslip)}}\n"
    Path("study.yaml").write_text(f"title: One\n{runs}")
    assert load_experiment(Path("study.yaml")).runs["a"].scenario == SCENARIOS / "fnn_sideslip/25mps.yaml"
    Path("mine.yaml").write_text(re.sub("vehicle: .*", "vehicle: no_such_car", text))
    status, _, told = yawbench("check", "mine.yaml")
    assert (status, mentions(told, "mine.yaml:", "no_such_car")) == (2, True)


def test_paths_in_a_scenario_are_relative_to_it_wherever_it_is_run_from(yawbench, tmp_path):
    place, fmus = tmp_path / "mine" / "cases", tmp_path / "mine" / "units"
    place.mkdir(parents=True)
    shutil.copytree(SCENARIOS / "vehicles", tmp_path / "mine" / "cars")
    put_fmus(fmus, components=["controller_off"])
    (place / "measured.csv").write_text("time,delta [deg]\n0,0\n10,5\n")
    text = (SCENARIOS / f"{NAME}.yaml").read_text()
    text, cars = re.subn("vehicle: .*/", "vehicle: ../cars/", text)
    text, controllers = re.subn("fmu: controller_fuzzy_feedback", "fmu: ../units/controller_off.fmu", text)
    assert (cars, controllers) == (1, 1)
    series = "inputs:\n  plant.steer_angle: {file: measured.csv, column: delta}\nunits:\n"
    (place / "mine.yaml").write_text(text.replace("units:\n", series))
    (place / "plain.yaml").write_text(text)
    (tmp_path / "elsewhere").mkdir()
    os.chdir(tmp_path / "elsewhere")
    status, shown, told = yawbench("check", "../mine/cases/mine.yaml")
    assert (status, told.count("\n")) == (0, 1)  # that the driver does not steer
    assert "controller_off" in shown
    assert "measured.csv" in shown
    assert yawbench("export-ssp", "../mine/cases/plain.yaml")[0] == 0
    os.chdir(tmp_path)
    assert yawbench("run", "elsewhere/plain.ssp", "--set", "stop_time=0.01")[0] == 0

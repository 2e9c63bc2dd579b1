"""Names of result folders: the scenario and its overrides."""

from pathlib import Path

import pytest

from tests.refusals import refused
from yawbench.foundation.errors import ScenarioError
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.results.folder_names import LONGEST, default_folder

FILE = Path("scenarios/paper/25mps.yaml")


def folder(*changes, **given):
    return default_folder(
        FILE, [Override.of(place, value, "--set") for place, value in changes], **given
    ).as_posix()


def test_a_plain_run_has_the_name_of_its_scenario():
    assert folder() == "results/paper/25mps"
    assert folder(suffix="-compare") == "results/paper/25mps-compare"


def test_overrides_follow_the_name():
    assert folder(("controller", "controller_off"), ("vehicle.mass", 1200), ("stop_time", 0.5)) == (
        "results/paper/25mps,controller=controller_off,vehicle.mass=1200,stop_time=0.5"
    )


def test_characters_that_no_path_can_hold_are_replaced_and_a_hash_added():
    all_wheels, told = folder(("inputs.friction*", 0.3)), folder(("inputs.friction_", 0.3))
    assert all_wheels.startswith("results/paper/25mps,inputs.friction_=0.3~")
    assert told == "results/paper/25mps,inputs.friction_=0.3"
    assert folder(("plant.initial_speed", "80 km/h")).startswith(
        "results/paper/25mps,plant.initial_speed=80_km_h~"
    )
    here, there = folder(("controller", "/a/it.fmu")), folder(("controller", "/b/it.fmu"))
    assert here != there
    assert here.startswith("results/paper/25mps,controller=it.fmu~")


def test_a_long_name_is_cut_and_a_hash_added():
    many = [(f"unit.parameter_{i}", i) for i in range(40)]
    name = Path(folder(*many)).name
    assert len(name) <= LONGEST
    assert name != Path(folder(*many[:-1], ("unit.parameter_39", 0))).name


def test_a_name_may_be_given():
    assert folder(("controller", "controller_off"), name="no control") == "results/paper/no control"


@pytest.mark.parametrize("name", ["", ".", "..", "a/b", "a\\b", "a\nb", "x" * 300])
def test_an_invalid_folder_name_is_refused(name):
    with refused(ScenarioError, names=("--name", "--out") if "\n" not in name else ("--name",)):
        folder(name=name)


@pytest.mark.parametrize(
    "file", ["../a.yaml", "../../a.yaml", "a/../../a.yaml", "/a.yaml", "./a.yaml", "a/./b.yaml"]
)
def test_a_default_folder_is_below_results_whatever_the_path_of_the_file(file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for changes in ((), (Override.of("controller", "../../off", "--swap"),)):
        parts = default_folder(Path(f"{file}.yaml"), changes, suffix="-compare").parts
        assert parts[0] == "results"
        assert ".." not in parts
        assert 2 <= len(parts) <= 3


@pytest.mark.parametrize("file", ["a/...yaml", "a/..yaml", "..."])
def test_a_file_that_no_folder_can_be_called_after_is_a_sentence(file):
    with refused(ScenarioError, "folder-invalid", names=("--out", file)):
        default_folder(Path(file))

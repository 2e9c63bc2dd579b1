"""Scenario files: what is read, and the sentence for everything that can be wrong with one."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from orchestrator.errors import ScenarioError
from orchestrator.names import SignalName
from orchestrator.scenario.load import ScenarioSpec, load_scenario
from tests.changed import changed
from tests.sentences import golden, golden_in, texts_of

GOOD = """\
title: Single sine
stop_time: 8.0
step_size: 1 ms
inputs: {"friction*": 0.65}
units:
  driver: {fmu: driver_sine, parameters: {amplitude: 5 deg}}
  controller: {fmu: controller_off, step_size: 0.002}
  plant:
    fmu: plant_seven_dof
connections:
  - {from: controller.torque_request_*, to: plant.wheel_torque_*}
"""


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A scenario that is all right, `a.yaml` in the working directory."""
    monkeypatch.chdir(tmp_path)
    path = Path("a.yaml")
    path.write_text(GOOD, encoding="utf-8")
    return path


def write(text: str) -> Path:
    path = Path("a.yaml")
    path.write_text(text, encoding="utf-8")
    return path


def edited(*replacements: tuple[str, str]) -> Path:
    """Write the good scenario with some text replaced."""
    text = GOOD
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new, 1)
    return write(text)


def problems(path: Path, **options: Any) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path, changes=changed(**options))
    assert caught.value.exit_status == 2
    return [*texts_of(caught.value)]


def test_everything_in_the_file_is_read(file: Path) -> None:
    scenario = load_scenario(file)
    assert scenario.path == file
    assert scenario.title == "Single sine"
    assert (scenario.stop_time, scenario.step_size) == (Fraction(8), Fraction(1, 1000))
    assert scenario.algorithm == "extrapolated"
    assert scenario.inputs == {"friction*": 0.65}
    assert list(scenario.units) == ["driver", "controller", "plant"]
    assert scenario.units["driver"].parameters == {"amplitude": "5 deg"}
    assert scenario.units["controller"].step_size == Fraction(1, 500)
    assert scenario.connections[0].source == SignalName("controller", "torque_request_*")
    assert scenario.connections[0].target == SignalName("plant", "wheel_torque_*")
    assert scenario.record is None


def test_a_scenario_as_run_is_plain_data_with_the_options_in_it(file: Path) -> None:
    scenario = load_scenario(
        file,
        changes=changed(["controller=controller_fnn"], ["driver.amplitude=0.1"], step_size=0.0005),
    )
    as_run = json.loads(json.dumps(scenario.as_run()))
    assert as_run["units"]["controller"]["fmu"] == "controller_fnn"
    assert as_run["units"]["driver"]["parameters"] == {"amplitude": 0.1}
    assert as_run["step_size"] == 0.0005
    assert as_run["vehicle_parameters"] == {}


def test_the_schema_can_be_printed() -> None:
    assert set(ScenarioSpec.model_json_schema()["properties"]) == set(ScenarioSpec.model_fields)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "stop_time: 8.0",
            "stop_tim: 8.0",
            [
                "a.yaml:1: 'stop_time' is missing",
                "a.yaml:2: stop_tim: unknown key; did you mean 'stop_time'? allowed here: title, source, "
                "vehicle, tyres, start_time, stop_time, step_size, algorithm, friction, speed, inputs, "
                "units, connections, record and faults",
            ],
        ),
        (
            "fmu: driver_sine, parameters",
            "fmu: driver_sine, parametres",
            [
                "a.yaml:6: units.driver.parametres: unknown key; did you mean 'parameters'? "
                "allowed here: fmu, step_size, parameters, tolerance and validate"
            ],
        ),
        (
            "{from: controller.torque_request_*, to:",
            "{from: controller.torque_request_*, too:",
            [
                "a.yaml:11: connections[0]: 'to' is missing",
                "a.yaml:11: connections[0].too: unknown key; did you mean 'to'? allowed here: from, to, "
                "gain and offset",
            ],
        ),
        (
            "step_size: 1 ms",
            "step_size: 1 ms\nalgorithm: jakobi",
            ["a.yaml:4: algorithm: must be 'jacobi', 'gauss_seidel' or 'extrapolated' (got 'jakobi')"],
        ),
        ("title: Single sine", "title: 5", ["a.yaml:1: title: must be text (got 5)"]),
        ("fmu: driver_sine", "fmu: 5", ["a.yaml:6: units.driver.fmu: must be text (got 5)"]),
        ("fmu: driver_sine", "fmu: ''", ["a.yaml:6: units.driver.fmu: must be text (got '')"]),
        ("8.0", "soon", ["a.yaml:2: stop_time: 'soon' is neither a number in s nor a number with its unit"]),
        ("8.0", "0", ["a.yaml:2: stop_time: must be a time above 0 s (got 0)"]),
        ("8.0", "", ["a.yaml:2: stop_time: must be a time in s (got nothing)"]),
        (
            "8.0",
            "8.0005",
            [
                "a.yaml:2: stop_time: 8.0005 s is no integer multiple of the communication step 0.001 s; "
                "nearest allowed: 8 s or 8.001 s"
            ],
        ),
        (
            "step_size: 0.002",
            "step_size: 0.5 ms",
            [
                "a.yaml:7: units.controller.step_size: 0.0005 s is no integer multiple of the communication "
                "step 0.001 s; nearest allowed: 0.001 s"
            ],
        ),
        ("0.65", ".nan", ["a.yaml:4: inputs.friction*: must be a finite number (got nan)"]),
        ("5 deg", "[1, 2]", ["a.yaml:6: units.driver.parameters.amplitude: must be one value (got [1, 2])"]),
        ("5 deg", "", ["a.yaml:6: units.driver.parameters.amplitude: has no value"]),
        (
            "  driver: {",
            "  my driver: {",
            ["a.yaml:6: units.my driver: 'my driver' cannot name a unit: use letters, digits and _"],
        ),
        (
            "  driver: {",
            "  vehicle: {",
            [
                "a.yaml:6: units.vehicle: a unit cannot be named 'vehicle': "
                "--set vehicle.NAME means something else"
            ],
        ),
        (
            "from: controller.",
            "from: contoller.",
            ["a.yaml:11: connections[0].from: there is no unit 'contoller'; did you mean 'controller'?"],
        ),
        (
            "to: plant.wheel_torque_*",
            "to: tyre.wheel_torque_*",
            ["a.yaml:11: connections[0].to: there is no unit 'tyre'; units: driver, controller and plant"],
        ),
        (
            "to: plant.wheel_torque_*",
            "to: plant",
            [
                "a.yaml:11: connections[0].to: must be unit.variable, with at most one * in variable "
                "(got 'plant')"
            ],
        ),
        (
            "connections:",
            "record: [plnt.yaw_rate]\nconnections:",
            ["a.yaml:10: record[0]: there is no unit 'plnt'; did you mean 'plant'?"],
        ),
        ("connections:\n  - {from", "connections:\n  {from", ["a.yaml:10: connections: must be a list"]),
        (
            "  plant:\n    fmu: plant_seven_dof",
            "  plant: {fmu: a}\n  plant: {fmu: b}",
            ["a.yaml:9: units.plant is given twice, first in line 8"],
        ),
    ],
)
def test_a_mistake_is_said_with_its_line(file: Path, old: str, new: str, expected: list[str]) -> None:
    found = problems(edited((old, new)))
    assert len(found) == len(expected)
    for problem, start in zip(found, expected, strict=True):
        assert problem.startswith(start) if start.endswith("a list") else problem == start


def test_all_mistakes_are_said_at_once_from_top_to_bottom(file: Path) -> None:
    found = problems(
        edited(("title: Single", "titel: Single"), ("0.002", "0.0025"), ("driver_sine", "5"), ("8.0", "-1"))
    )
    assert [text.split(": ")[:2] for text in found] == [
        ["a.yaml:1", "titel"],
        ["a.yaml:2", "stop_time"],
        ["a.yaml:6", "units.driver.fmu"],
        ["a.yaml:7", "units.controller.step_size"],
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "a.yaml: this scenario file is empty"),
        ("null\n", "a.yaml: this scenario file is empty"),
        ("a: " + 5000 * "[", "a.yaml:1: not valid YAML: more than 40 brackets in each other"),
        ("- 1\n", "a.yaml:1: must be a mapping (got [1])"),
        ("a: [1, 2\nb: 3\n", "a.yaml:2: not valid YAML: while parsing a flow sequence expected ',' or ']'"),
        ("a:\n\t- b\n", "a.yaml:2: not valid YAML: while scanning for the next token found character '\\t'"),
        ("a: &x [*x]\n", "a.yaml:1: a[0]: this alias contains itself"),
    ],
)
def test_what_is_no_scenario_at_all_is_said(file: Path, text: str, expected: str) -> None:
    assert problems(write(text))[0].startswith(expected)


def test_a_missing_file_is_said_with_a_guess(file: Path) -> None:
    assert golden(problems(Path("aa.yaml")))
    assert golden(problems(Path("25mps.yaml")))


def test_a_folder_and_a_binary_file_are_no_scenarios(file: Path) -> None:
    Path("d.yaml").mkdir()
    Path("e.yaml").write_bytes(b"\xff\xfe\x00")
    assert golden(problems(Path("d.yaml")))
    assert golden(problems(Path("e.yaml")))


def test_a_path_with_spaces_and_umlauts_is_read(file: Path) -> None:
    path = Path("Läufe 2/mit Wörtern.yaml")
    path.parent.mkdir()
    path.write_text(GOOD.replace("Single sine", "Einfacher Sinus, µ 0,65"), encoding="utf-8")
    assert load_scenario(path).title == "Einfacher Sinus, µ 0,65"


def test_vehicle_parameters_come_from_beside_the_scenario(file: Path) -> None:
    Path("cars").mkdir()
    Path("cars/car.yaml").write_text("title: Car\nparameters: {mass: 1.1 t}\n")
    scenario = load_scenario(edited(("title:", "vehicle: cars/car.yaml\ntitle:")))
    assert scenario.vehicle_file.parameters == {"mass": "1.1 t"}


def test_mistakes_in_the_vehicle_file_name_that_file(file: Path) -> None:
    Path("cars").mkdir()
    Path("cars/car.yaml").write_text("mass: 1100\nparameters: {mass: .inf}\n")
    found = problems(edited(("title:", "vehicle: cars/car.yaml\ntitle:"), ("0.65", ".nan")))
    assert golden(found)


def test_a_missing_vehicle_file_is_said_where_it_is_named(file: Path) -> None:
    Path("car.yaml").write_text("parameters: {}\n")
    assert golden(problems(edited(("title:", "vehicle: cra.yaml\ntitle:"))))


def test_a_vehicle_path_that_cannot_be_one_is_said(file: Path) -> None:
    said = problems(edited(("title:", 'vehicle: "a\\0"\ntitle:')))
    assert golden(said[0])
    assert golden_in(said[1])


def test_swap_replaces_the_fmu_and_remembers_the_old_one(file: Path) -> None:
    scenario = load_scenario(file, changes=changed(["controller=controller_fnn"]))
    assert scenario.units["controller"].fmu == "controller_fnn"
    assert scenario.replaced == {"controller": "controller_off"}


def test_swapped_paths_are_relative_to_the_working_directory(file: Path) -> None:
    Path("deep").mkdir()
    Path("deep/b.yaml").write_text(GOOD)
    scenario = load_scenario(Path("deep/b.yaml"), changes=changed(["controller=my.fmu"]))
    assert scenario.units["controller"].fmu == str(Path("my.fmu").absolute())


def test_settings_change_parameters_constants_and_the_vehicle(file: Path) -> None:
    scenario = load_scenario(
        file,
        changes=changed(
            settings=[
                "driver.amplitude=2 deg",
                "driver.mode=lane change",
                "plant.initial_speed=25",
                "plant.locked=true",
                "inputs.friction_fl=0.3",
                "vehicle.mass=1200 kg",
            ]
        ),
    )
    assert scenario.units["driver"].parameters == {"amplitude": "2 deg", "mode": "lane change"}
    assert scenario.units["plant"].parameters == {"initial_speed": 25, "locked": True}
    assert scenario.inputs == {"friction*": 0.65, "friction_fl": 0.3}
    assert scenario.vehicle_file.parameters == {"mass": "1200 kg"}


def test_settings_change_times_and_algorithm_of_the_run_and_steps_of_units(file: Path) -> None:
    scenario = load_scenario(
        file,
        changes=changed(
            settings=["stop_time=2 s", "step_size=5 ms", "algorithm=jacobi", "controller.step_size=0.01"]
        ),
    )
    assert (scenario.stop_time, scenario.step_size) == (2, Fraction(1, 200))
    assert scenario.algorithm == "jacobi"
    assert scenario.units["controller"].step_size == Fraction(1, 100)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (
            {"swaps": ["contoller=x"]},
            "--swap contoller=x: the scenario has no unit 'contoller'; did you mean 'controller'?",
        ),
        ({"swaps": ["controller"]}, "--swap controller: write --swap UNIT=FMU"),
        ({"swaps": ["controller="]}, "--swap controller=: write --swap UNIT=FMU"),
        (
            {"settings": ["tyre.mu=1"]},
            "--set tyre.mu=1: the scenario has no unit 'tyre'; it has: "
            "driver, controller, plant, vehicle and inputs",
        ),
        (
            {"settings": ["stop=3"]},
            "--set stop=3: write --set UNIT.PARAMETER=VALUE, or start_time, stop_time, step_size, algorithm, "
            "friction or speed=VALUE",
        ),
        (
            {"settings": ["step_size=0.0015"]},
            "a.yaml:2: stop_time: 8 s is no integer multiple of the communication step 0.0015 s "
            "(--set step_size=0.0015); nearest allowed: 7.9995 s or 8.001 s",
        ),
        ({"settings": ["driver.amplitude="]}, None),
        (
            {"settings": ["driver.amplitude=.inf"]},
            "--set driver.amplitude=inf: must be a finite number (got inf)",
        ),
        (
            {"step_size": 0.0015},
            "a.yaml:2: stop_time: 8 s is no integer multiple of the communication step 0.0015 s "
            "(test step_size=0.0015); nearest allowed: 7.9995 s or 8.001 s",
        ),
        ({"step_size": -1.0}, "test step_size=-1.0: must be a time above 0 s (got -1.0)"),
        (
            {"algorithm": "euler"},
            "test algorithm=euler: must be 'jacobi', 'gauss_seidel' or 'extrapolated' (got 'euler')",
        ),
    ],
)
def test_a_wrong_option_is_named(file: Path, options: dict[str, Any], expected: str | None) -> None:
    if expected is None:
        assert load_scenario(file, changes=changed(**options)).units["driver"].parameters["amplitude"] == ""
    else:
        assert expected in problems(file, **options)


def test_times_can_be_overridden_exactly(file: Path) -> None:
    scenario = load_scenario(file, changes=changed(step_size=0.00025, stop_time="2 s", algorithm="jacobi"))
    assert (scenario.step_size, scenario.stop_time) == (Fraction(1, 4000), Fraction(2))
    assert scenario.algorithm == "jacobi"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "runs: [{scenario: b.yaml}]",
            "a study file, not a scenario; it is for `yawbench study` and `report`",
        ),
        ("axes: {}\nruns: 3", "a sweep file, not a scenario; it is for `yawbench sweep`"),
        ("parameters: {mass: 3}", "a vehicle file, not a scenario; a scenario names it under 'vehicle'"),
    ],
)
def test_a_file_of_another_kind_is_one_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "other.yaml"
    path.write_text(text, encoding="utf-8")
    assert problems(path) == [f"{path}:1: {sentence}"]
    scenario = tmp_path / "a.yaml"
    scenario.write_text(GOOD.replace("stop_time", "vehicle: other.yaml\nstop_time"), encoding="utf-8")
    if "vehicle" not in sentence:
        swapped = sentence.replace("not a scenario", "not a vehicle file")
        assert f"{path}:1: {swapped}" in problems(scenario)

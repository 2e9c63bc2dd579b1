"""Scenario files: what is read, and the sentence for everything that can be wrong with one."""

from __future__ import annotations

import json
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from tests.changed import changed
from tests.refusals import each_mentions, mentions, places_of, told
from yawbench.foundation.errors import Diagnostic, ScenarioError
from yawbench.orchestrator.plan import Given, ValueSource
from yawbench.orchestrator.scenario.loader import load_scenario
from yawbench.orchestrator.signal_names import SignalName

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


def values_in(given: Mapping[str, Given[Any]]) -> dict[str, Any]:
    return {name: each.value for name, each in given.items()}


def problems(path: Path, **options: Any) -> list[Diagnostic]:
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path, changes=changed(**options))
    return caught.value.diagnostics


def test_everything_in_the_file_is_read(file: Path) -> None:
    scenario = load_scenario(file)
    assert scenario.path == file
    assert scenario.title == "Single sine"
    assert (scenario.stop_time, scenario.step_size) == (Fraction(8), Fraction(1, 1000))
    assert scenario.algorithm == "extrapolated"
    assert values_in(scenario.inputs) == {"friction*": 0.65}
    assert list(scenario.units) == ["driver", "controller", "plant"]
    assert values_in(scenario.units["driver"].parameters) == {"amplitude": "5 deg"}
    assert scenario.units["controller"].step_size == Fraction(1, 500)
    assert scenario.connections[0].source == SignalName("controller", "torque_request_*")
    assert scenario.connections[0].target == SignalName("plant", "wheel_torque_*")
    assert scenario.record is None


def test_a_scenario_as_run_is_plain_data_with_the_options_in_it(file: Path) -> None:
    changes = changed(["controller=controller_fnn"], ["driver.amplitude=0.1"], step_size=0.0005)
    as_run = json.loads(json.dumps(load_scenario(file, changes=changes).as_run()))
    assert as_run["units"]["controller"]["fmu"] == "controller_fnn"
    assert as_run["units"]["driver"]["parameters"] == {"amplitude": 0.1}
    assert as_run["step_size"] == 0.0005
    assert as_run["vehicle_parameters"] == {}


@pytest.mark.parametrize(
    ("old", "new", "lines"),
    [
        (
            "stop_time: 8.0",
            "stop_tim: 8.0",
            "key-missing | a.yaml:1 | 'stop_time'\n"
            "key-unknown | a.yaml:2: stop_tim | 'stop_time' | title | faults",
        ),
        (", parameters", ", parametres", "key-unknown | a.yaml:6: units.driver.parametres | 'parameters'"),
        (
            ", to:",
            ", too:",
            "key-missing | a.yaml:11: connections[0] | 'to'\n"
            "key-unknown | a.yaml:11: connections[0].too | 'to' | gain | offset | delay",
        ),
        ("units:", "algorithm: x\nunits:", "value-invalid | a.yaml:5: algorithm | 'jacobi' | 'x'"),
        ("Single sine", "5", "value-wrong-type | a.yaml:1: title | 5"),
        ("fmu: driver_sine", "fmu: ''", "value-wrong-type | a.yaml:6: units.driver.fmu | ''"),
        ("8.0", "soon", "value-invalid | a.yaml:2: stop_time | 'soon'"),
        ("8.0", "0", "value-invalid | a.yaml:2: stop_time | 0 s"),
        ("8.0", "", "value-invalid | a.yaml:2: stop_time"),
        ("8.0", "8.0005", "time-grid-invalid | a.yaml:2: stop_time | 8.0005 s | 0.001 s | 8 s | 8.001 s"),
        ("0.002", "0.5 ms", "time-grid-invalid | a.yaml:7: units.controller.step_size | 0.0005 s | 0.001 s"),
        ("0.65", ".nan", "value-invalid | a.yaml:4: inputs.friction* | nan"),
        ("5 deg", "[1, {a: 2}]", "value-invalid | a.yaml:6: units.driver.parameters.amplitude | {'a': 2}"),
        ("5 deg", "", "value-invalid | a.yaml:6: units.driver.parameters.amplitude"),
        ("  driver:", "  my driver:", "value-invalid | a.yaml:6: units.my driver | 'my driver' | digits | _"),
        ("  driver:", "  vehicle:", "value-invalid | a.yaml:6: units.vehicle | --set | vehicle.NAME"),
        ("  driver:", "  tyres:", "value-invalid | a.yaml:6: units.tyres | 'tyres' | --set | tyres.NAME"),
        ("from: con", "from: cn", "instance-unknown | a.yaml:11: connections[0].from | 'controller'"),
        (
            "to: plant.",
            "to: tyre.",
            "instance-unknown | a.yaml:11: connections[0].to | 'tyre' | driver | plant",
        ),
        ("to: plant.", "to: ", "value-invalid | a.yaml:11: connections[0].to | instance.variable"),
        ("units:", "record: [plnt.yaw]\nunits:", "instance-unknown | a.yaml:5: record[0] | 'plnt' | 'plant'"),
        ("  - {from", "  {from", "value-wrong-type | a.yaml:10: connections | 'from' | 'to'"),
        ("  plant:", "  plant: {fmu: a}\n  plant:", "key-duplicate | a.yaml:9 | units.plant | line 8"),
    ],
)
def test_a_mistake_is_said_with_its_line(file: Path, old: str, new: str, lines: str) -> None:
    assert told(problems(edited((old, new))), lines)


def test_all_mistakes_are_said_at_once_from_top_to_bottom(file: Path) -> None:
    found = problems(
        edited(("title: Single", "titel: Single"), ("0.002", "0.0025"), ("driver_sine", "5"), ("8.0", "-1"))
    )
    assert [one.location.line for one in found] == [1, 2, 6, 7]


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("", "file-empty | a.yaml | scenario | empty"),
        ("null\n", "file-empty | a.yaml | scenario | empty"),
        ("- 1\n", "value-wrong-type | a.yaml:1 | [1]"),
        ("a: [1, 2\nb: 3\n", "file-not-yaml | a.yaml:2 | ',' | ']' | ':'"),
        ("a:\n\t- b\n", "file-not-yaml | a.yaml:2 | '\\t'"),
    ],
)
def test_what_is_no_scenario_at_all_is_said(file: Path, text: str, lines: str) -> None:
    assert told(problems(write(text)), lines)


@pytest.mark.parametrize(
    ("name", "code", "names"),
    [
        ("aa.yaml", "file-missing", "'a.yaml'"),
        ("25mps.yaml", "file-missing", "a.yaml"),
        ("folder.yaml", "file-unreadable", "scenario"),
        ("binary.yaml", "file-unreadable", "scenario"),
    ],
)
def test_what_cannot_be_read_is_said_with_a_guess_if_it_is_missing(file: Path, name, code, names) -> None:
    Path("folder.yaml").mkdir()
    Path("binary.yaml").write_bytes(b"\xff\xfe\x00")
    assert told(problems(Path(name)), f"{code} | {name} | {names}")


OF_CAR = ("title:", "vehicle: cars/car.yaml\ntitle:")


def write_car(text: str) -> None:
    Path("cars").mkdir()
    Path("cars/car.yaml").write_text(text)


def test_vehicle_parameters_come_from_beside_the_scenario(file: Path) -> None:
    write_car("title: Car\nparameters: {mass: 1.1 t}\n")
    scenario = load_scenario(edited(OF_CAR))
    assert values_in(scenario.vehicle_file.parameters) == {"mass": "1.1 t"}


def test_mistakes_in_the_vehicle_file_name_that_file(file: Path) -> None:
    write_car("mass: 1100\nparameters: {mass: .inf}\n")
    assert each_mentions(
        problems(edited(OF_CAR, ("0.65", ".nan"))),
        ("a.yaml:5", "inputs.friction*", "nan"),
        ("cars/car.yaml:1", "title", "source", "tyres", "parameters"),
        ("cars/car.yaml:2", "parameters.mass", "inf"),
    )


def test_a_vehicle_path_that_cannot_be_one_is_said(file: Path) -> None:
    write_car("parameters: {}\n")
    missing = problems(edited(("title:", "vehicle: cars/cra.yaml\ntitle:")))
    assert each_mentions(missing, ("a.yaml:1", "cra.yaml", "'cars/car.yaml'"))
    assert each_mentions(
        problems(write('vehicle: "a\\0"\n' + GOOD)),
        ("a.yaml:1", "control", "character"),
        ("vehicle", "file", "null"),
    )


def test_a_swap_replaces_the_fmu_by_a_path_from_the_working_directory_and_remembers_the_old_one(
    file: Path,
) -> None:
    Path("deep").mkdir()
    scenario = load_scenario(file.rename("deep/b.yaml"), changes=changed(["controller=my.fmu"]))
    assert scenario.units["controller"].fmu == str(Path("my.fmu").absolute())
    assert scenario.replaced == {"controller": "controller_off"}


def test_settings_change_parameters_constants_and_the_vehicle(file: Path) -> None:
    settings = ["driver.amplitude=2 deg", "driver.mode=lane change", "plant.initial_speed=25"]
    settings += ["plant.locked=true", "plant.note=", "inputs.friction_fl=0.3", "vehicle.mass=1200 kg"]
    scenario = load_scenario(file, changes=changed(settings=settings))
    assert values_in(scenario.units["driver"].parameters) == {"amplitude": "2 deg", "mode": "lane change"}
    assert values_in(scenario.units["plant"].parameters) == {"initial_speed": 25, "locked": True, "note": ""}
    assert values_in(scenario.inputs) == {"friction*": 0.65, "friction_fl": 0.3}
    assert values_in(scenario.vehicle_file.parameters) == {"mass": "1200 kg"}


def test_a_value_keeps_its_unit_origin_and_place(file: Path) -> None:
    path = edited(("title:", "source: paper A\ntitle:"), ("5 deg}}", "5 deg}}  # chosen: small"))
    changes = changed(settings=["driver.amplitude=0.1 rad", "inputs.friction*=0.3"])
    of_file = load_scenario(path).units["driver"].parameters["amplitude"]
    loaded = load_scenario(path, changes=changes)
    of_option = loaded.units["driver"].parameters["amplitude"]
    place = "a.yaml:7: units.driver.parameters.amplitude"
    assert (of_file.value, of_file.unit, of_file.changed) == ("5 deg", "deg", False)
    assert (of_file.origin.kind, str(of_file.where)) == ("scenario", place)
    assert of_file.origin.source == ValueSource("chosen", "chosen: small", "a.yaml", 7)
    assert (of_option.value, of_option.unit, of_option.changed) == ("0.1 rad", "rad", True)
    assert (of_option.origin.kind, str(of_option.where)) == ("--set", "--set driver.amplitude=0.1 rad")
    assert of_option.replaces == of_file
    assert loaded.inputs["friction*"].unit == ""


def test_settings_change_times_and_algorithm_of_the_run_and_steps_of_units(file: Path) -> None:
    settings = ["stop_time=2 s", "step_size=5 ms", "algorithm=jacobi", "controller.step_size=0.01"]
    scenario = load_scenario(file, changes=changed(settings=settings))
    assert (scenario.stop_time, scenario.step_size) == (2, Fraction(1, 200))
    assert scenario.algorithm == "jacobi"
    assert scenario.units["controller"].step_size == Fraction(1, 100)


@pytest.mark.parametrize(
    ("options", "lines"),
    [
        ({"swaps": ["contoller=x"]}, "instance-unknown | --swap contoller=x | 'contoller' | 'controller'"),
        (
            {"swaps": ["controller"]},
            "option-invalid |  | --swap controller | --swap INSTANCE=FMU | controller",
        ),
        ({"swaps": ["controller="]}, "option-invalid |  | --swap INSTANCE=FMU | controller"),
        ({"settings": ["tyre.mu=1"]}, "instance-unknown | --set tyre.mu=1 | 'tyre' | driver | inputs"),
        (
            {"settings": ["stop=3"]},
            "option-invalid |  | --set stop=3 | --set INSTANCE.PARAMETER=VALUE | start_time | stop_time"
            " | step_size | speed=VALUE",
        ),
        ({"settings": ["driver.amplitude=.inf"]}, "value-invalid | --set driver.amplitude=inf | finite"),
        (
            {"step_size": 0.0015},
            "time-grid-invalid | a.yaml:2: stop_time | 8 s | 0.0015 s | step_size=0.0015 | 7.9995 s"
            " | 8.001 s\n"
            "time-grid-invalid | a.yaml:7: units.controller.step_size",
        ),
        ({"step_size": -1.0}, "value-invalid | test step_size=-1.0 | 0 s"),
        (
            {"algorithm": "euler"},
            "value-invalid | test algorithm=euler | 'jacobi' | 'gauss_seidel' | 'extrapolated' | 'euler'",
        ),
    ],
)
def test_a_wrong_option_is_named(file: Path, options: dict[str, Any], lines: str) -> None:
    assert told(problems(file, **options), lines)


@pytest.mark.parametrize(
    "text, names",
    [
        ("runs: [{scenario: b.yaml}]", ("`yawbench study`", "`report`")),
        ("axes: {}\nruns: 3", ("`yawbench sweep`",)),
        ("parameters: {mass: 3}", ("'vehicle'",)),
    ],
)
def test_a_file_of_another_kind_is_one_sentence(tmp_path: Path, text: str, names) -> None:
    path = tmp_path / "other.yaml"
    path.write_text(text, encoding="utf-8")
    (found,) = problems(path)
    assert places_of([found]) == [("file-wrong-kind", f"{path}:1")]
    assert mentions(found, "other.yaml:1", *names)
    scenario = tmp_path / "a.yaml"
    scenario.write_text(GOOD.replace("stop_time", "vehicle: other.yaml\nstop_time"), encoding="utf-8")
    if "vehicle" not in found.message:
        (swapped,) = problems(scenario)
        assert places_of([swapped]) == [("file-wrong-kind", f"{path}:1")]
        assert swapped.message == found.message.replace("not a scenario", "not a vehicle file")

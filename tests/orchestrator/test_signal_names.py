"""Names of signals and targets, and variables called as tools for Modelica and FMI 3 call theirs."""

from __future__ import annotations

import math
import re
import zipfile
from itertools import product
from pathlib import Path

import pytest

from tests.changed import changed
from tests.command_line import status_of
from tests.refusals import refused
from yawbench.foundation.errors import WiringError
from yawbench.metrics.expressions import evaluate, metric
from yawbench.orchestrator.results.reader import load_results
from yawbench.orchestrator.scenario.loader import load_scenario
from yawbench.orchestrator.signal_names import SignalName, Target, match, matching
from yawbench.orchestrator.wiring.make_plan import make_plan
from yawbench.studies.experiment import plan_experiment
from yawbench.studies.load_experiment import load_experiment

UNITS = ("driver_sine", "plant_two_dof", "tyre_linear")

NAMES = {
    "plant_two_dof": {
        "yaw_rate": "body.w",
        "sideslip": "x[1]",
        "position_y": "frame[1].y",
        "steer_angle": "u[1]",
    },
    "driver_sine": {"amplitude": "a[1]", "frequency": "wave.f"},
}
"""FMU -> variable -> its other name."""
SCENARIO = """\
title: Other names
stop_time: 3
step_size: 10 ms
inputs: {yaw_moment: 0}
friction: 0.9
units:
  driver: {fmu: driver_sine, parameters: {"a[1]": 2 deg, wave.f: 0.5}}
  plant: {fmu: plant_two_dof, parameters: {initial_speed: 20}}
  tyre: {fmu: tyre_linear}
connections:
  - {from: driver.steer_angle, to: "plant.u[1]"}
"""


def test_the_first_dot_of_a_name_separates_the_instance():
    assert SignalName.parse("plant.body.w") == ("plant", "body.w")
    assert SignalName.parse("plant.frame[1.5].x") == ("plant", "frame[1.5].x")
    assert SignalName.parse("yaw_rate") == ("", "yaw_rate")
    assert [str(SignalName.parse(text)) for text in ("plant.x[1]", "time")] == ["plant.x[1]", "time"]


def test_a_key_of_inputs_names_an_instance_only_if_there_is_one():
    assert SignalName.parse_input("tyre.friction_*", ["tyre"]) == ("tyre", "friction_*")
    assert SignalName.parse_input("body.u", ["tyre"]) == ("*", "body.u")


@pytest.mark.parametrize(
    "text, target",
    [
        ("stop_time", Target("run", variable="stop_time")),
        ("friction", Target("fact", variable="friction")),
        ("vehicle", Target("vehicle_file")),
        ("vehicle.mass", Target("vehicle_parameter", variable="mass")),
        ("tyres", Target("tyres")),
        ("tyres.rear", Target("tyres", variable="rear")),
        ("inputs.tyre.friction_*", Target("input", variable="tyre.friction_*")),
        ("faults.plant.x[1] -> sensor", Target("faults", variable="plant.x[1] -> sensor")),
        ("controller", Target("fmu", "controller")),
        ("plant.step_size", Target("setting", "plant", "step_size")),
        ("plant.body.m", Target("parameter", "plant", "body.m")),
    ],
)
def test_a_target_is_parsed_and_written_back(text, target):
    assert Target.parse(text) == target
    assert str(target) == text


@pytest.mark.parametrize("text", ["", ".", ".mass", "plant.", "inputs."])
def test_a_target_without_one_of_its_parts_is_refused(text):
    with pytest.raises(ValueError, match=re.escape(repr(text))):
        Target.parse(text)


def test_only_the_star_of_a_pattern_is_special():
    names = ["x[1]", "x[2]", "x1", "body.w", "bodyxw"]
    assert list(matching("x[1]", names).values()) == ["x[1]"]
    assert matching("x[*]", names) == {"1": "x[1]", "2": "x[2]"}
    assert list(matching("*.w", names).values()) == ["body.w"]
    assert [match("a*b", name) for name in ("ab", "a.b", "aXbc", "a\nb")] == ["", ".", None, "\n"]
    assert [match("a?", name) for name in ("a?", "ab")] == ["", None]


@pytest.fixture
def folder(fmus, tmp_path, monkeypatch) -> Path:
    """A folder with the scenario and FMUs whose variables have the other names."""
    for name in UNITS:
        _rename(fmus / f"{name}.fmu", tmp_path / "fmus" / f"{name}.fmu", NAMES.get(name, {}))
    (tmp_path / "other.yaml").write_text(SCENARIO)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("YAWBENCH_NO_BUILD", "1")
    return tmp_path


def _rename(fmu: Path, target: Path, names: dict[str, str]) -> None:
    target.parent.mkdir(exist_ok=True)
    with zipfile.ZipFile(fmu) as given, zipfile.ZipFile(target, "w") as made:
        for item in given.infolist():
            content = given.read(item)
            if item.filename == "modelDescription.xml":
                for old, new in names.items():
                    assert f'name="{old}"'.encode() in content
                    content = content.replace(f'name="{old}"'.encode(), f'name="{new}"'.encode())
            made.writestr(item, content)


@pytest.fixture
def results(folder):
    """The results of a run."""
    given = ["--set", "driver.a[1]=3 deg", "--set", "driver.wave.f=1"]
    assert status_of("run", "other.yaml", *given, "--out", "out") == 0
    return load_results(Path("out"))


METRICS = {
    "peak(plant.x[1])": lambda made: abs(made["plant.x[1]"]).max(),
    "peak(body.w)": lambda made: abs(made["plant.body.w"]).max(),
    "final(plant.frame[1].y)": lambda made: made["plant.frame[1].y"][-1],
    "rms(plant.x[1] - plant.x[1])": lambda made: 0,
}


def test_parameters_columns_wires_metrics_and_series_have_such_names(results, folder):
    assert {"plant.body.w", "plant.x[1]", "plant.frame[1].y"} <= set(results)
    assert results.find("body.w") is results["plant.body.w"]
    assert abs(results["plant.body.w"]).max() > 0
    assert [one.place for one in results.record.changes] == ["driver.a[1]", "driver.wave.f"]
    for name, value in METRICS.items():
        assert metric(name).name == name
        assert evaluate(results, metric(name)).number == value(results)
    series = 'inputs: {"u[1]": {file: out/results.csv, column: "plant.x[1]"}, '
    (folder / "again.yaml").write_text(SCENARIO.split("connections:")[0].replace("inputs: {", series))
    (read,) = plant_of(planned("again.yaml")).series.values()
    assert read.values.tolist() == results["plant.x[1]"].tolist()


def test_a_scenario_records_them_by_name_and_by_pattern(folder):
    record = 'record: ["plant.x[1]", "plant.frame[*].y", "*.{}w"]\n'
    (folder / "other.yaml").write_text(SCENARIO + record.format(""))
    with refused(WiringError, "variable-unknown", names=("'w'",)):  # only the first dot separates
        planned("other.yaml")
    (folder / "other.yaml").write_text(SCENARIO + record.format("body."))
    made = [str(one) for one in planned("other.yaml").record]
    assert made == ["plant.x[1]", "plant.frame[1].y", "plant.body.w"]


SWEEP = """\
title: Levels
scenario: other.yaml
axes:
  a: {vary: "driver.a[1]", values: [1, 2], unit: deg}
  f: {vary: driver.wave.f, values: [500, 1000], unit: mHz}
  u: {vary: "inputs.u[1]", values: [1, 2], unit: deg}
metrics:
  most: {metric: "peak(plant.x[1])"}
"""


def test_levels_of_axes_are_converted_to_the_unit_of_the_parameter_or_input(folder):
    (folder / "other.yaml").write_text(SCENARIO.split("connections:")[0])
    (folder / "sweep.yaml").write_text(SWEEP)
    angles, rates = [math.radians(1), math.radians(2)], [0.5, 1.0]
    plans = [job.plan for job in plan_experiment(load_experiment(folder / "sweep.yaml"), folder / "out").jobs]
    for plan, levels in zip(plans, product(angles, rates, angles), strict=True):
        values = {
            key: value for one in plan.instances for key, value in (one.parameters | one.constants).items()
        }
        assert [values[name] for name in ("a[1]", "wave.f", "u[1]")] == pytest.approx(levels)
    plan = planned("other.yaml", changed(settings=["inputs.plant.u[1]=0.1"]))
    assert plant_of(plan).constants["u[1]"] == 0.1


def planned(name: str, changes=()):
    return make_plan(load_scenario(Path(name), changes=changes), fmus=Path("fmus"))


def plant_of(plan):
    return next(one for one in plan.instances if one.name == "plant")

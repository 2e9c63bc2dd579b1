"""Mistakes that messages once misled about: each is answered by the sentence that mends it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cars import load_scenario, make_plan
from tests.fmus.fake_fmus import Var, make_fmu, out
from tests.refusals import told
from yawbench.foundation.errors import ScenarioError, WiringError
from yawbench.orchestrator.scenario.quantities import exact_text, seconds
from yawbench.studies.load_experiment import load_experiment

pytestmark = pytest.mark.usefixtures("common_cache")

CAR = {"mass": 1650, "yaw_inertia": 2600, "wheelbase": 2.75}
SCENARIO = """\
vehicle: car.yaml
stop_time: {stop}
step_size: {step}
inputs: {{"steer_angle": 0.1{given}}}
units:
  controller: {{fmu: controller_x}}
  plant: {{fmu: plant_x}}
  tyre: {{fmu: tyre_x}}
"""
SWEEP = """\
title: Mass
scenario: a.yaml
axes:
  mass: {{vary: vehicle.mass, unit: kg, values: {values}}}
  steer: {{vary: inputs.steer_angle, values: [0, 1]}}
metrics: {{yaw_rate: {{metric: peak(yaw_rate)}}}}
figures: [{{name: a, title: A, kind: curve, metric: yaw_rate, x: steer, lines: mass, only: {{mass: {only}}}}}]
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    make_fmu(
        tmp_path / "fmus/controller_x.fmu",
        inputs=[Var("PsiDot", "deg/s")],
        outputs=[out("Mz", unit="N.m", variability="discrete")],
    )
    make_fmu(
        tmp_path / "fmus/plant_x.fmu",
        inputs=[Var("steer_angle", "rad"), Var("yaw_moment", "N.m")],
        outputs=[
            out("yaw_rate", unit="rad/s"),
            out("sideslip_rate", unit="rad/s"),
            out("roll_angle", unit="rad"),
        ],
        parameters=[Var("mass", "kg", start=1.0), Var("yaw_inertia", "kg.m2"), Var("wheelbase", "m")],
    )
    make_fmu(tmp_path / "fmus/tyre_x.fmu", outputs=[out("aligning_moment_*", unit="N.m")])
    return tmp_path


def written(folder: Path, *, stop="10", step="1/30 s", given=', "PsiDot": 0, "yaw_moment": 0', **car: float):
    lines = "".join(f"  {name}: {value}\n" for name, value in (CAR | car).items())
    (folder / "car.yaml").write_text(f"parameters:\n{lines}", encoding="utf-8")
    path = folder / "a.yaml"
    path.write_text(SCENARIO.format(stop=stop, step=step, given=given), encoding="utf-8")
    return path


def test_times_are_shown_with_the_digits_that_tell_them_apart():
    assert [exact_text(seconds(one)) for one in ("1/30 s", 0.001, 9.99999999999, "1/3 ms")] == [
        "1/30", "0.001", "9.99999999999", "1/3000",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("changed", "line"),
    [
        (  # told to wire the aligning moment
            {"given": ', "PsiDot": 0'},
            "input-undriven | a.yaml:7: units.plant | plant.yaw_moment | N.m | controller.Mz | 'inputs'",
        ),
        (  # not told of the yaw rate
            {"given": ', "yaw_moment": 0'},
            "input-undriven | a.yaml:6: units.controller | controller.PsiDot | deg/s | plant.yaw_rate"
            " | 'inputs'",
        ),
        (  # "nearest allowed: 10 s", which it was
            {"step": "0.0333333333333"},
            "time-grid-invalid | a.yaml:2: stop_time | 10 s | 0.0333333333333 s | 9.99999999999 s"
            " | 10.0333333333233 s | 1/30 s | step_size",
        ),
        (
            {"step": "0.0333"},
            "time-grid-invalid | a.yaml:2: stop_time | 10 s | 0.0333 s | 9.99 s | 10.0233 s | step_size"
            " | 1/30 s",
        ),
        ({"step": "1/0 s"}, "value-invalid | a.yaml:3: step_size | '1/0 s'"),
    ],
    ids=["moment", "yaw rate", "thirteen digits", "four digits", "zero"],
)
def test_a_mistake_in_a_scenario(folder, changed, line):
    path = written(folder, **changed).relative_to(folder)
    with pytest.raises((ScenarioError, WiringError)) as caught:
        make_plan(load_scenario(path))
    assert told(caught.value.diagnostics, line)


@pytest.mark.parametrize("only", ["1100", "1100 kg", "[1100]", "[1100 kg, '1200']"])
def test_values_of_an_axis_are_named_as_they_are_written(folder, only):
    written(folder)
    (folder / "sweep.yaml").write_text(SWEEP.format(values=[1100, 1200], only=only), encoding="utf-8")
    assert load_experiment(folder / "sweep.yaml").spec.axes

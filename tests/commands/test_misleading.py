"""Ten mistakes that messages once misled about: each is answered by the sentence that mends it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cars import load_scenario, make_plan
from tests.command_line import status_of
from tests.fmus.fake_fmus import Var, make_fmu, out
from tests.refusals import mentions
from yawbench.cli import main
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
    ("changed", "code", "names"),
    [
        (
            {"given": ', "PsiDot": 0'},
            "input-undriven",
            ("a.yaml:7", "units.plant", "plant.yaw_moment", "N.m", "controller.Mz", "'inputs'"),
        ),  # 1: told to wire the aligning moment
        (
            {"given": ', "yaw_moment": 0'},
            "input-undriven",
            ("a.yaml:6", "units.controller", "controller.PsiDot", "deg/s", "plant.yaw_rate", "'inputs'"),
        ),  # 2: not told of the yaw rate
        (
            {"step": "0.0333333333333"},
            "time-grid-invalid",
            (
                "a.yaml:2",
                "stop_time",
                "10 s",
                "0.0333333333333 s",
                "9.99999999999 s",
                "10.0333333333233 s",
                "1/30 s",
                "step_size",
            ),
        ),  # 3: "nearest allowed: 10 s", which it was
        (
            {"step": "0.0333"},
            "time-grid-invalid",
            ("a.yaml:2", "stop_time", "10 s", "0.0333 s", "9.99 s", "10.0233 s", "step_size", "1/30 s"),
        ),  # 4
        ({"step": "1/0 s"}, "value-invalid", ("a.yaml:3", "step_size", "'1/0 s'")),  # 5
    ],
    ids=["moment", "yaw rate", "thirteen digits", "four digits", "zero"],
)
def test_a_mistake_in_a_scenario(folder, changed, code, names):
    with pytest.raises((ScenarioError, WiringError)) as caught:
        make_plan(load_scenario(written(folder, **changed)))
    assert caught.value.code == code
    assert mentions(caught.value, *names)


@pytest.mark.parametrize("only", ["1100", "1100 kg", "[1100]", "[1100 kg, '1200']"])  # 8
def test_values_of_an_axis_are_named_as_they_are_written(folder, only):
    written(folder)
    (folder / "sweep.yaml").write_text(SWEEP.format(values=[1100, 1200], only=only), encoding="utf-8")
    assert load_experiment(folder / "sweep.yaml").spec.axes


def test_a_value_that_an_axis_does_not_have(folder):
    written(folder)
    (folder / "sweep.yaml").write_text(SWEEP.format(values=[1100, 1200], only="1300"), encoding="utf-8")
    with pytest.raises(ScenarioError) as caught:
        load_experiment(folder / "sweep.yaml")
    assert caught.value.code == "figure-invalid"
    assert mentions(caught.value, "sweep.yaml:7", "figures[0].only.mass", "value 1300", "'1200'", "mass")


def test_new_outside_a_checkout_builds_the_fmus_that_it_uses(folder, capsys):  # 9
    with pytest.raises(SystemExit):
        main(["new", "scenario", "mine"])
    build = capsys.readouterr().out.splitlines()[0].split()
    assert build[-2:] == ["--out", "fmus"]
    assert len(build[build.index("build") + 1 : -2]) == 7


def test_runs_that_were_not_made_have_not_failed(folder, capsys):  # 10
    written(folder)
    (folder / "sweep.yaml").write_text(SWEEP.format(values=[1100, 1200], only="1100"), encoding="utf-8")
    assert status_of("sweep", "sweep.yaml", "--no-run", "--out", "out", "--fmus", "fmus") == 1
    said = capsys.readouterr()
    assert "4 of 4 runs not made yet" in said.err
    assert "failed" not in said.out + said.err
    rows = (folder / "out/table.csv").read_text(encoding="utf-8").splitlines()[1:]
    assert [row.split(",")[3] for row in rows] == ["not made"] * 4

"""Output and exit status of `yawbench check`."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fmus.fake_fmus import Var, make_fmu, out
from tests.refusals import each_mentions, mentions
from yawbench.cli import main

pytestmark = pytest.mark.usefixtures("common_cache")

SCENARIO = """\
title: Single sine [mu 0.65]
stop_time: 2
step_size: 1 ms
inputs: {"friction*": 0.65}
units:
  tyre: {fmu: tyre}
  plant: {fmu: plant, parameters: {mass: 1.2 t, note: default}}
  driver: {fmu: driver, step_size: 5 ms}
connections:
  - {from: driver.torque_*, to: plant.wheel_torque_*}
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with a scenario, `Läufe 2/a.yaml`, and its FMUs."""
    monkeypatch.chdir(tmp_path)
    make_fmu(
        tmp_path / "fmus/driver.fmu",
        inputs=[Var("friction")],
        outputs=[out("steer_angle", unit="rad"), out("torque_*", unit="N.m")],
    )
    make_fmu(
        tmp_path / "fmus/plant.fmu",
        inputs=[Var("steer_angle", "rad"), Var("tyre_force_*", "N"), Var("wheel_torque_*", "N.m")],
        outputs=[out("slip_angle_*", "steer_angle", unit="rad"), out("load_*", "tyre_force_*", unit="N")],
        parameters=[Var("mass", "kg", start=1500.0), Var("note", type="String", start="default")],
    )
    make_fmu(
        tmp_path / "fmus/tyre.fmu",
        inputs=[Var("slip_angle_*", "rad"), Var("friction_*")],
        outputs=[out("tyre_force_*", "slip_angle_*", unit="N")],
    )
    path = tmp_path / "Läufe 2" / "a.yaml"
    path.parent.mkdir()
    path.write_text(SCENARIO, encoding="utf-8")
    return path.parent


def check(*arguments: str) -> int:
    """Run the command and return its exit status."""
    with pytest.raises(SystemExit) as caught:
        main(["check", *arguments])
    assert isinstance(caught.value.code, int)
    return caught.value.code


def test_without_standard_output_the_exit_status_still_tells(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "stderr", None)
    assert check("Läufe 2/a.yaml") == 0
    assert check("Läufe 2/b.yaml") == 2


def test_what_a_terminal_cannot_show_is_escaped() -> None:
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    command = [sys.executable, "-m", "yawbench", "check", "Läufe 2/a.yaml"]
    done = subprocess.run(command, capture_output=True, env=environment, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.startswith(b"L\\xe4ufe 2/a.yaml: Single sine [mu 0.65]")


def test_a_scenario_is_shown_with_units_values_wires_and_the_reasons_of_its_order(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert check("Läufe 2/a.yaml") == 0
    shown = capsys.readouterr()
    assert shown.err == ""
    for names in (
        ("Läufe 2/a.yaml", "Single sine [mu 0.65]"),
        ("2 s", "2000 steps", "1 ms", "extrapolated", "13 wires", "17 outputs"),
        ("driver", "5 ms"),
        ("plant", "1 ms"),
        ("stop_time", "2 s", "scenario", "all"),
        ("step_size", "0.001 s", "scenario", "all"),
        ("algorithm", "extrapolated", "default", "all"),
        ("friction", "0.65", "scenario", "driver"),
        ("mass", "1200 kg", "scenario", "plant"),
        ("friction_*", "0.65", "scenario", "tyre"),
        ("driver", "plant", "steer_angle [rad], torque_* → wheel_torque_* [N.m]"),
        ("tyre", "plant", "tyre_force_* [N]"),
        ("plant", "tyre", "slip_angle_* [rad]"),
        ("plant", "driver", "steer_angle"),
        ("No errors",),
    ):
        assert mentions(shown.out, *names)


def test_a_value_says_where_it_comes_from_also_where_it_is_the_fmus_own(
    capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    path = folder / "a.yaml"
    path.write_text(SCENARIO.replace("parameters: {mass: 1.2 t, note: default}", "parameters: {}"))
    assert check("Läufe 2/a.yaml", "--set", "plant.note=default", "--set", "stop_time=1") == 0
    shown = capsys.readouterr().out
    rows = [line.split() for line in shown.splitlines()]
    assert ["mass", "1500", "kg", "default", "plant"] in rows
    assert ["note", "default", "--set", "plant"] in rows
    assert ["stop_time", "1", "s", "--set", "all"] in rows
    assert "all at their defaults" not in shown


def test_defaults_that_do_not_matter_are_shown_on_request(capsys: pytest.CaptureFixture[str]) -> None:
    make_fmu(Path("fmus/driver.fmu"), inputs=[Var("friction")], parameters=[Var("gain", start=3.0)],
             outputs=[out("steer_angle", unit="rad"), out("torque_*", unit="N.m")])  # fmt: skip
    assert check("Läufe 2/a.yaml") == 0
    shown = capsys.readouterr().out
    assert " gain " not in shown
    assert mentions(shown, "1", "--all", "left")
    assert check("Läufe 2/a.yaml", "--all") == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["gain", "3", "default", "driver"] in rows


def test_every_problem_is_a_line_on_stderr_and_the_status_is_2(
    capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    path = folder / "a.yaml"
    path.write_text(
        SCENARIO.replace("mass: 1.2 t", "mas: 1.2 t").replace("to: plant.wheel", "to: plant.weel")
    )
    assert check("Läufe 2/a.yaml") == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert each_mentions(
        shown.err.splitlines(),
        ("2/a.yaml:7", "units.plant.parameters.mas", "'mas'", "'mass'"),
        ("2/a.yaml:7", "units.plant", "plant.wheel_torque_*", "N.m", "driver.torque_*", "'inputs'"),
        ("2/a.yaml:10", "connections[0].to", "'weel_torque_*'", "'wheel_torque_*'", "plant"),
    )


def test_checking_loads_no_simulation_and_no_figures() -> None:
    code = (
        "import sys; from pathlib import Path; from yawbench.planner import Planner\n"
        "planner = Planner(); planner.plan(planner.load(Path('Läufe 2/a.yaml')))\n"
        "print(sorted({'fmpy', 'numpy', 'lxml', 'matplotlib', 'rich', 'components'} & set(sys.modules)))"
    )
    assert check("Läufe 2/a.yaml") == 0  # fills the cache
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_a_wire_that_converts_says_from_what_into_what(capsys: pytest.CaptureFixture[str]) -> None:
    outputs = [out("steer_angle", unit="deg"), out("torque_*", unit="N.m")]
    make_fmu(Path("Läufe 2/driver_deg.fmu"), outputs=outputs)
    assert check("Läufe 2/a.yaml", "--swap", "driver=Läufe 2/driver_deg.fmu") == 0
    assert mentions(capsys.readouterr().out, "steer_angle", "0.0174533")


SENSED = """\
stop_time: 2
step_size: 1 ms
units:
  driver: {fmu: driver_a}
  reference: {fmu: reference_a}
  ideal: {fmu: reference_a}
  controller: {fmu: controller_a}
  plant: {fmu: plant_a}
  gyro: {fmu: sensor_a}
  estimator: {fmu: estimator_a}
connections:
  - {from: plant.*, to: gyro.*_true}
  - {from: [estimator, gyro, reference], to: [reference, controller, estimator]}
  - {from: [plant], to: [ideal, driver]}
"""


def test_what_the_control_side_sees_is_shown_and_what_it_sees_exactly_is_noted(
    capsys: pytest.CaptureFixture[str],
) -> None:
    fmus = Path("fmus")
    rate, angle = {"unit": "rad/s"}, {"unit": "rad"}
    steered, turning = Var("steer_angle", "rad"), Var("yaw_rate", "rad/s")
    make_fmu(fmus / "driver_a.fmu", inputs=[turning], outputs=[out("steer_angle", **angle)])
    make_fmu(fmus / "reference_a.fmu", inputs=[steered, turning], outputs=[out("yaw_rate_ref", **rate)])
    make_fmu(fmus / "controller_a.fmu", outputs=[out("yaw_moment", unit="N.m")],
             inputs=[turning, Var("sideslip", "rad"), Var("yaw_rate_ref", "rad/s")])  # fmt: skip
    outputs = [out("yaw_rate", **rate), out("sideslip", **angle), out("wheel_speed_*", **rate)]
    make_fmu(fmus / "plant_a.fmu", inputs=[steered, Var("yaw_moment", "N.m")], outputs=outputs)
    make_fmu(fmus / "sensor_a.fmu", outputs=[out("yaw_rate", **rate)],
             inputs=[Var("yaw_rate_true", "rad/s"), Var("wheel_speed_*_true", "rad/s")])  # fmt: skip
    make_fmu(fmus / "estimator_a.fmu", inputs=[turning], outputs=[out("sideslip", **angle)])
    Path("b.yaml").write_text(SENSED)
    assert check("b.yaml") == 0
    shown = capsys.readouterr()
    rows = [line.split(maxsplit=3) for line in shown.out.splitlines()]
    assert ["gyro", "controller", "measurement", "yaw_rate [rad/s]"] in rows
    assert mentions(shown.out, "yaw_rate", "yaw_rate_true", "rad/s", "wheel_speed_*", "wheel_speed_*_true")
    assert ["estimator", "controller", "estimate", "sideslip [rad]"] in rows
    assert ["gyro", "estimator", "measurement", "yaw_rate [rad/s]"] in rows
    assert ["plant", "ideal", "truth", "yaw_rate [rad/s]"] in rows
    assert ["reference", "controller", "yaw_rate_ref", "[rad/s]"] in rows
    assert each_mentions(shown.err, ("note", "steer_angle"))

"""`yawbench run` with real FMUs, the project's own and faulty ones made for the test."""

import gc
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cars import load_scenario, make_plan
from tests.command_line import status_of
from tests.commands.terminal import seen_on_terminal
from tests.fmu_copies import put_fmus
from tests.refusals import each_mentions, mentions
from yawbench.fmus.build import build_component
from yawbench.orchestrator.master import log
from yawbench.orchestrator.master.fmi import open_instance
from yawbench.orchestrator.master.simulate import simulate
from yawbench.orchestrator.results.reader import load_results

UNITS = (
    "driver_sine", "reference_steady_state", "controller_fnn", "controller_off",
    "allocator_load_proportional", "wheel_control_direct", "plant_seven_dof", "tyre_dugoff",
)  # fmt: skip

CAR = """
title: A car on a slalom
stop_time: {stop}
step_size: 0.001
inputs: {{"friction*": 0.65}}
units:
  driver:        {{fmu: driver_sine, parameters: {{amplitude: 0.03, frequency: 2, start_time: 0}}}}
  reference:     {{fmu: reference_steady_state}}
  controller:    {{fmu: controller_fnn, step_size: 0.002}}
  allocator:     {{fmu: allocator_load_proportional, step_size: 0.002}}
  wheel_control: {{fmu: wheel_control_direct, step_size: 0.002}}
  plant:         {{fmu: plant_seven_dof, parameters: {{initial_speed: 25.0}}}}
  tyre:          {{fmu: tyre_dugoff}}
connections:
  - {{from: wheel_control.torque_request_*, to: plant.wheel_torque_*}}
"""

PAIR = """
stop_time: 0.1
step_size: 0.01
units:
  driver: {{fmu: driver_sine, parameters: {{frequency: 2, start_time: 0}}}}
  controller: {{fmu: {controller}}}
"""

FAULTY = '''
import os
import signal

from yawbench.components.fmi.component import Component


class {name}(Component):
    """A controller that does something it should not."""

    inputs = ("steer_angle",)
    outputs = ("yaw_moment",)
    sampled = True

    def advance(self, t, h, u):
        if t > 0.045:
            {act}

    def output(self, t, u):
        return ({value},)
'''


@pytest.fixture
def faulty(tmp_path, fmus):
    """Make a controller that does `act` from t = 0.05 s on; return a scenario with it."""

    def make(act="pass", value="0.0", name="faulty"):
        file = tmp_path / f"{name}.py"
        file.write_text(FAULTY.format(name=name.capitalize(), act=act, value=value), encoding="utf-8")
        fmu = build_component(file, tmp_path, role="controllers")
        scenario = tmp_path / "pair.yaml"
        scenario.write_text(PAIR.format(controller=fmu.name))
        return scenario

    return make


@pytest.fixture
def yawbench(yawbench, fmus):
    """Run the command line; return its exit status and what it said on stderr."""

    def run(scenario, *arguments, command="run"):
        status, out, said = yawbench(command, scenario, "--fmus", fmus, *arguments)
        assert out == ""
        return status, said

    return run


def car(folder, stop=0.05):
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "car.yaml"
    path.write_text(CAR.format(stop=stop), encoding="utf-8")
    return path


def test_a_run_writes_results_and_says_where(yawbench, tmp_path):
    status, said = yawbench(car(tmp_path), "--out", tmp_path / "out")
    assert status == 0
    assert said.startswith(f"{tmp_path / 'out'}: 51 rows of ")
    assert said.count("\n") == 1
    results = load_results(tmp_path / "out")
    assert results.time.tolist() == [k / 1000 for k in range(51)]
    assert results["plant.velocity_x"][0] == 25.0
    assert abs(results["driver.steer_angle"]).max() > 0.01
    assert abs(results["plant.yaw_rate"]).max() > 0.01
    assert results.units["plant.yaw_rate"] == "rad/s"


def test_the_record_tells_everything_needed_to_repeat_the_run(yawbench, fmus, tmp_path):
    yawbench(car(tmp_path), "--out", tmp_path / "out", "--set", "driver.amplitude=0.02")
    run = json.loads((tmp_path / "out" / "run.json").read_text())
    assert run["status"] == "completed"
    assert run["error"] is None
    assert mentions(run["title"], "car", "slalom")
    settings = [run[name] for name in ("algorithm", "step_size", "stop_time", "rows")]
    assert settings == ["extrapolated", 0.001, 0.05, 51]
    assert sorted(run["evaluation_order"]) == sorted(run["fmus"])
    assert list(run["units"]) == ["time", *load_results(tmp_path / "out")]
    for fmu in run["fmus"].values():
        content = (fmus / fmu["file"]).read_bytes()
        assert fmu["sha256"] == hashlib.sha256(content).hexdigest()
        assert fmu["generation_tool"].startswith("yawbench")
        assert fmu["guid"]
    assert run["fmus"]["driver"]["parameters"]["amplitude"] == 0.02
    assert run["fmus"]["plant"]["defaults"]["low_speed"] == 0.5
    assert "amplitude" not in run["fmus"]["driver"]["defaults"]
    assert run["fmus"]["controller"]["step_size"] == 0.002
    assert run["fmus"]["tyre"]["constants"] == {f"friction_{w}": 0.65 for w in ("fl", "fr", "rl", "rr")}
    assert run["scenario"]["units"]["driver"]["parameters"]["amplitude"] == 0.02
    assert set(run["versions"]) == {
        "python", "yawbench", "orchestrator", "fmpy", "pythonfmu", "numpy", "platform",
    }  # fmt: skip
    assert run["wall_time"] > 0


def test_runs_of_other_settings_and_one_that_fails_leave_all_results_readable(
    yawbench, faulty, tmp_path, monkeypatch
):
    scenario = faulty('raise ValueError("no")')
    monkeypatch.chdir(tmp_path)
    good = ("--swap", "controller=controller_off", "--name", "good")
    assert yawbench(scenario, *good)[0] == 0
    assert yawbench(scenario, "--swap", "controller=controller_off", "--set", "driver.amplitude=0.03")[0] == 0
    status, said = yawbench(scenario, "--name", "good")
    assert status == 1
    (results,) = Path("results").iterdir()
    assert mentions(said, "good/failed", "recorded")
    assert {folder.name: load_results(folder).record.status for folder in results.iterdir()} == {
        "good": "completed",
        f"{scenario.stem},controller=controller_off,driver.amplitude=0.03": "completed",
    }
    assert load_results(results / "good" / "failed").record.status == "failed"
    assert len(load_results(results / "good").time) > len(load_results(results / "good" / "failed").time)
    assert yawbench(scenario, "--name", "good", "--out", "x")[0] == 2


def test_two_units_of_one_fmu_have_their_own_state(yawbench, tmp_path):
    scenario = tmp_path / "two.yaml"
    scenario.write_text(
        "stop_time: 0.1\nstep_size: 0.01\nunits:\n"
        "  slow: {fmu: driver_sine, parameters: {frequency: 1, start_time: 0}}\n"
        "  fast: {fmu: driver_sine, parameters: {frequency: 2, start_time: 0}}\n"
    )
    status, _ = yawbench(scenario, "--out", tmp_path / "out")
    assert status == 0
    results = load_results(tmp_path / "out")
    assert results["slow.steer_angle"][10] == pytest.approx(results["fast.steer_angle"][5], rel=1e-12)
    assert results["slow.steer_angle"][10] != results["fast.steer_angle"][10]


def test_paths_with_spaces_and_umlauts_work(fmus, tmp_path, monkeypatch, capsys):
    folder = tmp_path / "Prüfstand für Autos"
    scenario = car(folder / "Läufe 1")
    put_fmus(folder / "meine FMUs", components=UNITS)
    monkeypatch.chdir(folder)
    assert status_of("run", "Läufe 1/car.yaml", "--fmus", "meine FMUs", "--out", "Ergebnis ä") == 0
    assert capsys.readouterr().err.startswith("Ergebnis ä: 51 rows")
    assert len(load_results(folder / "Ergebnis ä").time) == 51
    assert scenario.exists()


def test_an_exception_in_a_component_is_one_sentence_with_file_and_line(yawbench, faulty, tmp_path):
    scenario = faulty('raise ValueError("velocity must exceed 1 m/s, 100 % größer {u}".format(u=int(t > 0)))')
    status, said = yawbench(scenario, "--out", tmp_path / "out")
    assert status == 1
    assert each_mentions(
        said.splitlines(),
        ("controller", "0.05 s", "ValueError", "1 m/s", "100 %", "controllers/faulty.py:17", "velocity"),
        ("out", "recorded"),
    )
    results = load_results(tmp_path / "out")
    assert results.time.tolist() == [0.0, 0.01, 0.02, 0.03, 0.04, 0.05]
    error = results.record.error
    assert results.record.status == "failed"
    assert error.message == said.splitlines()[0]
    assert (error.instance, error.time) == ("controller", 0.05)
    assert error.inputs["steer_angle"] == pytest.approx(results["driver.steer_angle"][5], rel=0.5)
    assert "in advance\n" in error.traceback[0]
    assert error.traceback[0].rstrip().endswith("100 % größer 1")


def test_a_warning_of_a_component_is_shown_and_recorded(yawbench, faulty, tmp_path):
    status, said = yawbench(faulty('self.warn("tyres are 90 % warm")'), "--out", tmp_path / "out")
    assert status == 0
    assert mentions(said.splitlines()[0], "warning", "0.05 s", "90 %")
    run = load_results(tmp_path / "out").record
    assert each_mentions([w.text for w in run.warnings], *[("90 %", "tyres", "warm")] * 5)


@pytest.mark.skipif(sys.platform == "win32", reason="os.kill ends the process there")
@pytest.mark.parametrize("loop", ["compiled", pytest.param("python", marks=pytest.mark.exhaustive)])
def test_ctrl_c_ends_a_component_that_never_comes_back(loop, faulty, fmus, tmp_path, monkeypatch):
    monkeypatch.setenv("YAWBENCH_LOOP", loop)
    scenario = faulty("os.kill(os.getppid(), signal.SIGINT)\n            while True: signal.pause()")
    command = [sys.executable, "-m", "yawbench", "run", scenario, "--fmus", fmus, "--out", tmp_path / "out"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 130
    assert each_mentions(done.stderr, ("0.05 s", "interrupted", "controller"), ("out", "recorded"))
    results = load_results(tmp_path / "out")
    assert results.record.status == "interrupted"
    assert results.time[-1] == 0.05


LEFT = """
import contextlib, os, sys
from yawbench.cli import main
with contextlib.suppress(SystemExit):
    main(sys.argv[1:])
print("numpy" in sys.modules, len(os.listdir("/proc/self/task")))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="lists the threads of a process")
def test_a_run_of_native_units_starts_no_threads_and_shows_no_bar_in_a_pipe(fmus, tmp_path):
    arguments = "run", car(tmp_path, stop=0.5), "--fmus", fmus, "--out", tmp_path / "out"
    command = [sys.executable, "-c", LEFT, *map(str, arguments)]
    environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, env=environment)
    assert done.stdout.split() == ["True", "1"], done.stderr
    assert done.stderr.startswith(f"{tmp_path / 'out'}: 501 rows of ")
    assert "\x1b" not in done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
@pytest.mark.parametrize(("columns", "shown"), [(200, "of the [second] kind"), (60, "A car on a slalom of…")])
@pytest.mark.sampled(1)
def test_a_terminal_shows_a_progress_bar_and_keeps_only_the_last_line(columns, shown, fmus, tmp_path):
    scenario = car(tmp_path, stop=2)
    text = scenario.read_text(encoding="utf-8")
    scenario.write_text(text.replace("on a slalom", "on a slalom of the [second] kind"), encoding="utf-8")
    command = [sys.executable, "-m", "yawbench", "run", scenario, "--fmus", fmus, "--out", tmp_path / "out"]
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": str(columns)}
    seen = seen_on_terminal(command, "stderr", env=environment)
    assert all(part in seen for part in (shown, "━", "100%"))
    assert "2001 rows of " in seen.splitlines()[-1]


def left_behind():
    """Return what a run could leave behind: instances, all objects, listeners, files, mapped libraries."""
    gc.collect()
    objects = gc.get_objects()
    instances = sum(any(c.__name__ == "Component" for c in type(o).__mro__) for o in objects)
    mapped = sum(".so" in line for line in Path("/proc/self/maps").read_text().splitlines())
    places = len(log._listeners), len(sys.path), len(sys.modules), len(os.listdir("/proc/self/fd"))
    return len(objects), (instances, mapped, *places)


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_runs_in_one_process_leave_nothing_behind(fmus, tmp_path, monkeypatch):
    monkeypatch.setenv("YAWBENCH_UNITS", "python")
    plan = make_plan(load_scenario(car(tmp_path, stop=0.004)), fmus=fmus)
    slave = open_instance(plan.instances[0], log.Log(), set())
    _, (alive, *_) = left_behind()
    slave.free()
    _, (freed, *_) = left_behind()
    assert freed == alive - 1  # so instances are counted
    seen = []
    for _ in range(3):
        for _ in range(8):
            simulate(plan, tmp_path / "out")
        seen.append(left_behind())
    # what is left by each of 16 runs is more than what threads of earlier tests open and close meanwhile
    assert all(after - before < 8 for before, after in zip(seen[0][1], seen[2][1], strict=True))
    assert seen[2][0] - seen[1][0] <= 8 * len(plan.instances)  # PythonFMU's library loses an object of each


def test_what_was_remarkable_in_a_run_that_failed_is_said_before_why_it_failed(faulty, yawbench, tmp_path):
    scenario = faulty(act="raise ValueError('no')")
    status, said = yawbench(scenario, "--out", tmp_path / "o", "--set", "driver.amplitude=3")
    lines = [line for line in said.splitlines() if not line.startswith(("changed:", "note: driver"))]
    assert status == 1
    assert mentions(lines[0], "note", "101 degrees", "60", "0.03 s")
    assert mentions(lines[1], "controller", "0.05 s", "ValueError", "controllers/faulty.py:17")

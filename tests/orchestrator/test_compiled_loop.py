"""The compiled step loop beside the loop in Python, its reference: same bytes, same sentences, same times."""

from __future__ import annotations

import ctypes
import json
import os
import re
import shutil
import signal
import sys
import threading

import numpy as np
import pytest

import yawbench as yb
from tests.cars import load_scenario, make_plan
from tests.command_line import status_of
from tests.commands.test_run import FAULTY, PAIR
from tests.fmus import models3
from tests.fmus.models3 import make_fmu
from tests.refusals import mentions, refused
from yawbench.fmus.build import build_component
from yawbench.fmus.compiler import load_compiled
from yawbench.foundation.errors import Interrupted
from yawbench.orchestrator.master import compiled_loop
from yawbench.orchestrator.master.simulate import simulate
from yawbench.orchestrator.master.step_loop import RunPosition
from yawbench.orchestrator.results.reader import load_results
from yawbench.orchestrator.scenario.catalogue import names

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="compiles for Linux"),
    pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler"),
]
COMPILED = "compiled"
OF_EACH_RUN = ("id", "started", "wall_time")
"""Keys of run.json that differ from run to run."""

CAR = """
stop_time: 0.6
step_size: 0.001
algorithm: {algorithm}
inputs:
  tyre.friction_fl: {{file: grip.csv, column: friction, interpolation: {interpolation}}}
  "friction*": 0.65
units:
  driver: {{fmu: driver_sine, parameters: {{amplitude: 0.03, frequency: 2, start_time: 0}}}}
  reference: {{fmu: reference_steady_state}}
  controller: {{fmu: controller_fnn, step_size: 0.006}}
  allocator: {{fmu: allocator_load_proportional, step_size: 0.004}}
  wheel_control: {{fmu: wheel_control_direct, step_size: 0.002}}
  plant: {{fmu: plant_seven_dof, parameters: {{initial_speed: 25.0}}}}
  tyre: {{fmu: tyre_dugoff}}
connections:
  - {{from: wheel_control.torque_request_*, to: plant.wheel_torque_*, gain: 0.93, offset: 0.25}}
"""


@pytest.fixture
def both(tmp_path, monkeypatch, capsys):
    """Run a scenario with both loops; return the status and the words that both gave, and the record."""

    def run(scenario, *arguments, loop=COMPILED):
        given = []
        for wanted in ("python", ""):
            monkeypatch.setenv(compiled_loop.WANTED, wanted)
            out = tmp_path / "out"
            shutil.rmtree(out, ignore_errors=True)
            status = status_of("run", scenario, "--out", out, *arguments)
            words = re.sub(r" in [0-9.]+ s\n", "\n", capsys.readouterr().err)
            assert (out / "run.json").exists(), words
            record = json.loads((out / "run.json").read_text())
            made_by = record.pop("loop")
            kept = {key: value for key, value in record.items() if key not in OF_EACH_RUN}
            given.append((status, words, (out / "results.csv").read_bytes(), kept))
            asked_for = wanted and loop == COMPILED
            assert made_by == (f"Python: {compiled_loop.WANTED} asks for it" if asked_for else loop)
        reference, fast = given
        assert fast == reference
        return fast[0], fast[1], fast[3]

    return run


@pytest.mark.sampled(1)
@pytest.mark.parametrize("interpolation", ["linear", "held"])
@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel", "extrapolated"])
def test_periods_series_and_converting_wires_give_the_same_bytes(
    both, fmus, tmp_path, algorithm, interpolation
):
    times = np.arange(0.0, 1.0, 0.0137)
    rows = "".join(f"{t},{0.5 + 0.2 * np.sin(9 * t)}\n" for t in times)
    (tmp_path / "grip.csv").write_text("time,friction\n" + rows)
    scenario = tmp_path / "car.yaml"
    scenario.write_text(CAR.format(algorithm=algorithm, interpolation=interpolation))
    status, said, record = both(scenario, "--fmus", fmus)
    assert status == 0, said
    assert record["rows"] == 601


@pytest.mark.sampled(1)
@pytest.mark.parametrize("name", names("a scenario"))
def test_a_published_scenario_gives_the_same_bytes(both, fmus, name):
    status, said, record = both(name, "--fmus", fmus, "--set", "stop_time=2")
    assert (status, record["status"]) == (0, "completed"), said


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "fault",
    [
        "plant.sideslip: noise 0.01",
        "plant.sideslip -> controller: delay 50 ms",
        "plant.sideslip: bias 0.01 from 0.2 until 0.4",
        "plant.sideslip -> controller: gain -0.3 from 0.3; bias 0.002 until 0.5",
        "wheel_control.torque_request_fl: loss 0.4; saturation 50",
    ],
)
def test_a_fault_acts_alike_in_both_loops(both, fmus, fault):
    given = "--fmus", fmus, "--set", "stop_time=0.7", "--set", "driver.start_time=0.1", "--fault", fault
    status, said, _ = both("fnn_sideslip/25mps", *given)
    assert status == 0, said


class Proportional:
    """A controller in plain Python."""

    inputs = ("yaw_rate_ref", "yaw_rate")
    outputs = ("yaw_moment",)
    step_size = 0.002

    def output(self, t, u):
        return 20000 * (u.yaw_rate_ref - u.yaw_rate)


def test_a_controller_in_plain_python_gives_the_same_numbers(fmus, monkeypatch):
    scenario = yb.load("fnn_sideslip/25mps").swap(controller=Proportional()).set({"stop_time": 1.5})
    runs = []
    for wanted in ("python", ""):
        monkeypatch.setenv(compiled_loop.WANTED, wanted)
        runs.append(scenario.run())
    reference, fast = runs
    assert np.ptp(reference["yaw_moment"]) > 100.0
    assert all(np.array_equal(reference[name], fast[name]) for name in reference)


def test_too_few_rows_are_refused():
    loop = compiled_loop.CompiledLoop(
        np.zeros(3), 2, {1: ctypes.c_double()}, (0, 1, 10), np.array([2]), RunPosition(), {}, ctypes.c_int32()
    )
    loop.lay(range(1, 4), np.zeros((4, 1)), 1, {0: []})
    with refused(ValueError, names=("3 rows",)):
        loop.lay(range(1, 4), np.zeros((2, 1)), 1, {0: []})


def test_instances_of_fmi_3_give_the_same_bytes(both, models, tmp_path):
    names = ("Dahlquist", "VanDerPol", "BouncingBall", "Stair", "Early", "Every")
    units = {name: {"fmu": str(make_fmu(tmp_path, name, models))} for name in names}
    constants = {f"Every.{v}_in": 1 for v in models3.TYPES if v not in ("Float64", "Float32", "Boolean")}
    constants |= {"Every.Boolean_in": True, "Every.String_in": "a", "Every.mode_in": "wet"}
    wires = [
        {"from": "Dahlquist.x", "to": "Every.Float64_in"},
        {"from": "VanDerPol.x0", "to": "Every.Float32_in"},
    ]
    scenario = tmp_path / "s.yaml"
    told = {"units": units, "inputs": constants, "connections": wires, "stop_time": 3, "step_size": 0.1}
    scenario.write_text(json.dumps(told))
    status, said, record = both(scenario)
    assert (status, record["rows"]) == (0, 31), said
    assert record["smallest"]["Every.Float32_out"] < 0.0


@pytest.mark.parametrize(
    ("answer", "guid", "status", "names"),
    [
        (1, "{good}", 0, ("warning", "0.25 s", "3", "99.5%")),
        (2, "{good}", 1, ("b:", "0.25 s", "3")),
        (0, "{whole}", 0, ("0.3 s", "ended")),
        (0, "{half}", 0, ("0.275 s", "ended")),
    ],
)
def test_a_status_ends_the_run_with_the_same_sentence(both, scenario, answer, guid, status, names):
    given, said, _ = both(scenario(answer=answer, guid=guid))
    assert given == status
    assert mentions(said, *names)


def test_isolated_instances_are_left_to_the_loop_in_python(both, scenario):
    why = "Python: no instance is stepped in this process by a C function"
    assert both(scenario(answer=3), "--isolate", loop=why)[0] == 1


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("act", "value", "status", "names"),
    [
        ("pass", "float('nan') if t > 0.045 else 0.0", 1, ("controller", "yaw_moment", "0.05 s")),
        ("raise ValueError('flat tyre')", "0.0", 1, ("controller", "0.05 s", "ValueError")),
        ("self.warn('soft tyre')", "0.0", 0, ("warning", "0.05 s")),
        ("os.kill(os.getpid(), signal.SIGINT)", "0.0", 130, ("0.06 s", "interrupted")),
    ],
)
def test_a_component_that_fails_does_so_at_the_same_time(both, fmus, tmp_path, act, value, status, names):
    file = tmp_path / "faulty.py"
    file.write_text(FAULTY.format(name="Faulty", act=act, value=value), encoding="utf-8")
    fmu = build_component(file, tmp_path, role="controllers")
    wired = "connections:\n  - {from: controller.yaw_moment, to: follower.steer_angle, gain: 0.001}\n"
    text = f"{PAIR.format(controller=fmu.name)}  follower: {{fmu: {fmu.name}}}\n{wired}"
    (tmp_path / "pair.yaml").write_text(text)
    given, said, _ = both(tmp_path / "pair.yaml", "--fmus", fmus)
    assert given == status
    assert mentions(said, *names)


def test_ctrl_c_reaches_a_walk_within_a_moment(fmus, tmp_path):
    scenario = tmp_path / "car.yaml"
    scenario.write_text("stop_time: 1e5\nstep_size: 0.001\nunits:\n  driver: {fmu: driver_sine}\n")
    plan = make_plan(load_scenario(scenario), fmus=fmus)
    done, total = [0], plan.n_steps

    def progress(now: int, _: int) -> None:
        if now and not done[-1]:
            threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT)).start()
        done.append(now)

    with pytest.raises(Interrupted):
        simulate(plan, tmp_path / "out", progress=progress)
    record = load_results(tmp_path / "out").record
    assert (record.status, record.loop) == ("interrupted", COMPILED)
    assert 0 < done[-1] < 0.5 * total  # of a minute and more


def test_without_a_compiler_the_loop_is_in_python(fmus, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setenv("YAWBENCH_CACHE", str(tmp_path / "cache"))
    load_compiled.cache_clear()
    try:
        why = "no C compiler (no-such-compiler not found); name one in the environment variable CC, or "
        why += "'pip install yawbench[compiler]'"
        assert compiled_loop.missing_loop((0, 1, 1000), 10) == why
        (tmp_path / "s.yaml").write_text("stop_time: 1\nstep_size: 0.1\nunits:\n  a: {fmu: driver_sine}\n")
        out = tmp_path / "out"
        assert status_of("run", tmp_path / "s.yaml", "--fmus", fmus, "--out", out) == 0
        assert mentions(capsys.readouterr().err, "note", "no-such-compiler", "CC")
        assert load_results(out).record.loop == f"Python: {why}"
    finally:
        load_compiled.cache_clear()


def test_times_beyond_whole_numbers_are_left_to_python():
    assert not compiled_loop.missing_loop((0, 1, 2**53 - 1), 10)
    for grid in ((0, 1, 2**53), (2**53, 1, 1000), (0, 2**52, 1000)):
        assert "times" in compiled_loop.missing_loop(grid, 10)

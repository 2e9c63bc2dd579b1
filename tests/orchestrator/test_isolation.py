"""Units in processes of their own, and FMUs from elsewhere that crash, hang or fail there."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.cars import make_plan
from tests.changed import changed
from tests.command_line import status_of
from tests.conftest import build_controller_in_c
from tests.refusals import mentions
from yawbench.foundation.errors import SimulationError
from yawbench.orchestrator.master.fmi import open_instance
from yawbench.orchestrator.master.isolation import Isolation
from yawbench.orchestrator.master.simulate import simulate
from yawbench.orchestrator.results.reader import load_results
from yawbench.orchestrator.scenario.loader import load_scenario

ROOT = Path(__file__).parents[2]
CAR = ROOT / "scenarios" / "fnn_sideslip" / "25mps.yaml"
UNITS = (
    "driver_sine", "reference_steady_state", "controller_fnn", "allocator_load_proportional",
    "wheel_control_direct", "plant_seven_dof", "tyre_dugoff",
)  # fmt: skip
needs_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="--isolate needs Linux or macOS")


ACTS = {
    "crash": "raise(SIGSEGV);",
    "hang": "for (;;) {}",
    "exit": "exit(3);",
    "_exit": "_exit(0);",
    "fork": "static int n; if (n++ < 6) { "
    'f = fopen("HERE/told", "a"); fprintf(f, "%d ", getpid()); fclose(f); fork(); }',
}
"""What a controller in C does from t = 0.05 s on."""


@pytest.fixture(scope="module")
def controller(tmp_path_factory):
    """A controller in C that does what a file beside it names; built once."""
    folder = tmp_path_factory.mktemp("foreign")
    told = "".join(f'if (!strcmp(act, "{name}")) {{ {act} }} ' for name, act in ACTS.items())
    read = 'char act[9] = ""; FILE *f = fopen("HERE/act", "r"); if (f) { fscanf(f, "%8s", act); fclose(f); }'
    act = f"if (t > 0.0495) {{ {read} {told} }}".replace("HERE", str(folder))
    return build_controller_in_c(folder, act)


@pytest.fixture
def run(fmus, controller, tmp_path, capsys):
    """Run paper A's car with the controller, which does an act; return exit status, words and results."""

    def go(act, *arguments, isolate=True):
        (controller.parents[1] / "act").write_text(act)
        out = tmp_path / "out"
        options = ["--fmus", fmus, "--no-build", "--out", out, "--set", "stop_time=0.1"]
        options += ["--swap", f"controller={controller}", *arguments, *(["--isolate"] if isolate else [])]
        return status_of("run", CAR, *options), capsys.readouterr().err, load_results(out)

    return go


def plan_of(fmus, **options):
    changes = changed(settings=["driver.start_time=0"], **options)
    return make_plan(load_scenario(CAR, changes=changes), fmus=fmus)


@pytest.mark.parametrize("algorithm", ["extrapolated", "jacobi", "gauss_seidel"])
@pytest.mark.sampled(1)
def test_isolated_units_give_the_same_numbers_to_the_last_bit(algorithm, fmus, tmp_path):
    faults = [
        "driver.steer_angle -> plant: bias 1 deg from 0.1",
        "plant.yaw_rate: noise 0.1 deg/s; delay 0.03",
    ]
    plan = plan_of(fmus, stop_time=0.3, algorithm=algorithm, faults=faults)
    simulate(plan, tmp_path / "together")
    with Isolation(plan.instances) as isolation:
        simulate(plan, tmp_path / "apart", opener=isolation)
    together, apart = ((tmp_path / name / "results.csv").read_bytes() for name in ("together", "apart"))
    assert together == apart


def test_no_process_outlives_a_run(fmus, tmp_path):
    plan = plan_of(fmus, stop_time=0.01)
    with Isolation(plan.instances) as isolation:
        simulate(plan, tmp_path, opener=isolation)
        processes = [instance.child for instance in isolation.instances.values()]
    assert len(processes) == len(UNITS)
    assert all(process.ended() for process in processes)


def test_units_end_when_the_master_is_killed(fmus):
    code = f"""
import os, signal, sys
from pathlib import Path
from tests.orchestrator.test_isolation import Isolation, plan_of
from yawbench.orchestrator.master.log import Log
plan = plan_of(Path({str(fmus)!r}), stop_time=0.01)
isolation = Isolation(plan.instances)
[isolation(unit, Log(), set()) for unit in plan.instances]
print(*(one.child.pid for one in isolation.instances.values()), flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""
    # they have inherited the pipe: that this comes back shows that all of them have ended
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT, timeout=60)
    assert len(done.stdout.split()) == len(UNITS), done.stderr


@needs_cc
@pytest.mark.parametrize("isolate", [True, False], ids=["apart", "together"])
def test_the_copies_of_a_unit_that_forks_in_every_step_end_at_once(controller, run, isolate):
    told = controller.parents[1] / "told"
    told.unlink(missing_ok=True)
    status, _, results = run("fork", isolate=isolate)
    assert status == 0
    assert results.time[-1] == pytest.approx(0.1)
    assert len(set(told.read_text().split())) == 1


@needs_cc
@pytest.mark.parametrize(
    ("act", "arguments", "isolate", "names"),
    [
        ("crash", (), True, ("SIGSEGV", "fmi2DoStep")),
        ("hang", ("--call-limit", "200 ms"), True, ("fmi2DoStep", "0.2 s")),
        ("exit", (), True, ("status 3", "fmi2DoStep")),
        ("crash", (), False, ("SIGSEGV",)),
        ("crash", ("--format", "parquet"), False, ("SIGSEGV",)),
        ("exit", (), False, ("status 3",)),
        ("_exit", (), False, ("status 0",)),
    ],
)
def test_an_end_without_a_word_is_a_sentence_and_the_results_so_far(act, arguments, isolate, names, run):
    status, said, results = run(act, *arguments, isolate=isolate)
    assert status == 1
    assert mentions(said, "controller", "0.05 s", *names)
    assert results.record.status == "failed"
    assert results.record.error.instance == "controller"
    assert results.time[-1] in (
        (0.05, 0.051) if isolate else (0.051,)
    )  # the controller takes two steps at once
    assert np.all(np.isfinite(results["plant.velocity_x"]))


@needs_cc
def test_a_foreign_controller_in_c_runs_isolated_as_it_runs_together(run):
    _, _, apart = run("")
    _, _, together = run("", isolate=False)
    assert apart.record.status == "completed"
    for name in together.columns:
        assert np.array_equal(apart[name], together[name]), name


def test_a_failure_in_an_isolated_unit_is_the_sentence_of_one_that_is_not(fmus, tmp_path):
    sentences = []
    plan = plan_of(fmus, stop_time=0.01)
    next(one for one in plan.instances if one.name == "plant").parameters["mass"] = -1.0
    for apart in (False, True):
        with Isolation(plan.instances) as isolation, pytest.raises(SimulationError) as error:
            simulate(plan, tmp_path / "a", opener=isolation if apart else open_instance)
        sentences.append(str(error.value.diagnostics[0]))
    assert sentences[0] == sentences[1]
    assert "plant" in sentences[0]


@pytest.mark.parametrize(("option", "says"), [("0", "(got 0)"), ("soon", "--call-limit")])
def test_a_limit_that_is_no_time_is_refused(option, says, capsys):
    assert status_of("run", CAR, "--isolate", "--call-limit", option) == 2
    assert says in capsys.readouterr().err

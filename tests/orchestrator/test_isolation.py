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


@pytest.fixture
def foreign(tmp_path):
    """Build a controller in C that does `act` from t = 0.05 s on; return its path."""

    def build(act):
        return build_controller_in_c(tmp_path, f"if (t > 0.0495) {{ {act} }}")

    return build


@pytest.fixture
def run(fmus, tmp_path, capsys):
    """Run paper A's car with a controller, isolated; return exit status, what was said, the results."""

    def go(controller, *arguments, isolate=True):
        out = tmp_path / "out"
        options = ["--fmus", str(fmus), "--no-build", "--out", str(out), "--set", "stop_time=0.1"]
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


def test_units_end_when_the_master_is_killed(fmus, tmp_path):
    code = (
        "import sys, os, signal; from pathlib import Path\n"
        "from yawbench.orchestrator.plan import Override\n"
        "from yawbench.orchestrator.scenario.loader import load_scenario\n"
        "from tests.cars import make_plan\n"
        "from yawbench.orchestrator.master.isolation import Isolation\n"
        "from yawbench.orchestrator.master.simulate import simulate\n"
        f"short = [Override.of('stop_time', 0.01, 'test')]\n"
        f"plan = make_plan(load_scenario({str(CAR)!r}, changes=short), fmus=Path({str(fmus)!r}))\n"
        "isolation = Isolation(plan.instances)\n"
        f"simulate(plan, {str(tmp_path)!r}, opener=isolation)\n"
        "again = Isolation(plan.instances)\n"
        "from yawbench.orchestrator.master.log import Log\n"
        "[again(unit, Log(), set()) for unit in plan.instances]\n"
        "print(*(one.child.pid for one in again.instances.values()), flush=True)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    # they have inherited the pipe: that this comes back shows that all of them have ended
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT, timeout=60)
    assert len(done.stdout.split()) == len(UNITS), done.stderr


@needs_cc
@pytest.mark.parametrize("isolate", [True, False])
def test_the_copies_of_a_unit_that_forks_in_every_step_end_at_once(foreign, run, tmp_path, isolate):
    went_on = tmp_path / "went_on"
    tell = f'FILE *f = fopen("{went_on}", "a"); fprintf(f, "%d\\n", (int)getpid()); fclose(f);'
    act = f"static int n; if (n++ < 6) {{ {tell} fork(); }}"
    status, _, results = run(foreign(act), isolate=isolate)
    assert status == 0
    assert results.time[-1] == pytest.approx(0.1)
    assert len(set(went_on.read_text().split())) == 1


@needs_cc
def test_an_fmu_that_crashes_costs_the_run_and_not_its_results(foreign, run):
    status, said, results = run(foreign("raise(SIGSEGV);"))
    assert status == 1
    assert mentions(said, "controller", "0.05 s", "SIGSEGV", "fmi2DoStep")
    assert results.record.status == "failed"
    assert results.record.error.instance == "controller"
    assert 0.049 <= results.time[-1] <= 0.052
    assert np.all(np.isfinite(results["plant.velocity_x"]))


@needs_cc
def test_an_fmu_that_never_comes_back_is_ended_at_the_limit_of_a_call(foreign, run):
    status, said, results = run(foreign("for (;;) {}"), "--call-limit", "300 ms")
    assert status == 1
    assert "controller: " in said
    assert mentions(said, "fmi2DoStep", "0.3 s")
    assert 0.049 <= results.time[-1] <= 0.052


@needs_cc
def test_an_fmu_that_ends_the_process_is_named(foreign, run):
    status, said, _ = run(foreign("exit(3);"))
    assert status == 1
    assert mentions(said, "status 3", "fmi2DoStep")


@needs_cc
@pytest.mark.parametrize(
    ("act", "did", "names"),
    [
        ("raise(SIGSEGV);", "died of SIGSEGV", ("SIGSEGV",)),
        ("exit(0);", "ended with exit status 0", ("status 0",)),
        ("_exit(0);", "ended with exit status 0", ("status 0",)),
    ],
)
@pytest.mark.parametrize("format_", ["csv", "parquet"])
@pytest.mark.sampled(1)
def test_without_isolation_too_an_end_without_a_word_is_a_sentence_and_the_results_so_far(
    act, did, format_, foreign, run, names
):
    status, said, results = run(foreign(act), "--format", format_, isolate=False)
    assert status == 1
    assert mentions(said, "controller", "0.05 s", *names)
    assert results.record.status == "failed"
    assert results.record.error.instance == "controller"
    assert results.time[-1] == 0.051  # the controller takes two steps at once
    assert np.all(np.isfinite(results["plant.velocity_x"]))


@needs_cc
def test_a_foreign_controller_in_c_runs_isolated_as_it_runs_together(foreign, run):
    fmu = foreign(";")
    _, _, apart = run(fmu)
    _, _, together = run(fmu, isolate=False)
    assert apart.record.status == "completed"
    for name in together.columns:
        assert np.array_equal(apart[name], together[name]), name


def test_a_failure_in_an_isolated_unit_is_the_sentence_of_one_that_is_not(fmus, tmp_path):
    sentences = []
    for opened in (None, Isolation):
        plan = plan_of(fmus, stop_time=0.01)
        broken = {"plant": {"mass": -1.0}}
        units = [u for u in plan.instances if u.name in broken]
        units[0].parameters.update(broken["plant"])
        with pytest.raises(SimulationError) as error:
            if opened is None:
                simulate(plan, tmp_path / "a")
            else:
                with opened(plan.instances) as isolation:
                    simulate(plan, tmp_path / "a", opener=isolation)
        sentences.append(str(error.value.diagnostics[0]))
    assert sentences[0] == sentences[1]
    assert "plant" in sentences[0]


@pytest.mark.parametrize(
    ("option", "says"),
    [("0 s", "--call-limit"), ("0", "(got 0)"), ("soon", "--call-limit")],
)
def test_a_limit_that_is_no_time_is_refused(option, says, capsys):
    assert status_of("run", CAR, "--isolate", "--call-limit", option) == 2
    assert says in capsys.readouterr().err

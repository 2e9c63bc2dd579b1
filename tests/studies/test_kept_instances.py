"""Workers that keep instances between runs: the same bytes as of fresh processes, whatever ran before."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from tests.changed import changed
from tests.conftest import build_controller_in_c
from yawbench.fmus.archive import WANTED, is_native
from yawbench.orchestrator.master import fmi
from yawbench.orchestrator.master.log import Log
from yawbench.orchestrator.results.run_record import RUN_FILE
from yawbench.studies import jobs as jobs_module
from yawbench.studies.jobs import Job, execute, keyed, ready, run_job
from yawbench.studies.on_demand import StoredPlans

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="native FMUs are for Linux")
SCENARIOS = Path(__file__).parents[2] / "scenarios"
UNITS = None
"""All FMUs."""
PAPER_A = SCENARIOS / "fnn_sideslip" / "25mps.yaml"
LANE_CHANGE = SCENARIOS / "real_signals" / "monitored_lane_change.yaml"
CHANGING = ("started", "wall_time", "id", "created", "times")
"""Keys that differ between two records of the same run."""
METRICS = (
    ("peak", "peak(yaw_rate)", None),
    ("rms", "rms(yaw_rate)", None),
    ("moment", "peak(yaw_moment)", None),
)


@pytest.fixture(scope="module")
def foreign(tmp_path_factory):
    """A controller in C, which is not native, and one that crashes at t = 0.02 s."""
    if shutil.which("cc") is None:
        pytest.skip("there is no C compiler")

    acts = {"idea": "", "broken": "if (t > 0.0195) { *(volatile int *)8 = 0; }"}
    return tuple(
        build_controller_in_c(tmp_path_factory.mktemp(name), act, name) for name, act in acts.items()
    )


def settings(fmus: Path, foreign: tuple[Path, Path], folder: Path) -> list[dict]:
    """Return scenario, changes and options of runs of every kind."""
    (folder / "steer.csv").write_text("time,delta\n0,0\n0.02,0.01\n0.06,0.03\n")
    text = PAPER_A.read_text().replace("../vehicles", str(SCENARIOS / "vehicles"))
    text = text.replace("units:\n", "inputs: {plant.steer_angle: {file: steer.csv, column: delta}}\nunits:\n")
    (folder / "series.yaml").write_text(text)
    driver = ["driver.start_time=0"]
    idea, broken = foreign
    return [
        {"scenario": PAPER_A, "settings": driver},
        {"scenario": PAPER_A, "settings": [*driver, "plant.mass=1700"]},
        {"scenario": PAPER_A, "settings": driver, "keep": True},
        {"scenario": PAPER_A, "settings": driver, "swaps": ["controller=controller_pid"]},
        {"scenario": PAPER_A, "settings": driver, "swaps": ["tyre=tyre_magic_formula"]},
        {"scenario": PAPER_A, "settings": driver, "faults": ["plant.yaw_rate: noise 0.1 deg/s; delay 0.01"]},
        {"scenario": PAPER_A, "settings": driver, "call_limit": 10.0},
        {"scenario": PAPER_A, "settings": [*driver, "algorithm=jacobi"], "format": "parquet", "keep": True},
        {"scenario": folder / "series.yaml", "keep": True},
        {"scenario": PAPER_A, "swaps": ["controller=controller_mpc"]},
        {"scenario": PAPER_A, "swaps": [f"controller={idea}"], "keep": True},
        {"scenario": PAPER_A, "swaps": [f"controller={idea}"]},
        {"scenario": PAPER_A, "swaps": [f"controller={broken}"]},
        {"scenario": PAPER_A, "faults": ["plant.velocity_x: gain 1e300; gain 1e300"], "keep": True},
        {"scenario": LANE_CHANGE, "settings": driver},
        {"scenario": LANE_CHANGE, "settings": driver, "faults": ["sensor.yaw_rate: freeze from 0.02"]},
        {"scenario": LANE_CHANGE, "settings": ["sensor.seed=7"], "keep": True},
        {"scenario": SCENARIOS / "fuzzy_pid" / "double_lane_change.yaml", "settings": []},
    ]


@pytest.fixture(scope="module")
def kinds(fmus, foreign, tmp_path_factory):
    """Planned jobs of every kind."""
    folder = tmp_path_factory.mktemp("kinds")
    made = []
    for number, kind in enumerate(settings(fmus, foreign, folder)):
        asked = {name: kind.pop(name, ()) for name in ("swaps", "settings", "faults")}
        options = {"keep": False, "metrics": METRICS, **kind}
        changes = changed(**asked, stop_time=0.06)
        made.append(Job(str(number), out=folder / str(number), changes=changes, fmus=fmus, **options))
    return [keyed(job, job.metrics) for job in ready(made)]


def test_plans_share_what_is_equal_and_differ_as_before(fmus, tmp_path):
    masses = [("plant.mass=1700",), ("plant.mass=1800",)]
    some = [Job("", PAPER_A, tmp_path, changed(settings=one), fmus=fmus) for one in masses]
    alone = [ready([job])[0] for job in some]
    one, other = together = ready(some)
    assert together == alone
    assert [keyed(job).key for job in together] == [keyed(job).key for job in alone]
    assert other.plan.wires is one.plan.wires and other.plan.record is one.plan.record
    same = [new is old for new, old in zip(other.plan.instances, one.plan.instances, strict=True)]
    assert 0 < sum(same) < len(same)


@pytest.mark.parametrize(("old", "new"), [(0.0, -0.0), (1.0, 1), (True, 1)])
def test_plans_do_not_share_numbers_that_only_compare_equal(old, new, fmus, tmp_path):
    plan = ready([Job("", PAPER_A, tmp_path, fmus=fmus)])[0].plan

    plans = StoredPlans()
    for value in (old, new):
        plans.add(replace(plan, scenario={**plan.scenario, "x": value}))
    assert repr(plans[1].scenario["x"]) == repr(new)


def shown(job: Job, outcome) -> object:
    """Return all that a run gave, without what differs from time to time."""
    files = {}
    if job.keep and outcome.ok:
        for file in sorted(job.out.iterdir()):
            if file.name == RUN_FILE:
                record = json.loads(file.read_text())
                files[file.name] = {key: value for key, value in record.items() if key not in CHANGING}
            elif file.is_file() and not file.name.startswith("."):
                files[file.name] = file.read_bytes()
    reason = outcome.reason.replace(str(job.out), "OUT")
    value = outcome.value and replace(outcome.value, id=None)
    return reason, outcome.exit_status, value, files


def outcomes(some: list[Job], folder: Path, **options) -> list[object]:
    """Make runs, each with a folder of its own, and return what each gave."""
    placed = [replace(job, out=folder / str(number)) for number, job in enumerate(some)]
    return [shown(*pair) for pair in zip(placed, execute(placed, **options), strict=True)]


@pytest.mark.parametrize("count", [12, pytest.param(500, marks=pytest.mark.exhaustive)])
def test_runs_in_random_order_give_the_bytes_of_fresh_processes(count, kinds, tmp_path, monkeypatch):
    chance = random.Random(count)
    order = [chance.randrange(len(kinds)) for _ in range(count)]
    some = sorted({*order})
    with monkeypatch.context() as fresh:
        fresh.setattr(jobs_module, "LASTING", 1)
        made = outcomes([kinds[number] for number in some], tmp_path / "fresh")
    expected = dict(zip(some, made, strict=True))
    failed = {number for number, (reason, *_) in expected.items() if reason}
    assert failed == {12, 13} & {*some}
    got = outcomes([kinds[number] for number in order], tmp_path / "kept", workers=2)
    for place, number in enumerate(order):
        assert got[place] == expected[number], (place, number)


def run_and_say(job):
    """Make a run; return process, its instances made anew, and how many it keeps."""
    before = {id(one) for one in fmi._kept._idle.values()}
    run_job(job)
    after = {id(one) for one in fmi._kept._idle.values()}
    return os.getpid(), len(after - before), len(after)


def stories(some: list[Job]) -> list[tuple[int, int, int]]:
    return [outcome.value for outcome in execute(some, workers=1, run=run_and_say)]


def test_a_worker_resets_the_instances_that_it_keeps(kinds):
    units = len(kinds[0].plan.instances)
    first, second, swapped, again = stories([kinds[0], kinds[1], kinds[3], kinds[0]])
    assert len({process for process, *_ in (first, second, swapped, again)}) == 1
    assert [made for _, made, _ in (first, second, swapped, again)] == [units, 0, 1, 0]
    assert again[2] == units + 1


def test_a_worker_is_replaced_when_another_fmu_was_loaded_into_it(kinds):
    for other in (9, 11):
        assert not all(is_native(unit.fmu.directory) for unit in kinds[other].plan.instances)
        (first, *_), (second, *_), (third, *_) = stories([kinds[0], kinds[other], kinds[0]])
        assert first == second != third


def test_an_fmu_in_a_process_of_its_own_leaves_the_worker_as_it_is(kinds):
    units = len(kinds[0].plan.instances)
    for other in (6, 10):
        first, second, third = stories([kinds[0], kinds[other], kinds[0]])
        assert first[0] == second[0] == third[0]
        assert (second[1:], third[1:]) == ((0, units), (0, units))


def test_a_worker_is_replaced_after_a_failed_run_and_after_so_many(kinds, monkeypatch):
    monkeypatch.setattr(jobs_module, "LASTING", 2)
    outcomes = execute([kinds[i] for i in (0, 13, 0, 0, 0)], workers=1, run=run_and_say)
    assert [outcome.ok for outcome in outcomes] == [True, False, True, True, True]
    processes = [outcome.value[0] for outcome in outcomes if outcome.ok]
    assert processes[1] == processes[2]
    assert len(set(processes)) == 3


def die_once(job):
    """Die at the first attempt; then say whether instances are kept."""
    mark = job.out.with_name("tried")
    if not mark.exists():
        mark.write_text("")
        os.kill(os.getpid(), signal.SIGSEGV)
    return fmi._kept is None


def test_a_run_whose_worker_died_is_tried_again_in_a_process_that_keeps_nothing(kinds, tmp_path):
    (outcome,) = execute([replace(kinds[0], out=tmp_path / "out")], run=die_once)
    assert outcome.value is True


def test_an_fmu_that_has_changed_is_opened_anew(kinds):
    unit = kinds[0].plan.instances[-1]
    kept = fmi.KeptInstances()
    instance = fmi.open_instance(unit, Log(), set())
    kept.keep(unit, instance)
    other = replace(unit, fmu=replace(unit.fmu, sha256="0" * 64))
    assert kept.take(other, Log(), set()) is None
    assert kept.take(unit, Log(), set()) is instance
    instance.release()


def test_units_that_are_to_run_in_python_are_not_native(kinds, monkeypatch):
    directory = kinds[0].plan.instances[0].fmu.directory
    assert is_native(directory)
    monkeypatch.setenv(WANTED, "python")
    assert not is_native(directory)

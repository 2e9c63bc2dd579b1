"""What stands in the folder of a run, whatever has happened to the runs there."""

import json
import math
import os
import subprocess
import sys

import pytest

from orchestrator.errors import ResultsError
from orchestrator.master.simulate import simulate
from orchestrator.results import folder as module
from orchestrator.results.lock import LOCK_FILE, Lock, holder_of, writing
from orchestrator.results.read import load_results

from .fakes import Clock, Stage, make_plan

needs_locks = pytest.mark.skipif(sys.platform == "win32", reason="folders cannot be locked")


def run(folder, *, n_steps=10, **signals):
    units = {"a": Clock(**(signals or {"x": math.sin}))}
    return simulate(make_plan(units, n_steps=n_steps), folder, opener=Stage(units))


DIES = """
import math, os, sys
from orchestrator.master.simulate import simulate
from tests.orchestrator.fakes import Clock, Stage, make_plan
units = {"a": Clock(x=lambda t: os._exit(0) if t > 1.2 else t)}
simulate(make_plan(units, step="1/1000", n_steps=3000), sys.argv[1], opener=Stage(units))
"""


def die(folder):
    """Make a run whose process ends without a word after 1.2 s."""
    done = subprocess.run([sys.executable, "-c", DIES, str(folder)], timeout=60)
    assert done.returncode == 0


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_the_record_names_the_run_that_the_results_are_of(tmp_path):
    first, second = run(tmp_path), run(tmp_path)
    assert first.id != second.id
    assert load_results(tmp_path).run["id"] == second.id


@needs_locks
def test_results_of_a_run_before_one_that_died_do_not_pass_for_its_own(tmp_path):
    run(tmp_path)
    die(tmp_path)
    with pytest.raises(ResultsError, match=r"the run begun at .* ended without a word; .*yawbench salvage"):
        load_results(tmp_path)
    assert len((tmp_path / "results.csv").read_text().splitlines()) == 12


@needs_locks
def test_the_next_run_removes_what_a_dead_one_has_left(tmp_path):
    die(tmp_path)
    assert {"results.csv.part", "run.json.part", LOCK_FILE} == set(names(tmp_path))
    run(tmp_path)
    assert names(tmp_path) == ["results.csv", "run.json"]


def test_earlier_results_are_read_while_a_run_goes_on(tmp_path):
    info = run(tmp_path)
    seen = []
    run(tmp_path, x=lambda t: seen.append(load_results(tmp_path).run["id"]) or t)
    assert set(seen) == {info.id}


@pytest.mark.parametrize("died_after", range(4))
@pytest.mark.parametrize("before", ["nothing", "completed", "failed"])
@pytest.mark.parametrize("status", ["completed", "failed"])
def test_a_run_that_dies_while_its_files_get_their_names_is_caught_up_with(
    status, before, died_after, tmp_path, monkeypatch
):
    if before != "nothing":
        run(tmp_path)
        record = json.loads((tmp_path / "run.json").read_text())
        (tmp_path / "run.json").write_text(json.dumps({**record, "status": before}))
    replace, calls = os.replace, []

    def replace_until_death(source, target):
        if str(source).endswith(("results.csv.part", "/run.json.part")):
            calls.append(source)
            if len(calls) > died_after:
                raise KeyboardInterrupt
        replace(source, target)

    signals = (
        {"x": math.cos} if status == "completed" else {"x": lambda t: math.cos(t) if t < 0.05 else 1 / 0}
    )
    monkeypatch.setattr(module.os, "replace", replace_until_death)
    try:
        run(tmp_path, **signals)
        died = False
    except KeyboardInterrupt:
        died = True
    except Exception:
        died = False
    monkeypatch.undo()
    place = tmp_path / "failed" if (status, before) == ("failed", "completed") else tmp_path
    results = load_results(tmp_path)
    if place != tmp_path:
        assert results.run["status"] == "completed"
        assert results["a.x"][0] == 0.0
        results = load_results(place)
    assert results.run["status"] == status
    assert results["a.x"][0] == 1.0
    assert died == (died_after < 2)
    assert not [path for path in tmp_path.rglob("*") if path.name.endswith((".part", LOCK_FILE))]


@needs_locks
def test_the_second_command_in_a_folder_is_told_who_is_first(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["yawbench", "study", "my study.yaml"])
    with writing(tmp_path / "out"):
        assert holder_of(tmp_path / "out").process == os.getpid()
        sentence = (
            rf"out: \"yawbench study 'my study.yaml'\" \(process {os.getpid()} on .*, since ..:..:..\) is "
            r"writing here; wait for it, or give another folder with --out\.$"
        )
        with pytest.raises(ResultsError, match=sentence), writing(tmp_path / "out"):
            pass
    assert list(tmp_path.iterdir()) == []


@needs_locks
def test_a_folder_below_one_that_another_process_writes_is_refused(tmp_path):
    holding = "import sys; from pathlib import Path; from orchestrator.results.lock import *\n" + (
        "with writing(Path(sys.argv[1])): print('held', flush=True); input()"
    )
    command = [sys.executable, "-c", holding, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        with pytest.raises(ResultsError, match=rf"process {other.pid} on"), writing(tmp_path / "a" / "b"):
            pass
        other.kill()
    with writing(tmp_path / "a" / "b"):
        run(tmp_path / "a" / "b" / "run")
    assert names(tmp_path / "a" / "b") == ["run"]


@needs_locks
def test_a_look_at_a_lock_does_not_take_it(tmp_path):
    lock = Lock(tmp_path)
    assert holder_of(tmp_path) is not None
    lock.release()
    assert holder_of(tmp_path) is None
    (tmp_path / LOCK_FILE).write_text("what a killed process has left")
    assert holder_of(tmp_path) is None
    Lock(tmp_path).release()
    assert names(tmp_path) == []


def test_results_go_through_a_symbolic_link_to_a_folder(tmp_path):
    (tmp_path / "disk").mkdir()
    (tmp_path / "out").symlink_to("disk")
    run(tmp_path / "out")
    assert len(load_results(tmp_path / "disk").time) == 11
    assert (tmp_path / "out").is_symlink()


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="needs a folder that may not be written")
def test_a_folder_that_may_not_be_written_is_one_sentence(tmp_path):
    (tmp_path / "out").mkdir(mode=0o500)
    with pytest.raises(ResultsError, match=r"out: results cannot be written here: Permission denied\.$"):
        run(tmp_path / "out")


def test_a_link_that_leads_nowhere_is_one_sentence(tmp_path):
    (tmp_path / "out").symlink_to("nowhere")
    with pytest.raises(ResultsError, match=r"out: results cannot be written here: it is no folder\.$"):
        run(tmp_path / "out")

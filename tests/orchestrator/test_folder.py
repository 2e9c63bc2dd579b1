"""Content of the folder of a run, whatever has happened to the runs there."""

import contextlib
import json
import math
import os
import signal
import sys

import pytest

from tests.orchestrator.fakes import Clock, Function, Stage, make_plan
from tests.refusals import mentions, refused
from tests.trees import snapshot
from yawbench.foundation.errors import ResultsError, SimulationError
from yawbench.foundation.safe_files import LOCK_FILE
from yawbench.orchestrator.master.simulate import simulate
from yawbench.orchestrator.results import recorder
from yawbench.orchestrator.results import run_folder as module
from yawbench.orchestrator.results.folder_lock import FolderLock, holder_of, writing
from yawbench.orchestrator.results.reader import found_runs, load_results
from yawbench.orchestrator.results.salvage import lost_format, salvage
from yawbench.studies.listings import runs_table

needs_locks = pytest.mark.skipif(sys.platform == "win32", reason="folders cannot be locked")


def run(folder, *, n_steps=10, wire=False, **signals):
    units = {"a": Clock(**(signals or {"x": math.sin}))}
    if wire:
        units["b"] = Function(lambda t, u: {"y": u["x"]}, ["x"], ["y"])
    plan = make_plan(units, ["a.x -> b.x"] if wire else [], n_steps=n_steps)
    return simulate(plan, folder, opener=Stage(units))


def die(folder, format="csv"):
    """Make a run whose process, a copy of this one, ends without a word after 1.2 s."""
    units = {"a": Clock(x=lambda t: os._exit(0) if t > 1.2 else t)}
    plan = make_plan(units, step="1/1000", n_steps=3000)
    process = os.fork()
    if not process:
        with contextlib.suppress(BaseException):
            simulate(plan, folder, opener=Stage(units), format=format)
        os._exit(1)
    assert os.waitpid(process, 0)[1] == 0


def names_of(folder):
    return sorted(path.name for path in folder.iterdir())


@needs_locks
@pytest.mark.parametrize("before", [True, False])
def test_what_a_dead_run_recorded_can_be_salvaged(before, tmp_path):
    if before:
        run(tmp_path)
    die(tmp_path)
    with refused(ResultsError, "run-died", names=("yawbench salvage", "begun", "abnormally")):
        load_results(tmp_path)
    with (tmp_path / "results.csv.part").open("ab") as stream:
        stream.write(b"1.5,2.5e-1")  # a row that was cut off
    place, rows = salvage(tmp_path)
    assert place == (tmp_path / "failed" if before else tmp_path)
    results = load_results(place)
    assert rows == len(results.time) == results.record.rows == 1024  # two whole blocks
    assert results.record.status == "died"
    assert mentions(results.record.error.message, "ended abnormally")
    if before:
        assert load_results(tmp_path).record.status == "completed"
    with refused(ResultsError, "nothing-to-salvage"):
        salvage(tmp_path)
    assert not [path for path in tmp_path.rglob("*") if path.name.endswith((".part", LOCK_FILE))]


@needs_locks
def test_of_a_format_that_is_only_read_whole_nothing_is_kept_but_the_results_before(tmp_path):
    run(tmp_path)
    die(tmp_path, "parquet")
    assert lost_format(tmp_path) == "results.parquet"
    assert salvage(tmp_path) == (tmp_path, 0)
    assert names_of(tmp_path) == ["results.csv", "run.json"]
    assert len(load_results(tmp_path).time) == 11


@needs_locks
def test_a_list_of_runs_shows_those_that_died_and_failed_beside_the_good_one(tmp_path):
    run(tmp_path / "a")
    with pytest.raises(SimulationError):
        run(tmp_path / "a", x=lambda t: math.nan if t > 0.05 else t, wire=True)
    die(tmp_path / "a")
    die(tmp_path / "b")
    salvage(tmp_path / "b")
    run(tmp_path / "c")
    (tmp_path / "c" / "run.json").write_text("{")
    runs = found_runs(tmp_path)
    assert {f"{one.folder.relative_to(tmp_path).as_posix()} {one.status.value}" for one in runs} == {
        "a completed", "a/failed failed", "a died", "b died", "c unreadable"
    }  # fmt: skip
    table = runs_table(runs)
    assert next(row[0] for row in table.rows) == str(tmp_path / "c")
    assert mentions(table.notes, "ended abnormally")


@needs_locks
def test_the_next_run_removes_what_a_dead_one_has_left(tmp_path):
    die(tmp_path)
    assert {"results.csv.part", "run.json.part", LOCK_FILE} == set(names_of(tmp_path))
    run(tmp_path)
    assert names_of(tmp_path) == ["results.csv", "run.json"]


def test_earlier_results_are_read_while_a_run_goes_on(tmp_path):
    first = run(tmp_path)
    seen = []
    second = run(tmp_path, x=lambda t: seen.append(load_results(tmp_path).record.id) or t)
    assert set(seen) == {first.id}
    assert load_results(tmp_path).record.id == second.id != first.id


@pytest.mark.parametrize("died_after", range(3))
@pytest.mark.parametrize("before", ["nothing", "completed", "failed"])
@pytest.mark.parametrize("status", ["completed", "failed"])
def test_a_run_that_dies_while_its_files_get_their_names_is_said_and_put_in_place_by_salvage(
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

    died = False
    with monkeypatch.context() as patched:
        patched.setattr(module.os, "replace", replace_until_death)
        try:
            run(tmp_path, x=lambda t: math.cos(t) if status == "completed" or t < 0.05 else 1 / 0)
        except KeyboardInterrupt:
            died = True
        except ZeroDivisionError:
            pass
    assert died == (died_after < 2)
    place = tmp_path / "failed" if (status, before) == ("failed", "completed") else tmp_path
    if died:
        left = snapshot(tmp_path)
        with refused(ResultsError, "run-died", names=("yawbench salvage", "begun", "results")):
            load_results(tmp_path)
        assert "died" in [one.status for one in found_runs(tmp_path)]
        assert snapshot(tmp_path) == left
        assert salvage(tmp_path) == (place, load_results(place).record.rows)
    if place != tmp_path:
        results = load_results(tmp_path)
        assert (results.record.status, results["a.x"][0]) == ("completed", 0.0)
    results = load_results(place)
    assert (results.record.status, results["a.x"][0]) == (status, 1.0)
    assert not [path for path in tmp_path.rglob("*") if path.name.endswith((".part", LOCK_FILE))]


def test_the_next_run_puts_in_place_what_one_had_ended_with_before(tmp_path, monkeypatch):
    with monkeypatch.context() as patched, pytest.raises(ZeroDivisionError):
        patched.setattr(recorder, "put_in_place", lambda folder: 1 / 0)
        run(tmp_path)
    assert names_of(tmp_path) == ["results.csv.part", "run.json.part"]
    with pytest.raises(SimulationError):
        run(tmp_path, x=lambda t: math.nan if t > 0.05 else t, wire=True)
    assert load_results(tmp_path).record.status == "completed"
    assert load_results(tmp_path / "failed").record.status == "failed"


@needs_locks
def test_the_second_command_in_a_folder_is_told_who_is_first(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["yawbench", "study", "my study.yaml"])
    names = ("out", "\"yawbench study 'my study.yaml'\"", f"process {os.getpid()} on", "since", "--out")
    with writing(tmp_path / "out"):
        assert f"process {os.getpid()} " in holder_of(tmp_path / "out")
        with refused(ResultsError, "results-locked", names=names), writing(tmp_path / "out"):
            pass
    assert list(tmp_path.iterdir()) == []


@needs_locks
def test_a_folder_below_one_that_another_process_writes_is_refused(tmp_path):
    held, hold = os.pipe()
    other = os.fork()
    if not other:
        with writing(tmp_path):
            os.write(hold, b"!")
            signal.pause()
    assert os.read(held, 1)
    names = (f"process {other} on",)
    with refused(ResultsError, "results-locked", names=names), writing(tmp_path / "a" / "b"):
        pass
    os.kill(other, signal.SIGKILL)
    os.waitpid(other, 0)
    with writing(tmp_path / "a" / "b"):
        run(tmp_path / "a" / "b" / "run")
    assert names_of(tmp_path / "a" / "b") == ["run"]


@needs_locks
def test_a_look_at_a_lock_does_not_take_it(tmp_path):
    lock = FolderLock(tmp_path)
    assert holder_of(tmp_path) is not None
    lock.release()
    assert holder_of(tmp_path) is None
    (tmp_path / LOCK_FILE).write_text("what a killed process has left")
    assert holder_of(tmp_path) is None
    FolderLock(tmp_path).release()
    assert names_of(tmp_path) == []


def test_results_go_through_a_symbolic_link_to_a_folder(tmp_path):
    (tmp_path / "disk").mkdir()
    (tmp_path / "out").symlink_to("disk")
    run(tmp_path / "out")
    assert len(load_results(tmp_path / "disk").time) == 11
    assert (tmp_path / "out").is_symlink()


@pytest.mark.parametrize("make", [lambda out: out.write_text(""), lambda out: out.symlink_to("nowhere")])
def test_what_is_no_folder_is_one_sentence(make, tmp_path):
    make(tmp_path / "out")
    with refused(ResultsError, "results-unwritable", names=("--out", "folder")):
        run(tmp_path / "out")


@pytest.mark.parametrize("name", ["file/out", "n" * 300])
def test_a_folder_that_cannot_be_made_is_one_sentence(name, tmp_path):
    (tmp_path / "file").write_text("")
    with refused(ResultsError, "results-unwritable", names=("results",)):
        run(tmp_path / name)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")
@pytest.mark.parametrize("name", ["run.json.part", LOCK_FILE])
def test_a_pipe_in_place_of_a_file_of_ours_keeps_nobody_waiting(name, tmp_path):
    run(tmp_path)
    for pipe in {"run.json.part", name}:
        os.mkfifo(tmp_path / pipe)
    with refused(ResultsError, "run-died", names=("yawbench salvage", "abnormally", "results")):
        load_results(tmp_path)

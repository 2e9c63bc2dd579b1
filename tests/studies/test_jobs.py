"""Runs in processes of their own, with made-up runs in place of scenarios."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.orchestrator.recorded import car, write
from tests.refusals import each_mentions, mentions, refused, texts_of
from yawbench.fmus.fmu import Fmu, Variable
from yawbench.foundation import processes
from yawbench.foundation.errors import ResultsError, ScenarioError, SimulationError, YawbenchError
from yawbench.foundation.workers import Pool
from yawbench.orchestrator.results.reader import load_results
from yawbench.studies.jobs import Job, execute, read_back, ready


def record(job):
    """Write results, and which process did."""
    write(car(n=5), job.out)
    (job.out / "pid").write_text(str(os.getpid()))


def obey(job):
    """Do what the label says."""
    if job.label == "fails":
        raise SimulationError("plant: step failed at t = 1 s", instance="plant", time=1.0)
    if job.label == "wrong":
        raise ScenarioError(["first problem", "second problem"])
    if job.label == "dies":
        os.kill(os.getpid(), signal.SIGKILL)
    if job.label == "leaves":
        os._exit(3)
    if job.label == "breaks":
        raise ZeroDivisionError("by zero")
    if job.label == "hangs":
        while True:
            (job.out.parent / "fifo").read_text()  # waits for somebody to write
    if job.label == "waits":
        (job.out.parent / "fifo").write_text("it has begun")  # waits for somebody to read
    record(job)


def jobs(folder: Path, *labels: str) -> list[Job]:
    return [Job(label, Path("made_up.yaml"), folder / label) for label in labels]


def test_runs_are_shared_among_workers_and_outcomes_keep_their_order(tmp_path):
    outcomes = execute(jobs(tmp_path, "a", "b", "c", "d"), workers=2, run=record)
    assert [outcome.job.label for outcome in outcomes] == ["a", "b", "c", "d"]
    assert all(outcome.ok for outcome in outcomes)
    pids = {(tmp_path / label / "pid").read_text() for label in "abcd"}
    assert len(pids) == 2
    assert str(os.getpid()) not in pids


def test_a_run_that_fails_or_dies_takes_no_other_with_it(tmp_path):
    labels, told = ["fails", "good", "dies", "wrong", "leaves", "breaks", "fine"], []
    made = execute(jobs(tmp_path, *labels), workers=2, run=obey, done=told.append)
    assert len(told) == len(made) and all(outcome in told for outcome in made)
    outcomes = {one.job.label: one for one in made}
    assert outcomes["good"].ok
    assert outcomes["fine"].ok
    assert mentions(outcomes["fails"].reason, "plant", "1 s")
    assert outcomes["fails"].exit_status == 1
    assert texts_of(outcomes["wrong"]) == ("first problem", "second problem")
    assert outcomes["wrong"].exit_status == 2
    assert mentions(outcomes["dies"].reason, "SIGKILL", "process")
    assert mentions(outcomes["leaves"].reason, "status 3", "process", "exit")
    assert texts_of(outcomes["breaks"]) == ("ZeroDivisionError: by zero",)  # of the program itself
    assert outcomes["breaks"].exit_status == 1


def test_results_of_an_earlier_run_cannot_pass_for_new(tmp_path):
    write(car(n=5), tmp_path / "fails")
    (failed,) = execute(jobs(tmp_path, "fails"), run=obey)
    assert not failed.ok
    assert load_results(tmp_path / "fails").record.status == "completed"  # nothing is lost
    assert mentions(read_back(tmp_path / "fails", "of the new run"), "fails", "results", "just")


@pytest.mark.parametrize("why", [KeyboardInterrupt, pytest.param(ValueError, marks=pytest.mark.exhaustive)])
def test_when_the_caller_stops_all_runs_end(tmp_path, monkeypatch, why):
    def stop(outcome):
        raise why

    monkeypatch.setattr("yawbench.foundation.processes.GRACE", 0.0)
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(why):
        execute(jobs(tmp_path, "hangs", "waits"), workers=2, run=obey, done=stop)
    with refused(OSError, names=("[Errno 6]", "fifo")):  # nobody reads any more
        os.open(tmp_path / "fifo", os.O_WRONLY | os.O_NONBLOCK)


def deaf(job):
    """Return whether this process ignores Ctrl-C, and is in another session than the terminal's."""
    return signal.getsignal(signal.SIGINT) is signal.SIG_IGN, os.getsid(0)


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
def test_ctrl_c_does_not_reach_a_run_even_while_its_process_starts(tmp_path):
    (outcome,) = execute(jobs(tmp_path, "a"), run=deaf)
    assert outcome.value[0]
    assert outcome.value[1] != os.getsid(0)
    assert not deaf(None)[0]  # the caller gets it


CALLER = """
import sys
from pathlib import Path
from yawbench.studies.jobs import execute
from tests.studies.test_jobs import jobs, tell_and_wait
execute(jobs(Path(sys.argv[1]), "waits"), run=tell_and_wait)
"""


def tell_and_wait(job):
    """Say that the run has begun, and go on for as long as the process may."""
    (job.out.parent / "begun").write_text("")
    signal.pause()


@pytest.mark.skipif(sys.platform != "linux", reason="needs Linux to tell a process that its parent has ended")
def test_processes_end_without_a_word_when_their_caller_is_killed(tmp_path):
    os.mkfifo(tmp_path / "begun")
    command = [sys.executable, "-c", CALLER, str(tmp_path)]
    caller = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    (tmp_path / "begun").read_bytes()
    caller.kill()
    assert caller.communicate() == (b"", b"")  # nobody holds its output any more


def test_only_a_run_that_reached_its_end_is_read_back(tmp_path):
    write(car(n=5), tmp_path / "whole")
    write(car(n=5), tmp_path / "part", status="failed", error={"message": "plant: step failed"})
    assert read_back(tmp_path / "whole").folder == load_results(tmp_path / "whole").folder
    assert mentions(read_back(tmp_path / "part"), "part", "early", "plant")
    assert mentions(read_back(tmp_path / "none"), "no results here")


def test_all_problems_of_all_jobs_are_found_before_any_runs(tmp_path):
    first, second = tmp_path / "first.yaml", tmp_path / "second.yaml"
    twice = [Job("a", first, tmp_path), Job("b", second, tmp_path), Job("c", first, tmp_path)]
    with pytest.raises(ScenarioError) as error:
        ready(twice)
    assert each_mentions(error.value, (first,), (second,))
    assert [one.location.file for one in error.value.diagnostics] == [first, second]


def test_an_fmu_that_is_missing_is_told_once_with_all_places_that_need_it(tmp_path):
    text = "stop_time: 1\nstep_size: 0.1\nunits:\n  a: {fmu: driver_nowhere}\n"
    files = [tmp_path / name for name in ("first.yaml", "second.yaml", "third.yaml")]
    for file in files:
        file.write_text(text)
    files[2].write_text(f"{text}  b: {{fmu: plant_nowhere}}\n")
    with pytest.raises(ScenarioError) as error:
        ready([Job(file.stem, file, tmp_path, fmus=tmp_path) for file in files])
    driver, plant = error.value.diagnostics
    assert (driver.location.file, driver.location.line) == (files[0], 4)
    assert mentions(driver.message, "driver_nowhere", f"{files[1]}:4", f"{files[2]}:4")
    assert (plant.location.file, plant.location.line) == (files[2], 5)
    assert mentions(plant.message, "plant_nowhere") and "second" not in plant.message


def half(number):
    """Return half of an even number; end at 99."""
    if number == 99:
        os.kill(os.getpid(), signal.SIGKILL)
    if number % 2:
        raise ResultsError(f"{number} is odd")
    return number // 2


def test_processes_that_share_work_keep_its_order_and_hand_on_what_is_raised():
    with Pool(2) as workers:
        assert workers.map(half, range(0, 40, 2)) == list(range(20))
        with pytest.raises(ResultsError, match="7 is odd"):
            workers.map(half, [2, 4, 6, 7, 8, 10])
        assert workers.map(half, [2, 4]) == [1, 2]
        assert workers.map(half, []) == []
        with refused(YawbenchError, "run-process-died"):
            workers.map(half, [2, 99])


def title_of(fmu, number):
    """Return what a worker knows of an FMU."""
    return fmu.description, len(fmu.variables), number, os.getpid()


def test_a_worker_is_sent_an_fmu_once(monkeypatch):
    variables = {
        f"x{k}": Variable(f"x{k}", k, "Real", "local", "continuous", *[None] * 4, "") for k in range(99)
    }
    fmus = [Fmu(name, Path(), Path(), "", "", "", "", variables, name) for name in ("one", "another")]
    sizes = []

    def measured(content, reduce, pickled=processes.pickled):
        data = pickled(content, reduce)
        sizes.append(len(data))
        return data

    monkeypatch.setattr(processes, "pickled", measured)
    with Pool(1) as workers:
        told = workers.map(title_of, [fmus[0], fmus[1], *fmus], range(4))
    assert [known[:3] for known in told] == [(fmus[k % 2].description, 99, k) for k in range(4)]
    assert len({process for *_, process in told}) == 1
    assert max(sizes[2:]) < min(sizes[:2]) / 20

"""`yawbench compare`, `converge`, `plot` and `study` with real FMUs, from the command line to the files."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys

import pytest

from tests.command_line import status_of
from tests.refusals import each_mentions, mentions
from yawbench.foundation.safe_files import LOCK_FILE
from yawbench.orchestrator.results.folder_lock import FolderLock

UNITS = ("driver_sine", "reference_steady_state", "controller_off", "controller_fuzzy_sideslip")

SCENARIO = """
title: Half a car
stop_time: 0.4
step_size: 0.01
inputs: {velocity_x: 20, friction: 0.7, sideslip: 0.001, sideslip_rate: 0}
units:
  driver:     {fmu: driver_sine, parameters: {frequency: 2, start_time: 0}}
  reference:  {fmu: reference_steady_state}
  controller: {fmu: controller_fuzzy_sideslip}
"""

STUDY = """
title: Half a paper
runs:
  - for: {controller: ["off", fuzzy_sideslip]}
    name: "{controller}"
    scenario: half.yaml
    swap: {controller: "controller_{controller}"}
metrics:
  moment: {metric: peak(yaw_moment)}
tables:
  - {title: Moments, runs: ["*"], metrics: [moment]}
claims:
  - {says: Without control there is no moment., holds_if: [{run: "off", metric: moment, at_most: 0}]}
  - {says: Control is gentle., holds_if: [{run: fuzzy_sideslip, metric: moment, at_most: 1 N.m}]}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty working directory with the scenario and the study."""
    (tmp_path / "half.yaml").write_text(SCENARIO)
    (tmp_path / "study.yaml").write_text(STUDY)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def yawbench(yawbench, fmus, folder):
    """Run the command line in the folder, with the FMUs."""
    return lambda *arguments: yawbench(*arguments, "--fmus", fmus)


def test_compare_puts_the_runs_side_by_side(yawbench, folder):
    status, out, said = yawbench(
        "compare", "half.yaml", "--swap", "controller=controller_off,controller_fuzzy_sideslip"
    )
    assert status == 0
    where = f"results/{folder.name}/half-compare"  # beside those of `run`, as nothing else is said
    assert mentions(out, "Half", "car", "controller")
    heading = next(line for line in out.splitlines() if "metric" in line)
    assert heading.split()[1:] == ["controller_off", "controller_fuzzy_sideslip"]
    assert mentions(said.splitlines()[-1], "half-compare/report.html", "page")
    assert (folder / where / "figures/overview.svg").is_file()
    rows = {row["run"]: row for row in csv.DictReader((folder / where / "table.csv").open())}
    assert float(rows["controller_off"]["peak(yaw_moment) [N.m]"]) == 0.0
    assert float(rows["controller_fuzzy_sideslip"]["peak(yaw_moment) [N.m]"]) > 1.0
    for run in rows:
        assert (folder / where / run / "results.csv").is_file()


def test_compare_reports_a_failed_run_and_keeps_the_others(yawbench, folder):
    (folder / "o").mkdir()
    (folder / "o" / "controller_off").write_text("a file where the folder should be")
    status, out, said = yawbench(
        "compare", "half.yaml", "--swap", "controller=controller_off", "--out", "o", "--jobs", "1"
    )
    assert status == 1
    assert mentions(said, "o/controller_off", "results")
    assert "failed" in out
    rows = {row["run"]: row for row in csv.DictReader((folder / "o/table.csv").open())}
    assert rows["controller_fuzzy_sideslip"]["status"] == "completed"


def test_converge_halves_the_step_and_reports_order_and_cost(yawbench, folder):
    status, out, _ = yawbench(
        "converge", "half.yaml", "--signal", "reference.yaw_rate_ref", "--halvings", "2", "--out", "o",
        "--algorithm", "jacobi", "--algorithm", "gauss_seidel",
    )  # fmt: skip
    assert status == 0
    assert [line.split()[:2] for line in out.splitlines() if line.startswith((" jacobi", " gauss"))] == [
        [name, step] for name in ("jacobi", "gauss_seidel") for step in ("10", "5", "2.5")
    ]
    assert {"converge.csv", "converge.svg", "report.html"} <= {path.name for path in (folder / "o").iterdir()}
    rows = list(csv.DictReader((folder / "o/converge.csv").open()))
    assert float(rows[0]["order [1]"]) == pytest.approx(1.0, abs=0.1)  # jacobi is one step late
    assert float(rows[0]["wall_time [s]"]) > 0
    repeating = ("half.yaml", "--halvings", "2", "--signal", "reference.yaw_rate_ref", "gauss_seidel")
    assert mentions((folder / "o/report.html").read_text(), *repeating)
    header = (folder / "o/jacobi/5ms/results.csv").read_text().splitlines()[0]
    assert header == "time,reference.yaw_rate_ref"  # the signal alone


def test_converge_names_a_wrong_signal_or_algorithm(yawbench):
    status, _, said = yawbench("converge", "half.yaml", "--signal", "reference.yaw_rate")
    assert status == 2
    assert each_mentions(said, ("half.yaml", "'reference.yaw_rate'", "'reference.yaw_rate_ref'"))
    status, _, said = yawbench("converge", "half.yaml", "--algorithm", "gauss")
    assert status == 2
    assert each_mentions(said, ("--algorithm gauss", "gauss_seidel", "jacobi", "extrapolated"))


def test_study_makes_again_only_what_has_not_been_made_of_the_same_scenario(yawbench, folder):
    yawbench("study", "study.yaml", "--out", "o")
    records = [folder / "o" / run / "run.json" for run in ("off", "fuzzy_sideslip")]
    ids = [json.loads(file.read_text())["id"] for file in records]
    assert mentions(yawbench("study", "study.yaml", "--out", "o")[2], "all finished already")
    (folder / "o/off/results.csv").write_text("time\n")
    assert mentions(yawbench("study", "study.yaml", "--out", "o")[2], "2 runs", "1", "finished")
    again = [
        json.loads((folder / f"o/{run}/run.json").read_text())["id"] for run in ("off", "fuzzy_sideslip")
    ]
    assert (ids[0] == again[0], ids[1] == again[1]) == (False, True)
    assert "finished already" not in yawbench("study", "study.yaml", "--out", "o", "--fresh")[2]


def test_study_without_running_judges_what_is_there_and_tells_what_is_of_another_run(yawbench, folder):
    def judged(*options):
        status, out, said = yawbench("study", "study.yaml", "--out", "o", *options)
        return status, "not judged" in out, "out of date" in said, said

    assert judged()[:3] == (0, False, False)
    record = folder / "o/off/run.json"
    before = record.read_bytes()
    (folder / "o/report.html").unlink()
    scenario = folder / "half.yaml"
    scenario.write_text(SCENARIO + "# the same\n")
    assert judged("--no-run")[:3] == (0, False, False)
    assert (folder / "o/report.html").is_file()
    scenario.write_text(SCENARIO.replace("stop_time: ", "stop_time: 1"))
    *ended, said = judged("--no-run")
    assert ended == [0, False, True] and mentions(said, "off", "date", "stop")
    assert record.read_bytes() == before
    scenario.unlink()
    assert judged("--no-run")[:2] == (0, False)
    record.unlink()
    assert judged("--no-run")[:2] == (1, True)


def test_study_finds_a_wrong_scenario_before_anything_runs(yawbench, folder):
    (folder / "half.yaml").write_text(SCENARIO.replace("frequency", "frequenzy"))
    status, _, said = yawbench("study", "study.yaml", "--out", "o")
    assert status == 2
    assert mentions(said, "'frequenzy'", "'frequency'")
    assert said.count("\n") == 1  # once, though two runs have it
    assert not (folder / "o").exists()


SWEEP = """
title: Half a sweep
scenario: half.yaml
axes: {gain: {vary: driver.amplitude, values: [0.01, 0.02], unit: rad}}
metrics: {moment: {metric: peak(yaw_moment)}}
"""
WRITERS = {
    "run": ("half.yaml",),
    "compare": ("half.yaml", "--swap", "controller=controller_off"),
    "converge": ("half.yaml", "--signal", "controller.yaw_moment"),
    "study": ("study.yaml",),
    "report": ("study.yaml",),
    "sweep": ("sweep.yaml",),
}


@pytest.mark.sampled(2)
@pytest.mark.skipif(sys.platform == "win32", reason="folders cannot be locked")
@pytest.mark.parametrize("command", WRITERS)
def test_a_command_leaves_a_folder_alone_while_another_is_writing_and_leaves_it_in_turn(
    command, yawbench, folder
):
    (folder / "sweep.yaml").write_text(SWEEP)
    held = FolderLock(folder / "o")
    before = sorted((folder / "o").iterdir())
    status, out, said = yawbench(command, *WRITERS[command], "--out", "o")
    assert (status, out) == (2, "")
    assert mentions(said, "o:", f"(process {os.getpid()}")
    assert mentions(said.splitlines()[-1], "--out", "wait")
    assert sorted((folder / "o").iterdir()) == before
    held.release()
    assert yawbench(command, *WRITERS[command], "--out", "o")[0] == 0
    assert not list((folder / "o").rglob(LOCK_FILE))


LONG = """
  - {name: long, scenario: half.yaml, stop_time: 100000}
metrics:"""


def test_ctrl_c_ends_a_study_and_keeps_finished_runs(fmus, folder):
    (folder / "study.yaml").write_text(STUDY.replace("\nmetrics:", LONG))
    command = [sys.executable, "-m", "yawbench", "study", "study.yaml", "--out", "o", "--jobs", "1"]
    process = subprocess.Popen(
        [*command, "--fmus", str(fmus)], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stderr is not None
    for line in process.stderr:
        if "fuzzy_sideslip" in line:
            break
    os.killpg(process.pid, signal.SIGINT)
    said = process.stderr.read()
    assert process.wait() == 130
    assert mentions(said.splitlines()[-1], "results")
    assert json.loads((folder / "o/fuzzy_sideslip/run.json").read_text())["status"] == "completed"


def test_plot_runs_a_scenario_whose_results_are_missing_or_of_another_controller(yawbench, folder):
    out, plot = f"results/{folder.name}/half", ("plot", "half.yaml", "--panel", "yaw_moment")

    def controller():
        return json.loads((folder / out / "run.json").read_text())["fmus"]["controller"]["name"]

    status, _, said = yawbench(*plot)
    assert status == 0
    assert said.splitlines()[0].startswith("[1/1] half: ")
    assert mentions(said.splitlines()[1], "half/overview.svg", "overview.png")
    assert controller() == "controller_fuzzy_sideslip"
    status, _, said = yawbench(*plot)
    assert status == 0
    assert each_mentions(said, ("half/overview.svg", "overview.png"))
    status, _, said = yawbench(*plot, "--swap", "controller=controller_off")
    assert (status, said.count("\n")) == (0, 2)
    assert mentions(said.splitlines()[1], "half", "controller=controller_off/overview.svg", "overview.png")
    assert controller() == "controller_fuzzy_sideslip"
    out = f"{out},controller=controller_off"
    assert controller() == "controller_off"


def test_plot_says_what_is_wrong(yawbench, folder):
    yawbench("run", "half.yaml", "--out", "o/off")
    for arguments, *names in (
        (["nowhere"], "run.json", "'yawbench run SCENARIO --out nowhere'"),
        (["o/off/results.csv"], "o/off/results.csv", "folder", "results"),
        (["o/off", "--set", "driver.amplitude=0.01"], "--swap", "--set", "--fault"),
        (["half.yaml", "--swap", "brake=controller_off"], "--swap brake=controller_off", "'brake'", "driver"),
        (["o/off", "--panel", "roll_angle"], "--panel roll_angle", "'steer_angle'"),
        (["o/off", "--label", "a", "--label", "b"], "--label", "2 labels, 1 folder", "folder"),
    ):
        status, _, said = yawbench("plot", *arguments)
        assert status == 2
        assert each_mentions(said, tuple(names))


@pytest.mark.parametrize(
    "command",
    [
        ["compare", "half.yaml", "--swap", "controller=controller_off"],
        ["converge", "half.yaml", "--signal", "controller.yaw_moment"],
        ["plot", "half.yaml"],
        ["report", "study.yaml"],
        ["study", "study.yaml"],
    ],
    ids=lambda command: command[0],
)
def test_every_command_that_makes_runs_isolates_units_if_told(command, folder, fmus, monkeypatch):
    limits = []

    def ready(jobs, **options):
        limits.extend(job.call_limit for job in jobs)
        raise SystemExit(7)

    monkeypatch.setattr("yawbench.studies.jobs.ready", ready)
    monkeypatch.setattr("yawbench.studies.experiment.plans_of", ready)
    assert status_of(*command, "--fmus", fmus, "--isolate", "--call-limit", "3 s") == 7
    assert set(limits) == {3.0}

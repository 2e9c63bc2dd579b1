"""`--dry-run`: how many runs an experiment would take, how long and how much space, and nothing written."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.checkout import ROOT
from tests.commands.test_batch_commands import SCENARIO, STUDY
from tests.commands.test_output import ALWAYS, SWEEP, documented
from tests.ranking.test_ranking import SMALL
from yawbench.studies.dry_run import Forecast, Span, forecast_table
from yawbench.studies.jobs import MeasuredRun
from yawbench.studies.journal import Journal, records_in

UNITS = ("driver_sine", "reference_steady_state", "controller_off", "controller_fuzzy_sideslip")
OPEN = """
region:
  points: 10
  most: 20
  open_values:
    friction: {vary: inputs.friction, from: 0.5, to: 0.9, because: chosen}
"""
TUNING = """
title: One law
runs:
  - {name: held, scenario: half.yaml}
  - {name: free, scenario: half.yaml, swap: {controller: controller_off}}
metrics:
  moment: {metric: peak(yaw_moment)}
derived:
  cost: {says: moment, expression: a, of: {a: {run: held, metric: moment}}}
tuning:
  objective: cost
  population: 5
  generations: 3
  seed: 1
  runs: [held]
  laws:
    fuzzy: {axes: {range: {vary: controller.error_range, from: 0.01, to: 0.1}}}
"""


@pytest.fixture
def forecast(yawbench, fmus, tmp_path, monkeypatch):
    """Call a command with `--dry-run` and return its forecast; nothing may be written."""
    texts = {"half": SCENARIO, "study": STUDY, "sweep": SWEEP, "region": STUDY + OPEN, "tuning": TUNING}
    for name, text in texts.items():
        (tmp_path / f"{name}.yaml").write_text(text)
    monkeypatch.chdir(tmp_path)

    def state() -> dict[Path, int]:
        return {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}

    def call(*arguments: str) -> dict[str, object]:
        before = state()
        status, out, _ = yawbench(*arguments, "--fmus", fmus, "--dry-run", "--json")
        assert status == 0
        assert state() == before
        (made,) = json.loads(out)["forecasts"]
        return made

    return call


@pytest.mark.parametrize("command", ["study", "sweep"])
def test_runs_are_to_be_made_until_they_are_made(command, forecast, yawbench, fmus):
    before = forecast(command, f"{command}.yaml")
    assert (before["finished"], before["left"]) == (0, [2, 2])
    assert min(before["seconds"]) > 0
    assert min(before["size"]) > 0
    assert yawbench(command, f"{command}.yaml", "--fmus", fmus)[0] == 0
    after = forecast(command, f"{command}.yaml")
    assert [after.pop(name) for name in ("finished", "left", "seconds", "size")] == [2, *[[0, 0]] * 3]
    again = forecast(command, f"{command}.yaml", "--fresh")
    assert (again["finished"], again["left"]) == (0, [2, 2])


def test_a_tuning_takes_its_budget_and_the_runs_beside_it(forecast, yawbench, fmus):
    assert forecast("tune", "tuning.yaml")["left"] == [5 * 3 + 1, 5 * 3 + 1]
    status, out, _ = yawbench("tune", "tuning.yaml", "--fmus", fmus, "--json")
    assert status == 0
    assert set(json.loads(out)) == ALWAYS | documented()["tune"]
    after = forecast("tune", "tuning.yaml")
    assert after["left"] == [0, 0]


def test_a_journal_that_is_only_read_has_its_whole_lines(tmp_path):
    journal = Journal(tmp_path, "a/b.yaml")
    for key in ("one", "two", "three"):
        journal.add(key, MeasuredRun({"x": (1.0, "s")}))
    journal.close()
    assert records_in(tmp_path) == journal.records
    lines = (tmp_path / "runs.jsonl").read_text().splitlines()
    (tmp_path / "runs.jsonl").write_text("\n".join([*lines[:2], lines[2][:-9], lines[3]]))
    assert [*records_in(tmp_path)] == ["one"]  # neither the broken line nor the one that was cut off
    assert records_in(tmp_path / "nothing") == {}


def test_time_is_that_of_the_processors_and_bounds_are_in_words():
    forecast = Forecast("many")
    forecast.add(Span(10, 20), 30.0, 5e5)
    table = forecast_table([forecast], workers=4)
    ((title, finished, left, time, size),) = table.text()
    assert (title, finished, left) == ("many", "0", "10 to 20")
    assert time == "75 s to 2.5 min"
    assert size == "5 MB to 10 MB"


def test_a_ranking_is_counted_with_an_assumed_angle_until_it_is_measured(yawbench, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("small.yaml").write_text(SMALL)

    def counted() -> tuple[int, list[float], list[str]]:
        status, out, _ = yawbench("rank", "small.yaml", "--dry-run", "--json")
        assert status == 0
        answer = json.loads(out)
        (made,) = answer["forecasts"]
        return made["finished"], made["left"], made["notes"]

    finished, left, (note,) = counted()
    assert (finished, left) == (0, [2 + 2 * 2, 2 + 2 * 2])  # both sides of A, two entries in two conditions
    assert "40.0 °" in note
    assert [path.name for path in tmp_path.iterdir()] == ["small.yaml"]


@pytest.mark.exhaustive
def test_outside_a_checkout_dry_runs_work_and_runs_take_the_fmus_of_the_cache(tmp_path):
    """With a copy of the program as a package has it: without a checkout, and without FMUs."""
    site, work = tmp_path / "site", tmp_path / "work"
    for name in ("orchestrator", "components", "vocabulary", "scenarios", "yawbench", "fmus"):
        shutil.copytree(ROOT / name, site / name, ignore=shutil.ignore_patterns("__pycache__", "*.fmu"))
    work.mkdir()
    (work / "half.yaml").write_text(SCENARIO)
    (work / "sweep.yaml").write_text(SWEEP)
    environment = os.environ | {"PYTHONPATH": str(site), "YAWBENCH_CACHE": str(tmp_path / "cache")}

    def call(*arguments: str) -> tuple[int, str, str]:
        command = (sys.executable, "-m", "yawbench", *arguments)
        done = subprocess.run(command, cwd=work, env=environment, capture_output=True, text=True, check=False)
        return done.returncode, done.stdout, done.stderr

    status, _, said = call("run", "half.yaml", "--no-build")
    assert (status, said.count("fmu")) == (2, 3)
    assert all(f"{name} is not built" in said for name in ("driver_sine", "reference_steady_state"))
    status, out, _ = call("sweep", "sweep.yaml", "--dry-run", "--json")
    assert (status, json.loads(out)["forecasts"][0]["left"]) == (0, [2, 2])
    assert sorted(path.name for path in work.iterdir()) == ["half.yaml", "sweep.yaml"]
    assert not [*site.rglob("*.fmu")]
    assert call("sweep", "sweep.yaml", "--no-build")[0] == 0
    status, out, _ = call("sweep", "sweep.yaml", "--dry-run", "--json", "--no-build")
    assert (status, json.loads(out)["forecasts"][0]["finished"]) == (0, 2)


def test_no_run_and_dry_run_exclude_each_other(yawbench, forecast):
    status, _, said = yawbench("study", "study.yaml", "--no-run", "--dry-run")
    assert status == 2
    assert "--dry-run and --no-run" in said

"""Tuning from the file to what is found: one search and budget for all laws, resumed where it was."""

from __future__ import annotations

import csv
import json

import pytest
from lxml import html
from ruamel.yaml import YAML

from tests.refusals import mentions
from tests.studies.experiment_files import written
from yawbench.orchestrator.scenario import yaml_lines
from yawbench.orchestrator.scenario.schema_validation import validate
from yawbench.ranking.ranking import EntriesSpec

SCENARIO = """
title: A steering wheel
stop_time: 0.1
step_size: 0.01
units: {driver: {fmu: driver_sine, parameters: {frequency: 2.5, start_time: 0}}}
"""
TUNING = """
title: How far to turn
runs:
  - {name: turned, scenario: wheel.yaml}
  - {name: as it stands, scenario: wheel.yaml, set: {driver.amplitude: 0.03}}
metrics: {steer: {metric: peak(steer_angle)}}
derived:
  miss:
    says: Square of the distance
    expression: (turned - wanted) * (turned - wanted)
    of: {turned: {run: turned, metric: steer}, wanted: {run: as_it_stands, metric: steer}}
tuning:
  objective: miss
  population: 5
  generations: 2
  seed: 2
  runs: [turned]
  entries: driver
  laws:
    big wheel:
      swap: {driver: driver_sine}
      axes: {angle: {vary: driver.amplitude, from: 0.5, to: 5, unit: deg}}
""".replace("as it stands, ", "as_it_stands, ")


UNITS = ("driver_sine",)


@pytest.fixture
def tune(fmus, tmp_path, yawbench):
    """Tune, or call another command with, the file with texts replaced."""

    def run(*changes, command="tune"):
        file = written(tmp_path, TUNING, *changes, wheel=SCENARIO)
        return yawbench(command, file, "--out", tmp_path / "out", "--fmus", fmus)

    return run


def test_the_least_of_all_trials_is_found_written_down_and_not_sought_twice(tune, tmp_path):
    status, out, told = tune()
    assert status == 0, told
    trials = list(csv.DictReader((tmp_path / "out/trials.csv").open()))
    assert [row["generation"] for row in trials] == [str(1 + k // 5) for k in range(10)]
    assert trials[0]["driver.amplitude"] == "2.75"  # amid the range
    for row in trials:
        angle = float(row["driver.amplitude"])
        assert angle == float(f"{angle:.3g}")
        wanted = (angle * 3.141592653589793 / 180 - 0.03) ** 2
        assert float(row["objective"]) == pytest.approx(wanted, rel=1e-6, abs=1e-15)
    best = min(trials, key=lambda row: float(row["objective"]))
    assert float(best["driver.amplitude"]) == pytest.approx(1.719, abs=0.5)
    assert mentions(out, "driver.amplitude", "1.74 deg")
    written = yaml_lines.read(tmp_path / "out/entries.yaml", what="file of entries")
    assert [*validate(EntriesSpec, written).entries] == ["big_wheel_tuned"]
    (entry,) = YAML(typ="safe").load((tmp_path / "out/entries.yaml").read_text())["entries"].items()
    made = {"amplitude": f"{float(best['driver.amplitude'])!r} deg"}
    wanted = {"title": "tuned big wheel", "fmu": "driver_sine", "gains": "tuned", "parameters": made}
    source = entry[1].pop("source")
    assert entry == ("big_wheel_tuned", wanted)
    assert mentions(source, "experiment.yaml", "10 trials", "seed 2", "1.36e-07", "0.0003239")
    found = json.loads((tmp_path / "out/experiment.json").read_text())
    assert [*found["runs"]] == ["turned"]
    page = html.fromstring((tmp_path / "out/report.html").read_text())
    assert mentions(page.text_content(), "5", "2 trials", "seed 2")
    before = (tmp_path / "out/trials.csv").read_bytes()
    runs = (tmp_path / "out/runs.jsonl").read_bytes()
    status, out, told = tune()
    assert (status, (tmp_path / "out/runs.jsonl").read_bytes()) == (0, runs)
    assert (tmp_path / "out/trials.csv").read_bytes() == before


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ("objective: miss", "objective: mist", ("'mist'", "'miss'")),
        ("runs: [turned]", "runs: [burned]", ("'burned'", "'turned'")),
        ("from: 0.5, to: 5", "values: [1, 2]", ("axes.angle", "count")),
        ("entries: driver", "entries: wheel", ("'big wheel'", "changes", "driver")),
        ("swap: {driver: driver_sine}", "stop_time: 1", ("'big wheel'", "stop_time")),
        ("      swap: {driver: driver_sine}\n", "", ("'big wheel'",)),
        ("population: 5", "population: 3", ("tuning.population",)),
        ("tuning:", "axes: {a: {vary: driver.amplitude, values: [1]}}\ntuning:", ("axes",)),
    ],
)
def test_what_is_wrong_with_a_tuning_file_is_said_before_anything_runs(tune, old, new, names):
    status, out, told = tune((old, new))
    assert (status, out) == (2, "")
    assert mentions(told, *names)


def test_other_commands_say_what_a_tuning_file_is_for_and_tune_what_it_is_not(tune):
    for command in ("study", "run"):
        status, _, told = tune(command=command)
        assert status == 2
        assert mentions(told, "tuning", "`yawbench tune`")
    status, _, told = tune((TUNING.partition("tuning:")[2], ""), ("tuning:", ""))
    assert (status, told.count("\n")) == (2, 1)
    assert mentions(told, "'tuning'")

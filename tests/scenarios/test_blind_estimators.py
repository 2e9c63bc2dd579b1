"""Blind tests of the estimators: what they are told wrong, the published table, and that against runs."""

from __future__ import annotations

import csv
import random
from pathlib import Path

import numpy as np
import pytest
import yaml

import yawbench as yb
from docs.generate import blind_tables
from tests.command_line import status_of
from tests.refusals import sentence_has
from yawbench.studies.load_experiment import load_experiment

SWEEP = blind_tables.RUNS.parent / "blind_estimators.yaml"
FACTORS = {"+ 20 %": 1.2, "- 20 %": 0.8, "+ 15 %": 1.15, "- 15 %": 0.85}


def test_errors_are_factors_on_what_the_car_has():
    levels = yaml.safe_load(SWEEP.read_text(encoding="utf-8"))["axes"]["error"]["variants"]
    known = {unit.name: unit.parameters for unit in yb.load(SWEEP.with_name("blind.yaml")).plan().instances}
    wrong = {words: level for words, level in levels.items() if words[-6:] in FACTORS}
    assert len(wrong) == 7
    for words, level in wrong.items():
        for target, value in level["set"].items():
            unit, parameter = target.split(".")
            assert value == pytest.approx(FACTORS[words[-6:]] * float(known[unit][parameter]), rel=1e-12), (
                words
            )


def test_the_page_says_how_far_the_kinematic_estimator_is_off_in_the_spin():
    with blind_tables.RUNS.open(encoding="utf-8", newline="") as lines:
        rows = [row for row in csv.DictReader(lines) if row["error"] == blind_tables.RIGHT]
    by_run: dict[str, list[float]] = {}
    for row in rows:
        by_run.setdefault(row["run"], []).append(float(row["kinematic [rad]"]))
    mean = {run: np.degrees(np.mean(values)) for run, values in by_run.items()}
    text = " ".join(blind_tables.PAGE.read_text(encoding="utf-8").split())
    assert sentence_has(text, f"{max(mean.values()):.1f}°", "spin", "errs")
    assert max(mean.values()) > 0.5 * sum(mean.values())


def test_every_run_of_the_sweep_is_published():
    metrics = blind_tables.published()
    sweep = load_experiment(SWEEP)
    number = sum(table.size for table in metrics["observer"].values())
    assert number == len(sweep.cases)
    assert all(np.isfinite(table).all() for errors in metrics.values() for table in errors.values())


def test_an_error_that_adds_nothing_has_an_interval_of_zero_and_the_worst_is_named():
    right = np.array([[1.0, 1.2], [2.0, 2.2]])
    metrics = {
        name: {blind_tables.RIGHT: right, "mass": right, "bank": right + 0.5}
        for name in blind_tables.ESTIMATORS
    }
    assert blind_tables.mean_bounds(blind_tables.added(metrics["observer"])["mass"]) == (0.0, 0.0)
    low, high = blind_tables.mean_bounds(right)
    assert low < 1.6 < high
    text = blind_tables.worst_sentences(metrics)
    assert "Observer: a bank adds 0.50° (0.50 to 0.50) to the rms, more than any other" in text
    metrics["observer"]["slope"] = right + np.array([[0.0, 0.0], [0.9, 0.9]])
    metrics["observer"]["mass"] = right + 0.1
    text = blind_tables.worst_sentences(metrics)  # 0.45 times Student's 12.71
    assert "not separable from the next (paired: worse than slope by +0.05° (-5.67 to +5.77))" in text
    assert "at most 0.45° (-5.27 to 6.17) to the observer's mean rms (slope), 0.90° in the worst run" in (
        blind_tables.parameters_sentence(metrics)
    )


@pytest.mark.exhaustive
def test_published_runs_are_what_runs_come_to(tmp_path: Path):
    sweep = yaml.safe_load(SWEEP.read_text(encoding="utf-8"))
    chance = random.Random(27)
    for run in sweep["runs"]:
        run["scenario"] = str(SWEEP.parent / run["scenario"])
    sweep["runs"] = chance.sample(sweep["runs"], 2)
    chosen = ["nothing", *chance.sample([*sweep["axes"]["error"]["variants"]][1:], 2)]
    variants = sweep["axes"]["error"]["variants"]
    sweep["axes"]["error"]["variants"] = {words: variants[words] for words in chosen}
    sweep["axes"]["seed"]["values"] = [3]
    (tmp_path / "few.yaml").write_text(yaml.safe_dump(sweep, sort_keys=False), encoding="utf-8")
    assert status_of("sweep", tmp_path / "few.yaml", "--out", tmp_path / "out") == 0
    made, known = (
        {
            (row["run"], row["error"], float(row["seed"])): [row[key] for key in blind_tables.COLUMNS[3:]]
            for row in csv.DictReader(file.open(encoding="utf-8"))
        }
        for file in (tmp_path / "out" / "table.csv", blind_tables.RUNS)
    )
    assert len(made) == 6
    assert {place: known[place] for place in made} == made

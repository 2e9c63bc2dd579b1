"""The monitors' tables in the docs against the published runs, and what these runs say."""

from __future__ import annotations

import csv
import random
import statistics
from pathlib import Path

import pytest
import yaml

import yawbench as yb
from docs.generate import monitor_tables
from docs.generate.monitor_tables import GYRO, WHEEL, Outcome
from tests.command_line import status_of
from tests.refusals import sentence_has
from yawbench.orchestrator.scenario import yaml_lines
from yawbench.studies.confidence import share_bounds
from yawbench.studies.load_experiment import load_experiment

STUDY = monitor_tables.RUNS.parent / "faults.yaml"


@pytest.fixture(scope="module")
def published() -> dict[str, Outcome]:
    return monitor_tables.published()


def test_every_run_of_the_study_is_published_with_ten_seeds(published):
    study = load_experiment(STUDY)
    assert set(published) == set(study.runs)
    assert {outcome.number for outcome in published.values()} == {10}


def test_the_page_names_every_fault_that_no_run_finds_before_anything_else(published):
    page = monitor_tables.PAGE.read_text(encoding="utf-8")
    first = next(line for line in page.splitlines() if line.startswith("|"))
    assert first.startswith("| fault | in no run, monitor_redundancy")
    blind = page.partition("<!-- end of blind -->")[0]
    (row,) = (line for line in blind.splitlines() if line.startswith("| gyro: bias"))
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    sizes = [("0.5", "gyro_bias_0_5"), ("1", "gyro_bias_1"), ("2", "gyro_bias_2"), ("3", "gyro_bias_3")]
    for cell, key in ((cells[1], "with"), (cells[3], "parity")):
        never = [size for size, name in sizes if not published[f"{key}/B/{name}"].delays]
        assert cell.split(", ") == never


@pytest.mark.parametrize("fault", ["gyro_bias_2", "gyro_bias_3", "gyro_drift_1", "a_y_bias_1"])
def test_parity_locates_small_faults_that_redundancy_never_finds(fault, published):
    signal = {name: signal for _, name, signal in monitor_tables.rows_of_faults()}[fault]
    assert published[f"with/B/{fault}"].delays == []
    assert published[f"parity/B/{fault}"].located(signal) == 10


def test_a_bias_of_5_deg_s_is_no_longer_blamed_on_the_accelerometer(published):
    assert published["with/B/gyro_bias_5"].located(GYRO) == 0
    assert set(published["parity/B/gyro_bias_5"].blamed) <= {GYRO, monitor_tables.UNLOCATED}


def test_a_healthy_monitor_gives_no_alarm(published):
    page = monitor_tables.PAGE.read_text(encoding="utf-8")
    for key in monitor_tables.MONITORS:
        healthy = [published[f"{key}/{paper}/none"] for paper in "BC"]
        assert [outcome.delays for outcome in healthy] == [[], []]
        number = sum(outcome.number for outcome in healthy)
        most = f"at most {100 * share_bounds(0, number).high:.0f} %"
        assert sentence_has(page, number, "healthy")
        assert most in page


def test_the_sentences_on_faults_have_the_numbers_of_the_runs(published):
    def middle(name: str) -> float:
        return statistics.median(published[name].sideslip)

    def spins(name: str) -> int:
        return sum(angle > monitor_tables.SPIN for angle in published[name].sideslip)

    page = " ".join(monitor_tables.SIDESLIP_PAGE.read_text(encoding="utf-8").split())
    before, after = middle("without/B/none"), middle("with/B/none")
    of_c = middle("with/C/none") - middle("without/C/none")
    assert sentence_has(
        page,
        f"{after - before:.2f} degrees",
        f"{100 * (after / before - 1):.0f} %",
        f"{after:.2f}",
        f"{before:.2f}",
        f"{of_c:.2f}",
        "`monitor_parity`",
        "adds",
    )
    for paper in "BC":
        assert published[f"parity/{paper}/none"].sideslip == published[f"without/{paper}/none"].sideslip
    noisy = "B/gyro_noise_3"
    assert middle(f"parity/{noisy}") == middle(f"without/{noisy}")
    assert sentence_has(
        page,
        f"{middle(f'without/{noisy}'):.1f} degrees",
        f"{middle(f'with/{noisy}'):.0f}",
        "`monitor_parity`",
        "slides",
    )
    zero, off = "B/gyro_zero", middle(monitor_tables.OFF["B"])
    assert sentence_has(
        page,
        f"{middle(f'without/{zero}'):.0f} degrees",
        f"{middle(f'with/{zero}'):.0f}",
        f"{middle(f'parity/{zero}'):.0f} degrees",
        f"{off:.0f}",
        "spins",
        "monitor",
    )
    late = [
        delay
        for key in monitor_tables.MONITORS
        for name in ("gyro_gain_0_7", "gyro_drift_3", "hand_wheel")
        for delay in published[f"{key}/C/{name}"].delays
    ]
    assert len(late) == 60
    assert sentence_has(page, f"{min(late):.1f}", f"{max(late):.1f} s")
    small = "C/gyro_bias_3"
    counts = {key: len(published[f"{key}/{small}"].delays) for key in monitor_tables.MONITORS}
    assert counts == {"with": 6, "parity": 10}
    assert {spins(f"{key}/{small}") for key in ("without", *counts)} == {8}
    assert sentence_has(page, "six runs", "`monitor_parity`", "spins", "eight of ten")
    assert sentence_has(monitor_tables.PAGE.read_text(encoding="utf-8"), f"{after - before:.2f}°", "adds")


def test_a_run_that_spins_is_counted_and_the_others_keep_their_angle():
    some = Outcome(3, [], [], [100.0, 4.0, 6.0])
    assert monitor_tables.sideslip_text(some) == "spins (1 of 3), else 5.00 (4.00 to 6.00)"
    assert monitor_tables.sideslip_text(Outcome(1, [], [], [60.0])) == "spins (1 of 1)"
    assert monitor_tables.sideslip_text(Outcome(1, [], [], [44.0])) == "44.00"


def test_every_fault_blamed_wrongly_or_on_none_is_in_the_table_of_blame(published):
    table = monitor_tables.blame_table(published)
    for title, name, signal in monitor_tables.rows_of_faults():
        found = [published[f"{key}/B/{name}"] for key in monitor_tables.MONITORS]
        listed = any(line.startswith(f"| B, {title} |") for line in table.splitlines())
        assert listed == any(set(outcome.blamed) - {signal} for outcome in found)


def test_outcomes_count_alarms_and_whom_they_blame():
    rows = [
        {
            "run": "parity/B/x",
            "found [1]": "1.0",
            "after [s]": "0.5",
            "blamed [1]": "4.0",
            "sideslip [rad]": "0.1",
        },
        {
            "run": "parity/B/x",
            "found [1]": "0.0",
            "after [s]": "",
            "blamed [1]": "0.0",
            "sideslip [rad]": "0.2",
        },
    ]
    outcome = monitor_tables.outcomes(rows)["parity/B/x"]
    assert (outcome.number, outcome.delays, outcome.blamed) == (2, [0.5], [WHEEL])
    assert (outcome.located(WHEEL), outcome.located(GYRO)) == (1, 0)
    assert outcome.sideslip == pytest.approx([5.7296, 11.4592], abs=1e-4)


@pytest.mark.exhaustive
@pytest.mark.parametrize("fault", random.Random(27).sample(monitor_tables.rows_of_faults(), 2))
def test_published_runs_are_what_runs_come_to(fault, tmp_path: Path):
    """Drive a fault of the study anew, with two seeds and all monitors."""
    study = yaml_lines.read(STUDY, what="study").data
    runs = [entry for entry in study["runs"] if entry["name"].endswith("/B/{fault}")]
    for entry in runs:
        entry["for"] = {"fault": {fault[1]: entry["for"]["fault"][fault[1]]}}
        entry["scenario"] = str(STUDY.parent / entry["scenario"])
    axis = {**study["axes"]["seed"], "values": [2, 7]}
    few = {"title": "few", "runs": runs, "axes": {"seed": axis}, "metrics": study["metrics"]}
    (tmp_path / "few.yaml").write_text(yaml.safe_dump(few, sort_keys=False), encoding="utf-8")
    assert status_of("study", tmp_path / "few.yaml", "--out", tmp_path / "out") == 0
    made, known = (
        {(row["run"], float(row["seed"])): [row[key] for key in monitor_tables.COLUMNS[2:]] for row in rows}
        for rows in (
            csv.DictReader(file.open()) for file in (tmp_path / "out" / "table.csv", monitor_tables.RUNS)
        )
    )
    assert len(made) == 6
    assert {place: known[place] for place in made} == made


@pytest.mark.exhaustive
def test_false_alarms_in_two_hours_are_what_the_page_says(tmp_path):
    from scipy.stats import chi2  # not at the top: it takes long, and few tests need it

    assert status_of("sweep", "real_signals/false_alarms", "--out", tmp_path / "out") == 0
    alarms = yb.open(tmp_path / "out").table
    hours = 81 * 90.0 / 3600.0
    page = monitor_tables.PAGE.read_text(encoding="utf-8")
    for name, count, text in (("redundancy", 0, "at most 1.8 an hour"), ("parity", 1, "0.01 to 2.8 an hour")):
        assert (alarms[name] > 0).sum() == count
        low = chi2.ppf(0.025, 2 * count) / 2.0 / hours if count else 0.0
        high = chi2.ppf(0.975, 2 * count + 2) / 2.0 / hours
        assert text == (f"{low:.2f} to {high:.1f} an hour" if count else f"at most {high:.1f} an hour")
        assert text in page

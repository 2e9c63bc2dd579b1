"""The monitors' tables in the docs against the published runs, and what these runs say."""

from __future__ import annotations

import pytest
from scipy.stats import chi2

import yawbench as yb
from docs.generate import monitor_tables
from docs.generate.monitor_tables import GYRO, WHEEL, Outcome
from tests.commands import status_of


@pytest.fixture(scope="module")
def published() -> dict[str, Outcome]:
    return monitor_tables.published()


def test_the_tables_of_the_docs_follow_from_the_published_runs():
    assert monitor_tables.page_with_tables() == monitor_tables.PAGE.read_text(encoding="utf-8")


def test_monitor_parity_has_every_fault_with_the_same_number_of_seeds(published):
    names = [name for _, name, _ in monitor_tables.rows_of_faults()]
    assert {published[f"parity/B/{name}"].number for name in names} == {5}


@pytest.mark.parametrize("fault", ["gyro_bias_2", "gyro_bias_3", "gyro_drift_1", "a_y_bias_1"])
def test_parity_locates_small_faults_that_redundancy_never_finds(fault, published):
    signal = {name: signal for _, name, signal in monitor_tables.rows_of_faults()}[fault]
    assert published[f"with/B/{fault}"].delays == []
    assert published[f"parity/B/{fault}"].located(signal) == 5


def test_a_bias_of_5_deg_s_is_no_longer_blamed_on_the_accelerometer(published):
    assert published["with/B/gyro_bias_5"].located(GYRO) == 0
    assert set(published["parity/B/gyro_bias_5"].blamed) <= {GYRO, monitor_tables.UNLOCATED}


def test_a_healthy_monitor_gives_no_alarm(published):
    for key in monitor_tables.MONITORS:
        assert published[f"{key}/B/none"].delays == []
        assert published[f"{key}/C/none"].delays == []


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
def test_false_alarms_in_two_hours_are_what_the_page_says(tmp_path):
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

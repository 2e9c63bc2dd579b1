"""The monitors' tables in the docs against the published runs, and what these runs say."""

from __future__ import annotations

import pytest

from docs.generate import monitor_tables
from docs.generate.monitor_tables import GYRO, WHEEL, Outcome


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

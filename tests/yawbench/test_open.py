"""Folders that commands have written, opened from Python."""

import numpy as np
import pytest

import yawbench as yb
from orchestrator.experiments.record import columns_of, write_table


@pytest.fixture(scope="module")
def made():
    base = yb.load("fnn_sideslip/25mps").set({"stop_time": 1.2})
    axes = {"driver.amplitude": [0.02, 0.03]}
    return yb.experiment(base, axes, metrics=["peak(sideslip)"]).run(workers=1)


@pytest.fixture(scope="module")
def folder(made, tmp_path_factory):
    """A folder as a sweep writes it: tables, and the results of every run."""
    out = tmp_path_factory.mktemp("sweep")
    write_table(made.findings, out)
    for k, run in enumerate(made.runs):
        run.save(out / "runs" / str(k))
    return out


def test_the_table_is_that_of_the_experiment_with_its_units(made, folder):
    table = yb.open(folder).table
    assert list(table.columns) == columns_of(made.findings).headings
    assert table["peak(sideslip)"].tolist() == made.table["peak(sideslip)"].tolist()
    assert table.attrs["units"]["peak(sideslip)"] == made.table.attrs["units"]["peak(sideslip)"]


def test_the_runs_are_known_by_their_folders(made, folder):
    runs = yb.open(folder).runs
    assert list(runs) == ["runs/0", "runs/1"]
    assert np.array_equal(runs["runs/1"]["plant.yaw_rate"], made.runs[1]["plant.yaw_rate"])


def test_the_folder_of_a_run_is_a_run(folder):
    assert isinstance(yb.open(folder / "runs" / "0"), yb.Run)


def test_runs_without_a_table_are_opened_and_an_empty_folder_is_refused(folder, tmp_path):
    recorded = yb.open(folder / "runs")
    assert len(recorded.runs) == 2
    with pytest.raises(yb.ResultsError) as caught:
        recorded.table  # noqa: B018
    assert caught.value.code == "results-missing"
    with pytest.raises(yb.ResultsError) as caught:
        yb.open(tmp_path)
    assert caught.value.code == "results-missing"

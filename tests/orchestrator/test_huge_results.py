"""The note on huge results before a run starts."""

from __future__ import annotations

import pytest

from tests.fmu_copies import put_fmus
from tests.orchestrator.fakes import Clock, make_plan
from tests.refusals import mentions
from yawbench.orchestrator.results import file_formats
from yawbench.orchestrator.results.file_formats import expected_size, size_note


@pytest.fixture
def plan_of():
    """A plan of so many steps that records nine variables."""
    clock = Clock(**{f"y{n}": float for n in range(9)})
    return lambda n_steps: make_plan({"a": clock}, [], step="1/1000", n_steps=n_steps)


def test_the_expected_size_counts_time_and_the_first_row(plan_of):
    assert expected_size(plan_of(99), "csv") == 100 * 10 * 17


def test_huge_results_are_announced_with_a_way_out(plan_of, tmp_path):
    assert size_note(plan_of(10**6), tmp_path, "csv") is None
    note = size_note(plan_of(2 * 10**7), tmp_path, "csv")
    assert mentions(
        note, "results.csv", "3.4 GB", "20000001", "9 variables", "'record:'", "--format", "1.4 GB"
    )
    assert size_note(plan_of(2 * 10**7), tmp_path, "parquet") is None


def test_run_tells_before_it_starts(tmp_path, monkeypatch, yawbench):
    monkeypatch.setattr(file_formats, "HUGE", 1000)
    put_fmus(tmp_path, components=["driver_sine"])
    (tmp_path / "a.yaml").write_text("stop_time: 1\nstep_size: 0.01\nunits: {driver: {fmu: driver_sine}}\n")
    out = tmp_path / "out"
    status, _, told = yawbench("run", tmp_path / "a.yaml", "--out", out, "--fmus", tmp_path)
    first, last = told.splitlines()
    assert (status, last.startswith(f"{out}: 101 rows")) == (0, True)
    assert mentions(first, "note", "results.csv", "7 kB", "101 rows", "3 variables", "'record:'", "3 kB")

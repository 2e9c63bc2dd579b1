"""Which runs a comparison makes, and what it makes of their results."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from orchestrator.commands.recorded import distinct
from orchestrator.errors import ScenarioError
from orchestrator.studies.compare import judge_comparison, metric_table, variants, write_comparison
from orchestrator.studies.jobs import Job, Outcome
from tests.changed import changed

from .recorded import car, write

SCENARIO = """
stop_time: 1
step_size: 0.001
units:
  controller: {fmu: controller_fnn}
  tyre: {fmu: parts/tyre_own.fmu}
"""


@pytest.fixture
def scenario(tmp_path) -> Path:
    path = tmp_path / "scenario.yaml"
    path.write_text(SCENARIO)
    return path


def given(job):
    """Return what a job changes, by its place."""
    return {change.place: change.value for change in job.changes}


def labels(scenario, *swaps):
    return [job.label for job in variants(scenario, swaps, (), Path("out"), None)]


def test_one_run_per_fmu_of_a_list(scenario):
    jobs = variants(scenario, ["controller=a,b, c"], changed(settings=["plant.mass=2"]), Path("out"), None)
    assert [job.label for job in jobs] == ["a", "b", "c"]
    assert [given(job) for job in jobs] == [{"plant.mass": 2, "controller": fmu} for fmu in ("a", "b", "c")]
    assert [job.out for job in jobs] == [Path("out/a"), Path("out/b"), Path("out/c")]


def test_a_repeated_option_adds_to_the_list(scenario):
    assert labels(scenario, "controller=a", "controller=b", "controller=a") == ["a", "b"]


def test_an_fmu_named_twice_runs_once(scenario):
    assert labels(scenario, "controller=a,b,a") == ["a", "b"]
    assert labels(scenario, "controller=controller_off,controller_off") == labels(
        scenario, "controller=controller_off"
    )


def test_one_fmu_alone_is_compared_with_the_scenarios_own(scenario):
    assert labels(scenario, "controller=controller_off") == ["controller_fnn", "controller_off"]
    jobs = variants(scenario, ["tyre=tyre_linear"], (), Path("out"), None)
    assert [job.label for job in jobs] == ["tyre_own", "tyre_linear"]
    assert given(jobs[0]) == {"tyre": str(scenario.parent / "parts/tyre_own.fmu")}


def test_lists_for_two_units_are_combined(scenario):
    assert labels(scenario, "controller=a,b", "tyre=x,y") == ["a + x", "a + y", "b + x", "b + y"]
    assert labels(scenario, "controller=a,b", "tyre=x") == ["a", "b"]


def test_equal_names_of_different_files_stay_apart(scenario):
    jobs = variants(scenario, ["controller=old/c.fmu,new/c.fmu"], (), Path("out"), None)
    assert [job.label for job in jobs] == ["c", "c (2)"]
    assert len({job.out for job in jobs}) == 2


def test_a_file_whose_name_holds_a_comma_is_one_fmu(scenario, tmp_path):
    odd = tmp_path / "a,b.fmu"
    odd.touch()
    assert labels(scenario, f"controller={odd}") == ["controller_fnn", "a,b"]


def test_an_fmu_may_bring_parameters_and_so_be_compared_with_itself(scenario):
    heavier = changed(settings=["plant.mass=2"])
    jobs = variants(scenario, ["controller=a,a:law=sign:gain=2,b"], heavier, Path("out"), None)
    assert [job.label for job in jobs] == ["a", "a law=sign gain=2", "b"]
    assert [given(job) for job in jobs] == [
        {"plant.mass": 2, "controller": "a"},
        {"plant.mass": 2, "controller": "a", "controller.law": "sign", "controller.gain": 2},
        {"plant.mass": 2, "controller": "b"},
    ]
    assert len({job.out for job in jobs}) == 3


def test_labels_say_the_values_that_differ_and_folders_can_be_read(scenario):
    jobs = variants(scenario, ["controller=a:gain=20000:law=sign,a:gain=40000:law=sign"], (), Path("o"), None)
    assert [job.label for job in jobs] == ["gain=20000", "gain=40000"]
    assert [job.out for job in jobs] == [Path("o/gain=20000"), Path("o/gain=40000")]
    jobs = variants(scenario, ["controller=a:law=x y:gain=2,b", "tyre=t,u"], (), Path("o"), None)
    assert [job.label for job in jobs][:2] == ["a law=x y gain=2 + t", "a law=x y gain=2 + u"]
    assert jobs[0].out == Path("o/a_law=x_y_gain=2+t")
    alike = variants(scenario, ["controller=a:law=x y,a:law=x_y"], (), Path("o"), None)
    assert len({job.out for job in alike}) == 2


def test_parameters_alone_set_the_scenarios_own_fmu_against_itself(scenario):
    jobs = variants(scenario, ["controller=controller_fnn:learning=false"], (), Path("out"), None)
    own = {"controller": "controller_fnn"}
    assert [given(job) for job in jobs] == [own, {**own, "controller.learning": False}]


def test_a_comparison_with_itself_is_an_error(scenario):
    with pytest.raises(ScenarioError, match="nothing to compare: name several FMUs"):
        labels(scenario, "controller=controller_fnn")


def test_a_unit_that_does_not_exist_is_named_with_the_likely_one(scenario):
    with pytest.raises(
        ScenarioError, match="the scenario has no unit 'controler'; did you mean 'controller'"
    ):
        labels(scenario, "controler=controller_off")


def test_an_option_without_an_fmu_is_an_error(scenario):
    with pytest.raises(ScenarioError, match=r"--swap controller: write --swap UNIT=FMU"):
        labels(scenario, "controller")


@pytest.fixture
def outcomes(tmp_path):
    runs = {"off": car(2.4), "fnn": car(1.02)}
    made = [Outcome(Job(k, Path("s.yaml"), write(run, tmp_path / k))) for k, run in runs.items()]
    broken = Outcome(Job("broken", Path("s.yaml"), tmp_path / "broken"), ("unit died",), 1)
    return [made[0], broken, made[1]]


def test_the_table_has_a_row_per_metric_and_a_column_per_run(outcomes):
    table = metric_table(judge_comparison(outcomes), "title")
    assert table.headings == ["metric", "", "off", "fnn", "broken"]
    assert table.text()[0] == [
        "Sideslip angle: relative peak error", "max|β - β_ref| / max|β_ref|", "140 %", "2.00 %", "failed",
    ]  # fmt: skip


def test_a_run_that_failed_is_named_and_the_others_are_drawn(outcomes, tmp_path):
    comparison = judge_comparison(outcomes)
    files = write_comparison(comparison, metric_table(comparison, "title"), tmp_path)
    assert files == [
        "overview.svg", "overview.png", "wheel_torques.svg", "wheel_torques.png", "metrics.csv", "compare.md",
    ]  # fmt: skip
    assert all((tmp_path / name).stat().st_size > 0 for name in files)
    assert "broken failed: unit died" in (tmp_path / "compare.md").read_text()
    rows = {row["run"]: row for row in csv.DictReader((tmp_path / "metrics.csv").open())}
    assert rows["broken"]["status"] == "failed: unit died"
    assert float(rows["fnn"]["relative_peak_error(sideslip) [1]"]) == pytest.approx(0.02, rel=1e-9)
    assert float(rows["off"]["final(velocity_x) [m/s]"]) == pytest.approx(24.6, rel=1e-9)


def test_a_comparison_without_any_result_still_writes_its_tables(outcomes, tmp_path):
    comparison = judge_comparison(outcomes[1:2])
    assert write_comparison(comparison, metric_table(comparison, "title"), tmp_path) == [
        "metrics.csv", "compare.md",
    ]  # fmt: skip


def test_folders_are_told_apart_by_the_shortest_ends_of_their_paths():
    assert distinct([Path("a/fnn"), Path("a/off")]) == ["fnn", "off"]
    assert distinct([Path("a/fnn"), Path("b/fnn")]) == ["a/fnn", "b/fnn"]

"""Comparisons: their runs, and the tables and pages of their results."""

from __future__ import annotations

import csv
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.orchestrator.recorded import car, write
from tests.refusals import each_mentions, refused
from yawbench.commands.recorded_runs import distinct
from yawbench.figures.plots import LabelledRun
from yawbench.figures.style import save
from yawbench.foundation.errors import Diagnostic, ScenarioError
from yawbench.metrics.expressions import MetricValue
from yawbench.reports.comparison_page import BEST, comparison_view, metric_table
from yawbench.studies import result_figures
from yawbench.studies.claim_schema import MetricSpec
from yawbench.studies.comparison import FIGURE_SPECS, comparison, comparison_table, variants
from yawbench.studies.experiment import NamedRun, experiment_of
from yawbench.studies.experiment_result import judge_results
from yawbench.studies.jobs import Job, Outcome
from yawbench.studies.result_figures import draw_all
from yawbench.studies.result_files import write_findings
from yawbench.studies.schema import ExperimentSpec

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
    return {str(change.target): change.value for change in job.changes}


@pytest.mark.parametrize(
    ("swaps", "labels"),
    [
        (["controller=a,b, c"], ["a", "b", "c"]),
        (["controller=a,b,a"], ["a", "b"]),  # runs once
        (["controller=controller_off"], ["controller_fnn", "controller_off"]),  # beside the scenario's own
        (["controller=controller_off,controller_off"], ["controller_fnn", "controller_off"]),
        (["controller=a,b", "tyre=x,y"], ["a + x", "a + y", "b + x", "b + y"]),
        (["controller=a,b", "tyre=x"], ["a", "b"]),
        (["controller=old/c.fmu,new/c.fmu"], ["c", "c (2)"]),
        (["controller={folder}/odd,name.fmu"], ["controller_fnn", "odd,name"]),
        (["controller=a,a:law=sign:gain=2,b"], ["a", "a law=sign gain=2", "b"]),
        (["controller=a:gain=20000:law=sign,a:gain=40000:law=sign"], ["gain=20000", "gain=40000"]),
        (["controller=a:law=x y,a:law=x_y"], ["law=x y", "law=x_y"]),
        (
            ["controller=a:law=x y:gain=2,b", "tyre=t,u"],
            ["a law=x y gain=2 + t", "a law=x y gain=2 + u", "b + t", "b + u"],
        ),
    ],
)
def test_labels_tell_the_variants_apart_and_folders_too(swaps, labels, scenario, tmp_path):
    (tmp_path / "odd,name.fmu").touch()
    jobs = variants(scenario, [swap.format(folder=tmp_path) for swap in swaps], ())
    assert [job.label for job in jobs] == labels
    assert len({job.name for job in jobs}) == len(jobs)
    assert all(re.fullmatch(r"[\w.+=-]+", job.name) for job in jobs)


@pytest.mark.parametrize(
    ("swap", "changes"),
    [
        ("controller=a,b", [{"controller": "a"}, {"controller": "b"}]),
        ("tyre=tyre_linear", [{"tyre": "{folder}/parts/tyre_own.fmu"}, {"tyre": "tyre_linear"}]),
        (
            "controller=a,a:law=sign:gain=2",
            [{"controller": "a"}, {"controller": "a", "controller.law": "sign", "controller.gain": 2}],
        ),
        (  # the scenario's own against itself
            "controller=controller_fnn:learning=false",
            [
                {"controller": "controller_fnn"},
                {"controller": "controller_fnn", "controller.learning": False},
            ],
        ),
    ],
)
def test_a_variant_changes_its_fmu_and_the_parameters_that_this_brings(swap, changes, scenario):
    own = {"tyre": str(scenario.parent / "parts/tyre_own.fmu")}
    expected = [own if "{folder}" in str(one) else one for one in changes]
    assert [given(job) for job in variants(scenario, [swap], ())] == expected


def test_a_comparison_with_itself_is_an_error(scenario):
    with refused(ScenarioError, "option-invalid", names=("--swap controller=a", "compare", "controller")):
        variants(scenario, ["controller=controller_fnn"], ())


METRICS = {
    "metrics": {name: {"metric": name} for name in ("relative_peak_error(sideslip)", "final(velocity_x)")}
}


@pytest.fixture
def findings(tmp_path):
    """Result of a comparison of three made-up runs, of which one failed."""
    runs = [NamedRun(name, name, name, Path("s.yaml"), ()) for name in ("off", "broken", "fnn")]
    experiment = experiment_of(Path("s.yaml"), runs, title="title", figures=FIGURE_SPECS)
    spec = ExperimentSpec.model_validate(
        experiment.spec.model_dump(exclude_defaults=True, by_alias=True) | METRICS
    )
    write(car(2.4), tmp_path / "off")
    write(car(1.02), tmp_path / "fnn")
    lost = Outcome(
        Job("broken", Path("s.yaml"), tmp_path / "broken"), (Diagnostic("run-failed", "unit died"),), 1
    )
    return judge_results(replace(experiment, spec=spec), tmp_path, [lost])


def test_the_table_has_a_row_per_metric_and_a_column_per_run(findings):
    table = comparison_table(findings)
    assert table.headings == ["metric", "", "off", "fnn", "broken"]
    assert each_mentions(
        table.text()[0],
        ("Sideslip", "angle", "relative"),
        ("β_ref", "max"),
        ("140 %",),
        ("2.00 %",),
        ("failed",),
    )


def test_a_run_that_failed_is_named_and_the_others_are_drawn(findings, tmp_path, monkeypatch):
    monkeypatch.setattr(result_figures, "save", partial(save, kinds=["svg"]))
    drawn, problems = draw_all(findings, tmp_path)
    assert (list(drawn), problems) == (["overview", "wheel_torques"], [])
    write_findings(findings, drawn, tmp_path)
    rows = {row["run"]: row for row in csv.DictReader((tmp_path / "table.csv").open())}
    assert (rows["broken"]["status"], rows["broken"]["reason"]) == ("failed", "unit died")
    assert float(rows["fnn"]["relative_peak_error(sideslip) [1]"]) == pytest.approx(0.02, rel=1e-9)
    assert float(rows["off"]["final(velocity_x) [m/s]"]) == pytest.approx(24.6, rel=1e-9)


def test_the_page_marks_the_best_and_tells_differences_from_the_first(findings):
    compared = comparison_view(findings)
    error, speed = compared.table.text()[:2]
    assert error[2:] == ["140 %", f"2.00 % {BEST}\n−138 points"]
    assert not any(BEST in cell for cell in speed)  # less speed is not better as such


def stars(*values: tuple[float, ...]) -> list[list[int]]:
    """Return which runs are marked the best by RMS error, effort and chatter."""
    names = ("rms_error(yaw_rate)", "effort(yaw_moment)", "total_variation_rate(yaw_moment)")
    runs = [str(k) for k in range(len(values))]
    known = {
        (run, name): MetricValue(x, "1")
        for run, row in zip(runs, values, strict=True)
        for name, x in zip(names, row, strict=True)
    }
    spec = SimpleNamespace(metrics={name: MetricSpec(metric=name) for name in names})
    made = SimpleNamespace(spec=spec, values=known, results=dict.fromkeys(runs))
    table = metric_table(made, [LabelledRun(run, car()) for run in runs])
    return [[k for k, cell in enumerate(row[2:]) if BEST in cell] for row in table.text()]


@pytest.mark.parametrize(
    "values, expected",
    [
        (((2.0, 0.0, 0.0), (1.0, 5.0, 7.0), (3.0, 4.0, 9.0)), [[1], [2], [1]]),  # 0 controls nothing
        (((2.0, 0.0, 0.0), (1.0, 5.0, 7.0)), [[1], [], []]),  # the only one that acts is no winner
        (((2.0, 9.0, 0.0), (1.0, 5.0, 7.0), (3.0, 6.0, 8.0)), [[1], [1], [1]]),  # constant, of the driver
        (((6.0214, 4.0, 4.0), (6.0186, 5.0, 3.0)), [[], [0], [1]]),  # both read 6.02
        (((1.0, 1.0, 1.0), (1.0, 1.0, 1.0)), [[], [], []]),
    ],
)
def test_the_best_is_marked_where_it_reads_better_and_doing_nothing_wins_no_effort(values, expected):
    assert stars(*values) == expected


def test_folders_are_told_apart_by_the_shortest_ends_of_their_paths():
    assert distinct([Path("a/fnn"), Path("a/off")]) == ["fnn", "off"]
    assert distinct([Path("a/fnn"), Path("b/fnn")]) == ["a/fnn", "b/fnn"]


def test_labels_name_the_runs_in_their_order_and_metrics_are_those_asked_for(scenario, monkeypatch):
    loaded = SimpleNamespace(title="T")
    monkeypatch.setattr("yawbench.studies.comparison.Planner.load", lambda *_, **__: loaded)
    swaps = ["controller=a,b"]
    made = comparison(scenario, swaps, (), labels=["no control", "ours"], metrics=["peak(sideslip)"])
    assert [(run.name, run.label, run.row) for run in made.runs.values()] == [
        ("a", "no control", "no control"),
        ("b", "ours", "ours"),
    ]
    assert [spec.metric for spec in made.spec.metrics.values()] == ["peak(sideslip)"]
    for wrong in (["one"], ["twice", "twice"]):
        with refused(ScenarioError, "option-invalid", names=("--label", "a", "b")):
            comparison(scenario, swaps, (), labels=wrong)

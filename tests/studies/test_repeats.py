"""Repeats by seeds: means with confidence in tables, verdicts and figures; many claims from one entry."""

from __future__ import annotations

from dataclasses import replace

import pytest
from lxml import html

from tests.refusals import mentions, refused
from tests.studies.experiment_files import written
from yawbench.commands.experiments import chapter_of
from yawbench.components.sensing.noise import key, normal
from yawbench.figures.display import shown, shown_value
from yawbench.foundation.errors import ScenarioError
from yawbench.metrics.expressions import MetricValue
from yawbench.reports.page_parts import render
from yawbench.studies.confidence import interval, share_bounds
from yawbench.studies.experiment import plan_experiment
from yawbench.studies.experiment_result import judge_records
from yawbench.studies.jobs import run_job
from yawbench.studies.load_experiment import load_experiment
from yawbench.studies.result_figures import draw_over_axes
from yawbench.studies.result_tables import limit_tables, run_tables, verdict

SCENARIO = """
title: A car that turns, and its gyro
stop_time: 0.1
step_size: 0.01
inputs:
  sensor.yaw_rate_true: 1
  sensor.acceleration_*_true: 0
  sensor.steer_angle_true: 0
  sensor.wheel_speed_*_true: 0
units:
  sensor: {fmu: sensor_ideal, parameters: {sample_time: 0.01}}
"""
STUDY = """
title: How much hangs on chance
runs:
  - for:
      gain: {weak: {says: a weak gyro, set: {sensor.yaw_rate_gain: 0.5}}, right: a gyro}
      noise: {quiet: quiet, noisy: {says: noisy, set: {sensor.yaw_rate_noise: 0.1}}}
    name: "{gain}/{noise}"
    row: "{gain}, {noise}"
    scenario: gyro.yaml
axes:
  seed: {vary: sensor.seed, values: [1, 2, 3, 4], runs: ["*/noisy"], repeats: true, says: seeds}
metrics: {last: {metric: final(sensor.yaw_rate)}}
derived:
  "share/{gain}/{noise}":
    says: Share that is told
    for: {gain: [weak, right], noise: [quiet, noisy]}
    expression: x / most
    of: {x: {run: "{gain}/{noise}", metric: last}, most: {run: right/quiet, metric: last}}
    unit: "%"
grids:
  share:
    title: Share that is told
    derived: "share/{gain}/{noise}"
    rows: {noise: [quiet, noisy]}
    columns: {gain: {weak: Weak, right: Right}}
    holds: enough down to
tables: [{title: All, runs: ["*"], metrics: [last]}]
checks:
  - says: "{gain} tells nine tenths where it is {noise}."
    for: {gain: {weak: A weak gyro, right: A gyro}, noise: [quiet, noisy]}
    holds_if: [{derived: "share/{gain}/{noise}", at_least: 90 %}]
figures: [{name: share, kind: grid, grid: share, mark: 90 %}]
"""


UNITS = ("sensor_ideal",)


@pytest.fixture(scope="module")
def load(tmp_path_factory):
    """Write the study with texts replaced and return it as loaded."""
    folder = tmp_path_factory.mktemp("study")
    return lambda *changes: load_experiment(written(folder, STUDY, *changes, gyro=SCENARIO))


@pytest.fixture(scope="module")
def findings(load, fmus, tmp_path_factory):
    """Result of the study; what the axis does not change is made once."""
    findings = findings_of(load(), fmus, tmp_path_factory.mktemp("runs"))
    assert len({job.key for job in findings.planned.jobs}) == 2 + 2 * 4
    return findings


def findings_of(loaded, fmus, folder):
    planned = plan_experiment(loaded, folder, fmus=fmus, keep=False)
    records = {job.key: run_job(job) for job in {job.key: job for job in planned.jobs}.values()}
    return judge_records(planned, records)


def told(seeds, gain=1.0):
    return [gain + 0.1 * normal(key(seed, "yaw_rate"), 10) for seed in seeds]


def test_numbers_over_repeats_are_means_with_their_confidence(findings):
    over = interval(told(range(1, 5)))
    value = findings.values["right/noisy", "last"]
    assert (value.number, value.half) == pytest.approx((over.mean, over.half))
    assert findings.values["weak/quiet", "last"] == MetricValue(0.5, "rad/s")
    assert findings.derived["share/right/noisy"].half == pytest.approx(over.half)
    (table,) = run_tables(findings)
    rows = {row[0]: " ± " in row[1] for row in table.text()}
    assert rows == {
        "a weak gyro, quiet": False,
        "a weak gyro, noisy": True,
        "a gyro, quiet": False,
        "a gyro, noisy": True,
    }


def test_a_threshold_within_confidence_leaves_the_verdict_open(load, findings):
    says = [
        f"A {car} tells nine tenths where it is {noise}."
        for car in ("weak gyro", "gyro")
        for noise in ("quiet", "noisy")
    ]
    assert [one.claim.says for one in findings.checks] == says
    assert [verdict(one) for one in findings.checks] == [
        "does not hold",
        "does not hold",
        "holds",
        "undecided",
    ]
    sure = load(("at_least: 90 %", "at_least: 75 %"))
    judged = replace(findings, experiment=sure).checks
    assert [verdict(one) for one in judged] == ["does not hold", "does not hold", "holds", "holds"]


def test_a_metric_may_have_median_and_range_or_a_share_over_its_repeats(load, findings):
    numbers = sorted(told(range(1, 5)))

    def over(kind):
        experiment = load(
            ("metric: final(sensor.yaw_rate)", f"metric: final(sensor.yaw_rate), over_repeats: {kind}")
        )
        return replace(findings, experiment=experiment).values

    median = over("median")["right/noisy", "last"]
    assert median.number == pytest.approx(0.5 * (numbers[1] + numbers[2]))
    assert median.between == pytest.approx((numbers[0], numbers[-1]))
    assert over("median")["right/quiet", "last"].between is None
    share = over("share")["right/noisy", "last"]
    assert (share.number, share.unit, share.between) == (1.0, "1", tuple(share_bounds(4, 4)))
    assert mentions(shown(share.number, share.shown_in, between=share.between), "100", "39.8")


def test_whether_something_happens_is_yes_or_no_in_a_run_and_a_share_over_its_repeats(load, fmus, tmp_path):
    own = load(("metric: final(sensor.yaw_rate)", "metric: changes(sensor.yaw_rate)"))
    found = findings_of(own, fmus, tmp_path)
    over = {run: shown_value(found.values[run, "last"]) for run in ("right/quiet", "right/noisy")}
    assert over == {"right/quiet": "0 %", "right/noisy": "100 %"}
    for case in found.experiment.cases:
        assert shown_value(found.value(case, "last")) == ("yes" if "noisy" in case.run.name else "no")


def test_a_grid_says_how_far_down_its_columns_hold(findings):
    (table,) = limit_tables(findings)
    *cells, down_to = table.text()
    assert down_to == ["enough down to", "-", "quiet"]
    assert cells[0] == ["quiet", "50.0 % ✗", "100 %"]
    assert cells[1][2].endswith("?")


def test_a_grid_can_be_drawn_with_a_line_per_column(findings):
    figure = draw_over_axes(findings, findings.spec.figures[0])
    axes = figure.axes[0]
    lines = [line for line in axes.lines if len(line.get_xdata()) == 2 and line.get_marker() != "None"]
    assert [next(iter(line.get_ydata())) for line in lines] == [50.0, 100.0]
    assert len(axes.collections) == 2  # confidence where there is chance


def test_in_haste_there_are_fewer_repeats_and_the_page_says_so_before_anything_else(load, fmus, tmp_path):
    assert [len(one.points) for one in (load(), load().short)] == [4, 3]
    assert (load().quick, load().short.quick) == ("", "A quick look: 3 of 4 repeats.")
    quick = findings_of(load().short, fmus, tmp_path)
    tree = html.fromstring(render(chapter_of(quick, tmp_path, "yawbench study")))
    assert tree.xpath("string(//main/p[1])") == load().short.quick


@pytest.mark.parametrize(
    ("change", "names"),
    [
        (("values: [1, 2, 3, 4]", "from: 1, to: 4, count: 4"), ("repeats", "list", "values")),
        (('["*/noisy"]', '["*/nosy"]'), ("axes.seed.runs[0]", "'*/nosy'", "weak/quiet")),
        (("{gain} tells", "{gian} tells"), ("checks[0]", "'gain'")),
        (('"share/{gain}/{noise}":', '"share/{gain}":'), ("'share/weak'", "number")),
        (("noisy, set: {", "noisy, set: {sensor.yaw_rate_gain: 2, "), ("sensor.yaw_rate_gain", "twice")),
        (("kind: grid, grid: share", "kind: grid, grid: shares"), ("'shares'", "grid")),
        (("kind: grid, grid: share", "kind: curve, metric: last, x: seed"), ("'seed'", "numbers")),
        (('    derived: "share/{gain}', '    derived: "share/weak'), ("depend", "gain")),
    ],
)  # fmt: skip
def test_mistakes_are_told_in_a_sentence(load, change, names):
    with refused(ScenarioError, names=names):
        load(change)


def test_a_design_gives_every_run_points_of_its_own(load, findings, fmus, tmp_path):
    loaded = load()
    design = [(name, at) for name in loaded.runs for at in loaded.points[: 4 if "noisy" in name else 1]]
    planned = plan_experiment(replace(loaded, design=tuple(design)), tmp_path, fmus=fmus, keep=False)
    assert len(planned.jobs) == 2 + 2 * 4
    records = {job.key: one for job, one in zip(findings.planned.jobs, findings.records, strict=True)}
    assert judge_records(planned, records).values == findings.values

"""Verdicts over a region of open values, against closed forms: the peak of a sine is amplitude over ratio."""

from __future__ import annotations

import csv
import json
import math
import re

import pytest
from lxml import html

from tests.checkout import ROOT
from tests.refusals import mentions, refused
from tests.studies.experiment_files import written
from yawbench.foundation.errors import Diagnostic, ScenarioError
from yawbench.metrics.expressions import MetricValue
from yawbench.metrics.verdict import Status, Verdict, all_of, compare, not_judged, worst
from yawbench.planner import Planner
from yawbench.studies.claim_schema import Claim
from yawbench.studies.claims import Region, judge
from yawbench.studies.experiment import plan_experiment
from yawbench.studies.experiment_result import ExperimentResult
from yawbench.studies.jobs import MeasuredRun
from yawbench.studies.load_experiment import load_experiment
from yawbench.studies.open_value_regions import judge_region, next_jobs, plan_region, runs_of
from yawbench.studies.result_tables import region_words, verdict
from yawbench.studies.sequential_test import SequentialTest

SCENARIO = """
title: A sine
stop_time: 0.5
step_size: 0.0125
inputs: {velocity_x: 20}
units:
  driver: {fmu: driver_sine, parameters: {amplitude: 0.05, frequency: 2, start_time: 0}}
"""

STUDY = """
title: Half a paper
runs:
  - {name: plain, scenario: sine.yaml}
  - {name: double, scenario: sine.yaml, set: {driver.amplitude: 0.1}}
metrics:
  peak: {metric: peak(steer_angle)}
claims:
  - {says: It stays below 0.06 rad., short: < 0.06, holds_if: [{run: plain, metric: peak, below: 0.06}]}
  - {says: It is above 0.01 rad., holds_if: [{run: plain, metric: peak, above: 0.01}]}
  - says: Half the amplitude gives less.
    holds_if: [{run: plain, metric: peak, below: {run: double, metric: peak}}]
  - {says: It is 0.06 rad., open_values: [ratio], holds_if: [{run: plain, metric: peak, at_least: 0.06}]}
checks:
  - {says: Both are above nothing., holds_if: [{run: "*", metric: peak, above: 0}]}
  - {says: The doubled one stays below 0.09 rad., holds_if: [{run: double, metric: peak, below: 0.09}]}
tables:
  - {title: Peaks, runs: ["*"], metrics: [peak]}
region:
  points: 20
  most: 20
  seed: 1
  open_values:
    amplitude: {vary: driver.amplitude, times: true, from: 0.5, to: 1.5, because: "chosen: to show"}
    ratio: {vary: driver.steering_ratio, runs: [plain], values: [0.5, 1, 2], because: "chosen: to show"}
"""


UNITS = ("driver_sine",)


@pytest.fixture
def judged(tmp_path, fmus):
    """Judge the study, texts of it replaced, with the closed form in place of runs."""

    def judge(*changes: tuple[str, str], failing=lambda peak: False) -> ExperimentResult:
        double = SCENARIO.replace("0.05", "0.1")
        experiment = load_experiment(written(tmp_path, STUDY, *changes, sine=SCENARIO, double=double))
        planner = Planner()
        planned = plan_experiment(experiment, tmp_path / "o", fmus=fmus, planner=planner)

        def record(job) -> MeasuredRun:
            own = job.plan.instances[0].parameters
            peak = own["amplitude"] / own.get("steering_ratio", 1.0)
            return (
                MeasuredRun({}, (Diagnostic("run-failed", "it failed"),))
                if failing(peak)
                else MeasuredRun({"peak": (peak, "rad")})
            )

        findings = ExperimentResult(experiment, [record(job) for job in planned.jobs], {}, planned)
        plan = plan_region(planned, tmp_path / "o", planner=planner)
        records = {}
        while more := next_jobs(plan, findings, records):
            records |= {job.key: record(job) for job in more}
        regions = judge_region(plan, findings, records)
        return ExperimentResult(experiment, findings.records, {}, planned, regions)

    return judge


def test_a_flip_lies_where_the_closed_form_has_it_and_is_named_in_the_units_of_the_run(judged):
    (below, *_) = judged().claims
    assert below.verdict.margin == pytest.approx(1 / 6)
    amplitude, ratio = below.region.lines
    assert amplitude.flip.number == pytest.approx(1.2)  # 0.06 rad; the margin is linear in the amplitude
    assert amplitude.flip.words == "0.0600 rad"
    worse = (0.06 - 0.1) / 0.06  # at the level 0.5
    assert ratio.flip.number == pytest.approx(1 - 0.5 * (1 / 6) / (1 / 6 - worse))
    assert ratio.margins == (pytest.approx(worse), pytest.approx((0.06 - 0.025) / 0.06))
    assert below.region.flip == ratio.flip  # a fifth of its range against 0.067 of it
    assert mentions(region_words(below)[1], "0.900", "1.00", "ratio")


def test_the_share_of_a_latin_hypercube_along_one_value_is_that_of_the_closed_form(judged):
    claim = judged(("below: 0.06}]}", "below: 0.06}], open_values: [amplitude]}")).claims[0]
    assert claim.region.holding == 14  # factors below 1.2 of 0.5 to 1.5, in 20 equal parts
    assert claim.region.agreeing == pytest.approx(0.7)
    assert verdict(claim) == "depends on open values"  # 6 of 20 flip


def test_the_share_over_two_values_together_approaches_the_area(judged):
    ranges = ("values: [0.5, 1, 2]", "from: 0.5, to: 2")
    region = judged(ranges, ("points: 20", "points: 80"), ("most: 20", "most: 80")).claims[0].region
    assert region.agreeing == pytest.approx(0.5 + 0.275, abs=0.03)  # of {f < 1.2 r}, over 1 x 1.5


def test_points_are_added_to_a_claim_until_it_is_decided(judged):
    findings = judged(("points: 20\n  most: 20", "points: 16\n  most: 128"))
    verdicts = [verdict(one) for one in findings.claims]
    assert verdicts == ["depends on open values", "holds", *["depends on open values"] * 2]
    below, above, less, _ = (one.region for one in findings.claims)
    assert (above.flipping, len(above.points), above.robust) == (0, 48, True)
    assert above.flip_bounds.high < 0.1
    for region in (below, less):
        assert len(region.points) < 128
        assert region.flip_bounds.low > 0.1
        assert not region.robust
    assert mentions(region_words(findings.claims[0])[0], "7", "16 flip", "20", "70 %", "flip")
    assert mentions(region_words(findings.claims[1])[0], "0", "48 flip", "7.4 %", "flip")


def test_a_claim_depends_on_what_touches_its_runs_or_on_what_it_names(judged):
    below, _, less, only = judged().claims
    assert [line.open_value for line in below.region.lines] == ["amplitude", "ratio"]
    assert [line.open_value for line in only.region.lines] == ["ratio"]
    amplitude, ratio = less.region.lines  # both runs have it, and each its own
    assert amplitude.flip is None
    assert amplitude.unit == "× as chosen"
    assert ratio.flip.words == "0.500"  # where plain and double come to the same
    assert len(ratio.levels) == 2  # that of the chosen value is the named run itself


def test_a_check_is_judged_over_the_region_where_the_runs_of_claims_are_all_it_needs(judged):
    both, doubled = judged().checks
    assert (both.region.flipping, len(both.region.points)) == (0, 20)
    assert not both.region.robust  # one look at few points cannot make it so
    assert both.verdict.margin == pytest.approx(1.0)  # of the number itself, where the threshold is 0
    assert both.region.lines[0].margins == (pytest.approx(0.5), pytest.approx(1.5))
    assert doubled.region.agreeing == pytest.approx(0.6)  # 0.1 times more than 0.9, of 0.5 to 1.5
    unknown = judged((", below: {run: double, metric: peak}", ", above: 0")).checks
    assert [claim.region for claim in unknown] == [None, None]


def test_a_rank_correlation_of_part_of_a_grid_takes_the_runs_of_that_part_alone():
    experiment = load_experiment(ROOT / "scenarios" / "fuzzy_sliding_mode" / "distribution.yaml")
    within, whole = (
        next(one for one in experiment.spec.checks if words in one.says)
        for words in ("within the groups", "rank correlation at least")
    )
    assert len(runs_of(experiment, within)) == 16  # shares of 0.25 and more on both sides
    assert len(runs_of(experiment, whole)) == 26


def test_failed_runs_count_as_another_verdict_and_are_said(judged):
    both = judged(failing=lambda peak: peak > 0.12).claims[1]
    assert both.region.without_result > 0
    assert both.region.agreeing == pytest.approx(1 - both.region.without_result / 20)
    assert f"{both.region.without_result} of them without a result" in region_words(both)[0]
    assert both.region.spread == math.inf


def test_a_variant_may_put_another_scenario_in_place_of_a_runs(judged):
    ratio = re.search(r"    ratio: .*\n", STUDY)[0]
    other = (
        "    other: {variants: {plain: {}, doubled: {scenario: double.yaml}, long: {stop_time: 1}}, "
        'runs: [plain], because: "chosen: to show"}\n'
    )
    line = judged((ratio, other), ("[ratio]", "[other]")).claims[0].region.lines[1]
    assert [(one.words, one.verdict.holds) for one in line.levels] == [("doubled", False), ("long", True)]
    assert line.flip.words == "doubled"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("runs: [plain], values", "runs: [plan], values"), ("'plan'", "'plain'")),
        (("driver.steering_ratio", "drivers.ratio"), ("ratio", "drivers.ratio", "none")),
        (("[ratio]", "[ration]"), ("'ration'", "'ratio'")),
        (("values: [0.5, 1, 2]", "values: [0.01, 1]"), ("region.open_values.ratio: ",)),
        (
            ("times: true, from: 0.5, to: 1.5", "times: true, values: [a, b]"),
            ("times", "factors", "numbers"),
        ),
        (("most: 20", "most: 12"), ("region", "most", "12 and 20")),
        (("points: 20", "points: 2"), ("region.points", "10", "2")),
        (  # runs of one claim that differ in an open value need factors
            ("times: true, from: 0.5, to: 1.5", "from: 0.025, to: 0.075"),
            ("experiment.yaml", "region.open_values.amplitude", "0.05", "0.1", "`times: true`", "`runs`"),
        ),
    ],
)
def test_a_wrong_region_is_answered_by_a_sentence(judged, change, said):
    with refused(ScenarioError, names=said):
        judged(change, ("sine.yaml, set: {driver.amplitude: 0.1}", "double.yaml"))


@pytest.mark.parametrize(
    ("number", "relation", "bound", "margin"),
    [
        (114, "above", 100, 0.14),
        (114, "below", 100, -0.14),
        (-0.5, "at_least", -1, 0.5),
        (0, "at_most", 0, 0.0),
        (math.inf, "above", 1, math.inf),
        (1, "below", math.inf, 1.0),
        (None, "above", 2, None),
        (1, "below", None, None),
    ],
)
def test_a_margin_is_a_share_of_the_threshold(number, relation, bound, margin):
    found = compare(number, relation, bound)
    assert found.margin == (margin if margin is None else pytest.approx(margin))
    assert (found.status is Status.NOT_JUDGED) == (margin is None)


def test_the_verdict_on_a_claim_is_that_of_its_deciding_condition_and_a_missing_number_decides():
    values = {("a", "x"): MetricValue(114.0, "N"), ("a", "y"): MetricValue(1.016, "m")}

    def verdict_on(**bounds):
        conditions = [{"run": "a", "metric": key, "above": bound} for key, bound in bounds.items()]
        claim = Claim.model_validate({"says": "More.", "holds_if": conditions})
        return judge(claim, values, {"a": ""})

    near = verdict_on(x=100, y=1)
    assert (near.holds, near.value, near.bound, near.relation, near.unit) == (True, 1.016, 1, "above", "m")
    assert near.margin == pytest.approx(0.016)
    assert verdict_on(x=120, y=1).margin == pytest.approx(-0.05)
    assert verdict_on(x=120, z=1).status is Status.NOT_JUDGED
    assert verdict_on(x=120, z=1).margin is None


def test_of_several_verdicts_the_worst_counts_and_of_equal_ones_that_with_the_smallest_margin():
    near, far = compare(1.1, "above", 1.0), compare(3.0, "above", 1.0)
    missed, unknown = compare(0.5, "above", 1.0), not_judged("the record ends early")
    assert worst([]) is None
    assert worst([far, near]) is near
    assert worst([near, unknown]) is unknown
    assert worst([unknown, near, missed]) is missed
    assert missed.as_data() == {
        "verdict": "failed", "why": "", "value": 0.5, "bound": 1.0, "margin": -0.5, "relation": "above",
        "unit": "1",
    }  # fmt: skip
    assert compare(2, "above", 0).scaled(compare(4, "above", 0)).margin == 0.5


def test_a_verdict_within_its_confidence_interval_is_not_certain():
    assert compare(1.1, "above", 1.0, half=0.05).certain
    assert not compare(1.1, "above", 1.0, half=0.2).certain
    failing = compare(0.9, "above", 1.0, half=0.2)
    assert not all_of([failing, compare(2.0, "above", 1.0)]).certain
    assert all_of([failing, compare(0.5, "above", 1.0)]).certain


def at_margin(margin: float) -> Verdict:
    return Verdict(Status.PASSED if margin > 0 else Status.FAILED, margin=margin)


def test_the_spread_is_how_far_the_worst_tenth_comes_towards_the_threshold():
    points = tuple(at_margin(m) for m in (0.5, 0.4, 0.3, 0.2, 0.1, -0.1, 0.6, 0.7, 0.8, 0.9))
    ten = SequentialTest((10,), 0.1)
    assert Region(at_margin(0.5), points, (), ten).spread == pytest.approx(0.6)
    assert not Region(at_margin(0.5), points, (), ten).robust
    assert Region(at_margin(0.05), points[:5] * 2, (), ten).spread == 0.0
    assert Region(at_margin(-0.5), points, (), ten).spread == pytest.approx(1.4)


def test_study_makes_the_runs_of_the_region_once_and_quick_leaves_them_out(fmus, tmp_path, yawbench):
    fewer = (("from: 0.5, to: 1.5", "values: [0.5, 1.5]"), ("[0.5, 1, 2]", "[0.5, 2]"))
    file = written(tmp_path, STUDY, *fewer, sine=SCENARIO)

    def study(*options: str) -> tuple[str, str, dict, str]:
        status, out, said = yawbench("study", file, "--out", tmp_path / "o", "--fmus", fmus, *options)
        assert status == 0
        record, page = (
            (tmp_path / "o" / name).read_text("utf-8") for name in ("experiment.json", "report.html")
        )
        return " ".join(out.split()), said, json.loads(record), page

    out, said, record, page = study("--jobs", "1")
    assert mentions(said, "10 runs", "region")  # 2 x 2 and 4 of plain alone, 2 of double
    region = record["claims"][0]["region"]
    assert region["points"] == 20
    assert region["flip_bounds"][0] < region["flipping"] / 20 < region["flip_bounds"][1]
    flip = {"open_value": "ratio", "at": pytest.approx(0.9), "words": "0.900", "chosen": "1.00"}
    assert region["flip"] == flip
    assert mentions(out, "5", "20 flip", "8.7", "49 %", "flip")
    below = next(csv.DictReader((tmp_path / "o/verdicts.csv").open(encoding="utf-8")))
    assert below["verdict"] == "undecided"
    assert mentions(below["says"], "0.06 rad", "stays")
    assert (int(below["holds at"]), below["flips at"]) == (region["holds_at"], "0.900")
    assert mentions(page, "flips at ratio")
    assert mentions(page, "at the chosen point alone holds: 3, does not reproduce: 1")
    _, said, record, _ = study("--no-run")
    assert mentions(said, "10 runs", "region")
    assert record["claims"][0]["region"] == region
    out, said, record, page = study("--no-run", "--quick")
    assert "region of the verdicts" not in said
    only = "at the chosen point only; the region of the open values has not been run"
    assert f"verdicts: {only}" in out
    assert only in html.fromstring(page).text_content()
    assert record["claims"][0]["region"] is None
    assert record["claims"][0]["margin"] == pytest.approx(1 / 6)
    assert "17 %" in out

"""Study files, their verdicts and what they leave on disk, judged on made-up results."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from lxml import html

from tests.orchestrator.recorded import car, write
from tests.refusals import each_mentions, mentions, refused, texts_of
from tests.reports.made_up import unpacked
from tests.studies.experiment_files import written
from yawbench.foundation.errors import Diagnostic, ScenarioError
from yawbench.metrics.expressions import MetricValue
from yawbench.orchestrator.plan import Override
from yawbench.reports.page_parts import render
from yawbench.reports.study_page import chapter, viewer_of
from yawbench.studies.claim_schema import Claim, GridSpec
from yawbench.studies.claims import ClaimResult, comparisons, judge
from yawbench.studies.derived import correlation, rank_correlation
from yawbench.studies.experiment_result import judge_results
from yawbench.studies.expression import Expression
from yawbench.studies.jobs import Job, Outcome
from yawbench.studies.load_experiment import load_experiment
from yawbench.studies.result_figures import draw_all, draw_over_axes
from yawbench.studies.result_files import write_findings
from yawbench.studies.result_tables import claim_tables, derived_tables, measured_words, run_tables, share

STUDY = """
title: A made-up paper
source: Nobody, Nowhere
runs:
  - for: {speed: [15, 25], controller: {"off": no control, fnn: neural network}}
    name: "{speed}mps/{controller}"
    label: "{controller}"
    row: "{speed} m/s, {controller}"
    scenario: "{speed}mps.yaml"
    swap: {controller: "controller_{controller}"}
    set: {driver.amplitude: 0.03, controller.learning: true}
  - {name: slow, scenario: slow.yaml, stop_time: 2 s, algorithm: jacobi}
metrics:
  error: {metric: relative_peak_error(sideslip), heading: largest error}
  late: {metric: peak(sideslip), window: [6.5, 8]}
  moment: {metric: peak(yaw_moment)}
tables:
  - {title: Table, runs: ["*mps/*", slow], metrics: [error, moment]}
claims:
  - says: Without control the error exceeds 100 %.
    short: "> 100 %"
    source: section 3
    holds_if: [{run: 15mps/off, metric: error, above: 100 %}]
  - says: With the network it is within 1 %.
    short: "≤ 1 %"
    source: section 3
    holds_if: [{run: 15mps/fnn, metric: error, at_most: 1 %}]
    note: the paper names no gains
  - says: The network is better.
    source: section 4
    holds_if:
      - {run: 15mps/fnn, metric: error, below: {run: 15mps/off, metric: error, times: 0.5}}
      - {run: 25mps/fnn, metric: error, below: {run: 25mps/off, metric: error}}
checks:
  - says: The car is at rest in the end.
    holds_if: [{run: "*", metric: late, at_most: 0.1 deg}]
  - says: Moments are small.
    holds_if: [{run: "*mps/fnn", metric: moment, below: 1 kN.m}]
figures:
  - {name: both, title: Both at 15 m/s, runs: ["15mps/*"], panels: [sideslip, path]}
  - {name: roll, runs: [slow], panels: [roll_angle]}
"""


@pytest.fixture
def study(tmp_path):
    """Load the study with texts of it replaced."""
    return lambda *changes: load_experiment(written(tmp_path, STUDY, *changes))


def page(findings, out) -> str:
    """Return what a reader of the experiment's page sees."""
    view = chapter(findings, command="yawbench study", stale={}, folder=out)
    text = unpacked(render(view))
    return " ".join(" ".join(html.fromstring(text).itertext()).split())


GAINS = {"15mps/off": 2.4, "15mps/fnn": 1.02, "25mps/off": 3.0, "25mps/fnn": 1.04, "slow": 1.0}


@pytest.fixture
def out(tmp_path) -> Path:
    """A folder with results of all runs."""
    for name, gain in GAINS.items():
        write(car(gain, n=161), tmp_path / "out" / name)
    return tmp_path / "out"


def test_a_grid_is_drawn_from_results_alone(study, out):
    """Neither scenarios nor FMUs are at hand, so nothing can be planned."""
    grid = """
grids:
  errors:
    title: Errors
    metric: error
    run: "{speed}mps/{controller}"
    rows: {speed: [15, 25]}
    columns: {controller: {"off": free, fnn: held}}
checks:"""
    figure = """
figures:
  - {name: lines, kind: grid, grid: errors}"""
    made = study(("\nchecks:", grid), ("\nfigures:", figure))
    findings = judge_results(made, out)
    assert mentions(draw_all(findings, out)[0]["lines"], "made-up", "paper", "lines")
    lines = draw_over_axes(findings, findings.spec.figures[0]).axes[0].lines
    assert [(line.get_linestyle(), len(line.get_xdata())) for line in lines] == [("None", 2)] * 2
    drawn = (out / "figures" / "lines.svg").read_text()
    assert mentions(drawn, "5 runs", "15mps.yaml")
    assert mentions(drawn, "controller_made_up", "01234567", "plant_made_up")


@pytest.mark.parametrize(
    "value, bound, expected",
    [
        (3.8612, 3.8614, "3.8612 m (held) against 3.8614 m (free)"),
        (3.8612, 3.9, "3.86 m (held) against 3.90 m (free)"),
        (3.8612, 3.8612, "3.86 m (held) against 3.86 m (free)"),
        (1e-6, 2e-6, "1.00e-06 m (held) against 2.00e-06 m (free)"),
    ],
)
def test_numbers_that_decide_a_verdict_read_differently(value, bound, expected):
    condition = {"run": "a", "metric": "far", "below": {"run": "b", "metric": "far"}}
    claim = Claim.model_validate({"says": "Less.", "holds_if": [condition]})
    values = {(run, "far"): MetricValue(number, "m") for run, number in (("a", value), ("b", bound))}
    compared = comparisons(claim, values, {"a": "held", "b": "free"})
    result = ClaimResult.of(claim, "claims", [compared], None)
    assert (result.verdict.holds, measured_words(result)) == (value < bound, [expected])


def test_a_margin_beyond_the_threshold_itself_is_told_in_words():
    told = {0.016: "1.6 %", -0.5: "-50 %", 1.0: "100 %", -1.0: "-100 %", 1.01: "by far", -62: "missed by far"}
    assert {x: share(x) for x in told} == told


def test_the_viewer_has_a_view_per_figure_the_one_in_which_most_happens_first(study, tmp_path):
    figures = """
figures:
  - {name: calm, title: Calm, runs: ["15mps/*"], panels: [path, yaw_rate, sideslip(yaw_rate)]}
  - {name: lively, title: Lively, runs: ["25mps/*", slow], panels: [path]}"""
    made = study(
        ("\nfigures:", figures),
        ('  - {name: both, title: Both at 15 m/s, runs: ["15mps/*"], panels: [sideslip, path]}\n', ""),
    )
    gains = {"15mps/off": 1.1, "15mps/fnn": 1.0, "25mps/off": 3.0, "25mps/fnn": 1.0, "slow": 1.0}
    for name, gain in gains.items():
        run = car(gain, n=161)
        lost = replace(run, columns={k: x for k, x in run.columns.items() if "position" not in k})
        write(lost if name == "slow" else run, tmp_path / "out" / name)
    shown, _ = viewer_of(judge_results(made, tmp_path / "out"))
    assert shown is not None
    data = shown.data
    assert [view["title"] for view in data["views"]][:3] == ["Lively", "Calm", "Calm: sideslip(yaw_rate)"]
    assert [view["x"] for view in data["views"]][:3] == ["time", "time", "plant.yaw_rate"]
    assert data["views"][1]["panels"] == ["plant.yaw_rate,reference.yaw_rate_ref"]
    labels = [run["label"] for run in data["runs"]]
    assert [[labels[k] for k in view["shown"]] for view in data["views"][:2]] == [
        ["25 m/s, no control", "25 m/s, neural network", "slow"],
        ["15 m/s, no control", "15 m/s, neural network"],
    ]
    assert [run["road"] is None for run in data["runs"]] == [label == "slow" for label in labels]


def test_for_stands_for_one_run_per_combination(study, tmp_path):
    runs = study(
        ("name: slow, scenario: slow.yaml", "name: slow, swap: {tyre: mine/t.fmu}, scenario: slow.yaml")
    ).runs
    assert list(runs) == ["15mps/off", "15mps/fnn", "25mps/off", "25mps/fnn", "slow"]
    run = runs["25mps/fnn"]
    assert (run.label, run.row) == ("neural network", "25 m/s, neural network")
    assert run.scenario == tmp_path / "25mps.yaml"
    assert run.changes == (
        Override.of("driver.amplitude", 0.03, "study"),
        Override.of("controller.learning", True, "study"),
        Override.of("controller", "controller_fnn", "study"),
    )
    assert (runs["slow"].label, runs["slow"].row) == ("slow", "slow")
    assert Override.of("tyre", str(tmp_path / "mine/t.fmu"), "study") in runs["slow"].changes


def test_all_problems_of_a_study_are_reported_at_once(study):
    with pytest.raises(ScenarioError) as error:
        study(
            ("stop_time: 2 s", "stop_tim: 2 s"),
            ("relative_peak_error(sideslip), h", "relative_peek_error(sideslip), h"),
            ("window: [6.5, 8]", "window: [6.5]"),
            ("title: Both at", "titel: Both at"),
            ("above: 100 %", "above: [1]"),
        )
    assert each_mentions(
        texts_of(error.value),
        ("runs[1].stop_tim", "'stop_time'", "swap", "row"),
        (
            "metrics.error.metric",
            "'relative_peek_error(sideslip)'",
            "'relative_peek_error'",
            "'relative_peak_error'",
        ),
        ("metrics.late.window", "1 s", "3 s", "[6.5]"),
        ("claims[0].holds_if[0].above", "'5 %'"),
        ("figures[0].titel", "'title'", "mark"),
    )


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        (
            "metrics: [error, moment]",
            "metrics: [error, momentum]",
            ("tables[0].metrics[1]", "'momentum'", "'moment'"),
        ),
        (
            "{run: 15mps/off, metric: error, above",
            "{run: 15mps/of, metric: error, above",
            ("claims[0].holds_if[0].run", "'15mps/of'", "'15mps/off'"),
        ),
        (
            "{run: 25mps/off, metric: error}",
            "{run: 25mps/off, metric: errors}",
            ("claims[2].holds_if[1].below.metric", "'errors'", "'error'"),
        ),
        ("runs: [slow], panels", "runs: [slowly], panels", ("figures[1].runs[0]", "'slowly'", "'slow'")),
        ("name: slow", "name: 15mps/off", ("runs[1].name", "'15mps/off'")),
        *(
            ("name: slow", f'name: "{name}"', ("runs[1].name", "letters", "digits", f"'{name}'"))
            for name in ("../up", "figures/x", "a//b", "a b")
        ),
        ('"{speed}mps.yaml"', '"{sped}mps.yaml"', ("runs[0].scenario", "'speed'")),
        ("above: 100 %", "above: 100 %, below: 200 %", ("claims[0].holds_if[0]", "at_least", "at_most")),
        ("metric: error\n    run", "metric: eror\n    run", ("grids.errors.metric", "'eror'")),
        ("speed: [15, 25]}\n    col", "speed: [15, 26]}\n    col", ("grids.errors", "'26mps/off'")),
        ("[2, 0.05]]", "[2]]", ("grids.errors", "published", "2 rows", "2 numbers")),
        ('"{speed}mps/{controller}"\n    rows', '"{speed}mps/off"\n    rows', ("depend", "{controller}")),
        ("    rows: {speed: [15, 25]}", "    rows: {a: [1], b: [2]}", ("one name", "values")),
        ("rank_correlation: errors", "rank_correlation: error", ("grid 'error'", "'errors'")),
        ("(off - fnn) / off", "(of - fnn) / off", ("expression", "of", "off and fnn")),
        ("(off - fnn) / off", "off ** fnn", ("+ - * /",)),
        ("(off - fnn) / off", "(off - ", ("expression",)),
        ("(off - fnn) / off", "abs(off)", ("numbers", "names", "parentheses")),
        ("    expression: (off - fnn) / off\n", "", ("expression", "rank_correlation", "exactly one")),
        ("of: {off: {run: 15mps/off", "of: {off: {run: 15mps/of", ("derived.drop.of.off.run", "15mps/of")),
        ('    unit: "%"', '    unit: "%"\n    published: 95 kg', ("published", "'95 kg'")),
        ('    unit: "%"', '    unit: "%"\n    published: much', ("published", "number")),
        ("{derived: order, at", "{derived: ordre, at", ("'ordre'", "'order'")),
        ("{derived: order, at", "{derived: order, run: slow, at", ("run and metric", "derived")),
        ("{derived: order, at", "{at", ("run and metric", "derived")),
    ],
)
def test_what_is_wrong_is_said_with_its_place_and_the_likely_names(with_grid, old, new, names):
    with pytest.raises(ScenarioError) as error:
        with_grid((old, new))
    assert mentions(error.value, *names)


def test_a_missing_study_file_is_one_sentence(tmp_path):
    with refused(ScenarioError, names=("none.yaml", "experiment", "file")):
        load_experiment(tmp_path / "none.yaml")


def verdicts(judgements):
    return [judgement.verdict.holds for judgement in judgements]


def test_claims_are_judged_by_the_results_on_disk(study, out):
    findings = judge_results(study(), out)
    assert verdicts(findings.claims) == [True, False, True]
    assert verdicts(findings.checks) == [True, False]
    assert measured_words(findings.claims[0]) == ["140 % (15 m/s, no control)"]
    assert each_mentions(
        measured_words(findings.claims[2]),
        ("2.00 %", "15 m/s", "0.5", "140 %", "network", "against"),
        ("4.00 %", "25 m/s", "200 %", "network", "against"),
    )
    assert measured_words(findings.checks[1]) == ["2000 N·m (15 m/s, neural network)"]


def failing(out, name):
    """Return how a run ended that has just failed."""
    return Outcome(Job(name, Path("x"), out / name), (Diagnostic("run-failed", "plant: lost"),), 1)


def test_a_claim_about_a_run_without_results_is_not_judged(study, out):
    findings = judge_results(study(), out, [failing(out, "15mps/off")])
    assert findings.failed == {"15mps/off": "plant: lost"}
    assert verdicts(findings.claims) == [None, False, None]
    assert mentions(measured_words(findings.claims[2])[0], "2.00 %", "15 m/s", "network", "against")
    assert verdicts(findings.checks) == [None, False]


def test_a_run_that_ended_early_counts_as_failed(study, out):
    write(car(1.0, n=161), out / "slow", status="interrupted", error={"message": "the run was interrupted"})
    findings = judge_results(study(), out)
    assert findings.failed.keys() == {"slow"}
    assert mentions(findings.failed["slow"], out / "slow", "early", "interrupted")


def test_operators_and_factors_compare_as_they_say():
    values = {("a", "m"): MetricValue(1.0, "N.m"), ("b", "m"): MetricValue(2.0, "N.m")}

    def holds(**condition):
        claim = Claim(says="x", holds_if=[{"run": "a", "metric": "m", **condition}])
        return judge(claim, values, {"a": "", "b": ""}).holds

    assert [holds(above=1.0), holds(at_least=1.0), holds(below=1.0), holds(at_most=1.0)] == [
        False, True, False, True,
    ]  # fmt: skip
    assert holds(at_least={"run": "b", "metric": "m", "times": 0.5})
    assert not holds(at_least={"run": "b", "metric": "m", "times": 0.6})
    assert holds(below="0.002 kN.m")
    assert holds(run="*", at_most=2)
    assert not holds(run="*", at_most=1.5)
    with refused(ScenarioError, "unit-mismatch", names=("'2 deg'", "N.m", "kN.m")):
        holds(below="2 deg")


@pytest.fixture
def with_grid(study):
    """The study with a grid of its four runs, derived numbers and claims about them."""
    return lambda *changes: study(("claims:\n", GRID + "claims:\n"), ("checks:\n", CHECKS), *changes)


GRID = """\
grids:
  errors:
    title: Error
    metric: error
    run: "{speed}mps/{controller}"
    rows: {speed: [15, 25]}
    columns: {controller: {"off": no control, fnn: neural network}}
    corner: speed
    published: [[3, 0.01], [2, 0.05]]
    beside: [{run: slow, says: slow run, published: 0.001}]
derived:
  order: {says: Rank correlation, rank_correlation: errors}
  drop:
    says: Share of the error removed
    expression: (off - fnn) / off
    of: {off: {run: 15mps/off, metric: error}, fnn: {run: 15mps/fnn, metric: error}}
    unit: "%"
"""

CHECKS = """\
checks:
  - says: The order is the paper's.
    holds_if: [{derived: order, at_least: 0.9}]
"""


def test_a_grid_stands_beside_the_published_numbers_with_its_rank_correlation(with_grid, out):
    findings = judge_results(with_grid(), out)
    grid, numbers = derived_tables(findings)
    assert grid.headings == [
        "speed", "no control", "neural network", "the paper:", "no control", "neural network",
    ]  # fmt: skip
    assert grid.text() == [
        ["15", "1.40", "0.0200", "15", "3.00", "0.0100"],
        ["25", "2.00", "0.0400", "25", "2.00", "0.0500"],
    ]
    assert [grid.is_number(i) for i in range(6)] == [False, True, True, False, True, True]
    assert grid.notes[0].startswith("slow run: ")
    assert grid.notes[0].endswith(", the paper: 0.00100")
    assert mentions(grid.notes[1], "Spearman", "5 runs", "0.900")
    assert numbers.text() == [["Rank correlation", "0.900"], ["Share of the error removed", "98.6 %"]]
    assert findings.checks[0].verdict.holds
    assert measured_words(findings.checks[0]) == ["0.900"]


def test_a_grid_and_its_derived_numbers_are_written_down(with_grid, out):
    findings = judge_results(with_grid(('    unit: "%"\n', '    unit: "%"\n    published: 95 %\n')), out)
    _, numbers = derived_tables(findings)
    assert numbers.headings == ["what", "value", "the paper says"]
    assert numbers.text() == [
        ["Rank correlation", "0.900", "-"],
        ["Share of the error removed", "98.6 %", "95.0 %"],
    ]
    said = page(findings, out)
    assert "15 1.40 0.0200" in said
    assert "15 3.00 0.0100" in said
    write_findings(findings, {}, out)
    record = json.loads((out / "experiment.json").read_text())
    drop, order = (record["derived"][name] for name in ("drop", "order"))
    assert (drop["value"], drop["published"]) == (pytest.approx(1.38 / 1.4), pytest.approx(0.95))
    assert drop["of"]["off"] == ["15mps/off", "error"]
    assert order["published"] is None
    assert record["checks"][0]["holds_if"] == ["order ≥ 0.9"]


def test_expressions_are_arithmetic():
    values = {"a": 3.0, "b": 2.0}
    assert Expression.parse("(a - b) / -b * 4 + 1.5").value(values) == -0.5
    assert Expression.parse("a / (b - 2)").value(values) is None
    assert Expression.parse("1e308 * 10 * a").value(values) is None


def test_rank_correlation_agrees_with_scipy():
    stats = pytest.importorskip("scipy.stats")
    rng = np.random.default_rng(3)
    for n in (3, 5, 26):
        x = rng.integers(0, 8, n) + 0.0  # with equal values
        y = x + rng.normal(0, 3, n)
        assert rank_correlation(x, y) == pytest.approx(stats.spearmanr(x, y).statistic, abs=1e-12)
    assert rank_correlation([1, 2, 3], [10, 20, 30]) == pytest.approx(1.0)
    assert rank_correlation([1, 2, 3], [5, 5, 5]) is None


def test_what_the_paper_says_of_a_run_stands_beside_it(study, out):
    (table,) = run_tables(judge_results(study(), out))
    assert table.headings == ["run", "largest error", "the paper says", "verdict", "margin", "max|M_z|"]
    assert table.text()[:3] == [
        ["15 m/s, no control", "140 %", "> 100 % (section 3)", "holds", "40 %", "2000 N·m"],
        ["15 m/s, neural network", "2.00 %", "≤ 1 % (section 3)", "does not reproduce", "-100 %", "2000 N·m"],
        ["25 m/s, no control", "200 %", "-", "-", "-", "2000 N·m"],
    ]
    assert each_mentions(table.notes, ("β_ref", "largest", "error"), ("15 m/s", "neural", "network"))


def test_claims_about_several_runs_and_checks_have_tables_of_their_own(study, out):
    paper, project = claim_tables(judge_results(study(), out))
    (row,) = paper.text()
    assert row[2] == "holds"
    assert mentions(row[0], "4", "network", "better")
    assert mentions(row[1].splitlines()[1], "4.00 %", "25 m/s", "200 %", "network", "against")
    assert [row[2:] for row in project.text()] == [["holds", "100 %"], ["does not hold", "-100 %"]]


def test_a_failed_run_is_named_in_the_table_with_its_reason(study, out):
    (table,) = run_tables(judge_results(study(), out, [failing(out, "slow")]))
    assert table.text()[-1] == ["slow", "failed", "-", "-", "-", "-"]
    assert mentions(table.notes[-1], "slow", "plant", "lost")


def test_a_study_leaves_figures_tables_and_a_record(study, out):
    findings = judge_results(study(), out)
    drawn, said = draw_all(findings, out)
    write_findings(findings, drawn, out)
    assert len(said) == 1
    assert said[0].startswith("figure roll: ")
    assert mentions(said[0], "roll_angle", "recorded")
    assert sorted(path.name for path in (out / "figures").iterdir()) == ["both.png", "both.svg"]
    report = page(findings, out)
    assert mentions(report, "15 m/s", "140 %", "100 %", "3", "40 %", "2000 N·m", "control", "section")
    assert mentions(report, "15 m/s", "figures/both.svg")
    assert mentions(report, "6.5", "8 s", "largest", "absolute")
    assert pq.read_table(out / "table.parquet").num_rows == 5
    rows = {row["run"]: row for row in csv.DictReader((out / "table.csv").open())}
    assert float(rows["15mps/fnn"]["error [1]"]) == pytest.approx(0.02, rel=1e-9)
    record = json.loads((out / "experiment.json").read_text())
    assert mentions(record["claims"][1]["verdict"], "does not reproduce")
    assert record["claims"][1]["holds_if"] == ["15mps/fnn: error ≤ 1 %"]
    assert record["runs"]["25mps/off"]["metrics"]["error"] == {"value": pytest.approx(2.0), "unit": "1"}
    assert set(record["runs"]["slow"]["fmus"]) == {"controller_made_up", "plant_made_up"}


def test_a_study_without_any_result_still_says_so(study, tmp_path):
    findings = judge_results(study(), tmp_path / "empty")
    _, said = draw_all(findings, tmp_path / "empty")
    assert each_mentions(said, ("figure", "results"), ("figure", "roll", "results"))
    assert mentions(page(findings, tmp_path / "empty"), "5 runs")


def test_a_rank_correlation_may_be_that_of_part_of_a_grid():
    spec = GridSpec.model_validate({
        "title": "t", "metric": "m", "run": "{i}_{k}", "rows": {"i": ["1", "2", "3"]},
        "columns": {"k": ["1", "2"]}, "published": [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]],
        "beside": [{"run": "aside", "says": "aside", "published": 9.0}],
    })  # fmt: skip
    numbers = {"1_1": 1, "1_2": 2, "2_1": 4, "2_2": 3, "3_1": 9, "3_2": 0, "aside": 20}
    values = {(run, "m"): MetricValue(float(number), "1") for run, number in numbers.items()}
    assert correlation(spec, values, {"i": ["1"]}) == pytest.approx(1.0)
    assert correlation(spec, values, {"i": ["2", "3"], "k": ["1"]}) == pytest.approx(1.0)
    assert correlation(spec, values, {"i": ["2", "3"]}) == pytest.approx(-0.4)
    assert correlation(spec, values) < 1.0
    assert correlation(spec, {("1_1", "m"): MetricValue(1.0, "1")}, {"i": ["1"]}) is None

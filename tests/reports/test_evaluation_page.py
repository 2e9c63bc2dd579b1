"""The page of a standard test: verdicts with their distances, runs with instants and limits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.orchestrator.recorded import write
from tests.reports.browser import DESK, PHONE, Browser
from tests.reports.flaws import check_first_screen, check_whole, looks
from tests.reports.made_up import data_in, whole_car
from yawbench.metrics.verdict import compare, not_judged
from yawbench.proving_ground.standard_tests import TESTS, Evaluation
from yawbench.proving_ground.trace import trace_of
from yawbench.reports.evaluation_page import criteria_table, evaluation_page, results_of

TEST = TESTS["sine-with-dwell"]


def judged(label: str, ratio: float, distance: float | None = None) -> Evaluation:
    made = Evaluation(label)
    for key, value, unit in (("begin", 1.0, "s"), ("end", 3.0, "s"), ("peak", -0.4, "rad/s")):
        made.add(key, key, value, unit)
    made.rule("stability", compare(ratio, "at_most", 0.35, "%", why=f"{ratio:.3f}"))
    why = not_judged("the record ends early")
    made.rule("responsiveness", why if distance is None else compare(distance, "at_least", 1.83, "m"))
    return made


@pytest.fixture(scope="module")
def traces(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    return [
        replace(trace_of(whole_car(gain), name), folder=write(whole_car(gain), folder / name))
        for name, gain in (("slow", 1.0), ("fast", 2.0))
    ]


def test_a_criterion_has_the_run_that_decides_and_its_distance_to_the_limit():
    table, decide = criteria_table([judged("slow", 0.1, 2.0), judged("fast", 0.42, 1.9)], None)
    assert decide == ["fast", "fast"]
    assert table.text()[0][:6] == ["stability", "failed", "42.0 %", "≤ 35.0 %", "-7.00 % (-20 %)", "fast"]
    assert table.text()[1][:6] == [
        "responsiveness", "passed", "1.90 m", "≥ 1.83 m", "0.0700 m (3.8 %)", "fast",
    ]  # fmt: skip


def test_numbers_that_decide_read_differently_and_those_not_judged_have_a_reason_instead():
    table, _ = criteria_table([judged("x", 0.350004)], None)
    (_, status, value, limit, *_), (_, _, *numbers, why) = table.text()
    assert status == "failed" and value != limit.removeprefix("≤ ")
    assert (numbers, why) == (["-", "-", "-"], "the record ends early")


def test_the_viewer_has_the_instants_and_limits_of_the_run_that_decides(traces):
    page = evaluation_page(TEST, traces, [judged("slow", 0.1, 2.0), judged("fast", 0.42, 1.9)], None)
    data = data_in(page)
    assert {run for *_, run in data["marks"]} == {0, 1}  # a run's are hidden with it
    assert [instant for instant, _, run in data["marks"] if run == 1] == pytest.approx(
        [1.0, 2.07, 3.0, 4.0, 4.75]
    )
    levels = [(name, level) for name, level, _, run in data["limits"] if run == 1]
    assert levels == [("plant.yaw_rate", pytest.approx(-0.14)), ("plant.yaw_rate", pytest.approx(-0.08))]
    assert [view["shown"] for view in data["views"]][:2] == [[1], [0, 1]]
    assert [run["label"] for run in data["runs"]] == ["slow", "fast"]


def test_a_measurement_is_a_run_like_others(traces):
    measured = replace(traces[0], folder=None)
    results = results_of(measured)
    np.testing.assert_array_equal(results["yaw_rate"], measured["yaw_rate"])
    assert results.units["yaw_rate"] == "rad/s"
    data = data_in(evaluation_page(TEST, [measured], [judged("slow", 0.1, 2.0)], None))
    assert "yaw_rate" in [panel.split(",")[0] for panel in data["views"][0]["panels"]]


def test_a_test_without_criteria_has_its_quantities(traces):
    made = Evaluation("slow")
    made.add("gain", "yaw-rate gain", 0.3, "1/s")
    page = evaluation_page(TESTS["step-steer"], traces[:1], [made], None)
    assert "The test has no criteria." in page and "yaw-rate gain" in page


@pytest.mark.parametrize(("width", "colours"), looks(PHONE, DESK, narrow=True))
def test_the_page_has_no_flaws(chromium: Browser, traces, tmp_path: Path, width: int, colours: str):
    file = tmp_path / "evaluation.html"
    runs = [judged("slow", 0.1, 2.0), judged("fast", 0.42)]
    file.write_text(evaluation_page(TEST, traces, runs, None), "utf-8")
    check_whole(chromium, file, width, colours)
    check_first_screen(chromium, file, width, 844)

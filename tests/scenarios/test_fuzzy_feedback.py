"""The study of paper D on the real master."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.judged_studies import judge_all, judge_some, verdicts
from tests.refusals import sentence_has

STUDY = Path(__file__).parents[2] / "scenarios" / "fuzzy_feedback" / "study.yaml"
DEGREE = 0.017453292519943295


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The record of the study, without what its controller does not know."""
    runs = ("off", "both", "yaw_rate_alone", "sideslip_alone", "linear_tyre/off", "unlimited/fuzzy_feedback")
    return judge_some(STUDY, tmp_path_factory.mktemp("study"), *runs)


@pytest.fixture(scope="module")
def whole(study):
    """The same with all its runs."""
    return judge_all(STUDY, study["folder"], "--quick")


def test_the_controlled_car_follows_the_limited_reference_and_comes_to_rest(metric):
    assert metric("both", "rms") <= 0.10
    assert metric("both", "sideslip") <= 3 * DEGREE
    assert metric("both", "moment") <= 6700.0
    assert metric("both", "sideslip_at_end") <= 0.1 * DEGREE
    assert metric("both", "yaw_rate_at_end") <= 0.001


def test_the_uncontrolled_car_is_lost(metric):
    assert metric("off", "sideslip") > 20 * DEGREE


@pytest.mark.parametrize("system", ["yaw_rate_alone", "sideslip_alone"])
def test_each_system_alone_holds_the_car(metric, system):
    assert metric(system, "sideslip") < 8 * DEGREE


def test_the_printed_reference_asks_for_more_sideslip_than_the_road_allows_the_limited_one(metric):
    assert metric("unlimited/fuzzy_feedback", "sideslip") > 5 * metric("both", "sideslip")


LOST = [
    "With control the sideslip practically coincides with its reference.",
    "Weighting the two outputs improves lateral stability greatly over either system alone.",
]


def test_all_holds_but_that_the_sideslip_follows_too(study, metric):
    assert [says for says, verdict in verdicts(study).items() if verdict != "holds"] == LOST
    assert len(verdicts(study)) == 10
    assert metric("both", "sideslip_rms") > 0.10  # one moment, two references


@pytest.mark.exhaustive
def test_robustness_does_not_reproduce_either(whole):
    robust = "Fuzzy control is robust, insensitive to disturbances and changed parameters."
    assert [says for says, verdict in verdicts(whole).items() if verdict != "holds"] == [*LOST, robust]
    assert len(verdicts(whole)) == len(whole["claims"]) + len(whole["checks"])


PAGE = (STUDY.parents[2] / "docs" / "papers.md").read_text(encoding="utf-8")
SECTION = PAGE.partition("## Paper D")[2].partition("\n## ")[0]
TOLD = " ".join(SECTION.split())


def test_the_page_on_papers_tells_what_the_study_found(metric):
    assert sentence_has(TOLD, f"{metric('off', 'sideslip') / DEGREE:.0f} degrees", "degrees", "sideslip")
    assert sentence_has(TOLD, f"{100 * metric('both', 'rms'):.1f} %", "RMS", "peak")
    assert f"({100 * metric('both', 'sideslip_rms'):.0f} % RMS)" in TOLD
    assert sentence_has(TOLD, f"{metric('both', 'sideslip') / DEGREE:.1f} degrees", "reaches", "degrees")
    assert sentence_has(TOLD, f"{metric('both', 'sideslip_ref') / DEGREE:.1f}", "reference")
    assert sentence_has(TOLD, f"{metric('unlimited/fuzzy_feedback', 'sideslip') / DEGREE:.1f}", "reference")
    assert sentence_has(TOLD, f"{100 * metric('both', 'path'):.1f} %", "RMS", "road")
    assert sentence_has(
        TOLD, f"{metric('linear_tyre/off', 'sideslip') / DEGREE:.1f} degrees", "linear", "tyres"
    )
    rms = [f"{100 * metric(run, 'rms'):.1f} %" for run in ("yaw_rate_alone", "both")]
    peaks = [
        f"{metric(run, 'sideslip') / DEGREE:.1f} degrees" for run in ("yaw_rate_alone", "sideslip_alone")
    ]
    assert sentence_has(TOLD, " to ".join(rms), peaks[0], "alone")
    assert sentence_has(TOLD, peaks[1], "alone")


@pytest.mark.exhaustive
def test_the_page_on_papers_tells_what_becomes_of_what_the_controller_does_not_know(whole, metric_of_all):
    unknown = [run for run in whole["runs"] if run.startswith("unknown/")]
    rms, path = (max(100 * metric_of_all(run, name) for run in unknown) for name in ("rms", "path"))
    assert sentence_has(TOLD, f"{rms:.1f} %", f"{path:.0f} %", "path")

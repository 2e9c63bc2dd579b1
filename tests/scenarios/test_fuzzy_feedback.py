"""The study of paper D on the real master."""

from __future__ import annotations

from pathlib import Path

import pytest

from docs.generate.papers import numbers_of
from tests.judged_studies import judge_all, judge_some, verdicts
from tests.scenarios.recorded_numbers import assert_recorded

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


def test_the_runs_come_to_what_the_docs_are_made_of(study):
    assert_recorded("D", numbers_of(study["folder"]))

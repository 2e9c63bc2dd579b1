"""The study of paper D on the real master."""

from __future__ import annotations

from pathlib import Path

import pytest

from docs.generate.papers import numbers_of
from tests.judged_studies import judge_all, judge_some, verdicts
from tests.scenarios.recorded_numbers import assert_recorded

STUDY = Path(__file__).parents[2] / "scenarios" / "fuzzy_feedback" / "study.yaml"


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The record of the study, without what its controller does not know."""
    runs = ("off", "both", "yaw_rate_alone", "sideslip_alone", "linear_tyre/off", "unlimited/fuzzy_feedback")
    return judge_some(STUDY, tmp_path_factory.mktemp("study"), *runs)


@pytest.fixture(scope="module")
def whole(study):
    """The same with all its runs."""
    return judge_all(STUDY, study["folder"], "--quick")


LOST = [
    "With control the sideslip practically coincides with its reference.",
    "Weighting the two outputs improves lateral stability greatly over either system alone.",
]


def test_all_holds_but_that_the_sideslip_follows_too(study):
    assert [says for says, verdict in verdicts(study).items() if verdict != "holds"] == LOST
    assert len(verdicts(study)) == 10


@pytest.mark.exhaustive
def test_robustness_does_not_reproduce_either(whole):
    robust = "Fuzzy control is robust, insensitive to disturbances and changed parameters."
    assert [says for says, verdict in verdicts(whole).items() if verdict != "holds"] == [*LOST, robust]
    assert len(verdicts(whole)) == len(whole["claims"]) + len(whole["checks"])


def test_the_runs_come_to_what_the_docs_are_made_of(study):
    assert_recorded("D", numbers_of(study["folder"]))

"""The study of paper A, with the FMUs of the project."""

from __future__ import annotations

from pathlib import Path

import pytest

import yawbench as yb
from tests.studies import judge_all, judge_some, verdicts
from tests.verdicts import recorded
from yawbench.studies.experiment_result import judge_results
from yawbench.studies.load_experiment import load_experiment
from yawbench.studies.result_tables import run_tables

STUDY = Path(__file__).parents[2] / "scenarios" / "fnn_sideslip" / "study.yaml"
SPEEDS = (15, 25, 40)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The record of the study: its three speeds by three controllers."""
    return judge_some(STUDY, tmp_path_factory.mktemp("study"), "15mps/*", "25mps/*", "40mps/*")


@pytest.fixture(scope="module")
def whole(study):
    """The same with all its runs."""
    return judge_all(STUDY, study["folder"], "--quick")


@pytest.mark.exhaustive
def test_with_one_steering_input_for_all_speeds_the_network_is_lost_at_40_mps(metric_of_all):
    errors = [metric_of_all(f"one_input/{speed}mps/fnn", "error") for speed in (25, 40)]
    assert errors[0] > 0.05
    assert errors[1] > 3.0 > 10 * metric_of_all("one_input/40mps/fuzzy_sideslip", "error")


def test_without_control_the_error_is_what_the_paper_says(metric):
    assert metric("15mps/off", "error") > 1.0
    assert metric("25mps/off", "error") > 2.0
    assert metric("40mps/off", "error") > 2.0


@pytest.mark.parametrize("speed", SPEEDS)
def test_the_network_stays_within_five_per_cent_without_chatter(metric, speed):
    assert metric(f"{speed}mps/fnn", "error") <= 0.05
    assert metric(f"{speed}mps/fnn", "chatter") <= 15e3


@pytest.mark.parametrize("speed", SPEEDS)
def test_conventional_fuzzy_control_lies_between_the_two(metric, speed):
    errors = [metric(f"{speed}mps/{name}", "error") for name in ("fnn", "fuzzy_sideslip", "off")]
    assert errors == sorted(errors)


def test_frozen_weights_bring_twice_the_error_at_15_mps(metric):
    frozen = yb.load(STUDY.with_name("15mps.yaml")).set({"controller.learning": False}).run()
    assert metric("15mps/fnn", "error") <= 0.5 * frozen.metric("relative_peak_error(sideslip)")


@pytest.mark.exhaustive
def test_learning_halves_the_error_of_the_first_period_at_15_mps(metric_of_all):
    learning, frozen = (
        metric_of_all(f"three_periods/15mps/learning_{x}", "period_1") for x in ("true", "false")
    )
    assert learning <= 0.5 * frozen


@pytest.mark.exhaustive
@pytest.mark.parametrize("speed", [15, 25])
def test_learning_goes_on_from_period_to_period(metric_of_all, speed):
    run = f"three_periods/{speed}mps/learning_true"
    assert metric_of_all(run, "period_3") < metric_of_all(run, "period_1")


LOST = {
    "With conventional fuzzy control the largest sideslip error exceeds 10 % at 15 m/s.",
    "With conventional fuzzy control the largest sideslip error exceeds 40 % at 25 m/s.",
    "With conventional fuzzy control the largest sideslip error exceeds 40 % at 40 m/s.",
    "The fuzzy neural network chatters less than conventional fuzzy control at 25 and 40 m/s.",
}
ONE_INPUT = "One steering input for all speeds: "
LOST_WITH_ONE_INPUT_OR_HARSH_STEERING = {
    f"{ONE_INPUT}with conventional fuzzy control the largest sideslip error exceeds 10, 40 and 40 %.",
    f"{ONE_INPUT}with the fuzzy neural network the largest sideslip error is within 5 %.",
    f"{ONE_INPUT}the fuzzy neural network follows the reference "
    "more closely than conventional fuzzy control.",
    "Under harsh steering at 40 m/s learning does no harm.",
}


def test_the_verdicts_are_those_the_page_on_papers_tells(study):
    assert {says for says, verdict in verdicts(study).items() if verdict != "holds"} == LOST
    assert len(verdicts(study)) == 16


@pytest.mark.exhaustive
def test_the_verdicts_of_the_whole_study_are_those_the_page_on_papers_tells(whole):
    assert {says for says, verdict in verdicts(whole).items() if verdict != "holds"} == (
        LOST | LOST_WITH_ONE_INPUT_OR_HARSH_STEERING
    )
    assert len(verdicts(whole)) == len(whole["claims"]) + len(whole["checks"])


def rows(text):
    """Return the cells of the Markdown rows about one of the three speeds and a controller."""
    lines = [line for line in text.splitlines() if line.startswith(("| 15 m/s", "| 25 m/s", "| 40 m/s"))]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [row for row in cells if row[0].endswith(("control", "fuzzy", "network"))]


PAGE = (STUDY.parents[2] / "docs" / "papers.md").read_text(encoding="utf-8")


def test_the_page_on_papers_tells_what_the_study_found(study, metric):
    experiment = load_experiment(STUDY)
    first, *_ = run_tables(judge_results(experiment, study["folder"]))
    told = rows(PAGE)
    assert len(told) == 9
    found = [[cell.removesuffix(" †") for cell in row] for row in first.text()]
    assert [[*row[:3], row[-1]] for row in told] == [
        [row[0], row[1], row[2].partition(" (")[0], row[-1]] for row in found
    ]
    of_runs = [claim.says for claim in experiment.spec.claims if claim.short]
    carries = [list(row[1:]) for row in recorded()[experiment.spec.title] if row.says in of_runs]
    assert [row[3:-1] for row in told] == carries


@pytest.mark.exhaustive
def test_what_became_of_the_laws_with_motors_that_lag_and_tuned_alike(tmp_path):
    found = judge_all(STUDY.with_name("laws.yaml"), tmp_path)
    assert [check["holds"] for check in found["checks"]] == [False, True, True]
    laws = ("fnn", "frozen", "fuzzy_sideslip", "pd")
    cost, lag = (
        {law: found["derived"][f"{of}_{law}"]["value"] for law in laws} for of in ("cost", "lag_cost")
    )
    assert sorted(cost, key=cost.get) == [*laws]
    assert sorted(lag, key=lag.get) == ["fuzzy_sideslip", "frozen", "pd", "fnn"]
    names = ("fuzzy neural network", "frozen weights", "conventional fuzzy", "PD")
    for law, name in zip(laws, names, strict=True):
        for file, runs in (("tuning", "tuned"), ("tuning_with_actuators", "tuned_for_lag")):
            sought = load_experiment(STUDY.with_name(f"{file}.yaml")).spec.tuning.laws[name]
            given = {one["place"]: one["value"] for one in found["runs"][f"{runs}/15mps/{law}"]["changes"]}
            for axis in sought.axes.values():
                assert axis.start <= given[axis.vary[0]] <= axis.end

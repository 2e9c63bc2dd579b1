"""The study of paper A, with the FMUs of the project."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

import yawbench as yb
from docs.generate.papers import SEEDS, numbers_of
from tests.command_line import status_of
from tests.judged_studies import check_figures, judge_all, judge_some, verdicts
from tests.scenarios.recorded_numbers import assert_recorded
from yawbench.components.cars.published_cars import PaperA
from yawbench.studies.claim_schema import si_number
from yawbench.studies.load_experiment import load_experiment
from yawbench.vocabulary.gravity import G

STUDY = Path(__file__).parents[2] / "scenarios" / "fnn_sideslip" / "study.yaml"
SPEEDS = (15, 25, 40)
LIFTS = G * PaperA.track_width / (2 * PaperA.cg_height)
"""Lateral acceleration at which the car's inner wheels lift [m/s2]."""


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The record of the study: its three speeds by three controllers, and the complete learning rule."""
    runs = ("15mps/*", "25mps/*", "40mps/*", "complete_rule/*")
    return judge_some(STUDY, tmp_path_factory.mktemp("study"), *runs)


@pytest.fixture(scope="module")
def whole(study):
    """The same with all its runs."""
    return judge_all(STUDY, study["folder"], "--quick")


@pytest.mark.exhaustive
def test_the_complete_rule_works_at_scales_of_620_to_900_and_not_far_beyond():
    rule = {"controller.set_learning_rate": 2}

    def errors(scale):
        runs = (yb.load(STUDY.with_name(f"{speed}mps.yaml")) for speed in SPEEDS)
        changed = (run.set(rule | {"controller.error_scale": scale}) for run in runs)
        return [run.run().metric("relative_peak_error(sideslip)") for run in changed]

    assert max(errors(620)) <= 0.05
    assert max(errors(900)) <= 0.05
    slow, shaken = errors(500), errors(1100)
    assert slow[0] > 0.05 >= max(slow[1:])
    assert shaken[2] > 0.05 >= max(shaken[:2])


LOST = {
    "With conventional fuzzy control the largest sideslip error exceeds 10 % at 15 m/s.",
    "With conventional fuzzy control the largest sideslip error exceeds 40 % at 25 m/s.",
    "With conventional fuzzy control the largest sideslip error exceeds 40 % at 40 m/s.",
    "The fuzzy neural network chatters less than conventional fuzzy control at 25 and 40 m/s.",
    "The fuzzy neural network keeps the car from understeering.",
    "The fuzzy neural network keeps the car on its path.",
    "Without control the car is in danger of rolling over, with the fuzzy neural network it is not.",
}
ONE_INPUT = "One steering input for all speeds: "
LOST_WITH_ONE_INPUT_OR_HARSH_STEERING = {
    f"{ONE_INPUT}with conventional fuzzy control the largest sideslip error exceeds 10, 40 and 40 %.",
    f"{ONE_INPUT}with the fuzzy neural network the largest sideslip error is within 5 %.",
    f"{ONE_INPUT}the fuzzy neural network follows the reference "
    "more closely than conventional fuzzy control.",
    "Under harsh steering at 40 m/s learning does no harm.",
    "Sharing the moment in proportion to load uses less of the tyres' grip than equal shares.",
    "The fuzzy neural network depends little on the plant.",
}


def test_the_verdicts_are_those_the_page_on_papers_tells(study):
    assert {says for says, verdict in verdicts(study).items() if verdict != "holds"} == LOST
    assert len(verdicts(study)) == 21


@pytest.mark.exhaustive
def test_the_verdicts_of_the_whole_study_are_those_the_page_on_papers_tells(whole):
    assert {says for says, verdict in verdicts(whole).items() if verdict != "holds"} == (
        LOST | LOST_WITH_ONE_INPUT_OR_HARSH_STEERING
    )
    assert len(verdicts(whole)) == len(whole["claims"]) + len(whole["checks"])


def test_the_runs_come_to_what_the_docs_are_made_of(study):
    assert_recorded("A", numbers_of(study["folder"]))


def test_danger_of_rolling_over_is_judged_by_the_acceleration_at_which_wheels_lift():
    claims = load_experiment(STUDY).spec.claims
    (claim,) = (claim for claim in claims if "rolling over" in claim.says)
    assert {si_number(condition.bound, "m/s2") for condition in claim.holds_if} == {round(LIFTS, 2)}


@pytest.mark.exhaustive
def test_the_laws_with_motors_that_lag_and_tuned_alike_are_in_the_order_of_the_docs(tmp_path):
    found = judge_all(STUDY.with_name("laws.yaml"), tmp_path)
    assert [check["holds"] for check in found["checks"]] == [False, False, True, True, True]

    laws = ("fnn", "frozen", "fuzzy_sideslip", "pd")
    cost = {law: found["derived"][f"cost_{law}"]["value"] for law in laws}
    assert sorted(cost, key=cost.get) == [*laws]
    lag = {law: found["derived"][f"lag_cost_{law}"]["value"] for law in laws}
    order = ("fuzzy_sideslip", "frozen", "pd", "fnn")
    assert sorted(lag, key=lag.get) == [*order]
    for law, name in zip(
        laws, ("fuzzy neural network", "frozen weights", "conventional fuzzy", "PD"), strict=True
    ):
        for file, runs in (("tuning", "tuned"), ("tuning_with_actuators", "tuned_for_lag")):
            sought = load_experiment(STUDY.with_name(f"{file}.yaml")).spec.tuning.laws[name]
            given = {one["place"]: one["value"] for one in found["runs"][f"{runs}/15mps/{law}"]["changes"]}
            for axis in sought.axes.values():
                assert axis.start <= given[str(axis.vary[0])] <= axis.end


@pytest.mark.exhaustive
@pytest.mark.parametrize("tuning", ["tuning", "tuning_with_actuators"])
def test_the_recorded_objectives_of_other_seeds_are_what_a_search_finds(tuning, tmp_path):
    seed = 2
    with SEEDS.open(encoding="utf-8", newline="") as lines:
        rows = [row for row in csv.DictReader(lines) if (row["tuning"], row["seed"]) == (tuning, str(seed))]
    assert status_of("tune", STUDY.with_name(f"{tuning}.yaml"), "--seed", seed, "--out", tmp_path) == 0
    with (tmp_path / "trials.csv").open(encoding="utf-8", newline="") as lines:
        trials = [row for row in csv.DictReader(lines) if row["objective"]]
    for row in rows:
        least = min(float(trial["objective"]) for trial in trials if trial["law"] == row["law"])
        assert least == pytest.approx(float(row["objective"]), rel=1e-4)


@pytest.mark.exhaustive
def test_all_figures_are_drawn(whole):
    check_figures(
        whole, "15mps", "25mps", "40mps", "one_input_40mps", "25mps_wheel_torques", "lateral_forces_15mps",
        "lateral_forces_25mps", "lateral_forces_40mps", "complete_rule", "learning_15mps", "learning_25mps",
        "harsh",
    )  # fmt: skip

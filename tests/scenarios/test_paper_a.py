"""The study of paper A, with the FMUs of the project."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

import yawbench as yb
from docs.generate.papers import SEEDS, numbers_of
from tests.judged_studies import check_figures, judge_all, judge_some, verdicts
from tests.scenarios.recorded_numbers import assert_recorded
from yawbench.cli import main
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
def test_so_it_does_by_the_papers_complete_learning_rule(metric, speed):
    assert metric(f"complete_rule/{speed}mps", "error") <= 0.05
    assert metric(f"complete_rule/{speed}mps", "chatter") <= 15e3


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


@pytest.mark.parametrize("speed", SPEEDS)
def test_control_of_the_sideslip_takes_the_car_off_its_yaw_rate_and_path(metric, speed):
    run, off = f"{speed}mps/fnn", f"{speed}mps/off"
    assert metric(run, "yaw_rate") < 0.9 * metric(run, "yaw_rate_ref")
    assert metric(run, "path") > metric(off, "path")


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
def test_unknown_at_15_mps_the_lighter_car_is_the_hardest(whole, metric_of_all):
    errors = {run: metric_of_all(run, "error") for run in whole["runs"] if run.startswith("unknown/15mps/")}
    assert max(errors, key=errors.get) == "unknown/15mps/lighter"


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
    with pytest.raises(SystemExit) as ended:
        main(["tune", str(STUDY.with_name(f"{tuning}.yaml")), "--seed", str(seed), "--out", str(tmp_path)])
    assert not ended.value.code
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

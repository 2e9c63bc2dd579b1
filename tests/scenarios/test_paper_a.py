"""The study of paper A, with the FMUs of the project."""

from __future__ import annotations

from pathlib import Path

import pytest

import yawbench as yb
from tests.judged_studies import check_figures, judge_all, judge_some, verdicts
from tests.refusals import sentence_has
from tests.verdicts import recorded
from yawbench.components.cars.published_cars import PaperA
from yawbench.figures.display import shown
from yawbench.studies.claim_schema import si_number
from yawbench.studies.experiment_result import judge_results
from yawbench.studies.load_experiment import load_experiment
from yawbench.studies.result_tables import run_tables
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


def rows(text):
    """Return the cells of the Markdown rows about one of the three speeds and a controller."""
    lines = [line for line in text.splitlines() if line.startswith(("| 15 m/s", "| 25 m/s", "| 40 m/s"))]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [row for row in cells if row[0].endswith(("control", "fuzzy", "network"))]


PAGE = (STUDY.parents[2] / "docs" / "papers.md").read_text(encoding="utf-8")
PROSE = " ".join(PAGE.partition("## Paper A")[2].partition("\n## ")[0].split())


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
    over = [100 * metric(f"{speed}mps/fuzzy_sideslip", "overshoot") for speed in (15, 40)]
    assert sentence_has(PROSE, f"{over[0]:.0f}", f"{over[1]:.1f} %", "grows")
    complete = [f"{100 * metric(f'complete_rule/{speed}mps', 'error'):.2f}" for speed in SPEEDS]
    assert sentence_has(PROSE, complete[0], complete[1], f"{complete[2]} %", "complete", "750")
    turned = [f"{100 * study['derived'][f'yaw_{speed}']['value']:.0f}" for speed in SPEEDS]
    assert sentence_has(PROSE, turned[0], turned[1], f"{turned[2]} %", "yaw", "rate")
    for law in ("fnn", "off"):
        aside = [f"{100 * metric(f'{speed}mps/{law}', 'path'):.1f}" for speed in SPEEDS]
        assert sentence_has(PROSE, aside[0], aside[1], f"{aside[2]} %", "path")
    acceleration = max(metric(f"{speed}mps/off", "lateral") for speed in SPEEDS)
    assert sentence_has(PROSE, f"{acceleration:.1f} m/s²", "acceleration", f"{LIFTS:.1f}")


def test_danger_of_rolling_over_is_judged_by_the_acceleration_at_which_wheels_lift():
    claims = load_experiment(STUDY).spec.claims
    (claim,) = (claim for claim in claims if "rolling over" in claim.says)
    assert {si_number(condition.bound, "m/s2") for condition in claim.holds_if} == {round(LIFTS, 2)}


@pytest.mark.exhaustive
def test_the_page_on_papers_tells_what_the_variants_of_the_study_found(whole, metric_of_all):
    learning, frozen = (
        [f"{100 * metric_of_all(f'three_periods/15mps/{run}', f'period_{k}'):.1f}" for k in (1, 3)]
        for run in ("learning_true", "learning_false")
    )
    assert sentence_has(PROSE, f"{' to '.join(learning)} %", "error", "falls")
    assert sentence_has(PROSE, f"{' to '.join(frozen)} %", "frozen", "weights")
    harm, calm, recalled = (
        f"{100 * metric_of_all(f'harsh/{run}', 'error'):.0f} %"
        for run in ("learning_true", "learning_false", "recall")
    )
    assert sentence_has(PROSE, harm, calm, "error", "reaches")
    assert sentence_has(PROSE, recalled, "holds")
    net_25, fuzzy_25, net_40, fuzzy_40 = (
        shown(metric_of_all(f"one_input/{run}", "error"), "%")
        for run in ("25mps/fnn", "25mps/fuzzy_sideslip", "40mps/fnn", "40mps/fuzzy_sideslip")
    )
    assert sentence_has(PROSE, net_25, fuzzy_25, net_40, fuzzy_40, "25", "40", "conventional")
    saved = [f"{100 * whole['derived'][f'grip_{speed}']['value']:.1f}" for speed in SPEEDS]
    assert sentence_has(PROSE, saved[0], saved[1], f"{saved[2]} %", "tyres")
    unknown = {
        speed: max(
            metric_of_all(run, "error") for run in whole["runs"] if run.startswith(f"unknown/{speed}mps/")
        )
        for speed in (15, 40)
    }
    assert unknown[15] == metric_of_all("unknown/15mps/lighter", "error")
    assert sentence_has(PROSE, f"{100 * unknown[15]:.1f} %", f"{100 * unknown[40]:.1f} %", "plant", "lighter")


@pytest.mark.exhaustive
def test_the_page_on_papers_tells_what_became_of_the_laws_with_motors_that_lag_and_tuned_alike(tmp_path):
    found = judge_all(STUDY.with_name("laws.yaml"), tmp_path)
    assert [check["holds"] for check in found["checks"]] == [False, False, True, True, True]

    def error(run):
        return found["runs"][run]["metrics"]["error"]["value"]

    lost = [shown(error(f"lag/{speed}mps/learning_true"), "%") for speed in (25, 40)]
    complete = shown(error("lag/40mps/complete_rule"), "%")
    assert sentence_has(PROSE, lost[0], lost[1], "25", "error", complete, "complete")
    for runs in ("lag/{}mps/slowly", "tuned_for_lag/{}mps/fnn"):
        errors = [100 * error(runs.format(speed)) for speed in SPEEDS]
        assert sentence_has(PROSE, f"{min(errors):.1f}", f"{max(errors):.1f} %", "network")
    laws = ("learning_false", "fuzzy_sideslip")
    held = [100 * error(f"lag/{speed}mps/{law}") for speed in (15, 25, 40) for law in laws]
    assert sentence_has(PROSE, f"{min(held):.1f}", f"{max(held):.1f} %")
    assert sentence_has(PROSE, shown(error("slow/40mps/fuzzy_sideslip"), "%"), "40")
    laws = ("fnn", "frozen", "fuzzy_sideslip", "pd")
    cost = {law: found["derived"][f"cost_{law}"]["value"] for law in laws}
    assert sorted(cost, key=cost.get) == [*laws]
    told = [shown(cost[law], "%").removesuffix(" %") for law in laws]
    assert sentence_has(PROSE, f"{told[0]} %", told[1], "network", "frozen")
    assert sentence_has(PROSE, told[2], told[3], "PD", "conventional")
    lag = {law: found["derived"][f"lag_cost_{law}"]["value"] for law in laws}
    order = ("fuzzy_sideslip", "frozen", "pd", "fnn")
    assert sorted(lag, key=lag.get) == [*order]
    told = [shown(lag[law], "%").removesuffix(" %") for law in order]
    assert sentence_has(PROSE, f"{told[0]} %", told[1], told[2], "PD", "conventional")
    assert sentence_has(PROSE, told[3], "network")
    for law, name in zip(
        laws, ("fuzzy neural network", "frozen weights", "conventional fuzzy", "PD"), strict=True
    ):
        for file, runs in (("tuning", "tuned"), ("tuning_with_actuators", "tuned_for_lag")):
            sought = load_experiment(STUDY.with_name(f"{file}.yaml")).spec.tuning.laws[name]
            given = {one["place"]: one["value"] for one in found["runs"][f"{runs}/15mps/{law}"]["changes"]}
            for axis in sought.axes.values():
                assert axis.start <= given[str(axis.vary[0])] <= axis.end


@pytest.mark.exhaustive
def test_all_figures_are_drawn(whole):
    check_figures(
        whole, "15mps", "25mps", "40mps", "one_input_40mps", "25mps_wheel_torques", "lateral_forces_15mps",
        "lateral_forces_25mps", "lateral_forces_40mps", "complete_rule", "learning_15mps", "learning_25mps",
        "harsh",
    )  # fmt: skip

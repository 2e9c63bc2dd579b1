"""Studies of the papers and of the laws of the field, in the first tier some of their runs.

All runs, with the regions of the claims, are made by test_verdicts.py.
"""

from __future__ import annotations

import csv
from functools import cache

import numpy as np
import pytest

import yawbench as yb
from docs.generate.papers import SCENARIOS, SEEDS, recorded, study_of
from tests.changed import changed
from tests.command_line import status_of
from tests.judged_studies import judge_all, judge_some
from tests.scenarios.recorded_numbers import assert_recorded
from yawbench.components.cars.published_cars import PaperA
from yawbench.components.control_laws.sideslip_bound import PER_FRICTION, sideslip_bound
from yawbench.metrics.expressions import MetricValue
from yawbench.orchestrator.results.reader import load_results
from yawbench.studies.claim_schema import si_number
from yawbench.studies.experiment_result import derive
from yawbench.studies.jobs import Job, execute
from yawbench.studies.load_experiment import load_experiment
from yawbench.vocabulary.gravity import G

ROADS_OF_C = ("double_lane_change", "sine", "ramp")
ROADS_OF_B = ("high_friction", "low_friction")
SOME = {
    "A": (21, ["15mps/*", "25mps/*", "40mps/*", "complete_rule/*"]),
    "B": (
        9,
        [
            *(f"{road}/{law}" for road in ROADS_OF_B for law in ("off", "sign", "saturation", "fuzzy")),
            *("beyond_paper/off", "beyond_paper/fuzzy", "sliding/weight_0.25", "grip/6000_0.03/*"),
            *("rear_grip/0.285", "every_road/0.5/fuzzy"),
        ],
    ),
    "C": (8, [f"{road}/{law}" for road in ROADS_OF_C[:2] for law in ("off", "pid", "fuzzy_pid")]),
    "D": (
        10,
        ["off", "both", "yaw_rate_alone", "sideslip_alone", "linear_tyre/off", "unlimited/fuzzy_feedback"],
    ),
    "internal_model": (1, ["step/known/internal_model", "wind/internal_model"]),
    "integral_sliding_mode": (0, ["heavier/integral"]),
    "super_twisting": (0, ["prompt/high/super_twisting"]),
}
"""Study -> how many claims and checks are decided by the runs that are made, and these."""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return the record of a study of which some runs are made."""
    return cache(lambda name: judge_some(study_of(name).path, tmp_path_factory.mktemp(name), *SOME[name][1]))


@pytest.mark.parametrize("name", SOME)
def test_the_runs_come_to_the_numbers_and_verdicts_that_the_docs_are_made_of(made, name):
    study = made(name)
    assert_recorded(name, study)
    judged = [one for one in (*study["claims"], *study["checks"]) if one["holds"] is not None]
    assert len(judged) == SOME[name][0]


def test_the_brakes_of_paper_c_stay_within_their_limits(made):
    for road in ROADS_OF_C[:2]:
        results = load_results(made("C")["folder"] / road / "fuzzy_pid")
        pressures = np.array([results[f"wheel_control.brake_pressure_{w}"] for w in ("fl", "fr", "rl", "rr")])
        assert pressures.min() >= 0.0
        assert 3e5 < pressures.max() < 1e7  # braked, but not to the limit


def test_danger_of_rolling_over_is_judged_by_the_acceleration_at_which_wheels_lift():
    (claim,) = (claim for claim in study_of("A").spec.claims if "rolling over" in claim.says)
    lifts = G * PaperA.track_width / (2 * PaperA.cg_height)
    assert {si_number(condition.bound, "m/s2") for condition in claim.holds_if} == {round(lifts, 2)}


def test_every_road_is_judged_by_paper_bs_bound_of_the_sideslip():
    (claim,) = (one for one in study_of("B").spec.claims if one.says.endswith("on every road."))
    road = {"high_friction": 1.0, "low_friction": 0.3}
    for condition in claim.holds_if:
        name = condition.run.split("/")
        friction = float(name[1]) if name[0] == "every_road" else road[name[0]]
        assert si_number(condition.bound, "rad") == pytest.approx(
            sideslip_bound(friction, PER_FRICTION), rel=2e-3
        )


# Paper A: learning, and laws tuned alike


@pytest.mark.exhaustive
def test_the_complete_rule_works_at_scales_of_620_to_900_and_not_far_beyond():
    def errors(scale):
        rule = {"controller.set_learning_rate": 2, "controller.error_scale": scale}
        runs = (yb.load(f"fnn_sideslip/{speed}mps").set(rule).run() for speed in (15, 25, 40))
        return [run.metric("relative_peak_error(sideslip)") for run in runs]

    assert max(errors(620)) <= 0.05
    assert max(errors(900)) <= 0.05
    slow, shaken = errors(500), errors(1100)
    assert slow[0] > 0.05 >= max(slow[1:])
    assert shaken[2] > 0.05 >= max(shaken[:2])


LAWS = {
    "fnn": "fuzzy neural network",
    "frozen": "frozen weights",
    "fuzzy_sideslip": "conventional fuzzy",
    "pd": "PD",
}


def test_the_laws_with_motors_that_lag_and_tuned_alike_are_in_the_order_of_the_docs():
    study, derived = study_of("laws"), recorded()["laws"].derived
    assert sorted(LAWS, key=lambda law: derived[f"cost_{law}"]) == [*LAWS]
    lagging = sorted(LAWS, key=lambda law: derived[f"lag_cost_{law}"])
    assert lagging == ["fuzzy_sideslip", "frozen", "pd", "fnn"]
    for law, name in LAWS.items():
        for file, runs in (("tuning", "tuned"), ("tuning_with_actuators", "tuned_for_lag")):
            sought = load_experiment(study.path.with_name(f"{file}.yaml")).spec.tuning.laws[name]
            assert_within_ranges(sought, study, f"{runs}/15mps/{law}")


def assert_within_ranges(sought, study, run):
    """Assert that a run of a study has parameters that a search could find."""
    (case,) = (case for case in study.cases if case.run.name == run)
    given = {str(change.target): change.value for change in case.changes}
    for axis in sought.axes.values():
        assert axis.start <= given[str(axis.vary[0])] <= axis.end


@pytest.mark.exhaustive
@pytest.mark.parametrize("tuning", ["tuning", "tuning_with_actuators"])
def test_the_recorded_objectives_of_other_seeds_are_what_a_search_finds(tuning, tmp_path):
    with SEEDS.open(encoding="utf-8", newline="") as lines:
        rows = [row for row in csv.DictReader(lines) if (row["tuning"], row["seed"]) == (tuning, "2")]
    file = SCENARIOS / "fnn_sideslip" / f"{tuning}.yaml"
    assert status_of("tune", file, "--seed", 2, "--out", tmp_path) == 0
    with (tmp_path / "trials.csv").open(encoding="utf-8", newline="") as lines:
        trials = [row for row in csv.DictReader(lines) if row["objective"]]
    for row in rows:
        least = min(float(trial["objective"]) for trial in trials if trial["law"] == row["law"])
        assert least == pytest.approx(float(row["objective"]), rel=1e-4)


# Paper C: tuning, and how near the sine is to losing the car


@pytest.mark.exhaustive
def test_the_gains_of_paper_c_are_those_that_tuning_prefers(made):
    spec = load_experiment(SCENARIOS / "fuzzy_pid" / "tuning.yaml").spec
    whole = judge_all(study_of("C").path, made("C")["folder"], "--quick")

    def cost(controller):
        values = {}
        for run, of in (("off", "off"), ("tuned", controller)):
            for road in ROADS_OF_C:
                for key, found in whole["runs"][f"{road}/{of}"]["metrics"].items():
                    values[f"{road}/{run}", key] = MetricValue(found["value"], found["unit"])
        return derive(spec, values)[spec.tuning.objective].number

    assert cost("off") == pytest.approx(1.0)
    assert cost("pid_tuned") < cost("fuzzy_pid") < cost("pid")
    assert cost("fuzzy_pid_tuned") == pytest.approx(cost("pid_tuned"), abs=0.01)
    for controller, law in (("pid", "PID"), ("fuzzy_pid", "fuzzy PID")):
        assert_within_ranges(spec.tuning.laws[law], study_of("C"), f"sine/{controller}_tuned")


def sines(folder, **settings):
    """Return what is recorded of the sine of paper C with changes, run by run."""
    (folder / "sines").mkdir()
    file = SCENARIOS / "fuzzy_pid" / "sine.yaml"
    record = ("plant.yaw_rate", "plant.sideslip")
    jobs = [Job(name, file, folder / "sines" / name, of, record=record) for name, of in settings.items()]
    assert [outcome.diagnostics for outcome in execute(jobs)] == [()] * len(jobs)
    return [load_results(job.out) for job in jobs]


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("controller", "amplitude", "most"),
    [
        ("off", 1.4, 1e-4),
        ("off", 1.5, 2e-4),  # near the steering that loses the car, where every difference grows
        ("fuzzy_pid", 1.5, 2.5e-3),  # a step that the brakes are switched later, at 3.2 s
    ],
)
def test_the_coupling_error_of_the_sine_at_1_ms_is_small(tmp_path, controller, amplitude, most):
    swaps, steered = [f"controller=controller_{controller}"], [f"driver.amplitude={amplitude}"]
    steps = {f"by_{part}": changed(swaps, steered, stop_time=6, step_size=0.001 / part) for part in (1, 4)}
    coarse, fine = (results["plant.yaw_rate"] for results in sines(tmp_path, **steps))
    error = np.max(np.abs(coarse - fine[::4])) * 4 / 3  # the fine run's own, of first order, counted in
    assert 0.0 < error / np.max(np.abs(fine)) <= most


@pytest.mark.exhaustive
def test_under_a_tenth_more_steering_the_sine_loses_the_car_without_control_alone(tmp_path):
    settings = {
        law: changed([f"controller=controller_{law}"], ["driver.amplitude=1.65"])
        for law in ("off", "pid", "fuzzy_pid")
    }
    settings["near"] = changed(["controller=controller_off"], ["driver.amplitude=1.6"])
    settings["dry"] = changed(["controller=controller_off"], ["tyre.low_friction=scale"])  # its weights
    runs = sines(tmp_path, **settings)
    off, *held, near, dry = (np.degrees(np.max(np.abs(run["plant.sideslip"]))) for run in runs)
    assert off > 90.0
    assert max(held) < 2.5
    assert (near, dry) == pytest.approx((4.85, 2.48), abs=0.02)  # as docs/theory/paper_c.md says

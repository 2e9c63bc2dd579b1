"""Tunings from Python: the search of the command, and parameters of plain Python."""

from __future__ import annotations

import csv
import functools
import warnings
from dataclasses import dataclass

import pytest

import yawbench as yb
from tests.command_line import status_of
from tests.refusals import refused

SMALL = {"population": 5, "generations": 2, "workers": 1}
ERROR, EFFORT = "rms_error(yaw_rate)", "effort(yaw_moment)"
TUNING = """
title: A gain
runs: [{{name: it, scenario: "{scenario}", swap: {{controller: controller_pid}}, set: {{stop_time: 1.2}}}}]
metrics: {{error: {{metric: rms_error(yaw_rate)}}}}
derived: {{cost: {{says: The error, expression: error, of: {{error: {{run: it, metric: error}}}}}}}}
tuning:
  objective: cost
  population: 5
  generations: 2
  seed: 3
  laws: {{PID: {{axes: {{gain: {{vary: controller.yaw_rate_proportional_gain, {range}, spacing: log}}}}}}}}
"""


@pytest.fixture(scope="module")
def base():
    return yb.load("fnn_sideslip/25mps").set({"stop_time": 1.2})


def follow(yaw_rate_ref, yaw_rate, gain=2e4):
    return gain * (yaw_rate_ref - yaw_rate)


class Law:
    inputs, outputs = ("yaw_rate_ref", "yaw_rate"), ("yaw_moment",)

    def __init__(self, gain):
        self.gain = gain

    def output(self, t, u):
        return self.gain * (u.yaw_rate_ref - u.yaw_rate)


@dataclass
class Data:
    inputs, outputs = ("yaw_rate_ref", "yaw_rate"), ("yaw_moment",)
    gain: float = yb.parameter(2e4, "N.m.s/rad", "Moment per yaw-rate error", minimum=0.0)

    def output(self, t, u):
        return self.gain * (u.yaw_rate_ref - u.yaw_rate)


def test_the_trials_are_those_of_the_command(tmp_path):
    scenario = yb.load("fuzzy_pid/sine").swap(controller="controller_pid")
    (tmp_path / "tuning.yaml").write_text(TUNING.format(scenario=scenario.path, range="from: 1e4, to: 1e6"))
    assert status_of("tune", tmp_path / "tuning.yaml", "--out", tmp_path / "out") == 0
    rows = list(csv.DictReader((tmp_path / "out" / "trials.csv").open()))
    target = "controller.yaw_rate_proportional_gain"
    tuned = yb.tune(scenario.set({"stop_time": 1.2}), {target: (1e4, 1e6, "log")}, ERROR, seed=3, **SMALL)
    assert tuned.table[target].tolist() == [float(row[target]) for row in rows]
    assert tuned.table["objective"].tolist() == [float(row["objective"]) for row in rows]
    assert tuned.table["generation"].tolist() == [1] * 5 + [2] * 5


@pytest.mark.parametrize("law", [follow, Law(2e4), Data()], ids=["function", "object", "data"])
def test_parameters_of_plain_python_are_tuned(base, law):
    scenario = base.swap(controller=law)
    tuned = yb.tune(scenario, {"controller.gain": (1e3, 1e5, "log")}, ERROR, **{**SMALL, "generations": 1})
    gain = tuned.values["controller.gain"]
    assert tuned.table["controller.gain"].nunique() == 5
    assert tuned.table["controller.gain"].between(1e3, 1e5).all()
    assert tuned.objective == tuned.table["objective"].min()
    made = functools.partial(law, gain=gain) if callable(law) else type(law)(gain)
    for again in (scenario.set(tuned.values), base.swap(controller=made)):
        assert again.run().metric(ERROR) == tuned.objective


def test_the_objective_is_a_weighted_sum_averaged_over_scenarios(base, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenarios = [base.swap(controller=Law(1e4)), base.swap(controller=Law(1e4)).set({"speed": "70 km/h"})]
    weights = {ERROR: 2.0, EFFORT: -1e-6}
    ranges = {"controller.gain": (1e3, 1e5), "driver.amplitude": ("1 deg", "2 deg")}
    tuned = yb.tune(scenarios, ranges, weights, **SMALL)
    assert list(tmp_path.iterdir()) == []  # nothing is written
    assert str(tuned.values["driver.amplitude"]).endswith(" deg")
    runs = [each.set(tuned.values).run() for each in scenarios]
    costs = [sum(weight * run.metric(name) for name, weight in weights.items()) for run in runs]
    assert tuned.objective == pytest.approx(sum(costs) / 2, rel=1e-12)
    assert tuned.plot().axes[0].get_title("left") == f"2 {ERROR} + -1e-06 {EFFORT}, mean of 2 scenarios"


def test_one_seed_gives_one_search(base):
    scenario, ranges = base.swap(controller=follow), {"controller.gain": (1e3, 1e5)}
    first, again, other = (
        yb.tune(scenario, ranges, ERROR, seed=seed, **{**SMALL, "workers": workers}).table
        for seed, workers in ((1, 1), (1, 2), (2, 2))
    )
    assert first.equals(again)
    assert not first.equals(other)


def test_trials_that_fail_are_counted_and_lose(base):
    def fragile(yaw_rate_ref, yaw_rate, gain=2e4):
        return gain * (yaw_rate_ref - yaw_rate) if gain < 5e4 else 1.0 / (gain - gain)

    ranges = {"controller.gain": (1e3, 1e5)}
    with pytest.warns(yb.YawbenchWarning, match=r"\d of 10 runs failed: .*ZeroDivisionError") as warned:
        tuned = yb.tune(base.swap(controller=fragile), ranges, ERROR, **SMALL)
    assert [warning.filename for warning in warned] == [__file__]
    assert float(tuned.values["controller.gain"]) < 5e4
    assert 0 < tuned.table["objective"].isna().sum() < 10
    with (
        refused(yb.ResultsError, "results-missing", names=("0 s", "ZeroDivisionError")),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore", yb.YawbenchWarning)
        yb.tune(base.swap(controller=fragile), {"controller.gain": (6e4, 7e4)}, ERROR, **SMALL)


def test_scenarios_with_two_programs_of_a_name_are_refused(base):
    both = [base.swap(controller=Law(1e4)), base.swap(controller=Law(2e4))]
    with refused(yb.ScenarioError, "argument-invalid", names=("base[1]", "'Law'")):
        yb.tune(both, {"driver.amplitude": (0.01, 0.02)}, ERROR)


@pytest.mark.parametrize(
    ("ranges", "names"),
    [
        ({"controller.gain": (2e4, 1e4)}, ("ranges['controller.gain']", "20000", "10000")),
        ({"controller.gain": (-1e4, 1e4, "log")}, ("ranges['controller.gain']", "0", "log")),
        ({"controller.gain": (1e4, "20 N.m")}, ("ranges['controller.gain']", "unit")),
        ({"controller.gain": (1e4, True)}, ("ranges['controller.gain']", "number", "True")),
        ({"controller.gian": (1e4, 2e4)}, ("controller.gian=15000.0", "'gian'", "'gain'")),
        ({"controller": ("controller_off", "controller_pid")}, ("ranges['controller']", "'controller_pid'")),
        ({"stop_time": (-2, -1)}, ("stop_time=-1.5", "0 s")),
    ],
)
def test_wrong_ranges_are_refused_before_a_run(base, ranges, names, monkeypatch):
    monkeypatch.setattr("yawbench._experiment.make_all", None)
    with refused(yb.ScenarioError, names=names):
        yb.tune(base.swap(controller=follow), ranges, ERROR)


@pytest.mark.parametrize(
    ("objective", "names"),
    [
        ("rms_eror(yaw_rate)", ("'rms_eror'", "'rms_error'")),
        ("peak(nothing)", ("metrics.peak(nothing)", "fnn_sideslip/25mps.yaml")),
    ],
)
def test_what_is_no_metric_is_refused_by_name(base, objective, names):
    with refused(yb.ScenarioError, names=(objective, *names)):
        yb.tune(base, {"driver.amplitude": (0.01, 0.02)}, objective)

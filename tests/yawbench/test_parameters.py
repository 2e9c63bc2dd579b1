"""Parameters of plain Python: of functions, objects and dataclasses, wherever a scenario takes values."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest

import yawbench as yb
from tests.refusals import refused
from tests.yawbench.laws import Data, Law, powers


@pytest.fixture(scope="module")
def base():
    return yb.load("fnn_sideslip/25mps").set({"stop_time": 1.2})


def law(yaw_rate_ref, yaw_rate, gain=20000, limit=1e4, things: int = 3):
    return max(-limit, min(limit, gain * (yaw_rate_ref - yaw_rate)))


KINDS = {
    "a function": law,
    "a partial function": functools.partial(law, gain=2e4),
    "an object": Law(2e4),
    "a dataclass": Data(2e4),
}


def moments(scenario: yb.Scenario) -> np.ndarray:
    return scenario.run()["controller.yaw_moment"]


@pytest.mark.parametrize("what", KINDS)
def test_a_parameter_that_is_set_counts_as_if_python_had_been_given_it(what, base, monkeypatch):
    doubled = {
        "a function": lambda yaw_rate_ref, yaw_rate: law(yaw_rate_ref, yaw_rate, gain=4e4),
        "a partial function": lambda yaw_rate_ref, yaw_rate: law(yaw_rate_ref, yaw_rate, gain=4e4),
        "an object": Law(4e4),
        "a dataclass": Data(4e4),
    }[what]
    changed = base.swap(controller=KINDS[what]).set({"controller.gain": 4e4})
    wanted = moments(base.swap(controller=doubled))
    run = changed.run()
    assert run.record["fmus"]["controller"]["runs_as"] == "native"
    assert np.array_equal(run["controller.yaw_moment"], wanted)
    monkeypatch.setenv("YAWBENCH_UNITS", "python")
    assert np.array_equal(moments(changed), wanted)
    assert not np.array_equal(moments(base.swap(controller=KINDS[what])), wanted)


class Counted:
    """Controller that counts its starts."""

    inputs, outputs = ("yaw_rate",), ("yaw_moment",)

    def __init__(self, gain: float = 1e4) -> None:
        self.gain, self.starts = gain, 0

    def start(self, t, u):
        self.starts += 1

    def output(self, t, u):
        return -self.gain * u.yaw_rate + self.starts


@pytest.mark.parametrize("units", ["native", "python"])
def test_an_object_is_started_once_however_often_outputs_are_read_before(units, base, monkeypatch, tmp_path):
    monkeypatch.setenv("YAWBENCH_UNITS", units)
    exported = yb.export_fmu(Counted(), tmp_path / "controller_counted.fmu")
    for program in (Counted(), exported):
        run = base.swap(controller=program).run()
        assert run["controller.yaw_moment"][0] == 1.0 - 1e4 * run["plant.yaw_rate"][0]
        assert (run.record["fmus"]["controller"]["runs_as"] == "native") == (units == "native")


def variables(program: Any) -> dict[str, Any]:
    scenario = yb.load("fnn_sideslip/25mps").swap(controller=program)
    (unit,) = (unit for unit in scenario.plan().instances if unit.name == "controller")
    return {v.name: v for v in unit.fmu.of("parameter")}


def test_types_units_limits_and_choices_are_those_that_python_declares():
    of_function, of_data = variables(law), variables(Data())
    assert {name: (v.type, v.start) for name, v in of_function.items()} == {
        "gain": ("Real", 20000.0), "limit": ("Real", 1e4), "things": ("Integer", 3),
    }  # fmt: skip
    assert of_function["gain"].unit is None
    assert (of_data["gain"].unit, of_data["gain"].minimum) == ("N.m.s/rad", 0.0)
    assert of_data["kind"].choices == ("whole", "half")
    assert set(variables(Law(1.0))) == {"gain", "bias"}


def test_what_python_does_not_know_as_a_number_is_left_as_it_is(base):
    def held(yaw_rate, gain=1e3, limit=float("inf"), table=None):
        return -gain * yaw_rate if table is None else 0.0

    assert set(variables(held)) == {"gain"}
    assert np.any(moments(base.swap(controller=held)))


def test_a_whole_number_stays_whole_in_python(base):
    scenario = base.swap(controller=powers)
    assert [moments(s)[-1] for s in (scenario, scenario.set({"controller.count": 4}))] == [111.0, 1111.0]


def test_an_object_that_was_changed_after_it_was_made_has_no_parameters(base):
    changed = Law(2e4)
    changed.half = 5.0
    with refused(yb.WiringError, "parameter-unknown", names=("controller.gain=1.0", "Law", "'gain'")):
        base.swap(controller=changed).set({"controller.gain": 1.0}).plan()
    assert np.array_equal(moments(base.swap(controller=changed)), moments(base.swap(controller=Law(10.0))))


def test_values_outside_the_declared_ones_are_refused(base):
    scenario = base.swap(controller=Data())
    for target, value, *names in (
        ("controller.gain", -1, "0 N.m.s/rad"),
        ("controller.kind", "third", "whole", "half"),
        ("controller.gian", 1, "'gian'", "'gain'"),
    ):
        with refused(yb.WiringError, names=(f"{target}={value}", *names)):
            scenario.set({target: value}).plan()


def test_what_python_was_given_counts_more_than_the_vehicle_file(base):
    def heavy(yaw_rate, mass=5000.0, speed_gain=1.0):
        return mass

    assert moments(base.swap(controller=heavy))[-1] == 5000.0
    assert moments(base.swap(controller=heavy).set({"controller.mass": 7.0}))[-1] == 7.0
    with refused(yb.YawbenchError, names=("controller.mass", "parameter")):  # the network has none
        base.set({"controller.mass": 7.0}).swap(controller=heavy)


def test_two_objects_of_a_class_and_their_parameters_are_axes(base):
    axes = {"controller": {"low": Law(1e4), "high": Law(3e4)}, "controller.bias": [0.0, 50.0]}
    runs = yb.experiment(base, axes, metrics=["peak(yaw_moment)"]).run(workers=1)
    assert runs.table["controller"].tolist() == ["low", "low", "high", "high"]
    biases = runs.table["controller.bias"]
    for name, bias, run in zip(runs.table["controller"], biases, runs.runs, strict=True):
        alone = (
            base.swap(controller=Law({"low": 1e4, "high": 3e4}[name])).set({"controller.bias": bias}).run()
        )
        assert np.array_equal(run["controller.yaw_moment"], alone["controller.yaw_moment"])
    assert runs.table["peak(yaw_moment)"].nunique() == 4


def test_programs_of_one_name_in_two_instances_are_two(base):
    scenario = base.swap(controller=lambda yaw_rate: 7.0, driver=lambda t: 0.01 if t > 0.5 else 0.0)
    run = scenario.run()
    assert (run["controller.yaw_moment"][-1], run["driver.steer_angle"][-1]) == (7.0, 0.01)


class Slow(Law):
    step_size = 0.1


def test_objects_of_a_class_are_ranked_by_their_names_with_their_sampling_times(tmp_path):
    out = tmp_path / "ranking"
    laws = {"weak": Law(1e3), "strong": Law(1e5), "slow": Slow(1e5)}
    places = yb.rank(laws, against=["none"], conditions=["hard"], quick=True, out=out)
    headroom = places.cells.set_index("entry")["headroom"]
    assert set(headroom.index) == {*laws, "none"}
    assert headroom.nunique() == 4
    runs = yb.open(out).runs.values()
    assert {run.results.record.fmus["controller"].step_size for run in runs} >= {0.1, 0.005}
    other = yb.rank({"weak": Law(1e5)}, against=[], conditions=["hard"], quick=True, out=out)
    assert other.cells["headroom"].tolist() == [headroom["strong"]]  # not the kept run of the first one
    with refused(yb.ScenarioError, "argument-invalid", names=("name", "mapping")):
        yb.rank(laws, name="both", against=[], conditions=["hard"], quick=True)

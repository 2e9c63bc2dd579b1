"""Sweep files: what they may say, what is refused, and the points and plans they come to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.changed import changed
from tests.refusals import mentions, refused, texts_of
from tests.studies.experiment_files import written
from yawbench.foundation.errors import ScenarioError
from yawbench.studies.axes import AxisSpec, level_at
from yawbench.studies.experiment import plan_experiment
from yawbench.studies.load_experiment import load_experiment


def planned_of(experiment, fmus):
    """Return an experiment with all cases planned."""
    return plan_experiment(experiment, Path("runs"), fmus=fmus)


UNITS = ("driver_sine", "reference_steady_state", "controller_off", "controller_fuzzy_sideslip")

SCENARIO = """
title: Half a car
vehicle: car.yaml
stop_time: 0.4
step_size: 0.01
inputs: {velocity_x: 20, friction: 0.7, sideslip: 0.001, sideslip_rate: 0}
units:
  driver:     {fmu: driver_sine, parameters: {frequency: 2, start_time: 0}}
  reference:  {fmu: reference_steady_state}
  controller: {fmu: controller_fuzzy_sideslip}
"""
CAR = "parameters: {mass: 1100}\n"
HEAVY = "parameters: {mass: 1500}\n"

SWEEP = """
title: Half a sweep
scenario: half.yaml
axes:
  amplitude: {vary: driver.amplitude, values: [0.01, 0.02, 0.03]}
  control: {vary: controller, values: {controller_off: no control, controller_fuzzy_sideslip: fuzzy}}
metrics:
  moment: {metric: peak(yaw_moment)}
"""


@pytest.fixture
def sweep(tmp_path):
    """Write a sweep file with texts replaced and return it as loaded."""

    def make(*changes, text=SWEEP):
        return load_experiment(written(tmp_path, text, *changes, half=SCENARIO, car=CAR, heavy=HEAVY))

    return make


AMPLITUDE = "{vary: driver.amplitude, values: [0.01, 0.02, 0.03]}"
CONTROL = "{vary: controller, values: {controller_off: no control, controller_fuzzy_sideslip: fuzzy}}"


def values(loaded):
    return [tuple(level.value for level in point) for point in loaded.points]


def test_a_grid_has_every_combination_and_the_last_axis_changes_first(sweep):
    found = [tuple(level.words for level in point) for point in sweep().points]
    assert found == [(a, c) for a in ("0.01", "0.02", "0.03") for c in ("no control", "fuzzy")]


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("from: 0.1, to: 1.0, count: 10", [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]),
        ("from: 0.001, to: 1, count: 4, spacing: log", pytest.approx([0.001, 0.01, 0.1, 1.0], rel=1e-15)),
    ],
)
def test_equal_steps_are_the_decimal_numbers_that_people_expect_and_others_equal_factors(
    given, expected, sweep
):
    loaded = sweep((AMPLITUDE, f"{{vary: driver.amplitude, {given}}}"))
    assert list(dict.fromkeys(value[0] for value in values(loaded))) == expected


def test_a_place_in_a_range_of_equal_factors_may_be_negative():
    axis = AxisSpec.model_validate({"vary": "a.b", "from": -2.5, "to": -0.025, "spacing": "log"})
    assert [level_at(axis, place).value for place in (0, 0.5, 1)] == pytest.approx([-2.5, -0.25, -0.025])


def test_a_list_takes_the_first_with_the_first(sweep):
    loaded = sweep(("[0.01, 0.02, 0.03]", "[0.01, 0.02]"), ("axes:", "design: list\naxes:"))
    assert values(loaded) == [(0.01, "controller_off"), (0.02, "controller_fuzzy_sideslip")]


HYPERCUBE = """
title: A cube
scenario: half.yaml
design: latin_hypercube
points: 12
seed: {seed}
axes:
  amplitude: {{vary: driver.amplitude, from: 0, to: 0.06}}
  frequency: {{vary: driver.frequency, from: 0.1, to: 10, spacing: log}}
  control: {{vary: controller, values: [controller_off, controller_fuzzy_sideslip]}}
metrics:
  moment: {{metric: peak(yaw_moment)}}
"""


def test_a_latin_hypercube_has_one_point_in_each_part_of_every_axis(sweep):
    every = values(sweep(text=HYPERCUBE.format(seed=1)))
    assert [point[2] for point in every] == ["controller_off"] * 12 + ["controller_fuzzy_sideslip"] * 12
    found = every[:12]
    assert [point[:2] for point in every[12:]] == [point[:2] for point in found]
    amplitude = np.array([point[0] for point in found]) / 0.06
    frequency = (np.log10([point[1] for point in found]) + 1) / 2
    for unit in (amplitude, frequency):
        assert sorted((12 * unit).astype(int)) == list(range(12))
    assert values(sweep(text=HYPERCUBE.format(seed=1))) == every
    assert values(sweep(text=HYPERCUBE.format(seed=2))) != every


def test_plans_hold_what_the_axes_say(sweep, fmus, tmp_path):
    text = SWEEP.replace(CONTROL, "{vary: vehicle, values: {car.yaml: light, heavy.yaml: heavy}}").replace(
        AMPLITUDE,
        "{vary: inputs.velocity_x, values: [36, 72], unit: km/h}\n"
        "  both: {vary: [driver.amplitude, driver.start_time], values: [0.01, 0.05]}\n"
        "  fmu: {vary: controller, values: ['controller_off', 'controller_fuzzy_sideslip:moment_range=500']}",
    )
    planned = planned_of(sweep(text=text), fmus)
    assert len(planned.jobs) == 16
    units = [{unit.name: unit for unit in run.plan.instances} for run in planned.jobs]
    assert [unit["reference"].constants["velocity_x"] for unit in units] == [10.0] * 8 + [20.0] * 8
    assert {(u["driver"].parameters["amplitude"], u["driver"].parameters["start_time"]) for u in units} == {
        (0.01, 0.01), (0.05, 0.05),
    }  # fmt: skip
    assert [unit["reference"].parameters["mass"] for unit in units[:2]] == [1100, 1500]
    assert [unit["controller"].parameters.get("moment_range") for unit in units[:4]] == [None, None, 500, 500]
    assert planned.units == {"amplitude": "m/s", "both": "rad"}
    assert planned.number("amplitude", planned.experiment.points[0][0]) == 10.0
    assert len({run.key for run in planned.jobs}) == 16


def test_steps_and_algorithms_can_be_varied(sweep, fmus, tmp_path):
    loaded = sweep(
        (AMPLITUDE, "{vary: step_size, values: [10, 5], unit: ms}"),
        (CONTROL, "{vary: algorithm, values: [jacobi, extrapolated]}"),
    )
    planned = planned_of(loaded, fmus)
    assert [(float(run.plan.step), run.plan.algorithm) for run in planned.jobs] == [
        (0.01, "jacobi"), (0.01, "extrapolated"), (0.005, "jacobi"), (0.005, "extrapolated"),
    ]  # fmt: skip
    assert planned.units == {"amplitude": "s"}
    assert planned.number("amplitude", planned.experiment.points[-1][0]) == 0.005


def test_a_variant_changes_several_things_at_once(sweep, fmus, tmp_path):
    variants = (
        "{variants: {as it is: {}, soft: {swap: {controller: controller_off}, set: {driver.amplitude: 0.2}, "
        "vehicle: heavy.yaml}}}"
    )
    loaded = sweep((AMPLITUDE, "{vary: driver.frequency, values: [1, 2]}"), (CONTROL, variants))
    first, second = (
        {unit.name: unit for unit in run.plan.instances} for run in planned_of(loaded, fmus).jobs[:2]
    )
    assert first["controller"].fmu.name == "controller_fuzzy_sideslip"
    assert "amplitude" not in first["driver"].parameters
    assert second["controller"].fmu.name == "controller_off"
    assert second["driver"].parameters["amplitude"] == 0.2
    assert second["reference"].parameters["mass"] == 1500


def test_the_key_of_a_run_changes_with_whatever_its_metrics_follow_from(sweep, fmus, tmp_path):
    def key(*changes):
        return planned_of(sweep(*changes), fmus).jobs[0].key

    same = key()
    assert key(("title: Half a sweep", "title: Another")) == same
    assert key(("0.03]", "0.04]")) == same
    others = [
        key(("[0.01, 0.02", "[0.011, 0.02")),
        key(("axes:", "set: {driver.frequency: 3}\naxes:")),
        key(("axes:", "set: {vehicle.mass: 1200}\naxes:")),
        key(("axes:", "stop_time: 0.3\naxes:")),
        key(("axes:", "step_size: 0.005\naxes:")),
        key(("axes:", "algorithm: jacobi\naxes:")),
        key(("peak(yaw_moment)}", "peak(yaw_moment), window: [0, 0.2]}")),
    ]
    assert len({same, *others}) == 8


FIGURES = """
limits:
  gentle: {says: Gentle, of: amplitude, holds_if: [{metric: moment, at_most: 100 N.m}]}
figures:
  - {name: one, kind: curve, metric: moment, x: amplitude, lines: control}
  - {name: two, kind: limit, limit: gentle, x: control}
"""
REFUSED = [
    ("[0.01, 0.02, 0.03]", "[]", ("axes.amplitude.values", "values")),
    ("[0.01, 0.02, 0.03]", "[0.01, 0.02, 0.01]", ("0.01 twice",)),
    (AMPLITUDE, "{vary: driver.amplitude, from: 0.3, to: 0.1, count: 3}", ("from",)),
    (AMPLITUDE, "{vary: driver.amplitude, from: 0.1, to: 0.3}", ("axes.amplitude", "count")),
    (AMPLITUDE, "{vary: driver.amplitude, from: 0, to: 1, count: 3, spacing: log}", ("0",)),
    (AMPLITUDE, "{vary: driver.amplitude}", ("values", "count")),
    (AMPLITUDE, "{vary: driver.amplitude, values: [1], count: 3}", ("values",)),
    (AMPLITUDE, "{values: [1]}", ("vary", "variants")),
    (AMPLITUDE, "{vary: inputs, values: [1]}", ("inputs.friction*", "inputs", "example")),
    (AMPLITUDE, "{vary: [driver.a, controller], values: [1]}", ("instance.parameter", "several", "share")),
    (AMPLITUDE, "{vary: vehicle, values: [1]}", ("vehicle", "files")),
    (AMPLITUDE, "{vary: driver.amplitude, values: ['1 deg']}", ("plain", "numbers", "unit")),
    (AMPLITUDE, "{vary: driver.amplitude, values: [1], unit: furlong}", ("'furlong'", "unit")),
    ("  control:", "  amplitude:", ("axes.amplitude", "twice")),
    (CONTROL, AMPLITUDE, ("driver.amplitude", "'amplitude'")),
    ("axes:", "set: {driver.amplitude: 1}\naxes:", ("driver.amplitude", "set", "swap")),
    ("  control:", "  moment:", ("'moment'", "column", "table")),
    ("  control:", "  status:", ("'status'", "column", "table")),
    ("axes:", "seed: 3\naxes:", ("latin_hypercube", "points", "belong", "design: sobol")),
    ("axes:", "design: sobol\npoints: 4\naxes:", ("design sobol needs seed",)),
    ("axes:", "design: list\naxes:", ("amplitude", "control", "3", "2")),
    (AMPLITUDE, "{vary: driver.amplitude, from: 0, to: 1, count: 90000}", ("180000", "100000")),
]  # fmt: skip
FIGURES_REFUSED = [
    ("lines: control", "lines: contrl", ("'contrl'", "'control'")),
    (", lines: control", "", ("'control'", "lines", "panels")),
    ("limit: gentle", "limit: gentel", ("'gentel'", "'gentle'")),
    ("name: two", "name: one", ("'one'",)),
    ("kind: curve", "kind: map", ("map", "y")),
    ("kind: limit, limit: gentle, x: control", "kind: map, metric: moment, x: amplitude, y: control",
     ("'control'", "numbers")),
    ("x: control}", "x: amplitude}", ("'amplitude'", "'gentle'")),
    ("of: amplitude", "of: control", ("'control'", "numbers")),
    ("at_most: 100 N.m", "at_most: 100 N.m, above: 1", ("exactly one", "above")),
    ("at_most: 100 N.m", "at_most: many", ("at_most", "number", "unit")),
    ("kind: limit, limit: gentle", "kind: limit, limit: gentle, metric: moment", ("limit", "metric")),
    ("lines: control}", "lines: control, only: {amplitude: [0.07]}}", ("value", "0.07")),
]  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "names", "text"),
    [(*one, SWEEP) for one in REFUSED] + [(*one, SWEEP + FIGURES) for one in FIGURES_REFUSED],
)
def test_a_sweep_file_that_is_wrong_is_one_sentence_with_its_place(old, new, names, text, sweep, tmp_path):
    with pytest.raises(ScenarioError) as error:
        sweep((old, new), text=text)
    assert mentions(error.value, *names)
    assert len(error.value.diagnostics) <= (1 if text == SWEEP else 2)
    assert all(problem.startswith(f"{tmp_path / 'experiment.yaml'}:") for problem in texts_of(error.value))


PLANS_REFUSED = [
    ("driver.amplitude", "driver.amplitud", ("axes.amplitude", "driver.amplitud=0.01")),
    ("vary: driver.amplitude", "vary: drivr.amplitude", ("'drivr'", "scenario", "instance")),
    ("vary: controller,", "vary: contrller,", ("'contrller'", "scenario", "instance")),
    ("controller_off:", "controller_of:", ("'controller_of'",)),
    ("peak(yaw_moment)", "peak(roll_angle)", ("metrics.moment", "records", "signals")),
    ("scenario: half.yaml", "scenario: hlf.yaml", ("scenario", "file")),
    (AMPLITUDE, "{vary: driver.amplitude, values: [1, 2], unit: km/h}", ("'1 km/h'", "value", "rad")),
    (CONTROL, "{vary: vehicle, values: [heavier.yaml]}", ("vehicle", "file")),
    ("100 N.m", "100 km/h", ("experiment.yaml", "limits.gentle.holds_if[0]", "'100 km/h'", "N.m", "kN.m")),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "names"), PLANS_REFUSED)
def test_what_no_run_could_start_with_is_said_once_and_not_once_per_run(old, new, names, sweep, fmus):
    loaded = sweep((old, new), text=SWEEP + FIGURES)
    with pytest.raises(ScenarioError) as error:
        planned_of(loaded, fmus)
    assert mentions(str(error.value.diagnostics[0]), *names)
    assert len(error.value.diagnostics) == 1


def test_options_change_all_runs_as_the_file_would(sweep, fmus):
    path = sweep(("axes:\n", "set: {driver.frequency: 1}\naxes:\n")).path
    settings = ["driver.frequency=3 Hz", "stop_time=0.2", "vehicle.mass=1300", "driver.start_time=0.1"]
    planned = planned_of(load_experiment(path, changes=changed(settings=settings)), fmus)
    written = sweep(
        ("axes:\n", "set: {driver.frequency: 3 Hz, vehicle.mass: 1300, driver.start_time: 0.1}\naxes:\n"),
        ("axes:\n", "stop_time: 0.2\naxes:\n"),
    )
    assert [run.key for run in planned.jobs] == [run.key for run in planned_of(written, fmus).jobs]
    path = sweep((f"  control: {CONTROL}\n", "")).path
    swapped = load_experiment(path, changes=changed([f"controller={fmus / 'controller_off.fmu'}"]))
    for run in planned_of(swapped, fmus).jobs:
        assert {unit.name: unit.fmu.name for unit in run.plan.instances}["controller"] == "controller_off"


@pytest.mark.parametrize(
    ("options", "names"),
    [
        ({"swaps": ["controller=controller_off"]}, ("controller", "set", "swap")),
        ({"swaps": ["controller"]}, ("--swap controller", "--swap INSTANCE=FMU")),
        (
            {"settings": ["amplitude=3"]},
            ("--set amplitude=3", "--set INSTANCE.PARAMETER=VALUE", "start_time"),
        ),
        ({"settings": ["driver.amplitude=3"]}, ("driver.amplitude", "set", "swap")),
        ({"settings": ["stop_time="]}, ("--set stop_time=",)),
    ],
)
def test_options_that_are_wrong_are_said(options, names, sweep):
    path = sweep().path
    with refused(ScenarioError, names=names):
        load_experiment(path, changes=changed(**options))

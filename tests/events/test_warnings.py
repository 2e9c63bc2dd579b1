"""Plausibility warnings of runs, and where they are shown."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from tests.orchestrator.recorded import car, noted
from tests.refusals import mentions
from yawbench.events.kinds import WarningWatch
from yawbench.fmus.fmu import Fmu, Variable
from yawbench.foundation.errors import Diagnostic, Location, warnings_in
from yawbench.orchestrator.plan import Instance, Plan, Wire
from yawbench.orchestrator.results.run_record import RunRecord
from yawbench.orchestrator.signal_names import SignalName
from yawbench.studies.run_remarks import MARK, marked, remarks
from yawbench.vocabulary.wheels import WHEELS


def variable(name, causality="output", unit="1", kind="Real", lowest=None, highest=None):
    return Variable(name, 0, kind, causality, "continuous", unit, None, lowest, highest, "")


def plan(**outputs):
    """Return a plan whose plant records outputs: name -> their Variable's limits."""
    variables = {name: variable(name, **about) for name, about in outputs.items()}
    fmu = Fmu("plant_x", Path("x.fmu"), Path("x"), "", "", "x", "", variables)
    tyre = replace(fmu, name="tyre_x", variables={"friction_fl": variable("friction_fl", "input")})
    units = (Instance("plant", fmu, 1, {}, {}), Instance("tyre", tyre, 1, {}, {"friction_fl": 0.5}))
    record = tuple(SignalName("plant", name) for name in outputs)
    return Plan(units, (), record, Fraction(1, 100), 100, "jacobi")


def found(made, *columns, blocks=4):
    """Return the findings on columns that come in blocks, by kind."""
    watch = WarningWatch(made)
    time = np.linspace(0.0, 1.0, len(columns[0]))
    for rows in np.array_split(np.column_stack([time, *columns]), blocks):
        watch.look(rows)
    return {one.code: one for one in warnings_in(watch.warnings())}


def test_a_car_that_spins_is_named_with_the_time_and_the_angle():
    sideslip = np.radians(np.linspace(0.0, -90.0, 101))
    one = found(plan(sideslip={"unit": "rad"}), sideslip)["car-spins"]
    assert (one.location.signal, one.location.time) == ("plant.sideslip", pytest.approx(0.51))
    assert one.value == pytest.approx(90.0)
    assert mentions(one.message, "45 degrees", "0.51 s", "90 degrees", "car")


def test_a_calm_run_has_no_findings():
    angle = np.radians(np.linspace(0.0, 5.0, 50))
    assert found(plan(sideslip={"unit": "rad"}, velocity_x={"unit": "m/s"}), angle, 25.0 + angle) == {}
    assert found(plan(sideslip={}), np.array([0.0, np.nan, 0.1])) == {}


def test_the_first_wheel_that_lifts_is_named():
    loads = {f"vertical_load_{wheel}": {"unit": "N"} for wheel in WHEELS}
    time = np.linspace(0.0, 1.0, 101)
    values = [np.where(time < at, 3000.0, 0.0) for at in (2.0, 0.9, 0.4, 2.0)]
    one = found(plan(**loads), *values)["wheel-lifts"]
    assert (one.location.signal, one.location.time) == ("plant.vertical_load_rl", pytest.approx(0.4))
    assert mentions(one.message, "0.4 s", "wheel")


@pytest.mark.parametrize(
    ("signal", "value", "code"),
    [
        ("velocity_x", 90.0, "speed-implausible"),
        ("velocity_x", -5.0, "car-rolls-backwards"),
        ("roll_angle", 0.5, "car-rolls-over"),
        ("steer_angle", 5.0, "steer-angle-implausible"),
    ],
)
def test_each_limit_is_looked_at(signal, value, code):
    assert list(found(plan(**{signal: {}}), np.full(10, value))) == [code]


def test_more_acceleration_than_the_road_gives_is_named_where_its_friction_is_known():
    made = plan(acceleration_x={}, acceleration_y={})
    one = found(made, np.full(10, 6.0), np.full(10, 8.0))["acceleration-implausible"]
    assert one.value == pytest.approx(10.0 / 9.81 / 0.5)
    assert found(made, np.full(10, 3.0), np.full(10, 4.0)) == {}
    road = replace(made, wires=(Wire("road", "friction_fl", "tyre", "friction_fl"),))
    assert found(road, np.full(10, 60.0), np.full(10, 8.0)) == {}


def test_a_value_outside_what_its_model_states_is_named():
    made = plan(pressure={"lowest": 0.0, "highest": 2.0})
    assert found(made, np.linspace(0.0, 2.0, 10)) == {}
    one = found(made, np.linspace(0.0, 3.0, 101))["range-left"]
    assert mentions(one.message, "plant.pressure", "3", "0.67 s", "2")
    assert found(made, np.linspace(0.0, -1.0, 101))["range-left"].value == pytest.approx(-1.0)


def test_a_run_with_findings_is_marked_in_tables():
    results = car()
    assert marked("a", results) == "a"
    where = Location(signal="plant.sideslip", time=1.0)
    spin = Diagnostic("car-spins", "the car spins", "warning", where, math.inf)
    noted(results, diagnostics=[spin.record()])
    assert results.record.all_diagnostics == (spin,)
    assert marked("a", results) == f"a {MARK}"
    assert remarks([("a", results)]) == ["† a: the car spins"]


def test_a_record_of_version_0_2_says_where_its_warnings_are():
    (warning,) = RunRecord.model_validate({"findings": [{"kind": "spin"}], "notes": []}).all_diagnostics
    assert (warning.code, warning.severity) == ("earlier-warnings", "warning")
    assert mentions(warning.message, "0.2", "run.json", "findings")


@pytest.mark.parametrize("sideways", [True, False])
@pytest.mark.parametrize(
    ("speeds", "degrees", "spun"),
    [
        ([20, 10, 3, 0.01, 0, 0], [0, 1, 2, 180, -180, 90], False),  # brakes straight to rest
        ([20, 18, 15, 9, 2, 0], [0, 60, 120, 180, 180, 180], True),  # spins, then comes to rest
        ([20, 18, 15, 9, 5, 5], [0, 60, 120, 180, 180, 180], True),  # spins, then rolls backwards
        ([0, 0, 3, 6, 6, 6], [180, 90, 180, 180, -179, 178], False),  # reverses
        ([6, 6, 6, 6, 6, 6], [180, 180, 150, 120, 90, 60], True),  # reverses, and turns round
        ([9, 4, 0, 0, 4, 6], [0, 0, 180, 180, 180, 180], False),  # stops, and rolls back
        ([0, 0, 0, 5, 9, 15], [180, 45, -90, 0, 1, 2], False),  # starts from rest
    ],
)
def test_a_car_spins_only_while_it_moves(speeds, degrees, spun, sideways):
    """Whether rows come all at once, in blocks or one by one, in SI units or others."""
    sideslip, speeds = np.radians(degrees), np.array(speeds, float)
    forwards, aside = speeds * np.cos(sideslip), speeds * np.sin(sideslip)
    for angle, speed, units in (
        (sideslip, forwards, ("rad", "m/s")),
        (degrees, 3.6 * forwards, ("deg", "km/h")),
    ):
        of = {name: {"unit": unit} for name, unit in zip(("sideslip", "velocity_x"), units, strict=True)}
        columns = (angle, speed)
        if sideways:
            of["velocity_y"], columns = {"unit": "m/s"}, (angle, speed, aside)
        for blocks in (1, 3, len(speeds)):
            assert ("car-spins" in found(plan(**of), *columns, blocks=blocks)) == spun

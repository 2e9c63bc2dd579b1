"""Measures against closed forms; how metrics find their signals."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from tests.orchestrator.recorded import car, noted, results
from tests.refusals import mentions, refused
from yawbench.figures.display import digits_of, shown, shown_unit, shown_value
from yawbench.figures.plots import LabelledRun, draw, shown_by
from yawbench.foundation.errors import ScenarioError
from yawbench.metrics import measures
from yawbench.metrics.expressions import (
    AT_A_TIME,
    MetricValue,
    evaluate,
    evaluate_all,
    metric,
    while_moving,
    why_none,
)
from yawbench.metrics.measures import catalogue
from yawbench.metrics.verdict import RELATIONS, Relation, compare
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import ConnectionRecord, FmuRecord, RunRecord
from yawbench.proving_ground.standard_tests import Evaluation
from yawbench.reports.divergence import divergence, partings_table
from yawbench.studies.claim_schema import Condition
from yawbench.studies.driven_tests import run_table
from yawbench.studies.listings import metrics_of_run
from yawbench.studies.tables import Table
from yawbench.vocabulary.wheels import WHEELS

T = np.linspace(0.0, 2.0, 20001)
SINE = np.sin(2 * np.pi * T)
ZERO, ONE = np.zeros_like(T), np.ones_like(T)
UNEVEN = np.concatenate([np.linspace(0, 1, 11), np.linspace(1, 3, 5001)[1:]])
DAMPED = 10 * math.sqrt(1 - 0.3**2)
"""Angular frequency of a system with 10 rad/s and a damping of 0.3, of which this is the answer to a step."""
STEP = 1 - np.exp(-3 * T) * (np.cos(DAMPED * T) + 3 / DAMPED * np.sin(DAMPED * T))
EDGE = math.radians(24)
LATE = np.where((T >= 0.5) & (T < 0.9), 1.0, 0.0)
LONGER = np.linspace(0.0, 4.0, 401)
PULSE = np.where((LONGER >= 2.0) & (LONGER <= 2.5), 3.0, 0.0)
ASIDE = math.radians(45) * SINE


@pytest.mark.parametrize(
    ("measure", "signals", "expected", "within"),
    [
        ("mean_error", (SINE, ZERO), 2 / math.pi, 1e-7),
        ("rms_error", (SINE, ZERO), 1 / math.sqrt(2), 1e-9),
        ("peak_error", (SINE, ZERO), 1.0, 1e-9),
        ("relative_mean_error", (-3 * SINE, -2 * SINE), 1 / math.pi, 1e-6),
        ("relative_rms_error", (-3 * SINE, -2 * SINE), 0.5 / math.sqrt(2), 1e-6),
        ("relative_peak_error", (-3 * SINE, -2 * SINE), 0.5, 1e-6),
        ("rms", (3 * SINE,), 3 / math.sqrt(2), 1e-9),
        ("effort", (3 * SINE,), 3 * 4 / math.pi, 1e-7),
        ("total_variation", (5 * SINE,), 2 * 4 * 5, 1e-6),
        ("total_variation_rate", (5 * SINE,), 4 * 5, 1e-6),
        ("slope_variation_rate", (SINE,), 4 * 2 * math.pi, 1e-3),
        ("settling_time", (1 - np.exp(-T / 0.4), ONE), 0.4 * math.log(20), 1e-4),
        ("settling_time", (1 - np.exp(-T / 4), ONE), math.inf, 0),
        ("settling_time", (1.04 * SINE, SINE), 0.0, 0),
        ("overshoot", (STEP, ONE), math.exp(-math.pi * 3 / DAMPED), 1e-4),
        ("overshoot", (0.7 * SINE, SINE), 0.0, 0),
        ("changes", (np.where(T < 1.2, 3.0, 5.0),), 1.0, 0),
        ("change_time", (np.where(T < 1.2, 3.0, 5.0),), T[T >= 1.2][0], 1e-9),
        ("changes", (ONE,), 0.0, 0),
        ("change_time", (ONE,), math.nan, 0),
        ("displacement", (10 - T,), 2.0, 1e-9),
        ("peak", (10 - T,), 10.0, 1e-9),
        ("final", (10 - T,), 8.0, 1e-9),
        ("phase_area", (0.3 * SINE, 0.6 * math.pi * np.cos(2 * np.pi * T)), 0.36 * math.pi**2, 1e-9),
        ("stability_index", (EDGE / 4 * ONE, ZERO), 1.0, 1e-6),
        ("stability_index", (ZERO, -EDGE * ONE), 1.0, 1e-6),
        ("stability_index", (EDGE / 4 * ONE, -EDGE * ONE), 0.0, 0),
        ("time_beyond", (LATE, ZERO), 0.2, 1e-9),
        ("time_beyond", (ZERO, ZERO), 0.0, 0),
        ("jerk", (3 * T,), 3.0, 1e-6),
        ("jerk", (3 * T + 0.01 * (np.arange(T.size) % 2),), 3.0, 0.01),  # what a controller's samples add
        ("spins", (0.99 * ASIDE,), 0.0, 0),
        ("spins", (1.01 * ASIDE,), 1.0, 0),
        ("spins", (math.pi + ZERO,), 0.0, 0),  # reverses
        ("spins", (0.99 * ASIDE - math.pi,), 0.0, 0),
        ("spins", (np.where(T < 1.0, math.pi, 2.0),), 1.0, 0),
        ("spins", (np.where(T < 1.0, 0.0, math.nan),), math.nan, 0),
    ],
)
def test_measures_are_their_closed_forms(measure, signals, expected, within):
    found = getattr(measures, measure)(T, *signals)
    assert found == pytest.approx(expected, rel=within, abs=1e-12, nan_ok=True)


def test_samples_may_be_uneven_longer_or_too_few():
    assert measures.integral(UNEVEN, 2 * UNEVEN) == pytest.approx(9.0, rel=1e-12)
    assert measures.worst_second(LONGER, PULSE) == pytest.approx(3.0 * math.sqrt(0.5), rel=0.02)
    assert measures.worst_second(LONGER, 2.0 + 0.0 * LONGER) == pytest.approx(2.0)
    assert math.isnan(measures.worst_second(LONGER[:50], PULSE[:50]))
    assert math.isnan(measures.jerk(T[:3], T[:3]))


def test_grip_use_is_the_tyres_force_over_its_load_and_the_worst_wheel_counts():
    loads = {f"plant.vertical_load_{w}": 1000 + 0 * T for w in WHEELS}
    forces = {f"tyre.tyre_force_x_{w}": 300 + 0 * T for w in WHEELS} | {
        f"tyre.tyre_force_y_{w}": (400 if w == "rl" else 0) + 0 * T for w in WHEELS
    }
    found = evaluate(results(loads | forces, T), metric("grip_use(tyre_force_x_*)"))
    assert (found.number, found.unit) == (pytest.approx(0.5), "1")
    assert evaluate(results(forces, T), metric("grip_use(tyre_force_x_*)")) is None
    assert evaluate(results(loads | forces, T), metric("grip_use(tyre_force_y_*)")) is None
    in_the_air = {"plant.vertical_load_fl": 0 * T, "tyre.tyre_force_x_fl": 0 * T}
    lifted = evaluate(results(loads | forces | in_the_air, T), metric("grip_use(tyre_force_x_*)"))
    assert lifted is not None
    assert lifted.number == pytest.approx(0.5)


def test_the_path_is_compared_with_that_of_a_car_that_follows_its_reference():
    quarter = np.pi / 2 / T[-1]  # of a circle to the left, of radius 1 m, begun northwards
    columns = {
        "plant.yaw_angle": np.pi / 2 + quarter * T, "plant.velocity_x": quarter + 0 * T,
        "reference.yaw_rate_ref": quarter + 0 * T, "reference.sideslip_ref": 0 * T,
        "plant.position_y": 5 + np.sin(quarter * T),
    }  # fmt: skip
    error = metric("relative_path_error(position_y)")
    assert evaluate(results(columns, T), error).number == pytest.approx(0.0, abs=1e-7)
    assert evaluate(results(columns, T), error, (0.5, 1.5)).number == pytest.approx(0.0, abs=1e-7)
    columns["plant.position_y"] = 5 + 1.1 * np.sin(quarter * T)
    assert evaluate(results(columns, T), error).number == pytest.approx(0.1 / math.sqrt(2), rel=1e-6)
    columns["reference.sideslip_ref"] += np.pi / 2  # it drives to the west
    columns["plant.position_y"] = 5 - 1 + np.cos(quarter * T)
    assert evaluate(results(columns, T), error).number == pytest.approx(0.0, abs=1e-7)


def test_a_recorded_rate_goes_before_the_difference_quotient():
    sideslip = 0.05 * SINE
    index = metric("stability_index(sideslip)")
    rate = 0.1 * np.pi * np.cos(2 * np.pi * T)
    by_quotient = evaluate(results({"plant.sideslip": sideslip}, T), index)
    columns = {"plant.sideslip": sideslip, "plant.sideslip_rate": rate}
    assert by_quotient.number == pytest.approx(evaluate(results(columns, T), index).number, rel=1e-5)
    columns["plant.sideslip_rate"] = 3 * rate
    assert evaluate(results(columns, T), index).number > 2 * by_quotient.number


def test_some_measures_are_of_some_signals_only():
    run = results({"plant.yaw_rate": SINE, "plant.sideslip": SINE}, T)
    assert evaluate(run, metric("stability_index(yaw_rate)")) is None
    assert evaluate(run, metric("phase_area(yaw_rate)")).unit == "(rad/s)2/s"
    assert evaluate(run, metric("phase_area(sideslip)")).unit == "rad2/s"
    assert evaluate(run, metric("spins(yaw_rate)")) is None
    assert mentions(why_none(run, metric("spins(yaw_rate)"), None, 2.0), "sideslip")


def test_the_catalogue_names_every_measure_with_definition_formula_and_unit():
    found = {entry.name: entry for entry in catalogue()}
    assert list(found) == list(measures.MEASURES)
    assert all(entry.definition and entry.formula and entry.unit for entry in found.values())
    assert not any("{" in entry.formula + entry.unit for entry in found.values())
    assert mentions(found["total_variation_rate"].unit, "signal", "per")
    assert found["overshoot"].needs == "a reference"


def test_every_measure_can_be_applied():
    for name, measure in measures.MEASURES.items():
        if measure.signal:  # of other signals than this car has: tested above
            continue
        chosen = metric(f"{name}(sideslip){' at 2 s' if name == AT_A_TIME else ''}")
        value = evaluate(car(1.2), chosen)
        assert value is not None
        assert value.number >= 0 or name in ("final", AT_A_TIME)
        assert "{" not in chosen.formula


def test_every_relation_has_a_kind_and_a_key_of_conditions():
    assert get_args(Relation) == tuple(RELATIONS)
    assert RELATIONS.keys() <= Condition.model_fields.keys()


def test_a_ratio_has_the_unit_of_its_number_and_is_shown_in_per_cent():
    ratio = evaluate_all(car(0.8))["relative_peak_error(sideslip)"]
    assert (ratio.number, ratio.unit) == (pytest.approx(0.2), "1")
    table = metrics_of_run(car(0.8), ["relative_peak_error(sideslip)"])
    assert table.text()[0][-1] == "20.0 %"
    assert (table.unit(2), table.values(2)) == ("1", [pytest.approx(0.2)])
    again = replace(ratio, half=0.01)
    assert (again.unit, again.shown_in) == ("1", "%")
    verdict = compare(0.206, "at_most", 0.35, "%")
    assert (verdict.value, verdict.unit, verdict.as_data()["unit"]) == (0.206, "1", "1")
    judged = Evaluation("run")
    judged.add("ratio", "a ratio", 0.206, "%")
    data = judged.as_data()["quantities"]["ratio"]
    assert data == {"name": "a ratio", "value": 0.206, "unit": "1", "reading": ""}
    (row,) = run_table(judged, "").text()
    assert row[1] == "20.6 %"


def test_a_recorded_signal_in_per_cent_is_shown_as_it_was_recorded():
    charge = results({"battery.charge": [20.0, 20.6]}, units={"battery.charge": "%"})
    other = results({"battery.charge": [20.0, 30.6]}, units={"battery.charge": "%"})
    (parting,) = divergence(charge, other).partings
    assert partings_table([parting]).text()[0][4] == "10.0 %"
    figure = draw([LabelledRun("run", charge)], ["battery.charge"])
    (line,) = figure.axes[0].get_lines()[:1]
    assert line.get_ydata().tolist() == [20.0, 20.6]
    value = evaluate(charge, metric("peak(battery.charge)"))
    assert (value.number, value.unit) == (pytest.approx(0.206), "1")


def test_units_of_metrics_follow_from_the_signal():
    units = {name: value.unit for name, value in evaluate_all(car()).items()}
    assert units["relative_peak_error(sideslip)"] == "1"  # shown in per cent
    assert units["rms_error(yaw_rate)"] == "rad/s"
    assert units["effort(yaw_moment)"] == "N.m.s"
    assert units["total_variation_rate(yaw_moment)"] == "N.m/s"
    assert units["settling_time(yaw_rate)"] == "s"
    assert metric("slope_variation_rate(yaw_rate)").unit("rad/s") == "rad/s3"
    assert metric("effort(velocity_x)").unit("m/s") == "m"
    for odd in ("N/(m/s)", "m/s^3", "W/sr"):  # as other tools may write them
        assert metric("effort(yaw_rate)").unit(odd) == f"{odd}.s"


def test_metrics_without_their_signals_or_relative_to_zero_are_absent():
    alone = {"peak(sideslip)", "stability_index(sideslip)"}
    assert set(evaluate_all(results({"plant.sideslip": SINE}, T))) == alone
    straight = results({"plant.sideslip": SINE, "reference.sideslip_ref": 0 * SINE}, T)
    assert set(evaluate_all(straight)) == {*alone, "mean_error(sideslip)", "rms_error(sideslip)"}


@pytest.mark.parametrize(
    ("name", "window", "expected"),
    [
        ("peak(sideslip)", (0.0, 0.5), 0.5),
        ("displacement(sideslip)", (0.5, 2.0), 1.5),
        ("peak(sideslip)", (0.5, 2.5), None),  # the run does not last so long
        ("peak(sideslip)", (-0.5, 0.5), None),
    ],
)
def test_a_window_limits_a_metric_to_its_samples(name, window, expected):
    found = evaluate(results({"plant.sideslip": T}, T), metric(name), window)
    assert (found and found.number) == (expected and pytest.approx(expected))


def test_the_output_that_feeds_an_input_is_the_signal_of_that_name():
    columns = {"mine.Mz": 2 * T, "mine.beta": T, "plant.yaw_rate": T}
    run = results(columns, T, {"mine.Mz": "N.m", "mine.beta": "deg", "plant.yaw_rate": "rad/s"})
    assert evaluate(run, metric("peak(yaw_moment)")) is None
    wires = [
        {"from": "mine.Mz", "to": "allocator.yaw_moment"},
        {"from": "mine.Mz", "to": "plant.yaw_moment"},
        {"from": "mine.beta", "to": "driver.sideslip", "gain": np.pi / 180, "offset": 0.0, "unit": "rad"},
        {"from": "plant.yaw_rate", "to": "driver.turn", "gain": -1.0, "offset": 0.0, "unit": "rad/s"},
    ]
    noted(run, connections=wires)
    assert evaluate(run, metric("peak(yaw_moment)")) == MetricValue(2 * T[-1], "N.m")
    assert evaluate(run, metric("peak(sideslip)")) == MetricValue(pytest.approx(np.radians(T[-1])), "rad")
    assert evaluate(run, metric("peak(turn)")) is None  # another sign is another signal
    assert [panel.name for panel in shown_by([LabelledRun("a", run)], ["yaw_moment", "turn"])] == [
        "yaw_moment"
    ]


def test_values_in_other_units_are_measured_and_drawn_in_si():
    run = results({"mine.yaw_moment": T}, T, {"mine.yaw_moment": "kN.m"})
    assert evaluate(run, metric("peak(yaw_moment)")) == MetricValue(pytest.approx(1000 * T[-1]), "N.m")
    assert shown_unit("kN.m") == ("N·m", 1000.0)
    assert shown_unit("deg") == ("°", pytest.approx(1.0))
    assert shown_unit("widgets") == ("widgets", 1.0)


def test_metrics_find_signals_whatever_the_units_are_called_and_torques_where_no_actuator_is_between():
    renamed = results({"Fahrzeug.sideslip": 1.1 * SINE, "soll.sideslip_ref": SINE}, T)
    assert evaluate_all(renamed)["relative_peak_error(sideslip)"].number == pytest.approx(0.1, rel=1e-6)
    run = car(chatter=100.0)
    asked = evaluate(run, metric("total_variation_rate(torque_request_*)"))
    assert evaluate(run, metric("total_variation_rate(wheel_torque_*)")) == asked


def test_the_largest_of_four_wheels_counts_and_of_two_units_the_plant():
    columns = {f"actuator.wheel_torque_{w}": k * T for k, w in enumerate(WHEELS)}
    wheels = results(columns, T, dict.fromkeys(columns, "N.m"))
    assert evaluate(wheels, metric("peak(wheel_torque_*)")).number == pytest.approx(6.0)
    both = results({"estimator.sideslip": 0 * T, "plant.sideslip": SINE}, T)
    assert evaluate(both, metric("peak(sideslip)")).number == pytest.approx(1.0)
    assert evaluate(both, metric("peak(estimator.sideslip)")).number == 0.0


WATCHED = {
    "estimator.sideslip": 1.2 * SINE,
    "gyro.yaw_rate": 7.0 * SINE,
    "gyro.steer_angle": 9.0 * SINE,
    "driver.steer_angle": 2.0 * SINE,
    "plant.sideslip": SINE,
    "plant.yaw_rate": 3.0 * SINE,
    "reference.yaw_rate_ref": 4.0 * SINE,
    "ideal.yaw_rate_ref": 2.5 * SINE,
}
"""Columns of a car that is measured and estimated, with a reference beside the one in the loop."""


def watched():
    """Return the recorded run of such a car."""
    units = {name: "rad/s" if "rate" in name else "rad" for name in WATCHED}
    run = results(WATCHED, T, units)
    wire = ConnectionRecord(source="reference.sideslip_ref", target="controller.sideslip_ref")
    run.record.connections.append(wire)
    return noted(run, fmus={"gyro": {"name": "sensor_cluster"}})


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("peak_error(estimator.sideslip, plant.sideslip)", 0.2),
        ("peak( estimator.sideslip-plant.sideslip )", 0.2),
        ("rms(estimator.sideslip - sideslip)", 0.2 / math.sqrt(2)),
        ("value(gyro.yaw_rate - plant.yaw_rate) at 0.25 s", 4.0),
        ("relative_peak_error(yaw_rate)", 0.25),  # against the reference that acts
        ("relative_peak_error(yaw_rate, ideal.yaw_rate_ref)", 0.2),  # against the truth
        ("peak(steer_angle)", 2.0),  # the driver's, not what is measured of it
        ("phase_area(estimator.sideslip - plant.sideslip)", 0.04 * 4 * math.pi**2),
    ],
)
def test_a_metric_compares_two_named_columns(name, number):
    assert evaluate(watched(), metric(name)).number == pytest.approx(number, rel=1e-4)


def test_a_bare_name_never_means_what_is_only_measured_or_estimated():
    seen = results({"gyro.yaw_rate": SINE, "estimator.sideslip": SINE, "estimator.sideslip_rate": 9 * SINE,
                    "plant.sideslip": SINE}, T)  # fmt: skip
    noted(seen, fmus={"gyro": {"name": "sensor_cluster"}, "estimator": {"name": "estimator_a"}})
    assert evaluate(seen, metric("peak(yaw_rate)")) is None
    assert evaluate(seen, metric("peak(gyro.yaw_rate)")).number == pytest.approx(1.0, rel=1e-4)
    of_truth = evaluate(seen, metric("phase_area(sideslip)")).number  # by the slope of the car's own
    assert of_truth == pytest.approx(evaluate(results({"plant.sideslip": SINE}, T),
                                              metric("phase_area(sideslip)")).number)  # fmt: skip


def test_wheels_are_compared_in_pairs_and_units_converted():
    columns = {
        f"{unit}.load_{w}": k * f * T for k, w in enumerate(WHEELS) for unit, f in [("a", 1), ("b", 2)]
    }
    run = results(columns, T, {name: "N" if name[0] == "a" else "kN" for name in columns})
    assert evaluate(run, metric("peak(a.load_* - b.load_*)")) == MetricValue(
        pytest.approx(1999.0 * 3 * 2), "N"
    )


@pytest.mark.parametrize(
    ("name", "names"),
    [
        ("peek(sideslip)", ("'peek(sideslip)'", "'peek'", "'peak'")),
        ("sideslip", ("'sideslip'", "'peak(sideslip)'", "measure(signal)", "relative_peak_error(sideslip)")),
        ("peak_sideslip", ("measure(signal)", "'peak(sideslip)'")),
        ("rms_error_yaw_rate", ("measure(signal)", "'rms_error(yaw_rate)'")),
        ("peak(sideslip", ("measure(signal)", "'peak(sideslip)'")),
        ("rms_error(x - y)", ("rms_error", "compares", "reference")),
        ("rms(x, y)", ("difference", "reference", "rms")),
        ("peak(sideslip) at 2 s", ("2 s", "point", "time")),
        ("value(sideslip)", ("sideslip", "point", "time")),
        ("peak(sideslip) from 3 s to 1 s", ("ends", "begins")),
        ("peak(sideslip) during 3 s", ("1 s", "3 s", "2 s")),
        ("peak(sideslip) from 1 kg to 3 s", ("'1 kg'", "value")),
    ],
)
def test_a_name_that_is_no_metric_is_refused_with_what_is_meant(name, names):
    unknown = "measure(signal)" in names or "'peek'" in names
    with refused(ScenarioError, "metric-unknown" if unknown else "metric-invalid", names=names):
        metric(name)


def test_numbers_are_shown_in_the_units_people_read():
    assert shown(0.0349, "rad") == "2.00 °"
    assert shown(25.0, "m/s") == "90.0 km/h"
    assert shown(0.0394, "%") == "3.94 %"
    assert shown(14180.0, "N.m/s") == "14.2 kN·m/s"
    assert shown(2.513, "%") == "251 %"
    assert shown(math.inf, "s") == "never"
    assert digits_of(0.0996) == "0.0996"
    assert digits_of(0.9996) == "1.00"
    assert digits_of(12345.0) == "12345"


@pytest.mark.parametrize("text", ["from 500 ms to 1.5 s", "0.5 to 1.5"])
def test_a_metric_may_be_of_a_stretch_of_time(text):
    run = results({"plant.sideslip": T}, T)
    chosen = metric(f"peak(sideslip) {text}")
    assert mentions(chosen.name, "peak(sideslip)", "0.5 s", "1.5 s")
    assert metric(chosen.name) == chosen
    assert evaluate(run, chosen).number == pytest.approx(1.5)
    assert mentions(chosen.title, "0.5", "1.5 s", "Sideslip", "angle")


def test_a_value_may_be_of_a_point_of_time():
    run = results({"plant.sideslip": T}, T)
    chosen = metric("value(sideslip) at 750 ms")
    assert mentions(chosen.name, "value(sideslip)", "0.75 s")
    assert mentions(chosen.title, "0.75 s", "Sideslip", "angle")
    assert evaluate(run, chosen).number == pytest.approx(0.75)
    assert evaluate(run, metric("value(sideslip) at 9 s")) is None


# Angles of a velocity, while the car moves


def moving_car(speeds, sideslip, *, rate=None, sideways=True, unit="rad", speed_unit="m/s", **more):
    """Return a run with a speed [m/s] and a sideslip [rad] per row, every 0.1 s."""
    speeds, sideslip = np.array(speeds, float), np.array(sideslip, float)
    columns = {"plant.velocity_x": speeds * np.cos(sideslip) * (3.6 if speed_unit == "km/h" else 1.0)}
    units = {"plant.velocity_x": speed_unit, "plant.velocity_y": "m/s"}
    if sideways:
        columns["plant.velocity_y"] = speeds * np.sin(sideslip)
    columns["plant.sideslip"] = np.degrees(sideslip) if unit == "deg" else sideslip
    if rate is not None:
        columns["plant.sideslip_rate"] = np.array(rate, float)
    columns |= {name.replace("__", "."): np.array(values, float) for name, values in more.items()}
    units |= {name: "rad" for name in columns if name not in units} | {"plant.sideslip": unit, "time": "s"}
    record = RunRecord(fmus={"plant": FmuRecord(name="plant_x", role="plant")})
    return Results(Path(), 0.1 * np.arange(speeds.size), columns, units, record)


def of(results, name):
    value = evaluate(results, metric(name))
    return None if value is None else value.number


@pytest.mark.parametrize(("sideways", "unit", "speed_unit"), [(True, "rad", "m/s"), (False, "deg", "km/h")])
def test_the_sideslip_of_a_car_that_brakes_straight_to_rest_is_that_while_it_moves(
    sideways, unit, speed_unit
):
    speeds = [20.0, 10.0, 4.0, 0.001, 0.0, 0.0]
    run = moving_car(
        speeds, [0.0, 0.02, 0.01, np.pi, -np.pi, 3.0], sideways=sideways, unit=unit, speed_unit=speed_unit
    )
    assert of(run, "peak(sideslip)") == pytest.approx(0.02)
    assert of(run, "final(sideslip)") == pytest.approx(0.01)
    assert of(run, "value(sideslip) at 0.4 s") is None
    assert of(run, "peak(sideslip) from 0.3 s to 0.5 s") is None
    assert of(run, "peak(velocity_x)") == pytest.approx(20.0)
    shown = while_moving(run).columns["plant.sideslip"]
    assert np.isnan(shown).tolist() == [False] * 3 + [True] * 3
    assert not np.isnan(run.columns["plant.sideslip"]).any()  # what was recorded stays


WRAPPING = np.radians([150.0, 170.0, -170.0, -150.0, -130.0])


@pytest.mark.parametrize(
    ("speeds", "sideslip", "name", "expected"),
    [
        ([20, 18, 15, 8, 0], np.radians([0, 90, 150, -170, -170]), "peak(sideslip)", np.radians(170.0)),
        ([20, 18, 15, 8, 0], np.radians([0, 90, 150, -170, -170]), "total_variation(sideslip)",
         np.radians(190.0)),  # on through 180 degrees
        ([0.0, 0.0, 5.0, 10.0], [np.pi, -np.pi, 0.1, 0.05], "peak(sideslip)", 0.1),  # starts from rest
        ([0.0, 0.1, 0.0], [np.pi, 1.0, 2.0], "peak(sideslip)", None),  # never moves
        # the clock of a mean stands while the car does
        ([10, 10, 10, 0, 0, 10, 10, 10], [0.1, 0.1, 0.1, 3, -3, 0.3, 0.3, 0.3], "rms(sideslip)", 0.05**0.5),
        ([10, 10, 10, 0, 0, 10, 10, 10], [0.1, 0.1, 0.1, 3, -3, 0.3, 0.3, 0.3], "effort(sideslip)", 0.1),
        ([10.0] * 5, WRAPPING, "phase_area(sideslip)", np.radians(200.0) ** 2 * 0.4),
    ],
)  # fmt: skip
def test_angles_of_a_velocity_count_while_the_car_moves(speeds, sideslip, name, expected):
    run = moving_car(speeds, sideslip)
    assert of(run, name) == (None if expected is None else pytest.approx(expected))
    if expected is None:
        assert "10 km/h" in why_none(run, metric(name), None, 0.2)


def test_no_error_jumps_where_a_sideslip_wraps_at_180_degrees():
    run = moving_car([10.0] * 5, WRAPPING, reference__sideslip_ref=np.radians([150, 175, 178, 179, 180]))
    assert of(run, "peak_error(sideslip)") == pytest.approx(np.radians(50.0))


def test_slip_angles_and_estimates_count_while_the_true_car_moves():
    more = {f"plant__slip_angle_{wheel}": [0.1, 0.2, np.pi] for wheel in ("fl", "fr", "rl", "rr")}
    run = moving_car([10.0, 10.0, 0.0], [0.0, 0.0, 2.0], estimator__sideslip=[0.01, 0.02, -3.0], **more)
    run.record.fmus["estimator"] = FmuRecord(name="estimator_x", role="estimator")
    assert of(run, "peak(slip_angle_*)") == pytest.approx(0.2)
    assert of(run, "peak(estimator.sideslip)") == pytest.approx(0.02)
    assert of(run, "peak(estimator.sideslip - plant.sideslip)") == pytest.approx(0.02)


def test_without_a_speed_a_sideslip_is_taken_as_it_is():
    run = moving_car([0.0, 0.0], [3.0, 0.1])
    del run.columns["plant.velocity_x"]
    assert of(run, "peak(sideslip)") == 3.0


def test_a_line_has_a_gap_while_the_car_stands_and_keeps_its_time():
    run = moving_car([20.0, 15.0, 10.0, 5.0, 0.0, 0.0], [0.0, 0.02, 0.01, 0.0, np.pi, -np.pi])
    figure = draw([LabelledRun("a", run)], ["sideslip", "velocity_x", "velocity_x(sideslip)"])
    of_slip, of_speed = figure.axes[:2]
    (line,) = of_slip.get_lines()
    assert np.nanmax(np.abs(line.get_ydata())) == pytest.approx(np.degrees(0.02))
    assert of_slip.get_xlim() == pytest.approx(of_speed.get_xlim())
    assert max(map(abs, figure.axes[2].get_xlim())) < 2.0


def test_a_reference_is_named_after_its_signal_also_of_wheels():
    wheels = f"{measures.words('wheel_torque_*')} reference"
    assert measures.words("sideslip_ref") == f"{measures.words('sideslip')} reference"
    assert measures.words("wheel_torque_ref_*") == wheels
    assert measures.words("wheel_torque_ref_fl") == f"{wheels}, front left"
    assert mentions(metric("peak(yaw_rate_ref)").title, f"{measures.words('yaw_rate')} reference")


def test_whether_something_happens_in_a_run_is_shown_as_yes_or_no_and_stays_a_number():
    straight, spun = ({"plant.sideslip": x * SINE} for x in (0.1, 1.5))
    no, yes = (evaluate(results(columns, T), metric("spins(sideslip)")) for columns in (straight, spun))
    assert [shown_value(no), shown_value(yes)] == ["no", "yes"]
    table = Table("", ["run", "spins"], [["a", yes]])
    assert table.text() == [["a", "yes"]] and table.values(1) == [1.0]

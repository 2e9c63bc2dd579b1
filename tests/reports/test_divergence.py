"""Divergence of two runs."""

from __future__ import annotations

import numpy as np
import pytest

from tests.orchestrator.recorded import car, noted, results
from tests.refusals import each_mentions, mentions
from yawbench.metrics.expressions import MetricValue
from yawbench.reports.comparison_page import difference
from yawbench.reports.divergence import SAME, divergence, parting_summary, targets_of

T = np.linspace(0.0, 1.0, 101)


def two(**changed):
    """Return two runs of the same signals, the second with changes from a time on."""
    columns = {"plant.yaw_rate": np.sin(6 * T), "controller.yaw_moment": 1000 * np.cos(6 * T)}
    other = {name: values.copy() for name, values in columns.items()}
    for name, (start, amount) in changed.items():
        full = next(column for column in columns if column.endswith(name))
        other[full] += np.where(start - 1e-12 <= T, amount, 0.0)
    order = {"evaluation_order": ["controller", "plant"]}
    wires = {"connections": [{"from": "controller.yaw_moment", "to": "plant.yaw_moment"}]}
    made = [results(one, T) for one in (columns, other)]
    return [noted(one, **order, **wires) for one in made]


def test_a_run_does_not_part_from_itself():
    found = divergence(car(), car())
    assert found.partings == ()
    assert found.compared == len(car().columns)
    assert mentions(parting_summary(found), "the same throughout")


def test_the_first_moment_and_the_largest_difference_are_found():
    (one,) = divergence(*two(yaw_rate=(0.4, 0.25))).partings
    assert one.signal == "plant.yaw_rate"
    assert one.first == one.seen == pytest.approx(0.4)
    assert one.largest == pytest.approx(0.25)
    assert one.unit == "rad/s"


def test_a_difference_that_no_curve_shows_is_told_apart_from_one_that_can_be_seen_and_from_rounding():
    found = divergence(*two(yaw_rate=(0.2, 1e-4)))
    assert [(one.first, one.seen) for one in found.partings] == [(pytest.approx(0.2), None)]
    assert mentions(parting_summary(found), "difference", "visible", "curve")
    assert divergence(*two(yaw_rate=(0.2, 0.5 * SAME))).partings == ()


def test_what_parts_first_stands_first_and_in_one_instant_the_cause():
    found = divergence(*two(yaw_rate=(0.3, 0.1), yaw_moment=(0.5, 10.0)))
    assert [one.signal for one in found.partings] == ["plant.yaw_rate", "controller.yaw_moment"]
    together = divergence(*two(yaw_rate=(0.5, 0.1), yaw_moment=(0.5, 10.0)))
    assert [one.signal for one in together.partings] == ["controller.yaw_moment", "plant.yaw_rate"]
    said = parting_summary(together)
    first, seen = said.split(". ")
    assert mentions(first, "controller.yaw_moment", "0.5 s", "plant.yaw_rate")
    assert mentions(seen, "0.5 s", "plant.yaw_rate")


def test_a_signal_is_shown_with_the_units_that_take_it():
    one, other = two(yaw_moment=(0.5, 10.0))
    assert divergence(one, other).partings[0].targets == ("plant",)
    assert targets_of(one.record, "plant.yaw_rate") == ()


def test_four_wheels_are_one_signal_with_the_earliest_moment():
    a = {f"tyre.tyre_force_x_{w}": np.ones_like(T) for w in ("fl", "fr", "rl", "rr")}
    b = {name: values + np.where(0.2 * k <= T, 0.5 * k, 0.0) for k, (name, values) in enumerate(a.items())}
    (one,) = divergence(results(a, T), results(b, T)).partings
    assert (one.signal, one.first, one.largest) == ("tyre.tyre_force_x_*", pytest.approx(0.2), 1.5)


def test_a_run_that_ends_in_no_number_parts_where_it_does():
    one, other = two()
    other.columns["plant.yaw_rate"][70:] = np.nan
    (parting,) = divergence(one, other).partings
    assert (parting.first, parting.largest) == (pytest.approx(0.7), np.inf)


def test_runs_with_other_steps_are_compared_where_both_have_samples():
    fine, coarse = car(n=801), car(n=401)
    found = divergence(fine, coarse)
    assert mentions(found.notes[-1], "401", "times")
    exact = [
        one.signal for one in found.partings if "position" not in one.signal and "angle" not in one.signal
    ]
    assert exact == []  # the others are closed forms; these are sums over steps


def test_signals_of_one_run_alone_are_named():
    one, other = two()
    del other.columns["controller.yaw_moment"]
    assert each_mentions(divergence(one, other).notes, ("controller.yaw_moment", "recorded"))


@pytest.mark.parametrize(
    ("first", "second", "text"),
    [
        (MetricValue(2.0, "m/s2"), MetricValue(2.5, "m/s2"), "+0.500 m/s²"),
        (MetricValue(1.4, "%"), MetricValue(0.2, "%"), "−120 points"),
        (MetricValue(0.1, "rad"), MetricValue(0.1, "rad"), "the same"),
        (MetricValue(1.0, "s"), MetricValue(float("inf"), "s"), ""),
        (None, MetricValue(1.0, "s"), ""),
    ],
)
def test_differences_carry_their_sign_and_unit(first, second, text):
    assert difference(first, second) == text


def test_angles_of_cars_that_stand_do_not_differ_and_those_that_wrap_differ_by_little():
    def made(speed, sideslip):
        return results({"plant.velocity_x": speed + 0.0 * T, "plant.sideslip": sideslip + 0.0 * T}, T)

    stopped = (made(np.where(T < 0.5, 20.0, 0.0), np.where(T < 0.5, 0.1, rest)) for rest in (np.pi, -np.pi))
    assert divergence(*stopped).partings == ()
    (one,) = divergence(*(made(-20.0, sign * np.radians(179.0)) for sign in (1.0, -1.0))).partings
    assert one.largest == pytest.approx(np.radians(2.0))

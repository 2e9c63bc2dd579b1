"""Quantities with units: exact conversion, and sentences for what is none."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

from tests.refusals import refused
from yawbench.fmus.fmu import UnitDefinition
from yawbench.orchestrator.scenario.quantities import conversion, convert, measure_of, parse_unit, seconds


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("90 km/h", "m/s", Fraction(25)),
        ("-3.6 km/h", "m/s", Fraction(-1)),
        ("12 bar", "Pa", Fraction(1_200_000)),
        ("120 kPa", "Pa", Fraction(120_000)),
        ("20 MPa/s", "Pa/s", Fraction(20_000_000)),
        ("3 mm", "m", Fraction(3, 1000)),
        ("250 g", "kg", Fraction(1, 4)),
        ("0.5 g", "m/s2", Fraction("4.903325")),
        ("1.2 t", "kg", Fraction(1200)),
        ("5 %", "1", Fraction(1, 20)),
        ("2 min", "s", Fraction(120)),
        ("1.5 ms", "s", Fraction(3, 2000)),
        ("34 kN/m", "N/m", Fraction(34_000)),
        ("1 N/mm", "N/m", Fraction(1000)),
        ("3 N·m·s/rad", "N.m.s/rad", Fraction(3)),
        ("1343.1 kg m²", "kg.m2", Fraction("1343.1")),
        ("9 m/s^2", "m/s2", Fraction(9)),
        ("1e3Nm", "N.m", Fraction(1000)),
        ("1.2258 kg/m3", "kg/m3", Fraction("1.2258")),
        ("2 J/(kg K)", "m2/(s2.K)", Fraction(2)),
        ("5 widgets", "widgets", Fraction(5)),
    ],
)
def test_quantity_is_converted_exactly(text: str, unit: str, value: Fraction) -> None:
    assert convert(text, unit) == value


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [("180 deg", "rad", math.pi), ("30 rpm", "rad/s", math.pi), ("2 N.m/deg", "N.m/rad", 360.0 / math.pi)],
)
def test_quantity_with_pi_is_converted_to_rounding(text: str, unit: str, value: float) -> None:
    assert convert(text, unit) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "unit", "names"),
    [
        ("5 kg", "rad", ("'5 kg'", "rad", "deg", "mrad")),
        ("5 rad", "kg", ("'5 rad'", "kg", "g", "t")),
        ("fast", "m/s", ("'fast'", "m/s")),
        ("0,5 m", "m", ("'0,5 m'", "0.5 m")),
        ("5 foo", "m", ("'foo'", "m", "mm", "cm", "km")),
        ("5 kmh", "m/s", ("'kmh'", "'km/h'")),
        ("0,0325", "rad", ("'0,0325'", "0.0325")),
        ("5 m/", "m", ("'m/'", "'m'")),
        ("5 m/s.kg", "m", ("'m/s.kg'", "denominator", "parentheses")),
        ("5 m", "widgets", ("'5 m'", "widgets")),
        ("5 m", None, ("'5 m'", "unit", "declares")),
        ("5 mkg", "kg", ("'mkg'", "'kg'")),
    ],
)
def test_what_is_no_such_quantity_is_said_in_a_sentence(
    text: str, unit: str | None, names: tuple[str, ...]
) -> None:
    with refused(ValueError, names=names):
        convert(text, unit)


@pytest.mark.parametrize(
    ("a", "b"),
    [
        ("N.m", "Nm"), ("m/s2", "m/s^2"), ("kg.m2", "kg*m2"),
        ("N.(m/rad)", "N.m/rad"), ("(kg.m).s-2", "N"), ("m/(s/kg)", "kg.m/s"), ("((m))", "m"),
    ],
)  # fmt: skip
def test_units_are_the_same_if_they_mean_the_same(a: str, b: str) -> None:
    assert parse_unit(a) == parse_unit(b)
    assert conversion(parse_unit(a), parse_unit(b)) == (1.0, 0.0)


@pytest.mark.parametrize(("a", "b"), [("rad", "deg"), ("rad/s", "1/s"), ("N", "kN")])
def test_units_of_another_size_or_dimension_are_not(a: str, b: str) -> None:
    assert (1.0, 0.0) not in (
        conversion(parse_unit(a), parse_unit(b)),
        conversion(parse_unit(b), parse_unit(a)),
    )


RAD, KELVIN = (0, 0, 0, 0, 0, 0, 0, 1), (0, 0, 0, 0, 1, 0, 0, 0)


def test_what_an_fmu_defines_goes_before_the_table_but_for_rounding() -> None:
    rounded = measure_of("deg", UnitDefinition(RAD, 0.0174533))
    assert rounded == parse_unit("deg")  # the same, with fewer digits
    assert conversion(rounded, parse_unit("rad")) == (math.radians(1), 0.0)
    grad = measure_of("deg", UnitDefinition(RAD, 0.015707963267948967))
    assert conversion(grad, parse_unit("rad")) == (pytest.approx(math.pi / 200, rel=1e-15), 0.0)
    assert measure_of("widget") is None
    assert conversion(measure_of("widget", UnitDefinition(RAD)), parse_unit("rad")) == (1.0, 0.0)
    assert measure_of("deg", UnitDefinition(RAD, 0.0)) == parse_unit("deg")  # 0 is no factor


def test_offsets_are_converted_and_differences_have_none() -> None:
    celsius, fahrenheit = parse_unit("degC"), measure_of("F", UnitDefinition(KELVIN, 5 / 9, 459.67 * 5 / 9))
    assert conversion(celsius, parse_unit("K")) == (1.0, 273.15)
    gain, offset = conversion(celsius, fahrenheit)
    assert (100 * gain + offset, -40 * gain + offset) == (pytest.approx(212), pytest.approx(-40))
    assert convert("20 degC", "K") == Fraction("293.15")
    assert convert("300 K", "degC") == Fraction("26.85")
    assert conversion(parse_unit("W/degC"), parse_unit("W/K")) == (1.0, 0.0)


def test_a_quantity_is_converted_into_a_unit_that_only_the_fmu_defines() -> None:
    assert convert("180 deg", "radian", UnitDefinition(RAD)) == math.pi
    with refused(ValueError, "unit-mismatch", names=("'180 deg'", "radian", "number")):
        convert("180 deg", "radian")
    with refused(ValueError, "unit-mismatch", names=("'5 m'", "radian", "rad", "deg", "mrad")):
        convert("5 m", "radian", UnitDefinition(RAD))


@pytest.mark.parametrize(
    ("value", "time"),
    [(0.001, Fraction(1, 1000)), (8, Fraction(8)), ("1 ms", Fraction(1, 1000)), (1e-5, Fraction(1, 100_000))],
)
def test_times_are_the_fractions_that_were_written(value: object, time: Fraction) -> None:
    assert seconds(value) == time


@pytest.mark.parametrize(
    ("value", "names"),
    [
        (0, ("0 s", "time")),
        ("1e-999 s", ("1e-09 s", "'1e-999 s'")),
        ("-1 ms", ("0 s", "'-1 ms'")),
        ("1e400 s", ("'1e400 s'", "finite", "number")),
        (True, ("True", "time")),
        (math.inf, ("inf", "time")),
        ([1], ("[1]", "time")),
        ("1 m", ("'1 m'", "s", "ms", "min", "h")),
    ],
)
def test_what_is_no_time_is_said_in_a_sentence(value: object, names: tuple[str, ...]) -> None:
    with refused(ValueError, names=names):
        seconds(value)

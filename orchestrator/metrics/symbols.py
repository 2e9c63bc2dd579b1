"""Signals in symbols and words: what the field calls a variable of the signal dictionary."""

from __future__ import annotations

from functools import cache

from vocabulary.signals import SIGNALS
from vocabulary.wheels import WHEEL_NAMES

from ..scenario.measurement_units import conversion, measure_of, parse_unit

SI = ("1", "s", "m", "kg", "N", "Pa", "rad", "m/s", "rad/s", "m/s2", "rad/s2", "N.m")
"""Units that the signals of the dictionary have."""


@cache
def si_of(unit: str) -> tuple[str, float]:
    """Return the unit of the dictionary that measures the same, and the factor to it."""
    measure = measure_of(unit)
    for si in SI if measure is not None and unit not in SI else ():
        factors = conversion(measure, parse_unit(si))  # type: ignore[arg-type]
        if factors is not None and factors[1] == 0.0:
            return si, factors[0]
    return unit, 1.0


def si(unit: str) -> str:
    """Return the unit of a number as files have it: there a ratio has the unit 1, not per cent."""
    return "1" if unit == "%" else unit


def variable_of(column: str) -> str:
    """Return the variable's name of `unit.variable`, or the name itself."""
    return column.rpartition(".")[2]


def symbol(signal: str) -> str:
    """Return the symbol of a signal, or its name where the field has none."""
    name = variable_of(signal)
    if name.endswith("_ref"):
        return f"{symbol(name.removesuffix('_ref'))}_ref"
    return (SIGNALS[name].symbol if name in SIGNALS else "") or name


def words(signal: str) -> str:
    """Return the signal in words, with a capital; of one wheel with that: "Wheel torque, front left"."""
    name = variable_of(signal)
    if name[-2:] in WHEEL_NAMES and name[-3:-2] == "_":
        return f"{words(f'{name[:-2]}*')}, {WHEEL_NAMES[name[-2:]]}"
    known = SIGNALS[name].words if name in SIGNALS else ""
    return known or name.replace("_*", "").replace("_", " ").capitalize()

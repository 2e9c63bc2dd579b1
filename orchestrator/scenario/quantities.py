"""Quantities with a unit, as people write them: '90 km/h', '5 deg', '12 bar', '2 N.m/deg'.

A lone `g` is a gram where a mass is meant, else standard gravity, 9.80665 m/s2.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

from ..plan import UnitDefinition
from ..wording import closest, listed, short
from .measurement_units import Measure, UnknownUnitError, conversion, measure_of, parse_unit

LONGEST = 1e9
"""The longest time that is taken for one [s]."""
WRITTEN = 200
"""Characters of a quantity. Chosen: ten times the longest that makes sense."""
SHORTEST = Fraction(1, 10**9)
"""The shortest [s]; below, steps are lost in the rounding of time."""

_GRAVITY = replace(parse_unit("m/s2"), factor=Fraction("9.80665"))
_COMMON = (  # noqa: SIM905 - units read better as one line of text
    "s ms min h m mm cm km m/s km/h m/s2 g m2 m3 rad deg mrad rad/s deg/s rpm rad/s2 deg/s2 Hz "
    "kg g t kg.m2 kg/m3 N kN N.m kN.m N/rad kN/rad N/deg N/m kN/m N/mm N.s/m N.m/rad N.m/deg N.m.s/rad "
    "Pa kPa MPa bar Pa/s MPa/s bar/s K degC 1 %"
).split()
"""Spellings to offer in a message."""

_NUMBER = re.compile(
    r"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?)\s*(?P<unit>[A-Za-zµμ°%1(].*?)?\s*",
    re.ASCII,
)
_LARGEST = Fraction(sys.float_info.max)
_COMMA = re.compile(r"\s*([+-]?\d+),(\d+\s*[^,]*?)\s*", re.ASCII)


def number_and_unit(text: str) -> tuple[str, str] | None:
    """Return what a quantity is written as, ("80", "km/h"); None if `text` is no number with a unit."""
    match = _NUMBER.fullmatch(text) if len(text) <= WRITTEN else None
    return (match["number"], match["unit"]) if match and match["unit"] else None


def convert(text: str, unit: str | None, definition: UnitDefinition | None = None) -> Fraction | float:
    """Return the quantity `text` as a number in `unit`: a Fraction where that is exact.

    `definition` is what the FMU that declares the unit says about it.

    Raises:
        ValueError: a sentence that says what `text` should have been.
    """
    written = number_and_unit(text)
    if written is None:
        wanted = f" in {unit}" if unit else ""
        comma = _COMMA.fullmatch(text) if len(text) <= WRITTEN else None
        point = f"; write a decimal point: {comma[1]}.{comma[2]}" if comma else ""
        raise ValueError(f"{short(text)} is neither a number{wanted} nor a number with its unit{point}")
    number, given = Fraction(written[0]), written[1]
    if abs(number) > _LARGEST:
        raise ValueError(f"must be a finite number{f' in {unit}' if unit else ''} (got {text!r})")
    if given == unit:
        return number
    if unit is None:
        raise ValueError(f"{text!r} names a unit, but the FMU declares none: give a plain number")
    target = measure_of(unit, definition)
    if target is None:
        raise ValueError(f"{text!r} cannot be converted to {unit}: give a number in {unit}")
    try:
        source = _source(given, target)
    except UnknownUnitError as error:
        raise ValueError(f"{error}{_guess(given, unit, target)}") from None
    if source.powers != target.powers:
        raise ValueError(
            f"{text!r} is not a value in {unit}: use {listed(_spellings(unit, target), last='or')}"
        )
    value = converted(number, source, target)
    if value == math.inf:
        raise ValueError(f"must be a finite number in {unit} (got {text!r})")
    return value


def _source(given: str, target: Measure) -> Measure:
    """Return what a unit means where a quantity is wanted in another: `g` of an acceleration is gravity.

    Raises:
        ValueError: not a unit.
    """
    return _GRAVITY if given == "g" and target.powers == _GRAVITY.powers else parse_unit(given)


def gain_and_offset(given: str, target: Measure) -> tuple[float, float] | None:
    """Return what makes a number in a unit one in another, None if they do not fit or one is no unit."""
    try:
        return conversion(_source(given, target), target)
    except ValueError:
        return None


def converted(number: Fraction, source: Measure, target: Measure) -> Fraction | float:
    """Return a number in `source` as one in `target`, a unit of the same powers.

    It is exact where that can be, and infinite where no float is as large.
    """
    exact = (number * source.factor + source.offset - target.offset) / target.factor
    turns = source.pi - target.pi
    try:
        value = float(exact) * math.pi**turns
    except OverflowError:
        return math.inf
    if math.isinf(value):
        return math.inf
    return exact if turns == 0 else value


def _guess(given: str, unit: str, target: Measure) -> str:
    """Return "; did you mean ...?" for what is no unit, or the units that fit."""
    fitting = _spellings(unit, target)
    plain = {re.sub(r"[^a-z0-9]", "", name.lower()): name for name in reversed([*_COMMON, *fitting])}
    likely = plain.get(re.sub(r"[^a-z0-9]", "", given.lower())) or closest(given, fitting)
    return f"; did you mean {likely!r}?" if likely else f": use {listed(fitting, last='or')}"


def _spellings(unit: str, target: Measure) -> list[str]:
    """Return units that fit, the one in question first."""
    fitting = [name for name in _COMMON if parse_unit(name).powers == target.powers]
    if target.powers == _GRAVITY.powers:
        fitting.append("g")
    return list(dict.fromkeys((unit, *fitting)))


def meant_unit(number: float, given: str, unit: str, fits: Callable[[float], bool]) -> str:
    """Return the unit in which a number would be a plausible value, "" if there is none.

    Args:
        number: as it is written.
        given: the unit that it was taken to be in.
        unit: of the quantity.
        fits: whether a value in that unit is plausible.
    """
    target = parse_unit(unit)
    others = (one for one in _spellings(unit, target) if one != given)
    in_unit = ((one, converted(Fraction(number), _source(one, target), target)) for one in others)
    return next((one for one, value in in_unit if fits(float(value))), "")


def spellings(unit: str) -> list[str]:
    """Return the common units of what a unit measures, itself first."""
    return _spellings(unit, parse_unit(unit))


def instant(value: object) -> Fraction:
    """Return a point of time in s as an exact fraction of what is written: 0.001 is 1/1000.

    Raises:
        ValueError: not a time.
    """
    time = _time(value)
    if abs(time) > LONGEST:
        raise ValueError(f"must be a time of at most {LONGEST:g} s (got {value!r})")
    return time


def seconds(value: object) -> Fraction:
    """Return a span of time in s as an exact fraction of what is written.

    Raises:
        ValueError: not a positive time.
    """
    time = _time(value)
    if not 0 < time <= LONGEST:
        limit = f" and at most {LONGEST:g} s" if time > 0 else ""
        raise ValueError(f"must be a time above 0 s{limit} (got {value!r})")
    if time < SHORTEST:
        raise ValueError(f"must be a time of at least {float(SHORTEST):g} s (got {value!r})")
    return time


def _time(value: object) -> Fraction:
    if isinstance(value, str):
        return Fraction(convert(value, "s"))
    if isinstance(value, Fraction):
        return value
    if isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < math.inf:
        return Fraction(repr(value))
    raise ValueError(f"must be a time in s (got {short(value)})")

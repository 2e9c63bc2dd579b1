"""Units of measurement, and quantities written with one: '90 km/h', '5 deg', '2 N.m/deg', '1/30 s'.

A unit is a product of powers: symbols of the tables below, many with a decimal prefix, joined by `.` (also
`*`, a raised dot or a space), each with an exponent (`m2`, `m^2`, `s-1`), divided by `/`; a denominator of
several symbols is put in parentheses, or each of them after its own `/`. It is represented by powers of kg,
m, s, A, K, mol, cd, rad (FMI 2.0.4, section 2.2.2), a factor and an offset. Factors are exact fractions with
a separate power of pi, so that 90 km/h is 25 m/s to the last bit. The definition of an FMU takes precedence
over the tables, unless both agree except for rounding: then the tables have more digits.

Offsets of units, such as that of degC, apply to absolute quantities. FMI marks differences
(`relativeQuantity`): to them, and to what a fault adds to a signal, no offset applies.

A lone `g` is standard gravity, 9.80665 m/s2, where an acceleration is expected, otherwise a gram.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache, lru_cache

from yawbench.fmus.fmu import UnitDefinition, Variable
from yawbench.foundation.errors import InvalidValueError
from yawbench.foundation.messages import closest, listed, short

BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
Powers = tuple[int, int, int, int, int, int, int, int]  # of BASE_UNITS

_NONE: Powers = (0,) * 8


@dataclass(frozen=True)
class Unit:
    """A unit of measurement: a value times `factor * pi**pi`, plus `offset`, is one in base units."""

    factor: Fraction
    pi: int
    powers: Powers
    offset: Fraction = Fraction(0)
    relative: bool = False  # of differences, to which no offset applies: a rise of 7 degC is one of 7 K

    def __mul__(self, other: Unit) -> Unit:
        powers = tuple(a + b for a, b in zip(self.powers, other.powers, strict=True))
        return Unit(self.factor * other.factor, self.pi + other.pi, powers)  # type: ignore[arg-type]

    def __pow__(self, n: int) -> Unit:
        if n == 1:
            return self
        powers = tuple(n * a for a in self.powers)
        return Unit(self.factor**n, self.pi * n, powers)  # type: ignore[arg-type]


def _unit(factor: int | str = 1, pi: int = 0, **powers: int) -> Unit:
    return Unit(Fraction(factor), pi, tuple(powers.get(n, 0) for n in BASE_UNITS))  # type: ignore[arg-type]


_PREFIXED = {
    "m": _unit(m=1),
    "g": _unit("1/1000", kg=1),
    "s": _unit(s=1),
    "A": _unit(A=1),
    "K": _unit(K=1),
    "mol": _unit(mol=1),
    "cd": _unit(cd=1),
    "rad": _unit(rad=1),
    "Hz": _unit(s=-1),
    "N": _unit(kg=1, m=1, s=-2),
    "Nm": _unit(kg=1, m=2, s=-2),
    "Pa": _unit(kg=1, m=-1, s=-2),
    "J": _unit(kg=1, m=2, s=-2),
    "W": _unit(kg=1, m=2, s=-3),
    "V": _unit(kg=1, m=2, s=-3, A=-1),
    "bar": _unit(100_000, kg=1, m=-1, s=-2),
    "l": _unit("1/1000", m=3),
}
_PLAIN = {
    "1": _unit(),
    "%": _unit("1/100"),
    "min": _unit(60, s=1),
    "h": _unit(3600, s=1),
    "t": _unit(1000, kg=1),
    "deg": _unit("1/180", 1, rad=1),
    "°": _unit("1/180", 1, rad=1),
    "rev": _unit(2, 1, rad=1),
    "rpm": _unit("1/30", 1, rad=1, s=-1),
    "degC": replace(_unit(K=1), offset=Fraction("273.15")),
    "°C": replace(_unit(K=1), offset=Fraction("273.15")),
}
_PREFIXES = {
    "G": Fraction(10**9),
    "M": Fraction(10**6),
    "k": Fraction(1000),
    "c": Fraction(1, 100),
    "m": Fraction(1, 1000),
    "u": Fraction(1, 10**6),
    "µ": Fraction(1, 10**6),
    "n": Fraction(1, 10**9),
}
ROUNDING = 1e-6
"""Relative difference up to which two definitions are the same unit; chosen: definitions are often
written with seven digits, and no two units lie that close together."""

_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_TOKEN = re.compile(r"(?P<symbol>[A-Za-zµ°%]+|1)(?:\^?(?P<power>-?\d{1,2}))?|(?P<mark>[./()*·])|\s+")


class UnknownUnitError(ValueError):
    """A text is not a unit of measurement."""

    code = "unit-unknown"

    def __init__(self, text: str) -> None:
        super().__init__(f"{short(text)} is not a unit")


LONGEST_UNIT = 60
"""Maximum characters of a unit. Chosen: three times the longest that makes sense."""


def parse_unit(text: str) -> Unit:
    """Parse a unit of measurement.

    Raises:
        ValueError: not a unit.
    """
    if len(text) > LONGEST_UNIT:
        raise UnknownUnitError(text)
    plain = text.translate(_SUPERSCRIPTS).replace("μ", "µ")
    tokens: list[Unit | str] = []
    position = 0
    while position < len(plain):
        match = _TOKEN.match(plain, position)
        if match is None:
            raise UnknownUnitError(text)
        position = match.end()
        if match["symbol"]:
            tokens.append(_symbol(match["symbol"], text) ** int(match["power"] or 1))
        elif match["mark"]:
            tokens.append("." if match["mark"] in "*·" else match["mark"])
    measure, rest = _product(tokens, text)
    if rest:
        raise UnknownUnitError(text)
    return measure


def _symbol(symbol: str, text: str) -> Unit:
    known = _PLAIN.get(symbol) or _PREFIXED.get(symbol)
    if known is not None:
        return known
    prefix, base = _PREFIXES.get(symbol[0]), _PREFIXED.get(symbol[1:])
    if prefix is None or base is None:
        raise UnknownUnitError(text)
    return Unit(prefix, 0, _NONE) * base


def _product(tokens: list[Unit | str], text: str) -> tuple[Unit, list[Unit | str]]:
    """Return the product at the head of `tokens`, and the remaining tokens."""
    result, tokens = _factor(tokens, text)
    divided = False
    while tokens and tokens[0] != ")":
        mark = tokens[0]
        if mark in (".", "/"):
            tokens = tokens[1:]
        if mark != "/" and divided:
            raise ValueError(f"{text!r} is ambiguous: put the denominator in parentheses")
        factor, tokens = _factor(tokens, text)
        divided = divided or mark == "/"
        result = result * (factor**-1 if mark == "/" else factor)
    return result, tokens


def _factor(tokens: list[Unit | str], text: str) -> tuple[Unit, list[Unit | str]]:
    if tokens and isinstance(tokens[0], Unit):
        return tokens[0], tokens[1:]
    if tokens and tokens[0] == "(":
        inner, rest = _product(tokens[1:], text)
        if rest and rest[0] == ")":
            return inner, rest[1:]
    raise UnknownUnitError(text)


@cache
def measure_of(unit: str | None, definition: UnitDefinition | None = None) -> Unit | None:
    """Return the unit that an FMU declares, None if neither the FMU nor the tables define it."""
    try:
        known = parse_unit(unit) if unit else None
    except ValueError:
        known = None
    if definition is None:
        return known
    factor, offset = definition.factor, definition.offset
    if not (factor and math.isfinite(factor) and math.isfinite(offset)):
        return known
    defined = Unit(Fraction(repr(factor)), 0, definition.powers, Fraction(repr(offset)))  # type: ignore[arg-type]
    return known if known is not None and conversion(defined, known) == (1.0, 0.0) else defined


def unit_of(variable: Variable) -> Unit | None:
    """Return the unit of a variable, None if neither its FMU nor the tables define it."""
    measure = measure_of(variable.unit, variable.definition)
    return replace(measure, relative=True) if measure and variable.relative else measure


def _offset(source: Unit, target: Unit) -> Fraction:
    return Fraction(0) if source.relative or target.relative else source.offset - target.offset


def conversion(source: Unit, target: Unit) -> tuple[float, float] | None:
    """Return gain and offset that convert from `source` to `target`, None if they are incompatible.

    They are exactly 1 and 0 for equal units (see `ROUNDING`). If one of them is relative, so is the other.
    """
    if source.powers != target.powers:
        return None
    try:
        gain = float(source.factor / target.factor) * math.pi ** (source.pi - target.pi)
        offset = float(_offset(source, target) / target.factor) / math.pi**target.pi
    except OverflowError:  # extreme definitions in FMUs
        return None
    same = math.isclose(gain, 1.0, rel_tol=ROUNDING) and abs(offset) <= ROUNDING
    return (1.0, 0.0) if same else (gain, offset)


LONGEST_QUANTITY = 1e9
"""Longest accepted time [s]."""
WRITTEN = 200
"""Maximum characters of a quantity. Chosen: ten times the longest that makes sense."""
SHORTEST = Fraction(1, 10**9)
"""Shortest accepted time [s]; shorter steps are lost in the rounding of time."""

LONGEST_DENOMINATOR = 10_000
"""Denominators up to which a time is shown as a fraction. Chosen: beyond the rates of all hardware, in Hz."""

_GRAVITY = replace(parse_unit("m/s2"), factor=Fraction("9.80665"))
_COMMON = (  # noqa: SIM905 - units read better as one line of text
    "s ms min h m mm cm km m/s km/h m/s2 g m2 m3 rad deg mrad rad/s deg/s rpm rad/s2 deg/s2 Hz "
    "kg g t kg.m2 kg/m3 N kN N.m kN.m N/rad kN/rad N/deg N/m kN/m N/mm N.s/m N.m/rad N.m/deg N.m.s/rad "
    "Pa kPa MPa bar Pa/s MPa/s bar/s K degC 1 %"
).split()
"""Units to suggest in messages."""

_NUMBER = re.compile(
    r"\s*(?P<number>[+-]?(?:\d+/0*[1-9]\d*|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?))\s*(?P<unit>[A-Za-zµμ°%1(].*?)?\s*",
    re.ASCII,
)
_FRACTION = re.compile(r"\s*[+-]?\d+/0*[1-9]\d*\s*", re.ASCII)
_LARGEST = Fraction(sys.float_info.max)
_COMMA = re.compile(r"\s*([+-]?\d+),(\d+\s*[^,]*?)\s*", re.ASCII)


def number_and_unit(text: str) -> tuple[str, str] | None:
    """Split a quantity into number and unit, ("80", "km/h"); None if `text` is not a number with a unit.

    The number may be a fraction, "1/30".
    """
    match = _NUMBER.fullmatch(text) if len(text) <= WRITTEN else None
    return (match["number"], match["unit"]) if match and match["unit"] else None


def convert(
    text: str, unit: str | None, definition: UnitDefinition | None = None, *, relative: bool = False
) -> Fraction | float:
    """Convert the quantity `text` to a number in `unit`: a Fraction where that is exact.

    Args:
        text: a number with its unit.
        unit: of the result.
        definition: that of the FMU which declares the unit.
        relative: whether the quantity is a difference, to which offsets of units do not apply.

    Raises:
        ValueError: not such a quantity; the message says what is expected.
    """
    written = number_and_unit(text)
    if written is None:
        wanted = f" in {unit}" if unit else ""
        comma = _COMMA.fullmatch(text) if len(text) <= WRITTEN else None
        point = f"; write a decimal point: {comma[1]}.{comma[2]}" if comma else ""
        raise ValueError(f"{short(text)} is neither a number{wanted} nor a number with its unit{point}")
    number, written_unit = Fraction(written[0]), written[1]
    if abs(number) > _LARGEST:
        raise ValueError(f"must be a finite number{f' in {unit}' if unit else ''} (got {text!r})")
    if written_unit == unit:
        return number
    if unit is None:
        raise InvalidValueError(
            f"{text!r} names a unit, but the FMU declares none: give a plain number", code="unit-mismatch"
        )
    target = measure_of(unit, definition)
    if target is None:
        raise InvalidValueError(
            f"{text!r} cannot be converted to {unit}: give a number in {unit}", code="unit-mismatch"
        )
    try:
        source = _source(written_unit, target)
    except UnknownUnitError as error:
        raise InvalidValueError(f"{error}{_guess(written_unit, unit, target)}", code="unit-unknown") from None
    if source.powers != target.powers:
        raise InvalidValueError(
            f"{text!r} is not a value in {unit}: use {listed(spellings(unit, target), last='or')}",
            code="unit-mismatch",
        )
    value = converted(number, source, replace(target, relative=relative))
    if value == math.inf:
        raise ValueError(f"must be a finite number in {unit} (got {text!r})")
    return value


def _source(unit: str, target: Unit) -> Unit:
    """Parse the unit of a quantity that is to be converted; for accelerations `g` is standard gravity.

    Raises:
        ValueError: not a unit.
    """
    return _GRAVITY if unit == "g" and target.powers == _GRAVITY.powers else parse_unit(unit)


def gain_and_offset(unit: str, target: Unit) -> tuple[float, float] | None:
    """Return the conversion from a unit to another, None if `unit` is not a unit or incompatible."""
    try:
        return conversion(_source(unit, target), target)
    except ValueError:
        return None


def converted(number: Fraction, source: Unit, target: Unit) -> Fraction | float:
    """Convert a number from `source` to `target`, a unit of the same dimension.

    The result is exact where possible, and infinite where it is too large for a float.
    """
    exact = (number * source.factor + _offset(source, target)) / target.factor
    turns = source.pi - target.pi
    try:
        value = float(exact) * math.pi**turns
    except OverflowError:
        return math.inf
    if math.isinf(value):
        return math.inf
    return exact if turns == 0 else value


def _guess(unknown: str, unit: str, target: Unit) -> str:
    """Return "; did you mean ...?" for an unknown unit, or a list of the compatible units."""
    fitting = spellings(unit, target)
    plain = {re.sub(r"[^a-z0-9]", "", name.lower()): name for name in reversed([*_COMMON, *fitting])}
    likely = plain.get(re.sub(r"[^a-z0-9]", "", unknown.lower())) or closest(unknown, fitting)
    return f"; did you mean {likely!r}?" if likely else f": use {listed(fitting, last='or')}"


def spellings(unit: str, target: Unit | None = None) -> list[str]:
    """Return the common units of the same dimension as `unit`, itself first; `target`: `unit`, parsed."""
    target = target or parse_unit(unit)
    fitting = [name for name in _COMMON if parse_unit(name).powers == target.powers]
    if target.powers == _GRAVITY.powers:
        fitting.append("g")
    return list(dict.fromkeys((unit, *fitting)))


def meant_unit(number: float, assumed: str, unit: str, fits: Callable[[float], bool]) -> str:
    """Return the unit in which a number would be a plausible value, "" if there is none.

    Args:
        number: as written.
        assumed: the unit that the number was assumed to be in.
        unit: of the quantity.
        fits: returns whether a value in `unit` is plausible.
    """
    target = parse_unit(unit)
    others = (spelling for spelling in spellings(unit, target) if spelling != assumed)
    in_unit = (
        (spelling, converted(Fraction(number), _source(spelling, target), target)) for spelling in others
    )
    return next((spelling for spelling, value in in_unit if fits(float(value))), "")


def quantity_pattern(unit: str) -> str:
    """Return a regular expression (ECMA 262) of numbers with a unit of the same dimension as `unit`.

    It lists the units of one symbol; of products and quotients, which have countless spellings, it only asks
    for a unit.
    """
    powers = parse_unit(unit).powers
    symbols = [symbol for symbol, base in _PLAIN.items() if base.powers == powers]
    for symbol in (symbol for symbol, base in _PREFIXED.items() if base.powers == powers):
        symbols += [f"{prefix}{symbol}" for prefix in ("", *_PREFIXES)]
    units = "|".join(map(re.escape, sorted(symbols))) if unit in symbols else "[A-Za-zµ°%1(].*"
    return rf"^\s*[+-]?(\d+/0*[1-9]\d*|(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?)\s*({units})\s*$"


def instant(value: object) -> Fraction:
    """Return a point of time in s as the exact fraction of its text: 0.001 is 1/1000, and so is '1/1000 s'.

    Raises:
        ValueError: not a time.
    """
    time = _time(value)
    if abs(time) > LONGEST_QUANTITY:
        raise ValueError(f"must be a time of at most {LONGEST_QUANTITY:g} s (got {value!r})")
    return time


def seconds(value: object) -> Fraction:
    """Return a duration in s as the exact fraction of its text.

    Raises:
        ValueError: not a positive time.
    """
    time = _time(value)
    if not 0 < time <= LONGEST_QUANTITY:
        limit = f" and at most {LONGEST_QUANTITY:g} s" if time > 0 else ""
        raise ValueError(f"must be a time above 0 s{limit} (got {value!r})")
    if time < SHORTEST:
        raise ValueError(f"must be a time of at least {float(SHORTEST):g} s (got {value!r})")
    return time


def exact_text(time: Fraction) -> str:
    """Return a time in s as text that tells it from its neighbours: "0.001", "1/30", "9.99999999999"."""
    decimal = f"{float(time):.12g}"
    if Fraction(decimal) == time:
        return decimal
    return str(time) if time.denominator < LONGEST_DENOMINATOR else repr(float(time))


def _time(value: object) -> Fraction:
    if isinstance(value, Fraction):
        return value
    if isinstance(value, (str, int, float)) and not isinstance(value, bool):
        return _exact(value)
    raise ValueError(f"must be a time in s (got {short(value)})")


@lru_cache(maxsize=10_000, typed=True)
def _exact(value: str | float) -> Fraction:
    if isinstance(value, str):
        plain = len(value) <= WRITTEN and _FRACTION.fullmatch(value)
        return Fraction(value if plain else convert(value, "s"))
    if not abs(value) < math.inf:
        raise ValueError(f"must be a time in s (got {short(value)})")
    return Fraction(repr(value))

"""Quantities with a unit, as people write them: '90 km/h', '5 deg', '12 bar', '2 N.m/deg'.

A unit is a product of powers: symbols of the table below, most with a decimal prefix, joined by
`.` (also `*`, a raised dot or a space), each with an exponent (`m2`, `m^2`, `s-1`), divided by `/`;
a denominator of several symbols stands in parentheses or behind a `/` each. Two units mean the same
if they have the same powers of kg, m, s, A, K, mol, cd, rad (FMI 2.0.4, section 2.2.2) and the same
factor. Factors are exact fractions, with powers of pi beside them, so that 90 km/h is 25 m/s to the
last bit. A lone `g` is a gram where a mass is meant, else standard gravity, 9.80665 m/s2.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction

from ..wording import listed

Powers = tuple[int, int, int, int, int, int, int, int]  # kg m s A K mol cd rad

_NONE: Powers = (0,) * 8


@dataclass(frozen=True)
class Measure:
    """A unit of measurement: `factor * pi**pi` times the product of powers of base units."""

    factor: Fraction
    pi: int
    powers: Powers

    def __mul__(self, other: Measure) -> Measure:
        powers = tuple(a + b for a, b in zip(self.powers, other.powers, strict=True))
        return Measure(self.factor * other.factor, self.pi + other.pi, powers)  # type: ignore[arg-type]

    def __pow__(self, n: int) -> Measure:
        powers = tuple(n * a for a in self.powers)
        return Measure(self.factor**n, self.pi * n, powers)  # type: ignore[arg-type]


def _unit(factor: int | str = 1, pi: int = 0, **powers: int) -> Measure:
    names = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
    return Measure(Fraction(factor), pi, tuple(powers.get(n, 0) for n in names))  # type: ignore[arg-type]


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
LONGEST = 1e9
"""The longest time that is taken for one [s]."""
SHORTEST = Fraction(1, 10**9)
"""The shortest [s]; below, steps are lost in the rounding of time."""

_GRAVITY = _unit("980665/100000", m=1, s=-2)
_COMMON = (  # noqa: SIM905 - units read better as one line of text
    "s ms min h m mm cm km m/s km/h m/s2 g m2 m3 rad deg mrad rad/s deg/s rpm rad/s2 deg/s2 Hz "
    "kg g t kg.m2 kg/m3 N kN N.m kN.m N/rad kN/rad N/deg N/m kN/m N/mm N.s/m N.m/rad N.m/deg N.m.s/rad "
    "Pa kPa MPa bar Pa/s MPa/s bar/s 1 %"
).split()
"""Spellings to offer in a message."""

_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_TOKEN = re.compile(r"(?P<symbol>[A-Za-zµ°%]+|1)(?:\^?(?P<power>-?\d{1,2}))?|(?P<mark>[./()*·])|\s+")
_NUMBER = re.compile(
    r"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?)\s*(?P<unit>[A-Za-zµμ°%1(].*?)?\s*"
)


def parse_unit(text: str) -> Measure:
    """Return what the unit `text` means.

    Raises:
        ValueError: not a unit.
    """
    plain = text.translate(_SUPERSCRIPTS).replace("μ", "µ")
    tokens: list[Measure | str] = []
    position = 0
    while position < len(plain):
        match = _TOKEN.match(plain, position)
        if match is None:
            raise ValueError(f"{text!r} is not a unit")
        position = match.end()
        if match["symbol"]:
            tokens.append(_symbol(match["symbol"], text) ** int(match["power"] or 1))
        elif match["mark"]:
            tokens.append("." if match["mark"] in "*·" else match["mark"])
    measure, rest = _product(tokens, text)
    if rest:
        raise ValueError(f"{text!r} is not a unit")
    return measure


def _symbol(symbol: str, text: str) -> Measure:
    known = _PLAIN.get(symbol) or _PREFIXED.get(symbol)
    if known is not None:
        return known
    prefix, base = _PREFIXES.get(symbol[0]), _PREFIXED.get(symbol[1:])
    if prefix is None or base is None:
        raise ValueError(f"{text!r} is not a unit")
    return Measure(prefix, 0, _NONE) * base


def _product(tokens: list[Measure | str], text: str) -> tuple[Measure, list[Measure | str]]:
    """Return the product at the head of `tokens`, and what follows it."""
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


def _factor(tokens: list[Measure | str], text: str) -> tuple[Measure, list[Measure | str]]:
    if tokens and isinstance(tokens[0], Measure):
        return tokens[0], tokens[1:]
    if tokens and tokens[0] == "(":
        inner, rest = _product(tokens[1:], text)
        if rest and rest[0] == ")":
            return inner, rest[1:]
    raise ValueError(f"{text!r} is not a unit")


def same_unit(a: str | None, b: str | None) -> bool:
    """Return whether two unit strings mean the same: equal, or equal factor and powers."""
    if a == b:
        return True
    if a is None or b is None:
        return False
    try:
        return parse_unit(a) == parse_unit(b)
    except ValueError:
        return False


def convert(text: str, unit: str | None) -> Fraction | float:
    """Return the quantity `text` as a number in `unit`: a Fraction where that is exact.

    Raises:
        ValueError: a sentence that says what `text` should have been.
    """
    match = _NUMBER.fullmatch(text)
    if match is None or not match["unit"]:
        wanted = f" in {unit}" if unit else ""
        raise ValueError(f"{text!r} is neither a number{wanted} nor a number with its unit")
    number, given = Fraction(match["number"]), match["unit"]
    if given == unit:
        return number
    if unit is None:
        raise ValueError(f"{text!r} names a unit, but the FMU declares none: give a plain number")
    source = parse_unit(given)
    try:
        target = parse_unit(unit)
    except ValueError:
        raise ValueError(f"{text!r} cannot be converted to {unit}: give a number in {unit}") from None
    if given == "g" and target.powers == _GRAVITY.powers:
        source = _GRAVITY
    if source.powers != target.powers:
        raise ValueError(
            f"{text!r} is not a value in {unit}: use {listed(_spellings(unit, target), last='or')}"
        )
    exact = number * source.factor / target.factor
    turns = source.pi - target.pi
    return exact if turns == 0 else float(exact) * math.pi**turns


def _spellings(unit: str, target: Measure) -> list[str]:
    """Return units that fit, the one in question first."""
    fitting = [name for name in _COMMON if parse_unit(name).powers == target.powers]
    if target.powers == _GRAVITY.powers:
        fitting.append("g")
    return list(dict.fromkeys((unit, *fitting)))


def seconds(value: object) -> Fraction:
    """Return a time in s as an exact fraction of what is written: 0.001 is 1/1000.

    Raises:
        ValueError: not a positive time.
    """
    if isinstance(value, str):
        time = convert(value, "s")
    elif isinstance(value, Fraction):
        time = value
    elif isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value):
        time = Fraction(repr(value))
    else:
        raise ValueError(f"must be a time in s (got {value!r})")
    if not 0 < time <= LONGEST:
        limit = f" and at most {LONGEST:g} s" if time > 0 else ""
        raise ValueError(f"must be a time above 0 s{limit} (got {value!r})")
    if time < SHORTEST:
        raise ValueError(f"must be a time of at least {float(SHORTEST):g} s (got {value!r})")
    return Fraction(time)

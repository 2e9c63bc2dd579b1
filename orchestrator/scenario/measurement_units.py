"""Units of measurement by what they mean: 'N.m', 'km/h', 'm/s2', or as an FMU defines them.

A unit is a product of powers: symbols of the table below, most with a decimal prefix, joined by
`.` (also `*`, a raised dot or a space), each with an exponent (`m2`, `m^2`, `s-1`), divided by `/`;
a denominator of several symbols stands in parentheses or behind a `/` each. It stands for powers of
kg, m, s, A, K, mol, cd, rad (FMI 2.0.4, section 2.2.2), a factor and an offset. Factors are exact
fractions, with powers of pi beside them, so that 90 km/h is 25 m/s to the last bit. What an FMU
defines goes before the table; where both agree but for rounding, the table has more digits.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache

from ..plan import UnitDefinition
from ..wording import short

BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
Powers = tuple[int, int, int, int, int, int, int, int]  # of BASE_UNITS

_NONE: Powers = (0,) * 8


@dataclass(frozen=True)
class Measure:
    """A unit of measurement: a value times `factor * pi**pi`, plus `offset`, is one in base units."""

    factor: Fraction
    pi: int
    powers: Powers
    offset: Fraction = Fraction(0)

    def __mul__(self, other: Measure) -> Measure:
        powers = tuple(a + b for a, b in zip(self.powers, other.powers, strict=True))
        return Measure(self.factor * other.factor, self.pi + other.pi, powers)  # type: ignore[arg-type]

    def __pow__(self, n: int) -> Measure:
        if n == 1:
            return self
        powers = tuple(n * a for a in self.powers)
        return Measure(self.factor**n, self.pi * n, powers)  # type: ignore[arg-type]


def _unit(factor: int | str = 1, pi: int = 0, **powers: int) -> Measure:
    return Measure(Fraction(factor), pi, tuple(powers.get(n, 0) for n in BASE_UNITS))  # type: ignore[arg-type]


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
    """A text is no unit."""

    def __init__(self, text: str) -> None:
        super().__init__(f"{short(text)} is not a unit")


LONGEST = 60
"""Characters of a unit; chosen: three times the longest that makes sense."""


def parse_unit(text: str) -> Measure:
    """Return what the unit `text` means.

    Raises:
        ValueError: not a unit.
    """
    if len(text) > LONGEST:
        raise UnknownUnitError(text)
    plain = text.translate(_SUPERSCRIPTS).replace("μ", "µ")
    tokens: list[Measure | str] = []
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


def _symbol(symbol: str, text: str) -> Measure:
    known = _PLAIN.get(symbol) or _PREFIXED.get(symbol)
    if known is not None:
        return known
    prefix, base = _PREFIXES.get(symbol[0]), _PREFIXED.get(symbol[1:])
    if prefix is None or base is None:
        raise UnknownUnitError(text)
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
    raise UnknownUnitError(text)


@cache
def measure_of(unit: str | None, definition: UnitDefinition | None = None) -> Measure | None:
    """Return what a unit means that an FMU declares, None if neither the FMU nor the table says."""
    try:
        known = parse_unit(unit) if unit else None
    except ValueError:
        known = None
    if definition is None:
        return known
    factor, offset = definition.factor, definition.offset
    if not (factor and math.isfinite(factor) and math.isfinite(offset)):
        return known
    defined = Measure(Fraction(repr(factor)), 0, definition.powers, Fraction(repr(offset)))  # type: ignore[arg-type]
    return known if known is not None and conversion(defined, known) == (1.0, 0.0) else defined


def conversion(source: Measure, target: Measure) -> tuple[float, float] | None:
    """Return gain and offset that make a number in `source` one in `target`, None if they do not fit.

    They are 1 and 0 exactly where both mean the same (see `ROUNDING`).
    """
    if source.powers != target.powers:
        return None
    try:
        gain = float(source.factor / target.factor) * math.pi ** (source.pi - target.pi)
        offset = float((source.offset - target.offset) / target.factor) / math.pi**target.pi
    except OverflowError:  # by definitions of FMUs
        return None
    same = math.isclose(gain, 1.0, rel_tol=ROUNDING) and abs(offset) <= ROUNDING
    return (1.0, 0.0) if same else (gain, offset)

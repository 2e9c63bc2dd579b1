"""Units as loggers write them: `mph`, `deg/sec`, `Meters/second`, `G`, `[km/h]`.

Scenario files have the units of `scenario.quantities` alone; what is ambiguous there (`G` is a prefix, `kt`
might be a weight) is not in the heading of a column.
"""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction

from yawbench.foundation.messages import listed

from ..scenario.quantities import Unit, conversion, parse_unit, spellings

WORDS = {
    word: symbol
    for symbol, words in {
        "s": "s sec secs second seconds", "ms": "ms msec millisecond milliseconds",
        "us": "us usec microseconds", "min": "minute minutes mins", "h": "h hr hrs hour hours",
        "m": "m meter meters metre metres", "km": "km kilometers kilometres", "cm": "cm", "mm": "mm",
        "mi": "mile miles", "ft": "foot feet", "in": "inch inches", "deg": "deg degree degrees",
        "rad": "rad radian radians", "rpm": "rpm", "Hz": "hz", "N": "n newton newtons", "Nm": "nm",
        "kg": "kg", "g": "g", "kn": "kn", "bar": "bar", "mbar": "mbar", "kPa": "kpa", "Pa": "pa",
        "V": "v", "A": "a", "degC": "celsius degc", "%": "percent pct",
    }.items()
    for word in words.split()
}  # fmt: skip
"""Word in small letters -> symbol; read only where the text is not a unit as it stands."""
WHOLE = {
    "kph": "km/h", "kmh": "km/h", "kmph": "km/h", "kmhr": "km/h", "mps": "m/s", "dps": "deg/s",
    "u/min": "rpm", "r/min": "rpm", "c": "degC", "degc": "degC", ".c": "degC",
}  # fmt: skip
"""Likewise of whole texts."""


def _times(number: str | Fraction, unit: str) -> Unit:
    known = parse_unit(unit)
    return replace(known, factor=Fraction(number) * known.factor)


GRAVITY = _times("9.80665", "m/s2")
_FAHRENHEIT = replace(_times(Fraction(5, 9), "K"), offset=Fraction(45967, 180))
_FOOT, _POUND = Fraction("0.3048"), Fraction("4.4482216152605")
MORE = {
    name: _times(number, unit)
    for names, number, unit in (
        ("mph mi/h", "0.44704", "m/s"), ("ft/s", _FOOT, "m/s"),
        ("kn kt kts knot knots", Fraction(1852, 3600), "m/s"),
        ("ft", _FOOT, "m"), ("in", "0.0254", "m"), ("mi", "1609.344", "m"), ("yd", "0.9144", "m"),
        ("lb lbs", "0.45359237", "kg"), ("lbf", _POUND, "N"), ("ftlb ftlbs lbft", _POUND * _FOOT, "N.m"),
        ("psi", _POUND / Fraction("0.00064516"), "Pa"),
    )
    for name in names.split()
} | {"f": _FAHRENHEIT, "degf": _FAHRENHEIT, "g": GRAVITY}  # fmt: skip
"""Units that scenario files do not have, and `G`."""
OF_GRAVITY = {text: GRAVITY for text in ("g", "gs", "g's")} | {"mg": _times("0.00980665", "m/s2")}
"""Likewise where an acceleration is expected."""
NO_UNIT = frozenset(("", "-", "--", "#", "(null)", "null", "none", "no unit", "unitless", "n/a", "[]", "()"))


def stated_unit(text: str | None) -> str | None:
    """Return the unit that a file states, without brackets and quotes; None if it states none."""
    plain = (text or "").strip()
    while len(plain) > 2 and plain[0] + plain[-1] in ("[]", "()", "{}", "''", '""'):
        plain = plain[1:-1].strip()
    return None if plain.lower() in NO_UNIT else plain


def unit_in_file(text: str, target: Unit | None = None) -> Unit | None:
    """Return the unit that a text of a file means, None if it is not known.

    Args:
        text: see `stated_unit`.
        target: what it is to be converted to; a lone `g` is standard gravity where that is an acceleration.
    """
    if target is not None and target.powers == GRAVITY.powers and text.lower() in OF_GRAVITY:
        return OF_GRAVITY[text.lower()]
    small = re.sub(r"\s+", "", text.lower()).replace("°", "deg")
    words = re.sub(
        r"[a-z%]+", lambda word: WORDS.get(word[0], word[0]), re.sub(r"\s*/\s*", "/", text.lower())
    )
    plain = words.replace("°", "deg").replace("_", "").strip()
    for spelling in (text, WHOLE.get(small, "")):
        if (known := _parsed(spelling)) is not None:
            return known
    return MORE.get(small.replace("-", "").replace(".", "")) or MORE.get(plain) or _parsed(plain)


def _parsed(text: str) -> Unit | None:
    try:
        return parse_unit(text)
    except ValueError:
        return None


def how_to_give(fitting: str) -> str:
    """Return how to describe a column whose unit is not known, in one of the fitting units."""
    return f"write 'unit: ...' with {fitting}, and 'gain: ...', the factor that converts its numbers to it"


def factors(unit: str, wanted: Unit, says: str, what: str) -> tuple[float, float]:
    """Return gain and offset that convert the numbers of a column to a unit.

    Args:
        unit: of the column, as the file or its description states it.
        wanted, says: the unit to convert to, and its name for messages.
        what: the column for messages.

    Raises:
        ValueError: the unit is not known, or of another kind.
    """
    known = unit_in_file(unit, wanted)
    if known is None:
        fitting = listed(spellings(says) if _parsed(says) else [says], last="or")
        raise ValueError(f"{what}: unknown unit {unit!r}: {how_to_give(fitting)}")
    between = conversion(known, wanted)
    if between is None:
        raise ValueError(f"{what}: its unit {unit!r} does not fit: {says} is wanted")
    return between

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
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "millisecond": "ms",
    "milliseconds": "ms", "usec": "us", "microseconds": "us", "minute": "min", "minutes": "min",
    "mins": "min", "hr": "h", "hrs": "h", "hour": "h", "hours": "h",
    "meter": "m", "meters": "m", "metre": "m", "metres": "m", "kilometers": "km", "kilometres": "km",
    "degree": "deg", "degrees": "deg", "radian": "rad", "radians": "rad", "newton": "N", "newtons": "N",
    "mile": "mi", "miles": "mi", "foot": "ft", "feet": "ft", "inch": "in", "inches": "in",
    "celsius": "degC", "degc": "degC", "percent": "%", "pct": "%",
    "s": "s", "ms": "ms", "us": "us", "h": "h", "m": "m", "km": "km", "cm": "cm", "mm": "mm", "deg": "deg",
    "rad": "rad", "rpm": "rpm", "hz": "Hz", "bar": "bar", "mbar": "mbar", "kpa": "kPa", "pa": "Pa",
    "kg": "kg", "n": "N", "kn": "kn", "nm": "Nm", "g": "g", "v": "V", "a": "A",
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
_POUND = Fraction("4.4482216152605")
MORE = {
    "mph": _times("0.44704", "m/s"), "mi/h": _times("0.44704", "m/s"), "ft/s": _times("0.3048", "m/s"),
    "kn": _times(Fraction(1852, 3600), "m/s"), "kt": _times(Fraction(1852, 3600), "m/s"),
    "kts": _times(Fraction(1852, 3600), "m/s"), "knot": _times(Fraction(1852, 3600), "m/s"),
    "knots": _times(Fraction(1852, 3600), "m/s"),
    "ft": _times("0.3048", "m"), "in": _times("0.0254", "m"), "mi": _times("1609.344", "m"),
    "yd": _times("0.9144", "m"), "lb": _times("0.45359237", "kg"), "lbs": _times("0.45359237", "kg"),
    "lbf": _times(_POUND, "N"), "psi": _times(_POUND / Fraction("0.00064516"), "Pa"),
    "ftlb": _times(_POUND * Fraction("0.3048"), "N.m"), "lbft": _times(_POUND * Fraction("0.3048"), "N.m"),
    "ftlbs": _times(_POUND * Fraction("0.3048"), "N.m"),
    "f": replace(_times(Fraction(5, 9), "K"), offset=Fraction(45967, 180)),
    "degf": replace(_times(Fraction(5, 9), "K"), offset=Fraction(45967, 180)),
    "g": GRAVITY,
}  # fmt: skip
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

"""Signals and numbers as people read them: formulas, degrees, km/h, per cent, few digits."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from vocabulary.units import SHOWN

from ..metrics.symbols import si_of, symbol, variable_of
from ..results.read import Results

RESOLUTION = 1e-3
"""Of angles and their rates, as shown [°, °/s, °/s²]; chosen: less than any sensor of a car can tell."""
ROUNDING = 1e-12
"""Relative difference of two numbers that is none."""
DIGITS, EXACT = 3, 17
"""Significant digits of a number, and with how many no two floats read alike."""


class Run(NamedTuple):
    """A run and what the legend calls it."""

    label: str
    results: Results


def in_formula(signal: str) -> str:
    """Return the symbol of a signal as matplotlib sets it, or nothing where the field has none."""
    if symbol(signal) == variable_of(signal):
        return ""
    head, _, index = symbol(signal).partition("_")
    return f"${head}_\\mathrm{{{index}}}$" if index else f"${head}$"


def shown_unit(unit: str) -> tuple[str, float]:
    """Return the unit that people read and the factor to it; `%` stands for a ratio in per cent."""
    if unit in SHOWN:
        return SHOWN[unit]
    si, to_si = si_of(unit)
    text, factor = SHOWN.get(si, (si.replace(".", "·"), 1.0))
    return text, to_si * factor


def shown(value: float, unit: str, *, digits: int = DIGITS, half: float = 0.0) -> str:
    """Return a value given in SI as text in the unit that people read, e.g. `3.94 %`; `< 0.001 °` of less.

    With `half`, half the width of its confidence interval: `3.94 ± 0.12 %`.
    """
    text, factor = shown_unit(unit)
    coarse = digits <= DIGITS and not half
    if text.startswith("°") and 0 < abs(value * factor) < RESOLUTION and coarse:
        return f"< {RESOLUTION:g} {text}"
    number = digits_of(value * factor, digits)
    if half:
        number += f" ± {digits_of(half * factor, 2)}"
    return f"{number} {text}".rstrip() if math.isfinite(value) else number


def digits_apart(pairs: Iterable[tuple[float, float]], unit: str, digits: int = DIGITS) -> int:
    """Return the least digits, at least so many, with which the numbers of each pair read differently.

    Numbers that are equal are left alone, and so are those that differ by nothing but rounding.
    """
    for a, b in pairs:
        if not math.isfinite(a) or not math.isfinite(b) or math.isclose(a, b, rel_tol=ROUNDING):
            continue
        while digits < EXACT and shown(a, unit, digits=digits) == shown(b, unit, digits=digits):
            digits += 1
    return digits


def digits_of(value: float, digits: int = DIGITS) -> str:
    """Return a number with so many significant digits, whole digits all kept, no exponent if readable."""
    if math.isinf(value):
        return "never" if value > 0 else "-∞"
    if math.isnan(value):
        return "no number"
    if value == 0:
        return "0"
    rounded = float(f"{value:.{digits - 1}e}")
    decimals = digits - 1 - math.floor(math.log10(abs(rounded)))
    return f"{value:.{digits - 1}e}" if decimals > 6 else f"{value:.{max(decimals, 0)}f}"

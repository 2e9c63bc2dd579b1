"""How numbers and signals are shown: in degrees, km/h and per cent, with few digits, by their symbols."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from yawbench.metrics.expressions import MetricValue
from yawbench.metrics.measures import si_of, symbol, variable_of
from yawbench.orchestrator.results.reader import Results
from yawbench.vocabulary.units import SHOWN

RESOLUTION = 1e-3
"""Resolution of displayed angles and rates [°, °/s, °/s²]; chosen: finer than any sensor of a car."""
ROUNDING = 1e-12
"""Relative difference up to which two numbers count as equal."""
DIGITS, EXACT = 3, 17
"""Default significant digits, and the number with which no two floats read alike."""


class LabelledRun(NamedTuple):
    """A run and its label in the legend."""

    label: str
    results: Results


def in_formula(signal: str) -> str:
    """Return the symbol of a signal in matplotlib's math text, "" if it has none."""
    name = variable_of(signal)
    if symbol(name) == name:
        return ""
    head, _, index = symbol(name).partition("_")
    return f"${head}_\\mathrm{{{index}}}$" if index else f"${head}$"


SIGNAL_IN_PERCENT = "% of a signal"


def unit_of_signal(unit: str) -> str:
    """Return the unit for `shown` and `shown_unit` of a recorded signal; one in per cent is no ratio."""
    return SIGNAL_IN_PERCENT if unit == "%" else unit


def shown_unit(unit: str) -> tuple[str, float]:
    """Return the displayed unit and the factor to it; `%` marks a ratio in per cent."""
    if unit == SIGNAL_IN_PERCENT:
        return "%", 1.0
    if unit in SHOWN:
        return SHOWN[unit]
    si, to_si = si_of(unit)
    text, factor = SHOWN.get(si, (si.replace(".", "·"), 1.0))
    return text, to_si * factor


def shown(
    value: float,
    unit: str,
    *,
    digits: int = DIGITS,
    half: float = 0.0,
    between: tuple[float, float] | None = None,
) -> str:
    """Format an SI value in its displayed unit, e.g. `3.94 %`; smaller than the resolution: `< 0.001 °`.

    With `half`, half the width of its confidence interval: `3.94 ± 0.12 %`; with `between`, two bounds:
    `3.94 (3.61 to 4.02) %`.
    """
    text, factor = shown_unit(unit)
    if between is not None:
        low, high = (digits_of(bound * factor, digits) for bound in between)
        return f"{digits_of(value * factor, digits)} ({low} to {high}) {text}".rstrip()
    coarse = digits <= DIGITS and not half
    if text.startswith("°") and 0 < abs(value * factor) < RESOLUTION and coarse:
        return f"< {RESOLUTION:g} {text}"
    number = digits_of(value * factor, digits)
    if half:
        number += f" ± {digits_of(half * factor, 2)}"
    return f"{number} {text}".rstrip() if math.isfinite(value) else number


def shown_value(value: MetricValue, *, digits: int = DIGITS) -> str:
    """Format the value of a metric, with its interval; whether something happens in a run as yes or no."""
    if value.whether:
        return "yes" if value.number else "no"
    return shown(value.number, value.shown_in, digits=digits, half=value.half, between=value.between)


def digits_apart(pairs: Iterable[tuple[float, float]], unit: str, digits: int = DIGITS) -> int:
    """Return the fewest digits, at least `digits`, with which the numbers of each pair read differently.

    Pairs that are equal, or differ only by rounding, are ignored.
    """
    for a, b in pairs:
        if not math.isfinite(a) or not math.isfinite(b) or math.isclose(a, b, rel_tol=ROUNDING):
            continue
        while digits < EXACT and shown(a, unit, digits=digits) == shown(b, unit, digits=digits):
            digits += 1
    return digits


READABLE = 1e15
"""Size from which numbers have an exponent: beyond it, not all digits before the point are known."""


def digits_of(value: float, digits: int = DIGITS) -> str:
    """Format a number with `digits` significant digits, all integer digits kept, no exponent if readable."""
    if math.isinf(value):
        return "never" if value > 0 else "-∞"
    if math.isnan(value):
        return "no number"
    if value == 0:
        return "0"
    rounded = float(f"{value:.{digits - 1}e}")
    decimals = digits - 1 - math.floor(math.log10(abs(rounded)))
    return (
        f"{value:.{digits - 1}e}"
        if decimals > 6 or abs(value) >= READABLE
        else f"{value:.{max(decimals, 0)}f}"
    )

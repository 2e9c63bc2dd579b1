"""The page on how far the numbers can be trusted, from what the tests have measured."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from .text import cell, code, table

FILE = Path(__file__).resolve().parents[1] / "evidence.json"
CHAPTERS = {
    "cars": (
        "Cars on tyres against independent solutions",
        "The reference is either a second implementation of the same equations as one system, with "
        "the loops of load, force and acceleration closed at every instant, solved by scipy with "
        "much tighter tolerances, or a model by others. The table has the largest difference over "
        "the whole run, relative to the peak, of the worst signal, at a step of 1 ms with the "
        "`extrapolated` algorithm.",
    ),
    "tyres": (
        "Tyres against second implementations",
        "The largest relative difference of a force or moment over many slips, loads and frictions.",
    ),
    "order": (
        "Convergence",
        "The observed order of the coupling error against the same solutions, from steps of 4 and "
        "1 ms, of 2 and 1 ms where inputs are held. With order p, halving the step divides the "
        "error by 2^p.",
    ),
    "energy": (
        "Energy",
        "Energy that appears or vanishes without a source or sink in the model, as a share of the "
        "energy exchanged.",
    ),
    "mirror": (
        "Left and right",
        "The largest difference between a manoeuvre and its mirror image; it should be zero.",
    ),
    "masters": (
        "Other masters",
        "The same FMUs run by other co-simulation masters, with their own algorithm: the "
        "largest difference of any signal as a share of its range.",
    ),
}
"""Key in the record -> heading, what its figures are."""


def page() -> str:
    """Return the page of everything that is recorded."""
    record = json.loads(FILE.read_text(encoding="utf-8"))
    parts = [
        "# How far to trust the numbers",
        "*The named tests measure the numbers on this page, record them, and check them on every "
        "run; the page is generated from that record.*",
        "The numbers show how accurately the program solves its models, not whether the models "
        "match a paper or a real car: see [how far a verdict carries](regions.md) and "
        "[limits](limits.md).",
    ]
    for key, (heading, text) in CHAPTERS.items():
        rows = [_row(place, entry) for place, entry in record.get(key, {}).items()]
        parts += [f"## {heading}", text, table(("quantity", "reference", "measured", "limit", "test"), rows)]
    return "\n\n".join(part for part in parts if part)


def _row(place: str, entry: dict[str, Any]) -> tuple[str, ...]:
    what, _, against = place.partition(" | ")
    sign = "≥" if entry["at_least"] else "≤"
    file = Path(entry["test"].partition("::")[0]).stem
    limit = f"{sign} {_number(entry['limit'])}"
    return cell(what), cell(against), _number(entry["figure"]), limit, code(file)


def _number(value: float) -> str:
    if value == 0:
        return "0"
    if 1e-3 <= abs(value) < 1e4:
        return f"{value:.3g}"
    exponent = math.floor(math.log10(abs(value)))
    digits = f"{value / 10**exponent:.3g}"
    power = f"10<sup>{exponent}</sup>"
    return power if digits == "1" else f"{digits}&nbsp;·&nbsp;{power}"

"""Compatibility of outputs and inputs: types, units of measurement, items of enumerations."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache

from vocabulary.signals import SYMBOLS

from ..messages import listed
from ..plan import Variable
from ..scenario.quantities import conversion, measure_of


def conversion_between(source: Variable, target: Variable) -> tuple[float, float] | None:
    """Return gain and offset between the units of two variables, None if the units are incompatible.

    A variable without a unit is taken to have that of the other.
    """
    if source.unit is None or target.unit is None:
        return 1.0, 0.0
    if (source.unit, source.definition) == (target.unit, target.definition):
        return 1.0, 0.0
    measures = measure_of(source.unit, source.definition), measure_of(target.unit, target.definition)
    if measures[0] is None or measures[1] is None:
        return (1.0, 0.0) if source.unit == target.unit else None
    return conversion(measures[0], measures[1])


DIFFERENCES = {
    "types": "wiring-type-mismatch",
    "units": "wiring-unit-mismatch",
    "enumerations": "wiring-enumeration-mismatch",
}
"""Property in which the ends of a wire differ -> code."""


def contradicts_its_name(variable: Variable) -> bool:
    usual, defined = measure_of(variable.unit), measure_of(variable.unit, variable.definition)
    return usual is not None and usual != defined


LOSSLESS = {
    ("Integer", "Real"),
    ("Boolean", "Real"),
    ("Integer", "Enumeration"),
    ("Enumeration", "Integer"),
}
"""Types of output and input that differ, and whose wires convert without loss: false and true are 0 and 1, an
Integer that is the number of an item is that item."""


def compatible(source: Variable, target: Variable) -> bool:
    """Return whether the type of an output can feed that of an input."""
    return source.type == target.type or (source.type, target.type) in LOSSLESS


def difference(
    source: Variable, target: Variable, scale: tuple[float, float] | None
) -> tuple[str, str | None, str | None] | None:
    """Return why two variables cannot be connected (what differs, the source's, the target's), else None."""
    if not compatible(source, target):
        return "types", source.type, target.type
    if scale is None:
        return "units", source.unit, target.unit
    if target.type != "Enumeration":
        return None
    known = target.items or {}
    if source.type == "Enumeration":
        sent = source.items or {}
        return None if sent.items() <= known.items() else ("enumerations", _listed(sent), _listed(known))
    if source.variability == "constant" and source.start is not None and source.start not in known.values():
        return "enumerations", str(source.start), _listed(known)
    return None


def _listed(items: Mapping[str, int]) -> str:
    return listed(f"{name} {value}" for name, value in items.items())


def alike(output: str, name: str) -> int:
    """Return how many words the names of an output and of an input share: 0 if it should not be suggested.

    A reference value does not match an actual value.
    """
    words = words_of(output), words_of(name)
    return len(words[0] & words[1]) if ("ref" in words[0]) == ("ref" in words[1]) else 0


@cache
def words_of(name: str) -> frozenset[str]:
    """Return the words of a signal's name, symbols translated: of `PsiDot` and `yaw_rate` yaw and rate.

    Words of up to two letters do not count.
    """
    words = [name, *re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)]
    translated = "_".join(SYMBOLS.get(word.lower(), word.lower()) for word in words)
    return frozenset(word for word in translated.split("_") if len(word) > 2)


def fits(source: Variable, target: Variable) -> bool:
    alike = compatible(source, target) and (source.unit is None) == (target.unit is None)
    return alike and conversion_between(source, target) is not None

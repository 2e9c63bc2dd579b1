"""Whether an output can feed an input, with what gain and offset: types, units of measurement, items."""

from __future__ import annotations

from ..plan import Variable
from ..scenario.measurement_units import conversion, measure_of
from ..wording import listed


def conversion_between(source: Variable, target: Variable) -> tuple[float, float] | None:
    """Return gain and offset from one end's unit to the other's, None if they do not fit.

    A unit that an end does not declare is taken to be the other's.
    """
    if source.unit is None or target.unit is None:
        return 1.0, 0.0
    if (source.unit, source.definition) == (target.unit, target.definition):
        return 1.0, 0.0
    measures = measure_of(source.unit, source.definition), measure_of(target.unit, target.definition)
    if measures[0] is None or measures[1] is None:
        return (1.0, 0.0) if source.unit == target.unit else None
    return conversion(measures[0], measures[1])


def contradicts_its_name(variable: Variable) -> bool:
    usual, defined = measure_of(variable.unit), measure_of(variable.unit, variable.definition)
    return usual is not None and usual != defined


def difference(
    source: Variable, target: Variable, scale: tuple[float, float] | None
) -> tuple[str, str | None, str | None] | None:
    """Return in what two ends differ that cannot be connected, and what each has of it."""
    if source.type != target.type:
        return "types", source.type, target.type
    if scale is None:
        return "units", source.unit, target.unit
    items = source.items or {}, target.items or {}
    if source.type == "Enumeration" and not items[0].items() <= items[1].items():
        of, to = (listed(f"{name} {value}" for name, value in each.items()) for each in items)
        return "enumerations", of, to
    return None


def alike(output: str, name: str) -> bool:
    """Return whether an output may be what an input of another name means: names share a word.

    A unit of measurement alone says nothing, and a reference is not the value that should follow it.
    """
    words = [{word for word in one.split("_") if len(word) > 2} for one in (output, name)]
    return bool(words[0] & words[1]) and ("ref" in words[0]) == ("ref" in words[1])


def fits(source: Variable, target: Variable) -> bool:
    alike = source.type == target.type and (source.unit is None) == (target.unit is None)
    return alike and conversion_between(source, target) is not None

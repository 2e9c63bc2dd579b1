"""What the connections of an SSP archive do to numbers: units of connectors, linear transformations.

On every connection a number is first converted from the unit of its start into that of its end, unless
the connection suppresses that, and then transformed. A connector without a unit has that of its FMU's
variable, a system's that of what it is connected to.
"""

from __future__ import annotations

from collections.abc import Sequence

from lxml.etree import _Element

from .measurement_units import Measure, conversion
from .ssp_archive import Refused
from .ssp_structure import End, Structure
from .ssp_values import linear

Scale = tuple[float, float]
"""Gain and offset."""

AS_IT_IS: Scale = (1.0, 0.0)


def scale(structure: Structure, chain: Sequence[End]) -> Scale:
    """Return what becomes of a number on its way, from what gives it through connectors to what takes it.

    Raises:
        Refused: units that do not fit, or a transformation that is not linear.
    """
    total = AS_IT_IS
    measure: Measure | None = None
    connection: _Element | None = None
    for end in chain:
        outside, inside = structure.unit_outside(end), structure.unit_inside(end)
        if end is chain[0]:
            stops = [inside, outside]
        else:
            connection = structure.sources[end][1]
            if connection.get("suppressUnitConversion") in ("true", "1"):
                measure = None
            total, measure = _converted(total, measure, outside, end, connection)
            total = _then(total, linear(connection))
            stops = [inside]
        for stop in stops:
            total, measure = _converted(total, measure, stop, end, connection)
    return total


def automatic(structure: Structure, source: End, target: End) -> Scale | None:
    """Return what a wire does by itself, of what the two FMUs declare; None if it is refused."""
    of, to = (structure.components[end.element].variables.get(end.name) for end in (source, target))
    if of is None or to is None or of.measure is None or to.measure is None:
        return AS_IT_IS
    return conversion(of.measure, to.measure)


def _converted(
    total: Scale, measure: Measure | None, target: Measure | None, end: End, element: _Element | None
) -> tuple[Scale, Measure | None]:
    if measure is None or target is None:
        return total, target or measure
    between = conversion(measure, target)
    if between is None:
        raise Refused(f"the units on the way to {end} differ", element)
    return _then(total, between), target


def _then(first: Scale, second: Scale) -> Scale:
    return second[0] * first[0], second[0] * first[1] + second[1]

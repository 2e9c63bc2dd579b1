"""The scalar variables of a model description, whichever version of FMI it is written in."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Any
from xml.etree import ElementTree

from ..plan import UnitDefinition, Value, Variable
from .binary import INTEGERS

_KINDS = {"Float32": "Real", "Float64": "Real"} | dict.fromkeys(INTEGERS, "Integer")
"""Type of FMI 3.0 -> what it is to a scenario; others are called alike."""
_REFUSED = {
    "Binary": "is Binary, which is not supported",
    "Clock": "is a Clock, which is not supported",
}
MOST = 100_000
"""Elements of an array, beyond which it is not supported. Chosen: more than any interface has."""


def scalars(description: Any, root: ElementTree.Element) -> tuple[dict[str, Variable], dict[str, str]]:
    """Return the variables by name, arrays element by element, and why others cannot be used.

    Args:
        description: fmpy's.
        root: of the same model description.
    """
    variables: dict[str, Variable] = {}
    refused: dict[str, str] = {}
    elements = {e.get("name"): e for e in root.iterfind("ModelVariables/*")}
    modern = description.fmiVersion != "2.0"
    follows, definitions = _dependencies(description), _definitions(description)
    for v in description.modelVariables:
        element = elements[v.alias.name if v.alias else v.name]
        if why := _reason(v):
            refused[v.name] = why
            continue
        declared = v.declaredType
        kind = _KINDS.get(v.type, v.type)
        unit = v.unit or (declared.unit if declared else None)
        said = _said(element)
        choices = tuple(said["choices"].split(", ")) if "choices" in said else ()
        items = (
            {i.name: int(i.value) for i in declared.items} if v.type == "Enumeration" and declared else None
        )
        names = element_names(v.name, v.shape or ())
        starts = _starts(v, kind, element, len(names))
        limits = element if modern else v  # fmpy does not read those of all types of FMI 3.0
        for i, name in enumerate(names):
            variables.setdefault(
                name,
                Variable(
                    name=name,
                    reference=v.valueReference,
                    type=kind,
                    causality=v.causality,
                    variability=v.variability,
                    unit=unit,
                    start=starts[i],
                    minimum=_limit(limits, declared, "min"),
                    maximum=_limit(limits, declared, "max"),
                    description=(v.description or "").removesuffix(f" (one of: {', '.join(choices)})"),
                    depends_on=follows.get(id(v.alias or v)) if v.causality == "output" else None,
                    choices=choices or None,
                    items=items,
                    optional=v.causality == "input" and "optional" in said,
                    source=said.get("source", ""),
                    definition=definitions.get(unit),
                    encoding=("Int64" if kind == "Enumeration" else v.type) if modern else None,
                    element=i,
                    elements=len(names),
                ),
            )
    return variables, refused


def element_names(name: str, shape: tuple[int, ...]) -> list[str]:
    """Return the names of an array's elements, row by row, counted from 1; a scalar's own name."""
    if not shape:
        return [name]
    places = itertools.product(*(range(1, n + 1) for n in shape))
    return [f"{name}[{','.join(map(str, place))}]" for place in places]


def _reason(v: Any) -> str | None:
    """Return why a variable cannot be used, None if it can."""
    if v.type in _REFUSED:
        return _REFUSED[v.type]
    if v.clocks:
        return "belongs to a Clock, which is not supported"
    if math.prod(v.shape or ()) > MOST:
        return f"has {math.prod(v.shape)} elements; supported are {MOST}"
    if v.alias and v.causality == "input":
        return f"is another name of {v.alias.name}: use that"
    return None


def _dependencies(description: Any) -> dict[int, tuple[str, ...] | None]:
    """Return what each output follows: the names of inputs, None if it is not said."""

    def names(known: Any) -> Iterator[str]:
        for v in known:
            if v.causality == "input":
                yield from element_names(v.name, v.shape or ())

    return {
        id(unknown.variable): None if unknown.dependencies is None else tuple(names(unknown.dependencies))
        for unknown in description.outputs
    }


def _definitions(description: Any) -> dict[str | None, UnitDefinition]:
    """Return what the description defines in base units, by the name of the unit."""
    return {
        unit.name: UnitDefinition(
            (base.kg, base.m, base.s, base.A, base.K, base.mol, base.cd, base.rad), base.factor, base.offset
        )
        for unit in description.unitDefinitions
        if (base := unit.baseUnit) is not None
    }


def _said(element: ElementTree.Element) -> dict[str, str]:
    """Return what our own units say of a variable beyond the standard: optional, choices, source."""
    said = element.find("Annotations/Tool[@name='yawbench']/variable")
    return {} if said is None else said.attrib


def _starts(v: Any, kind: str, element: ElementTree.Element, count: int) -> list[Value | None]:
    """Return the start value of every element; one value stands for all."""
    texts: list[str | None]
    if not v.shape:
        texts = [v.start]
    elif kind == "String":
        texts = [start.get("value") for start in element.iterfind("Start")]
    else:
        texts = list((v.start or "").split())
    if len(texts) == 1:
        texts *= count
    if texts and len(texts) != count:
        raise ValueError(f"{v.name!r} has {len(texts)} start values for {count} elements")
    return [_value(kind, text) for text in texts] or [None] * count


def _value(kind: str, text: str | None) -> Value | None:
    if text is None or kind == "String":
        return text
    if kind == "Boolean":
        return text in ("true", "1")
    return float(text) if kind == "Real" else int(text)


def _limit(v: Mapping[str, str] | Any, declared: Any, which: str) -> float | None:
    own = v.get(which) if isinstance(v, ElementTree.Element) else getattr(v, which)
    text = own or (getattr(declared, which) if declared else None)
    return None if text is None else float(text)

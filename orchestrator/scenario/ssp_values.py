"""The values that an SSP archive binds to variables, by name, of inner systems and then of outer ones.

Of several values for one variable that of the outermost system counts, and on one level the last. A
name that nothing has is passed over, as the standard has it, but not without a word.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

from lxml import etree
from lxml.etree import _Element

from ..plan import UnitDefinition
from .measurement_units import measure_of
from .quantities import converted
from .ssp_archive import Archive, Declared, Refused, unit_definitions
from .ssp_names import MAPPING_TYPE, SSD, SSM, SSV, VALUES_TYPE
from .ssp_structure import End, Structure


@dataclass(frozen=True)
class Given:
    """A value as the archive gives it."""

    value: Any
    unit: str | None
    parameter: _Element
    definition: UnitDefinition | None = None  # of the unit, if the archive gives one
    factor: float = 1.0
    offset: float = 0.0

    def for_variable(self, declared: Declared | None) -> Any:
        """Return what a scenario file would say for a variable: a plain value, or one with its unit.

        Raises:
            Refused: a transformation of what is no number, or of a unit that does not fit.
        """
        value = self._in_unit_of(declared)
        if (self.factor, self.offset) == (1.0, 0.0):
            return value
        if isinstance(value, (bool, str)):
            raise Refused(
                f"{self._name}: a LinearTransformation is for numbers (got {value})", self.parameter
            )
        result = self.factor * value + self.offset
        if isinstance(value, float):
            return result
        if not result.is_integer():
            raise Refused(f"{self._name}: {result:g} is no whole number", self.parameter)
        return int(result)

    def _in_unit_of(self, declared: Declared | None) -> Any:
        """Return the value converted, or with its unit where that does not fit, for wiring to refuse it."""
        unit = declared.unit if declared else None
        if not isinstance(self.value, float) or self.unit is None or unit is None or self.unit == unit:
            return self.value
        source, target = measure_of(self.unit, self.definition), declared.measure if declared else None
        if source is None or target is None or source.powers != target.powers:
            return f"{self.value!r} {self.unit}"
        return float(converted(Fraction(repr(self.value)), source, target))

    @property
    def _name(self) -> str:
        return f"parameter {self.parameter.get('name')!r}"


@dataclass
class Values:
    """What is given to variables and connectors, and the names that nothing has."""

    given: dict[End, Given] = field(default_factory=dict)
    unknown: list[str] = field(default_factory=list)


def read_values(archive: Archive, structure: Structure) -> Values:
    """Return everything that is bound in a structure.

    Raises:
        Refused: values that cannot be read.
    """
    values = Values()
    elements = {path: one.element for path, one in structure.components.items()}
    for path, element in (elements | structure.systems).items():  # outer ones last
        for name, given in _bound(archive, element):
            end = structure.find(path, name)
            if end is not None:
                values.given[end] = given
            else:
                values.unknown.append(str(End(path, name)))
    return values


def _bound(archive: Archive, element: _Element) -> Iterator[tuple[str, Given]]:
    """Yield the names that an element's bindings give values to."""
    for binding in element.iterfind(f"{{{SSD}}}ParameterBindings/{{{SSD}}}ParameterBinding"):
        _check_type(binding, VALUES_TYPE)
        values = binding.find(f"{{{SSD}}}ParameterValues/{{{SSV}}}ParameterSet")
        if values is None:
            if not binding.get("source"):
                raise Refused("parameters are bound that are nowhere", binding)
            values = archive.xml(archive.member(binding), f"{{{SSV}}}ParameterSet")
        mapping = _mapping(archive, binding)
        definitions = unit_definitions(values.iterfind(f"{{{SSV}}}Units/*"))
        for parameter in values.iterfind(f"{{{SSV}}}Parameters/{{{SSV}}}Parameter"):
            name, given = binding.get("prefix", "") + parameter.get("name", ""), _value(parameter)
            given = replace(given, definition=definitions.get(str(given.unit)))
            if mapping is None:
                yield name, given
            for entry in (mapping or {}).get(name, ()):
                yield entry.get("target", ""), _transformed(given, entry)


def _mapping(archive: Archive, binding: _Element) -> dict[str, list[_Element]] | None:
    """Return the entries of a binding's mapping by the name they are for, None if it has none."""
    mapping = binding.find(f"{{{SSD}}}ParameterMapping")
    if mapping is None:
        return None
    _check_type(mapping, MAPPING_TYPE)
    content = mapping.find(f"{{{SSM}}}ParameterMapping")
    if content is None:
        content = archive.xml(archive.member(mapping), f"{{{SSM}}}ParameterMapping")
    entries: dict[str, list[_Element]] = {}
    for entry in content.iterfind(f"{{{SSM}}}MappingEntry"):
        entries.setdefault(entry.get("source", ""), []).append(entry)
    return entries


def _check_type(element: _Element, allowed: str) -> None:
    if element.get("type", allowed) != allowed:
        raise Refused(f"{element.get('type')} is not supported: only {allowed} is", element)


def _transformed(given: Given, entry: _Element) -> Given:
    """Return a value with what a mapping does to it."""
    if entry.get("suppressUnitConversion") in ("true", "1"):
        given = replace(given, unit=None)
    factor, offset = linear(entry)
    return replace(given, factor=factor, offset=offset)


def linear(element: _Element) -> tuple[float, float]:
    """Return factor and offset by which a connection or a mapping transforms numbers.

    Raises:
        Refused: its transformation is of another kind, or one of them is no number.
    """
    for one in element.iterchildren("{*}*"):
        kind = etree.QName(one).localname
        if kind == "LinearTransformation":
            return number(one, "factor", 1.0), number(one, "offset", 0.0)
        if kind.endswith("Transformation"):
            raise Refused(f"{kind} is not supported: only LinearTransformation is", one)
    return 1.0, 0.0


def _value(parameter: _Element) -> Given:
    for kind in parameter.iterchildren("{*}*"):
        name, text = etree.QName(kind).localname, kind.get("value", "")
        try:
            if name == "Real":
                return Given(float(text), kind.get("unit"), parameter)
            if name == "Integer":
                return Given(int(text), None, parameter)
            if name == "Boolean":
                meant = {"true": True, "1": True, "false": False, "0": False}[text.strip()]
                return Given(meant, None, parameter)
        except (ValueError, KeyError):
            raise Refused(
                f"parameter {parameter.get('name')!r}: {text!r} is not of type {name}", parameter
            ) from None
        if name in ("String", "Enumeration"):
            return Given(text, None, parameter)
        if name == "Binary":
            raise Refused(f"parameter {parameter.get('name')!r} is Binary: not supported", parameter)
    raise Refused(f"parameter {parameter.get('name')!r} has no value", parameter)


def number(element: _Element, attribute: str, default: float | None = None) -> float:
    """Return an attribute's number; what is read from its shortest decimal is exact.

    Raises:
        Refused: it is none.
    """
    text = element.get(attribute)
    if text is None and default is not None:
        return default
    try:
        return float(text or "")
    except ValueError:
        raise Refused(f"{attribute} {text or ''!r} is no number", element) from None

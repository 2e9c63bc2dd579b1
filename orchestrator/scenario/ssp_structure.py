"""Components, connections and parameter values of an SSP archive, with nested systems flattened.

The start and end of a connection do not determine its direction: the kinds of its connectors do. Inside a
system, its own inputs are sources and its outputs are targets.

Parameter values are bound to variables by name, first those of inner systems, then those of outer ones. Of
several values for a variable, that of the outermost system wins, on the same level the last. Unknown names
are ignored, as the standard requires, but with a note.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, NamedTuple

from lxml import etree
from lxml.etree import _Element

from ..plan import UnitDefinition
from .quantities import Unit, converted, measure_of
from .ssp_archive import (
    FMU_TYPE,
    MAPPING_TYPE,
    SSD,
    SSM,
    SSV,
    VALUES_TYPE,
    SspArchive,
    SspError,
    SspVariable,
    unit_definitions,
)

ElementPath = tuple[str, ...]
"""Path of an element: the names of the systems that contain it, without the outermost, then its own."""

_GIVES = {"output": True, "calculatedParameter": True, "input": False, "parameter": False}


class SspEnd(NamedTuple):
    """A connector of an element, or a variable of a component."""

    element: ElementPath
    name: str

    def __str__(self) -> str:
        return ".".join((*self.element, self.name))


@dataclass(frozen=True)
class SspComponent:
    """An FMU in a system."""

    path: ElementPath
    element: _Element
    member: str
    variables: dict[str, SspVariable]


@dataclass
class SspStructure:
    """The components, nested systems, connectors and connections of a system."""

    components: dict[ElementPath, SspComponent] = field(default_factory=dict)
    systems: dict[ElementPath, _Element] = field(default_factory=dict)
    """Path -> system, from the innermost to the outermost."""
    connectors: dict[ElementPath, dict[str, SspVariable]] = field(default_factory=dict)
    """Element -> name of a connector -> its kind and unit, if given."""
    sources: dict[SspEnd, tuple[SspEnd, _Element]] = field(default_factory=dict)
    """Target -> its source and the connection between them."""

    def unit_inside(self, end: SspEnd) -> Unit | None:
        """Return the unit of a variable from its FMU, else that of its connector."""
        known = self.components[end.element].variables if end.element in self.components else {}
        return (known[end.name].measure if end.name in known else None) or self.connector(end).measure

    def unit_outside(self, end: SspEnd) -> Unit | None:
        """Return the unit of a connector, else that of its variable."""
        return self.connector(end).measure or self.unit_inside(end)

    def connector(self, end: SspEnd) -> SspVariable:
        """Return the declaration of a connector, an empty one if the archive has none."""
        return self.connectors[end.element].get(end.name, SspVariable(None))

    def upstream(self, end: SspEnd) -> list[SspEnd]:
        """Return the chain of sources of an end: connectors of systems, then a component's output, if any.

        Raises:
            SspError: connections form a cycle.
        """
        ends: list[SspEnd] = []
        while end in self.sources:
            end, connection = self.sources[end]
            if end in ends:
                raise SspError(f"connections go round in a circle through {end}", connection)
            ends.append(end)
            if end.element in self.components:
                break
        return ends

    def find(self, path: ElementPath, name: str) -> SspEnd | None:
        """Resolve a hierarchical name in the element `path`, None if there is no such variable."""
        if path in self.components:
            known = self.components[path].variables
            return SspEnd(path, name) if name in known or not known else None
        if name in self.connectors[path]:
            return SspEnd(path, name)
        for inner in (*self.components, *self.systems):
            if inner[:-1] == path and inner and name.startswith(f"{inner[-1]}."):
                end = self.find(inner, name[len(inner[-1]) + 1 :])
                if end is not None:
                    return end
        return None


def read_structure(archive: SspArchive, system: _Element) -> SspStructure:
    """Read a system.

    Raises:
        SspError: it has unsupported features.
    """
    structure = SspStructure()
    definitions = unit_definitions(system.iterfind(f"../{{{SSD}}}Units/*"))
    _add_system(structure, archive, system, (), definitions)
    return structure


def _add_system(
    structure: SspStructure,
    archive: SspArchive,
    system: _Element,
    path: ElementPath,
    definitions: Mapping[str, UnitDefinition],
) -> None:
    structure.connectors[path] = _connectors(system, definitions)
    names: set[str] = set()
    for element in system.iterfind(f"{{{SSD}}}Elements/*"):
        kind, name = etree.QName(element).localname, element.get("name", "")
        if not name or name in names:
            raise SspError(f"two elements are called {name!r}" if name else "an element has no name", element)
        names.add(name)
        inner = (*path, name)
        if kind == "System":
            _add_system(structure, archive, element, inner, definitions)
        elif kind == "Component":
            structure.components[inner] = _component(archive, element, inner)
            structure.connectors[inner] = _connectors(element, definitions)
        elif kind == "SignalDictionaryReference":
            raise SspError(f"a signal dictionary ({name}) is not supported", element, code="ssp-unsupported")
        else:
            raise SspError(
                f"an element of kind {kind} ({name}) is not supported", element, code="ssp-unsupported"
            )
    for connection in system.iterfind(f"{{{SSD}}}Connections/{{{SSD}}}Connection"):
        source, sink = _directed(structure, connection, path)
        before, _ = structure.sources.setdefault(sink, (source, connection))
        if before != source:
            raise SspError(f"{sink} has more than one source: {before} and {source}", connection)
    structure.systems[path] = system


def _connectors(element: _Element, definitions: Mapping[str, UnitDefinition]) -> dict[str, SspVariable]:
    connectors = {}
    for connector in element.iterfind(f"{{{SSD}}}Connectors/{{{SSD}}}Connector"):
        unit = next((kind.get("unit") for kind in connector if kind.get("unit")), None)
        connectors[str(connector.get("name"))] = SspVariable(
            connector.get("kind", ""), unit, definitions.get(str(unit))
        )
    return connectors


def _component(archive: SspArchive, element: _Element, path: ElementPath) -> SspComponent:
    name, kind, source = ".".join(path), element.get("type", FMU_TYPE), element.get("source", "")
    if kind != FMU_TYPE or not source.lower().endswith(".fmu"):
        raise SspError(
            f"component {name!r} is not an FMU (type {kind}, source {source!r}): only FMUs are supported",
            element,
            code="ssp-unsupported",
        )
    implementation = element.get("implementation", "any")
    if implementation not in ("any", "CoSimulation"):
        raise SspError(
            f"component {name!r} wants {implementation}: only CoSimulation is supported",
            element,
            code="ssp-unsupported",
        )
    member = archive.member(element)
    return SspComponent(path, element, member, archive.variables(member, element))


def _directed(structure: SspStructure, connection: _Element, path: ElementPath) -> tuple[SspEnd, SspEnd]:
    """Return source and target of a connection in the system `path`."""
    start, end = (_end(structure, connection, which, path) for which in ("start", "end"))
    start_gives, end_gives = (_gives(structure, side, path) for side in (start, end))
    if start_gives is not None and start_gives == end_gives:
        what = "gives a value" if start_gives else "takes a value"
        raise SspError(f"cannot connect {start} and {end}: each {what}", connection)
    return (end, start) if start_gives is False or end_gives else (start, end)


def _end(structure: SspStructure, connection: _Element, which: str, path: ElementPath) -> SspEnd:
    element, name = connection.get(f"{which}Element"), connection.get(f"{which}Connector", "")
    inner = (*path, element) if element else path
    if inner not in structure.connectors:
        raise SspError(
            f"a connection names {element!r}: there is no such component", connection, code="file-missing"
        )
    if inner not in structure.components and name not in structure.connectors[inner]:
        system = f"the system {'.'.join(inner)}" if inner else "the system"
        raise SspError(
            f"a connection names the connector {name!r}: {system} has none of this name", connection
        )
    return SspEnd(inner, name)


def _gives(structure: SspStructure, end: SspEnd, path: ElementPath) -> bool | None:
    """Return whether an end is a source in the system `path`, None if undeclared."""
    kind = structure.connector(end).causality
    if end.element in structure.components:
        declared = structure.components[end.element].variables.get(end.name)
        kind = declared.causality if declared else kind
    gives = _GIVES.get(kind or "")
    return gives if gives is None or end.element != path else not gives


@dataclass(frozen=True)
class SspValue:
    """A parameter value as in the archive."""

    value: Any
    unit: str | None
    parameter: _Element
    definition: UnitDefinition | None = None  # of the unit, if the archive gives one
    factor: float = 1.0
    offset: float = 0.0

    def for_variable(self, declared: SspVariable | None) -> Any:
        """Return the value for a variable as in a scenario file: a plain value, or one with its unit.

        Raises:
            SspError: a transformation of something other than a number, or with an incompatible unit.
        """
        value = self._in_unit_of(declared)
        if (self.factor, self.offset) == (1.0, 0.0):
            return value
        if isinstance(value, (bool, str)):
            raise SspError(
                f"{self._name}: a LinearTransformation is for numbers (got {value})", self.parameter
            )
        result = self.factor * value + self.offset
        if isinstance(value, float):
            return result
        if not result.is_integer():
            raise SspError(f"{self._name}: {result:g} is not a whole number", self.parameter)
        return int(result)

    def _in_unit_of(self, declared: SspVariable | None) -> Any:
        """Return the converted value; if units are incompatible, with its unit, so that wiring refuses it."""
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
class SspValues:
    """The values of variables and connectors, and the unknown names."""

    known: dict[SspEnd, SspValue] = field(default_factory=dict)
    unknown: list[str] = field(default_factory=list)


def read_values(archive: SspArchive, structure: SspStructure) -> SspValues:
    """Read all parameter bindings of a structure.

    Raises:
        SspError: values cannot be read.
    """
    values = SspValues()
    elements = {path: component.element for path, component in structure.components.items()}
    for path, element in (elements | structure.systems).items():  # outer ones last
        for name, value in _bound(archive, element):
            end = structure.find(path, name)
            if end is not None:
                values.known[end] = value
            else:
                values.unknown.append(str(SspEnd(path, name)))
    return values


def _bound(archive: SspArchive, element: _Element) -> Iterator[tuple[str, SspValue]]:
    """Yield (name, value) of an element's parameter bindings."""
    for binding in element.iterfind(f"{{{SSD}}}ParameterBindings/{{{SSD}}}ParameterBinding"):
        _check_type(binding, VALUES_TYPE)
        values = binding.find(f"{{{SSD}}}ParameterValues/{{{SSV}}}ParameterSet")
        if values is None:
            if not binding.get("source"):
                raise SspError("parameters are bound that are nowhere", binding)
            values = archive.xml(archive.member(binding), f"{{{SSV}}}ParameterSet")
        mapping = _mapping(archive, binding)
        definitions = unit_definitions(values.iterfind(f"{{{SSV}}}Units/*"))
        for parameter in values.iterfind(f"{{{SSV}}}Parameters/{{{SSV}}}Parameter"):
            name, value = binding.get("prefix", "") + parameter.get("name", ""), _value(parameter)
            value = replace(value, definition=definitions.get(str(value.unit)))
            if mapping is None:
                yield name, value
            for entry in (mapping or {}).get(name, ()):
                yield entry.get("target", ""), _transformed(value, entry)


def _mapping(archive: SspArchive, binding: _Element) -> dict[str, list[_Element]] | None:
    """Return the entries of a binding's mapping by source name, None if it has no mapping."""
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
        raise SspError(
            f"{element.get('type')} is not supported: only {allowed} is", element, code="ssp-unsupported"
        )


def _transformed(value: SspValue, entry: _Element) -> SspValue:
    """Return a value with the transformation of a mapping entry."""
    if entry.get("suppressUnitConversion") in ("true", "1"):
        value = replace(value, unit=None)
    factor, offset = linear(entry)
    return replace(value, factor=factor, offset=offset)


def linear(element: _Element) -> tuple[float, float]:
    """Return factor and offset of the linear transformation of a connection or mapping entry.

    Raises:
        SspError: the transformation is of another kind, or has a malformed number.
    """
    for child in element.iterchildren("{*}*"):
        kind = etree.QName(child).localname
        if kind == "LinearTransformation":
            return number(child, "factor", 1.0), number(child, "offset", 0.0)
        if kind.endswith("Transformation"):
            raise SspError(
                f"{kind} is not supported: only LinearTransformation is", child, code="ssp-unsupported"
            )
    return 1.0, 0.0


def _value(parameter: _Element) -> SspValue:
    for kind in parameter.iterchildren("{*}*"):
        name, text = etree.QName(kind).localname, kind.get("value", "")
        try:
            if name == "Real":
                unit = kind.get("unit")
                if unit and (bare := re.fullmatch(r"\[(.+)\]", unit.strip())):
                    unit = bare[1]  # as tools write units behind names
                return SspValue(float(text), unit, parameter)
            if name == "Integer":
                return SspValue(int(text), None, parameter)
            if name == "Boolean":
                meant = {"true": True, "1": True, "false": False, "0": False}[text.strip()]
                return SspValue(meant, None, parameter)
        except (ValueError, KeyError):
            raise SspError(
                f"parameter {parameter.get('name')!r}: {text!r} is not of type {name}", parameter
            ) from None
        if name in ("String", "Enumeration"):
            return SspValue(text, None, parameter)
        if name == "Binary":
            raise SspError(
                f"parameter {parameter.get('name')!r} is Binary: not supported",
                parameter,
                code="ssp-unsupported",
            )
    raise SspError(f"parameter {parameter.get('name')!r} has no value", parameter)


def number(element: _Element, attribute: str, default: float | None = None) -> float:
    """Return an attribute as a number.

    Raises:
        SspError: it is not a number.
    """
    text = element.get(attribute)
    if text is None and default is not None:
        return default
    try:
        return float(text or "")
    except ValueError:
        raise SspError(f"{attribute} {text or ''!r} is not a number", element) from None

"""Reads an SSP 1.0 archive as a scenario, with the content of an equivalent YAML file.

Every component becomes an instance whose FMU is the member of the archive. Only the connections of the
archive are made, and an input without connection and value keeps its FMU's start value, as the standard
requires. The communication step and the steps of instances come from annotations of the Open Simulation
Platform or of OMSimulator, everything else that SSP cannot express from annotations of our own; archives of
other tools may lack them.

On every connection a number is first converted from the unit of its start to that of its end, unless the
connection suppresses that, and then linearly transformed. A connector of an FMU without a unit has that of
its variable, a connector of a system that of the connector it is connected to.

Parameter values are bound to variables by name, first those of inner systems, then those of outer ones. Of
several values for a variable, that of the outermost system wins, on the same level the last. Unknown names
are ignored, as the standard requires, but with a note.

Unsupported features are refused by name: signal dictionaries, mappings in connections, components that are
not FMUs.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from lxml import etree
from lxml.etree import _Element

from ..errors import Diagnostic, Location
from ..fmu.fmu import UnitDefinition
from ..messages import fold, listed
from ..signal_names import RESERVED
from .quantities import Unit, conversion, converted, measure_of
from .ssp_archive import (
    DESCRIPTION_FILE,
    MAPPING_TYPE,
    OMS,
    OSP,
    OWN,
    SSD,
    SSM,
    SSV,
    VALUES_TYPE,
    ElementPath,
    SspArchive,
    SspEnd,
    SspError,
    SspStructure,
    SspVariable,
    linear,
    number,
    read_structure,
    unit_definitions,
)
from .yaml_lines import Document

Scale = tuple[float, float]
"""Gain and offset."""

AS_IT_IS: Scale = (1.0, 0.0)


def scale(structure: SspStructure, chain: Sequence[SspEnd]) -> Scale:
    """Return the total gain and offset along a chain of connectors from source to target.

    Raises:
        SspError: units are incompatible, or a transformation is not linear.
    """
    total = AS_IT_IS
    measure: Unit | None = None
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


def automatic(structure: SspStructure, source: SspEnd, target: SspEnd) -> Scale | None:
    """Return the conversion that wiring makes from the units of two FMUs; None if they are incompatible."""
    of, to = (structure.components[end.element].variables.get(end.name) for end in (source, target))
    if of is None or to is None or of.measure is None or to.measure is None:
        return AS_IT_IS
    return conversion(of.measure, to.measure)


def _converted(
    total: Scale, measure: Unit | None, target: Unit | None, end: SspEnd, element: _Element | None
) -> tuple[Scale, Unit | None]:
    if measure is None or target is None:
        return total, target or measure
    between = conversion(measure, target)
    if between is None:
        raise SspError(f"the units on the way to {end} differ", element)
    return _then(total, between), target


def _then(first: Scale, second: Scale) -> Scale:
    return second[0] * first[0], second[0] * first[1] + second[1]


def read(path: Path, *, what: str = "SSP archive") -> Document:
    """Read the archive `path`; its errors are added to the document."""
    document = Document(path)
    try:
        document.data = _scenario(SspArchive(path, what=what), document)
    except SspError as refused:
        document.add(refused.diagnostic(path))
    return document


def missing_times(document: Document) -> list[Diagnostic]:
    """Return an error for each time that neither the archive nor an option gives."""
    wanted = {"stop_time": ("stop time", "10"), "step_size": ("communication step", "0.001")}
    return [
        Diagnostic(
            "key-missing",
            f"the archive says no {words}: give one in s, such as --set {name}={such_as}",
            location=Location(document.path),
        )
        for name, (words, such_as) in wanted.items()
        if name not in document.data
    ]


def _scenario(archive: SspArchive, document: Document) -> dict[str, Any]:
    """Return the content of an equivalent scenario file."""
    root = archive.xml(DESCRIPTION_FILE, f"{{{SSD}}}SystemStructureDescription")
    system = root.find(f"{{{SSD}}}System")
    if system is None:
        raise SspError(f"{DESCRIPTION_FILE} contains no system")
    structure = read_structure(archive, system)
    names = _instance_names(structure, document)
    values = read_values(archive, structure)
    if values.unknown:
        shown = listed(fold(list(dict.fromkeys(values.unknown))))
        sentence = f"the archive gives values to {shown}: ignored, as there are no such variables"
        document.notes.append(Diagnostic("variable-unknown", sentence, "info"))
    by_end = _values_through_connectors(structure, values.known)
    connections, driven = _connections(structure, names)
    by_end = {end: ssp_value for end, ssp_value in by_end.items() if end not in driven}

    instances: dict[str, Any] = {}
    inputs: dict[str, Any] = {}
    for path, component in structure.components.items():
        name = names[path]
        instances[name] = {"fmu": f"{archive.path.name}/{component.member}", "parameters": {}}
        document.lines[("units", name)] = component.element.sourceline or 1
        hint = component.element.find(f".//{{{OSP}}}StepSizeHint")
        if hint is not None:
            instances[name]["step_size"] = number(hint, "value")
    for (path, variable), ssp_value in by_end.items():
        if path not in structure.components:
            continue
        declared = structure.components[path].variables.get(variable)
        value = ssp_value.for_variable(declared)
        if declared is not None and declared.causality == "input":
            inputs[f"{names[path]}.{variable}"] = value
        else:
            instances[names[path]]["parameters"][variable] = value
    return {
        "title": _title(root),
        "source": root.get("description", ""),
        "units": instances,
        "connections": connections,
        "inputs": inputs,
    } | _experiment(root)


def _title(root: _Element) -> str:
    """Return the title from our annotation, else the name of the structure, which is only an identifier."""
    own = root.find(f".//{{{OWN}}}Scenario")
    name = root.get("name", "")
    return str(name if own is None else own.get("title", name))


def _instance_names(structure: SspStructure, document: Document) -> dict[ElementPath, str]:
    """Return the instance name of each component: that in the archive, changed where it is not allowed."""
    names: dict[ElementPath, str] = {}
    for path, component in structure.components.items():
        name = re.sub(r"[^A-Za-z0-9_]", "_", "_".join(path))
        if name[0].isdigit() or name in RESERVED:
            name = f"_{name}"
        if name in names.values():
            raise SspError(f"two components would be called {name!r} as instances", component.element)
        names[path] = name
    renamed = [f"{name} ({'.'.join(path)})" for path, name in names.items() if path != (name,)]
    if renamed:
        sentence = f"instances renamed from their names in the archive: {listed(renamed)}"
        document.notes.append(Diagnostic("instance-renamed", sentence, "info"))
    return names


def _values_through_connectors(
    structure: SspStructure, values: Mapping[SspEnd, SspValue]
) -> dict[SspEnd, SspValue]:
    """Return the values, with those from connectors of systems replacing those of components."""
    passed = {}
    for end in structure.sources:
        through = [
            connector
            for connector in structure.upstream(end)
            if connector in values and connector.element in structure.systems
        ]
        if through and end.element in structure.components:
            passed[end] = _passed_on(structure, values[through[-1]], through[-1], end)
    return {**values, **passed}


def _passed_on(structure: SspStructure, ssp_value: SspValue, connector: SspEnd, end: SspEnd) -> SspValue:
    """Return the value of a system's connector after conversion on its way to a component."""
    ways = structure.upstream(end)
    way = scale(structure, [*reversed(ways[: ways.index(connector) + 1]), end])
    if way == AS_IT_IS:
        return ssp_value
    value = ssp_value.for_variable(structure.connector(connector))
    if not isinstance(value, float):
        raise SspError(
            f"{end}: only numbers can be converted on the way from {connector}", ssp_value.parameter
        )
    return replace(ssp_value, value=way[0] * value + way[1], unit=None, factor=1.0, offset=0.0)


def _connections(
    structure: SspStructure, names: Mapping[ElementPath, str]
) -> tuple[list[dict[str, Any]], set[SspEnd]]:
    """Return the connections between components, and the ends that they drive."""
    connections: list[dict[str, Any]] = []
    driven = set()
    for end in structure.sources:
        source, *way = *reversed(structure.upstream(end)), end
        if end.element not in structure.components or source.element not in structure.components:
            continue
        ends: dict[str, Any] = {
            "from": f"{names[source.element]}.{source.name}",
            "to": f"{names[end.element]}.{end.name}",
        }
        gain, offset = scale(structure, [source, *way])
        usual = automatic(structure, source, end)
        if usual is None or not all(map(math.isclose, (gain, offset), usual)):
            ends |= {"gain": gain, "offset": offset}
        connections.append(ends)
        driven.add(end)
    return connections, driven


def _experiment(root: _Element) -> dict[str, Any]:
    """Return times, algorithm and recorded signals, as far as the archive gives them."""
    settings: dict[str, Any] = {}
    experiment = root.find(f"{{{SSD}}}DefaultExperiment")
    if experiment is not None:
        if start := number(experiment, "startTime", 0.0):
            settings["start_time"] = start
        if experiment.get("stopTime") is not None:
            settings["stop_time"] = number(experiment, "stopTime")
    for tag, attribute in (
        (f"{{{OMS}}}FixedStepMaster", "stepSize"),
        (f"{{{OSP}}}FixedStepAlgorithm", "baseStepSize"),
    ):
        step = root.find(f".//{tag}")
        if step is not None and step.get(attribute):
            settings["step_size"] = number(step, attribute)
    own = root.find(f".//{{{OWN}}}Scenario")
    if own is not None:
        settings["step_size"] = number(own, "stepSize")
        settings["algorithm"] = own.get("algorithm")
        record = [str(element.get("variable")) for element in own.iterfind(f"{{{OWN}}}Record")]
        settings |= {"record": record} if record else {}
    return settings


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

"""Reads an SSP archive, of version 1.0 or 2.0, as a scenario with the content of an equivalent YAML file.

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

Unsupported features are refused by name: transformations other than linear ones in connections, components
that are not FMUs.
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

from yawbench.fmus.description import INTEGERS
from yawbench.fmus.fmu import UnitDefinition, Value, integer_limits
from yawbench.foundation.errors import Diagnostic
from yawbench.foundation.messages import fold, listed

from ..signal_names import RESERVED
from .quantities import Unit, conversion, converted, measure_of
from .ssp_archive import (
    DESCRIPTION_FILE,
    MAPPING_TYPE,
    OMS,
    OSP,
    OWN,
    SSC,
    SSD,
    SSM,
    SSV,
    TEXTS,
    VALUES_TYPE,
    ElementPath,
    SspArchive,
    SspEnd,
    SspError,
    SspStructure,
    check_type,
    linear,
    number,
    read_structure,
    required,
    transformation,
    unit_definitions,
    unsupported,
)
from .yaml_lines import Document

LACKS = "the archive says"
"""What messages say of a time that is not there."""
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
    relative = _relative(structure, chain)
    for end in chain:
        outside, inside = structure.unit_outside(end), structure.unit_inside(end)
        if end is chain[0]:
            stops = [inside, outside]
        else:
            connection = structure.sources[end][1]
            if _suppresses(connection):
                measure = None
            total, measure = _converted(total, measure, outside, end, connection, relative)
            total = _then(total, linear(connection))
            stops = [inside]
        for stop in stops:
            total, measure = _converted(total, measure, stop, end, connection, relative)
    return total


def _suppresses(element: _Element) -> bool:
    return element.get("suppressUnitConversion") in ("true", "1")


def _relative(structure: SspStructure, chain: Sequence[SspEnd]) -> bool | None:
    """Return whether the quantity on a chain of connectors is a difference, None if its ends disagree."""
    ends = [structure.variable(end) for end in (chain[0], chain[-1])]
    said = {end.relative for end in ends if end is not None}
    return None if len(said) > 1 else said == {True}


def automatic(structure: SspStructure, source: SspEnd, target: SspEnd) -> Scale | None:
    """Return the conversion that wiring makes from the units of two FMUs; None if they are incompatible."""
    of, to = structure.variable(source), structure.variable(target)
    if of is None or to is None or of.measure is None or to.measure is None:
        return AS_IT_IS
    return conversion(of.measure, to.measure)


def _converted(
    total: Scale,
    measure: Unit | None,
    target: Unit | None,
    end: SspEnd,
    element: _Element | None,
    relative: bool | None,
) -> tuple[Scale, Unit | None]:
    """Return the scale and the unit after the conversion to `target`; `relative`: see `_relative`."""
    if measure is None or target is None:
        return total, target or measure
    if relative is None and measure.offset != target.offset:
        raise SspError(
            f"the offset of the units on the way to {end} is ambiguous: one end is a difference "
            "(relativeQuantity), the other is not; suppressUnitConversion with a LinearTransformation says "
            "what is meant",
            element,
        )
    between = conversion(replace(measure, relative=bool(relative)), target)
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
        document.add(refused.diagnostic(path if path.parent.is_dir() else path.parent))
    return document


def _scenario(archive: SspArchive, document: Document) -> dict[str, Any]:
    """Return the content of an equivalent scenario file."""
    root = archive.xml(archive.description, f"{{{SSD}}}SystemStructureDescription")
    system = root.find(f"{{{SSD}}}System")
    if system is None:
        raise SspError(f"{archive.description} contains no system")
    if note := _variants(archive):
        document.notes.append(Diagnostic("ssp-variants", note, "info"))
    structure = read_structure(archive, system)
    names = _instance_names(structure, document)
    values = read_values(archive, structure)
    if values.unknown:
        shown = listed(fold(list(dict.fromkeys(values.unknown))))
        sentence = f"the archive gives values to {shown}: ignored, as there are no such variables"
        document.notes.append(Diagnostic("variable-unknown", sentence, "info"))
    if values.unmapped:
        shown = listed(fold(list(dict.fromkeys(values.unmapped))))
        sentence = f"the archive maps {shown}: ignored, as its parameter sets have no such parameters"
        document.notes.append(Diagnostic("variable-unknown", sentence, "info"))
    by_end = _values_through_connectors(structure, values.known)
    connections, driven = _connections(structure, names)
    by_end = {end: ssp_value for end, ssp_value in by_end.items() if end not in driven}

    instances: dict[str, Any] = {}
    inputs: dict[str, Any] = {}
    for path, component in structure.components.items():
        name = names[path]
        instances[name] = {"fmu": f"{archive.root}/{component.member}", "parameters": {}}
        document.lines[("units", name)] = component.element.sourceline or 1
        hint = component.element.find(f".//{{{OSP}}}StepSizeHint")
        if hint is not None:
            instances[name]["step_size"] = number(hint, "value")
    for (path, variable), ssp_value in by_end.items():
        if path not in structure.components:
            continue
        end = SspEnd(path, variable)
        declared = structure.variable(end)
        value = ssp_value.to(structure.unit_inside(end))
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


def _variants(archive: SspArchive) -> str:
    """Return a note on the other descriptions in the archive, "" if there are none."""
    variants = archive.variants()
    others = [f"{member} ({name})" if name else member for member, name in variants.items()]
    if len(others) < 2:
        return ""
    path, other = archive.path, next(member for member in variants if member != archive.description)
    way = str(path) if other == DESCRIPTION_FILE else f"{path}/{other}"
    return (
        f"the archive has the variants {listed(others)}, of which {archive.description} is taken; give {way} "
        f"as the scenario to take {other}"
    )


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
    value = ssp_value.to(structure.unit_outside(connector))
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
        if _relative(structure, [source, end]) is None and any(
            _suppresses(structure.sources[stop][1]) for stop in way
        ):
            usual = None  # the archive has decided what a difference means here
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
    """A parameter value as in the archive; of an array, one element."""

    value: Value
    unit: str | None
    parameter: _Element
    definition: UnitDefinition | None = None  # of the unit, if the archive gives one
    factor: float = 1.0
    offset: float = 0.0

    def to(self, measure: Unit | None) -> Value:
        """Return the value in a unit, as in a scenario file: a plain value, or one with its unit.

        Raises:
            SspError: a transformation of something other than a number, or with an incompatible unit.
        """
        value = self._in(measure)
        if (self.factor, self.offset) == (1.0, 0.0):
            return value
        if isinstance(value, (bool, str)):
            raise SspError(
                f"{self.name}: a LinearTransformation is for numbers (got {value})", self.parameter
            )
        result = self.factor * value + self.offset
        if isinstance(value, float):
            return result
        if not result.is_integer():
            raise SspError(f"{self.name}: {result:g} is not a whole number", self.parameter)
        return int(result)

    def _in(self, measure: Unit | None) -> Value:
        """Return the converted value; if units are incompatible, with its unit, so that wiring refuses it."""
        if not isinstance(self.value, float) or self.unit is None or measure is None:
            return self.value
        source = measure_of(self.unit, self.definition)
        if source is None or source.powers != measure.powers:
            return f"{self.value!r} {self.unit}"
        if conversion(source, measure) == (1.0, 0.0) or not math.isfinite(self.value):
            return self.value
        return float(converted(Fraction(repr(self.value)), source, measure))

    @property
    def name(self) -> str:
        """How messages call it."""
        return f"parameter {self.parameter.get('name')!r}"


@dataclass
class SspValues:
    """The values of variables and connectors, and the names that mean nothing."""

    known: dict[SspEnd, SspValue] = field(default_factory=dict)
    unknown: list[str] = field(default_factory=list)
    """Names without a variable."""
    unmapped: list[str] = field(default_factory=list)
    """Names in mappings without a parameter."""


def read_values(archive: SspArchive, structure: SspStructure) -> SspValues:
    """Read all parameter bindings of a structure.

    Raises:
        SspError: values cannot be read.
    """
    values = SspValues()
    elements = {path: component.element for path, component in structure.components.items()}
    for path, element in (elements | structure.systems).items():  # outer ones last
        for name, given in _bound(archive, element, values.unmapped):
            ends = structure.find(path, name)
            for end in ends:
                values.known.update(_spread(structure, end, given))
            if not ends:
                values.unknown.append(str(SspEnd(path, name)))
    return values


Array = tuple[list[SspValue], tuple[int, ...]]
"""The values of a parameter, row by row, and the sizes of its dimensions as far as given."""


def _spread(structure: SspStructure, end: SspEnd, given: Array) -> Iterator[tuple[SspEnd, SspValue]]:
    """Yield (element, value) of a variable.

    Raises:
        SspError: there are not as many values as elements.
    """
    values, sizes = given
    shape, elements = structure.elements(end)
    if len(values) != len(elements) or (sizes and shape and sizes != shape):
        has, takes = ("x".join(map(str, n)) for n in (sizes or (len(values),), shape or (1,)))
        one = values[0]
        raise SspError(f"{one.name} has values for {has} elements, and {end} has {takes}", one.parameter)
    yield from zip(elements, values, strict=True)


def _bound(archive: SspArchive, element: _Element, unmapped: list[str]) -> Iterator[tuple[str, Array]]:
    """Yield (name, values) of an element's parameter bindings; add names that map nothing to `unmapped`."""
    for binding in element.iterfind(f"{{{SSD}}}ParameterBindings/{{{SSD}}}ParameterBinding"):
        check_type(binding, VALUES_TYPE)
        values = archive.content(
            binding, f"{{{SSD}}}ParameterValues/", f"{{{SSV}}}ParameterSet", "parameters"
        )
        mapping = _mapping(archive, binding)
        definitions = unit_definitions(values.iterfind(f"{{{SSV}}}Units/*"))
        names: set[str] = set()
        for parameter in values.iterfind(f"{{{SSV}}}Parameters/{{{SSV}}}Parameter"):
            name = binding.get("prefix", "") + required(parameter, "name")
            if name in names:
                raise SspError(f"parameter {parameter.get('name')!r} is given twice in one set", parameter)
            names.add(name)
            given, sizes = _values(parameter)
            given = [replace(value, definition=definitions.get(str(value.unit))) for value in given]
            if mapping is None:
                yield name, (given, sizes)
            for entry in (mapping or {}).get(name, ()):
                yield required(entry, "target"), ([_transformed(value, entry) for value in given], sizes)
        unmapped += [name for name in mapping or () if name not in names]


def _mapping(archive: SspArchive, binding: _Element) -> dict[str, list[_Element]] | None:
    """Return the entries of a binding's mapping by source name, None if it has no mapping."""
    mapping = binding.find(f"{{{SSD}}}ParameterMapping")
    if mapping is None:
        return None
    check_type(mapping, MAPPING_TYPE)
    content = archive.content(mapping, "", f"{{{SSM}}}ParameterMapping", "mappings")
    entries: dict[str, list[_Element]] = {}
    targets: set[str] = set()
    for entry in content.iterfind(f"{{{SSM}}}MappingEntry"):
        entries.setdefault(required(entry, "source"), []).append(entry)
        if (target := required(entry, "target")) in targets:
            raise SspError(f"two parameters are mapped to {target!r}", entry)
        targets.add(target)
    return entries


def _transformed(value: SspValue, entry: _Element) -> SspValue:
    """Return a value with the transformation of a mapping entry."""
    if _suppresses(entry):
        value = replace(value, unit=None)
    kind, found = transformation(entry) or ("", entry)
    if kind in TABLES:
        return replace(value, value=_looked_up(value, found, *TABLES[kind]))
    factor, offset = linear(entry)
    return replace(value, factor=factor, offset=offset)


TABLES = {
    "BooleanMappingTransformation": ("Boolean", bool),
    "IntegerMappingTransformation": ("Integer", int),
    "EnumerationMappingTransformation": ("Enumeration", str),
}
"""Transformation that replaces some values by others -> their type, in SSP and here."""


def _looked_up(value: SspValue, table: _Element, kind: str, python_type: type) -> Value:
    """Return what a table of values has in place of a value, which is kept if it is not there."""
    if type(value.value) is not python_type:
        raise SspError(
            f"{value.name}: a table of values of type {kind} cannot be applied to {value.value}", table
        )
    found: dict[Value, Value] = {}
    for entry in table.iterchildren(f"{{{SSC}}}MapEntry"):
        source, target = (
            _plain(kind, required(entry, key), value.name, entry) for key in ("source", "target")
        )
        if found.setdefault(source, target) != target:
            raise SspError(f"{value.name}: the table of values has {entry.get('source')} twice", entry)
    return found.get(value.value, value.value)


REALS = ("Real", "Float64", "Float32")
BESIDES = ("Dimension", "Annotations", "MetaData", "Signature")
"""Elements of a parameter that are no values."""


def _values(parameter: _Element) -> Array:
    """Return the values of a parameter.

    Raises:
        SspError: it has no value, several, or one that cannot be read.
    """
    name = f"parameter {parameter.get('name')!r}"
    kinds = [child for child in parameter.iterchildren("{*}*") if etree.QName(child).localname not in BESIDES]
    if len(kinds) != 1:
        raise SspError(f"{name} has {'more than one' if kinds else 'no'} value", parameter)
    (element,) = kinds
    kind, text = etree.QName(element).localname, element.get("value")
    if kind not in (*REALS, "Integer", *INTEGERS, *TEXTS, "Boolean"):
        raise unsupported(f"{name} is of type {kind}: not supported", parameter)
    inner = list(element.iterchildren("{*}*"))
    if (text is None) == (not inner):
        what = "no value" if text is None else "values both as an attribute and as elements"
        raise SspError(f"{name} has {what}", parameter)
    if any(etree.QName(child).localname != "Value" or child.get("value") is None for child in inner):
        raise SspError(f"{name} has an element in its {kind} that is no Value with a value", parameter)
    if inner:
        texts = [str(child.get("value")) for child in inner]
    else:
        texts = [str(text)] if kind in TEXTS else str(text).split()
    sizes = [d.get("size", "") for d in parameter.iterchildren("{*}Dimension")]
    if not all(size.isascii() and size.isdigit() for size in sizes):
        raise SspError(f"{name} does not give the size of its dimensions", parameter)
    shape = tuple(map(int, sizes))
    if len(texts) != (math.prod(shape) if shape else max(len(texts), 1)):
        size = "x".join(map(str, shape))
        raise SspError(
            f"{name} has {len(texts) or 'no'} values" + f" for {size} elements" * bool(shape), parameter
        )
    unit = element.get("unit") if kind in REALS else None
    if unit and (bare := re.fullmatch(r"\[(.+)\]", unit.strip())):
        unit = bare[1]  # as tools write units behind names
    return [SspValue(_plain(kind, one, name, parameter), unit, parameter) for one in texts], shape


def _plain(kind: str, text: str, name: str, element: _Element) -> Value:
    """Return a value of a type of SSP from its text.

    Raises:
        SspError: the text is not of this type.
    """
    if kind in TEXTS:
        return text
    try:
        if "_" in text:  # which Python allows in numbers
            raise ValueError
        if kind in REALS:
            return float(text)
        if kind == "Boolean":
            return {"true": True, "1": True, "false": False, "0": False}[text.strip()]
        lowest, highest = integer_limits("Int32" if kind == "Integer" else kind)
        if not lowest <= (number := int(text)) <= highest:
            raise ValueError
    except (ValueError, KeyError):
        raise SspError(f"{name}: {text!r} is not of type {kind}", element) from None
    return number

"""An SSP 1.0 archive as a scenario: the content that a YAML file of the same system would have.

Every component becomes a unit whose FMU is the member of the archive. Only what the archive connects
is connected, and an input that it neither connects nor gives a value keeps its FMU's start value, as
the standard has it. The communication step and the units' own come from the annotations of the Open
Simulation Platform or of OMSimulator, all that SSP cannot say from our own; archives from elsewhere may
lack them.

What has no counterpart here is refused by name: signal dictionaries, mappings in connections,
components that are no FMUs.

What the connections of an SSP archive do to numbers: units of connectors, linear transformations.

On every connection a number is first converted from the unit of its start into that of its end, unless
the connection suppresses that, and then transformed. A connector without a unit has that of its FMU's
variable, a system's that of what it is connected to.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from lxml.etree import _Element

from ..messages import fold, listed
from .overrides import RESERVED
from .quantities import Unit, conversion
from .ssp_archive import DESCRIPTION_FILE, OMS, OSP, OWN, SSD, SspArchive, SspError
from .ssp_structure import (
    ElementPath,
    SspEnd,
    SspStructure,
    SspValue,
    linear,
    number,
    read_structure,
    read_values,
)
from .yaml_lines import Document

Scale = tuple[float, float]
"""Gain and offset."""

AS_IT_IS: Scale = (1.0, 0.0)


def scale(structure: SspStructure, chain: Sequence[SspEnd]) -> Scale:
    """Return what becomes of a number on its way, from what gives it through connectors to what takes it.

    Raises:
        Refused: units that do not fit, or a transformation that is not linear.
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
    """Return what a wire does by itself, of what the two FMUs declare; None if it is refused."""
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
    """Read the archive `path`; whatever is wrong with it stands in the document's problems."""
    document = Document(path)
    try:
        document.data = _scenario(SspArchive(path, what=what), document)
    except SspError as refused:
        document.note(refused.problem(path))
    return document


def missing_times(document: Document) -> list[str]:
    """Return a sentence for each time that neither the archive nor an option gives."""
    wanted = {"stop_time": ("stop time", "10"), "step_size": ("communication step", "0.001")}
    return [
        f"{document.path}: the archive says no {words}: give one in s, such as --set {name}={such_as}"
        for name, (words, such_as) in wanted.items()
        if name not in document.data
    ]


def _scenario(archive: SspArchive, document: Document) -> dict[str, Any]:
    """Return what a scenario file of this system would hold."""
    root = archive.xml(DESCRIPTION_FILE, f"{{{SSD}}}SystemStructureDescription")
    system = root.find(f"{{{SSD}}}System")
    if system is None:
        raise SspError(f"{DESCRIPTION_FILE} holds no system")
    structure = read_structure(archive, system)
    names = _unit_names(structure, document)
    values = read_values(archive, structure)
    if values.unknown:
        shown = listed(fold(list(dict.fromkeys(values.unknown))))
        document.notes.append(
            f"the archive gives values to {shown}: passed over, there are no such variables"
        )
    given = _values_through_connectors(structure, values.given)
    connections, driven = _connections(structure, names)
    given = {end: one for end, one in given.items() if end not in driven}

    units: dict[str, Any] = {}
    inputs: dict[str, Any] = {}
    for path, component in structure.components.items():
        name = names[path]
        units[name] = {"fmu": f"{archive.path.name}/{component.member}", "parameters": {}}
        document.lines[("units", name)] = component.element.sourceline or 1
        hint = component.element.find(f".//{{{OSP}}}StepSizeHint")
        if hint is not None:
            units[name]["step_size"] = number(hint, "value")
    for (path, variable), one in given.items():
        if path not in structure.components:
            continue
        declared = structure.components[path].variables.get(variable)
        value = one.for_variable(declared)
        if declared is not None and declared.causality == "input":
            inputs[f"{names[path]}.{variable}"] = value
        else:
            units[names[path]]["parameters"][variable] = value
    return {
        "title": _title(root),
        "source": root.get("description", ""),
        "units": units,
        "connections": connections,
        "inputs": inputs,
    } | _experiment(root)


def _title(root: _Element) -> str:
    """Return the title, which the name of a structure, an identifier, cannot hold."""
    own = root.find(f".//{{{OWN}}}Scenario")
    name = root.get("name", "")
    return name if own is None else own.get("title", name)


def _unit_names(structure: SspStructure, document: Document) -> dict[ElementPath, str]:
    """Return what each component is called as a unit: as in the archive, where that can name a unit."""
    names: dict[ElementPath, str] = {}
    for path, component in structure.components.items():
        name = re.sub(r"[^A-Za-z0-9_]", "_", "_".join(path))
        if name[0].isdigit() or name in RESERVED:
            name = f"_{name}"
        if name in names.values():
            raise SspError(f"two components would be called {name!r} as units", component.element)
        names[path] = name
    renamed = [f"{name} ({'.'.join(path)})" for path, name in names.items() if path != (name,)]
    if renamed:
        document.notes.append(f"units called otherwise than in the archive: {listed(renamed)}")
    return names


def _values_through_connectors(
    structure: SspStructure, given: Mapping[SspEnd, SspValue]
) -> dict[SspEnd, SspValue]:
    """Return the values, with those that a system's connector passes on in place of a component's own."""
    passed = {}
    for end in structure.sources:
        through = [
            one for one in structure.upstream(end) if one in given and one.element in structure.systems
        ]
        if through and end.element in structure.components:
            passed[end] = _passed_on(structure, given[through[-1]], through[-1], end)
    return {**given, **passed}


def _passed_on(structure: SspStructure, given: SspValue, connector: SspEnd, end: SspEnd) -> SspValue:
    """Return a value that a system's connector has as it arrives at a component."""
    ways = structure.upstream(end)
    way = scale(structure, [*reversed(ways[: ways.index(connector) + 1]), end])
    if way == AS_IT_IS:
        return given
    value = given.for_variable(structure.connector(connector))
    if not isinstance(value, float):
        raise SspError(f"{end}: only numbers can be converted on the way from {connector}", given.parameter)
    return replace(given, value=way[0] * value + way[1], unit=None, factor=1.0, offset=0.0)


def _connections(
    structure: SspStructure, names: Mapping[ElementPath, str]
) -> tuple[list[dict[str, Any]], set[SspEnd]]:
    """Return the connections from component to component, and what they drive."""
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
    """Return times, algorithm and what is recorded, as far as the archive says."""
    found: dict[str, Any] = {}
    experiment = root.find(f"{{{SSD}}}DefaultExperiment")
    if experiment is not None:
        if start := number(experiment, "startTime", 0.0):
            found["start_time"] = start
        if experiment.get("stopTime") is not None:
            found["stop_time"] = number(experiment, "stopTime")
    for tag, attribute in (
        (f"{{{OMS}}}FixedStepMaster", "stepSize"),
        (f"{{{OSP}}}FixedStepAlgorithm", "baseStepSize"),
    ):
        step = root.find(f".//{tag}")
        if step is not None and step.get(attribute):
            found["step_size"] = number(step, attribute)
    own = root.find(f".//{{{OWN}}}Scenario")
    if own is not None:
        found["step_size"] = number(own, "stepSize")
        found["algorithm"] = own.get("algorithm")
        record = [str(one.get("variable")) for one in own.iterfind(f"{{{OWN}}}Record")]
        found |= {"record": record} if record else {}
    return found

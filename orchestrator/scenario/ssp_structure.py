"""The components of an SSP archive and what feeds what, with systems in systems laid flat.

A connection's ends are called start and end, but that says nothing of its direction: the kinds of its
connectors do. Seen from inside a system, its own inputs give values and its outputs take them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from lxml import etree
from lxml.etree import _Element

from ..plan import UnitDefinition
from .measurement_units import Measure
from .ssp_archive import Archive, Declared, Refused, unit_definitions
from .ssp_names import FMU_TYPE, SSD

Path = tuple[str, ...]
"""Of an element: the names of the systems it is in, below the outermost, then its own."""

_GIVES = {"output": True, "calculatedParameter": True, "input": False, "parameter": False}


class End(NamedTuple):
    """A connector of an element, or a variable of a component."""

    element: Path
    name: str

    def __str__(self) -> str:
        return ".".join((*self.element, self.name))


@dataclass(frozen=True)
class Component:
    """An FMU in a system."""

    path: Path
    element: _Element
    member: str
    variables: dict[str, Declared]


@dataclass
class Structure:
    """Everything that a system and the systems in it hold."""

    components: dict[Path, Component] = field(default_factory=dict)
    systems: dict[Path, _Element] = field(default_factory=dict)
    """From the inside out: the outermost is the last."""
    connectors: dict[Path, dict[str, Declared]] = field(default_factory=dict)
    """Of each element, by name: kind and unit, as far as the archive says them."""
    sources: dict[End, tuple[End, _Element]] = field(default_factory=dict)
    """What gives an end its value, and the connection that says so."""

    def unit_inside(self, end: End) -> Measure | None:
        """Return the unit of a variable as its FMU declares it, or if it does not, that of the connector."""
        known = self.components[end.element].variables if end.element in self.components else {}
        return (known[end.name].measure if end.name in known else None) or self.connector(end).measure

    def unit_outside(self, end: End) -> Measure | None:
        """Return the unit of a connector, or if it has none, that of the variable behind it."""
        return self.connector(end).measure or self.unit_inside(end)

    def connector(self, end: End) -> Declared:
        """Return what the archive says of a connector; nothing, if that is nothing."""
        return self.connectors[end.element].get(end.name, Declared(""))

    def upstream(self, end: End) -> list[End]:
        """Return what an end takes its value from: connectors of systems, then perhaps a component's output.

        Raises:
            Refused: connections go round in a circle.
        """
        found: list[End] = []
        while end in self.sources:
            end, connection = self.sources[end]
            if end in found:
                raise Refused(f"connections go round in a circle through {end}", connection)
            found.append(end)
            if end.element in self.components:
                break
        return found

    def find(self, path: Path, name: str) -> End | None:
        """Return what a hierarchical name means in the element `path`, None if there is no such variable."""
        if path in self.components:
            known = self.components[path].variables
            return End(path, name) if name in known or not known else None
        if name in self.connectors[path]:
            return End(path, name)
        for inner in (*self.components, *self.systems):
            if inner[:-1] == path and inner and name.startswith(f"{inner[-1]}."):
                found = self.find(inner, name[len(inner[-1]) + 1 :])
                if found is not None:
                    return found
        return None


def read_structure(archive: Archive, system: _Element) -> Structure:
    """Read a system.

    Raises:
        Refused: it holds what has no counterpart here.
    """
    structure = Structure()
    definitions = unit_definitions(system.iterfind(f"../{{{SSD}}}Units/*"))
    _add_system(structure, archive, system, (), definitions)
    return structure


def _add_system(
    structure: Structure,
    archive: Archive,
    system: _Element,
    path: Path,
    definitions: Mapping[str, UnitDefinition],
) -> None:
    structure.connectors[path] = _connectors(system, definitions)
    names: set[str] = set()
    for one in system.iterfind(f"{{{SSD}}}Elements/*"):
        kind, name = etree.QName(one).localname, one.get("name", "")
        if not name or name in names:
            raise Refused(f"two elements are called {name!r}" if name else "an element has no name", one)
        names.add(name)
        inner = (*path, name)
        if kind == "System":
            _add_system(structure, archive, one, inner, definitions)
        elif kind == "Component":
            structure.components[inner] = _component(archive, one, inner)
            structure.connectors[inner] = _connectors(one, definitions)
        elif kind == "SignalDictionaryReference":
            raise Refused(f"a signal dictionary ({name}) is not supported", one)
        else:
            raise Refused(f"an element of kind {kind} ({name}) is not supported", one)
    for connection in system.iterfind(f"{{{SSD}}}Connections/{{{SSD}}}Connection"):
        source, sink = _directed(structure, connection, path)
        before, _ = structure.sources.setdefault(sink, (source, connection))
        if before != source:
            raise Refused(f"{sink} has more than one source: {before} and {source}", connection)
    structure.systems[path] = system


def _connectors(element: _Element, definitions: Mapping[str, UnitDefinition]) -> dict[str, Declared]:
    found = {}
    for one in element.iterfind(f"{{{SSD}}}Connectors/{{{SSD}}}Connector"):
        unit = next((kind.get("unit") for kind in one if kind.get("unit")), None)
        found[str(one.get("name"))] = Declared(one.get("kind", ""), unit, definitions.get(str(unit)))
    return found


def _component(archive: Archive, element: _Element, path: Path) -> Component:
    name, kind, source = ".".join(path), element.get("type", FMU_TYPE), element.get("source", "")
    if kind != FMU_TYPE or not source.lower().endswith(".fmu"):
        raise Refused(
            f"component {name!r} is no FMU (type {kind}, source {source!r}): only FMUs are supported", element
        )
    implementation = element.get("implementation", "any")
    if implementation not in ("any", "CoSimulation"):
        raise Refused(f"component {name!r} wants {implementation}: only CoSimulation is supported", element)
    member = archive.member(element)
    return Component(path, element, member, archive.variables(member, element))


def _directed(structure: Structure, connection: _Element, path: Path) -> tuple[End, End]:
    """Return what gives and what takes a value by a connection in the system `path`."""
    start, end = (_end(structure, connection, which, path) for which in ("start", "end"))
    start_gives, end_gives = (_gives(structure, one, path) for one in (start, end))
    if start_gives is not None and start_gives == end_gives:
        what = "gives a value" if start_gives else "takes a value"
        raise Refused(f"cannot connect {start} and {end}: each {what}", connection)
    return (end, start) if start_gives is False or end_gives else (start, end)


def _end(structure: Structure, connection: _Element, which: str, path: Path) -> End:
    element, name = connection.get(f"{which}Element"), connection.get(f"{which}Connector", "")
    inner = (*path, element) if element else path
    if inner not in structure.connectors:
        raise Refused(f"a connection names {element!r}: there is no such component", connection)
    if inner not in structure.components and name not in structure.connectors[inner]:
        system = f"the system {'.'.join(inner)}" if inner else "the system"
        raise Refused(
            f"a connection names the connector {name!r}: {system} has none of this name", connection
        )
    return End(inner, name)


def _gives(structure: Structure, end: End, path: Path) -> bool | None:
    """Return whether an end gives a value in the system `path`, None if nothing says so."""
    kind = structure.connector(end).causality
    if end.element in structure.components:
        declared = structure.components[end.element].variables.get(end.name)
        kind = declared.causality if declared else kind
    gives = _GIVES.get(kind)
    return gives if gives is None or end.element != path else not gives

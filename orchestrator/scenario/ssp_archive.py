"""SSP archives: their members, and components and connections, with nested systems flattened.

Nothing is unpacked to disk, and references outside of the archive are refused.

The start and end of a connection do not determine its direction: the kinds of its connectors do. Inside a
system, its own inputs are sources and its outputs are targets.
"""

from __future__ import annotations

import contextlib
import io
import posixpath
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote, urlsplit

from lxml import etree
from lxml.etree import _Element

from ..errors import Diagnostic, Location
from ..fmu.fmu import Causality, UnitDefinition
from ..messages import short
from ..safe_files import PACKED, TooLargeError, check_archive, read_bytes, reason
from .quantities import BASE_UNITS, Unit, measure_of

DESCRIPTION_FILE = "SystemStructure.ssd"
RESOURCES = "resources"
PARAMETER_SET = "scenario"
"""Name of the parameter set; one for all components, because other programs apply a set by its name."""

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
SSM = "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
OWN = "urn:yawbench:ssp:1"
NAMESPACES = {"ssd": SSD, "ssc": SSC, "ssv": SSV, "osp": OSP, "oms": OMS, "yawbench": OWN}
"""Namespaces, all declared at the root with the prefixes that libcosim and Ecos expect: they compare text,
and libcosim mistakes a declaration further down for content."""

FMU_TYPE = "application/x-fmu-sharedlibrary"
VALUES_TYPE = "application/x-ssp-parameter-set"
MAPPING_TYPE = "application/x-ssp-parameter-mapping"

OSP_ANNOTATION = "com.opensimulationplatform"
OMS_ANNOTATION = "org.openmodelica"
OWN_ANNOTATION = "yawbench"

LARGEST = 100_000_000
"""Maximum bytes of an unpacked description. Chosen: a thousand times the size of ours."""

_DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, ValueError, RuntimeError, NotImplementedError)


class SspError(Exception):
    """An SSP archive cannot be read; has the XML element with the error."""

    def __init__(self, sentence: str, element: _Element | None = None, code: str = "ssp-invalid") -> None:
        super().__init__(sentence)
        self.code = code
        self.line = 0 if element is None else element.sourceline or 0
        self.member = "" if element is None else element.getroottree().docinfo.URL or ""

    def diagnostic(self, path: Path) -> Diagnostic:
        """Convert to an error of the archive `path`, with member and line if known."""
        within = self.line and self.member
        where = Location(path / self.member, self.line) if within else Location(path)
        return Diagnostic(self.code, str(self), location=where)


class SspVariable(NamedTuple):
    """A variable or connector as declared by an FMU or an archive."""

    causality: Causality | None
    unit: str | None = None
    definition: UnitDefinition | None = None

    @property
    def measure(self) -> Unit | None:
        """Its parsed unit, None if it has none or an unknown one."""
        return measure_of(self.unit, self.definition)


class SspArchive:
    """An SSP archive, read into memory.

    Raises:
        SspError: the archive is missing or damaged.
    """

    def __init__(self, path: Path, *, what: str) -> None:
        self.path = path
        try:
            raw = read_bytes(path, largest=PACKED)
        except FileNotFoundError:
            raise SspError(f"no such {what}", code="file-missing") from None
        except (OSError, ValueError) as error:
            raise SspError(f"cannot read this {what}: {reason(error)}", code="file-unreadable") from None
        try:
            self._archive = zipfile.ZipFile(io.BytesIO(raw))
            check_archive(self._archive)
        except TooLargeError as error:
            raise SspError(f"cannot read this {what}: {error}", code="file-unreadable") from None
        except _DAMAGE as error:
            raise SspError(f"no {what}, or damaged: {error}") from None
        self._variables: dict[str, dict[str, SspVariable]] = {}

    def member(self, element: _Element) -> str:
        """Return the name of the member that the `source` of an element refers to.

        Raises:
            SspError: the source is outside of the archive, or inside an FMU.
        """
        source = element.get("source", "")
        try:
            address = urlsplit(source)
        except ValueError:
            raise SspError(f"source {short(source)} is not an address", element) from None
        member = posixpath.normpath(unquote(address.path))
        if address.scheme or address.netloc or not source or member.startswith(("/", "..")):
            raise SspError(f"source {source!r} is not in the archive", element)
        if element.get("sourceBase", "SSD") != "SSD":
            raise SspError(
                f"source {source!r} is in a component: only members of the archive are read",
                element,
                code="ssp-unsupported",
            )
        return member

    def xml(self, member: str, tag: str) -> _Element:
        """Parse an XML member and return its root.

        Raises:
            SspError: the member is missing or damaged, or its root is not a `tag`.
        """
        try:
            if self._archive.getinfo(member).file_size > LARGEST:
                raise SspError(f"{member} is larger than {LARGEST // 10**6} MB")
            root = etree.fromstring(self._archive.read(member), _parser(), base_url=member)
        except KeyError:
            raise SspError(f"no SSP archive, or not all of it: there is no {member}") from None
        except etree.XMLSyntaxError as error:
            raise SspError(f"{member} is not well-formed: {error.msg}") from None
        except _DAMAGE as error:
            raise SspError(f"{member} is damaged: {error}") from None
        if root.tag != tag:
            raise SspError(f"{member} is not a {etree.QName(tag).localname} of SSP 1.0")
        return root

    def variables(self, member: str, component: _Element) -> dict[str, SspVariable]:
        """Return the variables of an FMU; none if it cannot be read, which is reported when it is opened.

        Raises:
            SspError: the FMU is not in the archive.
        """
        if member not in self._variables:
            try:
                with zipfile.ZipFile(io.BytesIO(self._archive.read(member))) as fmu:
                    check_archive(fmu)
                    description = etree.fromstring(fmu.read("modelDescription.xml"), _parser())
            except (KeyError, *_DAMAGE, etree.XMLSyntaxError):
                if member not in self._archive.namelist():
                    raise SspError(f"there is no {member} in the archive", component) from None
                description = etree.Element("none")
            self._variables[member] = dict(_declared(description))
        return self._variables[member]


def _declared(description: _Element) -> Iterator[tuple[str, SspVariable]]:
    """Yield the variables of a model description of FMI 2.0 or 3.0."""
    types = {
        str(definition.get("name")): (
            definition if definition.get("unit") else next(iter(definition), definition)
        ).get("unit")
        for definition in description.iterfind("TypeDefinitions/*")
    }
    definitions = unit_definitions(description.iterfind("UnitDefinitions/Unit"))
    for variable in description.iterfind("ModelVariables/*"):
        kind = variable if variable.tag != "ScalarVariable" else variable.find("Real")
        unit = None
        if kind is not None:
            unit = kind.get("unit") or types.get(str(kind.get("declaredType")))
        declared = SspVariable(variable.get("causality", "local"), unit, definitions.get(str(unit)))
        yield str(variable.get("name")), declared


def unit_definitions(units: Iterable[_Element]) -> dict[str, UnitDefinition]:
    """Return the definitions in `Unit` elements of FMI or SSP, by name."""
    definitions = {}
    for unit in units:
        base = unit.find("{*}BaseUnit")
        if base is None:
            continue
        with contextlib.suppress(ValueError):  # a malformed number defines nothing
            powers = tuple(int(base.get(name, "0")) for name in BASE_UNITS)
            scale = (float(base.get(key, default)) for key, default in (("factor", "1"), ("offset", "0")))
            definitions[str(unit.get("name"))] = UnitDefinition(powers, *scale)
    return definitions


def _parser() -> etree.XMLParser:
    return etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, remove_pis=True)


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

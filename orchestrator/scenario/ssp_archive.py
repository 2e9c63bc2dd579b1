"""SSP archives: their members, and components and connections, with nested systems flattened.

Nothing is unpacked to disk, and references outside of the archive, or of the folder of a description on its
own, are refused. An archive may have several
descriptions, variants of a system: `SystemStructure.ssd` is the default, another is named as if the archive
were a folder, `system.ssp/other.ssd`.

Arrays are taken apart: an array `u` has the elements `u[1]`, `u[2]`, row by row, which connections and values
reach one by one or all at once.

The start and end of a connection do not determine its direction: the kinds of its connectors do. Inside a
system, its own inputs are sources and its outputs are targets.
"""

from __future__ import annotations

import contextlib
import io
import math
import posixpath
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote, urlsplit

from lxml import etree
from lxml.etree import _Element

from yawbench.fmus.description import MODEL_DESCRIPTION
from yawbench.fmus.fmu import Causality, UnitDefinition, element_names
from yawbench.fmus.zip_members import DAMAGE, ArchiveError, members, misplaced
from yawbench.foundation.errors import Diagnostic, Location
from yawbench.foundation.messages import listed, short
from yawbench.foundation.safe_files import PACKED, read_bytes, reason

from .quantities import BASE_UNITS, Unit, measure_of

DESCRIPTION_FILE = "SystemStructure.ssd"
RESOURCES = "resources"
PARAMETER_SET = "scenario"
"""Name of the parameter set; one for all components, because other programs apply a set by its name."""

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
SSB = "http://ssp-standard.org/SSP1/SystemStructureSignalDictionary"
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
DICTIONARY_TYPE = "application/x-ssp-signal-dictionary"

TEXTS = ("String", "Enumeration")
"""Types whose values are texts, of which OMSimulator reads none from an archive."""

OSP_ANNOTATION = "com.opensimulationplatform"
OMS_ANNOTATION = "org.openmodelica"
OWN_ANNOTATION = "yawbench"

LARGEST_ARRAY = 100_000
"""Largest number of elements of an array; chosen: more than any interface has."""
LARGEST = 100_000_000
"""Maximum bytes of an unpacked description. Chosen: a thousand times the size of ours."""


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


def unsupported(sentence: str, element: _Element) -> SspError:
    """Return the error on a feature of SSP that is not read."""
    return SspError(sentence, element, code="ssp-unsupported")


class SspVariable(NamedTuple):
    """A variable or connector as declared by an FMU or an archive."""

    causality: Causality | None
    unit: str | None = None
    definition: UnitDefinition | None = None
    relative: bool = False  # a difference, to which offsets of units do not apply
    shape: tuple[int, ...] | None = ()  # of an array; None: the archive does not give it
    alias_of: str | None = None  # the variable of which this is another name (FMI 3.0)

    @property
    def measure(self) -> Unit | None:
        """Its parsed unit, None if it has none or an unknown one."""
        measure = measure_of(self.unit, self.definition)
        return replace(measure, relative=True) if measure and self.relative else measure


class SspArchive:
    """An SSP archive, read into memory.

    Args:
        path: of the archive, or of a description in it, `system.ssp/other.ssd`. A description in a folder is
            read with the files of that folder.
        what: kind of the file, for messages.

    Raises:
        SspError: the archive is missing or damaged.
    """

    def __init__(self, path: Path, *, what: str) -> None:
        inside = path.suffix.lower() == ".ssd"
        self.path = path.parent if inside else path
        self.description = path.name if inside else DESCRIPTION_FILE
        """Name of the member that describes the system."""
        self.root = "." if inside else self.path.name
        """Path of the archive, from the folder of `path`."""
        self._variables: dict[str, dict[str, SspVariable]] = {}
        self._folder = inside and self.path.is_dir()
        if self._folder:
            if not path.exists():
                raise SspError("no such file", code="file-missing")
            return
        try:
            raw = read_bytes(self.path, largest=PACKED)
        except FileNotFoundError:
            raise SspError(f"no such {what}", code="file-missing") from None
        except (OSError, ValueError) as error:
            raise SspError(f"cannot read this {what}: {reason(error)}", code="file-unreadable") from None
        try:
            self._archive = zipfile.ZipFile(io.BytesIO(raw))
            self._members = members(self._archive)
        except ArchiveError as error:
            raise SspError(f"cannot read this {what}: {error}", code="file-unreadable") from None
        except DAMAGE as error:
            raise SspError(f"no {what}, or damaged: {error}") from None

    def _has(self, member: str) -> bool:
        return (self.path / member).is_file() if self._folder else member in self._members

    def _read(self, member: str, largest: int) -> bytes:
        """Return the content of a member.

        Raises:
            ValueError: it is too large.
        """
        if self._folder:
            return read_bytes(self.path / member, largest=largest)
        if self._members[member].file_size > largest:
            raise ValueError(f"it is larger than {largest // 10**6} MB")
        return self._archive.read(self._members[member])

    def variants(self) -> dict[str, str]:
        """Return the descriptions in the archive, with their names: member -> name."""
        names = {}
        members = [file.name for file in sorted(self.path.iterdir())] if self._folder else self._members
        for member in members:
            if "/" not in member and member.lower().endswith(".ssd"):
                try:
                    names[member] = self.xml(member, f"{{{SSD}}}SystemStructureDescription").get("name", "")
                except SspError:
                    names[member] = ""
        return names

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
            raise unsupported(
                f"source {source!r} is in a component: only members of the archive are read", element
            )
        return member

    def xml(self, member: str, tag: str) -> _Element:
        """Parse an XML member and return its root.

        Raises:
            SspError: the member is missing or damaged, or its root is not a `tag`.
        """
        if not self._has(member):
            raise SspError(f"no SSP archive, or not all of it: {self._lacks(member)}")
        try:
            root = etree.fromstring(self._read(member, LARGEST), _parser(), base_url=member)
        except etree.XMLSyntaxError as error:
            raise SspError(f"{member} is not well-formed: {error.msg}") from None
        except DAMAGE as error:
            raise SspError(f"{member} cannot be read: {error}") from None
        if root.tag != tag:
            raise SspError(f"{member} is not a {etree.QName(tag).localname} of SSP 1.0 or 2.0")
        check_version(root)
        return root

    def content(self, element: _Element, inside: str, tag: str, what: str) -> _Element:
        """Return what an element contains, or the member that its source names.

        Args:
            element: it refers to a document.
            inside: path in the element of what contains the document in place.
            tag: of the document's root.
            what: the content in words, for messages.

        Raises:
            SspError: it has neither or both, or the member cannot be read.
        """
        content, source = element.find(inside + tag), element.get("source")
        if content is not None and source:
            raise SspError(f"{what} are given both in place and by the source {source!r}", element)
        if content is None and not source:
            raise SspError(f"{what} are named that are nowhere", element)
        if content is None:
            return self.xml(self.member(element), tag)
        check_version(content)
        return content

    def _lacks(self, member: str) -> str:
        """Return what the archive has in place of a missing member."""
        if self._folder:
            return f"there is no {member} beside {self.description}"
        others = [n for n in self.variants() if n != member]
        if member == self.description and others:
            return f"there is no {member}; it has {listed(others)}, run as {self.path}/{others[0]}"
        if member == self.description:
            return misplaced(self._members, member)
        return f"there is no {member}"

    def variables(self, member: str, component: _Element) -> dict[str, SspVariable]:
        """Return the variables of an FMU; none if it cannot be read, which is reported when it is opened.

        Raises:
            SspError: the FMU is not in the archive.
        """
        if member not in self._variables:
            if not self._has(member):
                raise SspError(f"there is no {member} in the archive", component)
            try:
                with zipfile.ZipFile(io.BytesIO(self._read(member, PACKED))) as fmu:
                    content = fmu.read(members(fmu)[MODEL_DESCRIPTION])
                    description = etree.fromstring(content, _parser())
            except (KeyError, *DAMAGE, etree.XMLSyntaxError):
                description = etree.Element("none")
            self._variables[member] = dict(_declared(description))
        return self._variables[member]


def _declared(description: _Element) -> Iterator[tuple[str, SspVariable]]:
    """Yield the variables of a model description of FMI 2.0 or 3.0."""
    types = {
        str(definition.get("name")): dict(
            (definition if definition.tag != "SimpleType" else next(iter(definition), definition)).attrib
        )
        for definition in description.iterfind("TypeDefinitions/*")
    }
    definitions = unit_definitions(description.iterfind("UnitDefinitions/Unit"))
    sizes = {v.get("valueReference"): v.get("start") for v in description.iterfind("ModelVariables/*")}
    for variable in description.iterfind("ModelVariables/*"):
        kind = variable if variable.tag != "ScalarVariable" else variable.find("Real")
        said = {} if kind is None else {**types.get(str(kind.get("declaredType")), {}), **kind.attrib}
        unit, name = said.get("unit"), str(variable.get("name"))
        sized = (
            dimension.get("start") or sizes.get(dimension.get("valueReference"))
            for dimension in variable.iterfind("Dimension")
        )
        declared = SspVariable(
            variable.get("causality", "local"),
            unit,
            definitions.get(str(unit)),
            said.get("relativeQuantity") in ("true", "1"),
            _whole(sized),
        )
        yield from _elements(name, declared)
        for alias in variable.iterfind("Alias"):
            for (other, of_alias), (element, _) in zip(
                _elements(str(alias.get("name")), declared), _elements(name, declared), strict=True
            ):
                yield other, of_alias._replace(alias_of=element)


def _whole(sizes: Iterable[str | None]) -> tuple[int, ...] | None:
    """Return the sizes of the dimensions of an array, None if one is not given."""
    found = [int(size) if size and size.isascii() and size.isdigit() else None for size in sizes]
    if None in found or math.prod(size for size in found if size) > LARGEST_ARRAY:
        return None
    return tuple(size for size in found if size is not None)


def _elements(name: str, declared: SspVariable) -> Iterator[tuple[str, SspVariable]]:
    """Yield a variable or connector, and the elements of an array."""
    yield name, declared
    if declared.shape:
        for element in element_names(name, declared.shape):
            yield element, declared._replace(shape=())


def check_version(root: _Element) -> None:
    """Check that a description or parameter set is of a version of SSP that is read.

    Raises:
        SspError: it is of a later version.
    """
    version = root.get("version", "1.0")
    if not version.startswith(("1.", "2.")):
        raise unsupported(
            f"a {etree.QName(root).localname} of SSP {short(version)}: supported are 1.0 and 2.0", root
        )


def check_type(element: _Element, allowed: str) -> None:
    """Check that an element refers to a document of the type that is read.

    Raises:
        SspError: it does not.
    """
    if element.get("type", allowed) != allowed:
        raise unsupported(f"{element.get('type')} is not supported: only {allowed} is", element)


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


def transformation(element: _Element) -> tuple[str, _Element] | None:
    """Return kind and element of the transformation of a connection or mapping entry, None if it has none.

    Raises:
        SspError: it has several.
    """
    children = [(etree.QName(child).localname, child) for child in element.iterchildren("{*}*")]
    found = [(kind, child) for kind, child in children if kind.endswith("Transformation")]
    if len(found) > 1:
        raise SspError(f"more than one transformation: {listed(kind for kind, _ in found)}", found[1][1])
    return found[0] if found else None


def linear(element: _Element) -> tuple[float, float]:
    """Return factor and offset of the linear transformation of a connection or mapping entry.

    Raises:
        SspError: the transformation is of another kind, or has a malformed number.
    """
    kind, found = transformation(element) or ("", element)
    if not kind:
        return 1.0, 0.0
    if kind != "LinearTransformation":
        raise unsupported(f"{kind} is not supported here", found)
    return number(found, "factor", 1.0), number(found, "offset", 0.0)


def required(element: _Element, attribute: str) -> str:
    """Return an attribute that an element must have.

    Raises:
        SspError: it does not, or it is empty.
    """
    if text := element.get(attribute):
        return str(text)
    raise SspError(f"a {etree.QName(element).localname} has no {attribute}", element)


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

_GIVES = {
    "output": True, "calculatedParameter": True, "local": True, "constant": True,
    "input": False, "parameter": False, "structuralParameter": False,
}  # fmt: skip


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
    dictionaries: dict[ElementPath, ElementPath] = field(default_factory=dict)
    """Signal dictionary, or a reference to one -> the path under which its entries are connectors."""
    sources: dict[SspEnd, tuple[SspEnd, _Element]] = field(default_factory=dict)
    """Target -> its source and the connection between them."""

    def variable(self, end: SspEnd) -> SspVariable | None:
        """Return the declaration of a variable by its FMU, None if it is not one of an FMU."""
        return (
            self.components[end.element].variables.get(end.name) if end.element in self.components else None
        )

    def unit_inside(self, end: SspEnd) -> Unit | None:
        """Return the unit of a variable from its FMU, else that of its connector."""
        variable = self.variable(end)
        return (variable.measure if variable else None) or self.connector(end).measure

    def unit_outside(self, end: SspEnd) -> Unit | None:
        """Return the unit of a connector, else that of its variable."""
        return self.connector(end).measure or self.unit_inside(end)

    def connector(self, end: SspEnd) -> SspVariable:
        """Return the declaration of a connector, of an element that of its array; empty if there is none."""
        known = self.connectors[end.element]
        return known.get(end.name) or known.get(end.name.rpartition("[")[0]) or SspVariable(None)

    def elements(self, end: SspEnd) -> tuple[tuple[int, ...], list[SspEnd]]:
        """Return the shape of a variable or connector, and its elements; a scalar is its own.

        Raises:
            SspError: the size of an array is not given.
        """
        variable = self.variable(end)
        declared = variable or self.connector(end)
        if declared.shape is None:
            raise SspError(f"the archive does not say how many elements the array {end} has")
        shape = () if variable is None and end.name.endswith("]") else declared.shape
        name = declared.alias_of or end.name
        return shape, [SspEnd(end.element, element) for element in element_names(name, shape)]

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

    def find(self, path: ElementPath, name: str) -> list[SspEnd]:
        """Return the variables with a hierarchical name in the element `path`; several if names have dots."""
        if path in self.components:
            known = self.components[path].variables
            return [SspEnd(path, name)] if name in known or not known else []
        found = [SspEnd(path, name)] if name in self.connectors[path] else []
        for inner in (*self.components, *self.systems):
            if inner[:-1] == path and inner and name.startswith(f"{inner[-1]}."):
                found += self.find(inner, name[len(inner[-1]) + 1 :])
        return found


def read_structure(archive: SspArchive, system: _Element) -> SspStructure:
    """Read a system.

    Raises:
        SspError: it has unsupported features.
    """
    reader = _StructureReader(archive, unit_definitions(system.iterfind(f"../{{{SSD}}}Units/*")))
    reader.add_system(system, ())
    return reader.structure


@dataclass
class _StructureReader:
    """Adds systems to a structure, the innermost first."""

    archive: SspArchive
    definitions: Mapping[str, UnitDefinition]
    """Units that the archive defines."""
    structure: SspStructure = field(default_factory=SspStructure)

    def add_system(self, system: _Element, path: ElementPath) -> None:
        structure = self.structure
        structure.connectors[path] = self._connectors(system)
        for dictionary in system.iterfind(f"{{{SSD}}}SignalDictionaries/{{{SSD}}}SignalDictionary"):
            self._add_dictionary(dictionary, path)
        names: set[str] = set()
        for element in system.iterfind(f"{{{SSD}}}Elements/*"):
            kind, name = etree.QName(element).localname, element.get("name", "")
            if not name or name in names:
                what = f"two elements are called {name!r}" if name else "an element has no name"
                raise SspError(what, element)
            names.add(name)
            inner = (*path, name)
            if kind == "System":
                self.add_system(element, inner)
            elif kind == "Component":
                structure.components[inner] = self._component(element, inner)
                structure.connectors[inner] = self._connectors(element)
            elif kind == "SignalDictionaryReference":
                structure.dictionaries[inner] = self._dictionary(element, path)
            else:
                raise unsupported(f"an element of kind {kind} ({name}) is not supported", element)
        for connection in system.iterfind(f"{{{SSD}}}Connections/{{{SSD}}}Connection"):
            for source, sink in self._directed(connection, path):
                before, _ = structure.sources.setdefault(sink, (source, connection))
                if before != source:
                    raise SspError(f"{sink} has more than one source: {before} and {source}", connection)
        structure.systems[path] = system

    def _add_dictionary(self, element: _Element, path: ElementPath) -> None:
        """Add the signal dictionary of a system, whose entries every reference to it shares, as a bus."""
        check_type(element, DICTIONARY_TYPE)
        content = self.archive.content(element, "", f"{{{SSB}}}SignalDictionary", "signals")
        own = {**self.definitions, **unit_definitions(content.iterfind(f"{{{SSB}}}Units/*"))}
        name = element.get("name", "")
        key, place = (*path, "", name), (*path, f"signal dictionary {name}")
        self.structure.dictionaries[key] = place
        self.structure.connectors[place] = _connectors(content, own, f"{{{SSB}}}DictionaryEntry")

    def _dictionary(self, reference: _Element, path: ElementPath) -> ElementPath:
        """Return the path of the dictionary that a reference names, in its own system or one around it."""
        name = reference.get("dictionary", "")
        for depth in range(len(path), -1, -1):
            if (place := self.structure.dictionaries.get((*path[:depth], "", name))) is not None:
                return place
        raise SspError(
            f"there is no signal dictionary {name!r}, to which {reference.get('name')!r} refers", reference
        )

    def _connectors(self, element: _Element) -> dict[str, SspVariable]:
        return _connectors(element, self.definitions, f"{{{SSD}}}Connectors/{{{SSD}}}Connector")

    def _component(self, element: _Element, path: ElementPath) -> SspComponent:
        who, source = f"component {'.'.join(path)!r}", element.get("source", "")
        kind = element.get("type", FMU_TYPE)
        if not source:
            raise unsupported(f"{who} names no FMU (it has no source): only FMUs can be run", element)
        if kind != FMU_TYPE or not source.lower().endswith(".fmu"):
            what = f"is not an FMU (type {kind}, source {source!r}): only FMUs are supported"
            raise unsupported(f"{who} {what}", element)
        implementation = element.get("implementation", "any")
        if implementation not in ("any", "CoSimulation"):
            raise unsupported(f"{who} wants {implementation}: only CoSimulation is supported", element)
        member = self.archive.member(element)
        return SspComponent(path, element, member, self.archive.variables(member, element))

    def _directed(self, connection: _Element, path: ElementPath) -> list[tuple[SspEnd, SspEnd]]:
        """Return source and target of a connection in the system `path`, of arrays those of every element."""
        start, end = (self._end(connection, which, path) for which in ("start", "end"))
        start_gives, end_gives = (self._gives(side, path) for side in (start, end))
        if start_gives is not None and start_gives == end_gives:
            what = "gives a value" if start_gives else "takes a value"
            raise SspError(f"cannot connect {start} and {end}: each {what}", connection)
        of_start, starts = self._elements_at(start, connection, "start")
        of_end, ends = self._elements_at(end, connection, "end")
        if len(starts) != len(ends) or (len(starts) > 1 and of_start != of_end):
            sizes = " and ".join("x".join(map(str, shape)) or "1" for shape in (of_start, of_end))
            raise SspError(f"cannot connect {start} and {end}: they have {sizes} elements", connection)
        turned = start_gives is False or end_gives
        return list(zip(ends, starts, strict=True) if turned else zip(starts, ends, strict=True))

    def _elements_at(
        self, end: SspEnd, connection: _Element, which: str
    ) -> tuple[tuple[int, ...], list[SspEnd]]:
        """Return the shape and elements of an end of a connection, or the one that it is restricted to."""
        shape, elements = self.structure.elements(end)
        text = connection.get(f"{which}Indices")
        if text is None:
            return shape, elements
        at = _whole(text.split())
        if not at or len(at) != len(shape) or not all(1 <= i <= n for i, n in zip(at, shape, strict=True)):
            size = (
                f"it has {'x'.join(map(str, shape))} elements, counted from 1" if shape else "it is no array"
            )
            raise SspError(f"{which}Indices {text!r} is no element of {end}: {size}", connection)
        return (), [SspEnd(end.element, f"{elements[0].name.rpartition('[')[0]}[{','.join(map(str, at))}]")]

    def _end(self, connection: _Element, which: str, path: ElementPath) -> SspEnd:
        known = self.structure
        element, name = connection.get(f"{which}Element"), connection.get(f"{which}Connector", "")
        inner = (*path, element) if element else path
        inner = known.dictionaries.get(inner, inner)
        if inner not in known.connectors:
            sentence = f"a connection names {element!r}: there is no such component"
            raise SspError(sentence, connection, code="file-missing")
        if inner not in known.components and name not in known.connectors[inner]:
            of = "the " if inner in known.dictionaries.values() else "the system "
            system = of + ".".join(inner) if inner else "the system"
            sentence = f"a connection names the connector {name!r}: {system} has none of this name"
            raise SspError(sentence, connection)
        return SspEnd(inner, name)

    def _gives(self, end: SspEnd, path: ElementPath) -> bool | None:
        """Return whether an end is a source in the system `path`, None if undeclared."""
        declared = self.structure.variable(end) or self.structure.connector(end)
        gives = _GIVES.get(declared.causality or "")
        return gives if gives is None or end.element != path else not gives


def _connectors(
    element: _Element, definitions: Mapping[str, UnitDefinition], tag: str
) -> dict[str, SspVariable]:
    connectors: dict[str, SspVariable] = {}
    for connector in element.iterfind(tag):
        unit = next((kind.get("unit") for kind in connector if kind.get("unit")), None)
        shape = _whole(dimension.get("size") for dimension in connector.iterfind(f"{{{SSC}}}Dimension"))
        declared = SspVariable(connector.get("kind", ""), unit, definitions.get(str(unit)), shape=shape)
        connectors.update(_elements(str(connector.get("name")), declared))
    return connectors

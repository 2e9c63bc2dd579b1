"""Access to the members of an SSP archive, and the names used by both reading and writing of SSP.

Nothing is unpacked to disk, and references outside of the archive are refused.
"""

from __future__ import annotations

import contextlib
import io
import posixpath
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote, urlsplit

from lxml import etree
from lxml.etree import _Element

from ..errors import Diagnostic, Location
from ..messages import short
from ..plan import Causality, UnitDefinition
from ..safe_files import PACKED, TooLargeError, check_archive, read_bytes, reason
from .quantities import BASE_UNITS, Unit, measure_of

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

"""The members of an SSP archive: descriptions as XML, and what its FMUs declare.

Nothing is unpacked to disk, and no address leads out of the archive.
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

from ..errors import Problem
from ..files import PACKED, TooLargeError, check_archive, read_bytes, reason
from ..plan import UnitDefinition
from ..wording import short
from .measurement_units import BASE_UNITS, Measure, measure_of

LARGEST = 100_000_000
"""Bytes that a description may take, unpacked. Chosen: a thousand times what one of ours takes."""

_DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, ValueError, RuntimeError, NotImplementedError)


class Refused(Exception):
    """What cannot be read, in one sentence, and the element that says so."""

    def __init__(self, sentence: str, element: _Element | None = None) -> None:
        super().__init__(sentence)
        self.line = 0 if element is None else element.sourceline or 0
        self.member = "" if element is None else element.getroottree().docinfo.URL or ""

    def problem(self, path: Path) -> Problem:
        """Return it as a problem of the archive `path`, with the place in it that it speaks of."""
        if self.line and self.member:
            return Problem(str(self), file=path / self.member, line=self.line)
        return Problem(str(self), file=path)


class Declared(NamedTuple):
    """A variable as an FMU declares it."""

    causality: str
    unit: str | None = None
    definition: UnitDefinition | None = None

    @property
    def measure(self) -> Measure | None:
        """What its unit means, None if it has none or one that nobody knows."""
        return measure_of(self.unit, self.definition)


class Archive:
    """An SSP archive, read into memory.

    Raises:
        Refused: it is missing or damaged.
    """

    def __init__(self, path: Path, *, what: str) -> None:
        self.path = path
        try:
            raw = read_bytes(path, largest=PACKED)
        except FileNotFoundError:
            raise Refused(f"no such {what}") from None
        except (OSError, ValueError) as error:
            raise Refused(f"cannot read this {what}: {reason(error)}") from None
        try:
            self._archive = zipfile.ZipFile(io.BytesIO(raw))
            check_archive(self._archive)
        except TooLargeError as error:
            raise Refused(f"cannot read this {what}: {error}") from None
        except _DAMAGE as error:
            raise Refused(f"no {what}, or damaged: {error}") from None
        self._variables: dict[str, dict[str, Declared]] = {}

    def member(self, element: _Element) -> str:
        """Return the member that the `source` of an element means.

        Raises:
            Refused: it is outside of the archive, or in an FMU.
        """
        source = element.get("source", "")
        try:
            address = urlsplit(source)
        except ValueError:
            raise Refused(f"source {short(source)} is no address", element) from None
        member = posixpath.normpath(unquote(address.path))
        if address.scheme or address.netloc or not source or member.startswith(("/", "..")):
            raise Refused(f"source {source!r} is not in the archive", element)
        if element.get("sourceBase", "SSD") != "SSD":
            raise Refused(
                f"source {source!r} is in a component: only members of the archive are read", element
            )
        return member

    def xml(self, member: str, tag: str) -> _Element:
        """Return the root of a description.

        Raises:
            Refused: there is none, it is damaged, or its root is not a `tag`.
        """
        try:
            if self._archive.getinfo(member).file_size > LARGEST:
                raise Refused(f"{member} is larger than {LARGEST // 10**6} MB")
            root = etree.fromstring(self._archive.read(member), _parser(), base_url=member)
        except KeyError:
            raise Refused(f"no SSP archive, or not all of it: there is no {member}") from None
        except etree.XMLSyntaxError as error:
            raise Refused(f"{member} is not well-formed: {error.msg}") from None
        except _DAMAGE as error:
            raise Refused(f"{member} is damaged: {error}") from None
        if root.tag != tag:
            raise Refused(f"{member} is no {etree.QName(tag).localname} of SSP 1.0")
        return root

    def variables(self, member: str, component: _Element) -> dict[str, Declared]:
        """Return the variables of an FMU; none if it cannot be read, as opening it will say.

        Raises:
            Refused: the archive does not hold it.
        """
        if member not in self._variables:
            try:
                with zipfile.ZipFile(io.BytesIO(self._archive.read(member))) as fmu:
                    check_archive(fmu)
                    description = etree.fromstring(fmu.read("modelDescription.xml"), _parser())
            except (KeyError, *_DAMAGE, etree.XMLSyntaxError):
                if member not in self._archive.namelist():
                    raise Refused(f"there is no {member} in the archive", component) from None
                description = etree.Element("none")
            self._variables[member] = dict(_declared(description))
        return self._variables[member]


def _declared(description: _Element) -> Iterator[tuple[str, Declared]]:
    """Yield the variables of a model description of FMI 2.0 or 3.0."""
    types = {
        str(one.get("name")): (one if one.get("unit") else next(iter(one), one)).get("unit")
        for one in description.iterfind("TypeDefinitions/*")
    }
    definitions = unit_definitions(description.iterfind("UnitDefinitions/Unit"))
    for variable in description.iterfind("ModelVariables/*"):
        kind = variable if variable.tag != "ScalarVariable" else variable.find("Real")
        unit = None
        if kind is not None:
            unit = kind.get("unit") or types.get(str(kind.get("declaredType")))
        declared = Declared(variable.get("causality", "local"), unit, definitions.get(str(unit)))
        yield str(variable.get("name")), declared


def unit_definitions(units: Iterable[_Element]) -> dict[str, UnitDefinition]:
    """Return what `Unit` elements define, those of FMI or of SSP, by name."""
    found = {}
    for unit in units:
        base = unit.find("{*}BaseUnit")
        if base is None:
            continue
        with contextlib.suppress(ValueError):  # a malformed number defines nothing
            powers = tuple(int(base.get(name, "0")) for name in BASE_UNITS)
            scale = (float(base.get(key, default)) for key, default in (("factor", "1"), ("offset", "0")))
            found[str(unit.get("name"))] = UnitDefinition(powers, *scale)
    return found


def _parser() -> etree.XMLParser:
    return etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, remove_pis=True)

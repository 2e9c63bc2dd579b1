"""An SSP 1.0 archive as a scenario: the content that a YAML file of the same system would have.

Every component becomes a unit whose FMU is the member of the archive. Only what the archive connects
is connected, and an input that it neither connects nor gives a value keeps its FMU's start value, as
the standard has it. The communication step and the units' own come from the annotations of the Open
Simulation Platform, all that SSP cannot say from our own; archives from elsewhere may lack both.

What has no counterpart here is refused by name: systems in systems, signal dictionaries,
transformations, components that are no FMUs.
"""

from __future__ import annotations

import io
import posixpath
import zipfile
import zlib
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from lxml import etree
from lxml.etree import _Element

from .ssp_names import DESCRIPTION_FILE, OSP, OWN, SSD, SSM, SSV
from .yaml_lines import Document

FMU_TYPE = "application/x-fmu-sharedlibrary"
_DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, ValueError, RuntimeError, NotImplementedError)


class _Refused(Exception):
    """What cannot be read, in one sentence; with the line it stands in, 0 for none."""

    def __init__(self, sentence: str, line: int = 0) -> None:
        super().__init__(sentence)
        self.line = line


def read(path: Path, *, what: str = "SSP archive") -> Document:
    """Read the archive `path`; whatever is wrong with it stands in the document's problems."""
    document = Document(path)
    try:
        document.data = _Reader(path, what).scenario(document)
    except _Refused as refused:
        place = f"{path}/{DESCRIPTION_FILE}:{refused.line}" if refused.line else str(path)
        document.problems.append((refused.line, f"{place}: {refused}"))
    return document


class _Reader:
    """Reads one archive."""

    def __init__(self, path: Path, what: str) -> None:
        self._path = path
        try:
            raw = path.read_bytes()
        except FileNotFoundError:
            raise _Refused(f"no such {what}") from None
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise _Refused(f"cannot read this {what}: {reason}") from None
        try:
            self._archive = zipfile.ZipFile(io.BytesIO(raw))
        except _DAMAGE as error:
            raise _Refused(f"no {what}, or damaged: {error}") from None

    def scenario(self, document: Document) -> dict[str, Any]:
        """Return what a scenario file of this system would hold."""
        root = self._xml(DESCRIPTION_FILE)
        if root.tag != f"{{{SSD}}}SystemStructureDescription":
            raise _Refused(f"{DESCRIPTION_FILE} is no system structure description of SSP 1.0")
        system = root.find(f"{{{SSD}}}System")
        if system is None:
            raise _Refused(f"{DESCRIPTION_FILE} holds no system")
        components = self._components(system)
        values: dict[str, dict[str, Any]] = {str(c.get("name")): {} for c in components}
        inputs: dict[str, Any] = {}
        for binding in self._bindings(system):
            for name, value in binding:
                unit, _, parameter = name.partition(".")
                if unit not in values or not parameter:
                    raise _Refused(
                        f"the system's parameter {name!r} belongs to no component", system.sourceline or 0
                    )
                values[unit][parameter] = value
        units: dict[str, Any] = {}
        for component in components:
            name = str(component.get("name"))
            for binding in self._bindings(component):
                values[name].update(binding)
            units[name] = self._unit(component, values[name], inputs)
            document.lines[("units", name)] = component.sourceline or 1
        connections = [self._connection(one, values) for one in system.iter(f"{{{SSD}}}Connection")]
        data: dict[str, Any] = {
            "title": root.get("name", ""),
            "source": root.get("description", ""),
            "units": units,
            "connections": connections,
            "inputs": inputs,
        }
        return data | self._experiment(root)

    def _components(self, system: _Element) -> list[_Element]:
        for kind, words in (
            ("System", "a system in the system"),
            ("SignalDictionaryReference", "a signal dictionary"),
        ):
            for one in system.findall(f"{{{SSD}}}Elements/{{{SSD}}}{kind}"):
                raise _Refused(f"{words} ({one.get('name')}) is not supported", one.sourceline or 0)
        components = system.findall(f"{{{SSD}}}Elements/{{{SSD}}}Component")
        for one in components:
            kind = one.get("type", FMU_TYPE)
            if kind != FMU_TYPE or not one.get("source", "").lower().endswith(".fmu"):
                raise _Refused(
                    f"component {one.get('name')!r} is no FMU (type {kind}, source {one.get('source')!r}): "
                    "only FMUs are supported",
                    one.sourceline or 0,
                )
            if one.get("implementation", "any") not in ("any", "CoSimulation"):
                raise _Refused(
                    f"component {one.get('name')!r} wants {one.get('implementation')}: "
                    "only CoSimulation is supported",
                    one.sourceline or 0,
                )
        return components

    def _unit(self, component: _Element, values: dict[str, Any], inputs: dict[str, Any]) -> dict[str, Any]:
        """Return a unit; what gives one of its inputs a value goes to `inputs`."""
        member = self._member(component, component.get("source", ""))
        name = str(component.get("name"))
        units = self._variables(member, component)
        parameters = {}
        for variable, (value, unit) in values.items():
            causality, own_unit = units.get(variable, ("", None))
            if unit is not None and unit != own_unit and not isinstance(value, (bool, str)):
                value = f"{value!r} {unit}"
            if causality == "input":
                inputs[f"{name}.{variable}"] = value
            else:
                parameters[variable] = value
        spec: dict[str, Any] = {"fmu": f"{self._path.name}/{member}"}
        if parameters:
            spec["parameters"] = parameters
        hint = component.find(f".//{{{OSP}}}StepSizeHint")
        if hint is not None:
            spec["step_size"] = _time(hint, "value")
        return spec

    def _variables(self, member: str, component: _Element) -> dict[str, tuple[str, str | None]]:
        """Return causality and unit of an FMU's variables; none if it cannot be read, as wiring will say."""
        try:
            with zipfile.ZipFile(io.BytesIO(self._archive.read(member))) as fmu:
                description = etree.fromstring(fmu.read("modelDescription.xml"), _parser())
        except KeyError as error:
            if member in self._archive.namelist():
                return {}
            raise _Refused(
                f"there is no {member} in the archive: {error.args[0]}", component.sourceline or 0
            ) from None
        except (*_DAMAGE, etree.XMLSyntaxError):
            return {}
        found = {}
        for variable in description.iter("ScalarVariable"):
            real = variable.find("Real")
            unit = real.get("unit") if real is not None else None
            found[str(variable.get("name"))] = (variable.get("causality", "local"), unit)
        return found

    def _bindings(self, element: _Element) -> list[list[tuple[str, Any]]]:
        """Return names with (value, unit) of each set of parameters bound to an element."""
        sets = []
        for binding in element.findall(f"{{{SSD}}}ParameterBindings/{{{SSD}}}ParameterBinding"):
            inline = binding.find(f"{{{SSD}}}ParameterValues/{{{SSV}}}ParameterSet")
            if inline is None and not binding.get("source"):
                raise _Refused("parameters are bound that are nowhere", binding.sourceline or 0)
            source = self._member(binding, binding.get("source", "")) if inline is None else ""
            values = inline if inline is not None else self._xml(source)
            names = self._mapping(binding)
            prefix = binding.get("prefix", "")
            found = []
            for parameter in values.iterfind(f"{{{SSV}}}Parameters/{{{SSV}}}Parameter"):
                value = _value(parameter)
                given = str(parameter.get("name"))
                called = [given] if names is None else names.get(given, [])
                found += [(prefix + name, value) for name in called]
            sets.append(found)
        return sets

    def _mapping(self, binding: _Element) -> dict[str, list[str]] | None:
        """Return what a binding's mapping calls each parameter, None if it has none."""
        mapping = binding.find(f"{{{SSD}}}ParameterMapping")
        if mapping is None:
            return None
        content = mapping.find(f"{{{SSM}}}ParameterMapping")
        if content is None:
            content = self._xml(self._member(mapping, mapping.get("source", "")))
        names: dict[str, list[str]] = {}
        for entry in content.iterfind(f"{{{SSM}}}MappingEntry"):
            _no_transformation(entry)
            names.setdefault(str(entry.get("source")), []).append(str(entry.get("target")))
        return names

    def _connection(self, connection: _Element, units: dict[str, Any]) -> dict[str, str]:
        _no_transformation(connection)
        ends = {}
        for key, end in (("from", "start"), ("to", "end")):
            unit, variable = connection.get(f"{end}Element"), connection.get(f"{end}Connector")
            if unit is None:
                raise _Refused(
                    f"a connection ends at the system's own connector {variable!r}: it has no value here",
                    connection.sourceline or 0,
                )
            if unit not in units:
                raise _Refused(
                    f"a connection names {unit!r}: there is no such component", connection.sourceline or 0
                )
            ends[key] = f"{unit}.{variable}"
        return ends

    def _experiment(self, root: _Element) -> dict[str, Any]:
        """Return times, algorithm and what is recorded, as far as the archive says."""
        found: dict[str, Any] = {}
        experiment = root.find(f"{{{SSD}}}DefaultExperiment")
        if experiment is not None:
            if experiment.get("startTime") is not None and _time(experiment, "startTime") != 0.0:
                raise _Refused(
                    "runs begin at 0 s: another startTime is not supported", experiment.sourceline or 0
                )
            if experiment.get("stopTime") is not None:
                found["stop_time"] = _time(experiment, "stopTime")
        algorithm = root.find(f".//{{{OSP}}}FixedStepAlgorithm")
        if algorithm is not None and algorithm.get("baseStepSize"):
            found["step_size"] = _time(algorithm, "baseStepSize")
        own = root.find(f".//{{{OWN}}}Scenario")
        if own is not None:
            found["step_size"] = _time(own, "stepSize")
            found["algorithm"] = own.get("algorithm")
            record = [str(one.get("variable")) for one in own.iterfind(f"{{{OWN}}}Record")]
            found |= {"record": record} if record else {}
        return found

    def _member(self, element: _Element, source: str) -> str:
        """Return the archive's member that a `source` means."""
        address = urlsplit(source)
        member = posixpath.normpath(unquote(address.path))
        if address.scheme or address.netloc or not source or member.startswith(("/", "..")):
            raise _Refused(f"source {source!r} is not in the archive", element.sourceline or 0)
        return member

    def _xml(self, member: str) -> _Element:
        try:
            return etree.fromstring(self._archive.read(member), _parser())
        except KeyError:
            raise _Refused(f"no SSP archive, or not all of it: there is no {member}") from None
        except etree.XMLSyntaxError as error:
            raise _Refused(f"{member} is not well-formed: {error.msg}") from None
        except _DAMAGE as error:
            raise _Refused(f"{member} is damaged: {error}") from None


def _parser() -> etree.XMLParser:
    return etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True)


def _no_transformation(element: _Element) -> None:
    for one in element:
        kind = etree.QName(one).localname
        if kind.endswith("Transformation"):
            raise _Refused(f"a {kind} is not supported: connect without one", one.sourceline or 0)


def _value(parameter: _Element) -> tuple[Any, str | None]:
    """Return a parameter's value and its unit."""
    line = parameter.sourceline or 0
    for kind in parameter:
        name, text = etree.QName(kind).localname, kind.get("value", "")
        try:
            if name == "Real":
                return float(text), kind.get("unit")
            if name == "Integer":
                return int(text), None
            if name == "Boolean":
                return {"true": True, "1": True, "false": False, "0": False}[text], None
        except (ValueError, KeyError):
            raise _Refused(
                f"parameter {parameter.get('name')!r}: {text!r} is not of type {name}", line
            ) from None
        if name in ("String", "Enumeration"):
            return text, None
        if name == "Binary":
            raise _Refused(f"parameter {parameter.get('name')!r} is Binary: not supported", line)
    raise _Refused(f"parameter {parameter.get('name')!r} has no value", line)


def _time(element: _Element, attribute: str) -> float:
    """Return a time [s]; what is read from its shortest decimal is exact."""
    text = element.get(attribute, "")
    try:
        return float(text)
    except ValueError:
        raise _Refused(f"{attribute} {text!r} is no time in s", element.sourceline or 0) from None

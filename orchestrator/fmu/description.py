"""An FMU's model description as `plan.Fmu`, read by fmpy, checked for what this master supports."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import re
from collections.abc import Container, Mapping
from pathlib import Path, PurePosixPath
from typing import Any
from xml.etree import ElementTree

from ..errors import ModelDescriptionError
from ..plan import Fmu, UnitDefinition, Value, Variable

SUPPORTED = "supported is FMI 2.0 for co-simulation"
_CHOICES = re.compile(r"\(one of: ([^()]*)\)$")


def describe(files: Mapping[str, bytes], raw: bytes, path: Path) -> Fmu:
    """Read the model description of the archive `raw` that holds `files`; `directory` is still to be set.

    Raises:
        ModelDescriptionError: none, malformed, invalid, or of a kind that is not supported.
    """
    if "modelDescription.xml" not in files:
        raise ModelDescriptionError(f"{path}: no FMU: the archive holds no modelDescription.xml")
    root = _parsed(files["modelDescription.xml"], path)

    from fmpy.model_description import ValidationError, read_model_description

    try:
        description = read_model_description(io.BytesIO(raw))
        variables = _variables(description, _optional(root))
    except ValidationError as error:
        raise ModelDescriptionError(
            f"{path}: the model description is not valid FMI 2.0: {error.problems[0]}"
        ) from None
    except Exception as error:  # fmpy raises whatever its parsing meets
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ModelDescriptionError(f"{path}: the model description cannot be used: {reason}") from None
    kind = description.coSimulation
    return Fmu(
        name=path.stem,
        path=path,
        directory=path,
        sha256=hashlib.sha256(raw).hexdigest(),
        guid=description.guid or "",
        model_identifier=kind.modelIdentifier,
        generation_tool=description.generationTool or "",
        can_save_state=kind.canGetAndSetFMUstate,
        variables=variables,
        description=description.description or "",
        once_per_process=kind.canBeInstantiatedOnlyOncePerProcess,
        python_modules=_python_modules(files),
    )


def _parsed(xml: bytes, path: Path) -> ElementTree.Element:
    """Return the root of the model description of an FMU of a kind that is supported."""
    try:
        root = ElementTree.fromstring(xml)
    except ElementTree.ParseError as error:
        raise ModelDescriptionError(f"{path}: modelDescription.xml is not well-formed XML: {error}") from None
    version = root.get("fmiVersion")
    if root.tag != "fmiModelDescription" or version is None:
        raise ModelDescriptionError(f"{path}: modelDescription.xml is no FMI model description; {SUPPORTED}")
    if version != "2.0":
        raise ModelDescriptionError(f"{path}: an FMU of FMI {version}; {SUPPORTED}")
    if root.find("CoSimulation") is None:
        raise ModelDescriptionError(f"{path}: an FMU for model exchange only; {SUPPORTED}")
    return root


def _optional(root: ElementTree.Element) -> set[str]:
    """Return the inputs that need no source: `<Annotations><Tool name="yawbench"><optional/>`."""
    mark = "Annotations/Tool[@name='yawbench']/optional"
    variables = root.iterfind("ModelVariables/ScalarVariable")
    return {
        v.get("name", "") for v in variables if v.get("causality") == "input" and v.find(mark) is not None
    }


def _variables(description: Any, optional: Container[str]) -> dict[str, Variable]:
    sources: dict[str, tuple[str, ...] | None] = {}
    for unknown in description.outputs:
        known = unknown.dependencies
        names = None if known is None else tuple(v.name for v in known if v.causality == "input")
        sources[unknown.variable.name] = names
    definitions = _definitions(description)
    variables: dict[str, Variable] = {}
    for v in description.modelVariables:
        declared = v.declaredType
        unit = v.unit or (declared.unit if declared else None)
        text = v.description or ""
        listed = _CHOICES.search(text) if v.type == "String" else None
        items = (
            {i.name: int(i.value) for i in declared.items} if v.type == "Enumeration" and declared else None
        )
        variables[v.name] = Variable(
            name=v.name,
            reference=v.valueReference,
            type=v.type,
            causality=v.causality,
            variability=v.variability,
            unit=unit,
            start=_value(v.type, v.start),
            minimum=_number(v.min or (declared.min if declared else None)),
            maximum=_number(v.max or (declared.max if declared else None)),
            description=text,
            depends_on=sources.get(v.name) if v.causality == "output" else None,
            choices=tuple(listed[1].split(", ")) if listed else None,
            items=items,
            optional=v.name in optional,
            definition=definitions.get(unit),
        )
    return variables


def _definitions(description: Any) -> dict[str | None, UnitDefinition]:
    """Return what the description defines in base units, by the name of the unit."""
    return {
        unit.name: UnitDefinition(
            (base.kg, base.m, base.s, base.A, base.K, base.mol, base.cd, base.rad), base.factor, base.offset
        )
        for unit in description.unitDefinitions
        if (base := unit.baseUnit) is not None
    }


def _value(kind: str, text: str | None) -> Value | None:
    if text is None or kind == "String":
        return text
    if kind == "Boolean":
        return text in ("true", "1")
    return float(text) if kind == "Real" else int(text)


def _number(text: str | None) -> float | None:
    return None if text is None else float(text)


def _python_modules(files: Mapping[str, bytes]) -> dict[str, str]:
    """Return the top-level modules that a PythonFMU unit brings along, each with a hash of its content.

    PythonFMU's own package is left out: it is the same for all units or at least made to be.
    """
    if "resources/slavemodule.txt" not in files:
        return {}
    hashes: dict[str, Any] = {}
    for name in sorted(files):
        parts = PurePosixPath(name).parts
        if len(parts) < 2 or parts[0] != "resources" or not name.endswith(".py"):
            continue
        module = parts[1].removesuffix(".py")
        digest = hashes.setdefault(module, hashlib.sha256())
        digest.update("/".join(parts[1:]).encode() + b"\0" + files[name] + b"\0")
    return {module: digest.hexdigest() for module, digest in hashes.items() if module != "pythonfmu"}


def to_record(fmu: Fmu) -> dict[str, Any]:
    """Return the description as JSON-ready data, without where archive and folder are."""
    record = dataclasses.asdict(fmu)
    for key in ("name", "path", "directory"):
        del record[key]
    record["variables"] = list(record["variables"].values())
    return record


def from_record(record: dict[str, Any], *, path: Path, directory: Path) -> Fmu:
    """Return the description that `to_record` made, for the archive `path` unpacked in `directory`."""
    variables = {}
    for v in record["variables"]:
        for key in ("depends_on", "choices"):
            v[key] = None if v[key] is None else tuple(v[key])
        if (unit := v.get("definition")) is not None:
            v["definition"] = UnitDefinition(tuple(unit["powers"]), unit["factor"], unit["offset"])
        variables[v["name"]] = Variable(**v)
    fields = {**record, "variables": variables}
    return Fmu(name=path.stem, path=path, directory=directory, **fields)

"""An FMU's model description as `plan.Fmu`, read by fmpy, checked for what this master supports."""

from __future__ import annotations

import hashlib
import io
import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from ..errors import ModelDescriptionError
from ..plan import Fmu, UnitDefinition, Variable
from ..wording import short
from .binary import binary_of, lacking
from .scalars import scalars
from .shadowing import hashes_of_modules

SUPPORTED = "supported are FMI 2.0 and 3.0 for co-simulation"


def describe(files: Mapping[str, bytes], raw: bytes, path: Path) -> Fmu:
    """Read the model description of the archive `raw` that holds `files`; `directory` is still to be set.

    One that is formally wrong is read all the same, if it can be; what is wrong stands in `flaws`.

    Raises:
        ModelDescriptionError: none, malformed, unusable, or of a kind that is not supported.
    """
    if "modelDescription.xml" not in files:
        raise ModelDescriptionError(f"{path}: no FMU: the archive holds no modelDescription.xml")
    root = _parsed(files["modelDescription.xml"], path)
    fmi = int(root.get("fmiVersion", "")[0])
    if wrong := _dangling(root, fmi):
        raise ModelDescriptionError(f"{path}: the model description cannot be used: {wrong}")

    from fmpy.model_description import ValidationError, read_model_description

    flaws: list[str] = []
    try:
        try:
            description = read_model_description(io.BytesIO(raw))
        except ValidationError as error:
            flaws = [_one_line(problem) for problem in error.problems]
            description = read_model_description(io.BytesIO(raw), validate=False)
        variables, refused = scalars(description, root)
    except Exception as error:  # fmpy raises whatever its parsing meets
        reason = _one_line(error) or type(error).__name__
        unforeseen = isinstance(error, LookupError | TypeError | AttributeError | NameError)
        if flaws:
            reason = f"it is not valid FMI {fmi}.0: {flaws[0].rstrip('.')}" + f" ({reason})" * (
                not unforeseen
            )
        elif unforeseen:
            reason = f"something in it is not understood ({type(error).__name__}: {reason})"
        raise ModelDescriptionError(f"{path}: the model description cannot be used: {reason}") from None
    kind = description.coSimulation
    experiment = description.defaultExperiment
    identifier = kind.modelIdentifier or ""
    return Fmu(
        name=path.stem,
        path=path,
        directory=path,
        sha256=hashlib.sha256(raw).hexdigest(),
        guid=description.guid or "",
        model_identifier=identifier,
        generation_tool=description.generationTool or "",
        variables=variables,
        description=description.description or "",
        once_per_process=kind.canBeInstantiatedOnlyOncePerProcess,
        python_modules=_python_modules(files),
        fmi=fmi,
        refused=refused,
        flaws=tuple(flaws),
        lacking=lacking(files.get(binary_of(fmi, identifier)), fmi),
        tolerance=_tolerance(experiment),
        needs_tool=kind.needsExecutionTool,
        host_packages=_host_packages(root),
    )


def _dangling(root: ElementTree.Element, fmi: int) -> str | None:
    """Return which variable is meant that does not exist, None if all do; fmpy takes 0 for the last one."""
    variables = root.findall("ModelVariables/*")
    if fmi == 2:
        known = {str(number) for number in range(1, len(variables) + 1)}
        what, own, among = "variable number", "index", f"there are {len(variables)}"
        rates = [(one, "derivative") for one in root.iterfind("ModelVariables/ScalarVariable/Real")]
    else:
        known = {one.get("valueReference", "") for one in variables}
        what, own, among = "value reference", "valueReference", "no variable has it"
        rates = [(one, "derivative") for one in variables]
    unknowns = root.findall("ModelStructure//Unknown") if fmi == 2 else root.findall("ModelStructure/*")
    places = [(one, key) for one in unknowns for key in (own, "dependencies")]
    for element, key in (*places, *rates):
        for number in (element.get(key) or "").split():
            if number.isdecimal() and number.lstrip("0") not in known and number not in known:
                return f"{key} of {element.tag} names {what} {short(number)}, but {among}"
    return None


def _host_packages(root: ElementTree.Element) -> tuple[str, ...]:
    """Return what one of our units needs of a Python beyond the standard library."""
    needed = root.find("VendorAnnotations/Tool[@name='yawbench']/hostPackages")
    return () if needed is None else tuple(needed.get("names", "").split())


def _one_line(problem: object) -> str:
    return " ".join(str(problem).split())


def _tolerance(experiment: Any) -> float | None:
    """Return the tolerance of a default experiment, None if it has none that makes sense."""
    text = experiment.tolerance if experiment else None
    value = None if text is None else float(text)
    return value if value is not None and 0.0 < value < math.inf else None


def _parsed(xml: bytes, path: Path) -> ElementTree.Element:
    """Return the root of the model description of an FMU of a kind that is supported."""
    try:
        root = ElementTree.fromstring(xml)
    except ElementTree.ParseError as error:
        raise ModelDescriptionError(f"{path}: modelDescription.xml is not well-formed XML: {error}") from None
    except (ValueError, LookupError) as error:  # of encodings that Python knows and the parser does not
        raise ModelDescriptionError(
            f"{path}: modelDescription.xml has an encoding that cannot be read ({_one_line(error)}); "
            "FMI asks for UTF-8"
        ) from None
    version = root.get("fmiVersion")
    if root.tag != "fmiModelDescription" or version is None:
        raise ModelDescriptionError(f"{path}: modelDescription.xml is no FMI model description; {SUPPORTED}")
    if version != "2.0" and not version.startswith("3.0"):
        raise ModelDescriptionError(f"{path}: an FMU of FMI {version}; {SUPPORTED}")
    if root.find("CoSimulation") is None:
        scheduled = root.find("ScheduledExecution") is not None and root.find("ModelExchange") is None
        kind = "scheduled execution" if scheduled else "model exchange"
        raise ModelDescriptionError(f"{path}: an FMU for {kind} only; {SUPPORTED}")
    return root


def _python_modules(files: Mapping[str, bytes]) -> dict[str, str]:
    """Return the top-level modules that a PythonFMU unit brings along, each with a hash of its content.

    PythonFMU's own package is left out: it is the same for all units or at least made to be.
    """
    if "resources/slavemodule.txt" not in files:
        return {}
    inside = {name.partition("/")[2]: files[name] for name in files if name.startswith("resources/")}
    return {name: digest for name, digest in hashes_of_modules(inside).items() if name != "pythonfmu"}


def to_record(fmu: Fmu) -> dict[str, Any]:
    """Return the description as JSON-ready data, without where archive and folder are."""
    record = {key: value for key, value in asdict(fmu).items() if key not in ("name", "path", "directory")}
    return {**record, "variables": list(record["variables"].values())}


def from_record(record: dict[str, Any], *, path: Path, directory: Path) -> Fmu:
    """Return the description that `to_record` made, for the archive `path` unpacked in `directory`."""
    variables = {}
    for v in record["variables"]:
        for key in ("depends_on", "choices"):
            v[key] = None if v[key] is None else tuple(v[key])
        if (unit := v.get("definition")) is not None:
            v["definition"] = UnitDefinition(tuple(unit["powers"]), unit["factor"], unit["offset"])
        variables[v["name"]] = Variable(**v)
    tuples = {key: tuple(record[key]) for key in ("flaws", "lacking", "host_packages")}
    fields = {**record, **tuples, "variables": variables}
    return Fmu(name=path.stem, path=path, directory=directory, **fields)

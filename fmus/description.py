"""Model descriptions: read by fmpy into `fmu.Fmu`, and checked for what this master supports.

`scalars` gives the variables as scalars whichever version of FMI describes them, arrays element by element.
"""

from __future__ import annotations

import hashlib
import io
import math
import platform as machine
import sys
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from yawbench.foundation.errors import Diagnostic, ModelDescriptionError
from yawbench.foundation.messages import listed, short

from .fmu import Fmu, UnitDefinition, Value, Variable, element_names
from .zip_members import misplaced

_ALWAYS = ("EnterInitializationMode", "ExitInitializationMode", "DoStep", "FreeInstance")
CORE = {
    2: ("Instantiate", "SetupExperiment", *_ALWAYS),
    3: ("InstantiateCoSimulation", *_ALWAYS),
}
"""Major version of FMI -> functions that every run calls."""
INTEGERS = tuple(f"{sign}Int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U"))
TYPES = {
    2: ("Real", "Integer", "Boolean", "String"),
    3: ("Float32", "Float64", *INTEGERS, "Boolean", "String"),
}
"""Major version of FMI -> types as in the names of setters and getters."""
_ARCHITECTURES = {"amd64": "x86_64", "x86_64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}

_KINDS = {"Float32": "Real", "Float64": "Real"} | dict.fromkeys(INTEGERS, "Integer")
"""Type of FMI 3.0 -> type in a scenario, where the names differ."""
_REFUSED = {
    "Binary": "is Binary, which is not supported",
    "Clock": "is a Clock, which is not supported",
}
ANNOTATION = "org.yawbench"
"""Type of yawbench's own annotations in FMI 3.0."""
MOST = 100_000
"""Largest number of elements of an array; chosen: more than any interface has."""


def scalars(description: Any, root: ElementTree.Element) -> tuple[dict[str, Variable], dict[str, str]]:
    """Return the variables by name, arrays element by element, and the reasons why others cannot be used.

    Args:
        description: the model description as fmpy reads it.
        root: root element of the same model description.
    """
    variables: dict[str, Variable] = {}
    refused: dict[str, str] = {}
    elements = {e.get("name"): e for e in root.iterfind("ModelVariables/*")}
    modern = description.fmiVersion != "2.0"
    follows, definitions = _dependencies(description), _definitions(description)
    for v in description.modelVariables:
        element = elements[v.alias.name if v.alias else v.name]
        if why := _reason(v):
            refused[v.name] = why
            continue
        declared = v.declaredType
        extra = _annotation(element)
        choices = tuple(extra["choices"].split(", ")) if "choices" in extra else ()
        kind: Any = "String" if v.type == "Enumeration" and choices else _KINDS.get(v.type, v.type)
        unit = v.unit or (declared.unit if declared else None)
        items = (
            {i.name: int(i.value) for i in declared.items} if v.type == "Enumeration" and declared else None
        )
        names = element_names(v.name, v.shape or ())
        driven = v.causality == "input" and v.alias
        aliases = element_names(v.alias.name, v.shape or ()) if driven else [None] * len(names)
        starts = _starts(v, "Integer" if kind == "String" and items else kind, element, len(names))
        if kind == "String" and items:
            starts = [next((name for name, n in items.items() if n == start), None) for start in starts]
        limits = element if modern else v  # fmpy does not read the limits of all FMI 3.0 types
        for i, name in enumerate(names):
            variables.setdefault(
                name,
                Variable(
                    name=name,
                    reference=v.valueReference,
                    type=kind,
                    causality=v.causality,
                    variability=v.variability,
                    unit=unit,
                    start=starts[i],
                    minimum=_limit(limits, declared, "min"),
                    maximum=_limit(limits, declared, "max"),
                    description=(v.description or "").removesuffix(f" (one of: {', '.join(choices)})"),
                    depends_on=follows.get(id(v.alias or v)) if v.causality == "output" else None,
                    choices=choices or None,
                    items=items,
                    optional=v.causality == "input" and "optional" in extra,
                    source=extra.get("source", ""),
                    definition=definitions.get(unit),
                    encoding=("Int64" if v.type == "Enumeration" else v.type) if modern else None,
                    element=i,
                    elements=len(names),
                    alias_of=aliases[i],
                    relative=_relative(element, declared),
                ),
            )
    return variables, refused


def _relative(element: ElementTree.Element, declared: Any) -> bool:
    """Return whether a variable is a difference: as its element says, else its type."""
    own = element if element.tag != "ScalarVariable" else element.find("Real")
    text = None if own is None else own.get("relativeQuantity")  # fmpy reads that of types alone
    return bool(declared and declared.relativeQuantity) if text is None else text in ("true", "1")


def _reason(v: Any) -> str | None:
    """Return why a variable cannot be used, None if it can."""
    if v.type in _REFUSED:
        return _REFUSED[v.type]
    if v.clocks:
        return "belongs to a Clock, which is not supported"
    if math.prod(v.shape or ()) > MOST:
        return f"has {math.prod(v.shape)} elements; supported are {MOST}"
    return None


def _dependencies(description: Any) -> dict[int, tuple[str, ...] | None]:
    """Return id of an output -> names of the inputs that it depends on, None if not stated."""

    def names(known: Any) -> Iterator[str]:
        for v in known:
            if v.causality == "input":
                yield from element_names(v.name, v.shape or ())

    return {
        id(unknown.variable): None if unknown.dependencies is None else tuple(names(unknown.dependencies))
        for unknown in description.outputs
    }


def _definitions(description: Any) -> dict[str | None, UnitDefinition]:
    """Return name -> definition in SI base units, for the units of measurement that have one."""
    return {
        instance.name: UnitDefinition(
            (base.kg, base.m, base.s, base.A, base.K, base.mol, base.cd, base.rad), base.factor, base.offset
        )
        for instance in description.unitDefinitions
        if (base := instance.baseUnit) is not None
    }


def _annotation(element: ElementTree.Element) -> dict[str, str]:
    """Return yawbench's own annotation of a variable: optional, choices, source."""
    annotation = _own(element.find("Annotations"), "variable")
    return {} if annotation is None else annotation.attrib


def _own(annotations: ElementTree.Element | None, tag: str) -> ElementTree.Element | None:
    """Return an element of yawbench's own annotation, where FMI 2.0 or 3.0 has it."""
    places = (f"Tool[@name='yawbench']/{tag}", f"Annotation[@type='{ANNOTATION}']/{tag}")
    found = [e for place in places if annotations is not None and (e := annotations.find(place)) is not None]
    return found[0] if found else None


def _starts(v: Any, kind: str, element: ElementTree.Element, count: int) -> list[Value | None]:
    """Return the start value of every element; a single value applies to all."""
    texts: list[str | None]
    if not v.shape:
        texts = [v.start]
    elif kind == "String":
        texts = [start.get("value") for start in element.iterfind("Start")]
    else:
        texts = list((v.start or "").split())
    if len(texts) == 1:
        texts *= count
    if texts and len(texts) != count:
        raise ValueError(f"{v.name!r} has {len(texts)} start values for {count} elements")
    return [_value(kind, text) for text in texts] or [None] * count


def _value(kind: str, text: str | None) -> Value | None:
    if text is None or kind == "String":
        return text
    if kind == "Boolean":
        return text in ("true", "1")
    return float(text) if kind == "Real" else int(text)


def _limit(v: Mapping[str, str] | Any, declared: Any, which: str) -> float | None:
    own = v.get(which) if isinstance(v, ElementTree.Element) else getattr(v, which)
    text = own or (getattr(declared, which) if declared else None)
    return None if text is None else float(text)


def hashes_of_modules(files: Mapping[str, bytes]) -> dict[str, str]:
    """Return the top-level Python modules among files, by their paths, each with a hash of its content."""
    hashes: dict[str, Any] = {}
    for name in sorted(files):
        if name.endswith(".py"):
            digest = hashes.setdefault(name.partition("/")[0].removesuffix(".py"), hashlib.sha256())
            digest.update(name.encode() + b"\0" + files[name] + b"\0")
    return {module: digest.hexdigest() for module, digest in hashes.items()}


MODEL_DESCRIPTION = "modelDescription.xml"
SUPPORTED = "supported are FMI 2.0 and 3.0 for co-simulation"


def describe(files: Mapping[str, bytes], raw: bytes, path: Path) -> Fmu:
    """Read the model description of the archive `raw` with the content `files`; the caller sets `directory`.

    An invalid model description is read nevertheless if possible; its errors are listed in `violations`.

    Raises:
        ModelDescriptionError: it is missing, malformed, unusable, or of a kind that is not supported.
    """
    if MODEL_DESCRIPTION not in files:
        raise ModelDescriptionError(f"{path}: not an FMU: {misplaced(files, MODEL_DESCRIPTION)}")
    root = _parsed(files[MODEL_DESCRIPTION], path)
    fmi = int(root.get("fmiVersion", "")[0])
    if wrong := _dangling(root, fmi):
        raise ModelDescriptionError(f"{path}: the model description cannot be used: {wrong}")

    from fmpy.model_description import ValidationError, read_model_description

    violations: list[str] = []
    try:
        try:
            description = read_model_description(_for_fmpy(files))
        except ValidationError as error:
            violations = [_one_line(violation) for violation in error.problems]
            description = read_model_description(_for_fmpy(files), validate=False)
        variables, refused = scalars(description, root)
    except Exception as error:  # fmpy raises whatever its parsing meets
        reason = _one_line(error) or type(error).__name__
        unforeseen = isinstance(error, LookupError | TypeError | AttributeError | NameError)
        if violations:
            reason = f"it is not valid FMI {fmi}.0: {violations[0].rstrip('.')}" + f" ({reason})" * (
                not unforeseen
            )
        elif unforeseen:
            reason = f"something in it is not understood ({type(error).__name__}: {reason})"
        raise ModelDescriptionError(f"{path}: the model description cannot be used: {reason}") from None
    kind = description.coSimulation
    experiment = description.defaultExperiment
    identifier = kind.modelIdentifier or ""
    fixed = _above_zero(kind.fixedInternalStepSize)
    preferred = _above_zero(experiment.stepSize if experiment else None)
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
        role=_annotated(root, "role", "name"),
        once_per_process=kind.canBeInstantiatedOnlyOncePerProcess,
        python_modules=_python_modules(files),
        fmi=fmi,
        refused=refused,
        violations=tuple(
            Diagnostic("fmu-invalid", f"the model description is not valid FMI {fmi}.0: {text}", "warning")
            for text in violations
        ),
        lacking=lacking(files.get(binary_of(fmi, identifier)), fmi),
        tolerance=_above_zero(experiment.tolerance if experiment else None),
        fixed_step=fixed or (None if kind.canHandleVariableCommunicationStepSize else preferred),
        takes_multiples=fixed is not None,
        needs_tool=kind.needsExecutionTool,
        host_packages=tuple(_annotated(root, "hostPackages", "names").split()),
    )


def resized(fmu: Fmu, values: Mapping[str, Value]) -> Fmu:
    """Return an FMU whose structural parameters have other values, which are the sizes of arrays.

    An array whose start values are for another size has none.

    Raises:
        ModelDescriptionError: an array becomes too large.
    """
    from fmpy.model_description import read_model_description

    root = ElementTree.fromstring((fmu.directory / MODEL_DESCRIPTION).read_bytes())
    sized = {}
    for element in root.iterfind("ModelVariables/*"):
        if element.get("name") in values:
            value = values[str(element.get("name"))]
            element.set("start", str(value).lower())
            sized[element.get("valueReference")] = value
    for element in root.iterfind("ModelVariables/*"):
        dimensions = [d.get("valueReference") for d in element.iterfind("Dimension")]
        if any(reference in sized for reference in dimensions):
            if len((element.get("start") or "").split()) > 1:
                del element.attrib["start"]
            starts = element.findall("Start")
            for start in starts if len(starts) > 1 else ():
                element.remove(start)
    content = {MODEL_DESCRIPTION: ElementTree.tostring(root, "utf-8", xml_declaration=True)}
    variables, refused = scalars(read_model_description(_for_fmpy(content), validate=False), root)
    for name, why in refused.items():
        if name not in fmu.refused:
            raise ModelDescriptionError(f"{fmu.path}: with {_spelled(values)}, {name} {why}")
    return replace(fmu, variables=variables, refused=refused)


def _spelled(values: Mapping[str, Value]) -> str:
    return listed(f"{name} = {value}" for name, value in values.items())


def _for_fmpy(files: Mapping[str, bytes]) -> io.BytesIO:
    """Return an archive of the files that fmpy reads, with their plain paths."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name in (MODEL_DESCRIPTION, "sources/buildDescription.xml"):
            if name in files:
                archive.writestr(name, files[name])
    content.seek(0)
    return content


def platform(fmi: int = 2) -> tuple[str, str]:
    """Return the name of this platform in a version of FMI, and the suffix of its binaries."""
    names = {"win32": ("win", ".dll"), "cygwin": ("win", ".dll"), "darwin": ("darwin", ".dylib")}
    system, suffix = names.get(sys.platform, ("linux", ".so"))  # as in fmpy, which is slow to import
    wide = sys.maxsize > 2**32
    if fmi == 2:
        return f"{system}{64 if wide else 32}", suffix
    architecture = _ARCHITECTURES.get(machine.machine().lower(), "x86_64") if wide else "x86"
    return f"{architecture}-{'windows' if system == 'win' else system}", suffix


def binary_of(fmi: int, identifier: str) -> str:
    """Return the path, within the archive, of the library for this platform."""
    name, suffix = platform(fmi)
    return f"binaries/{name}/{identifier}{suffix}"


def lacking(library: bytes | None, fmi: int) -> tuple[str, ...]:
    """Return the functions that this program may call and the library does not export.

    The library is not loaded: a function whose name is not in the file cannot be found after loading. A file
    with none of the names gets its functions from another library; it is checked when it is loaded.
    """
    access = [f"{verb}{kind}" for verb in ("Set", "Get") for kind in TYPES[fmi]]
    named = {name: f"fmi{fmi}{name}" for name in (*CORE[fmi], *access)}
    missing = [name for name, full in named.items() if f"{full}\0".encode() not in (library or b"")]
    return () if len(missing) == len(named) else tuple(named[name] for name in missing)


def _dangling(root: ElementTree.Element, fmi: int) -> str | None:
    """Return an error for a reference to a missing variable, else None; fmpy takes index 0 for the last."""
    variables = root.findall("ModelVariables/*")
    if fmi == 2:
        known = {str(number) for number in range(1, len(variables) + 1)}
        what, own, among = "variable number", "index", f"there are {len(variables)}"
        rates = [(e, "derivative") for e in root.iterfind("ModelVariables/ScalarVariable/Real")]
    else:
        known = {e.get("valueReference", "") for e in variables}
        what, own, among = "value reference", "valueReference", "no variable has it"
        rates = [(e, "derivative") for e in variables]
    unknowns = root.findall("ModelStructure//Unknown") if fmi == 2 else root.findall("ModelStructure/*")
    uses = [(e, key) for e in unknowns for key in (own, "dependencies")]
    for element, key in (*uses, *rates):
        for number in (element.get(key) or "").split():
            if number.isdecimal() and number.lstrip("0") not in known and number not in known:
                return f"{key} of {element.tag} names {what} {short(number)}, but {among}"
    return None


def _annotated(root: ElementTree.Element, tag: str, key: str) -> str:
    """Return an attribute of yawbench's own annotation of an FMU, "" if there is none."""
    element = _own(root.find("VendorAnnotations" if root.get("fmiVersion") == "2.0" else "Annotations"), tag)
    return "" if element is None else element.get(key, "")


def _one_line(problem: object) -> str:
    return " ".join(str(problem).split())


def _above_zero(text: str | float | None) -> float | None:
    """Return an optional number of a description, None if there is none or it is not above 0 and finite."""
    try:
        value = float("nan" if text is None else text)
    except ValueError:
        return None
    return value if 0.0 < value < math.inf else None


def _parsed(xml: bytes, path: Path) -> ElementTree.Element:
    """Parse a model description; refuse versions and kinds of FMI that are not supported."""
    try:
        root = ElementTree.fromstring(xml)
    except ElementTree.ParseError as error:
        raise ModelDescriptionError(f"{path}: modelDescription.xml is not well-formed XML: {error}") from None
    except (ValueError, LookupError) as error:  # encodings that Python knows and the parser does not
        raise ModelDescriptionError(
            f"{path}: modelDescription.xml has an encoding that cannot be read ({_one_line(error)}); "
            "FMI asks for UTF-8"
        ) from None
    version = root.get("fmiVersion")
    if root.tag != "fmiModelDescription" or version is None:
        raise ModelDescriptionError(
            f"{path}: modelDescription.xml is not an FMI model description; {SUPPORTED}"
        )
    if version != "2.0" and not version.startswith("3.0"):
        raise ModelDescriptionError(f"{path}: an FMU of FMI {version}; {SUPPORTED}", code="fmu-unsupported")
    if root.find("CoSimulation") is None:
        scheduled = root.find("ScheduledExecution") is not None and root.find("ModelExchange") is None
        kind = "scheduled execution" if scheduled else "model exchange"
        raise ModelDescriptionError(f"{path}: an FMU for {kind} only; {SUPPORTED}", code="fmu-unsupported")
    return root


def _python_modules(files: Mapping[str, bytes]) -> dict[str, str]:
    """Return the top-level Python modules in a PythonFMU archive, each with a hash of its content.

    PythonFMU's own package is left out: it is the same in all FMUs, or at least meant to be.
    """
    if "resources/slavemodule.txt" not in files:
        return {}
    inside = {name.partition("/")[2]: files[name] for name in files if name.startswith("resources/")}
    return {name: digest for name, digest in hashes_of_modules(inside).items() if name != "pythonfmu"}


def to_record(fmu: Fmu) -> dict[str, Any]:
    """Return the description as JSON-ready data, without the paths of archive and folder."""
    record = {key: value for key, value in asdict(fmu).items() if key not in ("name", "path", "directory")}
    violations = [violation.record() for violation in fmu.violations]
    return {**record, "violations": violations, "variables": list(record["variables"].values())}


def from_record(record: dict[str, Any], *, path: Path, directory: Path) -> Fmu:
    """Return the description written by `to_record`, for the archive `path` unpacked in `directory`."""
    variables = {}
    for v in record["variables"]:
        for key in ("depends_on", "choices"):
            v[key] = None if v[key] is None else tuple(v[key])
        if (unit := v.get("definition")) is not None:
            v["definition"] = UnitDefinition(tuple(unit["powers"]), unit["factor"], unit["offset"])
        variables[v["name"]] = Variable(**v)
    tuples = {key: tuple(record[key]) for key in ("lacking", "host_packages")}
    violations = tuple(map(Diagnostic.of, record["violations"]))
    fields = {**record, **tuples, "violations": violations, "variables": variables}
    return Fmu(name=path.stem, path=path, directory=directory, **fields)

"""From an archive of FMI 2.0 with native libraries to one of FMI 3.0: description, folders, icon.

The native libraries have the functions of both versions (`fmi2_unit.h`, `fmi3_unit.h`), so they are the same
files. Value references are positions counted from 1, as `fmi3_unit.h` has them; the time is the last
variable. What only the Python form needs is left out.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from yawbench.foundation.errors import BuildError

from .archive import REASON
from .build_stamp import read_stamp
from .compiler import OWN, PLATFORMS
from .description import ANNOTATION
from .native.build import NATIVE_LIBRARY
from .packing import DESCRIPTION, python_libraries, to_bytes

ONLY_FMI2 = "fmi2-only"
"""Code of the error that a component has no native library, and so no FMU of FMI 3.0."""
_TYPES = {
    "Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "String": "String",
    "Enumeration": "Enumeration",
}  # fmt: skip
"""Type of FMI 2.0 -> that of FMI 3.0."""
_ICON = """<?xml version="1.0" encoding="UTF-8"?>
<fmiTerminalsAndIcons fmiVersion="3.0">
  <GraphicalRepresentation>
    <CoordinateSystem x1="-100" y1="-100" x2="100" y2="100" suggestedScalingFactorTo_mm="0.1"/>
    <Icon x1="-100" y1="-100" x2="100" y2="100"/>
  </GraphicalRepresentation>
</fmiTerminalsAndIcons>
"""


def to_fmi3(files: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return the files of an FMU of FMI 3.0 for those of one of FMI 2.0 that was built here.

    Raises:
        BuildError: it has no native library; code `fmi2-only`.
    """
    if why := files.get(REASON, b"").decode():
        raise BuildError(f"FMI 2.0 only, as it runs in Python: {why}", code=ONLY_FMI2)
    description = ElementTree.fromstring(files[DESCRIPTION])
    kind = description.find("CoSimulation")
    name = kind.get("modelIdentifier", "") if kind is not None else ""
    kept = ("documentation/", "extra/", "sources/")
    made = {path: content for path, content in files.items() if path.startswith(kept)}
    made |= _binaries(files, name)
    root = _description(description)
    ElementTree.indent(root)
    made[DESCRIPTION] = ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"
    if "model.png" in files:
        made["terminalsAndIcons/icon.png"] = files["model.png"]
        made["terminalsAndIcons/terminalsAndIcons.xml"] = _ICON.encode()
    return made


def convert(archive: Path, folder: Path) -> Path:
    """Write an FMU of FMI 2.0 that was built here as one of FMI 3.0 into a folder, and return it.

    Raises:
        BuildError: it was not built here, or has no native library.
    """
    stamp = read_stamp(archive)
    if stamp is None:
        raise BuildError(f"{archive}: not built here, so it cannot be written as FMI 3.0", code=ONLY_FMI2)
    with zipfile.ZipFile(archive) as opened:
        files = {name: opened.read(name) for name in opened.namelist()}
    try:
        made = to_fmi3(files)
    except BuildError as error:
        raise BuildError(f"{archive}: {error.diagnostics[0].message}", code=ONLY_FMI2) from None
    target = folder / archive.name
    target.write_bytes(to_bytes(made, replace(stamp, edition=replace(stamp.edition, fmi=3))))
    return target


def _binaries(files: Mapping[str, bytes], name: str) -> dict[str, bytes]:
    """Return the native libraries in the folders of FMI 3.0, without those of PythonFMU."""
    native = f"binaries/{OWN.folder}/{NATIVE_LIBRARY}"
    made = {}
    for platform in PLATFORMS.values():
        library = files.get(f"binaries/{platform.folder}/{name}{platform.suffix}")
        if platform == OWN:
            library = files.get(native, library)
        if library is not None and library not in python_libraries():
            made[f"binaries/{platform.name}/{name}{platform.suffix}"] = library
    return made


def _description(old: Element) -> Element:
    """Return a model description of FMI 3.0."""
    new = Element("fmiModelDescription", fmiVersion="3.0", modelName=old.get("modelName", ""))
    new.set("instantiationToken", old.get("guid", ""))
    for key in ("description", "author", "version", "copyright", "license", "generationTool",
                "generationDateAndTime", "variableNamingConvention"):  # fmt: skip
        if old.get(key):
            new.set(key, old.get(key, ""))
    (kind,) = old.iterfind("CoSimulation")
    SubElement(
        new,
        "CoSimulation",
        modelIdentifier=kind.get("modelIdentifier", ""),
        canBeInstantiatedOnlyOncePerProcess="false",
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
        canHandleVariableCommunicationStepSize="true",
    )
    new.extend(old.findall("UnitDefinitions"))
    new.extend(_types(old))
    for tag in ("LogCategories", "DefaultExperiment"):
        new.extend(old.findall(tag))
    variables = SubElement(new, "ModelVariables")
    for position, variable in enumerate(old.iterfind("ModelVariables/ScalarVariable"), start=1):
        variables.append(_variable(variable, str(position)))
    time = str(len(variables) + 1)
    SubElement(
        variables, "Float64", name=_free("time", old), valueReference=time, causality="independent",
        variability="continuous", description="Time of the simulation", unit="s",
    )  # fmt: skip
    if not any(unit.get("name") == "s" for unit in old.iterfind("UnitDefinitions/Unit")):
        variables[-1].attrib.pop("unit")
    structure = SubElement(new, "ModelStructure")
    for tag, one in (("Outputs", "Output"), ("InitialUnknowns", "InitialUnknown")):
        for unknown in old.iterfind(f"ModelStructure/{tag}/Unknown"):
            made = SubElement(structure, one, valueReference=unknown.get("index", ""))
            for key in ("dependencies", "dependenciesKind"):
                if unknown.get(key) is not None:
                    made.set(key, unknown.get(key, ""))
    _annotate(new, [e for tool in old.iterfind("VendorAnnotations/Tool") for e in _content(tool)])
    return new


def _free(name: str, old: Element) -> str:
    """Return a name that no variable has."""
    taken = {variable.get("name") for variable in old.iterfind("ModelVariables/ScalarVariable")}
    while name in taken:
        name = f"independent_{name}"
    return name


def _types(old: Element) -> Iterator[Element]:
    """Yield the definitions of types, if there are any."""
    simple = old.findall("TypeDefinitions/SimpleType")
    if simple:
        group = Element("TypeDefinitions")
        for type in simple:
            (own,) = type
            made = SubElement(group, f"{_TYPES[own.tag]}Type", {**type.attrib, **own.attrib})
            made.extend(own.findall("Item"))
        yield group


def _variable(old: Element, reference: str) -> Element:
    """Return a variable with its value reference."""
    own = next(child for child in old if child.tag in _TYPES)
    kept = ("name", "description", "causality", "variability", "initial")
    attributes = {key: old.get(key, "") for key in kept if old.get(key)}
    new = Element(_TYPES[own.tag], {**attributes, "valueReference": reference})
    for key, text in own.attrib.items():
        if key not in ("start", "reinit", "derivative", "unbounded"):
            new.set(key, text)
    if own.tag != "Real" and new.get("variability") in (None, "continuous"):
        new.set("variability", "discrete")  # the default, which FMI 3.0 allows for numbers with a point alone
    _annotate(new, [e for tool in old.iterfind("Annotations/Tool") for e in _content(tool)])
    if own.get("start") is not None and own.tag == "String":
        SubElement(new, "Start", value=own.get("start", ""))
    elif own.get("start") is not None:
        new.set("start", own.get("start", ""))
    return new


def _content(tool: Element) -> Iterator[tuple[str, Element]]:
    """Yield the elements of a tool's annotation, each with the type of its annotation in FMI 3.0."""
    name = tool.get("name", "")
    for element in tool:
        yield (ANNOTATION if name == "yawbench" else name), element


def _annotate(above: Element, content: list[tuple[str, Element]]) -> None:
    """Add annotations, one for each element as in FMI 2.0."""
    if content:
        group = SubElement(above, "Annotations")
        for kind, element in content:
            SubElement(group, "Annotation", type=kind).append(element)

"""FMI 2.0 model description of a component.

It replaces that of PythonFMU 0.7.0, which lacks units, limits, dependencies, InitialUnknowns and the
capability flags for saving the state. The build fills in the GUID and the date, which it derives from
the content.
"""

from collections.abc import Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement

from yawbench.vocabulary.units import DISPLAYED, UNITS

from .variables import VariableSpec

LOG_CATEGORIES = {
    "logStatusWarning": "Messages with the status Warning",
    "logStatusError": "Messages with the status Error",
    "logStatusFatal": "Messages with the status Fatal",
    "traceback": "Full Python traceback of an error",
    "logAll": "All messages",
}


def to_xml(
    *,
    name: str,
    description: str,
    variables: Sequence[VariableSpec],
    credits: Mapping[str, str],
    host_packages: Sequence[str],
) -> Element:
    """Return the element `fmiModelDescription`; value references are positions in `variables`.

    `needsExecutionTool` is false: the Python interpreter in the process is not a tool in the sense of the
    standard, and some hosts refuse FMUs that say true. `credits` are attributes that may be empty.

    `InitialUnknowns` have no list of dependencies, which by FMI 2.0.4, section 2.2.8, means
    that they depend on all knowns; outputs list exactly the inputs on which they depend directly.
    """
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=name,
        guid="",
        description=description,
        generationTool="yawbench",
        variableNamingConvention="flat",
    )
    for key, text in credits.items():
        if text:
            root.set(key, text)
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=name,
        needsExecutionTool="false",
        canHandleVariableCommunicationStepSize="true",
        canInterpolateInputs="false",
        canBeInstantiatedOnlyOncePerProcess="false",
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
    )
    used = {v.unit for v in variables if v.unit is not None}
    if used:
        definitions = SubElement(root, "UnitDefinitions")
        for unit in sorted(used):
            exponents = {base: str(power) for base, power in UNITS[unit].items()}
            defined = SubElement(definitions, "Unit", name=unit)
            SubElement(defined, "BaseUnit", exponents)
            if unit in DISPLAYED:
                shown, factor = DISPLAYED[unit]
                SubElement(defined, "DisplayUnit", name=shown, factor=repr(factor))
    chosen = [v for v in variables if v.choices is not None]
    if chosen:
        types = SubElement(root, "TypeDefinitions")
        for v in chosen:
            items = SubElement(SubElement(types, "SimpleType", name=_type_of(v)), "Enumeration")
            for number, choice in enumerate(v.choices or (), start=1):
                SubElement(items, "Item", name=choice, value=str(number))
    categories = SubElement(root, "LogCategories")
    for category, text in LOG_CATEGORIES.items():
        SubElement(categories, "Category", name=category, description=text)
    SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize="0.001")
    if host_packages:  # FMI 2.0 has no attribute for it
        tool = SubElement(SubElement(root, "VendorAnnotations"), "Tool", name="yawbench")
        SubElement(tool, "hostPackages", names=" ".join(host_packages))
    listed = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(variables):
        _scalar_variable(listed, reference, variable)
    _model_structure(SubElement(root, "ModelStructure"), variables)
    return root


def _type_of(v: VariableSpec) -> str:
    """Return the name of the type of an Enumeration; no variable may have it."""
    return f"Choices_{v.name}"


def _scalar_variable(parent: Element, reference: int, v: VariableSpec) -> None:
    text = v.description
    if v.choices is not None:
        text += f" (one of: {', '.join(v.choices)})"
    attributes = {"name": v.name, "valueReference": str(reference), "description": text}
    attributes |= {"causality": v.causality, "variability": v.variability}
    if v.causality != "input":
        attributes["initial"] = "exact" if v.causality == "parameter" else "calculated"
    element = SubElement(parent, "ScalarVariable", attributes)
    typed = SubElement(element, v.fmi_type)
    if v.unit is not None:
        typed.set("unit", v.unit)
        if v.unit in DISPLAYED:
            typed.set("displayUnit", DISPLAYED[v.unit][0])
    if v.choices is not None:
        typed.set("declaredType", _type_of(v))
    for key, limit in (("min", v.minimum), ("max", v.maximum)):
        if limit is not None:
            typed.set(key, repr(limit))
    if v.start is not None:
        start = str(v.start).lower() if v.type == "Boolean" else str(v.start)
        if v.choices is not None:
            start = str(v.choices.index(v.start) + 1)
        typed.set("start", repr(float(v.start)) if v.type == "Real" else start)
    attributes = {"optional": "true" * v.optional, "choices": ", ".join(v.choices or ()), "source": v.source}
    if any(attributes.values()):  # FMI has no attributes for these; other tools ignore the annotation
        tool = SubElement(SubElement(element, "Annotations"), "Tool", name="yawbench")
        SubElement(tool, "variable", {key: text for key, text in attributes.items() if text})


def _model_structure(parent: Element, variables: Sequence[VariableSpec]) -> None:
    index = {v.name: i for i, v in enumerate(variables, start=1)}
    outputs = [v for v in variables if v.causality == "output"]
    if not outputs:
        return
    direct = SubElement(parent, "Outputs")
    initial = SubElement(parent, "InitialUnknowns")
    for v in outputs:
        sources = " ".join(str(index[name]) for name in v.depends_on)
        SubElement(direct, "Unknown", index=str(index[v.name]), dependencies=sources)
        SubElement(initial, "Unknown", index=str(index[v.name]))

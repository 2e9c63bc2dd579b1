"""SSP export: write a plan and its FMUs as an archive that other programs, and this one, can run.

SSP has no elements for the communication step, the instances' own steps and the algorithm. They are written
as annotations: the steps in those of the Open Simulation Platform, which libcosim understands, and of
OMSimulator; everything else that `yawbench run` needs in our own annotation, which also has the title,
because the name of a structure is an identifier to other programs.

Only connected inputs have a connector. A constant is a parameter value with the name of its input: libcosim
and Ecos read it that way, and fmpy gives an input connector without a connection the value of another one.
Equal plans give equal bytes.

Arrays and the types of FMI 3.0 are written as SSP 2.0 has them: an array is one connector and one parameter
with its dimensions, and a connection names the indices of the element that it connects. SSP 1.0 has neither.

`for_omsimulator` reduces a plan to what OMSimulator can run: no texts, no steps of instances, no
transformations.
"""

from __future__ import annotations

import io
import math
import re
import unicodedata
import zipfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from importlib.metadata import version
from pathlib import Path
from typing import Literal

from lxml import etree
from lxml.etree import SubElement, _Element

from yawbench.fmus.archive import open_fmu, read_archive
from yawbench.fmus.description import MODEL_DESCRIPTION
from yawbench.fmus.fmu import Fmu, Value, Variable
from yawbench.foundation.errors import ResultsError, WiringError
from yawbench.foundation.messages import fold, listed
from yawbench.foundation.safe_files import write_whole
from yawbench.orchestrator.plan import Instance, Plan, Wire
from yawbench.orchestrator.scenario.overrides import with_changes
from yawbench.orchestrator.scenario.quantities import BASE_UNITS, Unit, conversion, measure_of
from yawbench.orchestrator.scenario.ssp_archive import (
    DESCRIPTION_FILE,
    FMU_TYPE,
    NAMESPACES,
    OMS,
    OMS_ANNOTATION,
    OSP,
    OSP_ANNOTATION,
    OWN,
    OWN_ANNOTATION,
    PARAMETER_SET,
    RESOURCES,
    SSC,
    SSD,
    SSV,
    TEXTS,
)

_FILE_TIME = (1980, 1, 1, 0, 0, 0)
Version = Literal["1.0", "2.0"]
"""Version of the SSP standard; for FMUs of FMI 2.0, the files written differ only in this number."""
OLD_TYPES = {"Float64": "Real", "Int32": "Integer"}
"""Type of FMI 3.0 that SSP 1.0 has -> its name there."""


def write_ssp(plan: Plan, path: Path, standard: Version | None = None, *, named: bool = False) -> None:
    """Write the plan and its FMUs into an archive.

    Args:
        plan: the run.
        path: of the archive.
        standard: version of SSP; None: 1.0, or 2.0 if there are FMUs of FMI 3.0.
        named: as in `write_whole`.

    Raises:
        ResultsError: the archive cannot be written, or a text or value cannot be represented in it.
        ModelDescriptionError: an FMU no longer exists.
    """
    series = [f"{instance.name}.{name}" for instance in plan.instances for name in instance.series]
    delayed = [f"{wire.target}.{wire.input}" for wire in plan.wires if wire.delayed]
    for what, inputs in (("time series", series), ("delay", delayed)):
        if inputs:
            raise ResultsError(
                f"{path}: an SSP archive cannot contain the {what} of {listed(fold(inputs))}",
                code="ssp-unsupported",
            )
    sources = _sources(plan)
    standard = standard or ("2.0" if any(instance.fmu.fmi > 2 for instance in plan.instances) else "1.0")
    if standard == "1.0" and (lost := _lost(plan)):
        raise ResultsError(
            f"{path}: SSP 1.0 has no arrays, and of the types of FMI 3.0 only Float64, Int32, Boolean and "
            f"String: {listed(fold(lost))} needs SSP 2.0",
            code="ssp-unsupported",
        )
    try:
        structure = system_structure(plan, standard)
    except ValueError as error:  # a control character in a text
        raise ResultsError(f"{path}: cannot write this archive: {error}", code="results-unwritable") from None
    description = etree.tostring(structure, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    try:
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w") as archive:
            _put(archive, DESCRIPTION_FILE, description)
            for sha256, source in sorted(sources.items(), key=lambda item: item[1]):
                fmu = next(instance.fmu for instance in plan.instances if instance.fmu.sha256 == sha256)
                _put(archive, source, read_archive(fmu.path))
        write_whole(path, content.getvalue(), named=named)
    except OSError as error:
        raise ResultsError(
            f"{path}: cannot write this archive: {error.strerror or error}", code="results-unwritable"
        ) from None


def as_fmi3(plan: Plan, folder: Path) -> Plan:
    """Return the plan with its FMUs of FMI 2.0 as FMI 3.0, which are written into a folder.

    Raises:
        BuildError: one was not built here, or has no native library.
    """
    from yawbench.fmus.fmi3_archive import convert

    return _with_fmus(plan, [i.fmu for i in plan.instances if i.fmu.fmi == 2], convert, folder)


def _with_fmus(
    plan: Plan, changing: Iterable[Fmu], convert: Callable[[Path, Path], Path], folder: Path
) -> Plan:
    """Return the plan with some FMUs converted into a folder by a function of archive and folder."""
    made: dict[str, Fmu] = {}
    for fmu in changing:
        if fmu.sha256 not in made:
            place = folder / fmu.sha256[:8]
            place.mkdir()
            made[fmu.sha256] = replace(open_fmu(convert(fmu.path, place)), built=fmu.built)
    instances = (replace(i, fmu=made.get(i.fmu.sha256, i.fmu)) for i in plan.instances)
    return replace(plan, instances=tuple(instances))


def with_numbers(plan: Plan, folder: Path) -> Plan:
    """Return the plan with FMUs that declare Integers for Enumerations, which are written into a folder.

    libcosim ignores Enumerations of FMI 2.0, and OMSimulator does not read their values from an archive. The
    functions of an FMU are the same for both types.
    """
    named = [
        i.fmu for i in plan.instances if i.fmu.fmi == 2 and any(v.items for v in i.fmu.variables.values())
    ]
    numbered = _with_fmus(plan, named, _numbered, folder)
    instances = []
    for before, after in zip(plan.instances, numbered.instances, strict=True):
        of = before.fmu.variables
        parameters, constants = (
            {name: of[name].encoded(value) for name, value in values.items()}
            for values in (before.parameters, before.constants)
        )
        instances.append(replace(after, parameters=parameters, constants=constants))
    return replace(plan, instances=tuple(instances))


def _numbered(path: Path, folder: Path) -> Path:
    """Write an FMU with Integers in place of Enumerations into a folder; return its path."""
    made = folder / path.name
    with zipfile.ZipFile(io.BytesIO(read_archive(path))) as given, zipfile.ZipFile(made, "w") as archive:
        for info in given.infolist():
            content = given.read(info)
            if info.filename == MODEL_DESCRIPTION:
                root = etree.fromstring(content)
                for element in root.iterfind("ModelVariables/ScalarVariable/Enumeration"):
                    element.tag = "Integer"
                    element.attrib.pop("declaredType", None)
                    for own in element.getparent().iterfind("Annotations/Tool/variable"):
                        own.attrib.pop("choices", None)
                content = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
            archive.writestr(info, content)
    return made


def _lost(plan: Plan) -> list[str]:
    """Return the variables that an archive would contain and SSP 1.0 cannot express."""
    return [
        f"{instance.name}.{v.name}"
        for instance in plan.instances
        for v in (*_shown(instance, plan), *(instance.fmu.variables[name] for name in _given(instance)))
        if v.elements > 1 or (_type(v) not in ("Real", "Integer", *OLD_TYPES, "Boolean", *TEXTS))
    ]


def _shown(instance: Instance, plan: Plan) -> list[Variable]:
    """Return the variables of an instance that have connectors: connected inputs, and outputs."""
    driven = {wire.input for wire in plan.wires if wire.target == instance.name}
    return [v for v in instance.fmu.of("input") if v.name in driven] + instance.fmu.of("output")


def _given(instance: Instance) -> dict[str, Value]:
    """Return the values of an instance; start values that are no numbers stay in the FMU."""
    values = {**instance.parameters, **instance.constants}
    return {k: v for k, v in values.items() if not isinstance(v, float) or math.isfinite(v)}


def _type(variable: Variable) -> str:
    """Return the type of a variable, as SSP 2.0 names it."""
    plain = variable.fmi_type in ("Boolean", *TEXTS)
    return variable.fmi_type if plain or variable.encoding is None else variable.encoding


def _array(fmu: Fmu, variable: Variable) -> tuple[str, tuple[int, ...], list[Variable]]:
    """Return the name, shape and elements of the array that a variable belongs to; a scalar is its own."""
    if variable.elements == 1:
        return variable.name, (), [variable]
    name = variable.array
    every = [v for v in fmu.variables.values() if v.array == name]
    return name, tuple(map(int, every[-1].name[len(name) + 1 : -1].split(","))), every


def _put(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    info = zipfile.ZipInfo(name, _FILE_TIME)
    info.compress_type = zipfile.ZIP_DEFLATED
    info.external_attr = 0o644 << 16
    archive.writestr(info, content)


def system_structure(plan: Plan, standard: Version = "1.0") -> _Element:
    """Return the system structure description of a plan.

    Raises:
        ValueError: the plan has a text that XML cannot represent, or a step that no decimal equals.
    """
    root = etree.Element(f"{{{SSD}}}SystemStructureDescription", nsmap=NAMESPACES)
    root.set("version", standard)
    root.set("name", _identifier(with_changes(plan.title, plan.changes)))
    if plan.scenario.get("source"):
        root.set("description", str(plan.scenario["source"]))
    root.set("generationTool", f"yawbench {version('yawbench')}")
    instances = _in_order_of_scenario(plan)
    spelled = _spelled_units(plan)
    sources = _sources(plan)
    enumerations: dict[str, Mapping[str, int]] = {}
    system = SubElement(root, f"{{{SSD}}}System", name="system")
    elements = SubElement(system, f"{{{SSD}}}Elements")
    for instance in instances:
        _add_component(
            elements, instance, plan, sources[instance.fmu.sha256], spelled, enumerations, standard
        )
    if plan.wires:
        connections = SubElement(system, f"{{{SSD}}}Connections")
        for wire in plan.wires:
            _add_connection(connections, wire, plan)
    _add_step(system, plan)
    for parameter_set in root.iter(f"{{{SSV}}}ParameterSet"):
        parameter_set.set("version", standard)
    _add_enumerations(root, enumerations)
    _add_units(root, spelled)
    _add_experiment(root, plan)
    return root


def _identifier(title: str) -> str:
    """Return a title as an identifier: letters without accents, digits and _."""
    plain = unicodedata.normalize("NFKD", title).encode("ascii", "ignore").decode()
    name = re.sub(r"\W+", "_", plain).strip("_") or "scenario"
    return f"_{name}" if name[0].isdigit() else name


def _add_step(system: _Element, plan: Plan) -> None:
    """Write the communication step for OMSimulator, which rejects systems without it.

    Its master steps all instances alike; it ignores the tolerances but requires them.
    """
    annotations = SubElement(_annotation(system, OMS_ANNOTATION), f"{{{OMS}}}Annotations")
    master = SubElement(
        SubElement(annotations, f"{{{OMS}}}SimulationInformation"), f"{{{OMS}}}FixedStepMaster"
    )
    step = _decimal(plan.step)
    tolerances = {"absoluteTolerance": "1e-4", "relativeTolerance": "1e-4"}
    master.attrib.update({"description": "oms-ma", "stepSize": step, **tolerances})


def _add_connection(above: _Element, wire: Wire, plan: Plan) -> None:
    """Write a wire, with its conversion as an explicit gain and offset for programs that ignore units."""
    connection = SubElement(above, f"{{{SSD}}}Connection")
    fmus = {instance.name: instance.fmu for instance in plan.instances}
    ends = (("start", wire.source, wire.output), ("end", wire.target, wire.input))
    for which, instance, variable in ends:
        name, shape, _ = _array(fmus[instance], fmus[instance].variables[variable])
        connection.set(f"{which}Element", instance)
        connection.set(f"{which}Connector", name)
        if shape:
            connection.set(f"{which}Indices", variable[len(name) + 1 : -1].replace(",", " "))
    source, target = fmus[wire.source].variables[wire.output], fmus[wire.target].variables[wire.input]
    if wire.converts or _by_units(source, target) != (1.0, 0.0):
        connection.set("suppressUnitConversion", "true")
        scale = {"factor": repr(wire.gain), "offset": repr(wire.offset)}
        SubElement(connection, f"{{{SSC}}}LinearTransformation", scale)


def _by_units(source: Variable, target: Variable) -> tuple[float, float] | None:
    """Return what other programs make of the units of two variables, None if these are incompatible.

    SSP does not say which quantities are differences, so offsets apply to all.
    """
    of, to = (measure_of(v.unit, v.definition) for v in (source, target))
    return conversion(of, to) if of and to else (1.0, 0.0)


def _in_order_of_scenario(plan: Plan) -> list[Instance]:
    """Return the instances in the scenario's order, which decides between equals in the evaluation order."""
    names = list(plan.scenario.get("units", ()))
    return sorted(plan.instances, key=lambda i: names.index(i.name) if i.name in names else len(names))


def _sources(plan: Plan) -> dict[str, str]:
    """Return hash -> path in the archive for each FMU; the paths have no characters that need escaping."""
    sources: dict[str, str] = {}
    for instance in plan.instances:
        stem = re.sub(r"[^A-Za-z0-9_-]", "_", instance.fmu.name)
        source = f"{RESOURCES}/{stem}.fmu"
        if source in sources.values() and instance.fmu.sha256 not in sources:
            source = f"{RESOURCES}/{stem}_{instance.fmu.sha256[:8]}.fmu"
        sources.setdefault(instance.fmu.sha256, source)
    return sources


def _add_component(
    elements: _Element,
    instance: Instance,
    plan: Plan,
    source: str,
    spelled: Mapping[str, Unit],
    enumerations: dict[str, Mapping[str, int]],
    standard: Version,
) -> None:
    component = SubElement(elements, f"{{{SSD}}}Component", name=instance.name, type=FMU_TYPE)
    component.set("source", source)
    component.set("implementation", "CoSimulation")
    if instance.fmu.description:
        component.set("description", instance.fmu.description)
    shown = {(array := _array(instance.fmu, v))[0]: (v, array[1]) for v in _shown(instance, plan)}
    if shown:
        connectors = SubElement(component, f"{{{SSD}}}Connectors")
        for name, (variable, shape) in shown.items():
            connector = SubElement(connectors, f"{{{SSD}}}Connector", name=name, kind=variable.causality)
            if variable.description:
                connector.set("description", variable.description)
            kind = SubElement(connector, f"{{{SSC}}}{_spelled_type(variable, standard)}")
            if variable.type == "Real" and variable.unit in spelled:
                kind.set("unit", str(variable.unit))
            elif variable.fmi_type == "Enumeration":
                of_items = f"{instance.name}.{name}"
                enumerations[of_items] = variable.items or {}
                kind.set("name", of_items)
            _add_dimensions(connector, shape)
    values = _given(instance)
    if values:
        bindings = SubElement(component, f"{{{SSD}}}ParameterBindings")
        binding = SubElement(bindings, f"{{{SSD}}}ParameterBinding")
        above = SubElement(binding, f"{{{SSD}}}ParameterValues")
        _add_values(above, values, instance.fmu, spelled, standard)
    if instance.period > 1:
        annotation = _annotation(component, OSP_ANNOTATION)
        hint = SubElement(annotation, f"{{{OSP}}}StepSizeHint")
        hint.set("value", _decimal(instance.period * plan.step))


def _spelled_type(variable: Variable, standard: Version) -> str:
    return _type(variable) if standard == "2.0" else OLD_TYPES.get(_type(variable), variable.fmi_type)


def _add_dimensions(above: _Element, shape: tuple[int, ...]) -> None:
    for size in shape:
        SubElement(above, f"{{{SSC}}}Dimension", size=str(size))


def _add_values(
    above: _Element, values: Mapping[str, Value], fmu: Fmu, spelled: Mapping[str, Unit], standard: Version
) -> None:
    parameter_set = SubElement(above, f"{{{SSV}}}ParameterSet", version="1.0", name=PARAMETER_SET)
    parameters = SubElement(parameter_set, f"{{{SSV}}}Parameters")
    present = []
    arrays = {(array := _array(fmu, fmu.variables[name]))[0]: array for name in values}
    for name, shape, elements in arrays.values():
        variable = elements[0]
        parameter = SubElement(parameters, f"{{{SSV}}}Parameter", name=name)
        kind = SubElement(parameter, f"{{{SSV}}}{_spelled_type(variable, standard)}")
        texts = [_text(v, _value(v, values)) for v in elements]
        if shape and variable.fmi_type in TEXTS:
            for text in texts:
                SubElement(kind, f"{{{SSV}}}Value", value=text)
        else:
            kind.set("value", " ".join(texts))
        _add_dimensions(parameter, shape)
        if variable.type == "Real" and variable.unit in spelled:
            kind.set("unit", str(variable.unit))
            present.append(variable.unit)
    _add_units(parameter_set, {unit: spelled[unit] for unit in spelled if unit in present})


def _value(variable: Variable, values: Mapping[str, Value]) -> Value:
    """Return the value of an element of an array, of one without a value that which it has at the start."""
    start = variable.start if variable.start is not None else "" if variable.type == "String" else 0
    return values.get(variable.name, start)


def _text(variable: Variable, value: Value) -> str:
    if variable.type == "Boolean":
        return "true" if value else "false"
    if variable.type == "Real":
        return repr(float(value))
    if variable.fmi_type == "Enumeration" and not isinstance(value, str):
        return next((name for name, number in (variable.items or {}).items() if number == value), str(value))
    return str(value)


def _spelled_units(plan: Plan) -> dict[str, Unit]:
    """Return the units of measurement in the plan that all FMUs define alike."""
    meant: dict[str, set[Unit | None]] = {}
    for variable in (v for instance in plan.instances for v in instance.fmu.variables.values() if v.unit):
        meant.setdefault(str(variable.unit), set()).add(measure_of(variable.unit, variable.definition))
    only = {name: next(iter(measures)) for name, measures in sorted(meant.items()) if len(measures) == 1}
    return {name: measure for name, measure in only.items() if measure is not None}


def _add_units(above: _Element, spelled: Mapping[str, Unit]) -> None:
    if not spelled:
        return
    units = SubElement(above, f"{{{etree.QName(above).namespace}}}Units")
    for name, measure in spelled.items():
        unit = SubElement(units, f"{{{SSC}}}Unit", name=name)
        base = SubElement(unit, f"{{{SSC}}}BaseUnit")
        for symbol, power in zip(BASE_UNITS, measure.powers, strict=True):
            if power:
                base.set(symbol, str(power))
        factor = float(measure.factor) * math.pi**measure.pi
        if factor != 1.0:
            base.set("factor", repr(factor))
        if measure.offset:
            base.set("offset", repr(float(measure.offset)))


def _add_enumerations(root: _Element, enumerations: Mapping[str, Mapping[str, int]]) -> None:
    if not enumerations:
        return
    group = SubElement(root, f"{{{SSD}}}Enumerations")
    for name, items in enumerations.items():
        enumeration = SubElement(group, f"{{{SSC}}}Enumeration", name=name)
        for item, number in items.items():
            SubElement(enumeration, f"{{{SSC}}}Item", name=item, value=str(number))


def _add_experiment(root: _Element, plan: Plan) -> None:
    experiment = SubElement(root, f"{{{SSD}}}DefaultExperiment")
    experiment.set("startTime", repr(plan.time(0)))
    experiment.set("stopTime", repr(plan.time(plan.n_steps)))
    algorithm = SubElement(_annotation(experiment, OSP_ANNOTATION), f"{{{OSP}}}Algorithm")
    SubElement(algorithm, f"{{{OSP}}}FixedStepAlgorithm", baseStepSize=_decimal(plan.step))
    own = SubElement(_annotation(experiment, OWN_ANNOTATION), f"{{{OWN}}}Scenario")
    own.set("title", with_changes(plan.title, plan.changes))
    own.set("stepSize", _decimal(plan.step))
    own.set("algorithm", plan.algorithm)
    for pattern in _recorded(plan):
        SubElement(own, f"{{{OWN}}}Record", variable=pattern)


def _recorded(plan: Plan) -> Iterable[str]:
    """Return the record list of the scenario, empty if it records all outputs."""
    return () if plan.scenario.get("record") is None else map(str, plan.record)


def _annotation(above: _Element, kind: str) -> _Element:
    """Add an annotation; return the element for its content."""
    group = above.find(f"{{{SSD}}}Annotations")
    if group is None:
        group = SubElement(above, f"{{{SSD}}}Annotations")
    return SubElement(group, f"{{{SSC}}}Annotation", type=kind)


def _decimal(seconds: Fraction) -> str:
    """Return a time as the shortest decimal that equals the fraction exactly."""
    text = repr(float(seconds))
    if Fraction(text) != seconds:
        raise ValueError(f"the step, {text} s when rounded, has more digits than other programs read")
    return text


def for_omsimulator(plan: Plan) -> tuple[Plan, list[str]]:
    """Return the plan reduced to what OMSimulator accepts, and a note for every relevant omission.

    Raises:
        WiringError: a connection has a gain or offset beyond unit conversion, which it would silently ignore.
    """
    fmus = {instance.name: instance.fmu.variables for instance in plan.instances}

    def by_units(wire: Wire) -> bool:
        source, target = fmus[wire.source][wire.output], fmus[wire.target][wire.input]
        return (_by_units(source, target) or (1.0, 0.0)) == (wire.gain, wire.offset)

    problems = [
        f"{wire.source}.{wire.output} to {wire.target}.{wire.input}: OMSimulator applies no gain and "
        "offset to a connection, it only converts units"
        for wire in plan.wires
        if not by_units(wire)
    ]
    if problems:
        raise WiringError(problems, code="ssp-unsupported")
    notes = []
    slow = [instance.name for instance in plan.instances if instance.period > 1]
    if slow:
        notes.append(f"OMSimulator has one step for all instances: the steps of {listed(slow)} are omitted")
    texts = [f"{i.name}.{name} = {text!r}" for i in plan.instances for name, text in _texts(i).items()]
    if texts:
        notes.append(f"OMSimulator reads no texts from an archive; set them there: {listed(texts)}")
    wires = tuple(replace(wire, gain=1.0, offset=0.0) for wire in plan.wires)
    instances = tuple(_without_texts(instance) for instance in plan.instances)
    return replace(plan, instances=instances, wires=wires), notes


def _texts(instance: Instance) -> dict[str, Value]:
    """Return the texts and enumeration items that differ from the FMU's start values."""
    values, variables = {**instance.parameters, **instance.constants}, instance.fmu.variables
    return {k: v for k, v in values.items() if variables[k].type in TEXTS and v != variables[k].start}


def _without_texts(instance: Instance) -> Instance:
    """Return the instance without values that OMSimulator does not read, and with the step of all."""
    parameters, constants = (
        {name: value for name, value in values.items() if instance.fmu.variables[name].type not in TEXTS}
        for values in (instance.parameters, instance.constants)
    )
    return replace(instance, period=1, parameters=parameters, constants=constants)

"""Tiny FMUs for everything but execution: a model description and an empty binary, in a zip."""

from __future__ import annotations

import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.sax.saxutils import quoteattr

from yawbench.fmus.description import platform
from yawbench.vocabulary.wheels import WHEELS


@dataclass(frozen=True)
class Var:
    """A variable: name (`*` = four wheels), unit and whatever else its element carries."""

    name: str
    unit: str | None = "1"
    type: str = "Real"
    start: object = 0.0
    minimum: float | None = None
    maximum: float | None = None
    description: str = ""
    variability: str = "continuous"
    follows: tuple[str, ...] | None = ()
    items: tuple[str, ...] = ()
    choices: tuple[str, ...] = field(default=())
    optional: bool = False
    relative: bool = False


def out(name: str, *follows: str, unit: str | None = "1", **rest: object) -> Var:
    """Return an output and the inputs that it follows at once; `follows=None`: it is not said."""
    return Var(name, unit, **{"follows": follows, **rest})  # type: ignore[arg-type]


def make_fmu(
    path: Path,
    *,
    inputs: Iterable[Var | str] = (),
    outputs: Iterable[Var | str] = (),
    parameters: Iterable[Var] = (),
    files: Mapping[str, bytes] | None = None,
    binaries: Iterable[str] | None = None,
    xml: str | None = None,
    once: bool = False,
    definitions: Mapping[str, str] | None = None,
) -> Path:
    """Write an FMU; `binaries` are platform folders, by default this platform's; `xml` replaces all.

    `definitions` are units of measurement: name -> attributes of its BaseUnit.
    """
    name = path.stem
    text = xml or model_description(
        name, inputs, outputs, parameters, once=once, definitions=definitions or {}
    )
    here, suffix = platform()
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", text)
        for folder in [here] if binaries is None else binaries:
            end = suffix if folder == here else ".dll"
            archive.writestr(f"binaries/{folder}/{name}{end}", b"")
        for file, content in (files or {}).items():
            archive.writestr(file, content)
    return path


def model_description(
    name: str,
    inputs: Iterable[Var | str] = (),
    outputs: Iterable[Var | str] = (),
    parameters: Iterable[Var] = (),
    *,
    once: bool = False,
    definitions: Mapping[str, str] = {},
) -> str:
    """Return a valid FMI 2.0 model description."""
    rows: list[tuple[str, Var]] = []
    for causality, variables in (("input", inputs), ("output", outputs), ("parameter", parameters)):
        for item in variables:
            var = Var(item) if isinstance(item, str) else item
            rows += [(causality, one) for one in _wheels(var)]
    rows = rows or [("output", Var("idle"))]  # FMI wants one variable at least
    index = {var.name: i for i, (_, var) in enumerate(rows, start=1)}
    units = sorted({var.unit for _, var in rows if var.unit and var.type == "Real"})
    types = [var for _, var in rows if var.items]
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{name}" generationTool="fake">',
        f'<CoSimulation modelIdentifier="{name}" canGetAndSetFMUstate="true"'
        f' canBeInstantiatedOnlyOncePerProcess="{str(once).lower()}"/>',
    ]
    if units:
        inner = "".join(
            f"<Unit name={quoteattr(unit)}><BaseUnit {definitions[unit]}/></Unit>"
            if unit in definitions
            else f"<Unit name={quoteattr(unit)}/>"
            for unit in units
        )
        lines.append(f"<UnitDefinitions>{inner}</UnitDefinitions>")
    if types:
        lines.append("<TypeDefinitions>")
        for var in types:
            entries = "".join(f'<Item name="{item}" value="{i}"/>' for i, item in enumerate(var.items, 1))
            lines.append(
                f'<SimpleType name="{var.name}_type"><Enumeration>{entries}</Enumeration></SimpleType>'
            )
        lines.append("</TypeDefinitions>")
    lines.append("<ModelVariables>")
    lines += [_scalar_variable(causality, var, index[var.name]) for causality, var in rows]
    lines.append("</ModelVariables>")
    lines.append("<ModelStructure>")
    unknowns = [_unknown(var, index) for causality, var in rows if causality == "output"]
    if unknowns:
        lines.append(f"<Outputs>{''.join(unknowns)}</Outputs>")
    lines += ["</ModelStructure>", "</fmiModelDescription>"]
    return "\n".join(lines)


def _wheels(var: Var) -> list[Var]:
    if "*" not in var.name:
        return [var]
    fields = {k: v for k, v in vars(var).items() if k not in ("name", "follows")}
    return [
        Var(
            var.name.replace("*", wheel),
            follows=None if var.follows is None else tuple(f.replace("*", wheel) for f in var.follows),
            **fields,
        )
        for wheel in WHEELS
    ]


def _scalar_variable(causality: str, var: Var, reference: int) -> str:
    variability = "fixed" if causality == "parameter" else var.variability
    if var.type != "Real" and causality != "parameter" and variability != "constant":
        variability = "discrete"
    text = var.description + (f" (one of: {', '.join(var.choices)})" if var.choices else "")
    attributes = {"declaredType": f"{var.name}_type"} if var.items else {}
    if var.unit and var.type == "Real":
        attributes["unit"] = var.unit
    if var.relative:
        attributes["relativeQuantity"] = "true"
    if var.minimum is not None:
        attributes["min"] = str(var.minimum)
    if var.maximum is not None:
        attributes["max"] = str(var.maximum)
    if causality != "output" or variability == "constant":
        attributes["start"] = str(var.start).lower() if var.type == "Boolean" else str(var.start)
    inner = " ".join(f"{k}={quoteattr(v)}" for k, v in attributes.items())
    said = ' optional="true"' * var.optional
    said += f" choices={quoteattr(', '.join(var.choices))}" if var.choices else ""
    mark = f'<Annotations><Tool name="yawbench"><variable{said}/></Tool></Annotations>' if said else ""
    return (
        f'<ScalarVariable name={quoteattr(var.name)} valueReference="{reference}" causality="{causality}"'
        f' variability="{variability}" description={quoteattr(text)}>'
        f"<{var.type} {inner}/>{mark}</ScalarVariable>"
    )


def _unknown(var: Var, index: Mapping[str, int]) -> str:
    said = "" if var.follows is None else f' dependencies="{" ".join(str(index[f]) for f in var.follows)}"'
    return f'<Unknown index="{index[var.name]}"{said}/>'

"""Reads and checks the model description of a component in C, and generates a C header."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree

from yawbench.foundation.errors import BuildError
from yawbench.vocabulary.roles import Role

from ..packing import DESCRIPTION
from ..staging import missing_signals


@dataclass(frozen=True)
class CVariable:
    """Variable declared in a model description."""

    name: str
    causality: str
    unit: str
    description: str
    start: float
    minimum: float | None
    maximum: float | None
    tunable: bool


def read_declaration(xml: bytes, name: str, role: Role) -> tuple[ElementTree.Element, list[CVariable]]:
    """Return the model description and its variables, after checking the assumptions of the C code.

    Raises:
        BuildError: invalid XML, or variables that are not supported, with a sentence for each.
    """
    try:
        root = ElementTree.fromstring(xml)
    except ElementTree.ParseError as error:
        raise BuildError(
            f"{DESCRIPTION} is not well-formed XML: {error}", code="declaration-invalid"
        ) from None
    simulation = root.find("CoSimulation")
    if simulation is None or simulation.get("modelIdentifier") != name:
        raise BuildError(
            f'{DESCRIPTION}: needs <CoSimulation modelIdentifier="{name}" ...>', code="declaration-invalid"
        )
    variables, problems = [], []
    for i, element in enumerate(root.iterfind("ModelVariables/ScalarVariable")):
        own = element.get("name") or ""
        real = element.find("Real")
        if real is None:
            problems.append(f"{DESCRIPTION}: {own} is not Real; a component in C has only Real variables")
        elif element.get("causality") not in ("input", "output", "parameter"):
            problems.append(f"{DESCRIPTION}: {own} must be an input, an output or a parameter")
        elif element.get("valueReference") != str(i):
            problems.append(f"{DESCRIPTION}: {own} must have the value reference {i}: they count from 0")
        elif not (own.isidentifier() and own.isascii()):
            problems.append(f"{DESCRIPTION}: {own!r} is not a valid name in C; use letters, digits and _")
        else:
            variables.append(_variable(element, real))
    problems += [f"{DESCRIPTION}: {problem}" for problem in missing_signals(role, variables)]
    if problems:
        raise BuildError(problems, code="declaration-invalid")
    return root, variables


def _variable(element: ElementTree.Element, real: ElementTree.Element) -> CVariable:
    def number(key: str) -> float | None:
        text = real.get(key)
        try:
            return None if text is None else float(text)
        except ValueError:
            raise BuildError(
                f"{DESCRIPTION}: {element.get('name')}: {key} must be a number (got {text!r})",
                code="declaration-invalid",
            ) from None

    return CVariable(
        name=element.get("name") or "",
        causality=element.get("causality") or "",
        unit=real.get("unit") or "1",
        description=element.get("description") or "",
        start=number("start") or 0.0,
        minimum=number("min"),
        maximum=number("max"),
        tunable=element.get("variability") == "tunable",
    )


def headers(variables: list[CVariable], guid: str) -> dict[str, str]:
    """Return the texts of variables.h, a struct with the variables, and declared.h, their declarations."""
    members, declared = [], []
    causalities = [v.causality for v in variables]
    numbers = [causalities[:i].count("output") for i in range(len(causalities))]
    for v in variables:
        text = " ".join(v.description.replace("*/", "* /").split())
        members.append(f"    double {v.name}; /* {v.causality}, {v.unit}: {text} */")
        low = "-INFINITY" if v.minimum is None else repr(v.minimum)
        high = "INFINITY" if v.maximum is None else repr(v.maximum)
        place = f"offsetof(Variables, {v.name})"
        kind = f"REAL, {v.causality.upper()}, {int(v.tunable)}, {place}"
        declared.append(f'    {{"{v.name}", {kind}, {v.start!r}, {low}, {high}, NULL, 0}},')
    made = f"/* Made from {DESCRIPTION} by yawbench build. */"
    struct = [made, "#include <math.h>", "typedef struct {", *members, "} Variables;", ""]
    rows = [
        made,
        '#include "unit_parts.h"',
        f"enum {{ N_VARIABLES = {len(variables)}, N_REALS = N_VARIABLES,",
        f"       N_INPUTS = {causalities.count('input')},",
        f"       N_OUTPUTS = {causalities.count('output')} }};",
        "static const Declared DECLARED[] = {",
        *declared, "};",
        f"static const unsigned OUTPUT_NUMBERS[] = {{{', '.join(map(str, numbers))}}};",
        f'#define GUID "{guid}"', "",
    ]  # fmt: skip
    return {"variables.h": "\n".join(struct), "declared.h": "\n".join(rows)}

"""The reference of units, from the model descriptions of the built FMUs and the sources they carry."""

from __future__ import annotations

import ast
import io
import zipfile
from typing import Any
from xml.etree import ElementTree

from yawbench.fmus.build import HERE, find_components
from yawbench.foundation.messages import fold
from yawbench.vocabulary.roles import ROLES

from .text import NOTE, cell, code, docstring, table


def page() -> str:
    """Return the page of all FMUs that the project builds.

    Raises:
        FileNotFoundError: an FMU has not been built.
    """
    parts = ["# FMUs", NOTE, _INTRODUCTION]
    found = find_components()
    for folder, role in ROLES.items():
        names = [name for name, module in found.items() if module[0] == folder]
        if names:
            parts.append(f"## {folder.replace('_', ' ').capitalize()}")
            parts += [_unit(name, folder, name.removeprefix(f"{role.name}_")) for name in names]
    return "\n\n".join(parts)


_FOLDED = '<details markdown="1"><summary>The model</summary>'
"""Begins what readers unfold, in the built docs and on GitHub."""
_INTRODUCTION = """All FMUs of this project with their inputs, outputs and parameters; `*` stands for the
four wheels `fl`, `fr`, `rl`, `rr`. A scenario sets parameters by these names; a value of a vehicle file goes
to every FMU that has a parameter of its name.
"""


def _unit(name: str, folder: str, file: str) -> str:
    from fmpy.model_description import read_model_description

    path = HERE / f"{name}.fmu"
    if not path.exists():
        raise FileNotFoundError(f"{path} has not been built: run 'yawbench build' (or make fmus) first")
    raw = path.read_bytes()
    description = read_model_description(io.BytesIO(raw))
    variables = {v.name: v for v in description.modelVariables}
    parts = [f"### {name}", cell(description.description or "")]
    with zipfile.ZipFile(path) as archive:
        source = _source(archive, folder, file)
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    sources = {
        v.get("name", ""): said.get("source", "")
        for v in root.iterfind("ModelVariables/*")
        if (said := v.find("Annotations/Tool[@name='yawbench']/variable")) is not None
    }
    if source:
        parts.append(f"{_FOLDED}\n\n{docstring(source).strip()}\n\n</details>")
    follows = {u.variable.name: [d.name for d in u.dependencies or ()] for u in description.outputs}
    parts.append(_signals("input", variables, {}))
    parts.append(_signals("output", variables, follows))
    parameters = [v for v in description.modelVariables if v.causality == "parameter"]
    parts.append(_parameters(parameters, sources))
    return "\n\n".join(part for part in parts if part)


def _source(archive: zipfile.ZipFile, folder: str, file: str) -> str:
    """Return the docstring of the component's module as the FMU carries it."""
    for path in archive.namelist():
        if path.startswith("resources/yawbench_") and path.endswith(f"/{folder}/{file}.py"):
            return ast.get_docstring(ast.parse(archive.read(path).decode())) or ""
    return ""


def _signals(causality: str, variables: dict[str, Any], follows: dict[str, list[str]]) -> str:
    names = [name for name, v in variables.items() if v.causality == causality]
    rows = []
    for name in fold(names):
        v = variables[name.replace("*", "fl")]
        row = [code(name), code(v.unit or "1"), cell((v.description or "").removesuffix(", front left"))]
        if causality == "output":
            row.append(", ".join(map(code, fold(follows.get(v.name, [])))))
        rows.append(row)
    head = [f"{causality}", "unit", "meaning"] + (
        ["direct feedthrough from"] if causality == "output" else []
    )
    return table(head, rows)


def _parameters(parameters: list[Any], sources: dict[str, str]) -> str:
    rows = []
    for v in parameters:
        limits = [f"≥ {_number(v.min)}"] if v.min is not None else []
        limits += [f"≤ {_number(v.max)}"] if v.max is not None else []
        value = _number(v.start) if v.type == "Real" else str(v.start)
        if v.type == "Enumeration":
            value = next(item.name for item in v.declaredType.items if item.value == v.start)
        meaning, source = cell(v.description or ""), cell(sources.get(v.name, ""))
        rows.append((code(v.name), code(value), code(v.unit or ""), ", ".join(limits), meaning, source))
    return table(("parameter", "default", "unit", "allowed", "meaning", "source"), rows)


def _number(text: str) -> str:
    return f"{float(text):.10g}"

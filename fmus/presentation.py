"""Metadata of an FMU for display in other programs: authors, documentation page, icon.

The metadata do not depend on time or place of the build: the date is that of this version of the
program, and the icons are drawn in advance (`docs/generate/icons.py`).
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from jinja2 import Environment, Template

from .packing import DESCRIPTION
from .reference_result import FOLDER
from .source_archive import list_sources
from .usual_ranges import usual_range

DATE = "2026-11-22T00:00:00Z"
"""Date of this version of the program; the time of the build would make FMUs irreproducible."""
CREDITS = {
    "author": "The yawbench developers",
    "copyright": "Copyright (c) 2026 The yawbench developers",
    "license": "MIT",
}
"""Attributes of model descriptions of the project's components."""
HERE = Path(__file__).resolve().parent
ICONS = HERE / "icons"
PAGE = HERE / "page.html.j2"
"""Template of the documentation page."""


def presented(
    files: Mapping[str, bytes], sources: Mapping[str, str], *, role: str, credits: Mapping[str, str]
) -> dict[str, bytes]:
    """Return the files of an FMU with documentation, icon and credits added.

    Args:
        files: files of the archive.
        sources: its sources as path -> text, the component's own file first.
        role: such as "controller".
        credits: attributes of the model description, added where they are missing.
    """
    root = ElementTree.fromstring(files[DESCRIPTION])
    generated = {"generationTool": f"yawbench {version('yawbench')}", "generationDateAndTime": DATE}
    for key, value in {**credits, **generated}.items():
        if key in generated or not root.get(key):
            root.set(key, value)
    _declare_role(root, role)
    list_sources(root, files)
    _declare_nominals(root)
    shown = {
        DESCRIPTION: ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n",
        "documentation/index.html": _page(root, sources, files).encode(),
    }
    for file in icon(role):
        shown["model.png"] = file.read_bytes()
    return {**files, **shown}


def _declare_role(root: Element, role: str) -> None:
    """Add the role to a model description, in a separate annotation: each may contain only one element."""
    annotations = root.find("VendorAnnotations")
    if annotations is None:
        annotations = Element("VendorAnnotations")
        root.insert([child.tag for child in root].index("ModelVariables"), annotations)
    SubElement(SubElement(annotations, "Tool", name="yawbench"), "role", name=role)


def _declare_nominals(root: Element) -> None:
    """Add the magnitudes of signals to a model description, where they are known and not 1."""
    for variable in root.iterfind("ModelVariables/ScalarVariable"):
        real = variable.find("Real")
        if real is not None and variable.get("causality") != "parameter" and real.get("nominal") is None:
            nominal = max(map(abs, usual_range(variable.get("name", ""))))
            if nominal != 1.0:
                real.set("nominal", repr(nominal))


def icon(role: str) -> list[Path]:
    """Return the file of a role's icon, empty if it has none."""
    return [file] if (file := ICONS / f"{role}.png").exists() else []


def _page(root: Element, sources: Mapping[str, str], files: Iterable[str]) -> str:
    """Return the documentation page of an FMU; `files` are searched for its reference result."""
    needed = root.find("VendorAnnotations/Tool[@name='yawbench']/hostPackages")
    return _template().render(
        about=root.attrib,
        model=_blocks(next(iter(sources.values()), "")),
        variables=list(_variables(root)),
        needs="" if needed is None else needed.get("names"),
        reference=[path for path in files if path.startswith(FOLDER)],
        sources=sources,
    )


@cache
def _template() -> Template:
    environment = Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    environment.filters["symbols"] = _symbols
    return environment.from_string(PAGE.read_text("utf-8"))


def _blocks(source: str) -> list[str]:
    """Return the blocks of a docstring: paragraphs and indented equations."""
    try:
        docstring = ast.get_docstring(ast.parse(source)) or ""
    except SyntaxError:  # not Python
        return []
    return [block for block in re.split(r"\n\s*\n", docstring.strip("\n")) if block]


_GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "theta": "θ", "kappa": "κ",
    "lambda": "λ", "mu": "μ", "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "φ", "psi": "ψ", "omega": "ω",
}  # fmt: skip


def _symbols(equations: str) -> str:
    """Return equations typeset with Greek letters and superscripts."""
    shown = re.sub(r"\b([a-z]+)(?=\b|_)", lambda m: _GREEK.get(m[1], m[1]), equations)
    return shown.replace("^2", "²").replace("^3", "³")


def _variables(root: Element) -> Iterator[dict[str, str]]:
    """Yield the rows of the page's table of variables, for outputs with their direct feedthrough."""
    variables = root.findall("ModelVariables/ScalarVariable")
    names = [variable.get("name", "") for variable in variables]
    follows = {
        names[int(unknown.get("index", "1")) - 1]: ", ".join(
            names[int(i) - 1] for i in unknown.get("dependencies", "").split()
        )
        for unknown in root.iterfind("ModelStructure/Outputs/Unknown")
    }
    for variable, name in zip(variables, names, strict=True):
        annotation = variable.find("Annotations/Tool[@name='yawbench']/variable")
        choices = [] if annotation is None else annotation.get("choices", "").split(", ")
        start = variable[0].get("start")
        chosen = {"start": choices[int(start) - 1]} if variable[0].tag == "Enumeration" and start else {}
        yield {
            **variable[0].attrib,
            **chosen,
            **variable.attrib,
            "meaning": variable.get("description", ""),
            "depends directly on": follows.get(name, ""),
            "source": "" if annotation is None else annotation.get("source", ""),
        }

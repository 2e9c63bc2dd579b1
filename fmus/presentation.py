"""What a program shows of an FMU: who made it, a page of documentation, an icon.

Nothing here depends on when or where the FMU is built: the date is that of this version of the
program, the icon was drawn before (`docs/generate/icons.py`).
"""

from __future__ import annotations

import ast
import html
import re
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from .reference_result import FOLDER

DESCRIPTION = "modelDescription.xml"
DATE = "2026-11-22T00:00:00Z"
"""Of this version of the program; the time of a build would make equal sources give different FMUs."""
CREDITS = {
    "author": "The yawbench developers",
    "copyright": "Copyright (c) 2026 The yawbench developers",
    "license": "MIT",
}
"""Of the project's own components."""
ICONS = Path(__file__).resolve().parent / "icons"


def presented(
    files: Mapping[str, bytes], sources: Mapping[str, str], *, role: str, credits: Mapping[str, str]
) -> dict[str, bytes]:
    """Return the files of an FMU with what is shown of it.

    Args:
        files: of the archive.
        sources: path -> text of what it was written as, the component's own file first.
        role: of the unit, such as "controller".
        credits: attributes of the model description that it does not have yet.
    """
    root = ElementTree.fromstring(files[DESCRIPTION])
    generated = {"generationTool": f"yawbench {version('yawbench')}", "generationDateAndTime": DATE}
    for key, value in {**credits, **generated}.items():
        if key in generated or not root.get(key):
            root.set(key, value)
    shown = {
        DESCRIPTION: ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n",
        "documentation/index.html": _page(root, sources, _reference(files)).encode(),
    }
    for file in icon(role):
        shown["model.png"] = file.read_bytes()
    return {**files, **shown}


def icon(role: str) -> list[Path]:
    """Return the file of a role's icon, if it has one."""
    return [file] if (file := ICONS / f"{role}.png").exists() else []


def _page(root: Element, sources: Mapping[str, str], reference: str) -> str:
    name = root.get("modelName") or ""
    variables = [(v, v[0]) for v in root.iterfind("ModelVariables/ScalarVariable")]
    facts = {key: root.get(key) for key in ("author", "copyright", "license", "version", "generationTool")}
    text = next(iter(sources.values()), "")
    parts = [
        f"<h1>{_text(name)}</h1>\n<p>{_text(root.get('description'))}</p>",
        _model(_docstring(text)),
        _variables("Inputs", "input", ("start",), variables),
        _variables("Outputs", "output", (), variables, _followed(root)),
        _variables("Parameters", "parameter", ("start", "min", "max"), variables),
        _needs(root),
        reference,
        "<h2>About</h2>\n" + _table((), [(key, value) for key, value in facts.items() if value]),
        "<h2>Source</h2>",
        *(f"<h3>{_text(path)}</h3>\n<pre>{_text(source)}</pre>" for path, source in sources.items()),
    ]
    head = f'<!DOCTYPE html>\n<html lang="en">\n<meta charset="utf-8">\n<title>{_text(name)}</title>\n'
    return head + _STYLE + "\n".join(part for part in parts if part) + "\n</html>\n"


_STYLE = """<style>
body { font: 15px/1.5 sans-serif; max-width: 60em; margin: 2em auto; padding: 0 1em; color: #1b1b1b }
table { border-collapse: collapse }
th, td { text-align: left; vertical-align: top; padding: 2px 12px 2px 0 }
th { border-bottom: 1px solid #999 } td:first-child, pre { font-family: monospace; font-size: 13px }
pre { background: #f5f5f5; padding: .8em; overflow-x: auto }
</style>
"""


def _text(text: str | None) -> str:
    return html.escape(text or "", quote=False)


def _docstring(source: str) -> str:
    try:
        return ast.get_docstring(ast.parse(source)) or ""
    except SyntaxError:  # not written in Python
        return ""


_GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "theta": "θ", "kappa": "κ",
    "lambda": "λ", "mu": "μ", "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "φ", "psi": "ψ", "omega": "ω",
}  # fmt: skip


def _model(docstring: str) -> str:
    """Return a docstring as HTML: paragraphs, and what is indented, equations mostly, line by line."""
    parts = []
    for block in re.split(r"\n\s*\n", docstring.strip("\n")):
        if block.startswith("    "):
            shown = re.sub(r"\b([a-z]+)(?=\b|_)", lambda m: _GREEK.get(m[1], m[1]), block)
            parts.append(f"<pre>{_text(shown.replace('^2', '²').replace('^3', '³'))}</pre>")
        elif block:
            parts.append(f"<p>{_text(block)}</p>")
    return "\n".join(["<h2>Model</h2>", *parts]) if parts else ""


def _needs(root: Element) -> str:
    needed = root.find("VendorAnnotations/Tool[@name='yawbench']/hostPackages")
    if needed is None:
        return ""
    return f"<h2>Needs</h2>\n<p>The host's Python must have: {_text(needed.get('names'))}.</p>"


def _reference(files: Iterable[str]) -> str:
    links = [
        f'<a href="../{path}">{_text(path.rpartition("/")[2])}</a>'
        for path in files
        if path.startswith(FOLDER)
    ]
    if not links:
        return ""
    return (
        "<h2>Reference result</h2>\n<p>What the FMU computes from given inputs with its default parameters, "
        "in the form of the FMI Cross-Check: does it do the same in your tool? "
        f"{', '.join(links)}</p>"
    )


def _followed(root: Element) -> dict[str, str]:
    """Return output -> the inputs that it follows at once, as the model structure says."""
    names = [v.get("name") or "" for v in root.iterfind("ModelVariables/ScalarVariable")]
    return {
        names[int(unknown.get("index", "1")) - 1]: ", ".join(
            names[int(i) - 1] for i in (unknown.get("dependencies") or "").split()
        )
        for unknown in root.iterfind("ModelStructure/Outputs/Unknown")
    }


def _variables(
    title: str,
    causality: str,
    columns: Sequence[str],
    variables: Iterable[tuple[Element, Element]],
    follows: Mapping[str, str] | None = None,
) -> str:
    of_parameters = causality == "parameter"
    head = ["name", "unit", *columns, *(["follows at once"] if follows is not None else []), "meaning"]
    head += ["source"] * of_parameters
    rows = [
        [
            v.get("name"),
            typed.get("unit"),
            *(typed.get(column) for column in columns),
            *([follows.get(v.get("name") or "")] if follows is not None else []),
            v.get("description"),
            *([_source(v)] if of_parameters else []),
        ]
        for v, typed in variables
        if v.get("causality") == causality
    ]
    return f"<h2>{title}</h2>\n{_table(head, rows)}" if rows else ""


def _source(variable: Element) -> str | None:
    said = variable.find("Annotations/Tool[@name='yawbench']/variable")
    return None if said is None else said.get("source")


def _table(head: Sequence[str], rows: Iterable[Sequence[str | None]]) -> str:
    lines = ["<tr>" + "".join(f"<td>{_text(cell)}</td>" for cell in row) + "</tr>" for row in rows]
    first = ["<tr>" + "".join(f"<th>{_text(cell)}</th>" for cell in head) + "</tr>"] if head else []
    return "\n".join(["<table>", *first, *lines, "</table>"])

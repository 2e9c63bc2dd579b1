"""Hooks of mkdocs: JSON Schemas of files, boxes as GitHub writes them, formulas as MathML."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from generate import formulas  # mkdocs puts docs/ on the path
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

SCHEMAS = Path(__file__).resolve().parents[1] / "scenarios" / "schemas"


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the JSON Schemas."""
    for schema in sorted(SCHEMAS.glob("*.json")):
        files.append(File.generated(config, f"schemas/{schema.name}", content=schema.read_text("utf-8")))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Turn GitHub's alerts, `> [!WARNING]` and `> **Title.** Text`, into boxes of mkdocs."""
    return re.sub(
        r"^> \[!([A-Z]+)\]\n> \*\*(.+?)\.\*\* ((?:.*\n)(?:>.*(?:\n|\Z))*)", _box, markdown, flags=re.M
    )


def _box(alert: re.Match[str]) -> str:
    kind, title, text = alert.groups()
    lines = re.sub(r"^> ?", "", text.rstrip("\n"), flags=re.M).split("\n")
    return "\n".join([f'!!! {kind.lower()} "{title}"', *(f"    {line}".rstrip() for line in lines), ""])


def on_page_content(html: str, **_: Any) -> str:
    """Turn formulas into MathML, which browsers draw without any script; let names head narrow columns."""
    html = re.sub(r"(?<=<th)([^>]*>)([^<]*)", lambda th: th[1] + th[2].replace("_", "_<wbr>"), html)
    return formulas.to_mathml(html)

"""Hooks of mkdocs: JSON Schemas of files, formulas as MathML."""

from __future__ import annotations

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


def on_page_content(html: str, **_: Any) -> str:
    """Turn formulas into MathML, which browsers draw without any script."""
    return formulas.to_mathml(html)

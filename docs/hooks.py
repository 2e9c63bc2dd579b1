"""What mkdocs does beside copying pages: reference pages made from the program, formulas as MathML."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from generate import (
    commands,
    evidence,
    formulas,
    metrics,
    schemas,
    signals,
    units,
    vehicles,
)  # mkdocs puts docs/ on the path
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

PAGES = {
    "reference/commands.md": commands.page,
    "reference/scenario.md": schemas.scenario_page,
    "reference/experiment.md": schemas.experiment_page,
    "reference/ranking.md": schemas.ranking_page,
    "reference/threats.md": schemas.threats_page,
    "reference/signals.md": signals.page,
    "reference/units.md": units.page,
    "reference/metrics.md": metrics.page,
    "trust.md": evidence.page,
    "reference/vehicles.md": vehicles.page,
}
"""Path in the docs -> what writes its text."""
SCHEMAS = Path(__file__).resolve().parents[1] / "scenarios" / "schemas"


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made from the program as it is, and the JSON Schemas."""
    for path, write in PAGES.items():
        files.append(File.generated(config, path, content=write()))
    for schema in sorted(SCHEMAS.glob("*.json")):
        files.append(File.generated(config, f"schemas/{schema.name}", content=schema.read_text("utf-8")))
    return files


def on_page_content(html: str, **_: Any) -> str:
    """Turn formulas into MathML, which browsers draw without any script."""
    return formulas.to_mathml(html)

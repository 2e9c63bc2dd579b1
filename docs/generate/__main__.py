"""Write the pages and JSON Schemas that are generated from the program: `python -m docs.generate`.

They are in the repository, so that links between its pages lead somewhere without a build of the docs. All
FMUs have to be built.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from yawbench.commands.schema import kinds, schema_text

from . import (
    blind_tables,
    car_tables,
    commands,
    evidence,
    fuzzy_sets,
    library,
    measured_car_tables,
    metrics,
    monitor_tables,
    papers,
    ranking_pages,
    rooms,
    schemas,
    signals,
    units,
    vehicles,
)

DOCS = Path(__file__).resolve().parents[1]
SCHEMAS = DOCS.parent / "scenarios" / "schemas"
PAGES: dict[str, Callable[[], str]] = {
    "reference/commands.md": commands.page,
    "reference/scenario.md": schemas.scenario_page,
    "reference/experiment.md": schemas.experiment_page,
    "reference/ranking.md": schemas.ranking_page,
    "reference/threats.md": schemas.threats_page,
    "reference/signals.md": signals.page,
    "reference/units.md": units.page,
    "reference/metrics.md": metrics.page,
    "reference/library.md": library.page,
    "trust.md": evidence.page,
    "reference/vehicles.md": vehicles.page,
    **rooms.pages(),
    "theory/paper_c_sets.svg": fuzzy_sets.figure,
}
"""Path in the docs -> what returns its text."""
PUBLISHED = (
    blind_tables, car_tables, measured_car_tables, monitor_tables, ranking_pages
)  # fmt: skip
"""Modules of tables from published runs, which are parts of pages."""


def text_of(path: str) -> str:
    """Return the text of a page as it is written: no blanks at line ends, one newline at the end."""
    lines = (line.rstrip() for line in PAGES[path]().splitlines())
    return "\n".join(lines).rstrip() + "\n"


def main() -> None:
    """Write all pages, the tables in others, and the schemas."""
    for path in PAGES:
        (DOCS / path).parent.mkdir(exist_ok=True)
        (DOCS / path).write_text(text_of(path), encoding="utf-8")
    for tables in PUBLISHED:
        for page, text in tables.pages_with_tables().items():
            page.write_text(text, encoding="utf-8")
    for page, text in papers.pages_with_numbers().items():
        page.write_text(text, encoding="utf-8")
    for kind in kinds():
        (SCHEMAS / f"{kind}.json").write_text(schema_text(kind), encoding="utf-8")


if __name__ == "__main__":
    main()

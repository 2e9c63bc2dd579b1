"""The matrix of the docs against runs made now, of some of its cells."""

from __future__ import annotations

import csv
import functools
import random
import re
from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.experiments.ranking import load_ranking

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "ranking.md").read_text(encoding="utf-8")
RANKING = ROOT / "scenarios" / "proving_ground" / "ranking.yaml"


@functools.cache
def matrix() -> dict[tuple[str, str], str]:
    """Return (entry, condition) -> what stands in its cell."""
    ranking = load_ranking(RANKING)
    titles = {spec.title: name for name, (spec, _) in ranking.entries.items()}
    found = {}
    for line in PAGE.partition("## The matrix")[2].splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == len(ranking.conditions) + 3 and cells[1] in titles:
            found |= {
                (titles[cells[1]], name): cell
                for name, cell in zip(ranking.conditions, cells[3:], strict=True)
            }
    return found


def words(cell: dict[str, str]) -> str:
    """Return what the docs say of a row of cells.csv."""
    if cell["state"] == "passed":
        return "✓"
    return f"{cell['passed']}/{cell['runs']}" + (" spun" if cell["state"] == "spun" else "")


def test_the_matrix_of_the_docs_has_a_cell_for_every_controller_and_condition():
    ranking = load_ranking(RANKING)
    assert set(matrix()) == {(entry, name) for entry in ranking.entries for name in ranking.conditions}
    assert all(re.fullmatch(r"✓|\d+/\d+( spun)?", cell) for cell in matrix().values())


def test_the_conditions_passed_that_pages_of_threats_show_are_those_of_the_matrix():
    ranking = load_ranking(RANKING)
    with (RANKING.parent / "matrix.csv").open(encoding="utf-8", newline="") as lines:
        passed = {row["entry"]: (int(row["passed"]), int(row["conditions"])) for row in csv.DictReader(lines)}
    cells = {entry: [matrix()[entry, name] for name in ranking.conditions] for entry in ranking.entries}
    assert passed == {entry: (row.count("✓"), len(row)) for entry, row in cells.items()}


@pytest.mark.exhaustive
@pytest.mark.parametrize("entry, condition", random.Random(16).sample(sorted(matrix()), 8))
def test_cells_of_the_docs_are_what_runs_come_to(entry, condition, tmp_path):
    with pytest.raises(SystemExit) as ended:
        main(["rank", str(RANKING), "--only", entry, "--condition", condition, "--out", str(tmp_path)])
    assert not ended.value.code
    rows = csv.DictReader((tmp_path / "cells.csv").open())
    (cell,) = (row for row in rows if row["entry"] == entry)
    assert words(cell) == matrix()[entry, condition]

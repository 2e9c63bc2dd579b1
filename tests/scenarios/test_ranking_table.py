"""The matrix of the docs against published cells, and those against runs made now."""

from __future__ import annotations

import csv

import pytest

from docs.generate import matrix_tables
from tests.command_line import status_of
from yawbench.ranking.ranking import load_ranking
from yawbench.ranking.ranking_scores import RankingResult

RANKING = load_ranking(matrix_tables.FILE)


@pytest.fixture(scope="module")
def published() -> RankingResult:
    return matrix_tables.published()


def test_the_published_cells_are_in_the_order_of_the_ranking(published):
    with matrix_tables.RUNS.open(encoding="utf-8", newline="") as lines:
        order = list(dict.fromkeys(row["entry"] for row in csv.DictReader(lines)))
    assert order == [score.entry for score in published.scores]


@pytest.mark.exhaustive
@pytest.mark.parametrize("entry", sorted(RANKING.entries))
def test_cells_of_the_docs_are_what_runs_come_to(entry, published, request):
    """The journal of the runs is in pytest's cache, so that what was interrupted goes on."""
    out = request.config.cache.mkdir("matrix") / entry
    assert status_of("rank", matrix_tables.FILE, "--only", entry, "--out", out) == 0
    with (out / "cells.csv").open(encoding="utf-8", newline="") as lines:
        made = {row["condition"]: row for row in csv.DictReader(lines) if row["entry"] == entry}
    (score,) = (score for score in published.scores if score.entry == entry)
    for condition, cell in score.cells.items():
        for column in matrix_tables.COLUMNS[:-1]:  # but the time per step
            assert made[condition][column] == cell.row[column], (condition, column)

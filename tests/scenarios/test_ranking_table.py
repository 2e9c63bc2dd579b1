"""The matrix of the docs against published cells, and those against runs made now."""

from __future__ import annotations

import csv
import math
from dataclasses import replace

import pytest

from docs.generate import matrix_tables
from tests.command_line import status_of
from yawbench.ranking.ranking import ConditionSpec, load_ranking
from yawbench.ranking.ranking_scores import EntryScore, RankingResult, run_ranking
from yawbench.studies.executor import Executor, runner_of

RANKING = load_ranking(matrix_tables.FILE)
MODES = ("sliding_mode", "fuzzy_sliding_mode", "sliding_mode_tuned", "fuzzy_sliding_mode_tuned")
BY_SIDESLIP = ("controller_fuzzy_sideslip", "controller_fnn", "controller_off")
"""FMUs that do not use the yaw rate."""


@pytest.fixture(scope="module")
def published() -> RankingResult:
    return matrix_tables.published()


@pytest.fixture(scope="module")
def by_name(published: RankingResult) -> dict[str, EntryScore]:
    return {score.entry: score for score in published.scores}


@pytest.fixture(scope="module")
def conclusions() -> str:
    page = matrix_tables.PAGE.read_text(encoding="utf-8")
    return " ".join(page.partition("Conclusions:")[2].partition("In numbers")[0].split())


def passed(score: EntryScore) -> set[str]:
    return {name for name, cell in score.cells.items() if cell.passed}


def slides(score: EntryScore, condition: str) -> float:
    """Return the sideslip under a condition [deg]."""
    slip = score.cells[condition].number("sideslip")
    assert slip is not None
    return math.degrees(slip)


def between(numbers: list[float], digits: int = 1) -> str:
    return f"{min(numbers):.{digits}f} to {max(numbers):.{digits}f}"


def test_the_tables_of_the_docs_follow_from_the_published_cells():
    for page, text in matrix_tables.pages_with_tables().items():
        assert text == page.read_text(encoding="utf-8")


def test_the_published_cells_are_in_the_order_of_the_ranking(published):
    with matrix_tables.RUNS.open(encoding="utf-8", newline="") as lines:
        order = list(dict.fromkeys(row["entry"] for row in csv.DictReader(lines)))
    assert order == [score.entry for score in published.scores]


@pytest.mark.exhaustive
def test_what_is_not_the_same_for_all_is_as_the_page_says(tmp_path):
    hard = RANKING.spec.conditions["hard"]
    unguarded = ConditionSpec.model_validate(
        {
            **hard.model_dump(exclude_unset=True, mode="json"),
            "title": "unguarded",
            "set": {"allocator.wheel_choice": "moment"},
        }
    )
    names = ("fnn", "lqr", "fuzzy_pid", "fuzzy_sideslip", "sliding_mode")
    entries = {name: RANKING.entries[name] for name in names}
    for name, limit in (("fuzzy_pid", 10e3), ("sliding_mode", 5e3)):
        spec, folder = entries[name]
        entries[f"{name} limited"] = spec.model_copy(update={"parameters": {"moment_limit": limit}}), folder
    spec = RANKING.spec.model_copy(update={"conditions": {"hard": hard, "unguarded": unguarded}})
    chosen = replace(RANKING, spec=spec, entries=entries, quick=True)
    with Executor(tmp_path, chosen.identity, runner_of(1, None)) as execute:
        runs = {(run.entry, run.condition): run for run in run_ranking(chosen, execute, keep=False).runs}

    def ratio(entry: str, condition: str) -> str:
        return f"{100 * runs[entry, condition]['ratio_1000']:.0f} %"

    def slip(entry: str, condition: str = "hard") -> str:
        return f"{math.degrees(runs[entry, condition]['sideslip']):.1f}°"

    assert {round(math.degrees(run.amplitude)) for run in runs.values()} == {270}
    page = " ".join(matrix_tables.PAGE.read_text(encoding="utf-8").split())
    for sentence in (
        f"more ({ratio('fnn', 'unguarded')} at COS + 1 s instead of {ratio('fnn', 'hard')}), and LQR "
        f"({ratio('lqr', 'unguarded')} instead of {ratio('lqr', 'hard')}; the limit is 35 %)",
        f"({slip('fuzzy_pid')} and {slip('fuzzy_sideslip')} of sideslip, with the guard or without)",
        f"fuzzy PID reaches {slip('fuzzy_pid limited')} of sideslip instead of {slip('fuzzy_pid')}",
        f"with 5 reaches {slip('sliding_mode limited')} instead of {slip('sliding_mode')}",
    ):
        assert sentence in page
    for entry in ("fuzzy_pid", "fuzzy_sideslip"):
        assert slip(entry) == slip(entry, "unguarded")


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

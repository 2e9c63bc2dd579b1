"""The threats of the proving ground: tables of the docs against published levels, and those against runs."""

from __future__ import annotations

import csv
import random
from pathlib import Path

import pytest

from docs.generate import threat_tables
from orchestrator.experiments.threat_runs import ThreatResult, published_result
from orchestrator.experiments.threats import load_threats
from tests.commands import status_of

FILE = threat_tables.FILE


@pytest.fixture(scope="module")
def published() -> ThreatResult:
    return published_result(load_threats(FILE))


def test_every_entry_has_every_level_of_the_main_setting(published):
    threats = published.threats
    assert published.complete[threats.main] == threats.entries_in(threats.main)


def test_the_tables_of_the_docs_follow_from_the_published_levels():
    assert threat_tables.page_with_tables() == threat_tables.PAGE.read_text(encoding="utf-8")


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "entry", random.Random(27).sample(sorted(load_threats(FILE).ranking.spec.entries), 2)
)
def test_published_levels_are_what_runs_come_to(entry, published, tmp_path: Path):
    assert status_of("rank", FILE, "--quick", "--only", entry, "--out", tmp_path) == 0
    made = {tuple(row.values())[:4]: row for row in csv.DictReader((tmp_path / "levels.csv").open())}
    main = published.threats.main
    known = {place: one for place, one in published.survived.items() if place[::3] == (main, entry)}
    assert known
    for place, one in known.items():
        assert float(made[tuple(place)]["position"]) == one.position, place

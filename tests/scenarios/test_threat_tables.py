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

FILE, LANE_CHANGE = threat_tables.FILE, "lane_change"


@pytest.fixture(scope="module")
def published() -> ThreatResult:
    return published_result(load_threats(FILE))


def test_every_entry_has_every_level_of_the_main_setting(published):
    threats = published.threats
    assert published.complete[threats.main] == threats.entries_in(threats.main)


def test_the_tables_of_the_docs_follow_from_the_published_levels():
    assert threat_tables.page_with_tables() == threat_tables.PAGE.read_text(encoding="utf-8")


def test_every_entry_has_driven_every_discipline(published):
    threats = published.threats
    assert published.complete[LANE_CHANGE] == threats.entries_in(LANE_CHANGE)
    entries = threats.entries_in(threats.main)
    assert set(published.quantities) == {
        (name, car, entry)
        for name, spec in threats.spec.disciplines.items()
        for car in spec.cars
        for entry in entries
    }


@pytest.mark.exhaustive
@pytest.mark.parametrize("entry", random.Random(5).sample(sorted(load_threats(FILE).ranking.spec.entries), 2))
def test_published_disciplines_are_what_runs_come_to(entry, published, tmp_path: Path):
    names = [LANE_CHANGE, *published.threats.spec.disciplines]
    chosen = (word for name in names for word in ("--condition", name))
    assert status_of("rank", FILE, "--only", entry, *chosen, "--out", tmp_path) == 0
    made = csv.DictReader((tmp_path / "levels.csv").open())
    driven = {
        tuple(row.values())[:4]: float(row["position"]) for row in made if row["setting"] == LANE_CHANGE
    }
    known = {
        tuple(place): one.position for place, one in published.survived.items() if place[0] == LANE_CHANGE
    }
    assert driven == known
    made = csv.DictReader((tmp_path / "quantities.csv").open())
    driven = {tuple(row.values())[:4]: float(row["value"]) if row["value"] else None for row in made}
    known = {
        (*place, key): value
        for place, values in published.quantities.items()
        for key, value in values.items()
    }
    assert driven == known


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

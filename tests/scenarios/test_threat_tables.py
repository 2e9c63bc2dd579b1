"""The threats of the proving ground: tables of the docs against published levels, and those against runs."""

from __future__ import annotations

import csv
import random
from dataclasses import replace
from pathlib import Path

import pytest

from docs.generate import threat_tables
from tests.command_line import status_of
from yawbench.ranking.ranked_runs import angle_experiment, angles_of
from yawbench.ranking.threat_runs import ThreatResult, published_result, survivals
from yawbench.ranking.threats import load_threats
from yawbench.studies.executor import Executor, runner_of

FILE, LANE_CHANGE = threat_tables.FILE, "lane_change"
THREATS = load_threats(FILE)
ENTRIES = THREATS.entries_in(THREATS.main)


@pytest.fixture(scope="module")
def published() -> ThreatResult:
    return published_result(THREATS)


def test_every_entry_has_every_level_of_the_main_setting(published):
    threats = published.threats
    assert published.complete[threats.main] == threats.entries_in(threats.main)


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
@pytest.mark.parametrize("entry", random.Random(5).sample(ENTRIES, 2))
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
@pytest.mark.parametrize("car", THREATS.spec.cars)
@pytest.mark.parametrize("entry", ENTRIES)
def test_published_levels_are_what_runs_come_to(entry, car, published, request):
    """The journal of the runs is in pytest's cache, so that what was interrupted goes on."""
    threats = load_threats(FILE, quick=True)
    threats = replace(threats, spec=threats.spec.model_copy(update={"cars": [car]}))
    folder = request.config.cache.mkdir("threats") / f"{entry}_{car}"
    with Executor(folder, threats.identity, runner_of(1, None)) as execute:
        slow = execute(angle_experiment(threats.ranking, execute, [car]), keep=False)
        angles = angles_of(threats.ranking, slow, [car])
        found = survivals(threats, angles, execute, only=[entry])
    assert len(found) == len(threats.threats_in(threats.main))
    assert found == {place: published.survived[place] for place in found}

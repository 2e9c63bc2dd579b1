"""The threats of the proving ground: tables of the docs against published levels, and those against runs."""

from __future__ import annotations

import csv
import random
from pathlib import Path

import pytest

from docs.generate import threat_tables
from orchestrator.experiments.threat_runs import ThreatResult, published_result
from orchestrator.experiments.threat_scores import compared_gains, compared_setting, moves_between, scored
from orchestrator.experiments.threats import REFERENCE, load_threats
from orchestrator.pages import threats_page
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


def test_every_threat_of_the_main_setting_has_six_cars(published):
    threats = published.threats
    faced = {name: threats.cars_facing(threats.main, name) for name in threats.threats_in(threats.main)}
    assert len(faced) == 13
    assert {len(cars) for cars in faced.values()} == {6}


def test_the_sentences_on_threats_have_the_numbers_of_the_tables(published):
    text = " ".join(threat_tables.PAGE.read_text(encoding="utf-8").partition("### Who can be")[0].split())
    scores = scored(published)
    _, gains = compared_gains(published).groups.values()
    assert (
        f"varies by {100 * gains.gains.value:.1f} % of a threat's range, between these laws by "
        f"{100 * gains.between.value:.1f} % (difference {_spread(gains.difference, 100)})"
    ) in text
    assert (
        f"they vary by {100 * gains.laws.value:.1f} %, no more than luck may make them: seeds of the search "
        f"vary by {100 * gains.seeds.value:.1f} %, and the ratio is {gains.ratio.value:.1f} "
        f"({gains.ratio.bounds.low:.1f} to {gains.ratio.bounds.high:.1f})"
    ) in text
    moved = {
        name: 100 * compared_setting(published, name).moved
        for name in threats_page.compared_settings(published)
    }
    assert f"levels fall by {-moved['bound_15']:.0f} % of a range" in text
    assert f"levels rise by {moved['bound_30']:.0f} %" in text
    assert f"levels fall by {-moved['unguarded']:.1f} % of a range" in text
    assert f"lower levels by {-moved['authors']:.1f} % of a range" in text
    correlations = {
        test.title: moves_between(scores.by_entry(), test.scores.by_entry(), REFERENCE).correlation
        for test in threats_page.disciplines(published)
    }
    speed, braking, step, wind = (f"{x + 0.0:.1f}".replace("-0.0", "0.0") for x in correlations.values())
    assert (
        f"side wind has a rank correlation of {wind}, step steer of {step}, split friction of {braking}, the "
        f"entry speed of {speed}"
    ) in text
    apart = {test.title: test.scores.told_apart for test in threats_page.disciplines(published)}
    assert f"*Step steer*: {apart['Step steer']} of 210 pairs differ" in text
    assert f"of 210 pairs {apart['Gust of side wind']} differ" in text


def _spread(spread, scale: float) -> str:
    low, high = (f"{scale * x:.1f}" for x in spread.bounds)
    return f"{scale * spread.value:.1f}, {low} to {high}"


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

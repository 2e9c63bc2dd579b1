"""The threats of the proving ground: tables of the docs against published levels, and those against runs."""

from __future__ import annotations

import csv
import math
import random
from dataclasses import replace
from pathlib import Path
from statistics import fmean, median

import pytest

from docs.generate import threat_tables
from tests.command_line import status_of
from tests.refusals import sentence_has
from yawbench.ranking.disciplines import disciplines
from yawbench.ranking.gains_and_laws import compared_gains
from yawbench.ranking.ranking import angle_experiment, angles_of
from yawbench.ranking.threat_runs import Survived, ThreatResult, published_result, survivals
from yawbench.ranking.threat_scores import (
    compared_setting,
    moves_between,
    scored,
    scores_without,
)
from yawbench.ranking.threat_tables import compared_settings, titles_of
from yawbench.ranking.threats import REFERENCE, SearchPlace, load_threats
from yawbench.studies.executor import Executor, runner_of

FILE, LANE_CHANGE = threat_tables.FILE, "lane_change"
WITHOUT_MODEL = [
    f"{law}_tuned"
    for law in ("pid", "fuzzy_pid", "fuzzy_feedback", "sliding_mode", "fuzzy_sliding_mode", "dead_band")
]
"""Tuned laws that use the yaw rate, but no model of the car's tyres."""
THREATS = load_threats(FILE)
ENTRIES = THREATS.entries_in(THREATS.main)


@pytest.fixture(scope="module")
def published() -> ThreatResult:
    return published_result(THREATS)


def test_every_entry_has_every_level_of_the_main_setting(published):
    threats = published.threats
    assert published.complete[threats.main] == threats.entries_in(threats.main)


def test_the_tables_of_the_docs_follow_from_the_published_levels():
    for page, text in threat_tables.pages_with_tables().items():
        assert text == page.read_text(encoding="utf-8")


def test_every_threat_of_the_main_setting_has_six_cars(published):
    threats = published.threats
    faced = {name: threats.cars_facing(threats.main, name) for name in threats.threats_in(threats.main)}
    assert len(faced) == 13
    assert {len(cars) for cars in faced.values()} == {6}


@pytest.fixture(scope="module")
def text() -> str:
    """The sentences above the tables."""
    return " ".join(threat_tables.PAGE.read_text(encoding="utf-8").partition("### Who can be")[0].split())


def test_the_sentences_on_threats_have_the_numbers_of_the_tables(published, text):
    scores = scored(published)
    _, gains = compared_gains(published).groups.values()
    assert sentence_has(
        text,
        f"{100 * gains.gains.value:.1f} %",
        f"{100 * gains.between.value:.1f} %",
        _spread(gains.difference, 100),
        "varies",
        "threat",
    )
    assert sentence_has(
        text,
        f"{100 * gains.laws:.1f} %",
        f"{100 * gains.seeds.value:.1f} %",
        f"{gains.ratio.value:.1f}",
        f"{gains.ratio.bounds.low:.1f}",
        f"{gains.ratio.bounds.high:.1f}",
        f"F({gains.degrees[0]}, {gains.degrees[1]}) = {gains.f:.1f}",
        "vary",
        "luck",
    )
    moved = {name: 100 * compared_setting(published, name).moved for name in compared_settings(published)}
    assert sentence_has(text, f"{-moved['bound_15']:.0f} %", "levels", "fall")
    assert sentence_has(text, f"{moved['bound_30']:.0f} %", "levels", "rise")
    assert sentence_has(text, f"{-moved['unguarded']:.1f} %", "levels", "fall")
    assert sentence_has(text, f"{-moved['authors']:.1f} %", "lower", "levels")
    correlations = {
        test.title: moves_between(scores.by_entry(), test.scores.by_entry(), REFERENCE).correlation
        for test in disciplines(published)
    }
    speed, braking, step, wind = (f"{x + 0.0:.1f}".replace("-0.0", "0.0") for x in correlations.values())
    assert sentence_has(text, wind, step, braking, speed, "side", "wind")
    apart = {test.title: test.scores.apart for test in disciplines(published)}
    for title in ("Step steer", "Gust of side wind"):
        assert sentence_has(text, int(apart[title].better.sum()), title.split()[-1], "210", "pairs")


def test_the_sentences_on_who_is_first_are_those_of_the_tables(published, text):
    scores, titles = scored(published), titles_of(published)
    behind = scores.behind(scores.order()[0])
    assert sentence_has(text, f"{len(ENTRIES) - 1 - len(behind)} entries", "clearly", "better")
    helped = compared_gains(published).helped
    alone, sure = ([titles[law] for law, p in helped.items() if p[k] < 0.05] for k in (0, 1))
    assert not sure and sentence_has(text, *alone, "helps", "alone", "no")
    means = compared_gains(published).means
    rise = {titles[law]: 100 * (fmean(tuned) - study) for law, (study, *tuned) in means.items()}
    first, second = sorted(rise, key=rise.__getitem__, reverse=True)[:2]
    assert sentence_has(text, first, second, f"{rise[first]:.0f}", f"{rise[second]:.0f} %", "levels", "rise")
    entries = published.complete[THREATS.main]
    without = scores_without(entries, published.positions(THREATS.main, entries), REFERENCE)
    assert scores.order()[0] == next(score.entry for score in scores.scores if score.by_rank == 1)
    others = {
        place: first for place, order in without.items() if (first := next(iter(order))) != scores.order()[0]
    }
    ((place, first),) = others.items()
    assert place == ("car", THREATS.cars_in(THREATS.main).index("van"))
    assert sentence_has(text, titles[first], "left", "leads")


def test_the_sentences_on_settings_are_those_of_the_tables(published, text):
    lost = [
        sum(score.score == 0.0 for score in table.scores)
        for compared in [compared_setting(published, "bound_15")]
        for table in (compared.table, compared.main)
    ]
    assert sentence_has(text, lost[0], lost[1], f"{len(ENTRIES)} entries", "entries", "lose")
    for bound in ("bound_15", "bound_30"):
        compared = compared_setting(published, bound)
        assert compared.table.order()[0] == compared.main.order()[0] == "pid_tuned"
    compared = compared_setting(published, "unguarded")
    moves = moves_between(compared.main.by_entry(), compared.table.by_entry(), REFERENCE)
    title = titles_of(published)[moves.farthest]
    assert sentence_has(text, title, moves.before, moves.after, "goes", "place")


def test_the_sentence_on_wrong_stiffness_is_that_of_the_table(published, text):
    def survived(entry: str) -> list[Survived]:
        return [
            published.survived[SearchPlace(THREATS.main, "model", car, entry)] for car in THREATS.spec.cars
        ]

    spec = THREATS.spec.threats["model"]
    assert all(level.end == "hard" for name in WITHOUT_MODEL for level in survived(name))
    assert sentence_has(text, f"{spec.hard:g} times", "survive", "times")
    mpc, lqr = (
        [spec.level(level.position) for level in survived(name)]
        for name in ("model_predictive_tuned", "lqr_tuned")
    )
    assert sentence_has(
        text,
        f"{min(mpc):.1f}",
        f"{max(mpc):.1f} times",
        f"{min(lqr):.1f}",
        f"{max(lqr):.0f}",
        "LQR",
        "predictive",
    )


def test_the_sentences_on_disciplines_are_those_of_the_tables(published, text):
    (threat,), cars = THREATS.threats_in(LANE_CHANGE), THREATS.cars_in(LANE_CHANGE)
    spec, laws = THREATS.spec.threats[threat], [name for name in ENTRIES if name != REFERENCE]
    speeds = {
        car: {
            name: spec.level(published.survived[SearchPlace(LANE_CHANGE, threat, car, name)].position)
            for name in ENTRIES
        }
        for car in cars
    }
    gained = {car: [of[name] - of[REFERENCE] for name in laws] for car, of in speeds.items()}
    raised = gained.pop("hard") + gained.pop("van")
    assert sentence_has(text, f"{min(raised):.1f}", f"{max(raised):.1f} km/h", "`hard`")
    assert max(abs(gain) for gains in gained.values() for gain in gains) < 1.0
    spreads = {car: max(of[n] for n in laws) - min(of[n] for n in laws) for car, of in speeds.items()}
    assert sentence_has(
        text, f"{spreads.pop('van'):.1f} km/h", f"{max(spreads.values()):.1f}", "laws", "others"
    )

    def of_cars(name: str, entry: str, key: str) -> list[float]:
        return [published.quantities[name, car, entry][key] for car in cars]

    distances = {entry: median(of_cars("braking", entry, "distance")) for entry in ENTRIES}
    straight = [
        distances[entry]
        for entry in ENTRIES
        if math.degrees(median(of_cars("braking", entry, "yaw_angle"))) < 2.0
    ]
    assert sentence_has(
        text,
        f"{min(straight):.0f}",
        f"{max(straight):.0f} m",
        f"{distances[REFERENCE]:.0f} m",
        "cars",
        "control",
    )
    spins = sum(angle > math.pi / 2 for angle in of_cars("braking", "pid", "yaw_angle"))
    assert sentence_has(text, spins, f"{len(cars)} cars", "spins", "cars")
    late = sum(published.quantities["step_steer", "small_car", e]["yaw_rate_response"] > 4.0 for e in ENTRIES)
    assert sentence_has(text, f"{late} entries", "rate", "entries")
    firm = {entry: median(of_cars("wind", entry, "deviation")) for entry in ENTRIES}
    assert sorted(firm, key=firm.__getitem__)[:2] == ["sliding_mode", "fuzzy_feedback"]
    assert sentence_has(
        text,
        f"{firm['sliding_mode']:.1f}",
        f"{firm['fuzzy_feedback']:.1f} m",
        f"{firm[REFERENCE]:.1f} m",
        "deviation",
        "against",
    )


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
def test_told_a_fiftieth_of_the_stiffness_laws_without_a_model_lose_no_car(text, tmp_path):
    assert sentence_has(text, "fiftieth", "stiffness", "no car")
    told = THREATS.spec.threats["model"].model_copy(update={"easy": 0.02, "hard": 0.021})
    main = THREATS.spec.settings[THREATS.main].model_copy(update={"threats": ["model"]})
    spec = THREATS.spec.model_copy(
        update={"threats": {**THREATS.spec.threats, "model": told}, "settings": {THREATS.main: main}}
    )
    threats = replace(THREATS, spec=spec)
    with Executor(tmp_path, threats.identity, runner_of(1, None)) as execute:
        slow = execute(angle_experiment(threats.ranking, execute, spec.cars), keep=False)
        found = survivals(threats, angles_of(threats.ranking, slow, spec.cars), execute, only=WITHOUT_MODEL)
    assert len(found) == len(spec.cars) * len(WITHOUT_MODEL)
    assert {level.end for level in found.values()} == {"hard"}


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

"""Threat files: levels, searches, and scores that recover a known order."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tests.checkout import ROOT
from tests.command_line import status_of
from tests.ranking.test_ranking import SMALL as RANKING
from tests.ranking.test_ranking import rows
from tests.refusals import mentions
from tests.reports.made_up import unpacked
from yawbench.foundation.errors import ScenarioError
from yawbench.orchestrator.scenario.catalogue import SHIPPED
from yawbench.ranking.disciplines import discipline_table, disciplines, overview
from yawbench.ranking.gains_and_laws import compared_gains, gains_and_laws, ratio_of_spreads
from yawbench.ranking.threat_runs import RESOLUTION, Attempt, Survived, ThreatResult, _search
from yawbench.ranking.threat_scores import (
    compared_setting,
    mean_positions,
    mean_ranks,
    moves_between,
    score_table,
    scored,
    scores_without,
)
from yawbench.ranking.threat_tables import car_tables
from yawbench.ranking.threats import LoadedThreats, QuantitySpec, SearchPlace, ThreatSpec, load_threats
from yawbench.studies.limit_search import side_by_side

UNITS = (
    "driver_sine_with_dwell", "reference_steady_state", "controller_off", "controller_fuzzy_pid",
    "allocator_single_wheel", "wheel_control_hydraulic", "plant_fourteen_dof", "tyre_magic_formula",
)  # fmt: skip
GROUND = SHIPPED / "proving_ground"


def threat(easy: float, hard: float, **keys) -> ThreatSpec:
    return ThreatSpec.model_validate({
        "title": "t", "easy": easy, "hard": hard, "source": "here", "scenario": "s.yaml",
        "set": {"driver.amplitude": "{level} deg"}, **keys,
    })  # fmt: skip


def search(spec: ThreatSpec, survives, variants: int = 1) -> Survived:
    def passing(attempts: dict[str, Attempt]) -> dict[str, bool]:
        return {key: survives(spec.level(one.position), one.variant) for key, one in attempts.items()}

    return side_by_side({"x": _search(spec, variants)}, passing)["x"]


@pytest.mark.parametrize("easy, hard, limit", [(45, 720, 331.0), (0.9, 0.05, 0.51), (1, 1000, 75.0)])
def test_a_search_finds_the_level_to_two_per_cent(easy, hard, limit):
    spec = threat(easy, hard)
    found = search(spec, lambda level, _: level <= limit if hard > easy else level >= limit)
    assert found.end == ""
    assert 0.0 <= abs(math.log(limit / spec.level(found.position))) <= 1.001 * RESOLUTION


def test_the_ends_of_a_range_count_and_are_said():
    spec = threat(10, 1000)
    assert search(spec, lambda level, _: False) == Survived(0.0, "easy")
    assert search(spec, lambda level, _: True) == Survived(1.0, "hard")


def test_a_level_is_survived_if_all_of_its_runs_are_and_no_more_are_made_than_needed():
    spec, driven = threat(10, 1000), []

    def survives(level: float, variant: int) -> bool:
        driven.append((level, variant))
        return level <= (300.0 if variant == 0 else 100.0)

    found = search(spec, survives, variants=2)
    assert spec.level(found.position) == pytest.approx(100.0, rel=RESOLUTION)
    assert all(level <= 300.0 for level, variant in driven if variant == 1)


def test_the_first_failure_from_the_easy_end_counts_where_a_higher_level_passes_again():
    spec = threat(1, 100)
    found = search(spec, lambda level, _: level < 10.0 or level > 50.0)
    assert spec.level(found.position) == pytest.approx(10.0, rel=RESOLUTION)


@pytest.mark.parametrize(
    "keys, words",
    [
        ({"hard": 45}, "same level"),
        ({"set": {"driver.amplitude": 3}}, "changes nothing"),
        ({"mirrored": False}, "has one side"),
    ],
)
def test_a_threat_that_makes_no_sense_is_refused(keys, words):
    with pytest.raises(ValueError, match=words):
        threat(**{"easy": 45, "hard": 720, **keys})


@pytest.fixture(scope="module")
def shipped() -> LoadedThreats:
    return load_threats(GROUND / "threats.yaml")


@pytest.mark.parametrize(
    "old, new, code, place",
    [
        ("cars: [saloon75, hard", "cars: [truck, saloon75, hard", "condition-unknown", "truck"),
        ("easy: 60\n", "eazy: 60\n", "key-unknown", "threats.amplitude"),
        ("threats: [friction, mass", "threats: [frictoin, mass", "value-invalid", "frictoin"),
    ],
)
def test_a_wrong_threat_file_is_refused_at_its_place(old, new, code, place, tmp_path):
    text = (GROUND / "threats.yaml").read_text(encoding="utf-8")
    assert old in text
    text = text.replace(old, new, 1).replace("ranking: ranking.yaml", f"ranking: {GROUND}/ranking.yaml")
    (tmp_path / "threats.yaml").write_text(text)
    with pytest.raises(ScenarioError) as refused:
        load_threats(tmp_path / "threats.yaml")
    assert any(one.code == code and place in f"{one.location} {one}" for one in refused.value.diagnostics)


def simulated(chance: np.random.Generator, *skills: float) -> np.ndarray:
    """Positions of entries whose skill counts in all of 13 threats, which scatter, as do 6 cars."""
    common = chance.normal(0.3, 0.1, (1, 13, 1)) + chance.normal(0.0, 0.1, (1, 1, 6))
    own = chance.normal(0.0, 0.02, (len(skills), 13, 1)) + chance.normal(0.0, 0.02, (len(skills), 1, 6))
    noise = chance.normal(0.0, 0.02, (len(skills), 13, 6))
    return np.array(skills)[:, None, None] + common + own + noise


def test_a_known_order_is_recovered_by_score_and_by_rank():
    positions = simulated(np.random.default_rng(1), 0.0, 0.05, 0.1, 0.15, 0.2)
    table = score_table(["none", *"abcd"], positions, "none")
    assert table.order() == ["d", "c", "b", "a", "none"]
    assert [one.by_rank for one in table.scores] == [1, 2, 3, 4, 5]
    assert [one.place for one in table.scores] == [1, 2, 3, 4, 5]
    assert table.apart.better.sum() == 10
    assert table.behind("b") == ["a", "none"]
    assert [one.score for one in table.scores] == pytest.approx([100, 75, 50, 25, 0], abs=8)


def test_entries_of_equal_skill_share_a_place():
    table = score_table(["none", *"abc"], simulated(np.random.default_rng(1), 0.0, 0.2, 0.2, 0.2), "none")
    assert [one.place for one in table.scores] == [1, 1, 1, 4]


def test_intervals_hold_the_true_score_at_least_nine_times_in_ten():
    """Relative to no control and to an entry that is best by far, so that the true scores are known."""
    chance, held = np.random.default_rng(3), []
    for _ in range(150):
        table = score_table(["none", "half", "best"], simulated(chance, 0.0, 0.1, 0.3), "none")
        best, _, none = (score.mean for score in table.scores)
        bounds = table.scores[1].bounds
        distance = 100 - 100 * (0.3 - 0.1) / (best - none)  # the best's gain is taken as known
        held.append(bounds.low <= distance <= bounds.high)
    assert np.mean(held) >= 0.92


def test_threats_that_a_car_does_not_drive_are_left_out_and_all_threats_count_alike():
    positions = np.array([[[0.0, 0.0], [0.0, np.nan]], [[0.2, 0.4], [0.9, np.nan]]])
    assert mean_positions(positions) == pytest.approx([0.0, 0.6])
    assert mean_ranks(positions) == pytest.approx([2.0, 1.0])
    scores = scores_without(["none", "a"], positions, "none")
    assert set(scores) == {("threat", 0), ("threat", 1), ("car", 0), ("car", 1)}


def test_spreads_of_gains_and_laws_are_recovered():
    chance = np.random.default_rng(4)
    law, own = chance.normal(0.0, 0.05, (40, 1)), chance.normal(0.0, 0.02, (40, 5))
    tuned, authors = 0.4 + law + own, 0.3 + law[:, 0]
    found = gains_and_laws(tuned, authors)
    assert found.seeds.value == pytest.approx(0.02, rel=0.15)
    assert found.laws == pytest.approx(0.05, rel=0.3)
    assert found.gains.value == pytest.approx(0.1 / math.sqrt(2), rel=0.15)
    assert found.seeds.bounds.low < 0.02 < found.seeds.bounds.high
    assert found.ratio.bounds.low > 0.0
    assert found.f > 1.0


def test_gains_that_matter_by_a_few_weak_laws_alone_are_said_to():
    laws = np.linspace(0.3, 0.36, 8)
    tuned = laws[:, None] + np.random.default_rng(7).normal(0.0, 0.002, (8, 5))
    weak = laws - np.array([0.0, 0.25, 0.0, 0.0, 0.23, 0.0, 0.27, 0.24])
    assert set(gains_and_laws(tuned, weak).resting) <= {1, 4, 6, 7}
    assert gains_and_laws(tuned, weak).resting
    assert gains_and_laws(tuned, laws - 0.2).resting == (), "all laws gain"


def test_intervals_of_the_ratio_of_laws_to_seeds_hold_it_as_often_as_they_say():
    chance, ratio = np.random.default_rng(5), 2.0
    held = []
    for _ in range(2000):
        groups = chance.normal(0.0, ratio, (10, 1)) + chance.normal(0.0, 1.0, (10, 5))
        bounds = ratio_of_spreads(groups)[0].bounds
        held.append(bounds.low <= ratio <= bounds.high)
    assert np.mean(held) == pytest.approx(0.95, abs=0.015)  # three standard errors
    alike = [ratio_of_spreads(chance.normal(0.0, 1.0, (10, 5)))[0].bounds.low == 0.0 for _ in range(2000)]
    assert np.mean(alike) == pytest.approx(0.975, abs=0.011)


def test_orders_are_compared_by_the_entries_that_move():
    scores = {"a": 90.0, "b": 80.0, "c": 70.0, "d": 60.0, "none": 0.0}
    moves = moves_between(scores, {**scores, "a": 65.0}, "none")
    assert (moves.moved, moves.farthest, moves.before, moves.after) == (3, "a", 1, 3)
    assert moves.correlation == pytest.approx(1 - 6 * (4 + 1 + 1) / (4 * 15))
    assert moves_between(scores, {**scores, "new": 95.0}, "none").moved == 0
    lost = {"none": 0.0, "d": 0.0, "c": 0.0, "b": 1.0, "a": 2.0}
    shared = moves_between({**scores, "c": 0.0, "d": 0.0}, lost, "none")
    assert shared.moved == 0, "entries that share a score share a place"


def levels_of(threats: LoadedThreats, position) -> ThreatResult:
    survived = {place: Survived(position(place), "") for place in threats.searches()}
    return ThreatResult(threats, {}, survived, {})


def test_a_setting_is_compared_with_the_main_one_on_its_own_threats_and_cars(shipped):
    def position(place):
        skill = sorted(shipped.ranking.entries).index(place.entry) / 1000
        shift = {"bound_15": -0.05, "unguarded": -2 * skill}.get(place.setting, 0.0)
        return 0.5 + skill + shift

    result = levels_of(shipped, position)
    stricter, turned = (compared_setting(result, setting) for setting in ("bound_15", "unguarded"))
    assert stricter.moved == pytest.approx(-0.05)
    assert stricter.main is not None and turned.main is not None
    assert stricter.table.order() == stricter.main.order()
    moves = moves_between(turned.main.by_entry(), turned.table.by_entry(), "none")
    assert moves.correlation == pytest.approx(-1.0)


def test_gains_are_compared_among_all_laws_and_among_groups_of_them(shipped):
    chance = np.random.default_rng(6)
    drawn: dict[str, float] = {}

    def position(place):
        spec = shipped.ranking.entries[place.entry][0]
        law = drawn.setdefault(f"law {spec.fmu}", chance.normal(0.0, 0.01))
        gain = drawn.setdefault(place.entry, chance.normal(0.0, 0.002))
        return 0.5 + law + gain + (0.1 if spec.gains == "tuned" else 0.0)

    compared = compared_gains(levels_of(shipped, position))
    assert compared is not None
    assert {len(means) for means in compared.means.values()} == {6}  # of the study, and five seeds
    assert [*compared.groups] == ["all 18 laws", *shipped.spec.settings["seeds"].groups]
    for gains in compared.groups.values():
        assert gains.gains.value == pytest.approx(0.1 / math.sqrt(2), rel=0.05)
        assert gains.seeds.value == pytest.approx(0.002, rel=0.3)
        assert gains.ratio.bounds.low > 1.0
        assert gains.difference.bounds.low > 0.0


SMALL = f"""
title: small
ranking: ranking.yaml
cars: [s]
threats:
  friction:
    {{title: friction, easy: 0.9, hard: 0.1, scenario: {GROUND}/sine_with_dwell.yaml, dry: false,
     set: {{"inputs.tyre.friction_*": "{{level}}"}}, source: here}}
settings:
  main: {{title: main, limit: 10000}}
"""
OTHER_CAR = f"""  other:
    title: hard
    vehicle: {ROOT}/scenarios/vehicles/hard.yaml
    slow_steer: {GROUND}/slowly_increasing_steer.yaml
"""


def small(folder: Path, ranking: str = RANKING, threats: str = SMALL, *levels: str) -> Path:
    """Write a small ranking and its threats, and levels that were published; return the file of threats."""
    (folder / "ranking.yaml").write_text(ranking)
    if levels:
        head = "setting,threat,car,entry,level,unit,position,end"
        (folder / "levels.csv").write_text("\n".join([head, *levels, ""]))
        threats += "published: {levels: levels.csv}\n"
    (folder / "threats.yaml").write_text(threats)
    return folder / "threats.yaml"


def survived_everywhere(threats: LoadedThreats, **positions: float) -> dict[SearchPlace, Survived]:
    return {place: Survived(positions.get(place.entry, 0.5), "") for place in threats.searches()}


def test_a_setting_of_some_cars_has_tables_of_these_alone(tmp_path):
    some = SMALL.replace("cars: [s]", "cars: [other, s]").replace("limit: 10000", "limit: 10000, cars: [s]")
    threats = load_threats(small(tmp_path, RANKING.replace("conditions:", OTHER_CAR + "conditions:"), some))
    assert {place.car for place in threats.searches()} == {"s"}
    (table,) = car_tables(ThreatResult(threats, {}, survived_everywhere(threats), {}), ["fuzzy_pid"])
    assert list(table.headings) == ["controller", "s"]


NONE = "main,friction,s,none,0.9,,0.0,easy"


def test_an_entry_joins_the_published_levels_with_its_own_runs(tmp_path, yawbench):
    file = small(tmp_path, RANKING, SMALL, NONE)
    options = ("--only", "fuzzy_pid", "--out", tmp_path / "out", "--jobs", 1)
    status, _, said = yawbench("rank", file, *options)
    assert status == 0, said
    scores = rows(tmp_path / "out" / "scores.csv")
    assert [(one["entry"], float(one["score"])) for one in scores] == [("fuzzy_pid", 100.0), ("none", 0.0)]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Published levels" in page and "fails at 0.90" in unpacked(page)


def test_a_setting_that_is_chosen_is_searched_and_the_others_count_as_published(tmp_path, yawbench):
    other = SMALL + "  slippery: {title: slippery, limit: 10000, bound: 30}\n"
    file = small(tmp_path, RANKING, other, NONE, "main,friction,s,fuzzy_pid,0.3,,0.5,")
    options = ("--condition", "slippery", "--out", tmp_path / "out", "--jobs", 1)
    status, _, said = yawbench("rank", file, *options)
    assert status == 0, said
    levels = {(row["setting"], row["entry"]): row for row in rows(tmp_path / "out" / "levels.csv")}
    assert float(levels["main", "fuzzy_pid"]["position"]) == 0.5
    assert 0.1 < float(levels["slippery", "fuzzy_pid"]["level"]) < 0.9
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert mentions(page, "levels", "main")
    assert "--condition slippery" in page


def test_an_unknown_setting_is_refused_with_the_known_ones(tmp_path, yawbench):
    status, _, said = yawbench("rank", small(tmp_path), "--condition", "dry")
    assert status != 0 and mentions(said, "--condition dry", "main")


def quantity(**keys) -> QuantitySpec:
    return QuantitySpec.model_validate({"title": "distance", "best": 50.0, "worst": 200.0, **keys})


def test_a_quantity_has_a_geometric_range_and_a_car_that_is_lost_its_bad_end():
    distance = quantity()
    assert distance.position(100.0) == pytest.approx(0.5)
    assert (distance.position(50.0), distance.position(20.0)) == (1.0, 1.0)
    assert (distance.position(200.0), distance.position(900.0), distance.position(None)) == (0.0, 0.0, 0.0)
    overshoot = quantity(best=0.0, worst=3.0, offset=1.0)
    assert overshoot.position(1.0) == pytest.approx(0.5)


@pytest.mark.parametrize("keys", [{"best": 0.0}, {"worst": 50.0}, {"worst": 40.0}])
def test_a_quantity_without_a_range_is_refused(keys):
    with pytest.raises(ValueError, match=r"best.* 0 .*worst"):
        quantity(**keys)


BRAKING = f"""disciplines:
  braking:
    title: Braking
    scenario: {SHIPPED}/road/split_braking.yaml
    test: straight-braking
    source: Here
    quantities: {{distance: {{title: distance, best: 50, worst: 200}}}}
"""


def test_disciplines_stand_beside_the_threats_and_entries_that_did_not_drive_them_are_left_out(tmp_path):
    more = "".join(
        f"  {name}: {{title: {name}, fmu: controller_pid, source: here}}\n" for name in ("pid", "new")
    )
    threats = load_threats(small(tmp_path, RANKING + more, SMALL + BRAKING))
    survived = survived_everywhere(threats, none=0.0, fuzzy_pid=0.5, pid=0.4, new=0.3)
    driven = {"none": None, "fuzzy_pid": 100.0, "pid": 50.0}
    quantities = {("braking", "s", entry): {"distance": value} for entry, value in driven.items()}
    units = {("braking", "distance"): "m"}
    result = ThreatResult(threats, {}, survived, quantities, units, passed={"pid": (3, 4)})
    (braking,) = disciplines(result)
    assert braking.scores.order() == ["pid", "fuzzy_pid", "none"]
    table = discipline_table(result, braking)
    assert table.headings[-1] == "distance [m]"
    assert [row[-1] for row in table.rows] == ["50.0", "100", "lost"]
    rows_of_all = {row[0]: row[1:] for row in overview(result, scored(result)).rows}
    assert rows_of_all["pid"] == ["3 of 4", "80 (1)", "100 (1)"]
    assert rows_of_all["fuzzy PID"] == [None, "100 (1)", "50 (1)"]
    assert rows_of_all["new"] == [None, "60 (1)", None]
    assert {row[3] for row in table.rows} == {None}, "one car says nothing about others"


@pytest.mark.exhaustive
def test_entries_of_ones_own_are_driven_from_nothing(tmp_path, capsys):
    (tmp_path / "ranking.yaml").write_text(RANKING)
    (tmp_path / "threats.yaml").write_text(SMALL)
    status = status_of("rank", tmp_path / "threats.yaml", "--out", tmp_path / "out", "--jobs", 1)
    assert status == 0, capsys.readouterr().err
    levels = {one["entry"]: one for one in rows(tmp_path / "out" / "levels.csv")}
    assert levels["none"]["end"] == "easy"
    assert levels["fuzzy_pid"]["end"] == ""
    assert 0.1 < float(levels["fuzzy_pid"]["level"]) < 0.9
    scores = rows(tmp_path / "out" / "scores.csv")
    assert [(one["entry"], float(one["score"])) for one in scores] == [("fuzzy_pid", 100.0), ("none", 0.0)]
    page = unpacked(tmp_path / "out" / "report.html")
    assert "fuzzy PID" in page
    assert "fails at 0.90" in page

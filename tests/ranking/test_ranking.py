"""A ranking: cells and places from runs made up, and a small matrix that is driven."""

from __future__ import annotations

import csv
from math import radians
from pathlib import Path

import pytest

from tests.command_line import status_of
from tests.refusals import mentions, refused
from yawbench.foundation.errors import Diagnostic, ScenarioError
from yawbench.ranking.ranking import EntrySpec, load_ranking
from yawbench.ranking.ranking_scores import (
    UNHELD,
    WORST,
    EntryScore,
    RankedRun,
    RankedState,
    RankingCell,
    apart_by_conditions,
    placed,
)
from yawbench.ranking.ranking_tables import state_words
from yawbench.studies.confidence import share_bounds
from yawbench.studies.jobs import MeasuredRun

ROOT = Path(__file__).parents[2]
GROUND = ROOT / "scenarios" / "proving_ground"
A = radians(36.0)
GOOD = {"stability": 1.0, "responsiveness": 1.0, "ratio_1000": 0.05, "ratio_1750": 0.02, "sideslip": 0.1}


def driven(multiple: float = 5.0, *, repeat: int | None = None, dry: bool = True, **numbers: float | None):
    """Return a run of a multiple of A that passes, but for what is given."""
    known = {key: None if x is None else (x, "1") for key, x in {**GOOD, **numbers}.items()}
    return RankedRun("x", "c", multiple * A, A, MeasuredRun(known), repeat, dry)


def standing(name: str, *cells: list[RankedRun]) -> EntryScore:
    spec = EntrySpec(title=name, fmu="f", parameters={}, source="made up", gains="authors")
    return EntryScore(name, spec, {str(k): RankingCell(name, str(k), runs) for k, runs in enumerate(cells)})


def test_a_run_that_meets_the_criteria_with_much_sideslip_has_spun_and_does_not_pass():
    assert driven().passed
    spun = driven(sideslip=radians(21.0))
    assert (spun.met, spun.passed, spun.state) == (True, False, RankedState.SPUN)
    assert not driven(stability=0.0).met
    assert RankingCell("x", "c", [driven(), spun]).state is RankedState.SPUN
    assert RankingCell("x", "c", [driven(stability=0.0), spun]).state is RankedState.FAILED


@pytest.mark.parametrize("far", [0.0, None])
def test_responsiveness_is_asked_from_five_times_a_on_a_dry_road_alone(far):
    assert not driven(5.0, responsiveness=far).passed
    assert driven(4.9, responsiveness=far).passed
    assert driven(5.0, responsiveness=far, dry=False).passed


def test_the_headroom_is_that_of_the_nearer_limit_in_points():
    assert driven(ratio_1000=0.30, ratio_1750=0.02).headroom == pytest.approx(5.0)
    assert driven(ratio_1000=0.05, ratio_1750=0.25).headroom == pytest.approx(-5.0)
    assert driven(ratio_1000=None, ratio_1750=None).headroom == pytest.approx(100 * (0.20 - UNHELD))
    assert driven(ratio_1750=9.0).headroom == WORST


def test_a_cell_tells_how_sure_the_mean_over_its_seeds_is():
    runs = [driven(m, repeat=r, ratio_1750=0.01 * r * m) for r in (1, 2, 3) for m in (1.0, 2.0)]
    headroom = RankingCell("x", "c", runs).headroom
    assert headroom.mean == pytest.approx(20.0 - 4.0)  # the least of every seed: 18, 16, 14
    assert headroom.half == pytest.approx(4.302653 * 2.0 / 3**0.5, rel=1e-6)  # t of two degrees of freedom
    assert RankingCell("x", "c", [driven(), driven(6.0)]).headroom.half == 0.0


def test_a_ranking_names_scenarios_and_cars_as_the_command_line_does(tmp_path):
    known = SMALL.replace(f"vehicle: {ROOT}/scenarios/vehicles/saloon75.yaml", "vehicle: saloon75")
    known = known.replace(f"slow_steer: {GROUND}/", "slow_steer: proving_ground/")
    (tmp_path / "ranking.yaml").write_text(known.replace("steer.yaml", "steer"))
    ranking = load_ranking(tmp_path / "ranking.yaml")
    car = ranking.spec.cars["s"]
    assert (car.vehicle, car.slow_steer) == ("saloon75", "proving_ground/slowly_increasing_steer")
    assert ranking.scenario(car.slow_steer).resolve() == GROUND / "slowly_increasing_steer.yaml"
    (vehicle,) = (one.value for one in ranking.changes(car) if one.target.kind == "vehicle_file")
    assert Path(str(vehicle)).resolve() == ROOT / "scenarios/vehicles/saloon75.yaml"


def test_places_go_by_conditions_passed_then_runs_then_sideslip():
    bad = driven(stability=0.0)
    every = [
        standing("one and a half", [driven()], [bad, driven()]),
        standing("slides", [driven(sideslip=0.2)], [driven()]),
        standing("both", [driven()], [driven()]),
        standing("one", [driven()], [bad, bad]),
        standing("as both", [driven()], [driven()]),
        standing("none", [bad], [bad]),
    ]
    found = [(one.entry, one.rank) for one in placed(every)]
    assert [name for name, _ in found] == ["both", "as both", "slides", "one and a half", "one", "none"]
    assert [rank for _, rank in found] == [1, 1, 3, 4, 5, 6]


def test_entries_that_no_exact_test_tells_apart_share_a_place():
    def passing(name: str, count: int) -> EntryScore:
        return standing(name, *([driven(stability=float(k < count))] for k in range(12)))

    ranked = placed([passing("nine", 9), passing("none", 0), passing("eight", 8), passing("one", 1)])
    assert [(one.entry, one.place, one.rank) for one in ranked] == [
        ("nine", 1, 1), ("eight", 1, 2), ("one", 3, 3), ("none", 3, 4),
    ]  # fmt: skip
    assert ranked[0].bounds == pytest.approx([12 * x for x in share_bounds(9, 12)])
    apart = apart_by_conditions(ranked)
    assert (apart.better.sum(), apart.alone.sum()) == (4, 4)  # neither nine and eight nor one and none


def test_an_entry_brings_units_beside_its_controller_and_names_that_one_by_its_own_key(tmp_path):
    text = "entries: {wls: {title: x, fmu: controller_lqr, swap: {allocator: mine.fmu}, source: y}}"
    file, other = tmp_path / "ranking.yaml", tmp_path / "folder" / "more.yaml"
    other.parent.mkdir()
    other.write_text(text)
    file.write_text(SMALL + "\nmore_entries: [folder/more.yaml]\n")
    variant = load_ranking(file).variant("wls")
    assert variant.swap == {"controller": "controller_lqr", "allocator": str(other.parent / "mine.fmu")}
    other.write_text(text.replace("allocator:", "controller:"))
    with refused(ScenarioError, names=("entries.wls.swap", "controller", "fmu")):
        load_ranking(file)


def test_an_entry_without_a_run_is_missing_and_has_no_place():
    missing = RankedRun("x", "c", A, A, None)
    first, last = placed([standing("lacks", [driven()], [driven(), missing]), standing("has", [driven()])])
    assert (first.entry, first.place) == ("has", 1)
    assert (last.entry, last.place, last.missing) == ("lacks", None, 1)
    assert last.cells["1"].state is RankedState.MISSING
    assert last.mean("headroom") is None


def test_a_run_that_broke_off_counts_as_lost():
    broken = MeasuredRun({}, (Diagnostic("run-failed", "the controller has crashed"),))
    lost = RankedRun("x", "c", A, A, broken)
    cell = RankingCell("x", "c", [driven(), lost])
    assert cell.state is RankedState.FAILED
    assert cell.headroom.mean == pytest.approx(100 * (0.20 - UNHELD))
    assert mentions(state_words(lost), "controller")


SMALL = f"""
title: small
step_size: 0.005
stop_time: 5.5
every: 20
cars:
  s:
    title: saloon75
    vehicle: {ROOT}/scenarios/vehicles/saloon75.yaml
    slow_steer: {GROUND}/slowly_increasing_steer.yaml
conditions:
  dry: {{title: dry, car: s, scenario: {GROUND}/sine_with_dwell.yaml, quick: true}}
  low: {{title: low, car: s, scenario: {GROUND}/sine_with_dwell.yaml, dry: false, set: {{friction: 0.4}}}}
entries:
  none: {{title: no control, fmu: controller_off, source: the car alone}}
  fuzzy_pid: {{title: fuzzy PID, fmu: controller_fuzzy_pid, source: paper C}}
"""
"""Two controllers in two conditions, one amplitude each, with steps of 5 ms."""


def rows(file: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(file.open()))


@pytest.mark.exhaustive
def test_noisy_sensors_give_a_headroom_with_its_confidence(tmp_path):
    options = ("--condition", "saloon75_sensors", "--quick", "--only", "sliding_mode", "--out", tmp_path)
    assert status_of("rank", GROUND / "ranking.yaml", *options) == 0
    cell = next(row for row in rows(tmp_path / "cells.csv") if row["entry"] == "sliding_mode")
    assert int(cell["runs"]) == 5  # seeds
    assert 0 < float(cell["sideslip_half_width [rad]"]) < radians(1.0)
    side = tmp_path / "data" / "sliding-mode-in-saloon75-sensors.js"
    assert mentions(side.read_text(encoding="utf-8"), "95 %", "5 seeds", "confidence")


@pytest.mark.parametrize(
    "wrong, options, names",
    [
        (("car: s,", "car: t,"), (), ("conditions.dry.car", "'t'")),
        (("every: 20", "evry: 20"), (), ("'every'", "unknown", "key")),
        (("source: paper C", "sauce: paper C"), (), ("'source'",)),
        (("every: 20", "setting_conditions: [wet]"), (), ("setting_conditions", "'wet'")),
        (("every: 20", "ordinary: {x: {title: x, scenario: s.yaml, cars: [truck]}}"), (), ("'truck'",)),
        ((), ("--only", "fuzy_pid"), ("--only fuzy_pid", "'fuzzy_pid'")),
        ((), ("--condition", "wet"), ("'wet'", "condition")),
        ((), ("--controller", "nowhere/my.fmu"), ("--controller nowhere/my.fmu", "file")),
        ((), ("--controller", "none"), ("'none'", "entry")),
        ((), ("--fresh", "--no-run"), ("--fresh", "--no-run")),
        ((), ("--no-run",), ("'s'", "--no-run")),
    ],
)
def test_what_is_wrong_with_a_ranking_is_said_before_any_run(wrong, options, names, tmp_path, yawbench):
    file = tmp_path / "small.yaml"
    file.write_text(SMALL.replace(*wrong) if wrong else SMALL)
    status, _, said = yawbench("rank", file, "--out", tmp_path / "out", *options)
    assert status in (1, 2) and mentions(said, *names)
    assert not list(tmp_path.rglob("run.json"))

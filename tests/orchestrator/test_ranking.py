"""A ranking: cells and places from runs made up, and a small matrix that is driven."""

from __future__ import annotations

import csv
import json
import re
import shutil
import subprocess
import sys
import warnings
from math import radians
from pathlib import Path

import pytest

from tests.commands import status_of
from tests.refusals import mentions
from yawbench.figures.style import shown
from yawbench.foundation.errors import Diagnostic, RecordWarning
from yawbench.ranking.ranking import EntrySpec, load_ranking
from yawbench.ranking.ranking_scores import (
    UNHELD,
    WORST,
    EntryScore,
    RankedRun,
    RankedState,
    RankingCell,
    apart_by_conditions,
    deciding_digits,
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


def test_numbers_that_decide_places_read_differently():
    close = [
        standing("first", *2 * [[driven(sideslip=0.300001)]]),
        standing("second", *2 * [[driven(sideslip=0.300004)]]),
        standing("bad", [driven(stability=0.0, sideslip=0.300004)] + [driven()] * 999, [driven()]),
        standing("worse", [driven(stability=0.0, sideslip=0.3)] * 2 + [driven()] * 998, [driven()]),
    ]
    ranked = placed(close)
    digits = deciding_digits(ranked)
    slips = [shown(one.mean("sideslip"), "rad", digits=digits.sideslip) for one in ranked]
    shares = [shown(one.share, "%", digits=digits.share) for one in ranked]
    known = {one.entry: k for k, one in enumerate(ranked)}
    assert len({slips[known[name]] for name in ("first", "second")}) == 2
    assert len({shares[known[name]] for name in ("bad", "worse")}) == 2
    far = placed([standing(name, [driven(sideslip=x)]) for name, x in (("a", 0.2), ("b", 0.3))])
    assert deciding_digits(far) == (2, 3)


def test_an_entry_without_a_run_is_missing_and_has_no_place():
    missing = RankedRun("x", "c", A, A, None)
    first, last = placed([standing("lacks", [driven()], [driven(), missing]), standing("has", [driven()])])
    assert (first.entry, first.place) == ("has", 1)
    assert (last.entry, last.place, last.missing) == ("lacks", None, 1)
    assert last.cells["1"].state is RankedState.MISSING
    assert last.mean("headroom") is None


def test_a_run_that_broke_off_counts_as_lost():
    lost = RankedRun(
        "x", "c", A, A, MeasuredRun({}, (Diagnostic("run-failed", "the controller has crashed"),))
    )
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


def test_a_small_matrix_is_driven_goes_on_where_it_was_and_shows_what_is_missing(tmp_path, capsys):
    file, out = tmp_path / "small.yaml", tmp_path / "out"
    file.write_text(SMALL)
    assert status_of("rank", file, "--out", out, "--only", "fuzzy_pid", "--jobs", 2) == 0
    assert mentions(capsys.readouterr().err, "ranked", "missing", "none")
    page = (out / "report.html").read_text()
    assert mentions(page, "build", "control")
    lacking = rows(out / "table.csv")
    assert [(one["entry"], one["place"]) for one in lacking] == [("fuzzy_pid", "1"), ("none", "")]
    assert status_of("rank", file, "--out", out, "--jobs", 2) == 0
    assert mentions(capsys.readouterr().err, "4 runs", "2", "finished")
    found = rows(out / "table.csv")
    assert [(one["entry"], one["place"], one["passed"]) for one in found] == [
        ("fuzzy_pid", "1", "2"), ("none", "1", "0"),
    ]  # fmt: skip
    assert found[0] == lacking[0]  # what has been made is not made again
    cells = {(one["entry"], one["condition"]): one for one in rows(out / "cells.csv")}
    assert {key: one["state"] for key, one in cells.items()} == {
        ("fuzzy_pid", "dry"): "passed", ("fuzzy_pid", "low"): "passed",
        ("none", "dry"): "failed", ("none", "low"): "failed",
    }  # fmt: skip
    assert 0 < float(found[0]["step_time [s]"]) < 0.005
    held, free = (float(one["intervention [N.m.s]"]) for one in found)
    assert free < 0.001 * held  # what the engine's lag leaves of the driver's force
    assert len(rows(out / "runs.csv")) == 4
    page = (out / "report.html").read_text()
    assert 'href="#cell?id=fuzzy-pid-in-low"' in page
    sides = {path.stem: path.read_text() for path in (out / "data").glob("*.js")}
    assert set(sides) == {f"{entry}-in-{name}" for entry in ("fuzzy-pid", "none") for name in ("dry", "low")}
    (low,) = (one for one in rows(out / "runs.csv") if (one["entry"], one["condition"]) == ("none", "low"))
    content = json.loads(sides["none-in-low"].partition(", ")[2].rstrip(");\n"))
    (run,) = content["data"]["runs"]
    assert {"x", "y", "yaw"} <= set(run["road"])  # what the car on the road needs
    assert low["verdict"] in content["html"]
    assert mentions(content["html"], "sine-with-dwell", "drive")
    capsys.readouterr()
    assert status_of("rank", file, "--out", out, "--no-run", "--json") == 0
    answer = json.loads(capsys.readouterr().out)
    places = {entry["entry"]: entry["place"] for entry in answer["entries"]}
    assert places == {"fuzzy_pid": 1, "none": 1}
    assert (answer["page"], answer["folder"]) == (str(out / "report.html"), str(out))


@pytest.mark.exhaustive
def test_a_ranking_that_was_killed_goes_on_where_it_was(tmp_path, capsys):
    file, out = tmp_path / "small.yaml", tmp_path / "out"
    file.write_text(SMALL)
    program = "import sys; from yawbench.cli import main; main(sys.argv[1:])"
    command = [sys.executable, "-c", program, "rank", str(file), "--out", str(out), "--jobs", "1"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=ROOT) as process:
        assert process.stderr is not None
        next(line for line in process.stderr if line.startswith("[1/4]"))
        process.kill()
    assert not (out / "table.csv").exists()
    assert status_of("rank", file, "--out", out) == 0
    told = capsys.readouterr().err
    assert re.search(r"small: 4 runs, [123] finished already", told), told
    assert [one["missing"] for one in rows(out / "table.csv")] == ["0", "0"]


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
        ((), ("--only", "fuzy_pid"), ("--only fuzy_pid", "'fuzzy_pid'")),
        ((), ("--condition", "wet"), ("'wet'", "condition")),
        ((), ("--controller", "nowhere/my.fmu"), ("--controller nowhere/my.fmu", "file")),
        ((), ("--controller", "none"), ("'none'", "entry")),
        ((), ("--fresh", "--no-run"), ("--fresh", "--no-run")),
        ((), ("--no-run",), ("'s'", "--no-run")),
    ],
)
def test_what_is_wrong_with_a_ranking_is_said_before_any_run(wrong, options, names, tmp_path, capsys):
    file = tmp_path / "small.yaml"
    file.write_text(SMALL.replace(*wrong) if wrong else SMALL)
    assert status_of("rank", file, "--out", tmp_path / "out", *options) in (1, 2)
    assert mentions(capsys.readouterr().err, *names)
    assert not list(tmp_path.rglob("run.json"))


def edited_ranking(folder: Path, old: str = "", new: str = ""):
    for name in ("ranking.yaml", "tuned.yaml"):
        shutil.copy(GROUND / name, folder)
    text = (folder / "tuned.yaml").read_text()
    assert old in text
    (folder / "tuned.yaml").write_text(text.replace(old, new, 1))
    return load_ranking(folder / "ranking.yaml")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("42400.0", "42500.0", "'pid_tuned' was changed since `yawbench tune` wrote it"),
        ("gains: tuned", "gains: authors", "'pid_tuned' was changed since `yawbench tune` wrote it"),
        ("  pid_tuned:", "  own:", "'own' was added, 'pid_tuned' was removed since `yawbench tune` wrote it"),
        ("  '*': sha256:", "  '*': sha256:0", "checksums.* was changed since `yawbench tune` wrote it"),
    ],
)
def test_an_edited_file_of_tuned_entries_is_taken_and_the_edit_said(old, new, words, tmp_path):
    with pytest.warns(RecordWarning) as told:
        ranking = edited_ranking(tmp_path, old, new)
    assert [str(one.message) for one in told] == [f"{tmp_path / 'tuned.yaml'}: {words}"]
    assert ranking.edited == (str(told[0].message),)  # the page shows it, too


def test_tuned_entries_without_checksums_are_said_to_be_taken_as_they_are(tmp_path):
    whole = (GROUND / "tuned.yaml").read_text()
    with pytest.warns(RecordWarning, match="checksums"):
        edited_ranking(tmp_path, whole[whole.index("checksums:") :])


def test_shipped_entries_are_as_they_were_found(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert edited_ranking(tmp_path).edited == ()


def test_the_ranking_of_the_proving_ground_is_as_large_as_it_says():
    ranking = load_ranking(GROUND / "ranking.yaml")
    assert len(ranking.spec.entries) >= 11
    assert len(ranking.conditions) >= 12
    quick = load_ranking(GROUND / "ranking.yaml", quick=True)
    assert 1 < len(quick.conditions) < len(ranking.conditions)


@pytest.mark.parametrize("name", load_ranking(GROUND / "ranking.yaml").spec.conditions)
def test_brakes_get_no_help_from_a_drive_without_lag(name):
    """Whoever brakes by hydraulics has an allocator that never drives a wheel."""
    ranking = load_ranking(GROUND / "ranking.yaml")
    text = (GROUND / ranking.spec.conditions[name].scenario).read_text()
    assert ("wheel_control_hydraulic" in text) != ("allocator_load_proportional" in text)

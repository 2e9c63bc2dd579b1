"""The fingerprint of what the tool computes: what it takes out, what it finds, what a comparison shows."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.artefacts import artefacts_in, masked, texts_of
from tests.checkout import ROOT
from tests.fingerprint import (
    EVALUATED,
    QUICK_SCENARIOS,
    compare,
    hashes_in,
    jobs,
    lines_of,
    read,
    report,
    write,
)

ROWS = "time,plant.yaw_rate\n0.0,0.0\n0.001,0.25\n0.002,0.5\n"


def put(file: Path, text: str) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")
    return file


@pytest.mark.parametrize(
    ("said", "instead"),
    [
        ("started 2026-11-22T22:20:51+00:00", "started TIME"),
        ("SHA-256 1baf10d766b920efa9a94bb01f7622a757d7a37246690054a218dff4da8161e3", "SHA-256 HASH"),
        ("yawbench 0.2.0, pythonfmu 0.7.0", "yawbench VERSION, pythonfmu VERSION"),
        ("results: 8001 rows of 64 variables in 1.33 s", "results: 8001 rows of 64 variables in DURATION"),
        ("controller_fnn (b4573b63)", "controller_fnn (HASH)"),
        ("21.6 µs per step", "DURATION per step"),
        ("-4.716664836194605e-04, 0.47166648361946058", "-4.716664836194605e-04, 0.47166648361946058"),
        ("stops at 8.0 s with 12345678901234567890 rows", "stops at 8.0 s with 12345678901234567890 rows"),
    ],
)
def test_times_versions_and_hashes_are_masked_and_no_number_is(said, instead):
    assert masked(said) == instead


@pytest.mark.parametrize("digit", ["0.24", "0.2500000000000001"])
def test_a_changed_digit_of_a_results_file_is_found_between_its_extremes(tmp_path, digit):
    before = artefacts_in(put(tmp_path / "a" / "results.csv", ROWS).parent, tmp_path)
    after = artefacts_in(put(tmp_path / "b" / "results.csv", ROWS.replace("0.25", digit)).parent, tmp_path)
    found = compare(hashes_in(lines_of(before)), hashes_in(lines_of(after)))
    assert found == (["results.csv", "results.csv#bytes"], [], [])
    told = report(found, before, after)
    assert told[0] == "differs: results.csv, line 2"
    assert told[1].startswith("  - ") and "plant.yaw_rate: 3 values, 0.0 to 0.5" in told[1]


def test_a_record_has_an_artefact_per_key_and_none_of_what_differs_from_run_to_run(tmp_path):
    record = {
        "id": "e7ad616421fb", "started": "2026-11-22T22:20:51+00:00", "wall_time": 1.3, "versions": {},
        "status": "completed",
        "fmus": {"plant": {"sha256": "ab", "built": {}, "parameters": {"mass": 1100.0}}},
    }  # fmt: skip
    found = texts_of(put(tmp_path / "run.json", json.dumps(record)))
    assert found.keys() == {":status", ":fmus"}
    assert json.loads(found[":fmus"]) == {"plant": {"parameters": {"mass": 1100.0}}}


def test_a_comparison_tells_words_from_numbers(tmp_path):
    before = {"same": "1\n", "wording": "error: 3.4 %\n", "value": "a\nerror: 3.4 %\n", "gone": "1\n"}
    after = {"same": "1\n", "wording": "largest error: 3.4 %\n", "value": "a\nerror: 3.5 %\n", "added": "1\n"}
    write(before, tmp_path / "before.txt")
    hashes, texts = read(tmp_path / "before.txt")
    assert texts == before
    assert report(compare(hashes, hashes_in(lines_of(after))), texts, after) == [
        "differs: value, line 2",
        "  - error: 3.4 %",
        "  + error: 3.5 %",
        "differs, its numbers do not: wording, line 1",
        "  - error: 3.4 %",
        "  + largest error: 3.4 %",
        "missing: gone",
        "new: added",
        "2 differ, 1 are missing, 1 are new",
    ]
    assert not compare(hashes, hashes)


def test_every_scenario_is_run_and_what_is_named_exists():
    names = {job.name for job in jobs(ROOT / "scenarios")}
    assert len(names) == len(jobs(ROOT / "scenarios"))
    of_scenarios = {name.removeprefix("scenarios/") for name in names if name.startswith("scenarios/")}
    assert of_scenarios >= {*EVALUATED, *QUICK_SCENARIOS}
    assert len(of_scenarios) > 40
    assert {job.name for job in jobs(ROOT / "scenarios", quick=True)} < names

"""The fingerprint of what the tool computes: what it takes out, what it finds, what a comparison shows."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests import fingerprint
from tests.artefacts import artefacts_in, masked, numbers_in, texts_of
from tests.checkout import ROOT
from tests.fingerprint import (
    EVALUATED,
    QUICK_SCENARIOS,
    compare,
    hashes_in,
    jobs,
    lines_of,
    main,
    part_of,
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


def test_paths_are_relative_to_the_folder_of_the_results(tmp_path):
    assert masked(f"{tmp_path}/scenarios/a.yaml", tmp_path) == "./scenarios/a.yaml"


@pytest.mark.parametrize("digit", ["0.24", "0.2500000000000001"])
def test_a_changed_digit_of_a_results_file_is_found_between_its_extremes(tmp_path, digit):
    before = artefacts_in(put(tmp_path / "a" / "results.csv", ROWS).parent, tmp_path)
    after = artefacts_in(put(tmp_path / "b" / "results.csv", ROWS.replace("0.25", digit)).parent, tmp_path)
    found = compare(hashes_in(lines_of(before)), hashes_in(lines_of(after)))
    assert found == (["results.csv", "results.csv#bytes"], [], [])
    told = report(found, before, after)
    assert told[0] == "differs: results.csv, line 2"
    assert told[1].startswith("  - ") and "plant.yaw_rate: 3 values, 0.0 to 0.5" in told[1]


def test_the_same_numbers_are_the_same_text_in_csv_and_parquet(tmp_path):
    columns = pa.table({"time": [0.0, 0.001, 0.002], "plant.yaw_rate": [0.0, 0.25, 0.5]})
    pq.write_table(columns, tmp_path / "results.parquet")
    assert texts_of(tmp_path / "results.parquet")[""] == texts_of(put(tmp_path / "results.csv", ROWS))[""]


def test_a_record_has_an_artefact_per_key_and_none_of_what_differs_from_run_to_run(tmp_path):
    record = {
        "id": "e7ad616421fb", "started": "2026-11-22T22:20:51+00:00", "wall_time": 1.3, "versions": {},
        "status": "completed",
        "fmus": {"plant": {"sha256": "ab", "built": {}, "parameters": {"mass": 1100.0}}},
    }  # fmt: skip
    found = texts_of(put(tmp_path / "run.json", json.dumps(record)))
    assert found.keys() == {":status", ":fmus"}
    assert json.loads(found[":fmus"]) == {"plant": {"parameters": {"mass": 1100.0}}}


def test_a_table_is_without_its_columns_of_times_and_keys(tmp_path):
    file = put(tmp_path / "runs.csv", "entry,sideslip [rad],step_time [s],key\nnone,0.12,2e-05,0ee7\n")
    assert texts_of(file) == {"": "entry,sideslip [rad]\nnone,0.12\n"}


def test_runs_in_folders_named_by_a_hash_are_one_artefact_whatever_the_hash(tmp_path):
    first, second = ROWS, ROWS.replace("0.25", "0.26")
    for side, folders in {
        "a": ("3127e3a68cc2", "6db878bf86c0"),
        "b": ("f27e3a68cc2d", "156788339393"),
    }.items():
        for folder, text in zip(folders, (first, second), strict=True):
            put(tmp_path / side / "runs" / folder / "results.csv", text)
    found = artefacts_in(tmp_path / "a", tmp_path)
    assert found.keys() == {"runs/*/results.csv", "runs/*/results.csv#bytes"}
    assert found == artefacts_in(tmp_path / "b", tmp_path)
    put(tmp_path / "b" / "runs" / "156788339393" / "results.csv", first)
    assert found != artefacts_in(tmp_path / "b", tmp_path)


def test_of_a_page_the_cells_of_tables_and_the_verdicts_count_and_markup_does_not(tmp_path):
    table = '<p>{}</p><table class="{}"><tr><th>run<td>3.38 <b>%</b></tr></table>'
    page = table + '<span class="verdict good">✓ holds</span>'
    first, second = (put(tmp_path / f"{k}.html", page.format(*two)) for k, two in enumerate(["ab", "cd"]))
    assert texts_of(first) == texts_of(second) == {"": "run | 3.38 %\n✓ holds\n"}


def test_of_an_fmu_the_model_description_counts_without_guid_and_tool(tmp_path):
    def archive(name: str, guid: str, unit: str) -> Path:
        with zipfile.ZipFile(tmp_path / name, "w") as made:
            variable = f'<ScalarVariable name="x"><Real unit="{unit}"/></ScalarVariable>'
            about = f'guid="{guid}" generationTool="yawbench {guid}" generationDateAndTime="{guid}"'
            made.writestr(
                "modelDescription.xml", f"<fmiModelDescription {about}>{variable}</fmiModelDescription>"
            )
            made.writestr("resources/module.py", guid)
        return tmp_path / name

    assert texts_of(archive("a.fmu", "1", "rad")) == texts_of(archive("b.fmu", "2", "rad"))
    assert texts_of(archive("a.fmu", "1", "rad")) != texts_of(archive("b.fmu", "1", "deg"))


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


def test_without_the_texts_a_comparison_still_names_what_differs(tmp_path):
    put(tmp_path / "before.txt", "".join(f"{line}\n" for line in lines_of({"a b: c": "1", "d": "2"})))
    hashes, texts = read(tmp_path / "before.txt")
    after = {"a b: c": "1", "d": "3"}
    assert report(compare(hashes, hashes_in(lines_of(after))), texts, after)[0] == "differs: d"


def test_a_part_is_compared_with_the_same_part():
    before = {"fmus/a.fmu": "0", "sweep/table.csv": "1", "sweeping/table.csv": "2"}
    assert part_of(before, ["sweep"]) == {"fmus/a.fmu": "0", "sweep/table.csv": "1"}
    assert part_of(before, []) == before


def test_a_hash_counts_as_a_number_whatever_it_begins_with():
    assert numbers_in(f"x: 3 values, {'ab' * 32}") == ["3", "ab" * 32]


def test_numbers_are_found_with_signs_and_exponents_and_not_within_names():
    assert numbers_in("fl_2 x1 -3.5e-06, +4 \u22122 (40mps) 7") == ["-3.5e-06", "+4", "\u22122", "40", "7"]


@pytest.mark.parametrize(("times", "statuses"), [(1, ["0"]), (2, ["-9"])])
def test_a_command_that_somebody_kills_is_run_once_again(tmp_path, monkeypatch, times, statuses):
    calls = tmp_path / "calls"
    body = f'echo >> "{calls}"; [ $(wc -l < "{calls}") -gt {times} ] || kill -KILL $$; echo figures'
    script = put(tmp_path / "yawbench", f"#!/bin/sh\n{body}\n")
    monkeypatch.setattr(fingerprint, "_console_script", lambda: ["sh", str(script)])
    found = fingerprint._run(fingerprint.Job("sweep", (("sweep",),)), tmp_path)
    assert found["sweep/1 sweep: exit status"].split() == statuses
    assert found["sweep/1 sweep: printed"] == ("figures\n" if statuses == ["0"] else "")


def test_every_scenario_is_run_and_what_is_named_exists():
    names = {job.name for job in jobs(ROOT / "scenarios")}
    assert len(names) == len(jobs(ROOT / "scenarios"))
    of_scenarios = {name.removeprefix("scenarios/") for name in names if name.startswith("scenarios/")}
    assert of_scenarios >= {*EVALUATED, *QUICK_SCENARIOS}
    assert len(of_scenarios) > 40
    assert {job.name for job in jobs(ROOT / "scenarios", quick=True)} < names


def test_a_job_that_does_not_exist_is_told_with_those_that_do(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--only", "sweeep"])
    assert ended.value.code == 2
    assert "--only sweeep" in (told := capsys.readouterr().err) and "ranking" in told


def test_an_earlier_fingerprint_that_does_not_exist_is_told_before_anything_runs(tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--compare", str(tmp_path / "none.txt")])
    assert ended.value.code == 2
    assert "none.txt" in capsys.readouterr().err

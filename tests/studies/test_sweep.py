"""Sweeps from the file to the table: processes, failures, kills, resuming, a Dask cluster."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys

import pyarrow.parquet as pq
import pytest
from lxml import html

from tests.refusals import mentions, refused
from tests.reports.made_up import unpacked
from yawbench.cli import main
from yawbench.fmus.build import build_component
from yawbench.foundation.errors import Diagnostic, Location, ResultsError
from yawbench.orchestrator.results.reader import load_results
from yawbench.studies.executor import finish
from yawbench.studies.jobs import Job, MeasuredRun, Outcome
from yawbench.studies.journal import Journal

UNIT = '''
import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

from yawbench.components.fmi.component import Component
from yawbench.components.fmi.variables import parameter

HERE = Path({folder!r})


@dataclass(frozen=True)
class Levels:
    level: float = parameter(0.0, "N.m", "What it does")


class Moody(Component):
    """A controller that does what its level says."""

    Parameters = Levels
    inputs = ("steer_angle",)
    outputs = ("yaw_moment",)
    sampled = True

    def advance(self, t, h, u):
        level = self.p.level
        if t < 0.045:
            return
        if level == 20:
            raise ValueError("twenty is too much")
        if level == 30:
            os.kill(os.getpid(), signal.SIGKILL)
        while level == 35:
            time.sleep(1)
        if level in (40, 50) and not (HERE / str(int(level))).exists():
            (HERE / str(int(level))).touch()
            os.kill(os.getpid(), signal.SIGKILL if level == 40 else signal.SIGTERM)
        if level >= 60 and (HERE / "slow").exists():
            if t < 0.055:
                (HERE / "slow").write_text("it has begun")  # waits for somebody to read
            time.sleep(0.05)

    def output(self, t, u):
        return (self.p.level * t,)
'''

SCENARIO = """
title: A moody pair
stop_time: 0.1
step_size: 0.01
units:
  driver: {{fmu: driver_sine, parameters: {{frequency: 2.5, start_time: 0}}}}
  controller: {{fmu: {controller}}}
"""

SWEEP = """
title: Moods
source: made up
scenario: pair.yaml
axes:
  level: {{vary: controller.level, values: {levels}, says: Level}}
  amplitude: {{vary: driver.amplitude, from: 1, to: 3, count: {count}, unit: deg}}
metrics:
  moment: {{metric: peak(yaw_moment), heading: Largest moment}}
  steer: {{metric: peak(steer_angle)}}
limits:
  calm: {{says: Calm up to, of: level, holds_if: [{{metric: moment, at_most: 3.5 N.m}}]}}
"""

FIGURES = """
figures:
  - {name: curve, kind: curve, metric: moment, x: level, lines: amplitude, mark: 2 N.m}
  - {name: map, kind: map, metric: moment, x: level, y: amplitude, mark: 2 N.m}
  - {name: limit, kind: limit, limit: calm, x: amplitude}
"""


UNITS = ("driver_sine",)


@pytest.fixture
def moods(tmp_path, fmus):
    """Write a sweep over levels; return its file."""
    (tmp_path / "moody.py").write_text(UNIT.format(folder=str(tmp_path)), encoding="utf-8")
    fmu = build_component(tmp_path / "moody.py", tmp_path, role="controllers")
    (tmp_path / "pair.yaml").write_text(SCENARIO.format(controller=fmu.name))

    def make(*levels, count=2):
        file = tmp_path / "moods.yaml"
        file.write_text(SWEEP.format(levels=list(levels), count=count))
        return file

    return make


@pytest.fixture
def yawbench(fmus, capfd, tmp_path):
    """Run a sweep into a folder, in one process unless told; return exit status, stdout and stderr."""

    def run(file, out, *arguments):
        if not {"--jobs", "--scheduler"} & {*arguments}:
            arguments = (*arguments, "--jobs", "1")
        with pytest.raises(SystemExit) as end:
            main(["sweep", str(file), "--out", str(tmp_path / out), "--fmus", str(fmus), *arguments])
        told = capfd.readouterr()
        return end.value.code or 0, told.out, told.err

    return run


def rows(folder):
    return pq.read_table(folder / "table.parquet").to_pylist()


def journal(folder):
    return [json.loads(line) for line in (folder / "runs.jsonl").read_text().splitlines()[1:]]


def test_one_row_per_run_with_units_and_figures_and_a_page(moods, yawbench, tmp_path):
    file = moods(10, 40, 60)
    file.write_text(file.read_text() + FIGURES)
    status, out, err = yawbench(file, "out")
    assert status == 0, err
    table = pq.read_table(tmp_path / "out" / "table.parquet")
    assert table.column_names == [
        "run", "level", "amplitude", "status", "reason", "warnings", "moment", "steer", "key",
    ]  # fmt: skip
    units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in table.schema}
    assert units["level"] == units["moment"] == "N.m"
    assert units["amplitude"] == units["steer"] == "rad"
    found = table.to_pylist()
    assert [row["run"] for row in found] == [1, 2, 3, 4, 5, 6]
    assert [row["moment"] for row in found] == pytest.approx([1, 1, 4, 4, 6, 6])
    assert [row["steer"] for row in found] == pytest.approx([row["amplitude"] for row in found], rel=1e-9)
    assert {row["status"] for row in found} == {"completed"}
    about = json.loads(table.schema.metadata[b"experiment"])
    assert about["experiment"]["title"] == "Moods"
    assert len(about["fmus"]) == 2
    assert mentions(out, "N.m", "Calm")
    figures = {path.name for path in (tmp_path / "out" / "figures").iterdir()}
    assert figures == {f"{name}.{kind}" for name in ("curve", "map", "limit") for kind in ("png", "svg")}
    page = html.fromstring(unpacked(tmp_path / "out" / "report.html"))
    assert page.cssselect("h1")[0].text_content() == "Moods"
    assert page.cssselect("figure.chart") == []  # the map and the coordinates show them
    files = page.xpath("//details//li/code/text()")
    assert [one for one in files if one.endswith(".svg")] == [
        f"figures/{name}.svg" for name in ("curve", "map", "limit")
    ]
    assert mentions(page.text_content(), "N.m", "Calm")
    assert len(list(csv.DictReader((tmp_path / "out" / "table.csv").open()))) == 6


def test_a_run_that_fails_is_a_row_with_its_reason_and_is_not_made_again(moods, yawbench, tmp_path):
    file = moods(10, 20)
    status, _, err = yawbench(file, "out")
    assert status == 1
    failed = [row for row in rows(tmp_path / "out") if row["status"] == "failed"]
    assert [row["level"] for row in failed] == [20, 20]
    assert failed[0]["moment"] is None
    assert mentions(
        failed[0]["reason"], "controller", "0.05 s", "ValueError", "controllers/moody.py:32", "twenty"
    )
    assert mentions(err, "20 N.m", "1 deg", "level", "amplitude")
    assert mentions(unpacked(tmp_path / "out" / "report.html"), "20 N.m", "1 deg", "level", "amplitude")
    before = (tmp_path / "out" / "runs.jsonl").read_bytes()
    table = (tmp_path / "out" / "table.parquet").read_bytes()
    status, _, err = yawbench(file, "out")
    assert status == 1
    assert mentions(err, "all finished already")
    assert (tmp_path / "out" / "runs.jsonl").read_bytes() == before
    assert (tmp_path / "out" / "table.parquet").read_bytes() == table


@pytest.mark.parametrize(
    ("code", "again"),
    [
        ("results-unwritable", True),
        ("run-process-died", True),
        ("memory-exhausted", True),
        ("fmu-process-died", False),
    ],
)
def test_what_failed_for_a_reason_of_the_machine_is_made_again(code, again, tmp_path):
    def runner(jobs, done):
        for job in jobs:
            done(Outcome(job, (Diagnostic(code, "why"),), 1))

    resumed = Journal(tmp_path, "a/b.yaml")
    finish([Job("one", tmp_path, tmp_path, key="one")], resumed, runner=runner)
    resumed.close()
    assert len(journal(tmp_path)) == (0 if again else 1)


@pytest.mark.skipif(sys.platform == "win32", reason="--isolate needs Linux or macOS")
@pytest.mark.parametrize("isolated", [(), ("--isolate",)])
def test_a_run_whose_instance_is_killed_is_made_again_on_resuming(isolated, moods, yawbench, tmp_path):
    file = moods(10, 30)
    file.write_text(file.read_text() + "keep: all\n")
    assert yawbench(file, "out", *isolated)[0] == 1
    assert len(journal(tmp_path / "out")) == 2
    assert "4 runs, 2 finished already" in yawbench(file, "out", *isolated)[2]


def test_kept_results_can_be_loaded_in_every_format_and_are_made_once(moods, yawbench, tmp_path):
    file = moods(10)
    file.write_text(file.read_text() + "keep: none\n")
    yawbench(file, "out")
    assert not (tmp_path / "out" / "runs").exists()
    assert "finished already" not in yawbench(file, "out", "--keep", "--format", "parquet")[2]
    results = load_results(tmp_path / "out" / "runs" / rows(tmp_path / "out")[1]["key"][:12])
    assert results.file.name == "results.parquet"
    assert results["controller.yaw_moment"][-1] == pytest.approx(1.0)
    assert mentions(yawbench(file, "out", "--keep")[2], "all finished already")
    more = moods(5, 10)  # what was the first run is the third now
    assert mentions(yawbench(more, "out", "--keep")[2], "4 runs", "2", "finished")
    kept = [load_results(tmp_path / "out" / "runs" / row["key"][:12]) for row in rows(tmp_path / "out")]
    assert [run["controller.yaw_moment"][-1] for run in kept] == pytest.approx([0.5, 0.5, 1.0, 1.0])


def kept_levels(folder) -> set[float]:
    """Return the levels of the runs that have results."""
    return {
        row["level"] for row in rows(folder) if (folder / "runs" / row["key"][:12] / "run.json").is_file()
    }


@pytest.mark.parametrize(
    ("keep", "levels", "expected"),
    [
        ("", (1, 2, 20, 45), {2, 20}),  # twenty fails
        pytest.param(  # the last within the limit, the first beyond
            "limits", (10, 33, 38, 45), {33, 38}, marks=pytest.mark.exhaustive
        ),
        pytest.param("all", (10, 33), {10, 33}, marks=pytest.mark.exhaustive),
    ],
)
def test_results_are_kept_beside_limits_and_of_failed_runs_or_of_all(
    keep, levels, expected, moods, yawbench, tmp_path
):
    file = moods(*levels, count=2)
    file.write_text(file.read_text() + f"keep: {keep}\n" * bool(keep))
    yawbench(file, "out")
    assert kept_levels(tmp_path / "out") == expected
    before = journal(tmp_path / "out")
    assert len(before) == 2 * len(levels)  # what is made again to keep it is not counted again
    made = {path: path.stat().st_mtime_ns for path in (tmp_path / "out" / "runs").rglob("run.json")}
    assert "results to keep" not in yawbench(file, "out")[2]
    assert {path: path.stat().st_mtime_ns for path in made} == made
    missing = next(path for path in made if json.loads(path.read_text())["status"] == "completed")
    missing.unlink()
    yawbench(file, "out")
    assert missing.is_file()


def interrupted(file, out, fmus, tmp_path, number):
    """Start a sweep in a process, stop it by a signal once its slow runs have begun; return its stderr."""
    os.mkfifo(tmp_path / "slow")
    command = [sys.executable, "-m", "yawbench", "sweep", str(file), "--out", str(tmp_path / out)]
    process = subprocess.Popen(
        [*command, "--fmus", str(fmus), "--jobs", "1"], stderr=subprocess.PIPE, text=True
    )
    assert mentions((tmp_path / "slow").read_text(), "it has begun")
    process.send_signal(number)
    told = process.communicate()[1]
    (tmp_path / "slow").unlink()
    return process.returncode, told


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
@pytest.mark.sampled(1)
def test_a_sweep_that_was_stopped_goes_on_where_it_was(number, moods, yawbench, fmus, tmp_path):
    file = moods(5, 60)
    status, told = interrupted(file, "out", fmus, tmp_path, number)
    assert status == (-number if number == signal.SIGKILL else 128 + number)
    if number != signal.SIGKILL:
        assert mentions(told, "out", "results")
    before = journal(tmp_path / "out")
    assert len(before) == 2
    status, _, told = yawbench(file, "out")
    assert status == 0
    assert mentions(told, "4 runs", "2", "finished")
    after = journal(tmp_path / "out")
    assert after[:2] == before
    assert len({entry["key"] for entry in after}) == len(after) == 4
    yawbench(file, "whole")
    assert (tmp_path / "out" / "table.parquet").read_bytes() == (
        tmp_path / "whole" / "table.parquet"
    ).read_bytes()


def test_a_folder_of_another_sweep_is_refused(moods, yawbench, tmp_path):
    file = moods(10)
    Journal(tmp_path / "out", f"{tmp_path.name}/other.yaml").close()
    status, _, err = yawbench(file, "out")
    assert status == 2
    assert mentions(err, "out", "other.yaml")
    assert yawbench(file, "out", "--fresh")[0] == 0


SPIN = Diagnostic("car-spins", "the car spins", "warning", Location(signal="plant.sideslip", time=1.0), 90.0)
FAILED = (Diagnostic("run-failed", "plant: step failed"), Diagnostic("file-missing", "/home/\udcff: missing"))
RECORDS = {
    "one": MeasuredRun({"slip": (0.0302, "rad"), "moment": (12.0, "N.m")}, (SPIN,), ended="early"),
    "two": MeasuredRun({"slip": None, "moment": (float("inf"), "N.m")}, (SPIN,)),
    "three": MeasuredRun({}, FAILED),
}


def noted(folder, **records):
    """Add records to the journal of a folder; return all that it has then."""
    made = Journal(folder, "a/b.yaml")
    for key, record in records.items():
        made.add(key, record)
    made.close()
    return made.records


@pytest.mark.parametrize(
    ("key", "old", "new"),
    [
        ("three", "}]}\n", "}]"),  # a kill has cut the line off
        ("one", "0.0302", '"7.5"'),
        ("one", "0.0302", "true"),
        ("one", "0.0302", "[" * 5000 + "]" * 5000),
        ("one", '"key": "one", ', '"key": "one", "findings": ["spin"], '),
        ("one", '"key": "one"', '"key: "one"'),
    ],
)
def test_the_run_of_a_damaged_line_of_a_journal_is_made_again(key, old, new, tmp_path):
    noted(tmp_path, **RECORDS)
    assert noted(tmp_path) == RECORDS
    before, found, after = (tmp_path / "runs.jsonl").read_text().rpartition(old)
    assert found
    (tmp_path / "runs.jsonl").write_text(before + new + after)
    assert noted(tmp_path) == {name: record for name, record in RECORDS.items() if name != key}
    noted(tmp_path, **{key: RECORDS[key]})
    assert noted(tmp_path) == RECORDS


@pytest.mark.parametrize("head", ["nonsense", '{"sweep": "a/b.yaml", "format": 1}'])
def test_what_is_no_journal_of_this_version_is_refused_and_kept(head, tmp_path):
    (tmp_path / "runs.jsonl").write_text(f"{head}\n")
    with refused(ResultsError, "results-of-another", names=("--out", "--fresh", "version")):
        Journal(tmp_path, "a/b.yaml")
    assert (tmp_path / "runs.jsonl").read_text() == f"{head}\n"


def test_runs_that_were_never_made_are_not_called_failed(moods, yawbench, tmp_path):
    file = moods(1, 20)
    status, out, said = yawbench(file, "out", "--no-run")
    assert status == 1
    assert mentions(said, "4 runs")
    assert "failed" not in out + said
    assert "failed" not in (tmp_path / "out" / "table.csv").read_text()
    assert [row["status"] for row in csv.DictReader((tmp_path / "out/table.csv").open())] == ["not made"] * 4
    assert "unknown (1.00 not made)" in out  # the limit's table: from where on nothing is known
    body = html.fromstring(unpacked(tmp_path / "out" / "report.html")).body
    words = " ".join(" ".join(body.xpath(".//text()[not(ancestor::script or ancestor::style)]")).split())
    assert mentions(words, "4 runs")
    assert "failed" not in words
    assert yawbench(file, "out")[0] == 1  # twenty is too much
    status, out, said = yawbench(file, "out", "--no-run")
    assert (status, "not made" in out + said) == (1, False)
    assert "level 20" in said
    assert "failed: controller" in said


@pytest.mark.skipif(sys.platform == "win32", reason="--isolate needs Linux or macOS")
def test_a_run_that_hangs_in_isolation_is_a_row_that_names_the_unit(moods, yawbench, tmp_path):
    assert yawbench(moods(10, 35), "out", "--isolate", "--call-limit", "500 ms")[0] == 1
    calm, hung = rows(tmp_path / "out")[::2]
    assert calm["reason"] is None
    assert mentions(hung["reason"], "controller", "0.5 s")


def test_the_table_is_the_same_to_the_byte_however_many_workers(moods, yawbench, tmp_path):
    file = moods(5, 20)
    for workers in "13":
        assert yawbench(file, workers, "--jobs", workers)[0] == 1  # level 20 fails
    one, three = ((tmp_path / workers / "table.parquet").read_bytes() for workers in "13")
    assert one == three

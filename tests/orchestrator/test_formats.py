"""Results as Parquet: the same numbers, to the bit, as from CSV; with units."""

from __future__ import annotations

import json
import math
import sys

import pyarrow.parquet as pq
import pytest

from tests.command_line import status_of
from tests.orchestrator.fakes import Clock, Function, Stage, make_plan
from tests.orchestrator.recorded import car, record_text, write
from tests.refusals import each_mentions, mentions, refused
from yawbench.foundation.errors import ResultsError, SimulationError, YawbenchError
from yawbench.orchestrator.master.simulate import simulate, simulate_in_memory
from yawbench.orchestrator.results import parquet
from yawbench.orchestrator.results.file_formats import FILES
from yawbench.orchestrator.results.reader import load_results
from yawbench.orchestrator.results.recorder import BLOCK, MemoryRecorder, recorder_of
from yawbench.orchestrator.results.run_record import RunRecord

COLUMNS = ["a.n", "a.x", "a.s", "a.y", "a.b"]
REAL = [False, True, False, True, False]
OF_MEASUREMENT = {"time": "s", "a.x": "rad/s", "a.y": "N.m", "a.n": None}
OTHERS = [name for name in FILES if name != "csv"]


def fill(writer, rows):
    """Give a recorder rows of all types, with every kind of float."""
    odd = [0.1, -0.0, math.inf, -math.inf, math.nan, 5e-324, 1.7976931348623157e308, 1 / 3]
    for begin in range(0, rows, BLOCK):
        count = min(BLOCK, rows - begin)
        for k in range(count):
            i = begin + k
            writer.rows[k][:] = [0.001 * i, odd[i % len(odd)], -math.pi * i]
            writer.others.append([i - 3, "trocken" if i % 2 else "naß", i % 3 == 0])
        writer.write(count)


def record(folder, rows, name):
    writer = recorder_of(name)(folder, COLUMNS, REAL, OF_MEASUREMENT)
    fill(writer, rows)
    units = {k: OF_MEASUREMENT.get(k) for k in ("time", *COLUMNS)}
    started = "2024-01-02T03:04:05+00:00"
    writer.finish(RunRecord(status="completed", title="Sine", started=started, units=units, texts=["a.s"]))
    writer.close()
    return load_results(folder)


def alike(one, other):
    assert list(one) == list(other)
    assert one.time.tobytes() == other.time.tobytes()
    for column in one:
        assert one[column].dtype == other[column].dtype
        assert one[column].tobytes() == other[column].tobytes()
    assert one.units == other.units


@pytest.mark.parametrize("name", OTHERS)
@pytest.mark.parametrize("rows", [0, 1, BLOCK, 2 * BLOCK + 7])
def test_every_format_reads_back_as_csv_does_to_the_last_bit(rows, name, tmp_path):
    expected = record(tmp_path / "csv", rows, "csv")
    found = record(tmp_path / name, rows, name)
    alike(found, expected)
    assert sorted(p.name for p in (tmp_path / name).iterdir()) == sorted([FILES[name], "run.json"])


def test_results_in_memory_are_those_on_disk(tmp_path):
    expected = record(tmp_path, 700, "csv")
    memory = MemoryRecorder(COLUMNS, REAL, OF_MEASUREMENT)
    seen = []
    memory.looks.append(lambda rows: seen.append(len(rows)))
    fill(memory, 700)
    run = RunRecord(status="completed")
    memory.finish(run)
    run.units_freed = True
    memory.close(run)
    alike(memory.results, expected)
    said = memory.results.record
    assert (said.status, said.rows, said.units_freed) == ("completed", 700, True)
    for end in ("smallest", "largest"):
        expected_of = getattr(expected.record, end)
        assert getattr(said, end) == {name: float(value) for name, value in expected_of.items()}
    assert seen == [BLOCK, 700 - BLOCK]


def test_parquet_files_carry_units_and_row_groups(tmp_path, monkeypatch):
    monkeypatch.setattr(parquet.ParquetRecorder, "CHUNK", BLOCK)
    record(tmp_path, 3 * BLOCK + 1, "parquet")
    file = pq.ParquetFile(tmp_path / "results.parquet")
    units = {field.name: field.metadata[b"unit"].decode() for field in file.schema_arrow}
    assert units == {"time": "s", "a.n": "", "a.x": "rad/s", "a.s": "", "a.y": "N.m", "a.b": ""}
    assert [str(field.type) for field in file.schema_arrow] == [
        "double", "int64", "double", "string", "double", "bool",
    ]  # fmt: skip
    assert file.metadata.num_row_groups == 4


@pytest.mark.parametrize("name", OTHERS)
def test_results_of_another_format_are_replaced_as_a_whole(name, tmp_path):
    record(tmp_path, 5, name)
    assert len(record(tmp_path, 7, "csv").time) == 7
    assert not (tmp_path / FILES[name]).exists()
    record(tmp_path, 9, name)
    assert not (tmp_path / "results.csv").exists()
    assert len(load_results(tmp_path).time) == 9


def units(fail_at=math.inf):
    """A unit that puts out sin(t), and from some time [s] on what stops the run."""
    return {
        "a": Clock(y=lambda t: math.sin(t) if t < fail_at else math.nan),
        "b": Function(lambda t, u: {"z": u["y"]}, ["y"], ["z"]),
    }


def plan(n_steps=1200):
    return make_plan(units(), ["a.y -> b.y"], step="1/1000", n_steps=n_steps)


@pytest.mark.parametrize("name", ["csv", *OTHERS])
def test_a_run_writes_the_format_that_it_is_told(name, tmp_path):
    simulate(plan(), tmp_path, opener=Stage(units()), format=name)
    found = load_results(tmp_path)
    assert found.file == tmp_path / FILES[name]
    assert len(found.time) == 1201
    alike(found, simulate_in_memory(plan(), opener=Stage(units())))


@pytest.mark.parametrize("name", OTHERS)
def test_a_run_that_fails_keeps_what_it_has_recorded(name, tmp_path):
    with refused(SimulationError, "value-not-finite") as error:
        simulate(plan(), tmp_path, opener=Stage(units(fail_at=0.9)), format=name)
    assert mentions(str(error.value.diagnostics[1]), "recorded")
    found = load_results(tmp_path)
    assert (found.record.status, found.time[-1]) == ("failed", 0.899)


def test_a_run_in_memory_that_fails_says_nothing_of_files():
    with refused(SimulationError, names=("a:", "0.9 s", "a.y", "b.y", "y")):
        simulate_in_memory(plan(), opener=Stage(units(fail_at=0.9)))


@pytest.mark.skipif(sys.platform == "win32", reason="needs a limit on the size of files")
@pytest.mark.parametrize("name", OTHERS)
def test_a_disk_without_room_is_one_sentence_and_keeps_the_earlier_results(name, tmp_path, monkeypatch):
    import resource

    monkeypatch.setattr(parquet.ParquetRecorder, "CHUNK", BLOCK)
    simulate(plan(50), tmp_path, opener=Stage(units()), format=name)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (9_000, limits[1]))
    try:
        with pytest.raises(YawbenchError) as caught:
            simulate(plan(), tmp_path, opener=Stage(units()), format=name)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert caught.value.code == "results-unwritable"
    assert mentions(str(caught.value.diagnostics[0]), "File", "large")
    assert "rows that fit" not in str(caught.value)
    assert "recorded until" not in str(caught.value)
    assert len(load_results(tmp_path).time) == 51
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([FILES[name], "run.json"])


@pytest.mark.parametrize("name", OTHERS)
def test_damaged_files_are_one_sentence(name, tmp_path):
    record(tmp_path, 20, name)
    (tmp_path / FILES[name]).write_bytes(b"neither one nor the other")
    with refused(ResultsError, "results-unreadable", names=(tmp_path / FILES[name],)) as error:
        load_results(tmp_path)
    assert "\n" not in str(error.value)
    (tmp_path / FILES[name]).unlink()
    with refused(ResultsError, "results-missing", names=("run.json", f"results.{name}")):
        load_results(tmp_path)


def test_a_record_that_names_another_file_is_refused(tmp_path):
    folder = write(car(n=5), tmp_path / "run")
    run = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(record_text({**run, "results": "../secret.csv"}))
    names = ("run.json", "'../secret.csv'", *FILES.values())
    with refused(ResultsError, "results-unreadable", names=names):
        load_results(folder)


UNITS = ("driver_sine",)
SCENARIO = """
title: A driver alone
stop_time: 1
step_size: 0.01
units:
  driver: {fmu: driver_sine, parameters: {amplitude: 0.1, frequency: 1, start_time: 0}}
"""


def test_run_writes_the_format_it_is_told_and_prints_metrics(fmus, tmp_path, capsys):
    (tmp_path / "alone.yaml").write_text(SCENARIO)
    common = (tmp_path / "alone.yaml", "--fmus", fmus, "--format", "parquet")
    assert status_of("run", *common, "--out", tmp_path / "run", "--metric", "peak(steer_angle)") == 0
    told = capsys.readouterr().out
    assert mentions(told, "Steer", "angle", "peak")
    assert "5.73 °" in told
    assert load_results(tmp_path / "run").file.name == "results.parquet"


@pytest.mark.parametrize(
    ("option", "value", "names"),
    [
        ("format", "hdf5", ("--format hdf5", *FILES)),
        ("metric", "peek(sideslip)", ("'peek(sideslip)'", "'peek'", "'peak'")),
        ("metric", "peak(steer_angel)", ("peak(steer_angel)", "'steer_angel'", "'steer_angle'")),
        ("metric", "rms_error(steer_angle)", ("rms_error(steer_angle)", "reference", "unit")),
        ("metric", "rms(steer_angle - driver.steer)", ("'driver.steer'", "'driver.steer_angle'")),
    ],
)
def test_a_format_or_a_metric_that_there_is_not_is_said_before_the_run(
    option, value, names, fmus, tmp_path, capsys
):
    (tmp_path / "alone.yaml").write_text(SCENARIO)
    more = ("--metric", "standard", f"--{option}", value)
    assert status_of("run", tmp_path / "alone.yaml", "--fmus", fmus, "--out", tmp_path / "out", *more) == 2
    assert each_mentions(capsys.readouterr().err, names)
    assert not (tmp_path / "out").exists()

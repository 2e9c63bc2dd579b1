import csv
import errno
import json
import math
import os
import shutil
import sys

import numpy as np
import pytest

from tests.orchestrator.fakes import Clock, Function, Stage, make_plan
from tests.refusals import each_mentions, mentions, refused, texts_of
from yawbench.foundation.errors import ResultsError, SimulationError
from yawbench.foundation.safe_files import write_whole
from yawbench.orchestrator.master.simulate import simulate
from yawbench.orchestrator.results import file_formats
from yawbench.orchestrator.results import recorder as module
from yawbench.orchestrator.results.reader import load_results
from yawbench.orchestrator.results.recorder import BLOCK, Recorder, recorder_of
from yawbench.orchestrator.results.run_record import RunRecord
from yawbench.orchestrator.results.salvage import salvage


def record(folder, table, *, columns=None, real=None, others=None, run=None):
    """Write a table (first column time) as a run does."""
    columns = columns or [f"unit.v{i}" for i in range(1, table.shape[1])]
    writer = Recorder(folder, columns, real or [True] * len(columns))
    for begin in range(0, len(table), BLOCK):
        block = table[begin : begin + BLOCK]
        for row, values in zip(writer.rows, block, strict=False):
            row[:] = values
        writer.others.extend(others[begin : begin + BLOCK] if others else [])
        writer.write(len(block))
    writer.finish(RunRecord.model_validate({"status": "completed", "units": {}, **(run or {})}))
    writer.close()


def table(rows, columns=3):
    values = np.random.default_rng(1).standard_normal((rows, columns)) * 10.0 ** np.arange(
        -8, 4 * columns - 8, 4
    )
    values[:, 0].sort()  # time
    return values


@pytest.mark.parametrize("rows", [1, BLOCK, BLOCK + 1])
def test_numbers_are_read_back_to_the_last_bit(rows, tmp_path):
    values = table(rows)
    record(tmp_path, values)
    results = load_results(tmp_path)
    assert results.time.tolist() == values[:, 0].tolist()
    assert [column.tolist() for column in results.columns.values()] == values[:, 1:].T.tolist()


def hard_numbers():
    """Numbers around every boundary that matters to their shortest decimals, and of all magnitudes."""
    powers = np.concatenate([2.0 ** np.arange(-1074, 1024), 10.0 ** np.arange(-323, 309)])
    near = [np.nextafter(powers, 0.0), powers, np.nextafter(powers, math.inf)]
    generator = np.random.default_rng(1)
    bits = generator.integers(0, 2**64, 60_000, dtype=np.uint64).view(float)
    round_ones = np.round(generator.uniform(-1e4, 1e4, 10_000), 3)
    whole = generator.integers(-(10**17), 10**17, 10_000).astype(float)
    special = [0.0, -0.0, math.nan, -math.nan, math.inf, -math.inf, 9.5e15, 1e16, 1e-4, 9.9e-5, 2.0**53 + 2]
    return np.concatenate([*near, *(-one for one in near), bits, round_ones, whole, special])


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
def test_numbers_are_written_as_python_writes_them():
    numbers = hard_numbers()
    numbers = numbers[: len(numbers) // 3 * 3].reshape(-1, 3)
    assert file_formats._writer() is not None
    text = file_formats.rows_text(numbers).decode()
    assert text.splitlines() == [",".join(map(repr, row)) for row in numbers.tolist()]


def test_without_a_compiler_the_bytes_are_the_same(tmp_path, monkeypatch):
    record(tmp_path / "c", table(100))
    monkeypatch.setattr(file_formats, "_writer", lambda: None)
    record(tmp_path / "python", table(100))
    assert (tmp_path / "c" / "results.csv").read_bytes() == (tmp_path / "python" / "results.csv").read_bytes()


def test_the_file_is_a_plain_csv_with_a_header(tmp_path):
    record(tmp_path, np.array([[0.0, 1.5, -2e-9], [0.001, math.inf, math.nan]]))
    assert (tmp_path / "results.csv").read_bytes() == (
        b"time,unit.v1,unit.v2\n0.0,1.5,-2e-09\n0.001,inf,nan\n"
    )


def test_names_with_commas_and_quotes_are_quoted(tmp_path):
    names = ["unit.matrix[1,2]", 'unit."odd"', "unit.Ümläut"]
    record(tmp_path, np.array([[0.0, 1.0, 2.0, 3.0]]), columns=names)
    with (tmp_path / "results.csv").open(encoding="utf-8", newline="") as stream:
        assert next(csv.reader(stream)) == ["time", *names]
    assert [float(c[0]) for c in load_results(tmp_path).columns.values()] == [1.0, 2.0, 3.0]


def test_columns_keep_their_order_when_some_are_no_reals(tmp_path):
    columns, real = ["a.n", "a.x", "a.s", "a.y", "a.b"], [False, True, False, True, False]
    others = [[7, 'say "ä",\nthen stop', True]]
    row, run = np.array([[0.0, 1.0, 2.0]]), {"texts": ["a.s"]}
    record(tmp_path, row, columns=columns, real=real, others=others, run=run)
    results = load_results(tmp_path)
    assert {name: column[0] for name, column in results.columns.items()} == {
        "a.n": 7, "a.x": 1.0, "a.s": 'say "ä",\nthen stop', "a.y": 2.0, "a.b": 1,
    }  # fmt: skip


def test_the_record_may_hold_numbers_that_json_does_not_know(tmp_path):
    record(tmp_path, table(2), run={"error": {"inputs": {"x": math.nan, "y": -math.inf, "n": np.float64(2)}}})
    read = json.loads((tmp_path / "run.json").read_text(), parse_constant=pytest.fail)
    assert read["error"]["inputs"] == {"x": "nan", "y": "-inf", "n": 2.0}


def test_earlier_results_stay_until_the_new_ones_are_whole(tmp_path):
    record(tmp_path, table(3), run={"title": "first"})
    writer = Recorder(tmp_path, ["a.x"], [True])
    writer.rows[0][:] = 1.0
    writer.write(1)
    assert load_results(tmp_path).record.title == "first"
    assert len(load_results(tmp_path).time) == 3
    writer.finish(RunRecord(status="completed", title="second", units={}))
    writer.close()
    assert load_results(tmp_path).record.title == "second"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["results.csv", "run.json"]


def test_a_path_that_is_no_utf_8_does_not_cost_the_results(tmp_path):
    record(tmp_path, table(3), run={"scenario": {"file": os.fsdecode(b"sin\xe9.yaml")}})
    assert load_results(tmp_path).record.scenario["file"] == "sin\udce9.yaml"


def no_space(*args, **kwargs):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_disk_that_is_full_from_the_start_is_one_sentence(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "write_whole", no_space)
    units = {"a": Clock(x=math.sin)}
    stage = Stage(units)
    with refused(ResultsError, "results-unwritable"):
        simulate(make_plan(units), tmp_path, opener=stage)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="needs a limit on the size of files")
def test_a_disk_that_fills_up_keeps_whole_rows_and_says_so(tmp_path):
    import resource

    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    units = {"a": Clock(x=math.sin, y=math.cos)}
    stage = Stage(units)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, limits[1]))
    try:
        with pytest.raises(SimulationError) as caught:
            simulate(make_plan(units, step="1/1000", n_steps=3000), tmp_path, opener=stage)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    results = load_results(tmp_path)
    assert mentions(caught.value, "results.csv", "1.535 s")
    assert 49_900 < (tmp_path / "results.csv").stat().st_size <= 50_000
    assert results.record.status == "failed"
    assert results.record.rows == len(results.time) > 500
    np.testing.assert_allclose(results["a.y"], np.cos(results.time), atol=1e-15)
    assert stage.slaves["a"].freed == 1


def test_a_run_whose_record_did_not_fit_is_salvaged_with_every_row(tmp_path, monkeypatch):
    record(tmp_path, table(2 * BLOCK), run={"title": "first"})
    answers = iter([write_whole, no_space])  # the first is of the record that says that the run has begun
    units = {"a": Clock(x=math.sin)}
    names = ("disk", "'yawbench salvage")
    with monkeypatch.context() as patched:
        patched.setattr(module, "write_whole", lambda *args: next(answers, write_whole)(*args))
        with refused(SimulationError, "results-unwritable", names=names) as caught:
            simulate(make_plan(units, step="1/1000", n_steps=1300), tmp_path, opener=Stage(units))
    assert caught.value.exit_status == 1
    with refused(ResultsError, "run-died"):
        load_results(tmp_path)
    assert salvage(tmp_path) == (tmp_path / "failed", 1301)
    assert len(load_results(tmp_path / "failed").time) == 1301
    assert load_results(tmp_path).record.title == "first"


def _truncated(file):
    os.truncate(file, 0)


def _lengthened(file):
    with file.open("ab") as stream:
        stream.write(b"1.0,2.0\n" * 20 * BLOCK)


@pytest.mark.skipif(sys.platform == "win32", reason="open files cannot be removed")
@pytest.mark.parametrize(
    ("format", "change"),
    [
        *(("csv", change) for change in (os.unlink, _truncated, _lengthened)),
        *(("parquet", change) for change in (os.unlink, _lengthened)),  # which is empty until the end
    ],
)
def test_a_file_of_results_that_something_else_changes_during_the_run_fails_it(
    format, change, tmp_path, monkeypatch
):
    monkeypatch.setattr(recorder_of("parquet"), "CHUNK", BLOCK)
    file = tmp_path / f"{file_formats.FILES[format]}.part"
    times = []

    def course(time):
        times.append(time)
        if len(times) == 1100:  # after the first blocks
            change(file)
        return time

    units = {"a": Clock(x=course)}
    with refused(SimulationError, "results-unwritable", names=(file.name,)) as caught:
        simulate(make_plan(units, step="1/1000", n_steps=2000), tmp_path, opener=Stage(units), format=format)
    assert caught.value.exit_status == 1
    with refused(ResultsError, "results-missing"):
        load_results(tmp_path)


def test_a_run_that_did_not_record_every_row_has_failed(tmp_path, monkeypatch):
    plain = Recorder.write
    monkeypatch.setattr(Recorder, "write", lambda self, count: plain(self, count) if count == BLOCK else None)
    units = {"a": Clock(x=math.sin)}
    with refused(SimulationError, "results-unwritable", names=(f"{BLOCK} of 801 rows",)):
        simulate(make_plan(units, step="1/1000", n_steps=800), tmp_path, opener=Stage(units))
    assert load_results(tmp_path).record.status == "failed"


def test_memory_that_does_not_suffice_is_one_sentence(tmp_path):
    def greedy(time):
        if time > 0.5:
            raise MemoryError
        return time

    units = {"a": Clock(x=greedy)}
    with refused(SimulationError, "memory-exhausted"):
        simulate(make_plan(units, step="1/100", n_steps=100), tmp_path, opener=Stage(units))
    assert load_results(tmp_path).record.status == "failed"


def test_earlier_results_stay_if_the_record_cannot_be_written_at_all(tmp_path, monkeypatch):
    record(tmp_path, table(3), run={"title": "first"})
    monkeypatch.setattr(module, "write_whole", no_space)
    with refused(ResultsError, "results-unwritable"):
        record(tmp_path, table(5), run={"title": "second"})
    assert load_results(tmp_path).record.title == "first"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["results.csv", "run.json"]


def test_a_failure_that_cannot_be_recorded_says_both(tmp_path, monkeypatch):
    answers = iter([write_whole])  # of the record that says that the run has begun
    monkeypatch.setattr(module, "write_whole", lambda *args: next(answers, no_space)(*args))
    units = {"a": Clock(x=lambda t: math.nan), "b": Function(lambda t, u: {"y": u["x"]}, ["x"], ["y"])}
    with pytest.raises(SimulationError) as caught:
        simulate(make_plan(units, ["a.x -> b.x"]), tmp_path / "out", opener=Stage(units))
    assert each_mentions(texts_of(caught.value), ("a:", "0 s", "a.x", "b.x", "x"), ("out", "results", "disk"))
    with refused(ResultsError, "run-died"):
        load_results(tmp_path / "out")

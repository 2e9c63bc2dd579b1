import json

import numpy as np
import pytest

from tests.refusals import refused
from yawbench.foundation.errors import ResultsError
from yawbench.orchestrator.results import reader
from yawbench.orchestrator.results.file_formats import BLOCK, CsvFile
from yawbench.orchestrator.results.reader import load_results
from yawbench.orchestrator.results.run_record import check_record

RUN = {
    "status": "completed",
    "texts": ["car.mode"],
    "units": {"time": "s", "car.yaw_rate": "rad/s", "car.mode": None, "ecu.yaw_moment": "N.m"},
    "fmus": {
        "car": {"name": "plant_seven_dof"},
        "ecu": {"name": "controller_fnn"},
        "wheel_control": {"name": "wheel_control_direct"},
        "tyre": {"name": "my_own"},
    },
}
CSV = """time,car.yaw_rate,ecu.yaw_moment,car.mode,ecu.yaw_rate_error
0.0,0.25,-5.0,dry,1.0
0.001,0.5,-6.0,wet,2.0
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "run.json").write_text(json.dumps(RUN))
    (tmp_path / "results.csv").write_text(CSV)
    return tmp_path


def test_columns_are_arrays_by_their_full_names(folder):
    results = load_results(folder)
    assert results.time.tolist() == [0.0, 0.001]
    assert results["car.yaw_rate"].tolist() == [0.25, 0.5]
    assert results["car.mode"].tolist() == ["dry", "wet"]
    assert list(results) == ["car.yaw_rate", "ecu.yaw_moment", "car.mode", "ecu.yaw_rate_error"]
    assert "car.yaw_rate" in results
    assert "car.roll" not in results
    assert results.units == {
        "time": "s", "car.yaw_rate": "rad/s", "ecu.yaw_moment": "N.m", "car.mode": "",
        "ecu.yaw_rate_error": "",
    }  # fmt: skip


def test_a_variable_is_found_whatever_its_unit_is_called(folder):
    results = load_results(folder)
    assert results.find("yaw_rate").tolist() == [0.25, 0.5]
    assert results.column("yaw_moment") == "ecu.yaw_moment"
    assert results.column("ecu.yaw_moment") == "ecu.yaw_moment"


def test_a_role_is_that_of_the_fmu_s_name_else_of_the_unit_s(folder):
    results = load_results(folder)
    assert results.instances_of_role("plant") == ["car"]
    assert results.instances_of_role("controller") == ["ecu"]
    assert results.instances_of_role("tyre") == ["tyre"]
    assert results.instances_of_role("driver") == []
    assert results.column("yaw_rate", role="plant") == "car.yaw_rate"


def test_a_recorded_role_comes_before_the_names(folder):
    fmus = {"car": {"name": "body"}, "ecu": {"name": "plant_of_ours", "role": "controller"}}
    fmus["car"]["role"] = "plant"
    (folder / "run.json").write_text(json.dumps({**RUN, "fmus": fmus}))
    results = load_results(folder)
    assert results.instances_of_role("plant") == ["car"]
    assert results.instances_of_role("controller") == ["ecu"]


def test_a_variable_of_two_units_is_ambiguous_until_a_role_is_given(folder):
    (folder / "results.csv").write_text("time,car.yaw_rate,ecu.yaw_rate\n0.0,1.0,2.0\n")
    results = load_results(folder)
    names = ("results.csv", "'yaw_rate'", "car.yaw_rate", "ecu.yaw_rate")
    with refused(ResultsError, "signal-ambiguous", names=names):
        results.find("yaw_rate")
    assert results.find("yaw_rate", role="controller").tolist() == [2.0]


def test_an_unknown_column_suggests_the_likely_one(folder):
    with refused(ResultsError, "signal-unknown", names=("results.csv", "'car.yawrate'", "'car.yaw_rate'")):
        load_results(folder)["car.yawrate"]
    with refused(ResultsError, "signal-unknown", names=("results.csv", "'yaw_rate'")):
        load_results(folder).find("yaw_rate", role="driver")


def test_results_without_rows_have_empty_columns(folder):
    (folder / "results.csv").write_text("time,car.yaw_rate\n")
    results = load_results(folder)
    assert results.time.shape == results["car.yaw_rate"].shape == (0,)


def record(**changes):
    """Return the text of a run record with other values."""
    return json.dumps({**RUN, **changes})


@pytest.mark.parametrize(
    ("file", "text", "names"),
    [
        ("run.json", None, ("run.json", "yawbench run")),
        ("run.json", "{", ("run.json",)),
        ("run.json", "[]", ("run.json", "record")),
        ("run.json", record(rows="many"), ("run.json", "rows", "'many'")),
        ("run.json", record(rows=-1), ("run.json", "rows", "0", "-1")),
        ("run.json", record(units=["s"]), ("run.json", "units", "['s']")),
        ("run.json", record(fmus={"car": "plant"}), ("run.json", "fmus.car", "'plant'")),
        ("run.json", record(status=1, rows="x"), ("run.json", "status", "(got 1)", "1 more")),
        ("run.json", record(scenario={"units": {"plant": "x"}}), ("record", "scenario.units.plant")),
        ("run.json", record(scenario={"units": ["plant"]}), ("record", "scenario.units")),
        (
            "run.json", record(scenario={"units": {"plant": {"parameters": ["mass"]}}}),
            ("record", "scenario.units.plant.parameters"),
        ),
        ("run.json", record(scenario={"vehicle_parameters": 5}), ("record", "scenario.vehicle_parameters")),
        ("run.json", record(scenario=["units"]), ("record", "scenario")),
        ("results.csv", None, ("results.csv", "run.json")),
        ("results.csv", "", ("results.csv", "'time'")),
        ("results.csv", "time,a.x\n0.0,1.0\n0.1\n", ("results.csv", "2 columns", "got 1")),
        ("results.csv", "time,a.x\n0.0,1.0,2.0\n", ("2 columns", "got 3")),
        ("results.csv", "time,a.x,a.x\n0.0,1.0,2.0\n", ("column", "'a.x'")),
        ("results.csv", "time,a.x\n0.0,1.0\n0.0,1.0\n", ("row 2", "time 0 s", "0 s")),
        ("results.csv", "time,a.x\n0.1,1.0\n0.0,1.0\n", ("row 2", "time 0 s", "0.1 s")),
        ("results.csv", "time,a.x\nnan,1.0\n", ("row 1", "time nan s")),
        ("results.csv", "time,a.x\n0.0,1.0\n0.1,wet\n", ("'wet'",)),
        ("results.csv", "time,a.x\n0.0,1.0\n0.1,\n", ("''",)),
        ("results.csv", "time,a.x\nnoon,1.0\n", ("'noon'",)),
    ],
)  # fmt: skip
def test_missing_and_broken_files_are_one_sentence(folder, file, text, names):
    if text is None:
        (folder / file).unlink()
    else:
        (folder / file).write_text(text)
    code = "results-missing" if text is None else "results-unreadable"
    with refused(ResultsError, code, names=(*names, file) if text else names) as caught:
        load_results(folder)
    assert len(caught.value.diagnostics) == 1


def test_a_file_of_results_that_was_cut_off_or_edited_is_refused(folder):
    (folder / "run.json").write_text(json.dumps({**RUN, "size": len(CSV)}))
    assert len(load_results(folder).time) == 2
    for other in (CSV[:-2], CSV.replace("0.5", "0.55")):
        (folder / "results.csv").write_text(other)
        with refused(
            ResultsError, "results-changed", names=("results.csv", "run.json", len(CSV), len(other))
        ):
            load_results(folder)


def test_names_may_go_over_lines(folder):
    (folder / "results.csv").write_text('time,"a.long\nname",a.x\n0.0,1.0,2.0\n')
    assert load_results(folder)["a.long\nname"].tolist() == [1.0]


def test_only_chosen_columns_are_read(folder):
    results = load_results(folder, only=lambda all_: [name for name in all_ if name.startswith("ecu")])
    assert list(results) == ["ecu.yaw_moment", "ecu.yaw_rate_error"]
    assert results["ecu.yaw_moment"].tolist() == [-5.0, -6.0]


def test_a_long_run_is_thinned_to_rows_that_hold_every_peak(folder, monkeypatch):
    rows = 40_000
    time = np.arange(rows) / 1000
    noise = np.random.default_rng(2)
    signal = np.sin(time) + 1e-3 * noise.standard_normal(rows)
    signal[[1234, 30_001]] = 5.0, -7.0
    reference = signal.copy()
    reference[20_002] += 0.5  # a peak of the error alone
    gap = np.where(np.arange(rows) == 777, np.nan, 0.0)
    table = np.column_stack([time, signal, reference, gap])
    np.savetxt(folder / "results.csv", table, "%.17g", ",", header="time,a.x,b.x_ref,a.gap", comments="")
    (folder / "run.json").write_text(json.dumps({"status": "completed", "rows": rows}))
    assert len(load_results(folder, thin=True).time) == rows  # a drawing of this is quick
    monkeypatch.setattr(reader, "LONG", 1000)
    thin = load_results(folder, thin=True)
    assert len(thin.time) < 10 * reader.STRETCHES < rows
    assert {1.234, 30.001, 20.002, 0.777, 0.0, time[-1]} <= set(thin.time)
    kept = np.searchsorted(time, thin.time)
    for name, values in (("a.x", signal), ("b.x_ref", reference), ("a.gap", gap)):
        np.testing.assert_array_equal(thin[name], values[kept])
    assert np.max(np.abs(thin["a.x"] - thin["b.x_ref"])) == np.max(np.abs(signal - reference))


def test_a_line_without_end_is_not_read_to_its_end(tmp_path):
    file = tmp_path / "results.csv"
    with file.open("wb") as stream:
        stream.truncate(10 * BLOCK)
    with refused(ValueError, names=("8000000 bytes", "longer")):
        CsvFile(file)


def test_a_recorded_scenario_may_hold_more_than_is_read(tmp_path):
    scenario = {"units": {"plant": {"fmu": "x", "step_size": 0.1, "own": [1]}}, "title": None, "later": {}}
    record = check_record({"status": "completed", "scenario": scenario}, tmp_path / "run.json")
    assert record.content()["scenario"] == scenario

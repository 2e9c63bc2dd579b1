import json

import numpy as np
import pytest

from tests.refusals import mentions, refused, texts_of
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
    assert list(results) == ["car.yaw_rate", "ecu.yaw_moment", "car.mode", "ecu.yaw_rate_error"]
    assert "car.yaw_rate" in results
    assert "car.roll" not in results


def test_a_column_of_words_is_an_array_of_words(folder):
    assert load_results(folder)["car.mode"].tolist() == ["dry", "wet"]


def test_every_column_has_a_unit_if_only_an_empty_one(folder):
    assert load_results(folder).units == {
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
    with refused(
        ResultsError, "signal-ambiguous", names=("results.csv", "'yaw_rate'", "car.yaw_rate", "ecu.yaw_rate")
    ):
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


@pytest.mark.parametrize(
    ("name", "text", "names"),
    [
        ("run.json", None, ("run.json", "yawbench run")),
        ("run.json", "{", ("run.json",)),
        ("run.json", "[]", ("run.json", "record")),
        ("results.csv", None, ("results.csv", "run.json")),
        ("results.csv", "", ("results.csv", "'time'")),
        (
            "results.csv",
            "time,a.x\n0.0,1.0\n0.1\n",
            ("results.csv", "2 columns", "got 1"),
        ),
        ("results.csv", "time,a.x\n0.0,1.0,2.0\n", ("2 columns", "got 3")),
    ],
)
def test_missing_and_broken_files_are_one_sentence(folder, name, text, names):
    if text is None:
        (folder / name).unlink()
    else:
        (folder / name).write_text(text)
    with refused(ResultsError, names=names) as caught:
        load_results(folder)
    assert len(caught.value.diagnostics) == 1


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("time,a.x,a.x\n0.0,1.0,2.0\n", "more than one column is called 'a.x'"),
        ("time,a.x\n0.0,1.0\n0.0,1.0\n", "row 2: time 0 s does not follow 0 s"),
        ("time,a.x\n0.1,1.0\n0.0,1.0\n", "row 2: time 0 s does not follow 0.1 s"),
        ("time,a.x\nnan,1.0\n", "row 1: time nan s does not follow -inf s"),
        ("time,a.x\n0.0,1.0\n0.1,wet\n", "'wet'"),
        ("time,a.x\n0.0,1.0\n0.1,\n", "''"),
        ("time,a.x\n0.0,1.0\n0.1,1.0,2.0\n", "2 columns"),
        ("time,a.x\nnoon,1.0\n", "'noon'"),
    ],
)
def test_what_is_wrong_in_a_file_of_results_is_named(folder, text, sentence):
    (folder / "results.csv").write_text(text)
    with refused(ResultsError, "results-unreadable", names=("results.csv", sentence)):
        load_results(folder)


@pytest.mark.parametrize(
    ("changes", "sentence", "names"),
    [
        ({"rows": "many"}, "rows: input should be a valid integer (got 'many')", ("'many'",)),
        ({"rows": -1}, "rows: input should be greater than or equal to 0 (got -1)", ("0", "-1")),
        ({"units": ["s"]}, "units: input should be a valid dictionary (got ['s'])", ("['s']",)),
        ({"fmus": {"car": "plant"}}, "fmus.car: input should be a valid dictionary", ("fmus.car", "'plant'")),
        ({"error": "no"}, "error: input should be a valid dictionary (got 'no')", ("'no'",)),
        (
            {"status": 1, "rows": "x"},
            "status: input should be a valid string (got 1) (1 more like it)",
            ("1",),
        ),
    ],
)
def test_a_record_of_another_kind_is_one_sentence(folder, changes, sentence, names):
    (folder / "run.json").write_text(json.dumps({**RUN, **changes}))
    with pytest.raises(ResultsError) as caught:
        load_results(folder)
    (problem,) = texts_of(caught.value)
    assert mentions(problem, "run.json", *names)


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


@pytest.mark.parametrize(
    ("scenario", "place"),
    [
        ({"units": {"plant": "x"}}, "scenario.units.plant"),
        ({"units": ["plant"]}, "scenario.units"),
        ({"units": None}, "scenario.units"),
        ({"units": {"plant": {"parameters": ["mass"]}}}, "scenario.units.plant.parameters"),
        ({"vehicle_parameters": 5}, "scenario.vehicle_parameters"),
        (["units"], "scenario"),
    ],
)
def test_a_record_whose_scenario_was_altered_is_refused_at_its_place(scenario, place, tmp_path):
    with pytest.raises(ResultsError) as caught:
        check_record({"status": "completed", "scenario": scenario}, tmp_path / "run.json")
    assert f"run.json: is not the record of a run: {place}" in str(caught.value)


def test_a_recorded_scenario_may_hold_more_than_is_read(tmp_path):
    scenario = {"units": {"plant": {"fmu": "x", "step_size": 0.1, "own": [1]}}, "title": None, "later": {}}
    record = check_record({"status": "completed", "scenario": scenario}, tmp_path / "run.json")
    assert record.content()["scenario"] == scenario

import json

import pytest

from orchestrator.errors import ResultsError
from orchestrator.results.read import load_results

RUN = {
    "status": "completed",
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
    assert results.units_of_role("plant") == ["car"]
    assert results.units_of_role("controller") == ["ecu"]
    assert results.units_of_role("tyre") == ["tyre"]
    assert results.units_of_role("driver") == []
    assert results.column("yaw_rate", role="plant") == "car.yaw_rate"


def test_a_variable_of_two_units_is_ambiguous_until_a_role_is_given(folder):
    (folder / "results.csv").write_text("time,car.yaw_rate,ecu.yaw_rate\n0.0,1.0,2.0\n")
    results = load_results(folder)
    with pytest.raises(ResultsError, match=r"more than one unit: car\.yaw_rate, ecu\.yaw_rate\.$"):
        results.find("yaw_rate")
    assert results.find("yaw_rate", role="controller").tolist() == [2.0]


def test_an_unknown_column_suggests_the_likely_one(folder):
    with pytest.raises(
        ResultsError, match=r"no column 'car\.yawrate' was recorded; did you mean 'car\.yaw_rate'"
    ):
        load_results(folder)["car.yawrate"]
    with pytest.raises(ResultsError, match="no column 'yaw_rate' of a driver was recorded"):
        load_results(folder).find("yaw_rate", role="driver")


def test_results_without_rows_have_empty_columns(folder):
    (folder / "results.csv").write_text("time,car.yaw_rate\n")
    results = load_results(folder)
    assert results.time.shape == results["car.yaw_rate"].shape == (0,)


def test_results_that_were_cut_off_are_no_results(folder):
    (folder / "run.json").write_text(json.dumps({**RUN, "rows": 3}))
    with pytest.raises(
        ResultsError, match=r"results\.csv: holds 2 of the 3 rows of its run; run it again\.$"
    ):
        load_results(folder)


@pytest.mark.parametrize(
    ("name", "text", "sentence"),
    [
        ("run.json", None, r"no results here, run\.json is missing; make them with 'yawbench run"),
        ("run.json", "{", r"run\.json: cannot be read: "),
        ("run.json", "[]", r"run\.json: is not the record of a run\.$"),
        ("results.csv", None, r"results\.csv: is missing, though run\.json is there\.$"),
        ("results.csv", "", r"results\.csv: the first column must be 'time'\.$"),
        (
            "results.csv",
            "time,a.x\n0.0,1.0\n0.1\n",
            r"results\.csv: cannot be read: line 3 has 1 values for 2 col",
        ),
        ("results.csv", "time,a.x\n0.0,1.0,2.0\n", r"cannot be read: line 2 has 3 values for 2 columns$"),
    ],
)
def test_missing_and_broken_files_are_one_sentence(folder, name, text, sentence):
    if text is None:
        (folder / name).unlink()
    else:
        (folder / name).write_text(text)
    with pytest.raises(ResultsError, match=sentence) as caught:
        load_results(folder)
    assert len(caught.value.problems) == 1

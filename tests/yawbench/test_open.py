"""Folders that commands have written, opened from Python."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

import yawbench as yb
from tests.command_line import status_of
from tests.refusals import refused

SCENARIO = Path(yb.__file__).parents[1] / "scenarios/fnn_sideslip/25mps.yaml"
FILES = {
    "sweep": f"""
title: Sweep
scenario: {SCENARIO}
set: {{stop_time: 1.2}}
axes:
  amplitude: {{vary: driver.amplitude, values: [0.02, 0.03]}}
  controller: {{vary: controller, values: [controller_off, controller_fnn]}}
metrics: {{sideslip: {{metric: peak(sideslip)}}}}
""",
    "study": f"""
title: Study
runs:
  - {{name: free, scenario: {SCENARIO}, swap: {{controller: controller_off}}, set: {{stop_time: 1.2}}}}
  - {{name: held, scenario: {SCENARIO}, set: {{stop_time: 1.2}}}}
metrics: {{sideslip: {{metric: peak(sideslip)}}}}
""",
}


def yawbench(folder, *arguments):
    """Run a command in a folder with the files."""
    for name, text in FILES.items():
        (folder / f"{name}.yaml").write_text(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert status_of(*arguments, "--out", "made") == 0
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        opened = yb.open(folder / "made")
        if isinstance(opened, yb.RecordedRuns):
            opened.tables  # noqa: B018
    return opened


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    return yawbench(tmp_path_factory.mktemp("swept"), "sweep", "sweep.yaml", "--keep")


def test_a_folder_of_a_sweep_has_its_runs_over_the_axes(swept):
    table = swept.table
    assert len(swept.runs) == len(table) == 4
    data = swept.to_xarray()
    assert dict(data.sizes) == {"amplitude": 2, "controller": 2, "time": 1201}
    assert data["amplitude"].attrs["units"] == "rad"
    for row in table.to_dict("records"):
        run = swept.runs[f"runs/{row['key'][:12]}"]
        assert row["sideslip"] == run.metric("peak(sideslip)")
        at = {"amplitude": row["amplitude"], "controller": row["controller"]}
        assert np.array_equal(data["plant.yaw_rate"].sel(at), run["plant.yaw_rate"])
    (axes,) = swept.plot("sideslip").axes
    assert len(axes.get_lines()) >= 4


def test_runs_without_a_table_are_opened_and_so_is_one_of_them(swept, tmp_path):
    recorded = yb.open(swept.folder / "runs")
    assert len(recorded.runs) == 4
    assert all(isinstance(yb.open(swept.folder / "runs" / name), yb.Run) for name in recorded.runs)
    with refused(yb.ResultsError, "results-missing"):
        recorded.table  # noqa: B018
    with refused(yb.ResultsError, "results-missing"):
        yb.open(tmp_path)


def test_parquet_and_csv_have_the_same_columns_and_units(swept):
    (table, file) = swept.table, parquet.read_table(swept.folder / "table.parquet")
    assert list(table.columns) == file.schema.names
    units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in file.schema}
    assert table.attrs["units"] == {name: unit for name, unit in units.items() if unit}
    assert table["sideslip"].tolist() == file["sideslip"].to_pylist()


def test_a_folder_of_a_study_has_its_runs_by_name(tmp_path):
    study = yawbench(tmp_path, "study", "study.yaml")
    assert list(study.runs) == ["free", "held"]
    data = study.to_xarray()
    assert data["run"].values.tolist() == ["free", "held"]
    assert np.array_equal(data["plant.yaw_rate"].sel(run="held"), study.runs["held"]["plant.yaw_rate"])


def test_a_folder_of_a_run_and_of_its_evaluation(tmp_path):
    run = yawbench(tmp_path, "run", "proving_ground/sine_with_dwell")
    (tmp_path / "made").rename(tmp_path / "run")
    judged = yawbench(tmp_path, "evaluate", "sine-with-dwell", "run", "--no-figures")
    evaluation = run.evaluate("sine-with-dwell")
    (row,) = judged.table.to_dict("records")
    assert row["verdict"] == row["stability"] == evaluation.criteria["stability"].status.value
    assert row["displacement"] == evaluation.quantities["displacement"].value
    assert judged.table.attrs["units"]["displacement"] == "m"
    for missing in (judged.to_xarray, judged.plot):
        with refused(yb.ResultsError, "results-missing"):
            missing()


def test_a_measurement_file_is_opened_as_a_recording(tmp_path):
    times = np.arange(0.0, 2.0, 0.01)
    lines = ["T,Gyro", *(f"{t:.2f},{np.sin(t):.6f}" for t in times)]
    (tmp_path / "drive.csv").write_text("\n".join(lines) + "\n")
    file = tmp_path / "measured.yaml"
    file.write_text(
        "files: [drive.csv]\ntime: {column: T, unit: s}\nsignals: {yaw_rate: {column: Gyro, unit: rad/s}}\n"
    )
    run = yb.open(file)
    assert isinstance(run, yb.Run)
    assert np.array_equal(run["yaw_rate"], yb.measured(file)["yaw_rate"])

"""Validation by bands: which runs pass, how far measured points lie, which conditions are not met."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import yawbench as yb
from tests.commands.test_output import ALWAYS, documented
from tests.orchestrator import recorded
from tests.refusals import each_mentions, refused
from yawbench.foundation.errors import ScenarioError
from yawbench.measured_cars.validation import BANDS, Tolerance, load_bands
from yawbench.studies.experiment_result import judge_results
from yawbench.studies.load_experiment import load_experiment
from yawbench.studies.result_files import record_of
from yawbench.studies.result_tables import all_tables

UNITS = (
    "driver_ramp", "reference_steady_state", "controller_off", "allocator_single_wheel",
    "wheel_control_hydraulic", "plant_fourteen_dof", "tyre_magic_formula",
)  # fmt: skip
MEASURED = """files: [{files}]
signals: {{steering_wheel_angle: hand, acceleration_y: a_y}}
{more}
car: made up
source: a run
licence: none
date: 2024-01-01
"""


def write(folder: Path, name: str, hand: np.ndarray, a_y: np.ndarray, more: str = "", tests: int = 3) -> Path:
    """Write a measurement of some tests that are equal but for the resolution of a sensor."""
    header, files = "time [s],hand [rad],a_y [m/s2]", [f"{name}_{k}.csv" for k in range(tests)]
    for k, file in enumerate(files):
        table = np.column_stack([0.01 * np.arange(hand.size), hand, a_y + 1e-7 * k])
        np.savetxt(folder / file, table, "%.9g", ",", header=header, comments="")
    path = folder / f"{name}.yaml"
    path.write_text(MEASURED.format(files=", ".join(files), more=more))
    return path


def line(folder: Path, name: str, along: float = 0.0, up: float = 0.0, **more: object) -> Path:
    """Write a measurement along a = 0.1 delta, up to 5 m/s2, moved."""
    a_y = np.linspace(1.0, 5.0, 200)
    return write(folder, name, 0.1 * a_y + up, a_y + along, **more)


def bands_of(folder: Path, title: str = "Wide", **offsets: str) -> Path:
    """Write a file of bands of the same width everywhere."""
    path = folder / f"{title.lower()}.yaml"
    bands = "".join(f"  {name}: {{offset: {width}, gain: 0}}\n" for name, width in offsets.items())
    path.write_text(f"title: {title}\nsource: chosen\nbands:\n{bands}")
    return path


def test_a_point_on_the_boundary_of_the_source_lies_at_one(tmp_path):
    run = yb.measured(line(tmp_path, "run"), segment=1)
    bands = bands_of(tmp_path, acceleration_y="0.2 m/s2", steering_wheel_angle="2 deg")
    eps_x, eps_y, dx, dy = 0.2, np.radians(2.0), 1.0, 0.1
    length = np.hypot(dx * eps_y, dy * eps_x)
    for side in (1.0, -1.0):
        x, y = 3.0 - side * dy * eps_x**2 / length, 0.3 + side * dx * eps_y**2 / length
        path = write(tmp_path, "point", np.repeat(y, 3), np.repeat(x, 3))
        verdict = yb.validate(run, path, bands=bands).verdicts["steering_wheel_angle"]
        assert verdict.value == pytest.approx(1.0, rel=1e-3)


def test_the_tolerances_that_come_with_the_program_are_in_si():
    bands = load_bands(BANDS)
    assert bands.over == "acceleration_y" and "TUMFTM" in bands.source
    assert bands.tolerances["acceleration_y"] == Tolerance(0.1, 0.06)
    assert bands.tolerances["steering_wheel_angle"] == Tolerance(pytest.approx(np.radians(5.0)), 0.03)


@pytest.fixture(scope="module")
def ramps(tmp_path_factory):
    """A slow ramp, and measurements of cars with other stiffnesses, with noise."""
    place = tmp_path_factory.mktemp("ramps")
    base = yb.load("proving_ground/slow_ramp").set({"step_size": 0.005})
    run = base.run()
    given = run.record["fmus"]["tyre"]["parameters"]
    rng = np.random.default_rng(1)
    paths = {}
    for axle, factor in (("front", 1.1), ("front", 1.15), ("rear", 1.2)):
        name = f"cornering_stiffness_scale_{axle}"
        other = base.set({f"tyre.{name}": factor * given[name]}).run()
        times = np.arange(1.0, other.time[-1] - 0.01, 0.01)
        hand, a_y = (
            np.interp(times, other.time, other[column]) + rng.normal(0.0, noise, times.size)
            for column, noise in (("steering_wheel_angle", np.radians(0.1)), ("acceleration_y", 0.05))
        )
        label = f"{axle}_{factor:g}"
        paths[axle, factor] = write(place, label, hand, a_y, "filter: {low_pass: 6 Hz}")
    return run, paths


@pytest.mark.parametrize(
    ("axle", "factor", "passes"), [("front", 1.1, True), ("front", 1.15, False), ("rear", 1.2, True)]
)
def test_a_slow_ramp_tells_the_front_stiffness_and_hardly_the_rear(axle, factor, passes, ramps):
    run, paths = ramps
    validation = yb.validate(run, paths[axle, factor])
    assert validation.holds is passes and not validation.diagnostics
    verdict = validation.verdicts["steering_wheel_angle"]
    assert verdict.bound == 1.0 and 0.5 < verdict.value < 1.6
    assert "TUMFTM" in validation.source


def test_one_side_is_compared_with_the_other_in_the_mirror(tmp_path):
    run = yb.measured(line(tmp_path, "run"), segment=1)
    a_y = -np.linspace(1.0, 5.0, 200)
    verdict = yb.validate(run, write(tmp_path, "right", 0.1 * a_y, a_y)).verdicts["steering_wheel_angle"]
    assert verdict.value < 0.05


def test_conditions_that_are_not_met_are_warnings(tmp_path):
    run = yb.measured(line(tmp_path, "run"), segment=1)
    a_y = np.linspace(1.0, 3.0, 200)
    few = yb.validate(run, write(tmp_path, "few", 0.1 * a_y, a_y, tests=2))
    assert [one.code for one in few.diagnostics] == ["validation-conditions"] * 2
    asked = ("2 tests", "ISO", "19364", "3"), ("3 m/s2", "acceleration_y", "5 m/s2")
    assert few.holds and each_mentions(few.diagnostics, *asked)
    path = line(tmp_path, "thrice")
    path.write_text(path.read_text().replace("_1.csv", "_0.csv").replace("_2.csv", "_0.csv"))
    again = yb.validate(run, path).diagnostics
    assert each_mentions(again, ("1 test", "3 segments", "ISO", "19364"))


def test_the_command_draws_writes_and_ends_with_the_verdict(tmp_path, yawbench):
    run = yb.measured(line(tmp_path, "run"), segment=1).save(tmp_path / "results")
    near, far, out = line(tmp_path, "near", up=0.05), line(tmp_path, "far", up=0.2), tmp_path / "out"
    assert yawbench("validate", run, "--measured", near, "--out", out)[0] == 0
    assert not (out / "validation.html").exists()
    status, said, told = yawbench("validate", run, "--measured", far, "--out", out, "--page", "--json")
    answer = json.loads(said)
    assert status == 1 and "validation.html" in told
    assert set(answer) == ALWAYS | documented()["validate"]
    assert (out / "validation.svg").is_file()
    assert "tolerance" in (out / "validation.html").read_text(encoding="utf-8")
    data = json.loads((out / "validation.json").read_text())
    signal = data["signals"]["steering_wheel_angle"]
    assert signal["verdict"] == "failed" and signal["value"] > 1.0 and not data["holds"]
    assert answer["validation"] == data
    assert "TUMFTM" in data["source"]


def test_a_signal_that_is_not_recorded_is_not_judged(tmp_path):
    run = yb.measured(line(tmp_path, "run"), segment=1)
    bands = bands_of(tmp_path, acceleration_y="0.1 m/s2", roll_angle="1 deg")
    validation = yb.validate(run, line(tmp_path, "again"), bands=bands)
    assert validation.holds is None and validation.verdicts["roll_angle"].holds is None


HAND = "bands.steering_wheel_angle"
FILE_OF_BANDS = """title: Bands
source: chosen
bands:
  acceleration_y: {offset: 0.1 m/s2, gain: 6 %}
  steering_wheel_angle: {offset: 5 deg, gain: 3 %}
"""


@pytest.mark.parametrize(
    ("old", "new", "lines"),
    [
        ("5 deg", "5 kg", f"unit-mismatch | bands.yaml:5 | {HAND}.offset | '5 kg' | rad | deg | mrad"),
        ("3 %", "-3 %", f"value-invalid | bands.yaml:5 | {HAND}.gain | 0 | -3 %"),
        ("5 deg", "5", f"value-invalid | bands.yaml:5 | {HAND}.offset"),
        (
            "acceleration_y:",
            "roll_angle:",
            "key-missing | bands.yaml:1 | acceleration_y | 'bands'\n"
            "unit-mismatch | bands.yaml:4 | bands.roll_angle.offset | '0.1 m/s2' | rad | deg | mrad",
        ),
        (
            "steering_wheel_angle:",
            "steering_angle:",
            "value-invalid | bands.yaml:5 | bands.steering_angle | 'steering_angle' | 'steer_angle'",
        ),
        (
            "source: chosen",
            "sources: chosen",
            "key-missing | bands.yaml:1 | 'source'\nkey-unknown | bands.yaml:2 | 'source' | title | bands",
        ),
    ],
)
def test_mistakes_of_a_file_of_bands_have_a_line(old, new, lines, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("bands.yaml").write_text(FILE_OF_BANDS.replace(old, new))
    with pytest.raises(ScenarioError) as refused:
        load_bands(Path("bands.yaml"))
    found = refused.value.diagnostics
    assert each_mentions([f"{one.code} {one}" for one in found], *(x.split(" | ") for x in lines.split("\n")))


def test_unknown_bands_are_named_with_those_there_are():
    with refused(ScenarioError, names=("'steady'", "'steady_state'")):
        load_bands("steady")


STUDY = """title: A car and its model
runs: [{name: ramp, scenario: ramp.yaml, label: model}]
metrics: {peak: {metric: peak(acceleration_y)}}
validations:
  - {run: ramp, measured: near.yaml}
  - {run: ramp, measured: far.yaml, bands: wide.yaml}
"""


def write_study(folder: Path, **offsets: str) -> None:
    """Write a study with two validations, their recordings along a = 10 delta, and the bands of one."""
    line(folder, "near", up=0.05)
    line(folder, "far", up=0.5, tests=2)
    bands_of(folder, acceleration_y="0.1 m/s2", **offsets, steering_wheel_angle="10 deg")
    (folder / "study.yaml").write_text(STUDY)


@pytest.fixture
def study(tmp_path):
    """A study with two validations, and results of its run."""
    write_study(tmp_path)
    a_y = np.linspace(1.0, 5.0, 200)
    columns = {"plant.acceleration_y": a_y, "driver.steering_wheel_angle": 0.1 * a_y}
    units = {"plant.acceleration_y": "m/s2", "driver.steering_wheel_angle": "rad"}
    made = recorded.results(columns, 0.01 * np.arange(200.0), units)
    recorded.write(made, tmp_path / "ramp")
    return load_experiment(tmp_path / "study.yaml")


def test_a_study_has_its_validations_in_tables_record_and_answer(study, tmp_path):
    findings = judge_results(study, tmp_path)
    near, far = findings.sections["validations"]
    assert (near.holds, far.holds) == (True, False)
    assert [verdict.holds for verdict in far.conditions.values()] == [False, True]
    assert (far.bands, near.bands) == ("Wide", load_bands(BANDS).title)
    assert [one["holds"] for one in record_of(findings)["validations"]] == [True, False]
    tables = [table for table in all_tables(findings) if "against" in table.title]
    assert [table.rows[0][:2] for table in tables] == [
        ["steering_wheel_angle", "passed"], ["steering_wheel_angle", "failed"],
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("run: ramp, measured: near", "run: ramps, measured: near", "name-unknown"),
        ("near.yaml", "nowhere.yaml", "file-missing"),
        ("wide.yaml", "wider", "scenario-unknown"),
    ],
)
def test_mistakes_of_validations_are_told_before_any_run(old, new, code, study, tmp_path):
    (tmp_path / "study.yaml").write_text(STUDY.replace(old, new))
    with refused(ScenarioError, code):
        load_experiment(tmp_path / "study.yaml")

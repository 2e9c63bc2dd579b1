"""`yawbench list` and `yawbench diff`: tables of what there is, and of what differs between two runs."""

from pathlib import Path

import numpy as np
import pytest

from tests.fmu_copies import put_fmus
from tests.orchestrator.recorded import car, write
from tests.refusals import each_mentions, mentions
from yawbench.metrics.expressions import columns_for, evaluate_all
from yawbench.orchestrator.results.reader import found_runs, load_results
from yawbench.orchestrator.results.run_record import FmuRecord, RunRecord, RunStatus
from yawbench.orchestrator.scenario.catalogue import title_of
from yawbench.reports.record_differences import differences
from yawbench.studies.listings import runs_table
from yawbench.vocabulary.motion import LEAST_SPEED


def ends(results):
    """Return what the record of a run says of the largest values."""
    return {
        "smallest": {name: float(values.min()) for name, values in results.columns.items()},
        "largest": {name: float(values.max()) for name, values in results.columns.items()},
    }


def test_a_list_of_runs_tells_when_what_changed_and_what_came_out(tmp_path):
    plain, lively = car(), car(2.0)
    write(plain, tmp_path / "plain", started="2025-01-01T10:00:00+00:00", **ends(plain))
    change = {"place": "vehicle.mass", "value": 1200, "origin": "--set"}
    write(
        lively, tmp_path / "heavy", started="2024-01-01T10:00:00+00:00", changes=[change],
        scenario={"file": "scenarios/paper/25mps.yaml"}, **ends(lively),
    )  # fmt: skip
    table = runs_table(found_runs(tmp_path))
    heavy, light = (dict(zip(table.headings, row, strict=True)) for row in table.rows)
    assert (heavy["run"], light["run"]) == (str(tmp_path / "heavy"), str(tmp_path / "plain"))
    assert heavy["begun"].startswith("2024-01-01 ")
    assert heavy["scenario"] == "paper/25mps"
    assert heavy["changed"] == "vehicle.mass = 1200"
    assert light["changed"] is None
    for row, results in ((heavy, lively), (light, plain)):
        assert row["status"] == "completed"
        assert row["max|β|"].number == np.max(np.abs(results["plant.sideslip"]))
        assert row["max|r|"].unit == "rad/s"


def test_the_peak_of_a_listed_run_is_that_while_it_moved(tmp_path):
    stops, spun = car(), car()
    braking = stops.time / stops.time[-1]
    slip = np.where(braking > 0.95, np.pi, stops["plant.sideslip"])
    for run, sideslip in ((stops, slip), (spun, np.where(braking > 0.5, 2.5, slip))):
        run.columns["plant.sideslip"] = sideslip
        run.columns["plant.velocity_x"] = 20.0 * (1.0 - braking)
    for name, run in (("stops", stops), ("spun", spun)):
        write(run, tmp_path / name, **ends(run))
    moving = stops["plant.velocity_x"] >= LEAST_SPEED
    table = runs_table(found_runs(tmp_path))
    rows = [dict(zip(table.headings, row, strict=True)) for row in table.rows]
    peaks = {Path(row["run"]).name: row["max|β|"].number for row in rows}
    assert peaks["stops"] == pytest.approx(np.max(np.abs(slip[moving]))) and peaks["stops"] < 1.0
    assert peaks["spun"] == pytest.approx(2.5)


def test_what_differs_between_two_runs_stands_in_two_tables(yawbench, tmp_path):
    fmu = {"name": "plant_made_up", "sha256": "0" * 64, "parameters": {"mass": 1100.0, "width": 1.5}}
    write(car(), tmp_path / "one", fmus={"plant": fmu}, connections=[{"from": "a.x", "to": "b.x"}])
    heavy = {**fmu, "parameters": {"mass": 1200.0, "width": 1.5}}
    write(car(1.5), tmp_path / "other", fmus={"plant": heavy}, stop_time=9.0)
    status, out, _ = yawbench("diff", tmp_path / "one", tmp_path / "other")
    assert status == 0
    rows = {line.split()[0]: line.split()[1:] for line in out.splitlines() if line.strip()}
    assert rows["plant.mass"] == ["1100", "1200"]
    assert "plant.width" not in rows
    assert rows["stop_time"] == ["-", "9"]
    assert rows["a.x"] == ["->", "b.x", "connected", "-"]
    apart = np.max(np.abs(car()["plant.sideslip"] - car(1.5)["plant.sideslip"]))
    assert f"{np.degrees(apart):.3f} °" in " ".join(rows["plant.sideslip"])
    assert "driver.steer_angle" not in rows


def test_of_two_units_of_another_kind_only_shared_parameters_are_compared():
    def run(name, **parameters):
        fmu = FmuRecord(name=name, sha256=name, parameters=parameters)
        return RunRecord(fmus={"controller": fmu})

    found = differences(run("pid", gain=1, limit=2), run("fuzzy", width=1, limit=3))
    assert [one.place for one in found] == ["controller", "controller.limit"]


def test_runs_that_are_the_same_say_so(yawbench, tmp_path):
    write(car(), tmp_path / "one")
    write(car(), tmp_path / "other")
    status, out, said = yawbench("diff", tmp_path / "one", tmp_path / "other")
    assert (status, out) == (0, "")
    assert each_mentions(said, ("identical", "inputs", "numbers"))


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("runs", "none"), "none: no such folder; name one with results"),
        (("runs", "."), ".: contains no results; 'yawbench run SCENARIO' makes some"),
        (("scenarios", "."), ".: holds no file that is a scenario or a study file or a sweep file"),
        (("vehicles", "none"), "none: there is no such folder"),
        (("fmus", "."), ".: contains no FMUs"),
    ],
)
def test_a_list_of_nothing_is_one_sentence(arguments, sentence, yawbench, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert yawbench("list", *arguments) == (2, "", f"{sentence}\n")


def test_files_are_listed_by_their_kind(yawbench, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s").mkdir()
    (tmp_path / "s" / "car.yaml").write_text("title: A car\nparameters: {mass: 1}\n")
    (tmp_path / "s" / "sine.yaml").write_text("title: A sine\nunits: {}\n")
    (tmp_path / "s" / "broken.yaml").write_text("title: [\n")
    status, out, _ = yawbench("list", "vehicles", "s")
    assert status == 0
    assert out.split()[-5:] == ["s/car.yaml", "vehicle", "file", "A", "car"]
    assert "sine" not in out
    assert "A sine" in yawbench("list", "scenarios", "s")[1]


def test_signals_metrics_and_fmus_are_listed(yawbench, tmp_path):
    put_fmus(tmp_path, components=("controller_fnn", "wheel_control_direct"))
    assert "relative_peak_error(x)" in yawbench("list", "metrics")[1]
    fmus = yawbench("list", "fmus", tmp_path)[1]
    assert "controller_fnn" in fmus
    assert "wheel_control_direct" in fmus
    signals = yawbench("list", "signals", "--fmus", tmp_path)[1]
    assert "yaw_moment" in signals
    assert "wheel_torque_*" in signals or "torque_request_*" in signals


def test_metrics_need_only_the_columns_that_they_are_made_of(tmp_path):
    folder = write(car(), tmp_path / "one")
    names = ["relative_peak_error(sideslip)", "peak(wheel_torque_*)", "stability_index(sideslip)"]
    some = load_results(folder, only=lambda recorded: columns_for(recorded, names))
    assert len(some.columns) == 7 < len(load_results(folder).columns)
    assert "plant.velocity_x" in some.columns  # sideslip counts while the car moves
    assert evaluate_all(some, names) == evaluate_all(load_results(folder), names)


@pytest.mark.parametrize(
    ("entry", "title"),
    [
        ("title: A car # mine", "A car"), ("'title': 'A: b'", "A: b"), ("title: >-\n  A\n  car", "A car"),
        ("title: 5", "5"), ("title: ~", ""), ("title: [", ""), ("x: 1", ""), ("x:\n  title: inner", ""),
    ],
)  # fmt: skip
def test_a_title_is_read_without_the_rest_of_its_file(entry, title, tmp_path):
    file = tmp_path / "a.yaml"
    file.write_text(f"{entry}\nunits: [not YAML\n")
    assert title_of(file) == title


def test_without_a_word_the_list_shows_scenarios_by_name_then_vehicles(yawbench, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mine = tmp_path / "scenarios" / "mine" / "turn.yaml"
    mine.parent.mkdir(parents=True)
    mine.write_text("title: My turn\nstop_time: 1\nstep_size: 0.01\nunits: {driver: {fmu: driver_sine}}\n")
    status, out, _ = yawbench("list")
    assert status == 0
    rows = [line.split() for line in out.splitlines() if line.strip()]
    kinds = [row[1] for row in rows if len(row) > 2 and row[1] in ("scenario", "study", "sweep", "vehicle")]
    assert rows[2][:2] == ["mine/turn", "scenario"]
    assert ["fnn_sideslip/25mps", "scenario"] in [row[:2] for row in rows]
    assert kinds.index("vehicle") > kinds.index("sweep") > 0


def test_a_run_whose_record_cannot_be_read_is_listed_and_left_out_of_evaluations(yawbench, tmp_path):
    for name in ("one", "other"):
        write(car(), tmp_path / name)
    file = tmp_path / "one" / "run.json"
    file.write_text(file.read_text().replace('"plant.yaw_rate": "rad/s"', '"plant.yaw_rate": 7'))
    sentence = f"{file}: is not the record of a run: units.plant.yaw_rate: "
    (one,) = (run for run in found_runs(tmp_path) if run.status is RunStatus.UNREADABLE)
    assert one.problem.startswith(sentence)
    status, out, said = yawbench("evaluate", "step-steer", tmp_path / "one", "--no-figures")
    assert (status, out) == (2, "")
    assert said.startswith(sentence)
    _, _, said = yawbench("evaluate", "step-steer", tmp_path, "--no-figures")
    assert mentions(said, "note", "run.json", "units.plant.yaw_rate")
    for command in (("plot", tmp_path / "one"), ("diff", tmp_path / "one", tmp_path / "other")):
        status, out, said = yawbench(*command)
        assert (status, out) == (2, "")
        assert said.startswith(sentence)

"""Tyre property files in scenarios: who takes them, how they are changed, what a run remembers of them."""

from __future__ import annotations

import hashlib
import json
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from tests.cars import load_scenario, make_plan
from tests.changed import changed
from tests.command_line import status_of
from tests.refusals import mentions, refused, texts_of
from tests.vehicles.tir_files import write
from yawbench.foundation.errors import ScenarioError, WiringError, warnings_in
from yawbench.interop.ssp_write import write_ssp
from yawbench.orchestrator.results.folder_names import default_folder
from yawbench.orchestrator.results.freshness import key_of
from yawbench.orchestrator.results.reader import load_results
from yawbench.orchestrator.results.record_of_plan import run_record
from yawbench.orchestrator.scenario.overrides import changes_of, read_changes
from yawbench.orchestrator.signal_names import Target
from yawbench.reports.provenance import groups_of
from yawbench.studies.experiment import plan_experiment
from yawbench.studies.load_experiment import load_experiment

UNITS = "driver_force_pulse", "tyre_magic_formula_62", "tyre_linear", "plant_seven_dof", "wheel_control_slip"
SCENARIO = """\
title: Straight on
{tyres}vehicle: car.yaml
stop_time: 0.05
step_size: 0.001
inputs: {{"friction*": 0.9, "steer_angle": 0.0, "force_request*": -500}}
units:
  wheel_control: {{fmu: wheel_control_slip, parameters: {{tyre: magic_formula_62}}}}
  plant: {{fmu: plant_seven_dof}}
  tyre: {{fmu: tyre_magic_formula_62{more}}}
connections: [{{from: wheel_control.torque_request_*, to: plant.wheel_torque_*}}]
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with two tyre property files and the file of a car."""
    write(tmp_path / "soft.tir", {"PKY1": "-12.0", "PKX1": "18.0"})
    write(tmp_path / "stiff.tir", {"PKY1": "-17.0", "PKX1": "25.0", "FITTYP": "61"})
    (tmp_path / "car.yaml").write_text("parameters: {wheel_radius: 0.305}\n")
    return tmp_path


def scenario(folder, tyres="tyres: soft.tir", more=""):
    path = folder / "straight.yaml"
    path.write_text(SCENARIO.format(tyres=f"{tyres}\n" if tyres else "", more=more))
    return path


def plan(path, fmus, *swaps, **settings):
    return make_plan(load_scenario(path, changes=changed(swaps, **settings)), fmus=fmus)


def parameters(planned, unit="tyre"):
    return {u.name: u.parameters for u in planned.instances}[unit]


def test_every_unit_takes_what_it_declares_for_both_axles(folder, fmus):
    planned = plan(scenario(folder, "tyres: {front: soft.tir, rear: stiff.tir}"), fmus)
    tyre, control = parameters(planned), parameters(planned, "wheel_control")
    assert (tyre["pky1_front"], tyre["pky1_rear"]) == (-12.0, -17.0)
    assert (control["pkx1_front"], control["pkx1_rear"]) == (18.0, 25.0)
    assert "pky1_front" not in control
    assert not set(parameters(planned, "plant")) & set(tyre)
    tyres = next(u for u in planned.instances if u.name == "tyre")
    assert [str(tyres.origin(name)) for name in ("pky1_front", "pky1_rear")] == ["soft.tir", "stiff.tir"]
    assert not any("tyre" in note or "radius" in note for note in texts_of(planned))


def test_the_vehicle_file_may_name_them_and_the_scenario_has_the_last_word(folder, fmus):
    (folder / "car.yaml").write_text("tyres: stiff.tir\nparameters: {wheel_radius: 0.305, lmuy_rear: 0.7}\n")
    of_vehicle = parameters(plan(scenario(folder, ""), fmus))
    assert (of_vehicle["pky1_front"], of_vehicle["lmuy_front"], of_vehicle["lmuy_rear"]) == (-17.0, 0.98, 0.7)
    of_scenario = parameters(plan(scenario(folder, more=", parameters: {lmuy_front: 0.5}"), fmus))
    assert (of_scenario["pky1_front"], of_scenario["lmuy_front"]) == (-12.0, 0.5)


def test_tyres_are_an_axis_of_experiments_relative_to_their_file(folder, fmus):
    scenario(folder)
    sweep = folder / "sweeps" / "tyres.yaml"
    sweep.parent.mkdir()
    sweep.write_text(
        "title: Tyres\nscenario: ../straight.yaml\naxes:\n"
        "  tyre: {vary: tyres, values: {../soft.tir: soft, ../stiff.tir: stiff}}\n"
        "  rear: {vary: tyres.rear, values: [../soft.tir, ../stiff.tir]}\n"
        "metrics:\n  slip: {metric: peak(slip_ratio_fl)}\n"
    )
    loaded = load_experiment(sweep)
    planned = plan_experiment(loaded, folder / "runs", fmus=fmus)
    made = [parameters(job.plan) for job in planned.jobs]
    assert [(one["pky1_front"], one["pky1_rear"]) for one in made] == [
        (-12.0, -12.0), (-12.0, -17.0), (-17.0, -12.0), (-17.0, -17.0),
    ]  # fmt: skip
    assert len({job.key for job in planned.jobs}) == 4
    sweep.write_text(sweep.read_text().replace("[../soft.tir,", "[1,"))
    with refused(ScenarioError, "value-invalid", names=("tyres.yaml:5", "axes.rear", "tyres.rear")):
        load_experiment(sweep)


def test_another_file_is_another_run(folder, fmus, monkeypatch):
    path = scenario(folder)
    monkeypatch.chdir(folder)
    plain = plan(path, fmus)
    other = plan(path, fmus, **{"tyres": "stiff.tir"})
    rear = plan(path, fmus, **{"tyres.rear": "stiff.tir"})
    assert plain.changes == ()
    assert [(str(c.target), Path(str(c.value)).name) for c in rear.changes] == [("tyres.rear", "stiff.tir")]
    assert (parameters(rear)["pky1_front"], parameters(rear)["pky1_rear"]) == (-12.0, -17.0)
    assert len({key_of(p, {}) for p in (plain, other, rear)}) == 3
    assert len({default_folder(path, p.changes) for p in (plain, other, rear)}) == 3
    assert "stiff.tir" in default_folder(path, other.changes).name
    write(folder / "soft.tir", {"PKY1": "-12.5", "PKX1": "18.0"})
    assert key_of(plan(path, fmus), {}) != key_of(plain, {})
    assert plan(path, fmus, **{"tyres": "soft.tir"}).changes == ()  # as it stands


def test_files_of_options_are_found_from_here_and_those_of_studies_from_there(folder, monkeypatch):
    monkeypatch.chdir(folder)
    (option,) = read_changes(settings=["tyres.front=stiff.tir"])
    assert option.value == str(folder / "stiff.tir")
    (of_study,) = changes_of({}, {Target("tyres"): "stiff.tir"}, Path("/studies"), "study")
    assert of_study.value == str(Path("/studies/stiff.tir"))
    assert changes_of({}, {Target("tyres"): option.value}, Path("/studies"), "study")[0].value == option.value


def test_a_run_remembers_the_files_with_their_hash_kind_and_warnings(folder, fmus, tmp_path):
    write(folder / "soft.tir", {"TYRESIDE": "UNKNOWN"})
    out = tmp_path / "out"
    assert not status_of("run", scenario(folder), "--fmus", fmus, "--out", out)
    record = json.loads((out / "run.json").read_text())
    front = record["scenario"]["tyre_files"]["front"]
    assert front["sha256"] == hashlib.sha256((folder / "soft.tir").read_bytes()).hexdigest()
    assert (front["kind"], front["side"]) == ("MF-Tyre 6.2", "LEFT")
    assert mentions(front["warnings"][0], "UNKNOWN", "LEFT")
    assert mentions([one["message"] for one in record["diagnostics"]], "UNKNOWN", "LEFT")
    assert record["fmus"]["tyre"]["origins"]["pcx1_front"] == "soft.tir"


def test_check_shows_the_files_and_with_all_their_coefficients(folder, fmus, capsys):
    path = scenario(folder, "tyres: {front: soft.tir, rear: stiff.tir}")
    assert not status_of("check", path, "--fmus", fmus)
    text = " ".join(capsys.readouterr().out.split())
    assert mentions(text, "MF", "6.2", "LEFT", "soft.tir", "wheel_control")
    assert mentions(text, "MF", "6.1", "LEFT", "stiff.tir", "wheel_control")
    assert "pky1" not in text
    assert not status_of("check", path, "--fmus", fmus, "--all")
    assert mentions(" ".join(capsys.readouterr().out.split()), "pky1_rear", "-17", "stiff.tir")


def test_an_ssp_archive_carries_the_coefficients(folder, fmus):
    write_ssp(plan(scenario(folder), fmus), folder / "straight.ssp")
    again = plan(folder / "straight.ssp", fmus)
    assert parameters(again)["pky1_front"] == -12.0
    assert parameters(again, "wheel_control")["pkx1_rear"] == 18.0


@pytest.mark.parametrize(
    ("tyres", "names"),
    [
        ("tyres: none.tir", ("straight.yaml:2: tyres: ", "none.tir", "tyre", "property")),
        ("tyres: {front: soft.tir}", ("tyre", "property", "front")),
        ("tyres: 3", ("3", "property", "front")),
        ("tyres: bad.tir", ("bad.tir:32", "PKX1")),
    ],
)
def test_files_that_cannot_be_used_are_refused_with_their_place(folder, tyres, names):
    write(folder / "bad.tir", {"PKX1": "-3"})
    with refused(ScenarioError, names=names) as caught:
        load_scenario(scenario(folder, tyres))
    assert len(caught.value.diagnostics) == 1


def test_a_value_beyond_what_the_tyre_allows_is_refused_with_file_and_key(folder, fmus):
    write(folder / "soft.tir", {"PCX1": "0.001"})
    names = "straight.yaml:2", "soft.tir", "PCX1", "0.01", "0.001"
    with refused(WiringError, "value-invalid", names=names):
        plan(scenario(folder), fmus)


def test_without_a_tyre_that_takes_them_they_are_refused_and_after_a_swap_left_out(folder, fmus):
    path = scenario(folder)
    swapped = plan(path, fmus, "tyre=tyre_linear")
    assert mentions(texts_of(swapped), "tyres", "left", "files")
    path.write_text(path.read_text().replace("tyre_magic_formula_62", "tyre_linear"))
    with refused(WiringError, "tyre-file-unused", names=("straight.yaml:2", "tyre_magic_formula_62")):
        plan(path, fmus)


def test_a_slip_control_that_asks_another_law_and_another_radius_are_told(folder, fmus):
    (folder / "car.yaml").write_text("parameters: {wheel_radius: 0.33}\n")
    planned = plan(scenario(folder), fmus, **{"wheel_control.tyre": "dugoff"})
    kinds = [found.code for found in warnings_in(planned.diagnostics) if found.location.signal]
    assert kinds.count("tyre-mismatch") == 1
    assert kinds.count("wheel-radius-mismatch") == 2  # of plant and wheel control
    assert mentions(texts_of(planned), "wheel_radius", "0.33 m", "soft.tir", "0.3042 m")


def test_aligning_moments_come_by_a_connection_and_camber_with_the_plants_roll(tmp_path):
    """The scenario that shows them: without both the car moves otherwise, by a little."""
    shown = Path(__file__).parents[2] / "scenarios" / "tyre_file" / "lane_change.yaml"
    text = shown.read_text().replace("../vehicles", str(shown.parents[1] / "vehicles"))
    upright = [f"--set=plant.roll_camber_{axle}=0" for axle in ("front", "rear")]
    peaks = {}
    for name, content, given in (("both", text, []), ("none", text[: text.index("connections:")], upright)):
        out, path = tmp_path / name, tmp_path / f"{name}.yaml"
        path.write_text(content)
        assert not status_of("run", path, "--out", out, "--set", "stop_time=1.2", *given)
        peaks[name] = np.max(np.abs(load_results(out)["plant.yaw_rate"]))
    assert 0.002 < abs(peaks["both"] / peaks["none"] - 1.0) < 0.2


def test_the_origin_of_a_coefficient_on_a_page_is_its_file(folder, fmus):
    loaded = load_scenario(scenario(folder))
    plan = make_plan(loaded, fmus=fmus)
    groups = groups_of([(run_record(plan, status="", started=datetime.now()), plan)])
    (of_tyre,) = (group for group in groups if group.title.startswith("tyre:"))
    row = of_tyre.parameters["pky1_front"]
    assert row.stated is not None
    assert mentions(row.stated.says, "soft.tir", "tyre", "property")
    assert not row.set_by_study

"""Origins of parameters, and freshness of results."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path

import pytest

from tests.cars import load_scenario, make_plan
from tests.changed import changed
from tests.fmu_copies import put_fmus
from tests.orchestrator.recorded import record_text
from tests.refusals import mentions
from yawbench.fmus.build_stamp import BuildStamp
from yawbench.fmus.fmu import BuildInfo
from yawbench.orchestrator.plan import CHOSEN, ERRATUM, LITERATURE, NEUTRAL, PAPER, ValueSource
from yawbench.orchestrator.results.freshness import key_of, staleness
from yawbench.orchestrator.results.record_of_plan import run_record
from yawbench.orchestrator.results.run_record import RunRecord
from yawbench.reports.provenance import groups_of
from yawbench.studies import jobs

NOW = datetime.now(timezone.utc)
UNITS = ("driver_sine", "reference_steady_state", "controller_fnn")
SCENARIO = """
title: Half a car
source: "paper A, section 3"
vehicle: car.yaml
stop_time: 0.1
step_size: 0.01
inputs:
  velocity_x: 20                 # chosen: a middle speed
  friction: 0.7
  sideslip: 0
  sideslip_rate: 0
units:
  # One period of 5 s; chosen: slow.
  driver: {fmu: driver_sine, parameters: {amplitude: 0.05, frequency: 0.2}}
  reference: {fmu: reference_steady_state, parameters: {sideslip_limit: 0.2}}  # chosen: wide
  controller: {fmu: controller_fnn}
"""
CAR = """
title: A car
source: "paper A, table 1, unless a line says otherwise"
parameters:
  mass: 1100                     # kg
  cg_to_front_axle: 1.2          # m; erratum: printed as 12
  cg_to_rear_axle: 1.4           # m; chosen: a guess
  cornering_stiffness_front: 1e5 # N/rad
  cornering_stiffness_rear: 1e5
"""


@pytest.mark.parametrize(
    ("source", "kind"),
    [
        ("paper B, table 1", PAPER),
        ("chosen: the paper names none", CHOSEN),
        ("chosen", CHOSEN),
        ("erratum: the 1.36 m of paper C's table 1 cannot be right", ERRATUM),
        ("Pacejka 2006, table A3.1, the paper's", LITERATURE),
        ("", NEUTRAL),
    ],
)
def test_the_first_word_of_a_source_says_what_it_is(source, kind):
    assert ValueSource.parse(source) == ValueSource(kind, source)


@pytest.mark.parametrize(
    ("comment", "kind", "says"),
    [
        ("axle; chosen: that of the tyres; rounded", CHOSEN, "chosen: that of the tyres; rounded"),
        ("erratum: printed as 12", ERRATUM, "erratum: printed as 12"),
        ("wheelbase 3.05 m, chosen by nobody", PAPER, "wheelbase 3.05 m, chosen by nobody"),
        ("", PAPER, ""),
    ],
)
def test_a_comment_says_where_a_value_comes_from_or_else_its_file_does(comment, kind, says):
    found = ValueSource.of_comment(comment, "paper A, table 1, unless a line says otherwise")
    assert found == ValueSource(kind, says)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A folder with a scenario, its car and its FMUs."""
    folder = tmp_path_factory.mktemp("provenance")
    (folder / "half.yaml").write_text(SCENARIO)
    (folder / "car.yaml").write_text(CAR)
    put_fmus(folder / "fmus", components=UNITS)
    return folder


def planned(folder, *settings, **values):
    scenario = load_scenario(folder / "half.yaml", changes=changed(settings=settings, **values))
    return scenario, make_plan(scenario, fmus=folder / "fmus")


@pytest.fixture(scope="module")
def groups(folder):
    plans = [planned(folder)[1], planned(folder, "driver.amplitude=0.1")[1]]
    return {group.title: group.parameters for group in groups_in(*plans)}


def groups_in(*plans):
    """Return the groups of the runs of plans, from their records as they are read back."""
    records = [json.loads(run_record(one, status="", started=NOW).to_json()) for one in plans]
    return groups_of([*zip(map(RunRecord.model_validate, records), plans, strict=True)])


def test_the_car_s_parameters_come_from_its_file_line_by_line(groups):
    car = groups["The car: A car"]
    front, rear = (car[f"cg_to_{axle}_axle"].origin for axle in ("front", "rear"))
    assert car["mass"].origin.kind == PAPER
    assert (front.kind, front.says) == (ERRATUM, "erratum: printed as 12")
    assert (rear.kind, rear.says) == (CHOSEN, "chosen: a guess")


def test_a_unit_s_parameters_come_from_the_scenario_or_else_from_the_fmu(groups):
    driver, reference = groups["driver: driver_sine"], groups["reference: reference_steady_state"]
    assert driver["frequency"].origin.says == "chosen: slow."
    assert reference["sideslip_limit"].origin.says == "chosen: wide"
    assert "mass" not in reference
    learning = groups["controller: controller_fnn"]["learning_rate"]
    assert (learning.origin, list(learning.values)) == (ValueSource(PAPER, "paper A, equation (35)"), ["2"])
    assert mentions(learning.meaning, "Learning rate alpha")


def test_what_a_study_varies_keeps_its_source_and_shows_all_values(groups):
    amplitude = groups["driver: driver_sine"]["amplitude"]
    assert list(amplitude.values) == ["0.05", "0.1"]
    assert amplitude.set_by_study and amplitude.origin.kind == CHOSEN
    assert not groups["driver: driver_sine"]["frequency"].set_by_study


def test_constants_are_shown_with_their_own_values_sources_and_meanings(folder):
    put_fmus(folder / "fmus", components=("tyre_dugoff", "controller_sliding_mode"))
    constants = """\
  "friction*": 0.5               # chosen: all but one
  tyre.friction_fl: 0.2          # chosen: ice
  "slip_*": 0
  "vertical_load_*": 3000
  yaw_rate: 0.3
"""
    text = SCENARIO.replace("  friction: 0.7\n", constants).replace(
        "controller_fnn", "controller_sliding_mode"
    )
    (folder / "split.yaml").write_text(text + "  tyre: {fmu: tyre_dugoff}\n")
    groups = groups_in(make_plan(load_scenario(folder / "split.yaml"), fmus=folder / "fmus"))
    (found,) = (group.parameters for group in groups if group.title == "Constant inputs")
    values = {name: next(iter(one.values)) for name, one in found.items()}
    assert values["tyre.friction_fl"] == "0.2"
    assert values["tyre.friction_fr"] == values["tyre.friction_rr"] == "0.5"
    assert "tyre.friction_*" not in found
    assert found["tyre.friction_fl"].origin.says == "chosen: ice"
    assert mentions(found["tyre.friction_fr"].origin.says, "chosen")
    assert mentions(found["reference.velocity_x"].origin.says, "chosen", "middle")
    assert found["controller.yaw_rate"].origin.kind == PAPER  # as the scenario
    assert found["tyre.friction_fl"].meaning.endswith("front left")
    assert values["tyre.vertical_load_*"] == "3000"
    assert "left" not in found["tyre.vertical_load_*"].meaning
    assert values["controller.yaw_rate"] == "0.3"
    assert "driver" not in found["controller.yaw_rate"].meaning


def recorded(plan, folder: Path, **changes) -> Path:
    """Write what a run of a plan leaves, with changes."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "results.csv").write_text("time,x\n0.0,1.0\n0.1,2.0\n")
    record = run_record(plan, status="completed", started=NOW)
    record = record.content() | {"key": key_of(plan), "rows": 2, "size": 23}
    (folder / "run.json").write_text(record_text(record | changes))
    return folder


def test_results_of_the_same_plan_are_fresh_those_of_another_or_of_none_stale_with_a_reason(folder, tmp_path):
    _, plan = planned(folder)
    made = recorded(plan, tmp_path)
    assert staleness(plan, made) is None
    assert mentions(staleness(plan, tmp_path / "none"), "no results yet")
    assert mentions(staleness(planned(folder, "driver.amplitude=0.1")[1], made), "driver", "parameters")
    assert mentions(staleness(planned(folder, "inputs.friction=0.3")[1], made), "reference", "constants")
    assert mentions(staleness(planned(folder, stop_time=0.2)[1], made), "stop", "time")
    assert mentions(staleness(planned(folder, "controller.step_size=0.02")[1], made), "controller", "step")


def test_results_of_another_fmu_or_program_are_stale(folder, tmp_path):
    _, plan = planned(folder)
    record = json.loads((recorded(plan, tmp_path) / "run.json").read_text())
    fmus, versions = record["fmus"], record["versions"]
    fmus["driver"]["sha256"] = "0" * 64
    for changed_record, names in (
        ({"fmus": fmus}, ("driver", "driver_sine.fmu")),
        ({"versions": versions | {"numpy": "1.0"}}, ("1.0", "numpy", "place")),
        ({"versions": versions | {"orchestrator": "sources 0123456789ab"}}, ("orchestrator", "sources")),
    ):
        assert mentions(staleness(plan, recorded(plan, tmp_path, key="of it", **changed_record)), *names)


def test_results_are_up_to_date_with_another_archive_of_the_same_sources(folder, tmp_path):
    _, plan = planned(folder)

    def by(archive, key="of the sources", current=True):
        """Return the plan with another archive of the controller."""
        built = BuildInfo("components/controllers/fnn.py", key, "a tool", current)
        one = next(unit for unit in plan.instances if unit.name == "controller")
        other = replace(one, fmu=replace(one.fmu, sha256=archive, built=built))
        return replace(plan, instances=tuple(other if unit is one else unit for unit in plan.instances))

    unfinished = BuildStamp("controller_fnn", "of the sources", "").unfinished().key
    made = recorded(by("in Python", unfinished), tmp_path)
    assert staleness(by("native"), made) is None
    keys, timed = (
        [jobs.key_of(by(archive), timed=name) for archive in ("in Python", "native")]
        for name in ("", "controller")
    )
    assert keys[0] == keys[1] and timed[0] != timed[1]
    for other in (by("native", key="of other sources"), by("native", current=False)):
        assert mentions(staleness(other, made), "controller", "controller_fnn.fmu")

"""Facts that reach every instance that needs them, and warnings about suspicious values."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cars import load_scenario, make_plan
from tests.changed import changed
from tests.fmus.fake_fmus import Var, make_fmu, out
from tests.refusals import each_mentions, mentions, refused
from yawbench.foundation.errors import WiringError, warnings_in
from yawbench.orchestrator.wiring.control_side import seen_as
from yawbench.vocabulary.wheels import WHEELS

pytestmark = pytest.mark.usefixtures("common_cache")

SCENARIO = """\
vehicle: car.yaml
stop_time: 1
step_size: 0.01
{facts}
units:
  driver: {{fmu: driver_x, parameters: {{{driver}}}}}
  reference: {{fmu: reference_x, parameters: {{{reference}}}}}
  plant: {{fmu: plant_x, parameters: {{{plant}}}}}
  tyre: {{fmu: tyre_x}}
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A working directory with the FMUs of a car, each with a mass of its own."""
    monkeypatch.chdir(tmp_path)
    fmus = tmp_path / "fmus"
    speed = Var("target_speed", "m/s", start=25.0), Var("speed_gain", "N.s/m", start=0.0)
    steering = Var("steering_ratio", start=17.0), Var("amplitude", "rad", start=0.1)
    smooth = Var("smoothness", start=1.0), Var("limited", type="Boolean", start=False)
    make_fmu(fmus / "driver_x.fmu", outputs=[out("steer_angle", unit="rad")], parameters=[*speed, *steering])
    make_fmu(
        fmus / "reference_x.fmu",
        inputs=[Var("friction")],
        outputs=[out("yaw_rate_ref", unit="rad/s")],
        parameters=[Var("mass", "kg", start=1300.0), *smooth],
    )
    make_fmu(
        fmus / "plant_x.fmu",
        outputs=[out("yaw_rate", unit="rad/s")],
        parameters=[Var("mass", "kg", start=1100.0), Var("initial_speed", "m/s", start=25.0), smooth[0]],
    )
    make_fmu(fmus / "tyre_x.fmu", inputs=[Var("friction_*")], outputs=[out("tyre_force_x_*", unit="N")])
    base = Var("base_friction", start=0.9)
    make_fmu(fmus / "road_x.fmu", outputs=[out("friction_*"), out("friction_delayed")], parameters=[base])
    return tmp_path


def plan(*settings, facts='inputs: {"friction*": 0.65}', driver="", reference="", plant="",
         car="mass: 1200, steering_ratio: 16", more=""):  # fmt: skip
    """Return the plan of a scenario with these values, after --set."""
    Path("car.yaml").write_text(f"parameters: {{{car}}}\n")
    text = SCENARIO.format(facts=facts, driver=driver, reference=reference, plant=plant)
    Path("a.yaml").write_text(text + more)
    return make_plan(load_scenario("a.yaml", changes=changed(settings=settings)))


def remarks(*settings, **values):
    return [str(one) for one in warnings_in(plan(*settings, **values).diagnostics)]


def values(made, unit):
    one = next(one for one in made.instances if one.name == unit)
    return {**one.parameters, **one.constants}


def test_a_change_of_what_the_reference_is_told_alone_names_the_tyres_that_keep_theirs():
    made = plan("inputs.friction=0.3")
    (one,) = warnings_in(made.diagnostics)
    assert (one.code, one.location.signal, one.value) == ("values-differ", "reference.friction", 0.3)
    names = ("reference.friction", "0.3", "tyre.friction_*", "0.65", "--set friction=VALUE")
    assert mentions(one.message, *names)


@pytest.mark.parametrize(
    "given", [{"facts": "friction: 0.3"}, {"facts": 'friction: 0.3\ninputs: {"friction_f*": 0.3}'}]
)
def test_one_name_gives_friction_to_all_units(given):
    made = plan(**given)
    assert values(made, "reference")["friction"] == 0.3
    assert {values(made, "tyre")[f"friction_{wheel}"] for wheel in WHEELS} == {0.3}
    assert warnings_in(made.diagnostics) == ()


def test_a_changed_fact_goes_before_what_the_file_gives_and_behind_other_changes():
    given = {"facts": "inputs: {friction: 0.5, friction_fl: 0.2, 'friction*': 0.65}"}
    tyre = values(plan("friction=0.3", **given), "tyre")
    assert {tyre[f"friction_{wheel}"] for wheel in WHEELS} == {0.3}
    both = plan("friction=0.3", "inputs.friction_f*=0.1", **given)
    assert [values(both, "tyre")[f"friction_{wheel}"] for wheel in WHEELS] == [0.1, 0.1, 0.3, 0.3]


def test_a_fact_of_the_file_stands_behind_what_is_given_by_its_own_name():
    made = plan(facts="friction: 0.6\nspeed: 72 km/h\ninputs: {friction_fl: 0.2}", plant="initial_speed: 30")
    assert [values(made, "tyre")[f"friction_{wheel}"] for wheel in WHEELS] == [0.2, 0.6, 0.6, 0.6]
    assert values(made, "plant")["initial_speed"] == 30.0
    assert values(made, "driver")["target_speed"] == 20.0


def test_one_speed_reaches_the_plant_and_the_driver():
    made = plan("speed=72 km/h", plant="initial_speed: 30", driver="target_speed: 30, speed_gain: 100")
    assert (values(made, "plant")["initial_speed"], values(made, "driver")["target_speed"]) == (20.0, 20.0)
    assert str(made.changes[0].target) == "speed"
    assert warnings_in(made.diagnostics) == ()


@pytest.mark.parametrize(("settings", "friction"), [([], 0.5), (["friction=0.5"], 0.7)])
def test_friction_that_a_road_gives_is_left_to_it_and_is_that_of_the_road(settings, friction):
    made = plan(*settings, facts=f"friction: {friction}", more="  road: {fmu: road_x}\n")
    assert values(made, "reference") == {"mass": 1200.0, "friction": 0.5}
    assert values(made, "road") == {"base_friction": 0.5}
    assert values(made, "tyre") == {}


def test_a_reference_that_is_told_another_friction_than_the_roads_is_named_unless_it_is_meant():
    road = "  road: {fmu: road_x}\n"
    assert each_mentions(
        remarks("inputs.reference.friction=0.3", facts="friction: 0.5", more=road),
        ("road.base_friction", "0.5", "reference.friction", "0.3", "--set friction=VALUE"),
    )
    meant = plan(facts='friction: 0.5\ninputs: {"reference.friction": 0.3}', more=road)
    assert values(meant, "reference")["friction"] == 0.3
    assert warnings_in(meant.diagnostics) == ()
    late = "connections:\n  - {from: road.friction_delayed, to: reference.friction}\n"
    told = plan(facts="friction: 0.5", more=road + late)
    (wire,) = (w for w in told.wires if w.target == "reference")
    assert seen_as(wire, told.instances) == "late truth"


def test_a_fact_in_the_wrong_unit_is_refused():
    with refused(WiringError, "unit-mismatch", names=("--set speed=3", "'3 kg'", "m/s", "km/h")):
        plan("speed=3 kg")


def test_a_speed_held_by_the_driver_that_is_not_the_cars_is_named():
    names = ("driver.target_speed", "25 m/s", "plant.initial_speed", "22.2222 m/s", "--set speed=VALUE")
    assert each_mentions(remarks("plant.initial_speed=80 km/h", driver="speed_gain: 100"), names)
    assert remarks("plant.initial_speed=80 km/h") == []  # the driver holds no speed
    both = remarks(plant="initial_speed: 20", driver="speed_gain: 100, target_speed: 30")
    assert each_mentions(both, ("driver.target_speed", "30 m/s", "plant.initial_speed", "20 m/s"))


def test_one_mass_for_the_reference_and_another_for_the_plant_is_named():
    names = ("reference.mass", "1200 kg", "plant.mass", "1500 kg", "--set vehicle.mass=VALUE", "mass")
    assert each_mentions(remarks("plant.mass=1500"), names)


def test_two_values_that_the_scenario_gives_are_meant():
    assert remarks(plant="mass: 1500", reference="mass: 1400", car="steering_ratio: 16") == []


def test_the_fmus_own_values_of_what_is_no_property_of_the_car_are_meant():
    assert remarks("reference.smoothness=1") == []
    assert len(remarks("reference.smoothness=2")) == 1  # both FMUs have 1, so it is one matter


def test_another_cars_steering_ratio_is_named():
    assert each_mentions(remarks(car="mass: 1200"), ("driver.steering_ratio", "17"))


@pytest.mark.parametrize(
    ("setting", "names"),
    [
        ("plant.initial_speed=90", ("plant.initial_speed", "90 m/s", "70 m/s", "'90 km/h'")),
        ("driver.amplitude=30", ("driver.amplitude", "30 rad", "12.5664 rad", "'30 deg'")),
        ("friction=65", ("reference.friction", "'65 %'")),
    ],
)
def test_a_number_that_was_meant_in_another_unit_is_named(setting, names):
    assert mentions(remarks(setting), *names)


def test_a_scenario_without_contradictions_has_no_remarks_nor_has_a_speed_that_names_its_unit():
    assert remarks() == []
    assert remarks("plant.initial_speed=324 km/h") == []
    assert remarks("speed=324 km/h") == []

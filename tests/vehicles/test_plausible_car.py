"""Cars that cannot be, and units that never step: remarks of check, run and library."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from tests.cars import load_scenario, make_plan
from tests.changed import changed
from tests.fmus.fake_fmus import Var, make_fmu, out
from tests.refusals import mentions
from yawbench.foundation.errors import warnings_in
from yawbench.vehicles.derivations import known_car
from yawbench.vehicles.quantities import CAR
from yawbench.vehicles.suspicious_values import suspicious_vehicle

SCENARIOS = Path(__file__).parents[2] / "scenarios"
SCENARIO = """\
vehicle: car.yaml
stop_time: 2
step_size: 0.01
units:
  plant: {fmu: plant_x}
  controller: {fmu: controller_x}
"""
GIVEN = {
    "mass": 1650,
    "yaw_inertia": 2600,
    "cg_to_front_axle": 1.2,
    "cg_to_rear_axle": 1.55,
    "wheel_radius": 0.32,
}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch, cache):
    """A working directory with a car and a controller."""
    monkeypatch.chdir(tmp_path)
    parameters = [Var(name, CAR[name].unit, start=float(value)) for name, value in GIVEN.items()]
    make_fmu(tmp_path / "fmus/plant_x.fmu", outputs=[out("yaw_rate", unit="rad/s")], parameters=parameters)
    make_fmu(
        tmp_path / "fmus/controller_x.fmu",
        inputs=[Var("yaw_rate", "rad/s")],
        outputs=[out("yaw_moment", unit="N.m")],
    )
    return tmp_path


def remarks(*settings, **car):
    given = {**GIVEN, **car}
    Path("car.yaml").write_text("".join(["parameters:\n", *(f"  {k}: {v}\n" for k, v in given.items())]))
    Path("a.yaml").write_text(SCENARIO)
    made = make_plan(load_scenario("a.yaml", changes=changed(settings=settings)))
    return [str(one) for one in warnings_in(made.diagnostics)]


@pytest.mark.parametrize(
    "car, says",
    [
        ({"mass": 1650000}, ("vehicle.mass", "1650000 kg", "300", "5000 kg", "'1650000 g'")),
        ({"mass": "1650 t"}, ("vehicle.mass", "1650000 kg", "300", "5000 kg", "'1650 kg'")),
        ({"mass": 1.65}, ("vehicle.mass", "'1.65 t'")),
        ({"yaw_inertia": 26}, ("vehicle.yaw_inertia", "26 kg.m2", "150", "15000 kg.m2")),
        ({"wheel_radius": 320}, ("vehicle.wheel_radius", "'320 mm'")),
        ({"wheelbase": 2750, "cg_to_front_axle": 1200, "cg_to_rear_axle": 1550}, ("wheelbase", "'2750 mm'")),
        ({"cg_height": 55}, ("vehicle.cg_height", "'55 cm'")),
    ],
)
def test_a_quantity_that_no_car_has_is_named_with_the_unit_that_was_probably_meant(car, says):
    assert mentions(remarks(**car), *says)


def test_a_car_that_can_be_has_no_remarks_and_what_is_turned_off_is_meant():
    assert remarks() == []
    assert remarks(cg_height=0, anti_roll_stiffness_rear=0) == []


def test_a_value_is_named_once_wherever_it_is_given():
    assert len(remarks("vehicle.mass=1650000")) == 1
    (own,) = remarks("plant.mass=1650000")
    assert own.startswith("plant.mass: ")


def test_a_unit_whose_step_is_longer_than_the_run_is_named():
    (says,) = remarks("controller.step_size=10")
    assert mentions(says, "step_size", "10 s", "2 s")
    assert remarks("controller.step_size=2") == []


def test_check_does_not_say_that_nothing_is_wrong(yawbench):
    remarks(mass=1650000)
    status, shown, told = yawbench("check", "a.yaml")
    assert (status, "No errors." in shown) == (0, False)
    assert mentions(shown, "1 suspicious", "see", "notes")
    assert mentions(told, "note", "vehicle.mass", "1650000 kg")


@pytest.mark.parametrize("file", sorted((SCENARIOS / "vehicles").glob("*.yaml")), ids=lambda file: file.stem)
def test_every_car_of_the_library_is_plausible_with_all_that_follows(file):
    given = yaml.safe_load(file.read_text())["parameters"]
    assert suspicious_vehicle(given) == []
    known = known_car(given).values
    for name, value in known.items():
        low, high = CAR[name].plausible or (value, value)
        assert low <= value <= high, name

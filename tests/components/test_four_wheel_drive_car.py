"""The vehicle file of paper B and the defaults of its units agree, and its stiffnesses with the tyres."""

from __future__ import annotations

from pathlib import Path

import pytest
from ruamel.yaml import YAML

from yawbench.components.actuators.lag import Lag
from yawbench.components.allocators.side_share import SideShare
from yawbench.components.controllers.fuzzy_sliding_mode import FuzzySlidingMode
from yawbench.components.controllers.sliding_mode import SlidingMode
from yawbench.components.plants.eight_dof import EightDof
from yawbench.components.references.single_track import SingleTrack
from yawbench.components.tyre_models.pacejka_2002_set import MagicFormulaParameters, coefficients
from yawbench.vehicles.quantities import BODY

from .magic import forces_and_moment

CAR = Path(__file__).parents[2] / "scenarios" / "vehicles" / "four_wheel_drive_car.yaml"
UNITS = (SingleTrack, SlidingMode, FuzzySlidingMode, SideShare, Lag, EightDof)


@pytest.fixture(scope="module")
def car():
    return YAML(typ="safe").load(CAR.read_text(encoding="utf-8"))["parameters"]


def test_every_value_belongs_to_a_parameter_of_plant_or_reference(car):
    # These two stand in every scenario of the car, whatever else is exchanged.
    declared = {v.name for unit in (EightDof, SingleTrack) for v in unit.variables}
    assert set(car) <= declared | {*BODY, "vehicle_width"}


def test_a_unit_without_a_vehicle_file_is_the_papers_car(car):
    for unit in UNITS:
        for variable in unit.variables:
            if variable.causality == "parameter" and variable.name in car:
                assert variable.start == float(car[variable.name]), f"{unit.fmu_name}.{variable.name}"


@pytest.mark.parametrize("axle, arm", [("front", "cg_to_rear_axle"), ("rear", "cg_to_front_axle")])
def test_the_axle_stiffnesses_are_those_of_the_tyres_at_their_static_loads(car, axle, arm):
    wheelbase = car["cg_to_front_axle"] + car["cg_to_rear_axle"]
    load = 0.5 * car["mass"] * 9.81 * car[arm] / wheelbase
    _, f_y, _ = forces_and_moment(0.0, 1e-5, load, 1.0, coefficients(MagicFormulaParameters(), axle))
    assert -2.0 * f_y / 1e-5 == pytest.approx(car[f"cornering_stiffness_{axle}"], rel=2e-3)

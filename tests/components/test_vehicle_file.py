"""The vehicle file of paper A and the defaults of the units agree."""

from __future__ import annotations

from pathlib import Path

import pytest
from ruamel.yaml import YAML

from yawbench.components.allocators.fixed_share import FixedShare
from yawbench.components.allocators.load_proportional import LoadProportional
from yawbench.components.plants.seven_dof import SevenDof
from yawbench.components.references.steady_state import SteadyState
from yawbench.components.tyres.dugoff import Dugoff
from yawbench.components.tyres.linear import LinearTyre
from yawbench.components.wheel_controls.direct import Direct

CAR = Path(__file__).parents[2] / "scenarios" / "vehicles" / "in_wheel_motor_car.yaml"
UNITS = (SteadyState, LoadProportional, FixedShare, Direct, SevenDof, Dugoff, LinearTyre)


@pytest.fixture(scope="module")
def car():
    return YAML(typ="safe").load(CAR.read_text(encoding="utf-8"))["parameters"]


def defaults():
    return [
        (component.fmu_name, v.name, v.start)
        for component in UNITS
        for v in component.variables
        if v.causality == "parameter"
    ]


def test_a_unit_without_a_vehicle_file_is_the_papers_car(car):
    for unit, name, default in defaults():
        two_tyres = default == 0.0 and name.startswith("cornering_stiffness_")
        if name in car:
            assert float(car[name]) == (car[name] if two_tyres else default), f"{unit}.{name}"


def test_the_axle_stiffness_is_that_of_two_tyres(car):
    assert car["cornering_stiffness_front"] == 2 * car["cornering_stiffness"]
    assert car["cornering_stiffness_rear"] == 2 * car["cornering_stiffness"]

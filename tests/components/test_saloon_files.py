"""The vehicle files of papers C and D: what they hold belongs to units, agrees with defaults and tyres."""

from __future__ import annotations

from pathlib import Path

import pytest
from ruamel.yaml import YAML

from yawbench.components.drivers.sine import Sine
from yawbench.components.plants.fourteen_dof import FourteenDof
from yawbench.components.plants.two_dof import TwoDof
from yawbench.components.references.single_track import SingleTrack
from yawbench.components.tyre_models.bakker_1987 import (
    MagicFormula1987Parameters,
    coefficients_1987,
    loaded_tyre,
)
from yawbench.components.tyre_models.pacejka_2002_set import MagicFormulaParameters, coefficients
from yawbench.components.tyres.magic_formula import MagicFormula
from yawbench.components.tyres.magic_formula_1987 import MagicFormula1987
from yawbench.vehicles.quantities import BODY

from .magic import forces_and_moment

FOLDER = Path(__file__).parents[2] / "scenarios" / "vehicles"
G = 9.81
CARS = [
    pytest.param("large_saloon", FourteenDof, (SingleTrack, Sine, MagicFormula), id="large saloon"),
    pytest.param("esp_saloon", TwoDof, (SingleTrack, Sine, MagicFormula1987), id="ESP saloon"),
]


def load(name):
    return YAML(typ="safe").load((FOLDER / f"{name}.yaml").read_text(encoding="utf-8"))["parameters"]


def parameters(*components):
    return {v.name for c in components for v in c.variables if v.causality == "parameter"}


@pytest.mark.parametrize("name, plant, others", CARS)
def test_every_value_belongs_to_a_parameter_of_a_unit(name, plant, others):
    assert set(load(name)) <= parameters(plant, *others) | {*BODY, "vehicle_width"}


@pytest.mark.parametrize("name, plant, others", CARS)
def test_a_plant_without_a_vehicle_file_is_the_papers_car(name, plant, others):
    car = load(name)
    for v in plant.variables:
        if v.causality == "parameter" and v.name in car:
            assert float(car[v.name]) == v.start, v.name


@pytest.mark.parametrize("name, plant, others", CARS)
def test_the_file_leaves_nothing_of_the_car_to_defaults(name, plant, others):
    choices_of_the_run = {"initial_speed", "initial_sideslip", "initial_yaw_rate", "initial_heave"}
    numerics = {"low_speed", "slip_stiffness_per_load"}
    implied = {"front_unsprung_share", "sprung_roll_yaw_product"}  # equal wheels, principal axes
    implied |= {"roll_camber_front", "roll_camber_rear"}  # of tyres that take camber, as the paper's do not
    implied |= {"slip_angle_relaxation"}  # these are off
    implied |= {f"{what}_{axle}" for what in ("roll_steer", "steer_stiffness") for axle in ("front", "rear")}
    assert parameters(plant) - set(load(name)) <= choices_of_the_run | numerics | implied


def axle_loads(car):
    share = car["mass"] * G / (2 * (car["cg_to_front_axle"] + car["cg_to_rear_axle"]))
    return {"front": share * car["cg_to_rear_axle"], "rear": share * car["cg_to_front_axle"]}


def test_the_scaled_tyres_of_the_large_saloon_have_the_papers_cornering_stiffnesses():
    car = load("large_saloon")
    scales = {k: car[k] for k in ("cornering_stiffness_scale_front", "cornering_stiffness_scale_rear")}
    for axle, f_z in axle_loads(car).items():
        c = coefficients(MagicFormulaParameters(**scales), axle)
        stiffness = -2 * forces_and_moment(0.0, 1e-6, f_z, 1.0, c)[1] / 1e-6
        assert stiffness == pytest.approx(car[f"cornering_stiffness_{axle}"], rel=0.006)


def test_the_reference_of_the_esp_saloon_has_the_cornering_stiffnesses_of_its_tyres():
    car = load("esp_saloon")
    c = coefficients_1987(MagicFormula1987Parameters())
    for axle, f_z in axle_loads(car).items():
        assert 2 * loaded_tyre(f_z, 0.5, c).k_y == pytest.approx(car[f"cornering_stiffness_{axle}"], rel=1e-3)

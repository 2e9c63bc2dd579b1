"""The vehicle files of the papers agree with the defaults of their units, and stiffnesses with the tyres."""

from __future__ import annotations

from pathlib import Path

import pytest
from ruamel.yaml import YAML

from yawbench.components.actuators.lag import Lag
from yawbench.components.allocators.fixed_share import FixedShare
from yawbench.components.allocators.load_proportional import LoadProportional
from yawbench.components.allocators.side_share import SideShare
from yawbench.components.controllers.fuzzy_sliding_mode import FuzzySlidingMode
from yawbench.components.controllers.sliding_mode import SlidingMode
from yawbench.components.drivers.sine import Sine
from yawbench.components.plants.eight_dof import EightDof
from yawbench.components.plants.fourteen_dof import FourteenDof
from yawbench.components.plants.seven_dof import SevenDof
from yawbench.components.plants.two_dof import TwoDof
from yawbench.components.references.single_track import SingleTrack
from yawbench.components.references.steady_state import SteadyState
from yawbench.components.tyre_models.bakker_1987 import (
    MagicFormula1987Parameters,
    coefficients_1987,
    loaded_tyre,
)
from yawbench.components.tyre_models.pacejka_2002_set import MagicFormulaParameters, coefficients
from yawbench.components.tyres.dugoff import Dugoff
from yawbench.components.tyres.linear import LinearTyre
from yawbench.components.tyres.magic_formula import MagicFormula
from yawbench.components.tyres.magic_formula_1987 import MagicFormula1987
from yawbench.components.wheel_controls.direct import Direct
from yawbench.vehicles.quantities import BODY
from yawbench.vocabulary.gravity import G

from .magic import forces_and_moment

FOLDER = Path(__file__).parents[2] / "scenarios" / "vehicles"
DEFAULTS = {
    "in_wheel_motor_car": (SteadyState, LoadProportional, FixedShare, Direct, SevenDof, Dugoff, LinearTyre),
    "four_wheel_drive_car": (SingleTrack, SlidingMode, FuzzySlidingMode, SideShare, Lag, EightDof),
    "large_saloon": (FourteenDof,),
    "esp_saloon": (TwoDof,),
}
"""Paper's car -> units whose defaults are that car."""
TAKES = {
    "four_wheel_drive_car": (EightDof, SingleTrack),
    "large_saloon": (FourteenDof, SingleTrack, Sine, MagicFormula),
    "esp_saloon": (TwoDof, SingleTrack, Sine, MagicFormula1987),
}
"""Car -> units that take all that its file says, the plant first."""


def load(name):
    return YAML(typ="safe").load((FOLDER / f"{name}.yaml").read_text(encoding="utf-8"))["parameters"]


def parameters(*components):
    return {v.name for c in components for v in c.variables if v.causality == "parameter"}


@pytest.mark.parametrize("name", DEFAULTS)
def test_a_unit_without_a_vehicle_file_is_the_papers_car(name):
    car = load(name)
    for unit in DEFAULTS[name]:
        for v in unit.variables:
            of_two_tyres = v.start == 0.0 and v.name.startswith("cornering_stiffness_")
            if v.causality == "parameter" and v.name in car and not of_two_tyres:
                assert v.start == float(car[v.name]), f"{unit.fmu_name}.{v.name}"


@pytest.mark.parametrize("name", TAKES)
def test_every_value_belongs_to_a_parameter_of_a_unit(name):
    assert set(load(name)) <= parameters(*TAKES[name]) | {*BODY, "vehicle_width"}


@pytest.mark.parametrize("name", ["large_saloon", "esp_saloon"])
def test_the_file_leaves_nothing_of_the_car_to_defaults(name):
    choices_of_the_run = {"initial_speed", "initial_sideslip", "initial_yaw_rate", "initial_heave"}
    numerics = {"low_speed", "slip_stiffness_per_load"}
    implied = {"front_unsprung_share", "sprung_roll_yaw_product"}  # equal wheels, principal axes
    implied |= {"roll_camber_front", "roll_camber_rear"}  # of tyres that take camber, as the paper's do not
    implied |= {"slip_angle_relaxation"}  # these are off
    implied |= {f"{what}_{axle}" for what in ("roll_steer", "steer_stiffness") for axle in ("front", "rear")}
    assert parameters(TAKES[name][0]) - set(load(name)) <= choices_of_the_run | numerics | implied


def of_magic_formula(car, axle, f_z):
    scales = {k: car[k] for k in car if k.startswith("cornering_stiffness_scale_")}
    c = coefficients(MagicFormulaParameters(**scales), axle)
    return -forces_and_moment(0.0, 1e-6, f_z, 1.0, c)[1] / 1e-6


@pytest.mark.parametrize(
    ("name", "of_tyre", "within"),
    [
        ("in_wheel_motor_car", lambda car, axle, f_z: car["cornering_stiffness"], 1e-12),
        ("four_wheel_drive_car", of_magic_formula, 2e-3),
        ("large_saloon", of_magic_formula, 6e-3),
        (
            "esp_saloon",
            lambda car, axle, f_z: loaded_tyre(f_z, 0.5, coefficients_1987(MagicFormula1987Parameters())).k_y,
            1e-3,
        ),
    ],
)
def test_the_stiffness_of_an_axle_is_that_of_its_two_tyres_at_their_static_load(name, of_tyre, within):
    car = load(name)
    share = car["mass"] * G / (2 * (car["cg_to_front_axle"] + car["cg_to_rear_axle"]))
    for axle, arm in (("front", "cg_to_rear_axle"), ("rear", "cg_to_front_axle")):
        stiffness = 2 * of_tyre(car, axle, share * car[arm])
        assert stiffness == pytest.approx(car[f"cornering_stiffness_{axle}"], rel=within)

"""Checks of cars on an inclined road and in side wind, against closed forms."""

from __future__ import annotations

from math import cos, radians, sin, sqrt

import pytest

from yawbench.components.cars.road_plane import LEVEL, pull_of
from yawbench.components.plants.eight_dof import EightDof
from yawbench.components.plants.fourteen_dof import FourteenDof
from yawbench.components.plants.seven_dof import SevenDof
from yawbench.components.plants.two_dof import TwoDof
from yawbench.components.roads.patchwork import Patchwork
from yawbench.components.tyres.magic_formula_62_transient import MagicFormula62Transient
from yawbench.vocabulary.gravity import G

from .loop import Loop
from .stand import Stand, four, wheel_values

FREE = {"drag_coefficient": 0.0, "rolling_resistance": 0.0}
PLANTS = {SevenDof: {}, EightDof: FREE, FourteenDof: FREE}
plants = pytest.mark.parametrize("plant", PLANTS, ids=lambda plant: plant.__name__)
lateral = pytest.mark.parametrize("plant", [*PLANTS, TwoDof], ids=lambda plant: plant.__name__)
NAMES = ("slope", "bank", "wind_force_y", "wind_moment_z")


def stand_of(plant, **more):
    return Stand(plant, **PLANTS.get(plant, {}), **more)


def held(stand, seconds, h=0.004, **inputs):
    """Return the outputs after some time of constant inputs."""
    stand.start(**inputs)
    for _ in range(round(seconds / h)):
        y = stand.step(h, **inputs)
    return y


def forces(p, *, x=0.0, y=0.0):
    """Return tyre forces that add up to x, y [N] and turn nothing."""
    a, b = p.cg_to_front_axle, p.cg_to_rear_axle
    front, rear = 0.5 * b / (a + b) * y, 0.5 * a / (a + b) * y
    return four("tyre_force_x", 0.25 * x) | four("tyre_force_y", front, front, rear, rear)


def loads(y):
    return wheel_values(y, "vertical_load")


def test_a_level_road_without_wind_changes_no_bit():
    assert pull_of((0.0, -0.0, 0.0, 0.0), 1000.0) is LEVEL
    for number in (0.0, -0.0, 1e-300, 3.7):
        assert [repr(number + part) for part in LEVEL] == [repr(number)] * len(LEVEL)
        assert repr(G - LEVEL.lighter) == repr(G)


def test_a_plant_may_have_inputs_of_its_own_after_those_of_road_and_wind():
    class Mine(SevenDof):
        inputs = (*SevenDof.inputs, "yaw_rate_ref")

    assert held(stand_of(Mine), 0.1, slope=0.1) == held(stand_of(SevenDof), 0.1, slope=0.1)


@plants
def test_held_on_a_slope_a_car_stands_on_the_axles_that_statics_says(plant):
    slope, stand = 0.15, stand_of(plant, initial_speed=0.0)
    p = plant.Parameters()
    weight = p.mass * G
    y = held(stand, 4.0, slope=slope, **forces(p, x=weight * sin(slope)))
    assert abs(y["velocity_x"]) < 1e-9
    wheelbase = p.cg_to_front_axle + p.cg_to_rear_axle
    front = weight * (cos(slope) * p.cg_to_rear_axle - sin(slope) * p.cg_height) / wheelbase
    found = loads(y)
    settled = 1e-6 if plant is FourteenDof else 1e-9
    assert sum(found) == pytest.approx(weight * cos(slope), rel=settled)
    rel = 2e-3 if plant is FourteenDof else 1e-12  # its springs give, and its centre of mass moves with them
    assert found[0] + found[1] == pytest.approx(front, rel=rel)


@lateral
def test_a_steady_bank_takes_the_side_force_that_holds_the_car_and_nothing_else(plant):
    bank, stand = radians(6.0), stand_of(plant, initial_speed=15.0)
    p = plant.Parameters()
    y = held(stand, 4.0, bank=bank, **forces(p, y=p.mass * G * sin(bank)))
    for name in ("velocity_y", "yaw_rate", "acceleration_y", "position_y"):
        assert abs(y[name]) < (5e-3 if plant is FourteenDof else 1e-9), name  # the body sways at the start
    assert y["velocity_x"] == pytest.approx(15.0, rel=1e-8)
    left, right = loads(y)[::2], loads(y)[1::2]
    assert sum(left) < sum(right)  # the left side is up
    assert sum(left + right) == pytest.approx(p.mass * G * cos(bank), rel=1e-6)
    if plant in (SevenDof, TwoDof):
        shift = p.mass * G * sin(bank) * p.cg_height / p.track_width
        assert sum(right) - sum(left) == pytest.approx(2.0 * shift, rel=1e-9)


@lateral
def test_wind_through_the_centre_of_mass_pushes_as_the_bank_of_that_force_does(plant):
    force = 1500.0
    mass = plant.Parameters().mass
    in_wind = held(stand_of(plant), 1.0, wind_force_y=force)
    on_bank = held(stand_of(plant), 1.0, bank=-force / (mass * G))
    assert in_wind["velocity_y"] == pytest.approx(force / mass, rel=1e-9)
    assert in_wind["velocity_y"] == pytest.approx(on_bank["velocity_y"], rel=1e-2)


@lateral
def test_the_winds_moment_turns_the_car(plant):
    y = held(stand_of(plant), 0.5, wind_moment_z=300.0)
    inertia = plant.Parameters().yaw_inertia
    assert y["yaw_rate"] == pytest.approx(0.5 * 300.0 / inertia, rel=1e-5)


def test_a_braked_car_stands_on_a_slope_on_tyres_with_relaxation_lengths():
    braked = four("wheel_torque", -900.0) | four("friction", 0.9)
    units = [(EightDof, {"initial_speed": 0.5}), (MagicFormula62Transient, {})]
    loop = Loop(units, algorithm="extrapolated", constants={"slope": 0.1, **braked})
    loop.run(4.0, 2000, lambda _: None)
    assert abs(loop["velocity_x"]) < 1e-8
    held = sum(wheel_values(loop, "tyre_force_x"))
    assert held == pytest.approx(EightDof.Parameters().mass * G * sin(0.1), rel=1e-4)


@plants
def test_a_car_that_slides_turning_over_an_inclined_plane_flies_the_parabola_and_keeps_its_energy(plant):
    sigma, epsilon, speed = 0.06, -0.04, 12.0
    start = {"initial_speed": speed, "initial_yaw_rate": 1.3}
    units = [
        (plant, PLANTS[plant] | start),
        (Patchwork, {"road_slope": sigma, "road_bank": epsilon}),
    ]
    loop = Loop(units, algorithm="extrapolated")
    t = 3.0
    loop.run(t, 1500, lambda _: None)
    fall_x, fall_y = -G * sin(sigma), -G * sin(epsilon)
    assert loop["yaw_angle"] == pytest.approx(1.3 * t, rel=1e-3)
    assert loop["position_x"] == pytest.approx(speed * t + 0.5 * fall_x * t * t, abs=2e-5)
    assert loop["position_y"] == pytest.approx(0.5 * fall_y * t * t, abs=2e-5)
    height = loop["position_x"] * sin(sigma) + loop["position_y"] * sin(epsilon)
    kinetic = 0.5 * (loop["velocity_x"] ** 2 + loop["velocity_y"] ** 2)
    assert kinetic + G * height == pytest.approx(0.5 * speed**2, rel=1e-6)
    normal = sqrt(1.0 - sin(sigma) ** 2 - sin(epsilon) ** 2)
    weight = loop.units[0].slave.p.mass * G * normal
    assert sum(wheel_values(loop, "vertical_load")) == pytest.approx(weight, rel=1e-6)

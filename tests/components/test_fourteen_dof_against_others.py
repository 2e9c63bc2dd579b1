"""The car with 14 degrees of freedom against the one with eight and an independent solution."""

from __future__ import annotations

from functools import cache
from math import log2

import numpy as np
import pytest

from tests.evidence import measured
from yawbench.components.allocators.single_wheel import SingleWheel
from yawbench.components.drivers.ramp import Ramp
from yawbench.components.plants.eight_dof import EightDof
from yawbench.components.plants.fourteen_dof import FourteenDof
from yawbench.components.tyre_models.pacejka_2002_set import MagicFormulaParameters, coefficients
from yawbench.components.tyres.dugoff import Dugoff
from yawbench.components.tyres.magic_formula import MagicFormula
from yawbench.components.wheel_controls.hydraulic import Hydraulic

from . import monolith, monolith_c
from .fourteen_dof import (
    FREE,
    MU,
    SCALES,
    SPEED,
    STEER,
    drive,
)
from .loop import Loop, Straight
from .magic import forces_and_moment
from .stand import four


def test_stiff_in_heave_and_pitch_the_car_is_the_one_with_eight_degrees_of_freedom():
    track, k_roll, c_roll, share = 1.48, 56000.0, 2600.0, 0.55
    m, m_s, roll_arm, centre = 1350.0, 1110.0, 0.4, 0.14
    shared = {"mass": m, "sprung_mass": m_s, "yaw_inertia": 1343.1, "track_width": track}
    shared |= {"cg_to_front_axle": 1.04, "cg_to_rear_axle": 1.56, "wheel_radius": 0.313, "wheel_inertia": 2.1}
    shared |= {"roll_centre_height_front": centre, "roll_centre_height_rear": centre, **FREE}
    shared["cg_height"] = centre + m_s * roll_arm / m  # wheels' masses on the roll axis, as there
    stiff, per_track = 1e7, 1.0 / (0.5 * track**2)
    springs = {"spring_stiffness_front": stiff, "spring_stiffness_rear": stiff}
    # A negative anti-roll bar takes the springs' stiffness out of roll again.
    springs["anti_roll_stiffness_front"] = 0.5 * (share * k_roll * per_track - stiff)
    springs["anti_roll_stiffness_rear"] = 0.5 * ((1 - share) * k_roll * per_track - stiff)
    springs["damping_front"] = share * c_roll * per_track
    springs["damping_rear"] = (1 - share) * c_roll * per_track
    springs |= {"tyre_vertical_stiffness": 3e7, "unsprung_height": centre}
    springs["sprung_roll_inertia"] = 440.6 - m_s * roll_arm**2
    springs["sprung_pitch_inertia"] = 790.0
    springs["front_unsprung_share"] = 1.56 / 2.6  # no product of inertia of roll and yaw
    names = ["yaw_rate", "roll_angle", *four("vertical_load", 0.0), *four("slip_angle", 0.0)]
    setting = {"steer": 0.03, "mu": 0.65, "until": 2.5, "frequency": 0.4, "record": names}
    fourteen = drive(Dugoff, **setting, **shared, **springs)
    eight = drive(Dugoff, plant=EightDof, **setting, **shared)
    assert SPEED * np.abs(eight[0]).max() > 4.0  # two thirds of the grip
    for name, f, e in zip(names, fourteen, eight, strict=True):
        peak = np.abs(e - e[0]).max()
        # There the moment of X about the displaced centre of mass is left out, here tyres yield a little.
        assert np.abs(f - e).max() < (1e-3 if name == "yaw_rate" else 4e-3) * peak, name


NAMES = ["position_x", "position_y", "yaw_angle", "heave", "roll_angle", "pitch_angle"]
NAMES += ["velocity_x", "velocity_y", "yaw_rate", "roll_rate", *four("wheel_speed", 0.0)]
ROWS = [0, 1, 2, 3, 4, 5, 10, 11, 12, 14, 20, 21, 22, 23]


@cache
def magic(axle):
    return coefficients(MagicFormulaParameters(**SCALES), axle)


def tyre_of(alpha, kappa, load, mu, wheel):
    return forces_and_moment(kappa, alpha, load, mu, magic("front" if wheel < 2 else "rear"))[:2]


LAGRANGE = "scipy, Lagrange's equations of rigid bodies"


@cache
def exact_sine():
    """The hand-wheel sine of paper C, uncontrolled, every 4 ms."""
    return monolith_c.solve(
        np.linspace(0.0, 6.0, 1501),
        tyre=tyre_of,
        steer=monolith.sine(STEER, 0.2, 0.5, 1.0),
        speed=SPEED,
        mu=[MU] * 4,
        kinks=[0.5, 5.5],
    )[ROWS]


def sine_errors(h, **options):
    found = drive(h=h, record=NAMES, **options)[:, :: round(4e-3 / h)]
    return np.abs(found - exact_sine()).max(axis=1) / np.abs(exact_sine()).max(axis=1)


@pytest.mark.exhaustive
def test_the_hand_wheel_sine_is_within_a_ten_thousandth_of_an_independent_solution_at_1_ms():
    errors = sine_errors(1e-3)
    car = "plant_fourteen_dof, tyre_magic_formula, hand-wheel sine"
    measured("cars", car, LAGRANGE, errors.max(), at_most=1e-4)


@pytest.mark.exhaustive
def test_the_coupled_car_is_of_second_order():
    coarse, fine = (sine_errors(h)[NAMES.index("yaw_rate")] for h in (2e-3, 1e-3))
    assert log2(coarse / fine) < 2.4
    car = "plant_fourteen_dof, hand-wheel sine"
    measured("order", f"`extrapolated`, {car}", LAGRANGE, log2(coarse / fine), at_least=1.8)


@pytest.mark.exhaustive
def test_paper_cs_ramp_at_a_held_speed_is_within_a_thousandth_of_an_independent_solution():
    times = np.linspace(0.0, 9.0, 2251)
    exact = monolith_c.solve(
        times,
        tyre=tyre_of,
        steer=lambda t: STEER * min(max(0.5 * (t - 1.0), 0.0), 1.0),
        speed=SPEED,
        mu=[MU] * 4,
        held=SPEED,
        kinks=[1.0, 3.0],
        tolerance=1e-7,
    )
    ramp = {"constant_drive_force": monolith_c.HELD[0], "target_speed": SPEED, "start_time": 1.0}
    units = [(Ramp, ramp), (SingleWheel, {}), (Hydraulic, {}), (Straight, {})]
    units += [(FourteenDof, {"initial_speed": SPEED}), (MagicFormula, SCALES)]
    loop = Loop(units, algorithm="extrapolated", constants=four("friction", MU))
    names = ["velocity_x", "velocity_y", "yaw_rate", *four("wheel_speed", 0.0)]
    found = np.array(loop.run(9.0, 9000, lambda now: [now[name] for name in names])).T[:, ::4]
    exact = exact[[10, 11, 12, 20, 21, 22, 23]]
    errors = np.abs(found - exact).max(axis=1) / np.abs(exact).max(axis=1)
    car = "plant_fourteen_dof, tyre_magic_formula, hand-wheel ramp at a held speed"
    measured("cars", car, LAGRANGE, errors.max(), at_most=1e-3)
    here, there = (np.abs(np.arctan2(v_y, v_x)).max() for v_x, v_y in (found[:2], exact[:2]))
    assert here == pytest.approx(there, rel=1e-3)


@pytest.mark.exhaustive
def test_braking_in_the_turn_is_within_two_thousandths_of_an_independent_solution():
    torque = (-250.0, -250.0, -100.0, -100.0)
    times = np.linspace(0.0, 3.0, 751)
    exact = monolith_c.solve(
        times,
        tyre=tyre_of,
        steer=monolith.sine(STEER, 0.2, 0.5, 1.0),
        speed=SPEED,
        mu=[MU] * 4,
        torque=lambda t: torque,
        kinks=[0.5],
    )[ROWS]
    found = drive(until=3.0, record=NAMES, torque=torque)[:, ::4]
    errors = np.abs(found - exact).max(axis=1) / np.abs(exact).max(axis=1)
    assert exact[NAMES.index("velocity_x"), -1] < 21.0
    car = "plant_fourteen_dof, tyre_magic_formula, braking in a turn"
    measured("cars", car, LAGRANGE, errors.max(), at_most=2e-3)

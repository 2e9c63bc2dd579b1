"""The car with eight degrees of freedom: closed forms, limits, conservation, an independent solution."""

from __future__ import annotations

from math import atan, cos, sin, sqrt, tan

import numpy as np
import pytest

from tests.evidence import measured
from yawbench.components.cars.rolling_body import G, RollingCarParameters
from yawbench.components.drivers.sine import Sine
from yawbench.components.plants.eight_dof import EightDof
from yawbench.components.tyre_models.pacejka_2002_set import MagicFormulaParameters, coefficients
from yawbench.components.tyres.dugoff import Dugoff
from yawbench.components.tyres.magic_formula import MagicFormula

from . import monolith, monolith_b
from .loop import drive_on
from .magic import forces_and_moment
from .stand import Stand, four, wheel_values

P = RollingCarParameters()
COUPLING = P.sprung_mass * P.roll_arm
FREE = {"drag_coefficient": 0.0, "rolling_resistance": 0.0}


def lateral(force: float) -> dict[str, float]:
    """Lateral forces of `force` [N] in all that do not turn the car."""
    wheelbase = P.cg_to_front_axle + P.cg_to_rear_axle
    front, rear = 0.5 * force * P.cg_to_rear_axle / wheelbase, 0.5 * force * P.cg_to_front_axle / wheelbase
    return four("tyre_force_y", front, front, rear, rear)


def drive(tyre, *, plant=EightDof, mu=0.8, steer=0.0, until=1.0, h=1e-3, record, torque=(0.0,), **parameters):
    """Return the recorded signals (rows) of a car driven through one loop of plant and tyre."""
    sine = {"amplitude": steer, "frequency": 0.4, "start_time": 0.2}
    units = [(Sine, sine), (plant, parameters), (tyre, {})]
    return drive_on(units, mu=mu, until=until, h=h, record=record, torque=torque)


def roll_energy(y: dict[str, float]) -> float:
    v_y, phi, dphi = y["velocity_y"], y["roll_angle"], y["roll_rate"]
    moving = 0.5 * P.mass * v_y**2 - COUPLING * v_y * dphi + 0.5 * P.roll_inertia * dphi**2
    return moving + 0.5 * P.roll_stiffness * phi**2 + COUPLING * G * (cos(phi) - 1.0)


def test_steady_roll_angle_and_load_transfer_match_the_closed_form():
    force = 6000.0
    stand = Stand(EightDof, initial_speed=20.0, **FREE)
    y = stand.start()
    for _ in range(1000):
        y = stand.step(0.01, **lateral(force))
    a_y = force / P.mass
    phi = COUPLING * a_y / (P.roll_stiffness - COUPLING * G)
    for _ in range(20):
        phi = (COUPLING * a_y + COUPLING * G * sin(phi)) / P.roll_stiffness
    assert y["roll_angle"] == pytest.approx(phi, rel=1e-12)
    assert y["roll_rate"] == pytest.approx(0.0, abs=1e-12)
    assert y["acceleration_y"] == pytest.approx(a_y, rel=1e-12)
    front = (0.55 * P.roll_stiffness * phi + 0.14 * force * 1.56 / 2.6) / 1.48
    rear = (0.45 * P.roll_stiffness * phi + 0.14 * force * 1.04 / 2.6) / 1.48
    assert y["vertical_load_fr"] - y["vertical_load_fl"] == pytest.approx(2 * front, rel=1e-12)
    assert y["vertical_load_rr"] - y["vertical_load_rl"] == pytest.approx(2 * rear, rel=1e-12)
    # All of it is what the lateral forces and the displaced sprung mass do about the ground.
    assert (front + rear) * 1.48 == pytest.approx(
        (COUPLING + 0.14 * P.mass) * a_y + COUPLING * G * sin(phi), rel=1e-12
    )


def test_a_start_with_lateral_forces_is_in_roll_equilibrium():
    stand = Stand(EightDof, initial_speed=20.0, **FREE)
    before = stand.start(**lateral(4000.0))
    after = stand.step(0.01)
    assert before["roll_angle"] > 0.02
    assert after["roll_angle"] == pytest.approx(before["roll_angle"], rel=1e-12)
    assert after["roll_rate"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("damping", [2600.0, 0.0])
@pytest.mark.sampled(1)
def test_rolling_conserves_lateral_momentum_and_loses_energy_only_to_the_dampers(damping):
    stand = Stand(EightDof, initial_speed=0.0, roll_damping=damping, **FREE)
    y = stand.start(**lateral(5000.0))
    first, lost, off = roll_energy(y), 0.0, 0.0
    h = 2.5e-4
    for _ in range(4000):
        before = y["roll_rate"]
        y = stand.step(h, **lateral(0.0))
        lost += h * damping * ((before + y["roll_rate"]) / 2) ** 2
        assert P.mass * y["velocity_y"] == pytest.approx(COUPLING * y["roll_rate"], abs=1e-9)
        off = max(off, abs(roll_energy(y) + lost - first) / first)
    what = f"plant_eight_dof, rolling, damping {damping:g} N.m.s/rad"
    measured("energy", what, "its start less the dampers' work", off, at_most=2e-5)
    if damping:
        assert lost == pytest.approx(first, rel=1e-3)


def test_coasting_down_matches_the_closed_form_of_drag_and_rolling_resistance():
    (speed,) = drive(Dugoff, until=10.0, h=4e-3, record=["velocity_x"], initial_speed=30.0)
    drag = 0.5 * P.air_density * P.drag_coefficient * P.frontal_area
    rolling = P.rolling_resistance * P.mass * G
    mass = P.mass + 4.0 * P.wheel_inertia / P.wheel_radius**2
    terminal, rate = sqrt(rolling / drag), sqrt(rolling * drag) / mass
    # Wheels that are first taken to their slip push the car: 5e-5 of its speed.
    assert speed[-1] == pytest.approx(terminal * tan(atan(30.0 / terminal) - rate * 10.0), rel=1e-4)


def test_the_excess_of_rotating_mass_slows_longitudinal_motion_alone():
    stand = Stand(EightDof, initial_speed=10.0, rotating_mass_excess=0.04, **FREE)
    y = stand.start(**four("tyre_force_x", 300.0))
    assert y["acceleration_x"] == pytest.approx(1200.0 / (1.04 * P.mass), rel=1e-12)


def magic(alpha: float, kappa: float, load: float, mu: float) -> tuple[float, float]:
    f_x, f_y, _ = forces_and_moment(kappa, alpha, load, mu, MAGIC)
    return f_x, f_y


SCIPY = "scipy, one system of equations"
MAGIC = coefficients(MagicFormulaParameters(), "front")
RUNS = [
    pytest.param(Dugoff, monolith.tyre, 25.0, 0.05, 0.65, id="Dugoff, 25 m/s, mu 0.65"),
    pytest.param(MagicFormula, magic, 100 / 3.6, 0.05, 1.0, id="Magic Formula, 100 km/h, mu 1"),
    pytest.param(MagicFormula, magic, 50 / 3.6, 0.09, 0.3, id="Magic Formula, 50 km/h, mu 0.3"),
]


@pytest.mark.parametrize("component, tyre, speed, steer, mu", RUNS)
@pytest.mark.sampled(1)
def test_the_extrapolated_loop_agrees_with_an_independent_solution(component, tyre, speed, steer, mu):
    names = ["velocity_x", "velocity_y", "yaw_rate", "position_x", "position_y", "yaw_angle"]
    names += ["roll_angle", "roll_rate", *four("wheel_speed", 0.0)]
    times = np.linspace(0.0, 3.0, 3001)
    exact = monolith_b.solve(
        times,
        tyre=tyre,
        steer=monolith.sine(steer, 0.4, 0.2, 1.0),
        speed=speed,
        mu=[mu] * 4,
        kinks=[0.2, 2.7],
        tolerance=1e-8,
    )
    peak = np.abs(exact).max(axis=1)
    errors = {}
    for h in (4e-3, 1e-3):
        run = drive(component, mu=mu, steer=steer, until=3.0, h=h, record=names, initial_speed=speed)
        errors[h] = np.abs(run - exact[:, :: round(h / 1e-3)]).max(axis=1) / peak
    car = f"plant_eight_dof, {component.fmu_name}, {3.6 * speed:.0f} km/h, mu {mu:g}"
    measured("cars", car, SCIPY, errors[1e-3].max(), at_most=1e-4)
    order = np.log(errors[4e-3][2] / errors[1e-3][2]) / np.log(4.0)
    measured("order", f"`extrapolated`, {car}", SCIPY, order, at_least=1.8)


def test_braking_agrees_with_an_independent_solution():
    times = np.linspace(0.0, 1.0, 1001)
    torque = (-350.0, -350.0, -150.0, -150.0)
    exact = monolith_b.solve(
        times,
        tyre=magic,
        steer=monolith.sine(0.03, 0.4, 0.2, 1.0),
        speed=25.0,
        mu=[0.8] * 4,
        torque=lambda t: torque,
        kinks=[0.2],
        tolerance=1e-8,
    )
    run = drive(
        MagicFormula,
        mu=0.8,
        steer=0.03,
        until=1.0,
        record=["velocity_x", "yaw_rate", "wheel_speed_fl"],
        torque=torque,
        initial_speed=25.0,
    )
    error = np.abs(run - exact[[0, 2, 8]]).max(axis=1) / np.abs(exact[[0, 2, 8]]).max(axis=1)
    car = "plant_eight_dof, tyre_magic_formula, braking in a turn"
    measured("cars", car, SCIPY, error.max(), at_most=3e-4)  # the torque steps at the start


def test_lifted_wheels_carry_nothing_and_the_others_carry_the_car():
    stand = Stand(EightDof, initial_speed=20.0, cg_height=0.9, roll_centre_height_front=0.5)
    y = stand.start(**lateral(14000.0))
    assert y["vertical_load_fl"] == 0.0
    assert y["vertical_load_fr"] == pytest.approx(0.6 * P.mass * G, rel=1e-12)
    assert sum(wheel_values(y, "vertical_load")) == pytest.approx(P.mass * G, rel=1e-12)
    y = stand.step(1e-3, **lateral(0.0), **four("tyre_force_x", -20000.0))
    assert y["vertical_load_rl"] == y["vertical_load_rr"] == 0.0
    assert y["vertical_load_fl"] + y["vertical_load_fr"] == pytest.approx(P.mass * G, rel=1e-12)


def test_springs_that_cannot_hold_the_body_are_refused():
    with pytest.raises(AssertionError, match=r"roll_stiffness .*4355\.64"):
        Stand(EightDof, roll_stiffness=4000.0).start()
    with pytest.raises(AssertionError, match="roll_inertia"):
        Stand(EightDof, roll_inertia=100.0).start()

"""The tyre whose forces lag behind slip: relaxation, standstill, and cars on it."""

from __future__ import annotations

from math import exp, pi, sin

import numpy as np
import pytest

from yawbench.components.cars.wheel_kinematics import slip_angle, slip_ratio
from yawbench.components.plants.fourteen_dof import FourteenDof
from yawbench.components.plants.seven_dof import SevenDof
from yawbench.components.tyre_models.pacejka_2012_set import COMMON, LONGITUDINAL, REST
from yawbench.components.tyre_models.relaxation import gripped
from yawbench.components.tyres.magic_formula_62 import MagicFormula62
from yawbench.components.tyres.magic_formula_62_transient import MagicFormula62Transient
from yawbench.vocabulary.wheels import wheels

from .loop import Loop
from .stand import Stand

RADIUS, LOW = 0.313, 0.5
SYMMETRIC = {
    f"{name}_{axle}": 0.0
    for name in ("phx1", "phx2", "rhx1", "pey3", "phy1", "phy2", "pvy1", "pvy2", "rby3", "rvy1", "rvy2")
    for axle in ("front", "rear")
}


def rolling(v=20.0, s_x=0.0, s_y=0.0, load=4000.0, mu=1.0):
    """Return the inputs of four wheels with speed v, slip speeds s_x, s_y [m/s]."""
    one = {
        "slip_angle": slip_angle(v, s_y, LOW),
        "slip_ratio": slip_ratio(v + s_x, v, LOW),
        "vertical_load": load,
        "friction": mu,
        "wheel_velocity": v,
        "wheel_speed": (v + s_x) / RADIUS,
    }
    return {f"{name}_{wheel}": value for name, value in one.items() for wheel in ("fl", "fr", "rl", "rr")}


def stand(**parameters):
    return Stand(MagicFormula62Transient, wheel_radius=RADIUS, low_speed=LOW, **parameters)


@pytest.mark.parametrize("steps", [1, 7])
@pytest.mark.parametrize(("v", "kappa", "alpha"), [(20.0, 0.0, 0.05), (3.0, 0.0, -0.2), (20.0, -0.06, 0.0)])
def test_after_the_relaxation_length_a_step_has_come_to_1_less_1_over_e(v, kappa, alpha, steps):
    tyre = stand()
    before = tyre.start(**rolling(v))
    name, slip = ("y", alpha) if alpha else ("x", kappa)
    sigma = before[f"relaxation_length_{name}_fl"]
    along = v * np.cos(alpha)  # the wheel goes v metres a second on its way
    inputs = rolling(along, s_x=kappa * along, s_y=v * sin(alpha))
    for _ in range(steps):
        y = tyre.step(sigma / v / steps, **inputs)
    reached = sin(y["patch_slip_angle_fl"]) / sin(alpha) if alpha else y["patch_slip_ratio_fl"] / slip
    assert reached == pytest.approx(1.0 - exp(-1.0), abs=1e-12)


def test_in_steady_motion_forces_are_those_of_the_tyre_without_lag():
    for v, s_x, s_y in (
        (20.0, -1.0, 1.5),
        (8.0, 3.0, -1.0),
        (-5.0, 0.4, 0.3),
        (1.0, 0.0, -0.9),
        (0.6, 9.0, 0.1),
    ):
        lagging, instant = stand(damping=0.0), Stand(MagicFormula62)
        lagging.start(**rolling(0.0))
        inputs = rolling(v, s_x, s_y)
        found = lagging.step(1e3, **inputs)
        expected = instant.start(**{k: x for k, x in inputs.items() if k in instant.reference})
        for name, value in expected.items():
            if not name.startswith(("slip_stiffness", "tyre_slip")):
                assert found[name] == pytest.approx(value, rel=1e-9, abs=1e-6), (name, v)
        assert lagging.outputs()["patch_slip_angle_rl"] == pytest.approx(inputs["slip_angle_rl"], rel=1e-12)


def test_a_run_begins_in_steady_motion():
    tyre = stand()
    inputs = rolling(20.0, 0.4, -0.7)
    first = tyre.start(**inputs)
    later = tyre.step(5.0, **inputs)
    assert first["tyre_force_y_rr"] == pytest.approx(later["tyre_force_y_rr"], rel=1e-12)
    assert abs(first["tyre_force_y_rr"]) > 500.0


def test_a_deflection_beyond_the_grip_is_kept_as_far_as_the_wheel_slides_its_way():
    assert gripped((30.0, 40.0), (0.0, 0.0), 60.0) == 1.0
    assert gripped((30.0, 40.0), (0.0, 0.0), 25.0) == 0.5
    assert gripped((30.0, 40.0), (-30.0, -40.0), 25.0) == 0.5  # turned about
    assert gripped((30.0, 40.0), (24.0, 32.0), 25.0) == pytest.approx(0.8)
    assert gripped((30.0, 40.0), (300.0, 400.0), 25.0) == 1.0
    assert gripped((0.0, 0.0), (1.0, 0.0), 0.0) == 1.0


def test_at_rest_the_tyre_is_a_spring_of_the_carcass_stiffness():
    tyre = stand(damping=0.0, **SYMMETRIC)
    tyre.start(**rolling(0.0))
    for _ in range(10):
        y = tyre.step(0.001, **rolling(0.0, s_x=0.02, s_y=-0.03))
    moved = 0.01
    assert y["tyre_force_x_fl"] == pytest.approx(358000.0 * 0.02 * moved, rel=1e-2)
    assert y["tyre_force_y_fl"] == pytest.approx(102700.0 * 0.03 * moved, rel=1e-2)
    held = tyre.step(10.0, **rolling(0.0))
    assert held["tyre_force_x_fl"] == pytest.approx(y["tyre_force_x_fl"], rel=1e-12)


@pytest.mark.parametrize("v", [0.0, 1e-9, 0.3, 20.0])
def test_a_wheel_that_spins_or_slides_has_finite_slips_and_comes_back(v):
    tyre = stand()
    tyre.start(**rolling(v))
    for _ in range(50):
        y = tyre.step(0.1, **rolling(v, s_x=30.0, s_y=8.0))
        assert all(np.isfinite(list(y.values())))
        assert abs(y["patch_slip_ratio_fl"]) <= 2.0
        assert abs(y["patch_slip_angle_fl"]) <= pi
    y = tyre.step(3.0 / max(v, 1.0), **rolling(max(v, 1.0)))
    assert abs(y["patch_slip_ratio_fl"]) < 2e-5
    assert abs(y["patch_slip_angle_fl"]) < 1e-2


def test_the_slip_stiffness_told_is_the_slope_of_the_force_over_the_slip_held_in_the_step():
    for h, v, s_x in ((0.001, 20.0, -0.5), (0.005, 3.0, -0.1), (0.01, 40.0, 0.8), (0.001, 0.7, -0.01)):
        forces = []
        for d in (-1e-5, 1e-5):
            tyre = stand()
            tyre.start(**rolling(v, s_x))
            y = tyre.step(h, **rolling(v, s_x + d * v))
            forces.append((y["tyre_slip_ratio_fl"], y["tyre_force_x_fl"]))
        (kappa_0, f_0), (kappa_1, f_1) = forces
        assert y["slip_stiffness_fl"] == pytest.approx((f_1 - f_0) / (kappa_1 - kappa_0), rel=2e-3)


def test_relaxation_lengths_are_those_of_the_kind_of_set():
    six = stand(**{f"pcfx1_{a}": 0.1 for a in ("front", "rear")}).start(**rolling(load=6000.0))
    rows = {key: row.default for key, row in (COMMON | LONGITUDINAL | REST).items()}
    df = 0.5
    k_x = 6000.0 * (rows["pkx1"] + rows["pkx2"] * df) * exp(rows["pkx3"] * df)
    assert six["relaxation_length_x_fl"] == pytest.approx(k_x / (358000.0 * (1.0 + 0.1 * df)), rel=1e-12)
    given = {"fittyp": 6.0, "ptx1": 2.3, "ptx2": 0.2, "ptx3": 0.1, "pty1": 2.1, "pty2": 2.0, "lsgal": 0.9}
    old = stand(**{f"{k}_{a}": x for k, x in given.items() for a in ("front", "rear")})
    y = old.start(**rolling(load=6000.0))
    assert y["relaxation_length_x_fl"] == pytest.approx(
        1.5 * RADIUS * (2.3 + 0.2 * df) * exp(-0.1 * df), rel=1e-12
    )
    assert y["relaxation_length_y_fl"] == pytest.approx(
        2.1 * sin(2.0 * np.arctan(0.75)) * RADIUS * 0.9, rel=1e-12
    )
    none = stand(lateral_stiffness_front=0.0, relaxation_length=0.6).start(**rolling())
    assert (none["relaxation_length_y_fl"], none["relaxation_length_y_rl"] < 0.5) == (0.6, True)


def driven(plant, until, steps, *, torque=0.0, mu=None, each=lambda _: None, h=None, steer=0.0, **parameters):
    """Return the loop of a car on these tyres after some time under a torque at every wheel [N.m]."""
    given = {"wheel_radius": RADIUS, **parameters}
    frictions = dict(zip(wheels("friction_*"), mu or (1.0,) * 4, strict=True))
    constants = {**frictions, "steer_angle": steer, **dict.fromkeys(wheels("wheel_torque_*"), torque)}
    units = [(plant, given), (MagicFormula62Transient, {"wheel_radius": RADIUS, **SYMMETRIC})]
    loop = Loop(units, algorithm="extrapolated", constants=constants)
    return loop, loop.run(until, steps, each)


@pytest.mark.parametrize("plant", [SevenDof, FourteenDof])
@pytest.mark.parametrize("mu", [(1.0,) * 4, (0.2, 0.8, 0.2, 0.8)])
@pytest.mark.sampled(1)
def test_a_braked_car_comes_to_rest_and_stays_without_a_limit_cycle(plant, mu):
    speeds = []

    def see(loop):
        speeds.append(loop["velocity_x"])

    loop, _ = driven(plant, 5.0, 5000, torque=-350.0, mu=mu, initial_speed=5.0, each=see)
    last = np.array(speeds[-500:])
    assert np.max(np.abs(last)) < 1e-3
    assert abs(sum(loop[name] for name in wheels("tyre_force_x_*"))) < 20.0  # wheels may pull at each other
    assert abs(loop["yaw_rate"]) < 1e-3


def test_a_car_that_slides_to_rest_on_locked_wheels_springs_back_by_what_their_contact_holds():
    course = []

    def see(loop):
        course.append((loop["velocity_x"], loop["position_x"]))

    loop, _ = driven(SevenDof, 3.0, 3000, torque=-3000.0, mu=(0.8,) * 4, initial_speed=4.0, each=see)
    v, x = np.array(course).T
    mass = loop.units[0].slave.p.mass
    held = 3.0 * 0.8 * (mass * 9.81 / 4.0) / 358000.0
    assert 0.5 * held < x.max() - x[-1] < 1.1 * held
    assert np.abs(v[-500:]).max() < 1e-3


def test_a_braked_wheel_follows_its_equations_however_long_the_step_is():
    """One millisecond against a tenth of it, from the first bite of the brake to steady slip."""
    courses = []
    for steps in (200, 2000):
        brake = {"torque": -400.0, "initial_speed": 25.0}
        _, course = driven(SevenDof, 0.2, steps, each=lambda loop: loop["wheel_speed_fl"], **brake)
        courses.append(np.array(course[:: steps // 200]))
    coarse, fine = courses
    rolled_only = fine[0] + (fine[-1] - fine[0]) * np.linspace(0, 1, len(fine))
    assert np.max(np.abs(fine - rolled_only)) > 0.2  # there is something to follow
    assert np.max(np.abs(coarse - fine)) < 0.02 * np.max(np.abs(fine - rolled_only))


def test_the_coupling_with_the_car_is_of_second_order_in_the_step():
    """Loads move from side to side while the car turns in, and relaxation lengths with them."""
    rates = []
    for steps in (125, 250, 2000):
        loop, _ = driven(SevenDof, 0.5, steps, steer=0.05)
        rates.append(loop["yaw_rate"])
    coarse, half, fine = rates
    assert abs(coarse - fine) > 3.2 * abs(half - fine) > 0.0
    assert abs(half - fine) < 1e-3 * abs(fine)

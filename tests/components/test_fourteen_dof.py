"""The car with fourteen degrees of freedom: closed forms, limits, symmetry, an independent solution."""

from __future__ import annotations

from math import radians, sin

import numpy as np
import pytest

from tests.evidence import measured
from yawbench.components.cars.sprung_car import G
from yawbench.components.plants.fourteen_dof import FourteenDof
from yawbench.components.tyres.dugoff import Dugoff

from .fourteen_dof import (
    FREE,
    RIDE,
    A,
    B,
    D,
    L,
    P,
    drive,
    lateral,
    settle,
)
from .ride_energy import energy as energy_of
from .stand import Stand, four, wheel_values

# ---- at rest and straight ahead


def test_the_car_settles_from_a_drop_of_fifty_millimetres():
    stand = Stand(FourteenDof, initial_heave=0.05, initial_speed=0.0)
    before = stand.start()
    assert wheel_values(before, "vertical_load") == [0.0] * 4
    assert before["heave"] == 0.05
    landing = [stand.step(1e-3)["vertical_load_fl"] for _ in range(1000)]
    assert landing[10] == 0.0
    assert max(landing) > 1.2 * RIDE.load_f
    y = settle(stand)
    static = np.repeat([RIDE.load_f, RIDE.load_r], 2)
    assert wheel_values(y, "vertical_load") == pytest.approx(static, rel=1e-6)
    assert y["heave"] == pytest.approx(0.0, abs=1e-7)
    assert y["pitch_angle"] == pytest.approx(0.0, abs=1e-8)
    assert (y["roll_angle"], y["yaw_rate"], y["velocity_y"]) == (0.0, 0.0, 0.0)


def test_rolling_resistance_stops_the_car_and_does_not_drive_it_back():
    names = ["velocity_x", "acceleration_x", *four("wheel_speed", 0.0)]
    speed, acceleration, *spins = drive(steer=0.0, until=4.0, record=names, initial_speed=0.2)
    mass = P.mass + 4.0 * P.wheel_inertia / P.wheel_radius**2
    assert acceleration[500:1500] == pytest.approx(-P.rolling_resistance * G * P.mass / mass, rel=1e-3)
    assert speed.min() > -0.002  # the body swings back on its springs
    assert abs(speed[-1]) < 1e-6
    assert np.max(spins) > 0.5 and np.min(spins) == 0.0 == np.max(np.array(spins)[:, -1000:])


def test_a_freely_rolling_undamped_car_keeps_its_energy():
    stand = Stand(
        FourteenDof,
        initial_speed=20.0,
        initial_yaw_rate=0.5,
        initial_heave=0.01,
        damping_front=0.0,
        damping_rear=0.0,
        **FREE,
    )
    stand.start()
    unit = stand.unit
    unit.body = (0.01, 0.02, 0.01, *unit.body[3:])  # heaved, rolled, pitched

    def energy():
        v_x, v_y, r = unit.motion[:3]
        spins = sum(0.5 * P.wheel_inertia * w * w for w in unit.spins)
        return 0.5 * P.mass * (v_x**2 + v_y**2) + energy_of(RIDE, r, unit.body) + spins

    first = energy()
    swinging, off = energy_of(RIDE, 0.5, unit.body) - 0.5 * P.yaw_inertia * 0.25, 0.0
    for _ in range(4000):
        stand.step(5e-4)
        off = max(off, abs(energy() - first) / swinging)
    measured("energy", "plant_fourteen_dof without dampers", "its start", off, at_most=2e-6)
    assert swinging > 80.0
    assert max(map(abs, unit.body[:3])) > 1e-4  # still moving


# ---- steady states


def test_roll_and_load_transfer_are_those_of_springs_bars_tyres_and_roll_centres():
    force = 0.2 * P.mass * G
    stand = Stand(FourteenDof, initial_speed=0.0, **FREE)
    stand.start()
    y = settle(stand, **lateral(force))
    axles = []
    for k, s, h, share in (
        (P.spring_stiffness_front, P.anti_roll_stiffness_front, P.roll_centre_height_front, B / L),
        (P.spring_stiffness_rear, P.anti_roll_stiffness_rear, P.roll_centre_height_rear, A / L),
    ):
        axles.append((0.5 * D * D * (k + 2 * s), 0.5 * D * D * P.tyre_vertical_stiffness, h * share * force))
    # body: sum K (phi - phi_u) = h Y - sum(h_rc Y) + m_s g h' phi
    # axle: K (phi - phi_u) + h_rc Y = K_t phi_u
    stiffness = sum(k * k_t / (k + k_t) for k, k_t, _ in axles) - RIDE.gravity_roll
    moment = P.cg_height * force - sum(link for *_, link in axles)
    moment += sum(k * link / (k + k_t) for k, k_t, link in axles)
    assert y["roll_angle"] == pytest.approx(moment / stiffness, rel=2e-3)
    assert y["roll_angle"] / 0.2 == pytest.approx(radians(4.45), rel=0.02)
    fl, fr, rl, rr = wheel_values(y, "vertical_load")
    leaning = RIDE.gravity_roll * sin(y["roll_angle"])
    assert 0.5 * D * (fr - fl + rr - rl) == pytest.approx(force * P.cg_height + leaning, rel=1e-6)
    assert sum((fl, fr, rl, rr)) == pytest.approx(P.mass * G, rel=1e-9)
    assert fr - fl > rr - rl  # the stiffer front axle carries more
    assert y["heave"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("side, sign", [("fr", 1.0), ("rr", 1.0), ("fl", -1.0), ("rl", -1.0)])
@pytest.mark.sampled(2)
def test_a_force_on_the_outer_wheel_lifts_the_body_and_one_on_the_inner_wheel_pulls_it_down(side, sign):
    stand = Stand(FourteenDof, initial_speed=0.0, **FREE)
    stand.start()
    y = settle(stand, h=4e-3, **{f"tyre_force_y_{side}": 3000.0})  # to the left: the right wheels are outer
    assert sign * y["heave"] > 1e-3
    assert sum(wheel_values(y, "vertical_load")) == pytest.approx(P.mass * G, rel=1e-6)


def test_braking_pitches_the_nose_down_and_loads_the_front_axle():
    stand = Stand(FourteenDof, initial_speed=30.0, **FREE)
    stand.start()
    y = settle(stand, seconds=4.0, **four("tyre_force_x", -2000.0, -2000.0, -500.0, -500.0))
    fl, fr = wheel_values(y, "vertical_load")[:2]
    theta = y["pitch_angle"]
    expected = 5000.0 * P.cg_height + RIDE.gravity_pitch * sin(theta)
    assert fl - RIDE.load_f == pytest.approx(expected / (2 * L), rel=1e-4)
    assert fl == pytest.approx(fr, rel=1e-12)
    k_f, k_r = (
        k * P.tyre_vertical_stiffness / (k + P.tyre_vertical_stiffness)
        for k in (P.spring_stiffness_front, P.spring_stiffness_rear)
    )
    matrix = 2 * np.array(
        [
            [k_f + k_r, k_r * RIDE.b - k_f * RIDE.a],
            [k_r * RIDE.b - k_f * RIDE.a, k_f * RIDE.a**2 + k_r * RIDE.b**2],
        ]
    )
    matrix[1, 1] -= RIDE.gravity_pitch
    heave, pitch = np.linalg.solve(matrix, [0.0, 5000.0 * P.cg_height])
    assert theta == pytest.approx(pitch, rel=1e-3)
    assert y["heave"] == pytest.approx(heave, rel=1e-3)
    assert theta > 0.005
    assert y["acceleration_x"] == pytest.approx(-5000.0 / P.mass, rel=1e-12)


# ---- limits


def test_a_car_on_two_wheels_does_not_blow_up_and_stands_on_four_again():
    names = ["roll_angle", "heave", "velocity_x", *four("vertical_load", 0.0)]
    run = drive(Dugoff, mu=1.2, steer=0.15, until=6.0, h=2e-3, record=names, cg_height=0.75, frequency=0.3)
    assert np.all(np.isfinite(run))
    assert run[3:].min() == 0.0
    assert np.abs(run[0]).max() < 0.4
    assert run[3:, -1].min() > 3000.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_car_that_rolls_over_is_an_error_with_a_sentence(side):
    stand = Stand(FourteenDof, cg_height=0.9)
    force = 0.25 * side * 1830.0 * 1.5 * 9.81  # 1.5 g; it tips from d / 2h = 0.9 g on
    inputs = four("tyre_force_y", *[force] * 4)
    stand.start(**inputs)
    with pytest.raises(AssertionError, match=r"roll -?4\d\S*, pitch \S+ degrees.* 45"):
        for _ in range(3000):
            assert abs(stand.step(0.001, **inputs)["roll_angle"]) < 0.8
    assert stand["roll_angle"] * side > 0.7

"""Body, suspension and tyre springs: against Lagrange's equations, energy, power, geometry."""

from __future__ import annotations

import dataclasses
from math import cos, sin

import numpy as np
import pytest

from tests.refusals import refused
from yawbench.components.cars.contact_points import contact, contact_velocities
from yawbench.components.cars.ride import AT_REST, RESOLVED, loads, move_ride, rates
from yawbench.components.cars.sprung_car import FourteenDofParameters, G, ride_of

from . import monolith_c
from .ride_energy import energy

P = FourteenDofParameters()
RIDE = ride_of(P)
A, B, T = P.cg_to_front_axle, P.cg_to_rear_axle, 0.5 * P.track_width
FREE = contact(0.0, (0.0,) * 4, (0.0,) * 4, P)
LONGEST = RESOLVED / RIDE.fastest()


def pushed(f_x, f_y):
    return contact(0.0, f_x, f_y, P)


def small_state(random, size):
    """Return angles up to 0.1 `size`, heights up to 0.01 `size`, speeds up to `size`."""
    heights, angles = 0.01 * size, 0.1 * size
    scale = [heights, angles, angles, *[heights] * 4, size, size, size, *[size] * 4]
    return random.uniform(-1, 1, 14) * scale


def test_accelerations_are_those_of_lagranges_equations_to_second_order_in_the_angles():
    # Exact Euler rates there, second-order kinetic energy here: the difference is of third order.
    random = np.random.default_rng(1)
    direction = small_state(random, 1.0)
    f_x, f_y = random.uniform(-1e4, 1e4, (2, 4))
    errors = []
    for size in (0.1, 0.01):
        y = size * direction
        got = rates((0.8, *y), pushed(size * f_x, size * f_y), RIDE)
        w = np.concatenate([[20.0, 1.0, 0.8], y[7:]])
        exact = monolith_c.accelerations(y[:7], w, size * f_x, size * f_y)
        assert got[1:8] == pytest.approx(y[7:])
        errors.append(np.abs(np.array([got[0], *got[8:]]) - exact[2:]).max())
        assert errors[-1] < 0.01 * size**3
    assert errors[0] / errors[1] == pytest.approx(1000.0, rel=0.05)


@pytest.mark.parametrize("seed", range(5))
def test_energy_changes_by_the_power_of_the_forces_at_the_contact_points_less_the_dampers(seed):
    random = np.random.default_rng(seed)
    y = small_state(random, 0.3)
    y[3:7] += random.uniform(-0.03, 0.03, 4)  # one or the other wheel in the air
    v_x, v_y, r = 20.0, -2.0, 0.7
    f_x, f_y = random.uniform(-5e3, 5e3, (2, 4))
    held = pushed(f_x, f_y)
    change = np.array(rates((r, *y), held, RIDE))
    step = 1e-6
    ahead, behind = (energy(RIDE, r + s * change[0], y + s * change[1:]) for s in (step, -step))
    moving = v_x * held.x + v_y * held.y  # of the translation: m (v_x a_x + v_y a_y)
    velocities = contact_velocities(v_x, v_y, r, y, delta=0.0, ride=RIDE, p=P)
    power = np.dot(velocities, [*f_x, *f_y])
    travel_rates = monolith_c.TRAVEL @ np.concatenate([[v_x, v_y, r], y[7:]])
    lost = np.dot(np.repeat([P.damping_front, P.damping_rear], 2), travel_rates**2)
    assert (ahead - behind) / (2 * step) + moving == pytest.approx(power - lost, rel=1e-7)


def test_contact_velocities_are_the_time_derivatives_of_the_contact_points_places():
    random = np.random.default_rng(3)
    y = small_state(random, 0.5)
    v_x, v_y, r, delta = 15.0, 1.0, 0.6, 0.1

    def places(t):
        """Return the contact points in earth axes near t = 0, in the axes of the car at t = 0."""
        q = y[:7] + t * y[7:]
        psi = r * t
        c = monolith_c.TRAVEL[:, 3:] @ q
        for (x, side), slope, travel in zip(monolith_c.PLACES, monolith_c.SLOPES, c, strict=True):
            x_i = x - P.cg_height * q[2]
            y_i = side + P.cg_height * q[1] + slope * travel
            yield complex(v_x * t, v_y * t) + complex(x_i, y_i) * complex(cos(psi), sin(psi))

    step = 1e-5
    found = contact_velocities(v_x, v_y, r, y, delta=delta, ride=RIDE, p=P)
    for i, (later, before) in enumerate(zip(places(step), places(-step), strict=True)):
        turned = (later - before) / (2 * step) * complex(cos(delta), -sin(delta) if i < 2 else 0.0)
        if i >= 2:
            turned = (later - before) / (2 * step)
        assert found[i] == pytest.approx(turned.real, rel=1e-8)
        assert found[4 + i] == pytest.approx(turned.imag, rel=1e-8)


def test_a_tyre_cannot_pull_and_a_wheel_in_the_air_falls_freely_under_its_spring():
    y = list(AT_REST)
    y[3] = RIDE.load_f / RIDE.k_t + 0.01
    y[0] = y[1] = y[2] = 0.0
    assert loads(y, RIDE)[0] == 0.0
    travel = y[3]
    force = (RIDE.k_f + RIDE.s_f) * travel  # beyond the static one, pushing the wheel down
    static = RIDE.load_f - RIDE.m_f * G
    assert rates((0.0, *y), FREE, RIDE)[11] == pytest.approx(-G - (static + force) / RIDE.m_f)


def test_substeps_resolve_springs_however_stiff():
    stiff = RIDE._replace(k_f=1e3 * RIDE.k_f, k_r=1e3 * RIDE.k_r, k_t=1e3 * RIDE.k_t, d_f=1e5, d_r=1e5)
    state = (0.0, 1e-5, *AT_REST[1:])
    for _ in range(200):
        state = move_ride(0.0, state[1:], 5e-3, held=FREE, ride=stiff, longest=RESOLVED / stiff.fastest())
    assert np.abs(state).max() < 1e-6


@pytest.mark.parametrize("factor", [1.0, 30.0, 1000.0])
def test_no_rate_of_the_system_exceeds_its_bound_by_much(factor):
    ride = RIDE._replace(k_f=factor * RIDE.k_f, s_r=factor * RIDE.s_r, k_t=factor * RIDE.k_t)
    origin = np.zeros(15)
    base = np.array(rates(tuple(origin), FREE, ride))
    jacobian = np.array([(np.array(rates(tuple(e), FREE, ride)) - base) / 1e-7 for e in 1e-7 * np.eye(15)]).T
    assert np.abs(np.linalg.eigvals(jacobian)).max() < 1.5 * ride.fastest()


def test_the_step_is_of_fourth_order():
    start = (0.5, 0.01, 0.02, 0.01, *[0.005] * 4, *[0.1] * 7)

    def end(parts):
        state = start
        for _ in range(parts):
            state = move_ride(state[0], state[1:], 0.08 / parts, held=FREE, ride=RIDE, longest=1.0)
        return np.array(state)

    fine = end(1024)
    coarse, half = (np.abs(end(n) - fine).max() for n in (64, 128))
    assert 3.8 < np.log2(coarse / half) < 4.6


def test_the_product_of_inertia_turns_a_yaw_acceleration_into_roll():
    ride = ride_of(dataclasses.replace(P, sprung_roll_yaw_product=80.0, front_unsprung_share=1.65 / 3.05))
    moment = 1000.0
    held = FREE._replace(moment=moment)
    got = rates((0.0, *AT_REST), held, ride)
    inertia = np.array([[P.yaw_inertia, -80.0], [-80.0, ride.roll]])
    assert (got[0], got[9]) == pytest.approx(np.linalg.solve(inertia, [moment, 0.0]), rel=1e-12)
    assert ride.a == pytest.approx(A)  # the sprung mass stands where the car's centre is


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"sprung_mass": 1830.0}, ("sprung_mass", "1830 kg")),
        ({"yaw_inertia": 500.0}, ("yaw_inertia", "whole", "car")),
        ({"anti_roll_stiffness_front": -40000.0}, ("7653.95", "springs", "anti-roll")),
        ({"spring_stiffness_front": 0.0, "spring_stiffness_rear": 0.0}, ("body", "falls")),
    ],
)
def test_a_car_that_cannot_stand_is_refused(change, names):
    with refused(ValueError, names=names):
        ride_of(dataclasses.replace(P, **change))

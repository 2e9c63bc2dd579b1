"""The car with fourteen degrees of freedom beside a multi-body model, and the terms in which they differ."""

from __future__ import annotations

from math import pi, sin

import numpy as np
import pytest

from tests.evidence import measured
from yawbench.components.cars.contact_points import contact
from yawbench.components.cars.ride import AT_REST, Ride, loads, rates
from yawbench.components.cars.sprung_car import FourteenDofParameters, G, ride_of

from .multibody import MultiBody, follow, straight_path_forces

P = FourteenDofParameters()
RIDE = ride_of(P)
STILL = (0.0,) * 4


def accelerations(ride: Ride, y, f_y, *, added: bool, **options):
    """Return dr, ddz, ddphi, ddtheta, ddu_i of `cars.ride`, with or without the terms of straight paths."""
    got = np.array(rates(tuple(y), contact(0.0, STILL, tuple(f_y), P), ride))
    got = got[[0, *range(8, 15)]]
    if added:
        moment, e = straight_path_forces(ride, y[1:], f_y, **options)
        t = ride.half_track
        got[1] += e.sum() / ride.m_s
        got[2] += (moment + e @ [t, -t, t, -t]) / ride.roll
        got[3] -= (e @ [ride.a, ride.a, -ride.b, -ride.b]) / ride.pitch
        got[4:] -= e / [ride.m_f, ride.m_f, ride.m_r, ride.m_r]
    return got


def difference(size: float, *, p=P, **options):
    """Return the differences of ddz, ddphi and the largest ddu_i at a state of rest of this size."""
    random = np.random.default_rng(3)
    heights, f_y = 0.02 * size * random.uniform(-1, 1, 4), 1e4 * size * random.uniform(-1, 1, 4)
    z, phi = 0.02 * size, 0.08 * size
    model = MultiBody(p)
    dv, ddu = model.accelerations(model.at(z, phi, heights), np.zeros(10), f_y)
    got = accelerations(ride_of(p), [0.0, z, phi, 0.0, *heights, *AT_REST[7:]], f_y, **options)
    return abs(got[1] - dv[3]), abs(got[2] - dv[4]), np.abs(got[4:] - ddu).max()


def test_to_first_order_the_two_differ_only_by_the_roll_centres_of_straight_paths():
    coarse, fine = (np.array(difference(size, added=True)) for size in (0.1, 0.01))
    assert np.log10(coarse / fine) == pytest.approx(2.0, abs=0.1)  # of second order
    coarse, fine = (np.array(difference(size, added=False)) for size in (0.1, 0.01))
    assert np.log10(coarse / fine)[1] == pytest.approx(1.0, abs=0.2)  # roll


@pytest.mark.parametrize("sideways", [False, True])
@pytest.mark.sampled(1)
def test_a_small_steady_roll_differs_by_the_paths_of_contact_points_and_of_wheel_centres(sideways):
    a_y = 0.05
    f_y = np.array([RIDE.load_f, RIDE.load_f, RIDE.load_r, RIDE.load_r]) / G * a_y
    model = MultiBody(P, sideways=sideways)

    def roll(derivatives, state):
        return follow(derivatives, state, until=4.0, step=20e-3)[-1]

    def ours(**options):
        def derivatives(t, y):
            return np.array([0.0, *y[8:], *accelerations(RIDE, y, f_y, **options)[1:]])

        return roll(derivatives, np.array([0.0, *AT_REST]))[2]

    def exact(t, state):
        return np.array([*state[10:], *model.accelerations(state[:10], state[10:], f_y)[0]])

    other = roll(exact, np.zeros(20))[4]
    assert ours(added=True, sideways=a_y if sideways else None) == pytest.approx(other, rel=3e-4)
    assert 0.004 < (-1 if sideways else 1) * (ours(added=False) / other - 1.0) < 0.012


@pytest.mark.exhaustive
@pytest.mark.parametrize(("size", "share"), [(0.05, 2e-4), (0.85, 5e-3)])
def test_large_sines_are_those_of_the_multi_body_model_with_the_terms_of_straight_paths(size, share):
    """Lateral forces of `size` times the load, 0.7 Hz, the rear 0.08 s later; roll, heave and loads."""

    def forces(t, n):
        front, rear = (size * sin(1.4 * pi * max(t - late, 0.0)) for late in (0.0, 0.08))
        return np.array([front * n[0], front * n[1], rear * n[2], rear * n[3]])

    def ours(added):
        def derivatives(t, y):
            f_y = forces(t, loads(y[1:], RIDE))
            got = accelerations(RIDE, y, f_y, added=added)
            return np.array([got[0], *y[8:], *got[1:]])

        return np.array(follow(derivatives, np.array([0.0, *AT_REST]), until=1.6, step=2e-3))

    model = MultiBody(P)

    def exact(t, state):
        f_y = forces(t, model.loads(state[:10]))
        return np.array([*state[10:], *model.accelerations(state[:10], state[10:], f_y)[0]])

    start = np.zeros(20)
    start[10] = 25.0
    other = np.array(follow(exact, start, until=1.6, step=2e-3))
    roll = np.abs(other[:, 4]).max()
    with_terms, without = (np.abs(ours(added)[:, 2] - other[:, 4]).max() / roll for added in (True, False))
    against = f"multi-body model, exact rotations, peak roll {np.degrees(roll):.1f} deg"
    measured("cars", "roll angle, with the terms of straight paths", against, with_terms, at_most=share)
    measured("cars", "roll angle", against, without, at_most=0.06)

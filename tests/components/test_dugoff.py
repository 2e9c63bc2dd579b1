"""Dugoff's tyre against points of its closed form and its limits."""

from __future__ import annotations

from math import atan, hypot, pi, radians, sin, tan

import numpy as np
import pytest

from tests.evidence import measured
from yawbench.components.tyres.dugoff import dugoff

from .monolith import tyre

C_X, C_Y, LOAD = 40000.0, 50000.0, 3000.0


def force(alpha, kappa, f_z=LOAD, mu=0.8):
    return dugoff(alpha, kappa, f_z=f_z, mu=mu, c_x=C_X, c_y=C_Y)[:2]


def test_combined_slip_worked_by_hand():
    # kappa = 0.25, tan(alpha) = 0.15: n = hypot(10000, 7500) = 12500, s = 2400 * 1.25 / 25000 = 0.12
    f = 0.12 * 1.88
    assert force(atan(0.15), 0.25) == pytest.approx((10000 / 1.25 * f, -7500 / 1.25 * f), rel=1e-14)


def test_the_printed_form_is_met_wherever_it_is_finite():
    random, worst = np.random.default_rng(3), 0.0
    for alpha, kappa, load, mu in random.uniform((-1.5, -0.99, 0, 0.05), (1.5, 1, 9000, 1.2), (2000, 4)):
        pairs = zip(force(alpha, kappa, load, mu), tyre(alpha, kappa, load, mu), strict=True)
        worst = max(worst, *(abs(ours - printed) / abs(printed) for ours, printed in pairs))
    measured("tyres", "tyre_dugoff", "the printed form", worst, at_most=1e-11)


def test_a_locked_wheel_slides_with_full_friction_against_its_velocity():
    for degrees in (0, 20, 60):
        alpha = radians(degrees)
        f_x, f_y = force(alpha, -1.0)
        assert hypot(f_x, f_y) == pytest.approx(0.8 * LOAD, rel=1e-12)
        assert f_y / f_x == pytest.approx(C_Y * tan(alpha) / C_X, abs=1e-12)


def test_a_wheel_sliding_sideways_has_full_friction_across():
    for alpha in (pi / 2, -pi / 2):
        for kappa in (-1.0, 0.0, 0.5):
            f_x, f_y = force(alpha, kappa)
            assert f_y == pytest.approx(-0.8 * LOAD * sin(alpha), rel=1e-12)
            assert abs(f_x) < 1e-9


def test_backwards_rolling_is_opposed_on_the_same_side_as_forwards():
    for alpha in (0.02, 0.3, -0.1):
        forwards, backwards = force(alpha, 0.01), force((pi if alpha > 0 else -pi) - alpha, 0.01)
        assert backwards == pytest.approx(forwards, rel=1e-12)

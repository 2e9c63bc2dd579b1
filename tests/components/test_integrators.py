"""The Runge-Kutta step against closed forms."""

from __future__ import annotations

from math import cos, exp, log2, sin

import pytest

from yawbench.components.mathematics.integrators import rk4


def oscillate(steps, until=2.0, omega=3.0):
    y = (1.0, 0.0)
    h = until / steps
    for k in range(steps):
        y = rk4(lambda t, s: (s[1], -(omega**2) * s[0]), k * h, h, y)
    return y[0] - cos(omega * until), y[1] + omega * sin(omega * until)


def test_a_cubic_in_time_is_integrated_exactly():
    (y,) = rk4(lambda t, s: (4.0 * t**3 - 3.0 * t**2 + 2.0,), 1.0, 0.5, (5.0,))
    assert y == pytest.approx(5.0 + (1.5**4 - 1.0) - (1.5**3 - 1.0) + 1.0, abs=1e-14)


def test_one_step_of_growth_is_the_exponential_series_to_the_fourth_power():
    (y,) = rk4(lambda t, s: s, 0.0, 0.3, (1.0,))
    assert y == pytest.approx(1 + 0.3 + 0.3**2 / 2 + 0.3**3 / 6 + 0.3**4 / 24, rel=1e-15)
    assert abs(y - exp(0.3)) < 0.3**5 / 100


def test_the_error_falls_with_the_fourth_power_of_the_step():
    coarse, fine = (max(map(abs, oscillate(n))) for n in (100, 200))
    assert 3.9 < log2(coarse / fine) < 4.1

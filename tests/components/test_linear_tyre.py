"""The linear tyre."""

from __future__ import annotations

from math import hypot, pi

import pytest

from yawbench.components.tyres.linear import LinearTyre, LinearTyreParameters

from .stand import Stand


def wheel(alpha, kappa, load, mu, **parameters):
    found = Stand(LinearTyre, **parameters).start(
        slip_angle_rl=alpha, slip_ratio_rl=kappa, vertical_load_rl=load, friction_rl=mu
    )
    others = [v for name, v in found.items() if not name.endswith("_rl")]
    assert others == [0.0] * 12
    return found["tyre_force_x_rl"], found["tyre_force_y_rl"]


def test_forces_are_proportional_to_the_slips_whatever_load_and_friction():
    for load, mu in ((1.0, 0.0), (3000.0, 0.5), (9000.0, 1.0)):
        assert wheel(0.3, -0.2, load, mu) == pytest.approx((-8000.0, -15000.0))


def test_the_limit_keeps_the_direction_and_stops_at_friction():
    f_x, f_y = wheel(0.3, -0.2, 4000.0, 0.5, limited=True)
    assert hypot(f_x, f_y) == pytest.approx(2000.0)
    assert f_y / f_x == pytest.approx(15000.0 / 8000.0)
    assert wheel(0.01, 0.01, 4000.0, 0.5, limited=True) == pytest.approx((400.0, -500.0))
    assert wheel(0.01, 0.01, 4000.0, 0.0, limited=True) == (0.0, 0.0)


def linear_tyre(alpha, kappa):
    return LinearTyre.wheel(kappa, alpha, 1.0, 1.0, LinearTyre.axle(LinearTyreParameters(), "front"))[:2]


def test_backwards_rolling_is_opposed_on_the_same_side_as_forwards():
    forwards = linear_tyre(0.2, 0.0)
    assert linear_tyre(pi - 0.2, 0.0) == pytest.approx(forwards)

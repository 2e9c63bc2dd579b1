"""The Magic Formula tyre against a published table, the book's equations and their properties."""

from __future__ import annotations

import dataclasses
import random
from itertools import cycle
from math import atan, cos, degrees, exp, hypot, isfinite, pi, radians, sin, sqrt, tan

import pytest
from scipy.optimize import minimize_scalar

from tests.evidence import measured
from tests.refusals import mentions
from yawbench.components.tyre_models.pacejka_2002 import (
    longitudinal_curve,
    longitudinal_force,
)
from yawbench.components.tyre_models.pacejka_2002_set import MagicFormulaParameters, coefficients

from .magic import forces_and_moment

LOADS = (2000.0, 4000.0, 6000.0)
SLIPS = (-1.0, -0.4, -0.12, -0.03, 0.0, 0.01, 0.06, 0.3, 0.8, 1.0)
ANGLES = (0.0, 1e-9, 0.004, 0.03, 0.1, 0.25, 0.6, 1.2, 0.5 * pi)


def tyre(kappa, alpha, f_z=4000.0, mu=1.0, *, axle="front", **changed):
    return forces_and_moment(kappa, alpha, f_z, mu, coefficients(MagicFormulaParameters(**changed), axle))


def interface_slip(kappa):
    """The interface's slip for the book's."""
    return kappa / (1.0 + kappa) if kappa > 0.0 else kappa


def extreme(function, low, high, sign):
    """The largest (sign 1) or smallest (-1) value in an interval, and where it is."""
    found = minimize_scalar(
        lambda x: -sign * function(x), bounds=(low, high), method="bounded", options={"xatol": 1e-9}
    )
    return function(found.x), found.x


# The table of tyres.md, from a second implementation, offsets included.
TABLE = {
    2000.0: (2457.0, 0.1653, 38204.0, 2239.0, -15.09, -2011.0, 14.15, -26609.0),
    4000.0: (4840.0, 0.1473, 86040.0, 4140.0, -15.00, -3780.0, 14.03, -46009.0),
    6000.0: (7149.0, 0.1307, 145326.0, 5703.0, -15.85, -5307.0, 14.83, -56303.0),
}


@pytest.mark.parametrize("f_z", LOADS)
def test_a_second_implementation_with_the_offsets_is_met_to_a_thousandth(f_z):
    x_max, kappa_max, k_x, y_max, alpha_max, y_min, alpha_min, k_y = TABLE[f_z]
    c = coefficients(MagicFormulaParameters(asymmetric_terms=True), "front")

    def f_x(kappa):
        return longitudinal_force(interface_slip(kappa), longitudinal_curve(0.0, True, f_z, 1.0, c))

    def f_y(alpha):
        return forces_and_moment(0.0, alpha, f_z, 1.0, c)[1]

    assert extreme(f_x, 0.02, 0.4, 1) == pytest.approx((x_max, kappa_max), rel=1e-3)
    value, alpha = extreme(f_y, -0.5, -0.05, 1)
    assert (value, degrees(alpha)) == pytest.approx((y_max, alpha_max), rel=1e-3)
    value, alpha = extreme(f_y, 0.05, 0.5, -1)
    assert (value, degrees(alpha)) == pytest.approx((y_min, alpha_min), rel=1e-3)
    df = f_z / 4000.0 - 1.0
    kappa_0, alpha_0, h = 0.002 - 0.002 * df, -(0.003 - 0.001 * df), 1e-6  # where the shifts are undone
    assert (f_x(kappa_0 + h) - f_x(kappa_0 - h)) / (2 * h) == pytest.approx(k_x, rel=1e-3)
    assert (f_y(alpha_0 + h) - f_y(alpha_0 - h)) / (2 * h) == pytest.approx(k_y, rel=1e-3)


def magic(x, b, c, d, e):
    return d * sin(c * atan(b * x - e * (b * x - atan(b * x))))


def book(kappa, alpha, f_z, lam, p, k_y_scale=1.0, k_x_scale=1.0):
    """Equations 4.E9-4.E78 as printed, zero camber, forward, lambda_mu = lam, slips not scaled.

    Only G >= 0 is added.
    """
    df = f_z / p.nominal_load - 1.0
    sgn = lambda x: (x > 0) - (x < 0)  # noqa: E731
    f_0, r_0, tan_a = p.nominal_load, p.unloaded_radius, tan(alpha)
    lam_x, lam_y = lam * p.friction_scale_x, lam * p.friction_scale_y
    fade = lambda x: 10 * x / (1 + 9 * x)  # noqa: E731
    k_s = kappa + p.PHX1 + p.PHX2 * df
    mu_x = (p.PDX1 + p.PDX2 * df) * lam_x
    e_x = min(1.0, (p.PEX1 + p.PEX2 * df + p.PEX3 * df**2) * (1 - p.PEX4 * sgn(k_s)))
    k_x = f_z * (p.PKX1 + p.PKX2 * df) * exp(p.PKX3 * df) * k_x_scale
    f_x0 = magic(k_s, k_x / (p.PCX1 * mu_x * f_z), p.PCX1, mu_x * f_z, e_x)
    f_x0 += f_z * (p.PVX1 + p.PVX2 * df) * fade(lam_x)
    b = p.RBX1 * cos(atan(p.RBX2 * kappa))
    e = p.REX1 + p.REX2 * df
    weight = lambda x, b, c, e: cos(c * atan(b * x - e * (b * x - atan(b * x))))  # noqa: E731
    f_x = f_x0 * max(0.0, weight(tan_a + p.RHX1, b, p.RCX1, e) / weight(p.RHX1, b, p.RCX1, e))

    s_hy = p.PHY1 + p.PHY2 * df
    s_vy = f_z * (p.PVY1 + p.PVY2 * df) * fade(lam_y)
    a_y = tan_a + s_hy
    mu_y = (p.PDY1 + p.PDY2 * df) * lam_y
    e_y = min(1.0, (p.PEY1 + p.PEY2 * df) * (1 - p.PEY3 * sgn(a_y)))
    k_y = p.PKY1 * f_0 * sin(p.PKY4 * atan(f_z / (p.PKY2 * f_0))) * k_y_scale
    b_y = k_y / (p.PCY1 * mu_y * f_z)
    f_y0 = magic(a_y, b_y, p.PCY1, mu_y * f_z, e_y) + s_vy
    b = p.RBY1 * cos(atan(p.RBY2 * (tan_a - p.RBY3)))
    e, s = p.REY1 + p.REY2 * df, p.RHY1 + p.RHY2 * df
    unshifted = f_y0 * max(0.0, weight(kappa + s, b, p.RCY1, e) / weight(s, b, p.RCY1, e))
    d_v = mu_y * f_z * (p.RVY1 + p.RVY2 * df) * cos(atan(p.RVY4 * tan_a))
    f_y = unshifted + d_v * sin(p.RVY5 * atan(p.RVY6 * kappa))

    a_t = tan_a + p.QHZ1 + p.QHZ2 * df
    a_r = tan_a + s_hy + s_vy / k_y
    b_t = (p.QBZ1 + p.QBZ2 * df + p.QBZ3 * df**2) * k_y_scale / lam_y
    e_t = p.QEZ1 + p.QEZ2 * df + p.QEZ3 * df**2
    e_t = min(1.0, e_t * (1 + p.QEZ4 * 2 / pi * atan(b_t * p.QCZ1 * a_t)))
    d_t = f_z * r_0 / f_0 * (p.QDZ1 + p.QDZ2 * df)
    b_r = p.QBZ9 * k_y_scale / lam_y + p.QBZ10 * b_y * p.PCY1
    d_r = f_z * r_0 * (p.QDZ6 + p.QDZ7 * df) * cos(alpha) * lam_y
    a_t_eq = sqrt(a_t**2 + (k_x / k_y * kappa) ** 2) * sgn(a_t)
    a_r_eq = sqrt(a_r**2 + (k_x / k_y * kappa) ** 2) * sgn(a_r)
    x = b_t * a_t_eq
    trail = d_t * cos(p.QCZ1 * atan(x - e_t * (x - atan(x)))) * cos(alpha)
    lever = r_0 * (p.SSZ1 + p.SSZ2 * f_y / f_0)
    return f_x, f_y, -trail * unshifted + d_r * cos(atan(b_r * a_r_eq)) + lever * f_x


ODD = [
    "PHX1", "PHX2", "PVX1", "PVX2", "PHY1", "PHY2", "PVY1", "PVY2", "QHZ1", "QHZ2",
    "PEY3", "QEZ4", "RHX1", "RBY3", "RVY1", "RVY2", "QDZ6", "QDZ7", "SSZ1",
]  # fmt: skip


@pytest.mark.parametrize("asymmetric", [True, False])
def test_forces_and_moment_are_those_of_the_printed_equations_for_any_complete_set(asymmetric):
    draw, axles = random.Random(1), cycle(("front", "rear"))
    plain = MagicFormulaParameters()
    unlisted = {"PEX4": 0.1, "PVX1": 0.01, "PVX2": -0.02, "REX1": -0.3, "REX2": 0.1, "REY1": 0.2}
    unlisted |= {"REY2": -0.1, "RHY2": 0.01, "QBZ10": 0.4, "QEZ3": -0.1, "QDZ7": 0.003}
    worst = 0.0
    for _ in range(400):
        names = [f.name for f in dataclasses.fields(plain) if f.name.isupper()]
        given = {name: unlisted.get(name, getattr(plain, name)) * draw.uniform(0.8, 1.2) for name in names}
        given |= {"friction_scale_x": draw.uniform(0.8, 1.2), "friction_scale_y": draw.uniform(0.8, 1.2)}
        given |= {"asymmetric_terms": asymmetric, "low_friction": "scale"}
        axle, k_y, k_x = next(axles), draw.uniform(0.6, 1.2), draw.uniform(0.8, 1.2)
        given |= {f"cornering_stiffness_scale_{axle}": k_y, f"slip_stiffness_scale_{axle}": k_x}
        p = MagicFormulaParameters(reference_friction=0.9, **given)
        printed = p if asymmetric else dataclasses.replace(p, **dict.fromkeys(ODD, 0.0))
        kappa, alpha = draw.uniform(-0.9, 0.3), draw.uniform(-0.4, 0.4)
        f_z, mu = draw.uniform(300.0, 9000.0), draw.uniform(0.5, 1.2)
        expected = book(kappa, alpha, f_z, mu / 0.9, printed, k_y, k_x)
        found = forces_and_moment(interface_slip(kappa), alpha, f_z, mu, coefficients(p, axle))
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-7)
        worst = max(worst, *(abs(a - b) / f_z for a, b in zip(found[:2], expected[:2], strict=True)))
    terms = "with" if asymmetric else "without"
    printed = "the book's printed equations, forces as a share of the load"
    measured("tyres", f"tyre_magic_formula, {terms} asymmetric terms", printed, worst, at_most=1e-9)


def test_similarity_scales_forces_and_slips_together():
    for mu in (0.1, 0.3, 1.4):
        for kappa in (-0.05, -0.01, 0.0):
            for alpha in (-0.2, 0.002, 0.05):
                slippery = tyre(kappa, alpha, mu=mu, low_friction="similarity", SSZ2=0.0)
                angle = atan(tan(alpha) / mu)
                dry = tyre(kappa / mu, angle, SSZ2=0.0)
                moment = dry[2] * cos(alpha) / cos(angle)  # the arm turns with the true slip angle
                assert slippery == pytest.approx((mu * dry[0], mu * dry[1], mu * moment), rel=1e-11, abs=1e-9)


def test_similarity_keeps_the_resultant_in_the_bounds_of_the_dry_tyre_and_scale_does_not():
    def largest(mode, mu):
        return max(
            hypot(*tyre(-0.01 * i * mu, 0.02 * j * mu, mu=mu, low_friction=mode)[:2]) / (mu * 4000.0)
            for i in range(40)
            for j in range(20)
        )

    assert largest("similarity", 1.0) == pytest.approx(1.21, abs=0.005)
    assert largest("similarity", 0.3) == pytest.approx(1.21, abs=0.005)
    assert largest("scale", 0.3) == pytest.approx(1.42, abs=0.005)
    assert largest("scale", 0.1) == pytest.approx(1.53, abs=0.005)


@pytest.mark.parametrize("asymmetric", [True, False])
@pytest.mark.parametrize("mode", ["scale", "similarity"])
def test_forces_stay_finite_and_bounded_at_any_slip_load_and_friction(mode, asymmetric):
    c = coefficients(MagicFormulaParameters(low_friction=mode, asymmetric_terms=asymmetric), "front")
    for kappa in (*SLIPS, -2.0, 2.0, 1e9, -1e9):
        for alpha in (*ANGLES, -0.5 * pi, pi, -3.0, 1e-300):
            for f_z in (1e-5, 1.0, 4000.0, 1e5, 1e12):
                for mu in (1e-5, 0.3, 1.0, 5.0):
                    values = forces_and_moment(kappa, alpha, f_z, mu, c)
                    assert all(isfinite(value) for value in values)
                    assert hypot(*values[:2]) < 3.0 * mu * f_z


@pytest.mark.parametrize("asymmetric", [True, False])
def test_curvatures_above_one_count_as_one(asymmetric):
    flat = {"PEX2": 0.0, "PEX3": 0.0, "PEY2": 0.0, "PEY3": 0.0, "QEZ2": 0.0, "QEZ4": 0.0}
    ones, threes = ({"PEX1": e, "PEY1": e, "QEZ1": e, "PEX4": 0.0} for e in (1.0, 3.0))
    for kappa, alpha in ((-0.05, 0.06), (0.1, -0.02)):
        expected = tyre(kappa, alpha, asymmetric_terms=asymmetric, **flat, **ones)
        assert tyre(kappa, alpha, asymmetric_terms=asymmetric, **flat, **threes) == expected


def test_a_wheel_that_rolls_backwards_pushes_against_its_sliding_with_the_trail_on_the_other_side():
    for kappa in (-0.04, 0.04):
        x, y, _ = tyre(kappa, 0.1, RHY1=0.0)
        assert tyre(-kappa, pi - 0.1, RHY1=0.0)[:2] == pytest.approx((-x, y), rel=1e-9)
    assert tyre(0.0, pi - 0.1)[2] == pytest.approx(-tyre(0.0, 0.1)[2], rel=1e-9)


def test_a_braked_force_is_not_turned_round_by_a_large_slip_angle():
    angles = [radians(a) for a in range(0, 91, 3)]
    assert all(tyre(-0.02, a)[0] <= 0.0 for a in angles)
    assert tyre(-0.02, radians(60.0))[0] == 0.0


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"PDY2": 0.6}, ("mu_y", "PDY1", "PDY2")),
        ({"PDX1": 0.0}, ("mu_x", "PDX1", "PDX2")),
        ({"PKX2": -11.0}, ("K_x", "PKX1", "PKX2")),
        ({"PKY4": 4.0}, ("K_y", "PKY1", "PKY2", "PKY4")),
        ({"maximum_load": 40000.0}, ("mu_y", "PDY1", "PDY2")),
    ],
)
def test_a_set_that_changes_sign_below_maximum_load_is_refused_by_name(changed, named):
    with pytest.raises(ValueError) as error:
        coefficients(MagicFormulaParameters(**changed), "front")
    assert mentions(str(error.value), *named)
    assert "maximum_load" in str(error.value)

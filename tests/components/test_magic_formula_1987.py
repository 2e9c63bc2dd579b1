"""The Magic Formula tyre of 1987 against its printed formulae and the properties of combined slip."""

from __future__ import annotations

from math import atan, atan2, cos, exp, hypot, pi, radians, sin, tan

import pytest

from tests.evidence import measured
from yawbench.components.tyre_models.bakker_1987 import (
    MagicFormula1987Parameters,
    coefficients_1987,
    loaded_tyre,
)

from .magic import forces_1987


def tyre(kappa, alpha, f_z=4500.0, mu=1.0, **changed):
    loaded = loaded_tyre(f_z, mu, coefficients_1987(MagicFormula1987Parameters(**changed)))
    return (0.0, 0.0) if loaded is None else forces_1987(kappa, alpha, loaded)


def magic(x, b, c, d, e):
    return d * sin(c * atan(b * x - e * (b * x - atan(b * x))))


def printed_lateral(degrees, f, d):
    bcd = 1078.0 * sin(1.82 * atan(0.208 * f))
    return magic(degrees, bcd / (1.30 * d), 1.30, d, -0.354 * f + 0.707)


def printed_longitudinal(percent, f, d):
    bcd = (49.6 * f * f + 226.0 * f) * exp(-0.069 * f)
    return magic(percent, bcd / (1.65 * d), 1.65, d, -0.006 * f * f + 0.056 * f + 0.486)


@pytest.mark.parametrize("f_z", [500.0, 2000.0, 4500.0, 8000.0])
@pytest.mark.parametrize("mu", [0.3, 0.5, 1.0])
def test_pure_slip_gives_the_printed_formulae_with_the_peak_asked_for(mu, f_z):
    f = 0.001 * f_z
    peaks = {
        "road": (mu * f_z, mu * f_z),
        "measured": (mu * (-21.3 * f * f + 1144.0 * f), mu * (-22.1 * f * f + 1011.0 * f)),
    }
    worst = 0.0
    for mode, (d_x, d_y) in peaks.items():
        for degrees in (0.1, 1.0, 4.0, 12.0, 45.0):
            f_x, f_y = tyre(0.0, radians(degrees), f_z, mu, peak_friction=mode)
            assert f_x == 0.0
            worst = max(worst, abs(f_y / -printed_lateral(degrees, f, d_y) - 1.0))
        for percent in (-100.0, -20.0, -3.0, -0.1):
            f_x, f_y = tyre(0.01 * percent, 0.0, f_z, mu, peak_friction=mode)
            assert f_y == 0.0
            worst = max(worst, abs(f_x / printed_longitudinal(percent, f, d_x) - 1.0))
    assert worst <= 1e-12
    if (mu, f_z) == (0.5, 4500.0):
        measured("tyres", "tyre_magic_formula_1987, pure slip", "the printed formulae", worst, at_most=1e-12)


def test_driving_slip_is_turned_into_that_of_the_formula():
    assert tyre(0.2, 0.0)[0] == pytest.approx(printed_longitudinal(25.0, 4.5, 4500.0), rel=1e-12)


def test_combined_slip_ends_in_pure_slip_without_a_jump():
    for kappa in (-0.3, -0.05, 0.02, 0.4):
        assert tyre(kappa, 1e-7)[0] == pytest.approx(tyre(kappa, 0.0)[0], rel=1e-6)
    for alpha in (-0.3, -0.05, 0.02, 0.4):
        assert tyre(1e-9, alpha)[1] == pytest.approx(tyre(0.0, alpha)[1], rel=1e-6)


def test_the_resultant_never_exceeds_mu_times_load():
    for mu in (0.3, 1.0):
        for i in range(51):
            for alpha in (0.0, 0.01, 0.04, 0.1, 0.3, 1.0):
                assert hypot(*tyre(-0.02 * i * mu, alpha, mu=mu)) <= mu * 4500.0 * (1.0 + 1e-12)


def test_a_locked_wheel_slides_against_its_travel_where_both_sliding_frictions_are_equal():
    equal = {"a0": 1.3, "b0": 1.3, "b6": 0.0, "b7": -0.354, "b8": 0.707}
    for alpha in (0.02, 0.2, 0.8):
        f_x, f_y = tyre(-1.0, alpha, mu=0.3, **equal)
        assert atan2(-f_y, -f_x) == pytest.approx(alpha, abs=0.01)


def test_a_wheel_that_rolls_backwards_pushes_against_its_sliding():
    x, y = tyre(-0.04, 0.1)
    assert tyre(0.04, pi - 0.1) == pytest.approx((-x, y), rel=1e-9)


def test_curvatures_above_one_count_as_one():
    ones, threes = ({"a7": 0.0, "a8": e, "b6": 0.0, "b7": 0.0, "b8": e} for e in (1.0, 3.0))
    assert tyre(-0.05, 0.06, **threes) == tyre(-0.05, 0.06, **ones)


def test_half_the_reference_friction_doubles_a_measured_peak():
    one = tyre(0.0, 0.3, mu=0.4, peak_friction="measured")
    assert tyre(0.0, 0.3, mu=0.2, peak_friction="measured", reference_friction=0.5) == pytest.approx(one)


@pytest.mark.parametrize("changed", [{"a2": 100.0}, {"b2": -1.0}, {"a4": 3.0}, {"b3": -30.0}, {"a0": 0.0}])
def test_a_set_that_is_not_positive_up_to_maximum_load_is_refused_by_name(changed):
    (name,) = changed
    with pytest.raises(ValueError) as error:
        coefficients_1987(MagicFormula1987Parameters(**changed))
    assert name in str(error.value)
    assert "maximum_load = 12000 N" in str(error.value)


def test_the_force_direction_at_half_the_way_to_sliding_is_that_of_radt():
    # k = pi: eta = (1 + eta_0) / 2 exactly
    f_z, mu, alpha = 4500.0, 0.5, 0.05
    loaded = loaded_tyre(f_z, mu, coefficients_1987(MagicFormula1987Parameters()))
    n_x, n_y = loaded.k_x / loaded.d_x, loaded.k_y / loaded.d_y
    kappa = -((pi**2 - (n_y * alpha) ** 2) ** 0.5) / n_x
    f_x, f_y = forces_1987(kappa, alpha, loaded)
    size_x = printed_longitudinal(100.0 * pi / n_x, 4.5, loaded.d_x)
    size_y = printed_lateral(180.0 / pi * pi / n_y, 4.5, loaded.d_y)
    angle = atan2(0.5 * (1.0 + n_y / n_x) * tan(alpha), kappa)
    assert (f_x, f_y) == pytest.approx((size_x * cos(angle), -size_y * sin(angle)), rel=1e-10)

"""Slope of the force that tyres report, against differences of the force itself."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from yawbench.components.tyres.dugoff import Dugoff, dugoff
from yawbench.components.tyres.linear import LinearTyre
from yawbench.components.tyres.magic_formula import MagicFormula
from yawbench.components.tyres.magic_formula_62 import MagicFormula62
from yawbench.components.tyres.magic_formula_1987 import MagicFormula1987

from .stand import Stand

TYRES = [
    pytest.param(Dugoff, {}, id="Dugoff"),
    pytest.param(LinearTyre, {}, id="linear"),
    pytest.param(LinearTyre, {"limited": True}, id="linear, limited"),
    pytest.param(MagicFormula, {}, id="Magic Formula"),
    pytest.param(MagicFormula, {"low_friction": "similarity"}, id="Magic Formula, similarity"),
    pytest.param(MagicFormula, {"asymmetric_terms": True}, id="Magic Formula, asymmetric"),
    pytest.param(MagicFormula62, {}, id="6.2, asymmetric"),
    pytest.param(MagicFormula1987, {}, id="1987"),
    pytest.param(MagicFormula1987, {"peak_friction": "measured"}, id="1987, measured"),
]
ALPHAS = (-0.3, -0.02, 0.0, 0.004, 0.1, 3.0)
KAPPAS = (-1.2, -0.9, -0.15, -0.03, -0.002, 0.001, 0.05, 0.3, 0.9)


def of(stand, alpha, kappa, load, mu):
    stand.set(slip_angle_fl=alpha, slip_ratio_fl=kappa, vertical_load_fl=load, friction_fl=mu)
    y = stand.step(0.001)
    return y["tyre_force_x_fl"], y["slip_stiffness_fl"], y["tyre_slip_ratio_fl"]


@pytest.mark.parametrize("tyre, parameters", TYRES)
def test_the_stiffness_is_the_slope_of_the_longitudinal_force_over_slip(tyre, parameters):
    stand = Stand(tyre, **parameters)
    stand.start()
    step = 1e-5
    kinks = checked = 0
    for alpha, kappa, load, mu in product(ALPHAS, KAPPAS, (1500.0, 5000.0), (0.3, 1.0)):
        ahead, behind = (of(stand, alpha, kappa + d, load, mu)[0] for d in (step, -step))
        here, found, _ = of(stand, alpha, kappa, load, mu)
        sides = (ahead - here) / step, (here - behind) / step
        if abs(sides[0] - sides[1]) > 0.01 * max(map(abs, sides)) + 50.0:
            kinks += 1  # grip to sliding within the step: either side's slope will do
            continue
        checked += 1
        assert found == pytest.approx((ahead - behind) / (2 * step), rel=2e-3, abs=2.0)
    assert checked > 200
    assert kinks < 3


@pytest.mark.parametrize("tyre, parameters", TYRES)
def test_at_rest_the_stiffness_is_that_of_pure_slip(tyre, parameters):
    stand = Stand(tyre, **parameters)
    stand.start()
    found = of(stand, 0.0, 0.0, 4000.0, 1.0)[1]
    force = of(stand, 0.0, -1e-6, 4000.0, 1.0)[0] - of(stand, 0.0, 0.0, 4000.0, 1.0)[0]
    assert found == pytest.approx(-force / 1e-6, rel=1e-3)
    assert found > 2e4


@pytest.mark.parametrize("tyre, parameters", TYRES)
def test_the_slip_told_is_the_slip_given_and_a_lifted_wheel_has_no_stiffness(tyre, parameters):
    stand = Stand(tyre, **parameters)
    stand.start()
    assert of(stand, 0.1, -0.07, 0.0, 1.0)[1:] == (0.0, -0.07)


@pytest.mark.parametrize("tyre, parameters", [t.values for t in TYRES if "asymmetric" not in t.id])
def test_left_and_right_slip_angles_give_the_same_stiffness_to_the_last_bit(tyre, parameters):
    stand = Stand(tyre, **parameters)
    stand.start()
    for alpha, kappa in product((0.01, 0.2, 3.0), KAPPAS):
        assert of(stand, alpha, kappa, 4000.0, 0.8) == of(stand, -alpha, kappa, 4000.0, 0.8)


def test_dugoffs_stiffness_is_finite_wherever_its_force_is():
    random = np.random.default_rng(5)
    tyre = {"f_z": 3000.0, "mu": 0.8, "c_x": 4e4, "c_y": 5e4}
    for alpha, kappa in [*random.uniform((-3.2, -2.0), (3.2, 2.0), (2000, 2)), (0.0, -1.0), (np.pi / 2, 0.0)]:
        assert np.all(np.isfinite(dugoff(alpha, kappa, **tyre)))


@pytest.mark.parametrize("tyre, parameters", TYRES)
@pytest.mark.parametrize("kappa", [1e-140, -1.3e-162, 5e-324])
def test_slips_too_small_to_be_squared_give_the_stiffness_at_rest(tyre, parameters, kappa):
    stand = Stand(tyre, **parameters)
    stand.start()
    force, found, _ = of(stand, 0.0, kappa, 4000.0, 1.0)
    still, expected, _ = of(stand, 0.0, 0.0, 4000.0, 1.0)
    assert found == pytest.approx(expected, rel=1e-5)
    assert force == pytest.approx(still, abs=1e-100)

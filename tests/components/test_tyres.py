"""What every tyre does: four wheels apart, nothing without load or friction, its slope as told."""

from __future__ import annotations

from itertools import product
from math import hypot, pi

import numpy as np
import pytest

from yawbench.components.tyres.dugoff import Dugoff, dugoff
from yawbench.components.tyres.linear import LinearTyre, LinearTyreParameters
from yawbench.components.tyres.magic_formula import MagicFormula
from yawbench.components.tyres.magic_formula_62 import MagicFormula62
from yawbench.components.tyres.magic_formula_1987 import MagicFormula1987

from .stand import Stand
from .test_conformance import mirrored

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
every = pytest.mark.parametrize("tyre, parameters", TYRES)
symmetric = pytest.mark.parametrize("tyre, parameters", [t for t in TYRES if "asymmetric" not in t.id])
ALPHAS = (-0.3, -0.02, 0.0, 0.004, 0.1, 3.0)
KAPPAS = (-1.2, -0.9, -0.15, -0.03, -0.002, 0.001, 0.05, 0.3, 0.9)


def of(stand, alpha, kappa, load, mu):
    stand.set(slip_angle_fl=alpha, slip_ratio_fl=kappa, vertical_load_fl=load, friction_fl=mu)
    y = stand.step(0.001)
    return y["tyre_force_x_fl"], y["slip_stiffness_fl"], y["tyre_slip_ratio_fl"]


@every
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


@every
def test_at_rest_the_stiffness_is_that_of_pure_slip(tyre, parameters):
    stand = Stand(tyre, **parameters)
    stand.start()
    found = of(stand, 0.0, 0.0, 4000.0, 1.0)[1]
    force = of(stand, 0.0, -1e-6, 4000.0, 1.0)[0] - of(stand, 0.0, 0.0, 4000.0, 1.0)[0]
    assert found == pytest.approx(-force / 1e-6, rel=1e-3)
    assert found > 2e4


STATES = {
    "fl": (0.02, -0.03, 4000.0, 1.0),
    "fr": (-0.05, 0.02, 3000.0, 0.3),
    "rl": (0.01, 0.0, 3500.0, 0.8),
    "rr": (0.04, -0.1, 2500.0, 0.5),
}
"""Slip angle, slip ratio, load and friction of each wheel."""


def given(states):
    names = ("slip_angle", "slip_ratio", "vertical_load", "friction")
    return {f"{n}_{w}": x for w, state in states.items() for n, x in zip(names, state, strict=True)}


@every
def test_a_wheel_has_its_own_slips_load_and_friction_and_the_others_do_not_matter(tyre, parameters):
    together = Stand(tyre, **parameters).start(**given(STATES))
    for wheel, state in STATES.items():
        alone = Stand(tyre, **parameters).start(**given({wheel: state}))
        for name, value in alone.items():
            assert value == (together[name] if name.endswith(wheel) else 0.0)
        assert alone[f"tyre_force_y_{wheel}"] * state[0] < 0.0


@every
def test_without_load_or_friction_a_wheel_has_no_force_but_tells_its_slip(tyre, parameters):
    for load, mu in ((0.0, 1.0), (-500.0, 1.0), (4000.0, 0.0), (4000.0, -1.0), (-500.0, -0.5)):
        if load > 0.0 and (tyre, parameters) == (LinearTyre, {}):
            continue  # knows no friction
        y = Stand(tyre, **parameters).start(**given({"fl": (0.1, -0.07, load, mu)}))
        assert y.pop("tyre_slip_ratio_fl") == -0.07
        assert set(y.values()) == {0.0}


@symmetric
def test_without_slip_there_is_no_force_and_left_and_right_are_mirrors_to_the_last_bit(tyre, parameters):
    stand = Stand(tyre, **parameters)
    still = stand.start(**given({"fl": (0.0, 0.0, 4000.0, 0.8)}))
    assert (still["tyre_force_x_fl"], still["tyre_force_y_fl"]) == (0.0, 0.0)
    for alpha, kappa in product((0.01, 0.2, 1.2, 3.0), KAPPAS):
        left, right = (
            stand.step(0.001, **given({"fl": (a, kappa, 4e3, 0.8), "fr": (a, kappa, 4e3, 0.8)}))
            for a in (alpha, -alpha)
        )
        assert right == mirrored(left)


@pytest.mark.parametrize(
    ("tyre", "limits"),
    [
        (MagicFormula, {"maximum_load": 4000.0}),
        (MagicFormula1987, {"maximum_load": 4000.0}),
        (MagicFormula1987, {"maximum_load": 4000.0, "peak_friction": "measured"}),
        (MagicFormula62, {"fzmax_front": 4000.0}),
    ],
)
def test_above_the_largest_load_of_the_set_everything_is_proportional_to_load(tyre, limits):
    stand = Stand(tyre, **limits)
    at_limit = stand.start(**given({"fl": (0.06, -0.05, 4000.0, 1.0)}))
    above = stand.step(0.001, vertical_load_fl=12000.0)
    assert above.pop("tyre_slip_ratio_fl") == at_limit.pop("tyre_slip_ratio_fl")
    for name, value in at_limit.items():
        of_slopes = name.startswith("slip_stiffness")  # differences of forces
        assert above[name] == pytest.approx(3.0 * value, rel=1e-10 if of_slopes else 1e-12)


def test_dugoffs_stiffness_is_finite_wherever_its_force_is():
    random = np.random.default_rng(5)
    tyre = {"f_z": 3000.0, "mu": 0.8, "c_x": 4e4, "c_y": 5e4}
    for alpha, kappa in [*random.uniform((-3.2, -2.0), (3.2, 2.0), (2000, 2)), (0.0, -1.0), (np.pi / 2, 0.0)]:
        assert np.all(np.isfinite(dugoff(alpha, kappa, **tyre)))


@every
@pytest.mark.parametrize("kappa", [1e-140, -1.3e-162, 5e-324])
def test_slips_too_small_to_be_squared_give_the_stiffness_at_rest(tyre, parameters, kappa):
    stand = Stand(tyre, **parameters)
    stand.start()
    force, found, _ = of(stand, 0.0, kappa, 4000.0, 1.0)
    still, expected, _ = of(stand, 0.0, 0.0, 4000.0, 1.0)
    assert found == pytest.approx(expected, rel=1e-5)
    assert force == pytest.approx(still, abs=1e-100)


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

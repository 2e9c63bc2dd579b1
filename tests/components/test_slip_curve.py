"""The inverse slip curve: the slip that gives a force of a tyre, and its limit."""

from __future__ import annotations

from itertools import pairwise, product

import pytest
from scipy.optimize import brentq

from yawbench.components.tyre_models.slip_curve import slip_for_force
from yawbench.components.tyres.dugoff import Dugoff
from yawbench.components.tyres.linear import LinearTyre
from yawbench.components.tyres.magic_formula import MagicFormula
from yawbench.components.tyres.magic_formula_62 import MagicFormula62
from yawbench.components.tyres.magic_formula_1987 import MagicFormula1987
from yawbench.components.wheel_controls.slip import TYRES as KNOWN
from yawbench.components.wheel_controls.slip import SlipParameters

from .stand import Stand
from .tyre_curves import CAP, SHARE, curve_of, slip_limits, tyre_curve

LOADS = (300.0, 2000.0, 4000.0, 8000.0, 15000.0)
ANGLES = (0.0, 0.03, -0.05, 0.1, 0.25, 0.6, 1.3, 2.8)
FRICTIONS = (0.1, 0.3, 0.6, 1.0, 1.2)
TYRES = {
    "magic formula": {"tyre": "magic_formula"},
    "magic formula, similarity": {"tyre": "magic_formula", "low_friction": "similarity"},
    "magic formula, similarity, asymmetric": {
        "tyre": "magic_formula",
        "low_friction": "similarity",
        "asymmetric_terms": True,
    },
    "magic formula 6.2, asymmetric": {"tyre": "magic_formula_62"},
    "magic formula 1987": {"tyre": "magic_formula_1987"},
    "magic formula 1987, measured": {"tyre": "magic_formula_1987", "peak_friction": "measured"},
    "dugoff": {"tyre": "dugoff"},
    "linear": {"tyre": "linear"},
    "linear, limited": {"tyre": "linear", "limited": True},
}


@pytest.mark.parametrize("name", TYRES)
def test_the_inverse_curve_returns_the_force_asked_for_and_clamps_outside(name):
    for f_z, alpha, mu in list(product(LOADS, ANGLES, FRICTIONS))[::23]:
        force, first = tyre_curve(alpha, f_z, mu, **TYRES[name])
        for sign in (1.0, -1.0):
            limits, grid = slip_limits(force, sign)
            limit = limits[0]
            at_zero, at_limit = force(0.0), force(sign * limit)
            for part in (0.001, 0.02, 0.2, 0.5, 0.8, 0.97):
                wanted = at_zero + part * (at_limit - at_zero)
                kappa = slip_for_force(wanted, force, first=first, cap=CAP, share=SHARE)
                assert force(kappa) == pytest.approx(wanted, rel=1e-3, abs=2e-6)
                assert abs(kappa) <= limit + grid
            if abs(at_limit - at_zero) > 1e-3:
                for beyond in (1.1, 5.0):
                    wanted = at_zero + beyond * (at_limit - at_zero)
                    kappa = slip_for_force(wanted, force, first=first, cap=CAP, share=SHARE)
                    at_limit_of_some_optimum = any(
                        kappa == pytest.approx(sign * x, rel=5e-3, abs=2 * grid) for x in limits
                    )
                    beyond_a_dip = len(limits) > 1 and force(kappa) == pytest.approx(wanted, rel=1e-3)
                    assert at_limit_of_some_optimum or beyond_a_dip


def test_the_inverse_curve_does_not_depend_on_where_the_search_begins():
    force, first = tyre_curve(0.02, 4000.0, 0.3)
    end = slip_for_force(-9e9, force, first=first, cap=CAP, share=SHARE)
    for part in (0.3, 0.9, 0.99, 0.999):
        wanted = part * force(end)
        for i in range(40):
            begin = first * 0.1 * 1.06**i
            kappa = slip_for_force(wanted, force, first=begin, cap=CAP, share=SHARE)
            assert force(kappa) == pytest.approx(wanted, rel=1e-4)
            assert end <= kappa < 0.0


def test_a_force_between_the_share_and_the_optimum_gets_the_share():
    force, first = tyre_curve(0.0, 4000.0, 0.3)
    limit = slip_for_force(-9e9, force, first=first, cap=0.5, share=0.8)
    for share_of_optimum in (0.85, 0.95, 0.99):
        wanted = force(limit * share_of_optimum / 0.8)
        kappa = slip_for_force(wanted, force, first=first, cap=0.5, share=0.8)
        assert kappa == pytest.approx(limit, rel=3e-3)


def test_the_inverse_curve_is_continuous_in_the_force_up_to_the_clamp():
    force, first = tyre_curve(0.05, 4000.0, 0.3)
    slips = [slip_for_force(-2.0 * i, force, first=first, cap=CAP, share=SHARE) for i in range(700)]
    assert all(later <= earlier for earlier, later in pairwise(slips))
    slope = (force(slips[-1] + 1e-6) - force(slips[-1] - 1e-6)) / 2e-6  # the curve is flattest at its limit
    assert max(earlier - later for earlier, later in pairwise(slips)) < 1.1 * 2.0 / slope


def test_the_limit_is_the_share_of_the_dry_optimum_and_the_cap_where_the_optimum_lies_beyond():
    force, first = tyre_curve(0.0, 4000.0, 0.3)
    optimum = brentq(lambda k: force(k + 1e-6) - force(k - 1e-6), -0.08, -0.02)
    assert slip_for_force(-9e9, force, first=first, cap=0.5, share=0.9) == pytest.approx(
        0.9 * optimum, rel=2e-3
    )
    force, first = tyre_curve(0.26, 4000.0, 0.3)  # 15 degrees: the optimum is near kappa -0.9
    assert slip_for_force(-9e9, force, first=first, cap=0.15, share=0.95) == -0.15
    assert slip_for_force(-9e9, force, first=first, cap=0.9, share=0.95) < -0.5


def test_a_curve_without_any_force_gives_the_cap_and_no_request_gives_no_slip():
    for name, f_z, mu in product(TYRES, (0.0, 4000.0), (0.0, 1.0)):
        force, first = tyre_curve(0.02, f_z, mu, **TYRES[name])
        kappa = slip_for_force(-500.0, force, first=first, cap=CAP, share=SHARE)
        if force(-CAP) == 0.0:
            assert kappa == -CAP
        if "asymmetric" not in name:
            assert slip_for_force(0.0, force, first=first, cap=CAP, share=SHARE) == 0.0


def test_zero_force_of_a_tyre_with_offsets_needs_a_slip():
    force, first = tyre_curve(0.0, 4000.0, 1.0, asymmetric_terms=True)
    kappa = slip_for_force(0.0, force, first=first, cap=CAP, share=SHARE)
    assert force(0.0) < -100.0
    assert kappa == pytest.approx(0.002, rel=0.05)
    assert force(kappa) == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize("name", TYRES)
def test_the_curve_that_is_inverted_is_that_of_the_tyre_unit(name):
    units = {
        "magic_formula": MagicFormula,
        "magic_formula_62": MagicFormula62,
        "magic_formula_1987": MagicFormula1987,
        "dugoff": Dugoff,
        "linear": LinearTyre,
    }
    given = dict(TYRES[name])
    stand = Stand(units[given.pop("tyre")], **given)
    stand.start()
    for alpha, kappa, f_z, mu in (
        (0.03, -0.02, 4000.0, 0.5),
        (-0.2, 0.1, 2500.0, 1.0),
        (0.0, -0.6, 800.0, 0.3),
    ):
        slips = {"slip_angle_rl": alpha, "slip_ratio_rl": kappa, "vertical_load_rl": f_z, "friction_rl": mu}
        force, _ = tyre_curve(alpha, f_z, mu, **TYRES[name])
        assert force(kappa) == pytest.approx(stand.step(0.001, **slips)["tyre_force_x_rl"], rel=1e-14)


def test_right_wheels_ask_the_mirror_of_a_set_that_tells_left_from_right():
    p = SlipParameters(tyre="magic_formula_62", rhx1_front=0.03)
    left, right = KNOWN["magic_formula_62"].for_curve(p)[:2]
    forces = [
        MagicFormula62.curve(alpha, 4000.0, 1.0, s)[0](-0.03) for alpha, s in ((0.04, left), (-0.04, right))
    ]
    assert forces[0] == forces[1] != MagicFormula62.curve(0.04, 4000.0, 1.0, right)[0](-0.03)


def test_each_axle_has_its_own_stiffness():
    p = SlipParameters(slip_stiffness_scale_front=0.8, slip_stiffness_scale_rear=1.2)
    front, rear = [curve_of(p, axle)[0](1e-6) for axle in ("front", "rear")]
    assert front / rear == pytest.approx(0.8 / 1.2, rel=1e-4)

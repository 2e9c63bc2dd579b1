"""The Magic Formula tyre of MF-Tyre 6.2, 6.1 and 5.2, against a second implementation of the equations."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from tests.evidence import measured
from yawbench.components.tyre_models.pacejka_2012_set import COMMON, LONGITUDINAL, REST
from yawbench.components.tyres.magic_formula_62 import MagicFormula62

from . import magic_62
from .stand import Stand

ODD = (
    *("rhx1", "pey3", "phy1", "phy2", "pvy1", "pvy2", "rby3", "rvy1", "rvy2"),
    *("qbz4", "qdz3", "qdz6", "qdz7", "qez4", "qhz1", "qhz2", "ssz1", "qsx1"),
)
"""Coefficients that tell left from right."""
ROWS = COMMON | LONGITUDINAL | REST
KINDS = (6.0, 61.0, 62.0)
BOOK = {key: row.default for key, row in ROWS.items()}
FOR_62 = {"phy3", "lgax", "lgay", "lgaz"}
FOR_52 = {
    *("pey5", "pky5", "pky6", "pky7", "ppy5", "qdz10", "qdz11", "rbx3", "rby4", "lkyc", "lkzc"),
    *(f"qsx{i}" for i in range(4, 15)),
}


def some_set(rng, kind):
    """Return a set near the book's with every coefficient of its kind alive."""
    given = {}
    for key, row in ROWS.items():
        if key.startswith("l"):
            given[key] = rng.uniform(0.7, 1.3)
        elif row.default == 0.0:
            given[key] = rng.uniform(-0.2, 0.2)
        else:
            given[key] = row.default * rng.uniform(0.8, 1.2)
    given |= {"fittyp": kind, "tyreside": 1.0, "fzmax": rng.uniform(6000.0, 12000.0)}
    if rng.random() < 0.5:  # only products have a sign
        given["pdy1"], given["pdy2"] = -given["pdy1"], -given["pdy2"]
    if rng.random() < 0.5:
        given["pky1"], given["pky4"] = -given["pky1"], -given["pky4"]
    left_out = FOR_52 if kind == 6.0 else FOR_62
    return given | {key: ROWS[key].default if key[0] in "lf" else 0.0 for key in left_out}


def some_states(rng, n=60):
    return {
        "kappa": rng.uniform(-0.9, 0.6, n),
        "alpha": rng.uniform(-0.5, 0.5, n),
        "gamma": np.where(rng.random(n) < 0.2, 0.0, rng.uniform(-0.15, 0.15, n)),
        "f_z": rng.uniform(200.0, 14000.0, n),
    }


def each(states):
    return [dict(zip(states, one, strict=True)) for one in zip(*states.values(), strict=True)]


def in_file_names(given):
    return {key.upper(): value for key, value in given.items()}


def of_axles(given):
    return {f"{key}_{axle}": value for key, value in given.items() for axle in ("front", "rear")}


def at(stand, wheel="fl", *, kappa=0.0, alpha=0.0, gamma=0.0, f_z=4000.0, mu=1.0):
    """Return F_x, F_y, M_z, M_x, dF_x/dkappa of a wheel."""
    given = {
        **{f"slip_ratio_{wheel}": kappa, f"slip_angle_{wheel}": alpha, f"inclination_angle_{wheel}": gamma},
        **{f"vertical_load_{wheel}": f_z, f"friction_{wheel}": mu},
    }
    y = stand.step(0.001, **given)
    names = ("tyre_force_x", "tyre_force_y", "aligning_moment", "overturning_moment", "slip_stiffness")
    return tuple(y[f"{name}_{wheel}"] for name in names)


def tyre(given=None, **more):
    stand = Stand(MagicFormula62, **of_axles(given or {}), **more)
    stand.start()
    return stand


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(8))
def test_forces_moments_and_slip_stiffness_are_those_of_the_second_implementation(kind, seed):
    rng = np.random.default_rng([seed, int(kind)])
    given, states, mu = some_set(rng, kind), some_states(rng), rng.uniform(0.2, 1.2)
    expected = magic_62.forces(in_file_names(given), **states, mu=mu)
    stand = tyre(given, file_low_friction="scale")
    found = np.array([at(stand, mu=mu, **state) for state in each(states)]).T
    share = 0.0
    for name, a, b in zip(("F_x", "F_y", "M_z", "M_x", "stiffness"), found, expected, strict=True):
        share = max(share, np.max(np.abs(a - b) / np.maximum(np.abs(b), 1e-3 * states["f_z"])))
        allowed = 1e-9 * np.maximum(np.abs(b), 1e-3 * states["f_z"])
        worst = int(np.argmax(np.abs(a - b) / allowed))
        assert np.all(np.abs(a - b) <= allowed), (name, a[worst], b[worst])
    if seed == 0:
        second = "a second implementation, any set of coefficients"
        measured("tyres", f"tyre_magic_formula_62, FITTYP {kind:g}", second, share, at_most=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_with_similarity_forces_are_those_of_the_second_implementation_at_scaled_slips(kind):
    rng = np.random.default_rng([99, int(kind)])
    given, states, mu = some_set(rng, kind), some_states(rng), rng.uniform(0.3, 0.6)
    practical = (
        np.where(states["kappa"] > 0.0, states["kappa"] / (1.0 - states["kappa"]), states["kappa"]) / mu
    )
    scaled = np.where(practical > 0.0, practical / (1.0 + practical), practical)
    dry = magic_62.forces(in_file_names(given), **states | {"kappa": scaled, "alpha": states["alpha"] / mu})
    stand = tyre(given, file_low_friction="similarity")
    found = np.array([at(stand, mu=mu, **state) for state in each(states)]).T
    for a, b in zip(found[:2], dry[:2], strict=True):
        assert np.all(np.abs(a - mu * b) <= 1e-9 * np.maximum(np.abs(mu * b), 1e-3 * states["f_z"]))
    h = 1e-6  # the slope is that of the force
    for state, slope in zip(each(states), found[4], strict=True):
        ahead, behind = (at(stand, mu=mu, **state | {"kappa": state["kappa"] + d})[0] for d in (h, -h))
        if abs(state["kappa"]) > h:
            assert slope == pytest.approx((ahead - behind) / (2.0 * h), rel=1e-4, abs=2.0)


def test_on_the_road_of_the_set_both_readings_of_low_friction_agree_to_the_bit():
    rng = np.random.default_rng(5)
    given = some_set(rng, 62.0)
    one, other = (tyre(given, file_low_friction=how) for how in ("scale", "similarity"))
    for state in each(some_states(rng)):
        assert at(one, **state) == at(other, **state)


@pytest.mark.parametrize("kind", KINDS)
def test_a_set_and_its_mirror_named_for_the_other_side_agree_to_the_bit(kind):
    rng = np.random.default_rng(int(kind) + 7)
    left = some_set(rng, kind)
    right = left | {key: -left[key] for key in ODD} | {"tyreside": -1.0}
    one, other = tyre(left), tyre(right)
    for state in each(some_states(rng)):
        for wheel in ("fl", "fr", "rl", "rr"):
            assert at(one, wheel, **state) == at(other, wheel, **state)


def test_a_wheel_that_rolls_backward_is_the_forward_one_reflected():
    rng = np.random.default_rng(12)
    stand = tyre(some_set(rng, 62.0))
    for state in each(some_states(rng)):
        back = state | {"kappa": -state["kappa"], "alpha": pi - state["alpha"]}
        f_x, f_y, m_z, m_x, slope = at(stand, **state)
        expected = (-f_x, f_y, -m_z, m_x, slope)
        assert at(stand, **back) == pytest.approx(expected, rel=1e-9, abs=1e-6)


def test_the_default_set_gives_the_peaks_and_stiffnesses_tabled_for_it():
    """Table of a second implementation at zero camber, of the set's own offsets."""
    expected = {2000.0: (2457.0, 38204.0), 4000.0: (4840.0, 86040.0), 6000.0: (7149.0, 145326.0)}
    stand, centred = tyre(), tyre(phx1_front=0.0, phx2_front=0.0, rhx1_front=0.0)
    for load, (peak, stiffness) in expected.items():
        forces = [at(stand, kappa=k, f_z=load)[0] for k in np.linspace(0.0, 0.4, 401)]
        assert max(forces) == pytest.approx(peak, rel=2e-4)
        assert at(centred, f_z=load)[4] == pytest.approx(stiffness, rel=1e-4)


def test_the_books_tangents_are_a_switch():
    by_angle, by_tangent = tyre(), tyre(slip_angle_as_tangent=True)
    assert at(by_angle, alpha=1e-4) == pytest.approx(at(by_tangent, alpha=1e-4), rel=1e-4, abs=1e-3)
    a, b = at(by_angle, alpha=0.13)[1], at(by_tangent, alpha=0.13)[1]
    assert 1.0 < abs(a - b) < 0.012 * 4000.0
    assert b == pytest.approx(at(by_angle, alpha=float(np.tan(0.13)))[1], rel=1e-12)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"pky1_front": 15.0}, "K_y (PKY1, PKY2, PKY4) of the front tyres must be positive"),
        ({"pkx1_rear": -20.0}, "K_x (PKX1) of the rear tyres must be positive"),
        ({"pky2_front": 0.0}, "pky2_front must not be 0"),
        ({"fnomin_front": 0.0}, "fnomin_front must be at least 1"),
    ],
)
def test_a_set_that_cannot_be_is_refused(wrong, says):
    stand = Stand(MagicFormula62, **wrong)
    with pytest.raises(AssertionError, match=says.replace("(", r"\(").replace(")", r"\)")):
        stand.start()


def test_front_and_rear_have_sets_of_their_own():
    stand = tyre(lky_front=0.5)
    state = {"alpha": 0.01}
    assert abs(at(stand, "fl", **state)[1]) < 0.7 * abs(at(stand, "rl", **state)[1])

"""The Magic Formula tyre of MF-Tyre 6.2, 6.1 and 5.2, against a second implementation of the equations."""

from __future__ import annotations

from math import atan, pi, sin

import numpy as np
import pytest

from tests.evidence import measured
from yawbench.components.fmi.variables import parameter_variables
from yawbench.components.plants.seven_dof import SevenDof
from yawbench.components.tyre_models.pacejka_2012_set import COMMON, LONGITUDINAL, REST, Pacejka2012Parameters
from yawbench.components.tyres.magic_formula_62 import MagicFormula62
from yawbench.vocabulary.wheels import wheels

from . import magic_62
from .loop import Loop
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
@pytest.mark.parametrize("seed", range(25))
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


def test_similarity_keeps_both_forces_together_within_what_friction_leaves_of_the_dry_tyres():
    alphas, kappas = np.linspace(0.0, 0.5, 26), np.linspace(-0.6, 0.0, 31)

    def most(mu, **more):
        stand = tyre(BOOK, **more)
        forces = [at(stand, kappa=k, alpha=a, mu=mu)[:2] for a in alphas for k in kappas]
        return max(np.hypot(*force) for force in forces)

    dry = most(1.0)
    for mu in (0.1, 0.3, 0.6):
        assert most(mu, file_low_friction="similarity") <= 1.001 * mu * dry
    assert most(0.1, file_low_friction="scale") > 1.1 * 0.1 * dry


def test_on_the_road_of_the_set_both_readings_of_low_friction_agree_to_the_bit():
    rng = np.random.default_rng(5)
    given = some_set(rng, 62.0)
    one, other = (tyre(given, file_low_friction=how) for how in ("scale", "similarity"))
    for state in each(some_states(rng)):
        assert at(one, **state) == at(other, **state)


@pytest.mark.exhaustive
def test_every_coefficient_counts():
    """None of a file's numbers is read and then forgotten."""
    rng = np.random.default_rng(3)
    states = each(some_states(rng, 12))
    names = set()
    for kind in KINDS:
        given = some_set(rng, kind) | {"fzmax": 9000.0, "inflpres": 2.4e5, "nompres": 2.2e5}
        before = [at(tyre(given), **s) for s in states]
        left_out = FOR_52 if kind == 6.0 else FOR_62
        for key in ROWS.keys() - left_out - {"fittyp", "tyreside"}:
            after = [at(tyre(given | {key: given[key] * 1.02}), **s) for s in states]
            assert after != before, (kind, key)
            names.add(key)
    assert names == ROWS.keys() - {"fittyp", "tyreside"}


@pytest.mark.parametrize("kind", KINDS)
def test_slopes_at_zero_are_the_stiffnesses(kind):
    rng = np.random.default_rng(int(kind))
    given = some_set(rng, kind) | {"inflpres": 2.2e5, "nompres": 2.2e5, "ppx1": 0.0, "ppx2": 0.0}
    shifts = ("phx1", "phx2", "pvx1", "pvx2", "phy1", "phy2", "pvy1", "pvy2", "rhx1", "rby3", "rvy1", "rvy2")
    given |= dict.fromkeys(shifts, 0.0)
    stand, load = tyre(given), 3700.0
    df = load / (given["fnomin"] * given["lfzo"]) - 1.0
    k_x = load * (given["pkx1"] + given["pkx2"] * df) * np.exp(given["pkx3"] * df) * given["lkx"]
    over = (1.0 + df) / given["pky2"]
    k_y = given["pky1"] * given["fnomin"] * given["lfzo"] * sin(given["pky4"] * atan(over)) * given["lky"]
    assert at(stand, f_z=load)[4] == pytest.approx(k_x, rel=1e-6)
    h = 1e-7
    f_x = [at(stand, kappa=k, f_z=load)[0] for k in (-h, h)]
    f_y = [at(stand, alpha=a, f_z=load)[1] for a in (-h, h)]
    assert (f_x[1] - f_x[0]) / (2 * h) == pytest.approx(k_x, rel=1e-6)
    assert (f_y[1] - f_y[0]) / (2 * h) == pytest.approx(k_y, rel=1e-6)
    assert k_y < 0.0 < k_x


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


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.sampled(1)
def test_a_car_on_tyres_of_either_side_runs_straight(side):
    units = [(SevenDof, {}), (MagicFormula62, {"tyreside_front": side, "tyreside_rear": side})]
    loop = Loop(units, algorithm="extrapolated", constants=dict.fromkeys(wheels("friction_*"), 1.0))
    loop.run(5.0, 2500, lambda _: None)
    assert abs(loop["position_y"]) < 1e-9
    assert loop["position_x"] > 100.0
    assert abs(loop["tyre_force_y_fl"]) > 10.0  # what conicity and plysteer give, against each other


def test_the_default_set_gives_the_peaks_and_stiffnesses_tabled_for_it():
    """Table of a second implementation at zero camber, of the set's own offsets."""
    expected = {
        2000.0: (2457.0, 38204.0, -26609.0),
        4000.0: (4840.0, 86040.0, -46009.0),
        6000.0: (7149.0, 145326.0, -56303.0),
    }
    given = in_file_names(BOOK)
    stand = tyre()
    for load, (peak, k_x, k_y) in expected.items():
        kappas = np.linspace(0.0, 0.4, 4001)
        assert max(at(stand, kappa=k, f_z=load)[0] for k in kappas[::10]) == pytest.approx(peak, rel=2e-4)
        k = magic_62.values_of(given)
        assert magic_62.longitudinal(k, 0.0, 0.0, 0.0, load, 1.0)[1] == pytest.approx(k_x, rel=1e-4)
        assert magic_62.lateral(k, 0.0, 0.0, load, 1.0)[2] == pytest.approx(k_y, rel=1e-4)


def test_the_books_tangents_are_a_switch():
    by_angle, by_tangent = tyre(), tyre(slip_angle_as_tangent=True)
    assert at(by_angle, alpha=1e-4) == pytest.approx(at(by_tangent, alpha=1e-4), rel=1e-4, abs=1e-3)
    a, b = at(by_angle, alpha=0.13)[1], at(by_tangent, alpha=0.13)[1]
    assert 1.0 < abs(a - b) < 0.012 * 4000.0
    assert b == pytest.approx(at(by_angle, alpha=float(np.tan(0.13)))[1], rel=1e-12)


def test_more_pressure_changes_what_the_coefficients_of_pressure_say():
    low, high = (
        tyre(BOOK | {"ppy1": -0.5, "ppx3": -0.1, "inflpres": pressure}) for pressure in (2.2e5, 2.42e5)
    )
    h = 1e-6
    slopes = [(at(t, alpha=h)[1] - at(t, alpha=-h)[1]) / (2 * h) for t in (low, high)]
    assert slopes[1] / slopes[0] == pytest.approx(0.95, rel=1e-3)


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
    names = {v.name for v in parameter_variables(Pacejka2012Parameters)}
    assert {"pcx1_front", "pcx1_rear", "qsx14_rear"} <= names
    assert all(name == name.lower() for name in names)

"""Mamdani inference: agrees with scikit-fuzzy and with closed forms."""

from __future__ import annotations

import doctest
import math
import random

import numpy as np
import pytest

from tests.refusals import refused
from yawbench.components.mathematics import fuzzy
from yawbench.components.mathematics.fuzzy import (
    SEVEN,
    Mamdani,
    Partition,
    clipped_pair,
    gaussian_grades,
)

STANDARD_7X7 = """
    NB NB NB NB NM NS ZO
    NB NB NB NM NS ZO PS
    NB NB NM NS ZO PS PM
    NB NM NS ZO PS PM PB
    NM NS ZO PS PM PB PB
    NS ZO PS PM PB PB PB
    ZO PS PM PB PB PB PB
"""
SHARED_5X5 = """
    SS SS S  S  M
    S  S  M  M  M
    S  M  M  B  B
    S  M  B  B  BB
    M  M  B  BB BB
"""  # paper B: one table for two outputs


def standard_seven() -> Mamdani:
    sets = Partition.even(SEVEN)
    return Mamdani(sets, sets, [sets], STANDARD_7X7)


def paper_b() -> Mamdani:
    labels = "SS S M B BB"
    outputs = [Partition.even(labels, 0.0, 3.0), Partition.even(labels, 0.0, 10.0)]
    return Mamdani(Partition.even(labels, 0.0, 1.0), Partition.even(labels, 0.0, 0.09), outputs, SHARED_5X5)


def uneven() -> Mamdani:
    outputs = [Partition("low middle high", [0.0, 1.0, 5.0]), Partition("small big", [-1.0, 2.0])]
    return Mamdani(
        Partition("N Z P", [-1.0, 0.2, 1.0]),
        Partition("N Z P", [-2.0, -1.0, 3.0]),
        outputs,
        "low/big low/small high/big \n low/big middle/small high/big \n middle/small high/small high/big",
    )


SYSTEMS = [standard_seven, paper_b, uneven]


def scikit_fuzzy_surfaces(system: Mamdani, points: list[tuple[float, float]]) -> np.ndarray:
    """Evaluate the rules of `system` with scikit-fuzzy: shape (points, outputs)."""
    from skfuzzy import control, trimf  # not at the top: it takes long, and one worker needs it

    def variable(kind, name, sets):
        universe = np.linspace(sets.peaks[0], sets.peaks[-1], 241)
        made = kind(np.union1d(universe, sets.peaks), name)
        padded = [sets.peaks[0], *sets.peaks, sets.peaks[-1]]
        for k, label in enumerate(sets.labels):
            made[label] = trimf(made.universe, padded[k : k + 3])
        return made

    x = variable(control.Antecedent, "x", system.rows)
    y = variable(control.Antecedent, "y", system.columns)
    outputs = [variable(control.Consequent, f"u{i}", sets) for i, sets in enumerate(system.outputs)]
    rules = [
        control.Rule(
            x[row] & y[column],
            [u[sets.labels[k]] for u, sets, k in zip(outputs, system.outputs, cell, strict=True)],
        )
        for row, line in zip(system.rows.labels, system.rules, strict=True)
        for column, cell in zip(system.columns.labels, line, strict=True)
    ]
    simulation = control.ControlSystemSimulation(control.ControlSystem(rules))
    for name, sets, values in zip(
        "xy", (system.rows, system.columns), zip(*points, strict=True), strict=True
    ):
        simulation.input[name] = np.clip(values, sets.peaks[0], sets.peaks[-1])
    simulation.compute()
    return np.array([simulation.output[o.label] for o in outputs]).T


def sample(system: Mamdani, n: int, *, beyond: float = 0.0, seed: int = 1) -> list[tuple[float, float]]:
    """Random points of the input ranges, widened by the fraction `beyond`."""
    generator = random.Random(seed)

    def pick(sets):
        low, high = sets.peaks[0], sets.peaks[-1]
        margin = beyond * (high - low)
        return generator.uniform(low - margin, high + margin)

    return [(pick(system.rows), pick(system.columns)) for _ in range(n)]


@pytest.mark.filterwarnings("ignore:Passing more than 2 positional:DeprecationWarning")  # in scikit-fuzzy
@pytest.mark.parametrize(
    "make",
    [*(pytest.param(large, marks=pytest.mark.exhaustive) for large in (standard_seven, paper_b)), uneven],
)
def test_surface_agrees_with_scikit_fuzzy(make):
    system = make()
    peaks = [(x, y) for x in system.rows.peaks[::2] for y in system.columns.peaks[::2]]
    points = sample(system, 20, beyond=0.1) + peaks
    ours = np.array([system(x, y) for x, y in points])
    theirs = scikit_fuzzy_surfaces(system, points)
    ranges = [sets.peaks[-1] - sets.peaks[0] for sets in system.outputs]
    assert np.max(np.abs(ours - theirs) / ranges) < 1e-3


@pytest.mark.parametrize("a", [0.0, 0.2, 0.5, 0.7, 1.0])
@pytest.mark.parametrize("b", [0.0, 0.1, 0.5, 0.6, 1.0])
def test_area_and_moment_of_two_clipped_sets_agree_with_quadrature(a, b):
    t = (np.arange(200_000) + 0.5) / 200_000
    envelope = np.maximum(np.minimum(a, 1.0 - t), np.minimum(b, t))
    assert clipped_pair(a, b) == pytest.approx(
        (
            envelope.mean(),
            ((t - 0.5) * envelope).mean(),
        ),
        abs=1e-9,
    )


def test_outputs_reach_their_range_up_to_a_third_of_the_outermost_spacing():
    (highest,) = standard_seven()(1.0, 1.0)
    assert highest == pytest.approx(1.0 - 1.0 / 9.0, abs=1e-14)
    eps, k_d = paper_b()(1.0, 0.09)
    assert (eps / 3.0, k_d / 10.0) == pytest.approx((11.0 / 12.0, 11.0 / 12.0), abs=1e-14)


@pytest.mark.parametrize("make", SYSTEMS)
def test_inputs_saturate_at_the_outer_peaks(make):
    system = make()
    left, right = system.rows.peaks[0], system.rows.peaks[-1]
    low, high = system.columns.peaks[0], system.columns.peaks[-1]
    assert system(left - 3.0, high + 9.0) == system(left, high)
    assert system(math.inf, -math.inf) == system(right, low)


def test_gaussian_grades_are_one_at_the_centre_and_1_over_e_one_width_off():
    grades = gaussian_grades(0.3, [0.3, 0.1, 0.6], [0.24, 0.2, 0.3])
    assert grades == pytest.approx([1.0, math.exp(-1.0), math.exp(-1.0)], abs=1e-15)


def test_nan_in_gives_nan_out():
    assert math.isnan(standard_seven()(math.nan, 0.0)[0])
    assert all(math.isnan(u) for u in paper_b()(0.0, math.nan))


def test_the_example_in_the_docstring_is_right():
    assert doctest.testmod(fuzzy).failed == 0


@pytest.mark.parametrize(
    "table, names",
    [
        ("N Z P \n N Z P", ("2 rows", "3 sets")),
        ("N Z P \n N Z \n N Z P", ("2 cells", "3 sets")),
        (
            "N Z P \n N Z PB \n N Z P",
            ("'PB'", "column", "table"),
        ),
        ("N Z P \n N Z P \n N/Z Z P", ("2 labels", "1 outputs")),
    ],
)
def test_a_wrong_table_is_refused_by_the_name_of_its_cell(table, names):
    sets = Partition.even("N Z P")
    with refused(ValueError, names=names):
        Mamdani(sets, sets, [sets], table)


@pytest.mark.parametrize(
    "labels, peaks, names",
    [
        ("N Z P", [0.0, 1.0], ("2 peaks", "3 sets", "'N Z P'")),
        ("N Z N", [0.0, 1.0, 2.0], ("'N Z N'", "set", "twice")),
        ("N Z P", [0.0, 1.0, 1.0], ("'N Z P'", "peaks", "strictly")),
        ("N P", [0.0, math.nan], ("'N P'", "peaks", "strictly")),
    ],
)
def test_impossible_sets_are_refused(labels, peaks, names):
    with refused(ValueError, names=names):
        Partition(labels, peaks)

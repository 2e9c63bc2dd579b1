"""Means over repeats and how sure they are."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from yawbench.studies.confidence import (
    crossed_interval,
    crossed_probability,
    interval,
    jackknife,
    share_bounds,
)
from yawbench.studies.pair_comparisons import holm, shared_places, sign_test, told_apart


def test_the_interval_is_that_of_students_t_test():
    numbers = [3.1, 2.9, 3.4, 3.3, 2.7, 3.0, 3.2, 2.8, 3.1, 3.6]
    found = interval(numbers)
    theirs = stats.ttest_1samp(numbers, 0.0).confidence_interval(0.95)
    assert (found.mean - found.half, found.mean + found.half) == pytest.approx(tuple(theirs))
    assert found.mean == pytest.approx(np.mean(numbers))


def test_numbers_without_chance_in_them_have_no_interval():
    assert interval([0.1] * 10) == interval([0.1])
    assert interval([0.1]).half == 0.0
    assert interval([]) is interval([1.0, math.nan]) is interval([math.inf, -math.inf]) is None
    assert interval([1.0, math.inf]).mean == math.inf


@pytest.mark.parametrize("count, number", [(0, 20), (1, 46), (10, 10), (7, 30)])
def test_bounds_of_a_share_are_those_of_the_exact_binomial_test(count, number):
    theirs = stats.binomtest(count, number).proportion_ci(0.95, method="exact")
    assert share_bounds(count, number) == pytest.approx(tuple(theirs))


@pytest.mark.parametrize("count, number", [(-1, 5), (6, 5), (0, 0)])
def test_a_count_beyond_its_number_is_refused(count, number):
    with pytest.raises(ValueError, match="between 0 and its number"):
        share_bounds(count, number)


@pytest.mark.parametrize(
    ("tests", "cars", "spread"),
    [
        (13, 6, (1.0, 0.3, 1.0)),
        (4, 3, (1.0, 1.0, 1.0)),
        (4, 3, (0.0, 0.0, 1.0)),
        (1, 5, (0.0, 0.0, 1.0)),
        (1, 5, (1.0, 1.0, 1.0)),
    ],
)
def test_intervals_over_two_factors_hold_the_true_mean_as_often_as_they_say(tests, cars, spread):
    chance, held, number = np.random.default_rng(2), 0, 1000
    for _ in range(number):
        shapes = ((tests, 1), (1, cars), (tests, cars))
        table = sum(size * chance.normal(size=shape) for size, shape in zip(spread, shapes, strict=True))
        mean, half = crossed_interval(table)
        held += abs(mean) <= half
    if tests > 1 or spread[0] == 0.0:
        assert held / number >= 0.93  # three standard errors below 0.95
    else:
        assert held / number < 0.93, "one test says nothing about others"


def test_one_factor_alone_gives_the_test_of_student():
    numbers = np.random.default_rng(3).normal(0.5, 1.0, 9)
    assert crossed_probability(numbers[np.newaxis]) == pytest.approx(stats.ttest_1samp(numbers, 0.0).pvalue)
    assert crossed_interval(numbers[:, np.newaxis]) == pytest.approx(interval(list(numbers)))
    assert crossed_probability(np.zeros((3, 3))) == 1.0
    assert crossed_probability(np.array([[0.3]])) == 1.0
    assert crossed_interval(np.array([[0.3]])).half == math.inf


def test_cells_that_are_not_known_are_left_out():
    whole = np.add.outer([0.0, 1.0, 2.0], [0.0, 0.1, 0.2])
    assert crossed_interval(np.where(whole == 1.2, np.nan, whole)).mean == pytest.approx(
        (0.1 + 1.05 + 2.1) / 3
    )


def test_outcomes_in_pairs_are_judged_by_the_exact_binomial_test():
    first = np.array([True] * 9 + [False] * 6)
    second = np.array([True] * 3 + [False] * 10 + [True] * 2)
    assert sign_test(first, second) == pytest.approx(stats.binomtest(2, 8).pvalue)
    assert sign_test(first, first) == 1.0


def test_many_comparisons_are_corrected_as_holm_does():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    chance = np.random.default_rng(4)
    wrong = [min(holm(list(chance.uniform(size=20)))) < 0.05 for _ in range(2000)]
    assert np.mean(wrong) == pytest.approx(0.05, abs=0.015)  # three standard errors


def test_who_is_better_than_the_baseline_is_a_question_of_its_own():
    numbers = [0.0, 1.0, 2.0, 3.0]
    found = told_apart(numbers, lambda i, j: 0.02 if 0 in (i, j) else 0.01, baseline=0)
    assert not found.better.any(axis=0)[0], "0.02 times 3"
    assert found.better.sum() == 3, "0.01 times 3"
    assert found.alone.sum() == 6
    assert shared_places(found.of([3, 2, 1, 0]).alone) == [1, 2, 3, 4]


def test_the_jackknife_of_a_mean_is_the_interval_of_student():
    numbers = np.array([3.1, 2.9, 3.4, 3.3, 2.7])
    value, half = jackknife(lambda some: numbers[some].mean(keepdims=True), 5)
    assert (value[0], half[0]) == pytest.approx(interval(list(numbers)))

"""Means over repeats and how sure they are."""

from __future__ import annotations

import math

import numpy as np
import pytest

from yawbench.studies.confidence import bootstrap, interval, percentile_bounds, resample, share_bounds


def test_the_interval_is_that_of_students_t_test():
    from scipy import stats  # not at the top: it takes long, and few tests need it

    numbers = [3.1, 2.9, 3.4, 3.3, 2.7, 3.0, 3.2, 2.8, 3.1, 3.6]
    found = interval(numbers)
    theirs = stats.ttest_1samp(numbers, 0.0).confidence_interval(0.95)
    assert (found.mean - found.half, found.mean + found.half) == pytest.approx(tuple(theirs))
    assert found.mean == pytest.approx(np.mean(numbers))


def test_nineteen_in_twenty_intervals_hold_the_true_mean():
    draws = np.random.Generator(np.random.PCG64(1)).normal(5.0, 2.0, (2000, 10))
    held = [abs(found.mean - 5.0) <= found.half for found in map(interval, draws.tolist())]
    assert np.mean(held) == pytest.approx(0.95, abs=0.015)


def test_numbers_without_chance_in_them_have_no_interval():
    assert interval([0.1] * 10) == interval([0.1])
    assert interval([0.1]).half == 0.0
    assert interval([]) is None
    assert interval([1.0, math.nan]) is None
    assert interval([1.0, math.inf]).mean == math.inf
    assert interval([math.inf, -math.inf]) is None


@pytest.mark.parametrize("count, number", [(0, 20), (1, 46), (10, 10), (7, 30)])
def test_bounds_of_a_share_are_those_of_the_exact_binomial_test(count, number):
    from scipy import stats  # not at the top: it takes long, and few tests need it

    theirs = stats.binomtest(count, number).proportion_ci(0.95, method="exact")
    assert share_bounds(count, number) == pytest.approx(tuple(theirs))


def test_bounds_of_a_share_hold_it_at_least_as_often_as_they_say():
    chance = np.random.default_rng(1)
    for share in (0.03, 0.1, 0.5):
        counts = chance.binomial(30, share, 2000)
        known = {count: share_bounds(int(count), 30) for count in set(counts)}
        held = [known[count].low <= share <= known[count].high for count in counts]
        assert np.mean(held) >= 0.95 - 0.01


def test_29_of_29_and_45_of_46_say_that_fewer_than_a_tenth_fail():
    """One-sided at 95 %: the bound of an interval of 90 %."""
    assert share_bounds(0, 29, confidence=0.9).high < 0.1 < share_bounds(0, 28, confidence=0.9).high
    assert share_bounds(1, 46, confidence=0.9).high < 0.1 < share_bounds(1, 45, confidence=0.9).high


@pytest.mark.parametrize("count, number", [(-1, 5), (6, 5), (0, 0)])
def test_a_count_beyond_its_number_is_refused(count, number):
    with pytest.raises(ValueError, match="between 0 and its number"):
        share_bounds(count, number)


def test_the_bootstrap_of_a_mean_is_as_wide_as_its_standard_error():
    numbers = np.random.default_rng(1).normal(3.0, 2.0, 50)
    low, high = percentile_bounds(bootstrap(lambda drawn: numbers[drawn].mean(axis=1), [50]))
    assert low < numbers.mean() < high
    assert high - low == pytest.approx(2 * 1.96 * numbers.std() / math.sqrt(50), rel=0.1)


def test_bootstrapped_blocks_hold_the_true_mean_of_data_with_two_factors():
    """Numbers that share a row or a column are alike; as single numbers they would seem far too sure."""
    chance = np.random.default_rng(2)
    blocks = alone = 0
    for _ in range(200):
        rows, columns = chance.normal(size=(8, 1)), chance.normal(size=(1, 12))
        table = rows + columns + chance.normal(size=(8, 12))

        def mean(*drawn, table=table):
            return resample(table, *drawn).mean(axis=(1, 2))

        low, high = percentile_bounds(bootstrap(mean, [8, 12], draws=300))
        blocks += low <= 0.0 <= high
        low, high = percentile_bounds(
            bootstrap(lambda i, t=table: t.ravel()[i].mean(axis=1), [96], draws=300)
        )
        alone += low <= 0.0 <= high
    assert blocks / 200 >= 0.9
    assert alone / 200 < 0.7


def test_the_same_data_give_the_same_bounds():
    numbers = np.arange(10.0)
    found = [percentile_bounds(bootstrap(lambda drawn: numbers[drawn].mean(axis=1), [10])) for _ in range(2)]
    assert (found[0] == found[1]).all()

"""Means over repeats and how sure they are."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from orchestrator.experiments.confidence import interval


def test_the_interval_is_that_of_students_t_test():
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

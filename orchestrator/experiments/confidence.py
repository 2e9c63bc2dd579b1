"""Confidence intervals of means over repeats with different seeds.

    mean ± t s / √n         s: standard deviation of the sample, n: repeats,
                            t: quantile of Student's distribution with n - 1 degrees of freedom

Repeats that differ only in their seed are independent. That their numbers are normally distributed is an
assumption, harmless to a mean of ten unless there are outliers; with outliers the mean says little, and its
interval is wide.

Source: Student (W. S. Gosset), The probable error of a mean, Biometrika 6 (1908) 1-25.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

LEVEL = 0.95
"""Confidence level: share of intervals that contain the true mean; chosen: the usual one."""


class ConfidenceInterval(NamedTuple):
    """A mean over repeats and the half width of its confidence interval, in the unit of the numbers."""

    mean: float
    half: float


def interval(numbers: Sequence[float], level: float = LEVEL) -> ConfidenceInterval | None:
    """Return the mean over repeats with its confidence interval; None without numbers, or if one is NaN.

    The interval has no width for a single number, for equal numbers, and where the mean is infinite.
    """
    if not numbers or any(map(math.isnan, numbers)):
        return None
    n = len(numbers)
    if n == 1 or min(numbers) == max(numbers):
        return ConfidenceInterval(float(numbers[0]), 0.0)
    mean = math.fsum(numbers) / n if all(map(math.isfinite, numbers)) else sum(numbers)
    if not math.isfinite(mean):
        return None if math.isnan(mean) else ConfidenceInterval(mean, 0.0)
    spread = math.sqrt(math.fsum((x - mean) ** 2 for x in numbers) / (n - 1))
    return ConfidenceInterval(mean, _quantile(n - 1, level) * spread / math.sqrt(n))


@cache
def _quantile(degrees: int, level: float) -> float:
    """Return the quantile of Student's distribution that leaves (1 - level) / 2 in each tail."""
    from scipy.special import stdtrit  # what scipy.stats.t uses, without its slow import

    return float(stdtrit(degrees, 0.5 + level / 2))

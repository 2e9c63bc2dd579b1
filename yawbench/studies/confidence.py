"""Confidence intervals of means, shares and other statistics of samples.

Means over repeats with different seeds (`interval`):

    mean ± t s / √n         s: standard deviation of the sample, n: repeats,
                            t: quantile of Student's distribution with n - 1 degrees of freedom

Repeats that differ only in their seed are independent. That their numbers are normally distributed is an
assumption, harmless to a mean of ten unless there are outliers; with outliers the mean says little, and its
interval is wide.

Shares, k of n (`share_bounds`): the shares p at which k or more, and k or fewer, of n have the probability
(1 - confidence) / 2, quantiles of the beta distribution. They contain the true share at least as often as
stated.

Means over two factors that are samples both, such as tests and cars (`crossed_interval`): numbers that
share a test or a car are not independent, so the mean is as sure as its means over each factor:

    variance of the mean = s_1² / n_1 + s_2² / n_2      s_k: standard deviation of the means at the n_k levels
                                                        of factor k
    degrees of freedom   = variance² / sum of (s_k² / n_k)² / (n_k - 1)

This counts the scatter that belongs to neither factor twice, and so covers at least as often as stated where
that scatter is all there is: 94 to 99 % of intervals of 95 % hold the mean with 13 tests and 6 cars, and with
4 and 3, of normally distributed numbers; 92 to 95 % of exponentially distributed ones (a simulation, which
the tests repeat). Percentiles of a bootstrap hold it in 82 to 90 % with 4 tests and 3 cars.

A statistic of a sample that is no mean, such as a standard deviation (`jackknife`): from its values without
each member.

Sources: Student (W. S. Gosset), The probable error of a mean, Biometrika 6 (1908) 1-25. C. J. Clopper, E. S.
Pearson, The use of confidence or fiducial limits illustrated in the case of the binomial, Biometrika 26
(1934) 404-413. F. E. Satterthwaite, An approximate distribution of estimates of variance components,
Biometrics Bulletin 2 (1946) 110-114. H. H. Clark, The language-as-fixed-effect fallacy, Journal of Verbal
Learning and Verbal Behavior 12 (1973) 335-359, whose min F' is the same test. J.
W. Tukey, Bias and confidence in not quite large samples, Annals of Mathematical Statistics 29 (1958) 614.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

CONFIDENCE = 0.95
"""Share of intervals that contain the true mean; chosen: the usual one."""
TAIL = 0.5 * (1.0 - CONFIDENCE)
"""Probability of each side of an interval, and of a wrong decision on one side."""


class ConfidenceInterval(NamedTuple):
    """A mean over repeats and the half width of its confidence interval, in the unit of the numbers."""

    mean: float
    half: float


class Bounds(NamedTuple):
    """Lower and upper bound of a confidence interval, in the unit of the estimate."""

    low: float
    high: float


def interval(numbers: Sequence[float]) -> ConfidenceInterval | None:
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
    return ConfidenceInterval(mean, _quantile(n - 1) * spread / math.sqrt(n))


@cache
def _quantile(degrees: float) -> float:
    """Return the quantile of Student's distribution that leaves (1 - CONFIDENCE) / 2 in each tail."""
    from scipy.special import stdtrit  # what scipy.stats.t uses, without its slow import

    return float(stdtrit(degrees, 0.5 + CONFIDENCE / 2))


def share_bounds(count: int, number: int) -> Bounds:
    """Return the Clopper-Pearson interval of a share, count of number.

    Raises:
        ValueError: the count is not between 0 and the number, or the number is 0.

    >>> share_bounds(10, 10).low  # 10 of 10
    0.6915...
    """
    from scipy.special import betaincinv

    if not 0 <= count <= number or not number:
        raise ValueError(f"a share needs a count between 0 and its number (got {count} of {number})")
    low = float(betaincinv(count, number - count + 1, TAIL)) if count else 0.0
    high = float(betaincinv(count + 1, number - count, 1.0 - TAIL)) if count < number else 1.0
    return Bounds(low, high)


def crossed_interval(table: np.ndarray) -> ConfidenceInterval:
    """Return the mean over two crossed factors, both samples, with its interval.

    Args:
        table: numbers by the levels of the factors, shape (n_1, n_2); NaN: not known. Levels of the first
            factor count alike. A factor with a single level is none.

    The half width is infinite for a single number.
    """
    mean, variance, degrees = _crossed(table)
    return ConfidenceInterval(mean, _quantile(degrees) * math.sqrt(variance) if degrees else math.inf)


def crossed_probability(table: np.ndarray) -> float:
    """Return the probability of a mean over two crossed factors as far from 0, if the true one is 0."""
    from scipy.special import stdtr

    mean, variance, degrees = _crossed(table)
    if not degrees or (variance == 0.0 and mean == 0.0):
        return 1.0
    return 2.0 * float(stdtr(degrees, -abs(mean) / math.sqrt(variance))) if variance else 0.0


def _crossed(table: np.ndarray) -> tuple[float, float, float]:
    """Return mean, its variance and degrees of freedom, 0 for a single number."""
    rows = np.nanmean(table, axis=1)
    mean = float(np.mean(rows))
    columns = mean + np.nanmean(table - rows[:, np.newaxis], axis=0)
    parts = [(float(np.var(x, ddof=1)) / len(x), len(x) - 1) for x in (rows, columns) if len(x) > 1]
    variance = sum(part for part, _ in parts)
    if not variance:
        return mean, 0.0, float(max((number for _, number in parts), default=0))
    return mean, variance, variance**2 / sum(part**2 / number for part, number in parts)


def jackknife(statistic: Callable[[np.ndarray], np.ndarray], number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return statistics of a sample and the half widths of their intervals.

    Args:
        statistic: called with indices of members of the sample.
        number: of members.

    For standard deviations of 8 to 10 members 80 to 97 % of the intervals of 95 % hold the truth, for
    differences of two 91 to 96 % (a simulation with normal, exponential and mixed members). For the logarithm
    of a ratio of sums over ten pairs 92 to 95 %, percentiles of a bootstrap 88 to 90 % (lognormal members
    with a spread of 0.3 to 1 and correlations of 0.5 to 0.95).
    """
    everybody = np.arange(number)
    without = np.array([statistic(np.delete(everybody, k)) for k in everybody])
    spread = np.sqrt((number - 1) / number * np.sum((without - without.mean(axis=0)) ** 2, axis=0))
    return statistic(everybody), _quantile(number - 1) * spread

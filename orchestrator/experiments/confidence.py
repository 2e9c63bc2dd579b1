"""Confidence intervals: of means over repeats, of shares, and of any statistic by the bootstrap.

Means over repeats with different seeds (`interval`):

    mean ± t s / √n         s: standard deviation of the sample, n: repeats,
                            t: quantile of Student's distribution with n - 1 degrees of freedom

Repeats that differ only in their seed are independent. That their numbers are normally distributed is an
assumption, harmless to a mean of ten unless there are outliers; with outliers the mean says little, and its
interval is wide.

Shares, k of n (`share_bounds`): the shares p at which k or more, and k or fewer, of n have the probability
(1 - level) / 2, quantiles of the beta distribution. They contain the true share at least as often as stated.

Other statistics (`bootstrap`): the statistic of resamples drawn with replacement. Data with several factors,
such as cars and tests, are resampled in blocks: levels of each factor are drawn, whole rows and columns
together, as numbers that share a car or a test are not independent. This tends to wide intervals.

Sources: Student (W. S. Gosset), The probable error of a mean, Biometrika 6 (1908) 1-25. C. J. Clopper,
E. S. Pearson, The use of confidence or fiducial limits illustrated in the case of the binomial, Biometrika
26 (1934) 404-413. B. Efron, Bootstrap methods: another look at the jackknife, Annals of Statistics 7 (1979)
1-26. A. B. Owen, The pigeonhole bootstrap, Annals of Applied Statistics 1 (2007) 386-411.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    import numpy as np

LEVEL = 0.95
"""Confidence level: share of intervals that contain the true mean; chosen: the usual one."""
DRAWS = 2000
"""Resamples of a bootstrap. Chosen: bounds of 95 % then repeat within a few per cent of their distance."""


class ConfidenceInterval(NamedTuple):
    """A mean over repeats and the half width of its confidence interval, in the unit of the numbers."""

    mean: float
    half: float


class Bounds(NamedTuple):
    """Lower and upper bound of a confidence interval, in the unit of the estimate."""

    low: float
    high: float


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


def share_bounds(count: int, number: int, level: float = LEVEL) -> Bounds:
    """Return the Clopper-Pearson interval of a share, count of number.

    Each bound by itself is one-sided at (1 + level) / 2: for 95 % one-sided, take a level of 90 %.

    Raises:
        ValueError: the count is not between 0 and the number, or the number is 0.

    >>> share_bounds(10, 10).low  # 10 of 10
    0.6915...
    """
    from scipy.special import betaincinv

    if not 0 <= count <= number or not number:
        raise ValueError(f"a share needs a count between 0 and its number (got {count} of {number})")
    tail = 0.5 * (1.0 - level)
    low = float(betaincinv(count, number - count + 1, tail)) if count else 0.0
    high = float(betaincinv(count + 1, number - count, 1.0 - tail)) if count < number else 1.0
    return Bounds(low, high)


def bootstrap(
    statistic: Callable[..., Any], sizes: Sequence[int], *, draws: int = DRAWS, seed: int = 1
) -> np.ndarray:
    """Return a statistic of resamples, an array of `draws` rows.

    Args:
        statistic: called with an array of indices for each factor, drawn with replacement.
        sizes: the number of levels of each factor; a single one for independent numbers.
        draws: resamples.
        seed: of the random numbers, so that the same data give the same intervals.
    """
    import numpy as np

    chance = np.random.default_rng(seed)
    return np.array([statistic(*(chance.integers(n, size=n) for n in sizes)) for _ in range(draws)])


def percentile_bounds(samples: np.ndarray, level: float = LEVEL) -> np.ndarray:
    """Return the quantiles that leave (1 - level) / 2 of resamples in each tail: two rows, low and high."""
    import numpy as np

    bounds: np.ndarray = np.quantile(samples, [0.5 - 0.5 * level, 0.5 + 0.5 * level], axis=0)
    return bounds

"""Confidence intervals of means over repeats, of shares and of any statistic; sequential tests of shares.

Means over repeats with different seeds (`interval`):

    mean ± t s / √n         s: standard deviation of the sample, n: repeats,
                            t: quantile of Student's distribution with n - 1 degrees of freedom

Repeats that differ only in their seed are independent. That their numbers are normally distributed is an
assumption, harmless to a mean of ten unless there are outliers; with outliers the mean says little, and its
interval is wide.

Shares, k of n (`share_bounds`): the shares p at which k or more, and k or fewer, of n have the probability
(1 - confidence) / 2, quantiles of the beta distribution. They contain the true share at least as often as
stated.

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
from dataclasses import dataclass
from enum import Enum
from functools import cache, cached_property, lru_cache
from itertools import accumulate
from typing import NamedTuple

import numpy as np

CONFIDENCE = 0.95
"""Share of intervals that contain the true mean; chosen: the usual one."""
TAIL = 0.5 * (1.0 - CONFIDENCE)
"""Probability of each side of an interval, and of a wrong decision on one side."""
DRAWS = 2000
"""Resamples of a bootstrap. Chosen: bounds of 95 % then repeat within a few per cent of their distance."""

BATCH = 100
"""Resamples at a time. Chosen: few calls, and no more than some megabytes."""


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
def _quantile(degrees: int) -> float:
    """Return the quantile of Student's distribution that leaves (1 - CONFIDENCE) / 2 in each tail."""
    from scipy.special import stdtrit  # what scipy.stats.t uses, without its slow import

    return float(stdtrit(degrees, 0.5 + CONFIDENCE / 2))


def share_bounds(count: int, number: int, confidence: float = CONFIDENCE) -> Bounds:
    """Return the Clopper-Pearson interval of a share, count of number.

    Each bound by itself is one-sided at (1 + confidence) / 2: for 95 % one-sided, take a confidence of 90 %.

    Raises:
        ValueError: the count is not between 0 and the number, or the number is 0.

    >>> share_bounds(10, 10).low  # 10 of 10
    0.6915...
    """
    from scipy.special import betaincinv

    if not 0 <= count <= number or not number:
        raise ValueError(f"a share needs a count between 0 and its number (got {count} of {number})")
    tail = 0.5 * (1.0 - confidence)
    low = float(betaincinv(count, number - count + 1, tail)) if count else 0.0
    high = float(betaincinv(count + 1, number - count, 1.0 - tail)) if count < number else 1.0
    return Bounds(low, high)


def bootstrap(
    statistic: Callable[..., np.ndarray], sizes: Sequence[int], *, draws: int = DRAWS
) -> np.ndarray:
    """Return a statistic of resamples, an array of `draws` rows; the same data give the same resamples.

    Args:
        statistic: called with an array of indices for each factor, drawn with replacement, a row for each
            draw of a batch; it returns a row for each.
        sizes: the number of levels of each factor; a single one for independent numbers.
        draws: resamples.
    """
    drawn = _drawn(tuple(sizes), draws)
    batches = range(0, draws, BATCH)
    return np.concatenate([statistic(*(rows[k : k + BATCH] for rows in drawn)) for k in batches])


@lru_cache(maxsize=8)
def _drawn(sizes: tuple[int, ...], draws: int) -> list[np.ndarray]:
    """Return the indices drawn of each factor, a row for each draw."""
    chance = np.random.default_rng(1)
    rows = [[chance.integers(n, size=n) for n in sizes] for _ in range(draws)]
    drawn = [np.array(factor) for factor in zip(*rows, strict=True)]
    for factor in drawn:
        factor.flags.writeable = False
    return drawn


def resample(table: np.ndarray, *drawn: np.ndarray | None) -> np.ndarray:
    """Return resamples of a table, the first axis a row for each draw.

    Args:
        table: the numbers.
        drawn: for each axis of the table, the indices drawn, a row for each draw; None keeps the axis.
    """
    indices = []
    for axis, rows in enumerate(drawn):
        rows = np.arange(table.shape[axis])[np.newaxis] if rows is None else rows
        indices.append(rows.reshape(len(rows), *(-1 if k == axis else 1 for k in range(table.ndim))))
    resampled: np.ndarray = table[tuple(indices)]
    return resampled


def percentile_bounds(samples: np.ndarray) -> np.ndarray:
    """Return the quantiles that leave (1 - CONFIDENCE) / 2 of resamples in each tail: low and high rows."""
    bounds: np.ndarray = np.quantile(samples, [0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE], axis=0)
    return bounds


def shared_places(lows: Sequence[float], highs: Sequence[float]) -> list[int]:
    """Return places, from the bounds of intervals, the best first: those that overlap may share a place.

    A place is one more than the intervals that lie wholly above, and never better than that before it.
    """
    places = (1 + sum(bool(low > high) for low in lows) for high in highs)
    return list(accumulate(places, max))


def pairs_apart(resampled: np.ndarray) -> tuple[int, int]:
    """Return how many pairs of columns differ with one sign in 95 % of the rows, and of how many."""
    number = resampled.shape[1]
    ends = (percentile_bounds(resampled[:, [k]] - resampled[:, k + 1 :]) for k in range(number - 1))
    return sum(int(np.sum((low > 0.0) | (high < 0.0))) for low, high in ends), math.comb(number, 2)


class Decision(Enum):
    """State of the test of a share."""

    BELOW = "below"
    ABOVE = "above"
    OPEN = "open"


@dataclass(frozen=True)
class SequentialTest:
    """Test of a share while points are added, until it is known to be below or above a limit.

    A count that is looked at repeatedly crosses the bound of a single look more often than that bound
    admits. Here the error of each side, (1 - confidence) / 2, is spent over the looks in proportion to
    their points, and the boundary of each look is computed exactly, by the recursion of the binomial
    distribution over the counts that have crossed no earlier boundary:

        f_0(0) = 1,   f_j(k) = sum_i g_(j-1)(i) B(k - i; n_j - n_(j-1), p),   g_j = f_j between its boundaries

    with p at the limit. The interval of the share has the same error and agrees with the decision. Its
    bounds are the shares at which an outcome as low (as high) as the observed one has the probability (1
    - confidence) / 2, where an outcome is the lower (higher), the earlier it crosses the lower (upper)
    boundary. With a single look this is the Clopper-Pearson interval.

    Sources: K. K. G. Lan, D. L. DeMets, Discrete sequential boundaries for clinical trials, Biometrika 70
    (1983) 659-663. P. Armitage, C. K. McPherson, B. C. Rowe, Repeated significance tests on accumulating
    data, Journal of the Royal Statistical Society A 132 (1969) 235-244. C. Jennison, B. W. Turnbull,
    Group Sequential Methods, Chapman and Hall (2000), chapters 8 and 12.

    Args:
        looks: ascending numbers of points at which the count is compared with the boundaries.
        limit: of the share.
    """

    looks: tuple[int, ...]
    limit: float

    @cached_property
    def boundaries(self) -> tuple[tuple[int, int], ...]:
        """Bounds at each look: the largest count that decides "below", the smallest that decides "above"."""
        alive, before, made = np.ones(1), 0, list[tuple[int, int]]()
        spent_low = spent_high = 0.0
        for look in self.looks:
            alive = _with_more(alive, look - before, self.limit)
            before, spendable = look, TAIL * look / self.looks[-1]
            low = int(np.count_nonzero(spent_low + np.cumsum(alive) <= spendable)) - 1
            high = look + 1 - int(np.count_nonzero(spent_high + np.cumsum(alive[::-1]) <= spendable))
            spent_low += float(alive[: low + 1].sum())
            spent_high += float(alive[high:].sum())
            made.append((low, high))
            alive = _within(alive, low, high)
        return tuple(made)

    def decision(self, count: int, number: int) -> Decision:
        """Return the decision by a count at a number of points; open between looks."""
        if number not in self.looks:
            return Decision.OPEN
        low, high = self.boundaries[self.looks.index(number)]
        return Decision.BELOW if count <= low else Decision.ABOVE if count >= high else Decision.OPEN

    def bounds(self, count: int, number: int) -> Bounds:
        """Return the interval of the share after a count that has crossed no boundary at earlier looks.

        Raises:
            ValueError: the number of points is not that of a look, or the count is not between 0 and it.
        """
        if number not in self.looks or not 0 <= count <= number:
            raise ValueError(f"needs a count at a look, after {self.looks} points (got {count} of {number})")
        return _bounds(self, count, number)

    def _tails(self, share: float, count: int, number: int) -> tuple[float, float]:
        """Return the probabilities of outcomes as low and as high as a count at a look."""
        alive, before, low, high = np.ones(1), 0, 0.0, 0.0
        for look, (few, many) in zip(self.looks, self.boundaries, strict=True):
            alive = _with_more(alive, look - before, share)
            if look == number:
                break
            before = look
            low += float(alive[: few + 1].sum())
            high += float(alive[many:].sum())
            alive = _within(alive, few, many)
        return low + float(alive[: count + 1].sum()), high + float(alive[count:].sum())


@cache
def _bounds(test: SequentialTest, count: int, number: int) -> Bounds:
    from scipy.optimize import brentq

    def bound(side: int) -> float:
        return float(brentq(lambda share: test._tails(share, count, number)[side] - TAIL, 0.0, 1.0))

    return Bounds(bound(1) if count else 0.0, bound(0) if count < number else 1.0)


def _with_more(alive: np.ndarray, points: int, share: float) -> np.ndarray:
    """Return the distribution of counts after more points."""
    from scipy.stats import binom

    return np.convolve(alive, binom.pmf(np.arange(points + 1), points, share))


def _within(alive: np.ndarray, low: int, high: int) -> np.ndarray:
    """Return the distribution of counts that cross no boundary."""
    counts = np.arange(len(alive))
    return np.where((counts > low) & (counts < high), alive, 0.0)

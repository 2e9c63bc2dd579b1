"""Test of a share while points are added, until it is known to be below or above a limit."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cache, cached_property

import numpy as np

from .confidence import TAIL, Bounds


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

"""Comparisons of all pairs of members: which are better, corrected for the number of pairs.

Two series of outcomes, passed or not, under the same conditions (`sign_test`): the conditions that only one
passes are a fair coin if neither is better. Of many comparisons some are clear by chance; `holm` corrects for
that.

Sources: Q. McNemar, Note on the sampling error of the difference between correlated proportions,
Psychometrika 12 (1947) 153-157. S. Holm, A simple sequentially rejective multiple test procedure,
Scandinavian Journal of Statistics 6 (1979) 65-70.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate, combinations

import numpy as np

from .confidence import TAIL


def sign_test(first: np.ndarray, second: np.ndarray) -> float:
    """Return the exact probability of outcomes that differ as much, if neither series is better.

    Args:
        first, second: whether each passes, under the same conditions.
    """
    from scipy.special import bdtr

    wins, losses = int(np.sum(first & ~second)), int(np.sum(second & ~first))
    return min(1.0, 2.0 * float(bdtr(min(wins, losses), wins + losses, 0.5))) if wins + losses else 1.0


def holm(probabilities: Sequence[float]) -> list[float]:
    """Return probabilities corrected for their number: any is below 5 % by chance in 5 % of such lists."""
    order = sorted(range(len(probabilities)), key=probabilities.__getitem__)
    corrected, largest = [1.0] * len(probabilities), 0.0
    for before, k in enumerate(order):
        largest = max(largest, min(1.0, (len(order) - before) * probabilities[k]))
        corrected[k] = largest
    return corrected


@dataclass(frozen=True)
class ToldApart:
    """Pairs of members that their numbers tell apart.

    Attributes:
        better: square array, true at [i, j] if i is clearly better than j, corrected for the number of pairs.
        alone: the same, with every pair as if it were the only one.
    """

    better: np.ndarray
    alone: np.ndarray

    def of(self, order: Sequence[int]) -> ToldApart:
        """Return the same of some members in another order."""
        return ToldApart(self.better[np.ix_(order, order)], self.alone[np.ix_(order, order)])


def told_apart(
    numbers: Sequence[float] | np.ndarray,
    probability: Callable[[int, int], float],
    baseline: int | None = None,
) -> ToldApart:
    """Compare all pairs of members.

    Args:
        numbers: of the members, larger is better.
        probability: of the difference between two members, if neither is better.
        baseline: one with which the others are compared. Whether a member is better than it, and which of two
            others is better, are two questions: each is corrected for the number of its own pairs.
    """
    alone = np.zeros((len(numbers), len(numbers)), dtype=bool)
    better = alone.copy()
    pairs = list(combinations(range(len(numbers)), 2))
    for with_baseline in (True, False):
        asked = [pair for pair in pairs if (baseline in pair) is with_baseline]
        each = [probability(*pair) for pair in asked]
        for found, probabilities in ((alone, each), (better, holm(each))):
            for (i, j), p in zip(asked, probabilities, strict=True):
                if p < 2.0 * TAIL:
                    found[(i, j) if numbers[i] > numbers[j] else (j, i)] = True
    return ToldApart(better, alone)


def shared_places(better: np.ndarray) -> list[int]:
    """Return places, the best first; `better[i, j]`: whether i is clearly better than j.

    A place is one more than the number of those clearly better, and never better than that before it.
    """
    places = (1 + int(number) for number in better.sum(axis=0))
    return list(accumulate(places, max))

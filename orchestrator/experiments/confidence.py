"""Confidence in a mean over repeats: how far chance, such as the noise of a sensor, may have moved it.

The one place that says how sure a mean over several runs is: axes that `repeats` a run, tables, verdicts and
whatever else takes seeds.

    mean ± t s / √n         s: standard deviation of the sample, n: repeats,
                            t: quantile of Student's distribution with n - 1 degrees of freedom

Where repeats are alike in everything but their seed, their numbers are independent; that they are normally
distributed is an assumption, harmless to a mean of ten unless single runs lie far off. Such a mean says
little, and its interval is wide.

Source: Student (W. S. Gosset), The probable error of a mean, Biometrika 6 (1908) 1-25.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

LEVEL = 0.95
"""Share of such intervals that hold the true mean; chosen: what is usual."""


class Interval(NamedTuple):
    """The mean over repeats, and half the width of its confidence interval, in the unit of the numbers."""

    mean: float
    half: float


def interval(numbers: Sequence[float], level: float = LEVEL) -> Interval | None:
    """Return the mean of the numbers of several repeats with its confidence interval.

    Equal numbers, and a single one, have no chance in them that could be seen: their interval has no width.
    Nor have those of which one is infinite, as their mean is then. None for no numbers, or if one is none.
    """
    if not numbers or any(map(math.isnan, numbers)):
        return None
    n = len(numbers)
    if n == 1 or min(numbers) == max(numbers):
        return Interval(float(numbers[0]), 0.0)
    mean = math.fsum(numbers) / n if all(map(math.isfinite, numbers)) else sum(numbers)
    if not math.isfinite(mean):
        return None if math.isnan(mean) else Interval(mean, 0.0)
    spread = math.sqrt(math.fsum((x - mean) ** 2 for x in numbers) / (n - 1))
    return Interval(mean, _quantile(n - 1, level) * spread / math.sqrt(n))


@cache
def _quantile(degrees: int, level: float) -> float:
    """Return the quantile of Student's distribution that leaves out (1 - level) / 2 at each end."""
    from scipy.special import stdtrit  # as scipy.stats.t does, which takes long to import

    return float(stdtrit(degrees, 0.5 + level / 2))

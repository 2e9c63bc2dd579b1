"""Sums of floating-point numbers: the same bits whatever Python adds them.

From CPython 3.12 on, `sum` compensates for rounding, so its last bits are others than before.
"""

from collections.abc import Iterable, Sequence
from operator import mul


def added(values: Iterable[float]) -> float:
    """Return the sum of numbers, from the first to the last, rounded after each."""
    total = 0.0
    for value in values:
        total += value
    return total


def dot(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the sum of the products of two rows of numbers."""
    return added(map(mul, a, b))

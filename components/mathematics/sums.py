"""Sums of floating-point numbers with identical bits in all Python versions.

Since CPython 3.12, `sum` compensates for rounding, which changes its last bits.
"""

from collections.abc import Iterable, Sequence
from operator import mul


def added(values: Iterable[float]) -> float:
    """Return the sum of numbers, from first to last, rounded after each addition."""
    total = 0.0
    for value in values:
        total += value
    return total


def dot(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the dot product of two vectors."""
    return added(map(mul, a, b))

"""Searches for the highest value that passes: in steps, then by halving; several run side by side.

A search is a generator that says which value it tries next. Searches run `side_by_side`, so that a round of
all of them is one experiment (`executor`).
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from typing import TypeVar

T = TypeVar("T")
K = TypeVar("K")
V = TypeVar("V")
Search = Generator[V, bool, T]
"""A search for a limit: yields values, is sent whether each of them passes, and returns its result."""


def highest_passing(
    *, first: float, step: float, resolution: float, least: float, most: float
) -> Search[float, tuple[float | None, float | None]]:
    """Search the highest value that passes, in steps and halves; return it and the lowest failing one above.

    None stands for a value that does not exist within the bounds.

    Args:
        first, step: where the search starts, and its step.
        resolution: largest difference between the two values at the end.
        least, most: bounds of the values.

    >>> search = highest_passing(first=50, step=10, resolution=1, least=10, most=200)
    >>> side_by_side({"x": search}, lambda values: {name: v < 61.3 for name, v in values.items()})
    {'x': (61.25, 61.875)}
    """
    good = bad = None
    value = min(max(first, least), most)
    while good is None or bad is None:
        if (yield value):
            good, nearer = value, min(value + step, most)
        else:
            bad, nearer = value, max(value - step, least)
        if nearer == value:
            return good, bad
        value = nearer
    while bad - good > resolution:
        value = 0.5 * (good + bad)
        if (yield value):
            good = value
        else:
            bad = value
    return good, bad


def side_by_side(
    searches: Mapping[K, Search[V, T]], passing: Callable[[dict[K, V]], Mapping[K, bool]]
) -> dict[K, T]:
    """Run searches in rounds, each a single experiment; return the result of each search.

    Args:
        searches: name -> search.
        passing: maps the value that each search asks for in a round to whether it passes.
    """
    returned: dict[K, T] = {}
    answers: Mapping[K, bool | None] = dict.fromkeys(searches)  # None starts a generator
    while answers:
        values = {}
        for name, answer in answers.items():
            try:
                values[name] = searches[name].send(answer)  # type: ignore[arg-type]
            except StopIteration as end:  # noqa: PERF203 - this is how a generator returns
                returned[name] = end.value
        answers = passing(values) if values else {}
    return returned

"""The points of a design: every combination, a list, or a Latin hypercube."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from ..plan import Value
from .axis_schema import AxisSpec

if TYPE_CHECKING:
    from .schema import ExperimentSpec

RUN = "run"
"""What figures and tables along axes call the axis of named runs."""
Point = tuple["Level", ...]
"""One level per axis, in the order of the axes."""


@dataclass(frozen=True)
class Level:
    """A value of an axis as the file gives it, and what figures and tables call it."""

    value: Value
    words: str


def levels_of(axis: AxisSpec) -> list[Level]:
    """Return the levels of an axis that lists or counts them."""
    if axis.variants:
        return [Level(words, words) for words in axis.variants]
    if axis.values is not None:
        return [Level(value, words) for value, words in axis.values.items()]
    assert axis.start is not None
    assert axis.end is not None
    assert axis.count is not None
    return [_level(number) for number in _spaced(axis.start, axis.end, axis.count, axis.spacing)]


def _spaced(start: float, end: float, count: int, spacing: str) -> list[float]:
    """Return `count` numbers from start to end; 0.1, 0.2, 0.3 where equal steps are that exactly."""
    if spacing == "log":
        inner = [start * (end / start) ** (i / (count - 1)) for i in range(1, count - 1)]
        return [float(start), *inner, float(end)]
    first, last = Fraction(repr(start)), Fraction(repr(end))
    return [float(first + (last - first) * i / (count - 1)) for i in range(count)]


def _level(number: float) -> Level:
    return Level(number, f"{number:.6g}")


def points(spec: ExperimentSpec) -> list[Point]:
    """Return the points of the axes, always in the same order; the last axis of a grid changes first."""
    axes = list(spec.axes.values())
    if spec.design == "latin_hypercube":
        assert spec.points is not None
        assert spec.seed is not None
        return latin_hypercube(axes, spec.points, spec.seed)
    levels = [levels_of(axis) for axis in axes]
    return list(itertools.product(*levels) if spec.design == "grid" else zip(*levels, strict=True))


def latin_hypercube(axes: Sequence[AxisSpec], runs: int, seed: int) -> list[Point]:
    """Return `runs` points of which every axis has one in each of `runs` equal parts of its range.

    An axis of listed values takes each of them equally often, as far as `runs` can be divided.
    Source: McKay, Beckman, Conover, Technometrics 21 (1979) 239-245.
    """
    generator = np.random.Generator(np.random.PCG64(seed))
    columns: list[list[Level]] = []
    for axis in axes:
        places = (generator.permutation(runs) + generator.random(runs)) / runs
        columns.append([level_at(axis, float(place)) for place in places])
    return list(zip(*columns, strict=True))


def level_at(axis: AxisSpec, place: float) -> Level:
    """Return the level at a place between 0 and 1."""
    if axis.variants or axis.values is not None or axis.count is not None:
        levels = levels_of(axis)
        return levels[min(int(place * len(levels)), len(levels) - 1)]
    assert axis.start is not None
    assert axis.end is not None
    if axis.spacing == "log":
        size = math.exp((1 - place) * math.log(abs(axis.start)) + place * math.log(abs(axis.end)))
        return _level(math.copysign(size, axis.start))
    return _level((1 - place) * axis.start + place * axis.end)

"""Samples: distributions of what varies, and where their points lie.

A distribution turns a relative position, 0 to 1, into a value (its quantile function), so that every design
of points in the unit cube is one of values: a Latin hypercube, a Sobol sequence, or random points.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from yawbench.foundation.safe_files import TEXT, read_bytes, reason

SAMPLES = ("latin_hypercube", "sobol", "random", "saltelli")
"""Designs whose points are drawn."""
EDGE = 2.0**-53
"""Distance from 0 and 1 at which a position is held, where a normal distribution is infinite. Chosen: the
smallest that 1 can be told apart from."""
LEAST = 1e-6
"""Smallest probability of the range to which a normal distribution is truncated. Chosen: less is a typo."""


class Distribution(Protocol):
    """What values a quantity takes, and how often."""

    def at(self, position: float) -> float:
        """Return the value below which lies this share of all values."""


@dataclass(frozen=True)
class Uniform:
    """Values between two ends are equally likely; `log`: their logarithms are."""

    low: float
    high: float
    log: bool = False

    def at(self, position: float) -> float:
        if not self.log:
            return (1 - position) * self.low + position * self.high
        size = math.exp((1 - position) * math.log(abs(self.low)) + position * math.log(abs(self.high)))
        return math.copysign(size, self.low)


@dataclass(frozen=True)
class Normal:
    """Normal distribution, between two ends if these are given."""

    mean: float
    deviation: float
    low: float | None = None
    high: float | None = None

    @cached_property
    def _ends(self) -> tuple[float, float]:
        """The ends in standard deviations from the mean."""
        low = -math.inf if self.low is None else (self.low - self.mean) / self.deviation
        high = math.inf if self.high is None else (self.high - self.mean) / self.deviation
        return low, high

    def check(self) -> None:
        """Check that values lie within the ends.

        Raises:
            ValueError: next to none do.
        """
        from scipy.special import ndtr

        low, high = self._ends
        share = float(ndtr(-low) - ndtr(-high)) if low > 0 else float(ndtr(high) - ndtr(low))
        if not share >= LEAST:
            raise ValueError(
                f"normal: of mean {self.mean:g} and deviation {self.deviation:g}, a share of "
                f"{max(share, 0.0):.1g} lies between from and to; at least {LEAST:g} is needed"
            )

    def at(self, position: float) -> float:
        from scipy.special import ndtr, ndtri

        position = min(max(position, EDGE), 1.0 - EDGE)
        low, high = self._ends
        if low > 0:  # in the upper tail, where 1 - F would lose its digits
            number = -float(ndtri((1 - position) * ndtr(-low) + position * ndtr(-high)))
        else:
            number = float(ndtri((1 - position) * ndtr(low) + position * ndtr(high)))
        value = self.mean + self.deviation * number
        value = value if self.low is None else max(value, self.low)
        return value if self.high is None else min(value, self.high)


@dataclass(frozen=True)
class Tabulated:
    """Distribution from a table: pairs of a value and the share of values up to it, straight between them."""

    pairs: tuple[tuple[float, float], ...]

    @cached_property
    def _columns(self) -> tuple[np.ndarray, np.ndarray]:
        values, shares = np.array(self.pairs).T
        return shares, values

    def at(self, position: float) -> float:
        return float(np.interp(position, *self._columns))


def read_table(path: Path) -> tuple[tuple[float, float], ...]:
    """Return the table of a distribution in a CSV file, with or without a line of headings.

    Raises:
        ValueError: it cannot be read, or is no such table.
    """
    try:
        text = read_bytes(path, largest=TEXT).decode("utf-8-sig")
        lines = [line for line in csv.reader(io.StringIO(text)) if any(line)]
    except (OSError, ValueError, csv.Error) as error:
        raise ValueError(f"{path}: cannot be read: {reason(error)}") from None
    rows: list[Any] = []
    for number, line in enumerate(lines):
        try:
            cells = [float(cell) for cell in line]
        except ValueError:
            if number == 0:  # headings
                continue
            raise ValueError(f"{path}: line {number + 1} has what is no number") from None
        rows.append(cells[0] if len(cells) == 1 else cells)
    try:
        return table_of(rows)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def table_of(rows: Sequence[Any]) -> tuple[tuple[float, float], ...]:
    """Return measured values, or pairs of a value and a cumulative share, as such pairs.

    Measured values, in order x_1 to x_n, have the shares (k - 1) / (n - 1): the most common definition of
    sample quantiles (number 7 of R. J. Hyndman, Y. Fan, The American Statistician 50 (1996) 361-365), whose
    values lie within those measured.

    Raises:
        ValueError: they are neither, or do not rise from 0 to 1.
    """
    if rows and all(map(_is_number, rows)):
        if len(rows) < 2 or min(rows) == max(rows):
            raise ValueError("needs two different values or more")
        return tuple(zip(map(float, sorted(rows)), np.linspace(0.0, 1.0, len(rows)).tolist(), strict=True))
    if not rows or not all(
        isinstance(row, (list, tuple)) and len(row) == 2 and all(map(_is_number, row)) for row in rows
    ):
        raise ValueError("must be numbers, or pairs of a value and a cumulative share")
    values, shares = zip(*rows, strict=True)
    if len(rows) < 2 or shares[0] != 0 or shares[-1] != 1:
        raise ValueError("cumulative shares must begin with 0 and end with 1")
    if any(a >= b for a, b in pairwise(values)) or any(a > b for a, b in pairwise(shares)):
        raise ValueError("values must rise, and cumulative shares must not fall")
    return tuple((float(value), float(share)) for value, share in rows)


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def runs_of_design(design: str, axes: int, points: int) -> int:
    """Return how many points a design draws on a number of axes."""
    return points * (axes + 2) if design == "saltelli" else points


def positions(design: str, axes: int, points: int, seed: int) -> np.ndarray:
    """Return the points that a design draws, positions from 0 to 1: an array of (points, axes).

    `latin_hypercube` see `hypercube`; `sobol`: the first of a Sobol sequence scrambled by the seed
    (`scipy.stats.qmc.Sobol`; A. B. Owen, Journal of Complexity 14 (1998) 466-489); `random`: independent
    ones. `saltelli`: points A and B of a Sobol sequence, then for every axis A with the values of B on it,
    from which Sobol indices follow (A. Saltelli et al., Computer Physics Communications 181 (2010) 259-270).
    """
    if design == "latin_hypercube":
        return hypercube(axes, points, points, seed)
    if design == "random":
        return np.random.Generator(np.random.PCG64(seed)).random((points, axes))
    from scipy.stats import qmc

    both = design == "saltelli"
    drawn: np.ndarray = qmc.Sobol(axes * (1 + both), rng=seed).random(points)
    if not both:
        return drawn
    first, second = drawn[:, :axes], drawn[:, axes:]
    mixed = [np.where(np.arange(axes) == k, second, first) for k in range(axes)]
    return np.concatenate([first, second, *mixed])


def hypercube(axes: int, runs: int, most: int, seed: int) -> np.ndarray:
    """Return relative positions, 0 to 1, of a Latin hypercube that is extended: an array of (most, axes).

    On every axis, each of `runs` equal parts holds one of the first `runs` rows. So do the first 2, 4, 8 ...
    times as many: when each part of a range is halved, the new points fill the halves that have none. So no
    point is ever given up, which `scipy.stats.qmc.LatinHypercube` does not offer.
    Source: M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21 (1979) 239-245; for the extension
    C. J. Sallaberry, J. C. Helton, S. C. Hora, Reliability Engineering and System Safety 93 (2008) 1047-1059.
    """
    generator = np.random.Generator(np.random.PCG64(seed))
    draws = [(generator.permutation(runs) + generator.random(runs)) / runs for _ in range(axes)]
    positions = np.stack(draws, axis=1)
    while len(positions) < most:
        parts = 2 * len(positions)
        free = [np.setdiff1d(np.arange(parts), (column * parts).astype(int)) for column in positions.T]
        more = [(generator.permutation(halves) + generator.random(len(halves))) / parts for halves in free]
        positions = np.concatenate([positions, np.stack(more, axis=1)])
    return positions[:most]

"""Scores of entries over threats and cars, how sure they are, and who can be told apart.

Positions are an array of entry, threat and car: where between its easy end (0) and its hard end (1) each
level survived lies on a geometric scale; NaN where a car does not drive a threat. The mean position is the
logarithm of a geometric mean of levels, each threat's range taken as one unit. Cars count alike within a
threat, and threats count alike.

    score = 100 (m - m_none) / (m_best - m_none)            m: mean position of an entry

so no control has 0 and the best 100. Intervals are percentiles of a bootstrap that draws threats and cars, in
blocks; score and best are computed again in every draw. An entry's place is one more than the number of
entries whose whole interval lies above its own, and never better than that of an entry with a higher score,
so entries with overlapping intervals share places; `groups` counts how many intervals lie apart from each
other. Differences between two entries are surer than their intervals say, as both face the same threats:
`told_apart` counts pairs whose difference has one sign in 95 % of draws.

Mean ranks are a second order, which knows nothing of distances.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .confidence import DRAWS, Bounds, bootstrap, percentile_bounds
from .tables import Table, column


def mean_positions(positions: np.ndarray) -> np.ndarray:
    """Return the mean over threats of the means over cars, per entry."""
    known = ~np.isnan(positions)
    number = known.sum(axis=2)
    sums = np.where(known, positions, 0.0).sum(axis=2)
    of_threats = np.divide(sums, number, out=np.full(number.shape, np.nan), where=number > 0)
    means: np.ndarray = np.nanmean(of_threats, axis=1)
    return means


def scores_of_positions(positions: np.ndarray, reference: int) -> np.ndarray:
    """Return the scores of all entries; `reference`: index of no control."""
    means = mean_positions(positions)
    gained = means - means[reference]
    best = gained.max()
    scores: np.ndarray = 100.0 * gained / best if best > 0.0 else np.zeros_like(gained)
    return scores


def mean_ranks(positions: np.ndarray) -> np.ndarray:
    """Return the mean rank of every entry, 1 the best; equal levels share the mean of their ranks."""
    from scipy.stats import rankdata

    ranks = np.full(positions.shape, np.nan)
    for threat, car in zip(*np.nonzero(~np.isnan(positions[0])), strict=True):
        ranks[:, threat, car] = rankdata(-positions[:, threat, car])
    return mean_positions(ranks)


def order_of(numbers: np.ndarray) -> list[int]:
    """Return indices, the largest number first; equal ones in their order."""
    return [int(i) for i in np.argsort(-np.round(numbers, 9), kind="stable")]


@dataclass(frozen=True)
class ThreatScore:
    """Score of an entry."""

    entry: str
    score: float
    bounds: Bounds
    place: int
    mean: float  # position
    mean_rank: float
    by_rank: int  # place by the mean rank


@dataclass(frozen=True)
class ScoreTable:
    """Scores of all entries, the best first, and who can be told apart."""

    scores: list[ThreatScore]
    groups: int  # largest number of intervals of which no two overlap
    pairs: int
    told_apart: int  # pairs whose difference has one sign in 95 % of draws

    def order(self) -> list[str]:
        """Return the entries, the best first."""
        return [score.entry for score in self.scores]


def score_table(
    entries: Sequence[str], positions: np.ndarray, reference: str, *, draws: int = DRAWS
) -> ScoreTable:
    """Return the scores of entries with intervals and places.

    Args:
        entries: their names.
        positions: array of entry, threat, car; NaN where a car does not drive a threat.
        reference: the entry without control.
        draws: resamples of the bootstrap.
    """
    none = entries.index(reference)
    scores, ranks = scores_of_positions(positions, none), mean_ranks(positions)

    def draw(threats: np.ndarray, cars: np.ndarray) -> np.ndarray:
        return scores_of_positions(positions[:, threats][:, :, cars], none)

    resampled = bootstrap(draw, positions.shape[1:], draws=draws)
    low, high = percentile_bounds(resampled)
    order = order_of(scores)
    places = np.maximum.accumulate([1 + int((low > high[i]).sum()) for i in order])
    by_rank = {i: place for place, i in enumerate(order_of(-ranks), start=1)}
    means = mean_positions(positions)
    pairs = [(i, k) for i in range(len(entries)) for k in range(i)]
    apart = 0
    for i, k in pairs:
        least, most = percentile_bounds(resampled[:, i] - resampled[:, k])
        apart += bool(least > 0.0 or most < 0.0)
    return ScoreTable(
        [
            ThreatScore(
                entries[i], float(scores[i]), Bounds(float(low[i]), float(high[i])), int(place),
                float(means[i]), float(ranks[i]), by_rank[i],
            )
            for i, place in zip(order, places, strict=True)
        ],
        groups_of(list(zip(low, high, strict=True))), len(pairs), apart,
    )  # fmt: skip


def rank_correlation(table: ScoreTable, other: ScoreTable, reference: str) -> float:
    """Return Spearman's rank correlation of the scores of entries in both tables; NaN for less than 3."""
    from scipy.stats import spearmanr

    first, second = ({row.entry: row.score for row in scores.scores} for scores in (table, other))
    both = [entry for entry in first if entry in second and entry != reference]
    if len(both) < 3:
        return float("nan")
    return float(spearmanr([first[entry] for entry in both], [second[entry] for entry in both]).statistic)


def table_of_scores(table: ScoreTable) -> Table:
    """Return the table for programs with a row per entry, the best first."""
    rows = table.scores
    numbers = {
        "score": [row.score for row in rows],
        "low": [row.bounds.low for row in rows],
        "high": [row.bounds.high for row in rows],
        "mean_position": [row.mean for row in rows],
        "mean_rank": [row.mean_rank for row in rows],
    }
    return Table.of_columns(
        [
            column("entry", "string", [row.entry for row in rows]),
            column("place", "int64", [row.place for row in rows]),
            *(column(name, "float64", values) for name, values in numbers.items()),
        ]
    )


def groups_of(bounds: Sequence[tuple[float, float]]) -> int:
    """Return the largest number of intervals of which no two overlap."""
    number, end = 0, -np.inf
    for low, high in sorted(bounds, key=lambda interval: interval[1]):
        if low > end:
            number, end = number + 1, high
    return number


def orders_without(
    entries: Sequence[str], positions: np.ndarray, reference: str
) -> dict[tuple[str, int], list[str]]:
    """Return the order without each threat and each car: ("threat" or "car", its index) -> entries."""
    none = entries.index(reference)
    orders = {}
    for axis, word in ((1, "threat"), (2, "car")):
        for k in range(positions.shape[axis]) if positions.shape[axis] > 1 else ():
            left = np.delete(positions, k, axis=axis)
            if np.isnan(left[0]).all(axis=1).any():  # a threat that no other car drives
                left = left[:, ~np.isnan(left[0]).all(axis=1)]
            orders[word, k] = [entries[i] for i in order_of(scores_of_positions(left, none))]
    return orders


class Spread(NamedTuple):
    """A standard deviation of mean positions, with its interval."""

    value: float
    bounds: Bounds


@dataclass(frozen=True)
class GainsAndLaws:
    """How far gains and laws spread the mean positions apart.

    `laws`, `seeds`: of laws tuned with several seeds, the standard deviation between laws and that of the
    luck of the search within them, components of variance. `gains`: between authors' and tuned gains of a
    law; `between`: between the means of laws over both. `difference`: gains - between; gains matter more than
    laws if its interval is above 0.
    """

    laws: Spread
    seeds: Spread
    gains: Spread
    between: Spread
    difference: Spread


def gains_and_laws(tuned: np.ndarray, authors: np.ndarray) -> GainsAndLaws:
    """Compare spreads by the bootstrap over laws, threats and cars.

    Args:
        tuned: positions of law, seed, threat, car.
        authors: positions of law, threat, car, with the authors' gains.

    Intervals draw threats and cars, and laws, which are a sample of those that could be compared.
    """
    laws, seeds = tuned.shape[:2]

    def spreads(some: np.ndarray, threats: np.ndarray, cars: np.ndarray) -> list[float]:
        chosen = tuned[some][:, :, threats][:, :, :, cars]
        of_seeds = mean_positions(chosen.reshape(-1, *chosen.shape[2:])).reshape(len(some), seeds)
        own = mean_positions(authors[some][:, threats][:, :, cars])
        means = of_seeds.mean(axis=1)
        within = float(of_seeds.var(axis=1, ddof=1).mean())
        between = float(means.var(ddof=1)) - within / seeds
        of_gains = float(np.sqrt(np.mean(0.5 * (means - own) ** 2)))
        of_laws = float(np.sqrt(max(0.0, np.var(0.5 * (means + own), ddof=1) - 0.25 * within / seeds)))
        return [np.sqrt(max(0.0, between)), np.sqrt(within), of_gains, of_laws, of_gains - of_laws]

    sizes = (laws, *tuned.shape[2:])
    whole = spreads(*(np.arange(n) for n in sizes))
    draws = percentile_bounds(bootstrap(spreads, sizes))
    return GainsAndLaws(
        *(Spread(float(x), Bounds(*map(float, b))) for x, b in zip(whole, draws.T, strict=True))
    )

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

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from yawbench.studies import derived
from yawbench.studies.confidence import (
    DRAWS,
    TAIL,
    Bounds,
    bootstrap,
    pairs_apart,
    percentile_bounds,
    resample,
    shared_places,
)
from yawbench.studies.tables import Table, column

from .threat_runs import ThreatResult
from .threats import REFERENCE

FEWEST = 3
"""Laws of which a spread is taken; chosen: fewer say nothing about laws."""


def mean_positions(positions: np.ndarray) -> np.ndarray:
    """Return the mean over threats of the means over cars, per entry: without the last two axes."""
    known = ~np.isnan(positions)
    number = known.sum(axis=-1)
    sums = np.where(known, positions, 0.0).sum(axis=-1)
    of_threats = np.divide(sums, number, out=np.full(number.shape, np.nan), where=number > 0)
    means: np.ndarray = np.nanmean(of_threats, axis=-1)
    return means


def scores_of_positions(positions: np.ndarray, reference: int) -> np.ndarray:
    """Return the scores of all entries, in each draw if there are several; `reference`: index of none."""
    means = mean_positions(positions)
    gained = means - means[..., [reference]]
    best = gained.max(axis=-1, keepdims=True)
    scores: np.ndarray = np.divide(100.0 * gained, best, out=np.zeros_like(gained), where=best > 0.0)
    return scores


def resampled_scores(positions: np.ndarray, reference: int, draws: int = DRAWS) -> np.ndarray:
    """Return the scores of all entries in draws of threats and cars; shape (draws, entries)."""

    def draw(threats: np.ndarray, cars: np.ndarray) -> np.ndarray:
        return scores_of_positions(resample(positions, None, threats, cars), reference)

    return bootstrap(draw, positions.shape[1:], draws=draws)


def mean_ranks(positions: np.ndarray) -> np.ndarray:
    """Return the mean rank of every entry, 1 the best; equal levels share the mean of their ranks."""
    ranks = np.full(positions.shape, np.nan)
    for threat, car in zip(*np.nonzero(~np.isnan(positions[0])), strict=True):
        ranks[:, threat, car] = derived.ranks(-positions[:, threat, car])
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
    best: float  # share of the draws in which it has the best score


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

    def by_entry(self) -> dict[str, float]:
        """Return entry -> score, the best first."""
        return {score.entry: score.score for score in self.scores}


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
    resampled = resampled_scores(positions, none, draws)
    low, high = percentile_bounds(resampled)
    order = order_of(scores)
    places = shared_places(low[order], high[order])
    leaders = np.bincount(resampled.argmax(axis=1), minlength=len(entries)) / len(resampled)
    by_rank = {i: place for place, i in enumerate(order_of(-ranks), start=1)}
    means = mean_positions(positions)
    apart, pairs = pairs_apart(resampled)
    return ScoreTable(
        [
            ThreatScore(
                entries[i], float(scores[i]), Bounds(float(low[i]), float(high[i])), place,
                float(means[i]), float(ranks[i]), by_rank[i], float(leaders[i]),
            )
            for i, place in zip(order, places, strict=True)
        ],
        groups_of(list(zip(low, high, strict=True))), pairs, apart,
    )  # fmt: skip


def table_of_scores(table: ScoreTable) -> Table:
    """Return the table for programs with a row per entry, the best first."""
    rows = table.scores
    numbers = {
        "score": [row.score for row in rows],
        "low": [row.bounds.low for row in rows],
        "high": [row.bounds.high for row in rows],
        "mean_position": [row.mean for row in rows],
        "mean_rank": [row.mean_rank for row in rows],
        "best_in_draws": [row.best for row in rows],
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


def scores_without(
    entries: Sequence[str], positions: np.ndarray, reference: str
) -> dict[tuple[str, int], dict[str, float]]:
    """Return the scores without each threat and each car.

    Returns:
        ("threat" or "car", its index) -> entry -> score, the best first.
    """
    none = entries.index(reference)
    scores = {}
    for axis, word in ((1, "threat"), (2, "car")):
        for k in range(positions.shape[axis]) if positions.shape[axis] > 1 else ():
            left = np.delete(positions, k, axis=axis)
            if np.isnan(left[0]).all(axis=1).any():  # a threat that no other car drives
                left = left[:, ~np.isnan(left[0]).all(axis=1)]
            numbers = scores_of_positions(left, none)
            scores[word, k] = {entries[i]: float(numbers[i]) for i in order_of(numbers)}
    return scores


class Moves(NamedTuple):
    """Difference between two orders of the same entries."""

    correlation: float  # Spearman's, of the entries with control; NaN for fewer than three, or equal ones
    moved: int  # of them, those whose place changes
    farthest: str  # that which moves farthest
    before: int  # its place
    after: int


def moves_between(before: Mapping[str, float], after: Mapping[str, float], reference: str) -> Moves:
    """Compare the orders of the entries in both by their scores; equal scores share a place.

    Args:
        before, after: entry -> score.
        reference: the entry without control.
    """
    both = [entry for entry in before if entry in after]
    places = {
        entry: tuple(
            1 + sum(round(scores[other] - scores[entry], 9) > 0.0 for other in both)
            for scores in (before, after)
        )
        for entry in both
    }
    of_laws = [places[entry] for entry in both if entry != reference]
    farthest = max(both, key=lambda e: abs(places[e][1] - places[e][0]) if e != reference else -1)
    correlation = derived.rank_correlation(*zip(*of_laws, strict=True)) if len(of_laws) > 2 else None
    return Moves(
        math.nan if correlation is None else correlation,
        sum(old != new for old, new in of_laws),
        farthest,
        *places[farthest],
    )


class Spread(NamedTuple):
    """A standard deviation of mean positions, or a ratio of two, with its interval."""

    value: float
    bounds: Bounds


@dataclass(frozen=True)
class GainsAndLaws:
    """Spread of the mean positions by gains and by laws.

    `laws`, `seeds`: of laws tuned with several seeds, the standard deviation between laws and that of the
    luck of the search within them, components of variance; `ratio`: laws / seeds. `gains`: between authors'
    and tuned gains of a law; `between`: between the means of laws over both. `difference`: gains - between;
    gains matter more than laws if its interval is above 0.
    """

    laws: Spread
    seeds: Spread
    ratio: Spread
    gains: Spread
    between: Spread
    difference: Spread


def gains_and_laws(tuned: np.ndarray, authors: np.ndarray) -> GainsAndLaws:
    """Compare spreads of laws, seeds of their search, and gains.

    Args:
        tuned: positions of law, seed, threat, car.
        authors: positions of law, threat, car, with the authors' gains.

    Intervals are of a bootstrap over threats, cars, and laws, which are a sample of those that could be
    compared. That of `ratio` is exact for normally distributed laws and seeds on these threats and cars.
    """
    laws, seeds = tuned.shape[:2]

    def spreads(some: np.ndarray, threats: np.ndarray, cars: np.ndarray) -> np.ndarray:
        of_seeds = mean_positions(resample(tuned, some, None, threats, cars))
        own = mean_positions(resample(authors, some, threats, cars))
        means = of_seeds.mean(axis=-1)
        within = of_seeds.var(axis=-1, ddof=1).mean(axis=-1)
        between = means.var(axis=-1, ddof=1) - within / seeds
        of_gains = np.sqrt((0.5 * (means - own) ** 2).mean(axis=-1))
        variance = (0.5 * (means + own)).var(axis=-1, ddof=1) - 0.25 * within / seeds
        of_laws = np.sqrt(np.maximum(0.0, variance))
        spread = np.sqrt(np.maximum(0.0, between))
        return np.stack([spread, np.sqrt(within), of_gains, of_laws, of_gains - of_laws], axis=-1)

    sizes = (laws, *tuned.shape[2:])
    (whole,) = spreads(*(np.arange(n)[np.newaxis] for n in sizes))
    draws = percentile_bounds(bootstrap(spreads, sizes))
    of_laws, of_seeds, *of_gains = (
        Spread(float(x), Bounds(*map(float, b))) for x, b in zip(whole, draws.T, strict=True)
    )
    return GainsAndLaws(of_laws, of_seeds, ratio_of_spreads(mean_positions(tuned)), *of_gains)


def ratio_of_spreads(groups: np.ndarray) -> Spread:
    """Return the standard deviation between groups over that within them, with its interval.

    Components of variance of a balanced one-way analysis: F is the mean square between groups over that
    within, (1 + n ratio^2) times a number that follows the F distribution.

    Args:
        groups: n numbers of each; shape (groups, n).

    Source: S. R. Searle, G. Casella, C. E. McCulloch, Variance Components, Wiley 1992.
    """
    from scipy.special import fdtri  # what scipy.stats.f uses, without its slow import

    number, n = groups.shape
    within = float(groups.var(axis=1, ddof=1).mean())
    if within == 0.0:
        return Spread(math.inf, Bounds(math.inf, math.inf))
    observed = n * float(groups.mean(axis=1).var(ddof=1)) / within
    quantiles = fdtri(number - 1, number * (n - 1), [1.0 - TAIL, TAIL])
    value, low, high = (math.sqrt(max(0.0, observed / q - 1.0) / n) for q in (1.0, *map(float, quantiles)))
    return Spread(value, Bounds(low, high))


def scored(result: ThreatResult, setting: str = "") -> ScoreTable:
    """Return the scores of a setting, by default the main one."""
    setting = setting or result.threats.main
    entries = result.complete[setting]
    return score_table(entries, result.positions(setting, entries), REFERENCE)


@dataclass(frozen=True)
class ComparedSetting:
    """A setting beside the main one.

    Attributes:
        table: its scores.
        main: those of the main setting on the same threats and cars; None if it does not have them all.
        moved: mean difference of its positions from those of the main setting.
    """

    table: ScoreTable
    main: ScoreTable | None
    moved: float


def compared_setting(result: ThreatResult, setting: str) -> ComparedSetting:
    """Return a setting with the main one on the same threats and cars."""
    threats = result.threats
    entries = [entry for entry in result.complete[setting] if entry in result.complete[threats.main]]
    if not entries or not {*threats.threats_in(setting)} <= {*threats.threats_in(threats.main)}:
        return ComparedSetting(scored(result, setting), None, 0.0)
    mains = result.positions(threats.main, entries, like=setting)
    moved = float(np.nanmean(result.positions(setting, entries) - mains))
    return ComparedSetting(scored(result, setting), score_table(entries, mains, REFERENCE), moved)


@dataclass(frozen=True)
class ComparedGains:
    """Gains and laws by a setting whose laws were tuned with several seeds.

    Attributes:
        setting: its name.
        means: law, by its entry with the studies' gains -> mean position with these, and with each seed.
        groups: title of a group of laws -> spreads; all laws first.
    """

    setting: str
    means: dict[str, list[float]]
    groups: dict[str, GainsAndLaws]


def compared_gains(result: ThreatResult) -> ComparedGains | None:
    """Compare gains and laws by the setting with seeds; None if there is none with all levels."""
    threats = result.threats
    setting = next((name for name, described in threats.spec.settings.items() if described.seeds), None)
    if setting is None:
        return None
    spec, entries = threats.spec.settings[setting], threats.ranking.entries
    tuned = {
        name: [
            other
            for other in result.complete[setting]
            if entries[other][0].fmu == entries[name][0].fmu and entries[other][0].gains == "tuned"
        ]
        for name in result.complete[threats.main]
        if entries[name][0].gains == "authors"
    }
    laws = {name: others for name, others in tuned.items() if len(others) == 1 + len(spec.seeds)}
    groups = {f"all {len(laws)} laws": [*laws], **spec.groups}
    tuned_positions = {name: result.positions(setting, others) for name, others in laws.items()}
    studies = {name: result.positions(threats.main, [name], like=setting) for name in laws}
    compared = {
        title: gains_and_laws(
            np.array([tuned_positions[name] for name in names]),
            np.concatenate([studies[name] for name in names]),
        )
        for title, names in groups.items()
        if len(names) >= FEWEST and {*names} <= {*laws}
    }
    means = {
        name: [float(x) for x in mean_positions(np.concatenate([studies[name], tuned_positions[name]]))]
        for name in laws
    }
    return ComparedGains(setting, means, compared) if compared else None

"""Scores of entries over threats and cars, with their intervals and places (tests: `studies.confidence`).

Positions are an array of entry, threat and car: where between its easy end (0) and its hard end (1) each
level survived lies on a geometric scale; NaN where a car does not drive a threat. The mean position is the
logarithm of a geometric mean of levels, each threat's range taken as one unit. Cars count alike within a
threat, and threats count alike.

    score = 100 (m - m_none) / (m_best - m_none)            m: mean position of an entry

so no control has 0 and the best 100. Two entries face the same threats and cars: what is sure is the interval
of the mean of their differences, with threats and cars as samples both (`confidence.crossed_interval`). The
interval beside a score is that of its distance from the best, in points of the score, with the best's gain
taken as known. An entry is **clearly** better than another if the difference remains significant among those
of all pairs (Holm). Its place is one more than the number of entries that are clearly better, and never
better than that of an entry with a higher score, so entries that cannot be told apart share places.

Mean ranks are a second order, which knows nothing of distances.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from yawbench.studies import derived
from yawbench.studies.confidence import Bounds, crossed_interval, crossed_probability
from yawbench.studies.pair_comparisons import ToldApart, shared_places, told_apart
from yawbench.studies.tables import Table, column

from .threat_runs import ThreatResult
from .threats import REFERENCE


def mean_positions(positions: np.ndarray) -> np.ndarray:
    """Return the mean over threats of the means over cars, per entry: without the last two axes."""
    known = ~np.isnan(positions)
    number = known.sum(axis=-1)
    sums = np.where(known, positions, 0.0).sum(axis=-1)
    of_threats = np.divide(sums, number, out=np.full(number.shape, np.nan), where=number > 0)
    means: np.ndarray = np.nanmean(of_threats, axis=-1)
    return means


def scores_of_positions(positions: np.ndarray, reference: int) -> np.ndarray:
    """Return the scores of all entries; `reference`: index of none."""
    means = mean_positions(positions)
    gained = means - means[..., [reference]]
    best = gained.max(axis=-1, keepdims=True)
    scores: np.ndarray = np.divide(100.0 * gained, best, out=np.zeros_like(gained), where=best > 0.0)
    return scores


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
    bounds: Bounds  # of its distance from the best score
    place: int
    mean: float  # position
    mean_rank: float
    by_rank: int  # place by the mean rank


@dataclass(frozen=True)
class ScoreTable:
    """Scores of all entries, the best first, and who can be told apart."""

    scores: list[ThreatScore]
    apart: ToldApart  # in their order

    def behind(self, entry: str) -> list[str]:
        """Return the entries that an entry is clearly better than."""
        order = self.order()
        return [order[k] for k in np.flatnonzero(self.apart.better[order.index(entry)])]

    def order(self) -> list[str]:
        """Return the entries, the best first."""
        return [score.entry for score in self.scores]

    def by_entry(self) -> dict[str, float]:
        """Return entry -> score, the best first."""
        return {score.entry: score.score for score in self.scores}


def score_table(entries: Sequence[str], positions: np.ndarray, reference: str) -> ScoreTable:
    """Return the scores of entries with intervals and places.

    Args:
        entries: their names.
        positions: array of entry, threat, car; NaN where a car does not drive a threat.
        reference: the entry without control.
    """
    none = entries.index(reference)
    scores, ranks, means = (
        scores_of_positions(positions, none),
        mean_ranks(positions),
        mean_positions(positions),
    )
    order = order_of(scores)
    best = order[0]
    gain = means[best] - means[none]
    half = [
        100.0 * crossed_interval(table - positions[best]).half / gain if gain else 0.0 for table in positions
    ]
    apart = told_apart(means, lambda i, j: crossed_probability(positions[i] - positions[j]), none).of(order)
    by_rank = {i: place for place, i in enumerate(order_of(-ranks), start=1)}
    return ScoreTable(
        [
            ThreatScore(
                entries[i],
                float(scores[i]),
                Bounds(float(scores[i] - half[i]), float(scores[i] + half[i])),
                place,
                float(means[i]),
                float(ranks[i]),
                by_rank[i],
            )
            for i, place in zip(order, shared_places(apart.better), strict=True)
        ],
        apart,
    )


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

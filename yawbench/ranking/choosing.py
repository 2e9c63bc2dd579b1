"""Choosing a law: what controllers pass, what they cost, how they degrade, and where their order is certain.

The table has a row per controller, in the order of the ranking: conditions passed, nuisance, intervention and
time per step in the matrix, and the highest levels survived of what misleads a law (levels of the threats).
Its last row counts the pairs of controllers that each column tells apart, corrected for their number (Holm):
of conditions and intervention by exact sign tests over conditions, of nuisance and levels by differences over
situations and cars (`studies.confidence`). Times depend on the computer and are not compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import comb

import numpy as np

from yawbench.studies.confidence import crossed_probability
from yawbench.studies.pair_comparisons import ToldApart, sign_test, told_apart
from yawbench.studies.tables import Cell, Table

from .ranking_scores import IDLE, EntryScore, RankedState, apart_by_conditions
from .ranking_tables import share_text
from .threat_runs import ThreatResult
from .threat_tables import levels_table
from .whole_ranking import WholeRanking

MISLEAD = ("friction", "model", "delay", "noise", "gyro_bias", "mass")
"""Threats that mislead a law: friction and tyres told wrong, late moments, poor sensors, load. Those that a
threat file has are shown."""


def choosing_table(ranked: WholeRanking, threats: ThreatResult | None) -> Table:
    """Return the table for choosing a law.

    Args:
        ranked: the ranking, whole.
        threats: levels survived, searched or published; None: without.
    """
    scores = [score for score in ranked.scores if score.place and score.spec.fmu != IDLE]
    known = threats.complete[threats.threats.main] if threats else []
    names = [name for name in MISLEAD if threats and name in threats.threats.threats_in(threats.threats.main)]
    headings = ["controller", "passed", "braking", "intervention [N.m.s]", "time per step [µs]"]
    of_levels: dict[str, list[Cell]] = {}
    if threats and names:
        levels = levels_table(threats, known)
        own = [1 + threats.threats.threats_in(threats.threats.main).index(name) for name in names]
        headings += [levels.headings[k] for k in own]
        of_levels = {entry: [row[k] for k in own] for entry, row in zip(known, levels.rows, strict=True)}
    rows: list[list[Cell]] = [
        [
            score.spec.title, f"{score.count(RankedState.PASSED)} of {len(score.cells)}",
            share_text(score.braking), _whole(score.mean("intervention")), _whole(score.step_time, 1e6),
            *of_levels.get(score.entry, [None] * len(names)),
        ]
        for score in scores
    ]  # fmt: skip
    clear = [
        "clear pairs",
        *_clear_pairs(ranked, scores),
        *(_clear_levels(threats, scores, x) for x in names),
    ]
    return Table("Choosing a law", headings, [*rows, clear], [NOTE], {*range(1, len(headings))})


NOTE = (
    "Passed: conditions of the matrix. Braking: share of the time in ordinary driving. Intervention: of the "
    "wheel that gets most. Then the hardest levels survived, geometric means over cars; of friction the "
    "lowest is the hardest. Clear pairs: those of controllers that the column tells apart, corrected for "
    "their number; where few of all are clear, the order within the column may be chance."
)


def _whole(number: float | None, factor: float = 1.0) -> str | None:
    return None if number is None else f"{factor * number:.0f}"


def _clear_pairs(ranked: WholeRanking, scores: Sequence[EntryScore]) -> list[str | None]:
    """Return the clear pairs by conditions, nuisance and intervention, and none for the time."""
    if len(scores) < 2:
        return [None] * 4
    passed, nuisance = _of_pairs(apart_by_conditions(scores), len(scores)), None
    if ranked.nuisance:
        entries = [score.entry for score in ranked.nuisance.complete]
        own = [entries.index(score.entry) for score in scores if score.entry in entries]
        nuisance = _of_pairs(ranked.nuisance.apart.of(own), len(own))
    return [passed, nuisance, _by_sign(scores, "intervention"), None]


def _by_sign(scores: Sequence[EntryScore], key: str) -> str | None:
    """Return how many pairs a number tells apart, less is better, by exact sign tests over conditions."""
    numbers = [[cell.number(key) for cell in score.cells.values()] for score in scores]
    if any(x is None for row in numbers for x in row):
        return None
    table = np.array(numbers, dtype=float)

    def probability(i: int, j: int) -> float:
        return sign_test(table[i] < table[j], table[j] < table[i])

    return _of_pairs(told_apart(-table.mean(axis=1), probability), len(table))


def _clear_levels(threats: ThreatResult | None, scores: Sequence[EntryScore], name: str) -> str | None:
    """Return how many pairs the levels of a threat tell apart over the cars."""
    assert threats is not None
    main = threats.threats.main
    entries = [score.entry for score in scores if score.entry in threats.complete[main]]
    if len(entries) < 2:
        return None
    k = threats.threats.threats_in(main).index(name)
    positions = threats.positions(main, entries)[:, k : k + 1, :]
    positions = positions[:, :, ~np.isnan(positions).all(axis=(0, 1))]

    def probability(i: int, j: int) -> float:
        return crossed_probability(positions[i] - positions[j])

    return _of_pairs(told_apart(positions.mean(axis=(1, 2)), probability), len(positions))


def _of_pairs(apart: ToldApart, number: int) -> str:
    return f"{apart.better.sum()} of {comb(number, 2)}"

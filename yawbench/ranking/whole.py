"""The whole ranking: the matrix, nuisance in ordinary driving, and the order under other settings."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from yawbench.studies.executor import Executor

from .nuisance import Nuisance, run_nuisance
from .ranking import LoadedRanking
from .ranking_scores import EntryScore, RankingResult, run_ranking
from .settings import run_settings


def run_whole(
    ranking: LoadedRanking, execute: Executor, *, only: Collection[str] = (), keep: bool = True
) -> RankingResult:
    """Execute the missing runs of a ranking and all that belongs to it; arguments as of `run_ranking`.

    A quick look and selected conditions are those of the matrix alone.

    Raises:
        YawbenchError: a run cannot start, or A cannot be determined.
    """
    ranked = run_ranking(ranking, execute, only=only, keep=keep)
    if not ranking.whole:
        return ranked
    spec = ranking.spec
    nuisance = run_nuisance(ranking, execute, only=only) if spec.ordinary else None
    return replace(
        ranked,
        scores=with_braking(ranked.scores, nuisance),
        nuisance=nuisance,
        settings=run_settings(ranked, execute, only=only) if spec.settings else (),
    )


def with_braking(scores: Sequence[EntryScore], nuisance: Nuisance | None) -> list[EntryScore]:
    """Return scores with the share of the time that entries brake in ordinary driving, if that is driven."""
    if nuisance is None:
        return [*scores]
    return [replace(score, braking=nuisance.scores[score.entry].braking()) for score in scores]

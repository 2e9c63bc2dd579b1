"""The whole ranking: the matrix, nuisance in ordinary driving, and the order under other settings."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from yawbench.studies.executor import Executor

from .nuisance import Nuisance, run_nuisance
from .ranking import LoadedRanking
from .ranking_scores import EntryScore, RankingResult, run_ranking
from .settings import SettingScores, run_settings


@dataclass(frozen=True)
class WholeRanking(RankingResult):
    """Result of a ranking with all that belongs to it."""

    nuisance: Nuisance | None = None  # in ordinary driving; None: not driven
    settings: Sequence[SettingScores] = ()  # its own first; empty: none were driven


def run_whole(
    ranking: LoadedRanking, execute: Executor, *, only: Collection[str] = (), keep: bool = True
) -> WholeRanking:
    """Execute the missing runs of a ranking and all that belongs to it; arguments as of `run_ranking`.

    A quick look and selected conditions are those of the matrix alone.

    Raises:
        YawbenchError: a run cannot start, or A cannot be determined.
    """
    ranked = run_ranking(ranking, execute, only=only, keep=keep)
    own = ranked.ranking, ranked.angles, ranked.runs
    if not ranking.whole:
        return WholeRanking(*own, ranked.scores)
    spec = ranking.spec
    nuisance = run_nuisance(ranking, execute, only=only) if spec.ordinary else None
    settings = run_settings(ranked, execute, only=only) if spec.settings else ()
    return WholeRanking(*own, with_braking(ranked.scores, nuisance), nuisance, settings)


def with_braking(scores: Sequence[EntryScore], nuisance: Nuisance | None) -> list[EntryScore]:
    """Return scores with the share of the time that entries brake in ordinary driving, if that is driven."""
    if nuisance is None:
        return [*scores]
    return [replace(score, braking=nuisance.scores[score.entry].braking()) for score in scores]

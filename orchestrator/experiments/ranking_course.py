"""The course of a ranking: A of every car, then all runs that are left, then where everybody stands."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass

from ..errors import ResultsError
from .jobs import Job, Once
from .journal import Journal
from .ranking import Drive, Ranking, angle_of, drives_of, jobs_for_angles, plan_drives
from .standings import Standing, standings

Make = Callable[[str, Sequence[Job]], object]
"""Makes those of some runs that are left, under a title, and notes them in the journal."""
Planning = Callable[[int], AbstractContextManager[Callable[[int], None]]]
"""Shows how many of so many runs are planned."""


@dataclass(frozen=True)
class Ranked:
    """What a ranking comes to."""

    ranking: Ranking
    angles: dict[str, float]  # car -> A [rad]
    drives: list[Drive]
    standings: list[Standing]


def drive_ranking(
    ranking: Ranking,
    base: Job,
    journal: Journal,
    once: Once,
    make: Make,
    *,
    only: Collection[str] = (),
    planning: Planning = lambda total: nullcontext(lambda done: None),
) -> Ranked:
    """Make the runs that are left and return where everybody stands.

    Args:
        ranking: as loaded.
        base: what all jobs share; results go to its folder.
        journal: of finished runs.
        once: reads files and opens FMUs.
        make: makes runs.
        only: entries whose runs are made; none: of all. The others stand with what is there.
        planning: shows how many of so many runs are planned.

    Raises:
        YawbenchError: a run cannot start, or A cannot be found.
    """
    slow = jobs_for_angles(ranking, base, once)
    make("A, the angle at 0.3 g", [job for jobs in slow.values() for job in jobs])
    angles = {}
    for car, jobs in slow.items():
        if any(job.key not in journal.records for job in jobs):
            raise ResultsError(f"{base.out}: holds no A of {car!r} of this build; rank without --no-run")
        angles[car] = angle_of([journal.records[job.key] for job in jobs], car)
    drives = drives_of(ranking, angles)
    with planning(len(drives)) as progress:
        drives = plan_drives(ranking, drives, base, once, progress)
    wanted = [one.job for one in drives if one.job and (not only or one.entry in only)]
    make(ranking.spec.title, wanted)
    return Ranked(ranking, angles, drives, standings(ranking, drives, journal.records))

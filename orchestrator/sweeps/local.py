"""Runs of a sweep in processes of this machine."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..studies.jobs import Outcome, execute
from .measuring import Measurement, measure

Done = Callable[[Outcome], None]
"""Told of every run that is finished."""

TRIES = 2
"""Times that a run is begun whose process dies; chosen: a kill from outside strikes seldom twice."""


def run_here(jobs: Sequence[Measurement], done: Done, *, workers: int | None = None) -> None:
    """Make all runs, each in a process of its own.

    A run whose process died is made again when the others are through: perhaps the process was
    killed, and the run is not to blame.

    Args:
        jobs: what to run.
        done: called with every outcome as it comes, with one only for each job.
        workers: processes at a time; default: one per processor core.

    Raises:
        KeyboardInterrupt: Ctrl-C or SIGTERM, when all processes have ended.
    """
    waiting = list(jobs)
    for left in reversed(range(TRIES)):
        died: list[Outcome] = []

        def note(outcome: Outcome, last: bool = not left, died: list[Outcome] = died) -> None:
            if outcome.died and not last:
                died.append(outcome)
            else:
                done(outcome)

        execute(waiting, workers=workers, done=note, run=measure)
        waiting = [outcome.job for outcome in died]  # type: ignore[misc]
        if not waiting:
            return

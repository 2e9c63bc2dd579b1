"""What the commands that make several runs share: an option, progress, tables on the terminal."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..wording import printable

if TYPE_CHECKING:
    from ..studies.jobs import Job, Outcome
    from ..studies.tables import Table

Jobs = Annotated[
    int | None,
    typer.Option("--jobs", metavar="N", min=1, help="Runs at a time; default: one per processor core."),
]
WIDTH = 140
"""Of tables that go into a file or a pipe."""


def say(text: str) -> None:
    """Write a message for the user, apart from what the command gives out."""
    print(printable(text), file=sys.stderr, flush=True)


def run_all(jobs: Sequence[Job], folder: Path, *, workers: int | None, build: bool) -> list[Outcome]:
    """Run all jobs, after making sure that every one can start, and report each as it ends.

    `build`: build first what is stale of the FMUs that they use.

    Raises:
        BuildError, ScenarioError: a job cannot start; none has been.
    """
    from ..studies.jobs import check, execute

    for note in check(jobs, build=build):
        say(f"note: {note}")
    with stoppable(folder):
        return execute(jobs, workers=workers, done=_progress(len(jobs)))


def hold(context: typer.Context, *folders: Path) -> None:
    """Claim folders for this command until it has ended.

    Raises:
        ResultsError: another command is writing there, or nothing can be written.
    """
    from ..results.lock import writing

    context.with_resource(writing(*folders))


@contextlib.contextmanager
def stoppable(folder: Path) -> Iterator[None]:
    """Let Ctrl-C end the command with a word on what has been recorded."""
    try:
        yield
    except KeyboardInterrupt:
        say(f"Interrupted; what was recorded until then: {folder}")
        raise typer.Exit(1) from None


def _progress(total: int) -> Callable[[Outcome], None]:
    width, count = len(str(total)), 0

    def done(outcome: Outcome) -> None:
        nonlocal count
        count += 1
        ended = f"{outcome.seconds:.1f} s" if outcome.ok else f"failed: {outcome.reason}"
        say(f"[{count:{width}}/{total}] {outcome.job.label}: {ended}")

    return done


def print_tables(tables: Iterable[Table]) -> None:
    """Print tables on the standard output, as wide as the terminal."""
    from rich.console import Console

    from ..studies.tables import for_terminal

    console = Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else WIDTH)
    for table in tables:
        console.print()
        console.print(for_terminal(table))

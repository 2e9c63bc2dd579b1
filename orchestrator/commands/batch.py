"""What the commands that make several runs share: an option, progress, tables on the terminal."""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..wording import printable

if TYPE_CHECKING:
    from ..experiments.jobs import Outcome
    from ..experiments.tables import Table

Jobs = Annotated[
    int | None,
    typer.Option("--jobs", metavar="N", min=1, help="Runs at a time; default: one per processor core."),
]
WIDTH = 140
"""Of tables that go into a file or a pipe."""


def say(text: str) -> None:
    """Write a message for the user, apart from what the command gives out."""
    print(printable(text), file=sys.stderr, flush=True)


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


@contextlib.contextmanager
def reported(
    title: str, total: int, done: int = 0, *, each: bool = True
) -> Iterator[Callable[[Outcome], None]]:
    """Tell of runs as they end: a bar on a terminal, elsewhere a line each or a line now and then.

    Args:
        title: of the bar.
        total: runs in all.
        done: how many of them are finished already.
        each: whether to write a line for each run; else for every tenth of those that are left.
    """
    width, count = len(str(total)), done
    with bar(title, total, done, quiet=each) as progress:

        def told(outcome: Outcome) -> None:
            nonlocal count
            count += 1
            progress(count)
            if each:
                ended = f"{outcome.seconds:.1f} s" if outcome.ok else f"failed: {outcome.reason}"
                say(f"[{count:{width}}/{total}] {outcome.job.label}: {ended}")

        yield told


@contextlib.contextmanager
def bar(title: str, total: int, done: int = 0, *, quiet: bool = False) -> Iterator[Callable[[int], None]]:
    """Show progress and the time left: a bar on a terminal, elsewhere a line now and then, or none."""
    if not sys.stderr.isatty() or os.environ.get("TERM") == "dumb":
        yield (lambda count: None) if quiet else _lines(total, done)
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("left"),
        TimeRemainingColumn(), TextColumn("so far"), TimeElapsedColumn(),
    )  # fmt: skip
    # time left from the pace of the last runs; they differ less than their number
    with Progress(*columns, console=Console(stderr=True), transient=True, speed_estimate_period=120) as shown:
        task = shown.add_task(title.replace("[", r"\["), total=total, completed=done)
        yield lambda count: shown.update(task, completed=count)


def _lines(total: int, done: int) -> Callable[[int], None]:
    """Return what writes a line for every tenth of the runs that are left."""
    began, last = time.monotonic(), done

    def told(count: int) -> None:
        nonlocal last
        if count < total and 10 * (count - last) < total - done:
            return
        last = count
        left = (time.monotonic() - began) / (count - done) * (total - count)
        say(f"[{count:{len(str(total))}}/{total}]" + (f" {left:.0f} s left" if count < total else ""))

    return told


def print_tables(tables: Iterable[Table]) -> None:
    """Print tables on the standard output, as wide as the terminal."""
    from rich.console import Console

    from ..experiments.tables import for_terminal

    console = Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else WIDTH)
    for table in tables:
        console.print()
        console.print(for_terminal(table))

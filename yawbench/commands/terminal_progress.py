"""How far a command is: notices, bars and lines on stderr, and how it is stopped."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from yawbench.foundation.errors import Interrupted
from yawbench.foundation.messages import counted, printable

if TYPE_CHECKING:
    from yawbench.studies.experiment import PlannedExperiment
    from yawbench.studies.jobs import Outcome


SHOWN = 10
"""Failed runs named on the terminal; all are in the table."""
SILENCE = 30.0
"""Longest time [s] without a line where stderr is not a terminal. Chosen: readers of a log take a minute for
a hang, and a night of lines is a page."""


class _Log:
    """Lines on stderr, and one on how far the command is whenever there was none for `SILENCE`."""

    def __init__(self) -> None:
        self.last = time.monotonic()
        self.progress: Callable[[], str] | None = None  # how far the current work is

    def say(self, text: str) -> None:
        """Print a line."""
        self.last = time.monotonic()
        print(printable(text), file=sys.stderr, flush=True)

    @contextlib.contextmanager
    def watched(self) -> Iterator[None]:
        """Break the silence while the block runs."""
        began, over = time.monotonic(), threading.Event()
        self.last = began

        def watch() -> None:
            while not over.wait(max(0.0, self.last + SILENCE - time.monotonic())):
                if time.monotonic() >= self.last + SILENCE:
                    so_far = f"{time.monotonic() - began:.0f} s so far"
                    self.say(f"{self.progress()}, {so_far}" if self.progress else f"still running, {so_far}")

        thread = threading.Thread(target=watch, daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()


_LOG = _Log()
PATIENCE = 2.0
"""Time [s] after which a command says what it is at. Chosen: readers of a terminal take more for a hang."""
OPENING = "opening the FMUs"
BUILDING = f"{OPENING}, and building those that are missing or whose sources have changed: seconds each"


@contextlib.contextmanager
def announced(text: str) -> Iterator[None]:
    """Print a line if the block takes longer than `PATIENCE`."""
    timer = threading.Timer(PATIENCE, say, [text])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()


def say(text: str) -> None:
    """Print a message for the user on stderr, apart from the command's output."""
    _LOG.say(text)


def shows_bars() -> bool:
    """Return whether stderr is a terminal that can show bars."""
    return sys.stderr.isatty() and os.environ.get("TERM") != "dumb"


def hold(context: typer.Context, *folders: Path) -> None:
    """Lock folders for this command until it ends; in a log, it is never silent for long.

    Raises:
        ResultsError: another command is writing there, or a folder is not writable.
    """
    from yawbench.orchestrator.results.folder_lock import writing

    context.with_resource(writing(*folders))
    if not shows_bars():
        context.with_resource(_LOG.watched())


@contextlib.contextmanager
def stoppable(folder: Path) -> Iterator[None]:
    """On Ctrl-C and SIGTERM, end the command with a message on what has been recorded.

    Raises:
        Interrupted: with that message.
    """
    try:
        yield
    except KeyboardInterrupt as error:
        number = Interrupted.of(error).number
        raise Interrupted(f"Interrupted; results so far: {folder}", number=number) from None


@dataclass
class Terminal:
    """Shows the progress of experiments on stderr, each note once."""

    making: bool = True  # whether missing runs are made
    building: bool = True  # whether FMUs are built
    noted: set[str] = field(default_factory=set)

    @contextlib.contextmanager
    def planning(self, total: int) -> Iterator[Callable[[int], None]]:
        """Show a bar, and say if FMUs are what takes long."""
        with (
            announced(BUILDING if self.building else OPENING),
            bar("planning", total, quiet=True) as progress,
        ):
            yield progress

    def planned(self, planned: PlannedExperiment) -> None:
        """Print which FMUs are out of date."""
        from yawbench.fmus.opener import stale_fmus

        for note in map(str, stale_fmus(planned.fmus.values())):
            if note not in self.noted:
                say(f"note: {note}")
            self.noted.add(note)

    def running(
        self, title: str, runs: int, finished: int, left: int, *, journaled: bool
    ) -> contextlib.AbstractContextManager[Callable[[Outcome], None]]:
        """Print how many runs are left, and show a bar; of runs with results, also a line for each."""
        before = "" if not finished else f", {finished if left else 'all'} finished already"
        say(f"{title}: {counted(runs, 'run')}{before}")
        if not self.making or not left:
            return contextlib.nullcontext(lambda outcome: None)
        return reported("runs", finished + left, finished, each=not journaled)


def say_failed(failed: Mapping[str, str]) -> None:
    """Print which runs failed; `failed`: description of the run -> reason."""
    for words, why in list(failed.items())[:SHOWN]:
        say(f"{words} failed: {why}")
    if len(failed) > SHOWN:
        say(f"{len(failed) - SHOWN} more failed")


@contextlib.contextmanager
def reported(
    title: str, total: int, done: int = 0, *, each: bool = True
) -> Iterator[Callable[[Outcome], None]]:
    """Report runs as they end: a bar on a terminal, elsewhere a line for each or for every tenth.

    Args:
        title: of the bar.
        total: number of runs.
        done: how many of them are finished already.
        each: whether to write a line for each run; else for every tenth of the remaining ones.
    """
    width, count = len(str(total)), done
    with bar(title, total, done, quiet=each) as progress:

        def report(outcome: Outcome) -> None:
            nonlocal count
            count += 1
            progress(count)
            if each:
                ended = f"{outcome.seconds:.1f} s" if outcome.ok else f"failed: {outcome.reason}"
                say(f"[{count:{width}}/{total}] {outcome.job.label}: {ended}")

        yield report


@contextlib.contextmanager
def bar(title: str, total: int, done: int = 0, *, quiet: bool = False) -> Iterator[Callable[[int], None]]:
    """Show progress and the time left: a bar on a terminal, elsewhere lines or nothing."""
    if not shows_bars():
        with _lines(title, total, done, quiet=quiet) as report:
            yield report
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
    # estimate the time left from the pace of the latest runs
    with Progress(*columns, console=Console(stderr=True), transient=True, speed_estimate_period=120) as shown:
        task = shown.add_task(printable(title).replace("[", r"\["), total=total, completed=done)
        yield lambda count: shown.update(task, completed=count)


@contextlib.contextmanager
def _lines(title: str, total: int, done: int, *, quiet: bool) -> Iterator[Callable[[int], None]]:
    """Print a line for every tenth of the remaining runs unless `quiet`, and while they take long."""
    began, last, count = time.monotonic(), done, done

    def progress() -> str:
        left = (time.monotonic() - began) / (count - done) * (total - count) if count > done else None
        number = f"{title}: [{count:{len(str(total))}}/{total}]" if total else title
        return number + (f" {left:.0f} s left" if left else "")

    def report(finished: int) -> None:
        nonlocal last, count
        count = finished
        if quiet or (count < total and 10 * (count - last) < total - done):
            return
        last = count
        say(progress().removeprefix(f"{title}: "))

    before, _LOG.progress = _LOG.progress, progress
    try:
        yield report
    finally:
        _LOG.progress = before

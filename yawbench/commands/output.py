"""Output of commands: tables for people, tables in LaTeX, or one JSON object; messages and progress.

The option `--json` or `--latex` decides; with them, any other output, also of libraries and FMUs, goes to
standard error. Commands print their tables with `print_tables` and pass data for programs to `answer` and
`note`, whatever the form. Messages go to `say`, progress to `bar` and `reported`.
"""

from __future__ import annotations

import contextlib
import functools
import inspect
import json
import math
import os
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from yawbench.foundation.errors import Diagnostic, Interrupted, ScenarioError
from yawbench.foundation.messages import counted, printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console

    from yawbench.studies.experiment import PlannedExperiment
    from yawbench.studies.jobs import Outcome
    from yawbench.studies.tables import Table

VERSION = 1
"""Version of the JSON object; increased when a field changes its meaning or is removed."""
Form = Literal["text", "json", "latex"]


@dataclass
class Output:
    """The output of a command in one form."""

    form: Form = "text"
    command: str = ""
    fields: dict[str, Any] = field(default_factory=dict)
    tables: list[Table] = field(default_factory=list)
    diagnostics: dict[Diagnostic, None] = field(default_factory=dict)

    def print(self, status: int) -> None:
        """Print the collected output; `status`: the exit status."""
        if self.form != "text":
            print(self._text(status), end="", flush=True)

    def _text(self, status: int) -> str:
        from yawbench.studies.tables import to_latex

        if self.form == "latex":
            return "\n".join(map(to_latex, self.tables))
        whole = {
            "schema": VERSION,
            "command": self.command,
            "status": status,
            **self.fields,
            "tables": [*map(_data_of, self.tables)],
            "diagnostics": [diagnostic.record() for diagnostic in self.diagnostics],
        }
        return json.dumps(_plain(whole), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


_OUTPUT: ContextVar[Output] = ContextVar("_OUTPUT", default=Output())  # noqa: B039 - nothing collects in text


def form() -> Form:
    """Return the form of the output of the current command."""
    return _OUTPUT.get().form


def answer(**fields: Any) -> None:
    """Add fields to the JSON object; in other forms, do nothing."""
    if form() == "json":
        _OUTPUT.get().fields |= fields


def note(diagnostics: Iterable[Diagnostic]) -> None:
    """Add errors, warnings and infos to the JSON object; in other forms, do nothing."""
    if form() == "json":
        _OUTPUT.get().diagnostics |= dict.fromkeys(diagnostics)


def collect(tables: Iterable[Table]) -> None:
    """Add tables to output that is not text."""
    _OUTPUT.get().tables.extend(tables)


@contextlib.contextmanager
def printing(arguments: Sequence[str]) -> Iterator[Output]:
    """Collect the output of a command line in the form that it asks for; help is text."""
    own = [*arguments[: arguments.index("--")]] if "--" in arguments else [*arguments]
    wanted: Form = "json" if "--json" in own else "latex" if "--latex" in own else "text"
    if wanted == "text" or {"-h", "--help"} & {*own}:
        yield Output()
        return
    output = Output(wanted, own[0])
    token = _OUTPUT.set(output)
    try:
        with _stdout_to_stderr():
            yield output
    finally:
        _OUTPUT.reset(token)


@contextlib.contextmanager
def _stdout_to_stderr() -> Iterator[None]:
    """Redirect standard output to standard error, also that of C code and of child processes."""
    try:
        place, target = sys.stdout.fileno(), sys.stderr.fileno()
        sys.stdout.flush()
        kept = os.dup(place)
    except (OSError, ValueError):  # a stream without a file
        with contextlib.redirect_stdout(sys.stderr):
            yield
        return
    try:
        os.dup2(target, place)
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        os.dup2(kept, place)
        os.close(kept)


Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON object to standard output, see docs/editors.md.")
]
Latex = Annotated[bool, typer.Option("--latex", help="Print tables for LaTeX, with the package booktabs.")]


def tabular(command: Callable[..., None]) -> Callable[..., None]:
    """Mark a command that prints tables, and so takes `--json` and `--latex`."""
    command.tabular = True  # type: ignore[attr-defined]
    return command


def with_options(
    command: Callable[..., None],
    called: Callable[..., None],
    *,
    without: str = "",
    **options: tuple[Any, Any],
) -> Callable[..., None]:
    """Return what is called for a command, with the command's signature and further options.

    Args:
        command: has parameters of its own.
        called: takes them and the options by name.
        without: a parameter of the command that `called` makes itself.
        options: name -> default and annotation.
    """
    kind = inspect.Parameter.KEYWORD_ONLY
    own = inspect.signature(command, eval_str=True).parameters.values()
    more = (
        inspect.Parameter(name, kind, default=default, annotation=annotation)
        for name, (default, annotation) in options.items()
    )
    every = [*(parameter.replace(kind=kind) for parameter in own if parameter.name != without), *more]
    called.__signature__ = inspect.Signature(every)  # type: ignore[attr-defined]
    return called


def with_forms(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command that also takes `--json` and `--latex`."""

    @functools.wraps(command)
    def called(*, json: bool, latex: bool, **arguments: Any) -> None:
        if json and latex:
            raise ScenarioError("--json and --latex are mutually exclusive", code="option-invalid")
        command(**arguments)

    return with_options(command, called, json=(False, Json), latex=(False, Latex))


def _data_of(table: Table) -> dict[str, Any]:
    """Return a table as data: numbers in SI units where all of a column have the same."""
    columns = [{"heading": heading, "unit": table.unit(k)} for k, heading in enumerate(table.headings)]
    cells = [table.values(k) for k in range(len(table.columns))]
    return {
        "title": table.title,
        "columns": columns,
        "rows": [[*row] for row in zip(*cells, strict=True)],
        "notes": table.notes,
    }


def _plain(value: Any) -> Any:
    """Return a value as JSON-ready data; infinite numbers and NaN become null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [*map(_plain, value)]
    if isinstance(value, (bool, int, str)) or value is None:
        return value
    if isinstance(value, Path):
        return str(value)
    number = float(value)  # also of NumPy, and fractions
    return number if math.isfinite(number) else None


WIDTH = 140
"""Width of tables written to a file or a pipe, unless `COLUMNS` is set."""
NARROWEST = 20
"""Narrowest width of tables; a terminal that states less does not know its own."""
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


def save_figure(figure: Figure, wanted: Path | None, default: Path) -> None:
    """Save a figure as `.svg` and `.png` and print the paths; `wanted` may have either suffix, or none."""
    from yawbench.figures.style import save

    stem = wanted or default
    if stem.suffix.lower() in (".svg", ".png"):
        stem = stem.with_suffix("")
    svg, png = save(figure, stem)
    say(f"{svg}, {png.name}")


def print_tables(tables: Iterable[Table]) -> None:
    """Print tables to stdout for the width of `console`, or in the form that is asked for."""
    if form() != "text":
        collect(tables)
        return
    from yawbench.studies.tables import for_terminal

    screen = console()
    for table in tables:
        screen.print()
        screen.print(for_terminal(table), crop=False)


def console() -> Console:
    """Return stdout as a console as wide as `COLUMNS` says, or the terminal, or `WIDTH`."""
    from rich.console import Console

    columns, lines = shutil.get_terminal_size((WIDTH, 50))
    width = max(columns, NARROWEST)  # with a height, for rich to use it on every terminal
    return Console(highlight=False, markup=False, emoji=False, width=width, height=lines)

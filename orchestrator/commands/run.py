"""`yawbench run`: run a scenario."""

from __future__ import annotations

import contextlib
import os
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from ..messages import printable
from .options import CHANGES, MAKING, RunOptions, ScenarioFile, plan_of_scenario, takes
from .progress import say

if TYPE_CHECKING:
    from ..errors import Diagnostic

MetricsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--metric",
        metavar="NAME",
        help="Metric to print, such as 'peak(sideslip)' or 'peak(sideslip) from 1 s to 3 s'; "
        "'standard' prints the standard metrics. Repeatable.",
    ),
]

RunName = Annotated[
    str | None,
    typer.Option("--name", metavar="NAME", help="Name of the results folder, below results/."),
]

SHOWN = 5
"""Number of warnings shown; all are in run.json."""
BESIDE = 36
"""Columns of the terminal reserved for the bar and its numbers."""


@takes(*CHANGES, *MAKING, "format_", "no_validate")
def run(
    scenario: ScenarioFile, options: RunOptions, name: RunName = None, metric: MetricsOption = None
) -> None:
    """Run a scenario and write results.csv and run.json.

    Without --out and --name, results go to results/<folder of the scenario>/<its name>, with the overrides
    appended to the name. They replace those of an earlier run, but a failed run never replaces a
    completed one: its results go to failed/ in that folder.
    """
    from ..errors import ScenarioError, SimulationError
    from ..master.compiled_loop import slower_because
    from ..master.isolation import opener_of
    from ..master.log import STATUS, WARNING
    from ..master.simulate import simulate
    from ..messages import changed, with_changes
    from ..results.folder_and_lock import default_folder, refuse_below_others
    from ..results.formats_and_csv import size_note

    if options.out and name:
        raise ScenarioError("--out and --name are mutually exclusive", code="option-invalid")
    metrics = _metric_names(metric or ())
    plan = plan_of_scenario(scenario, options)
    if named := [name for name in metric or () if name != "standard"]:
        from ..metrics import run_metrics

        run_metrics.check_metrics(plan, map(run_metrics.metric, named))
    folder = options.out or default_folder(scenario, plan.changes, name=name)
    refuse_below_others(folder)
    for note in (*plan.diagnostics, size_note(plan, folder, options.format_)):
        if note:
            say(f"note: {note}")
    if options.limit is None and (why := slower_because()):
        say(f"note: {why}; stepping in Python, which is slower")
    if plan.changes:
        say(f"changed: {changed(plan.changes)}")
    title = with_changes(plan.title or scenario.stem, plan.changes)
    try:
        with _bar(title) as progress, opener_of(plan, options.limit) as opener:
            info = simulate(
                plan, folder, progress=progress, opener=opener, format=options.format_, apart=True
            )
    except SimulationError as error:
        _say_warnings(error.warnings)
        raise
    for message in info.warnings[:SHOWN]:
        grade = "" if message.status == WARNING else f"{STATUS[message.status]}: "
        text = " ".join(message.text.split())
        say(f"warning: {message.instance} at t = {message.time:.9g} s: {grade}{text}")
    if len(info.warnings) > SHOWN:
        say(f"warning: {len(info.warnings) - SHOWN} more, see {folder / 'run.json'}")
    if info.ended:
        say(f"ended: {info.ended}")
    _say_warnings(info.diagnostics)
    say(f"{folder}: {info.rows} rows of {info.columns} variables in {info.wall_time:.2f} s")
    if metrics:
        from ..experiments.tables import metrics_of_run
        from ..metrics.run_metrics import columns_for
        from ..results.read_and_salvage import load_results
        from .progress import print_tables

        needed = load_results(folder, only=lambda recorded: columns_for(recorded, metrics))
        print_tables([metrics_of_run(needed, metrics)])


def _say_warnings(diagnostics: Iterable[Diagnostic]) -> None:
    from ..errors import warnings_in

    for warning in warnings_in(diagnostics):
        say(f"note: {warning}")


def _metric_names(texts: Sequence[str]) -> list[str]:
    """Return the metrics given by `--metric`, each once."""
    if not texts:
        return []
    from ..metrics.run_metrics import STANDARD, metric

    names = [name for text in texts for name in (STANDARD if text == "standard" else [metric(text).name])]
    return list(dict.fromkeys(names))


@contextlib.contextmanager
def _bar(title: str) -> Iterator[Callable[[int, int], None] | None]:
    """Show a progress bar on a terminal while the block runs, and nothing elsewhere.

    It redraws only when the run reports progress: a bar with a thread of its own would take the interpreter
    lock away from the FMUs.
    """
    if not sys.stderr.isatty() or os.environ.get("TERM") == "dumb":
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, auto_refresh=False, transient=True) as bar:
        shown = textwrap.shorten(title, max(10, console.width - BESIDE), placeholder="…")
        task = bar.add_task(printable(shown).replace("[", r"\["), total=None)

        def report(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total, refresh=True)

        yield report

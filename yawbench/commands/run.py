"""`yawbench run`: one run of a scenario."""

from __future__ import annotations

import contextlib
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from yawbench.commands import output
from yawbench.foundation.errors import Diagnostic, ScenarioError, SimulationError, warnings_in
from yawbench.foundation.messages import printable

from .options import CHANGES, MAKING, RunOptions, ScenarioFile, plan_of_scenario, takes
from .output import print_tables, say, shows_bars, tabular

if TYPE_CHECKING:
    from yawbench.orchestrator.results.run_record import EventRecord


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


@tabular
@takes(*CHANGES, *MAKING, "format_", "no_validate")
def run(
    scenario: ScenarioFile, options: RunOptions, name: RunName = None, metric: MetricsOption = None
) -> None:
    """Run a scenario and write results.csv and run.json.

    Without --out and --name, results go to results/<folder of the scenario>/<its name>, with the overrides
    appended to the name. They replace those of an earlier run, but a failed run never replaces a
    completed one: its results go to failed/ in that folder.
    """
    from yawbench.events.kinds import RunWatch
    from yawbench.orchestrator.master.compiled_loop import slower_because
    from yawbench.orchestrator.master.isolation import opener_of
    from yawbench.orchestrator.master.log import STATUS, WARNING
    from yawbench.orchestrator.master.simulate import simulate
    from yawbench.orchestrator.results.file_formats import size_note
    from yawbench.orchestrator.results.folder_lock import refuse_below_others
    from yawbench.orchestrator.results.folder_names import default_folder
    from yawbench.orchestrator.scenario.overrides import changed, with_changes

    if options.out and name:
        raise ScenarioError("--out and --name are mutually exclusive", code="option-invalid")
    metrics = metric_names(metric or ())
    plan = plan_of_scenario(scenario, options)
    output.note(plan.diagnostics)
    if named := [name for name in metric or () if name != "standard"]:
        from yawbench.metrics import expressions

        expressions.check_metrics(plan, map(expressions.metric, named))
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
                plan,
                folder,
                progress=progress,
                opener=opener,
                watch=RunWatch(plan),
                format=options.format_,
                apart=True,
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
    _say_why(info.events)
    say(f"{folder}: {info.rows} rows of {info.columns} variables in {info.wall_time:.2f} s")
    output.answer(
        folder=folder, rows=info.rows, columns=info.columns, wall_time=info.wall_time, ended=info.ended
    )
    if metrics:
        from yawbench.metrics.expressions import columns_for, evaluate_all
        from yawbench.orchestrator.results.reader import load_results
        from yawbench.studies.listings import metrics_of_run

        needed = load_results(folder, only=lambda recorded: columns_for(recorded, metrics))
        print_tables([metrics_of_run(needed, metrics)])
        numbers = evaluate_all(needed, metrics)
        output.answer(
            metrics={name: {"value": value.number, "unit": value.unit} for name, value in numbers.items()}
        )


def _say_why(events: Sequence[EventRecord]) -> None:
    """Say why the car was lost, if it was; all events stand in run.json."""
    from yawbench.events.why import why

    reasons = why(events)
    output.answer(events=[event.model_dump(exclude_unset=True) for event in events], why=[*map(str, reasons)])
    if reasons:
        say(f"lost: {'; '.join(map(str, reasons))}")


def _say_warnings(diagnostics: Iterable[Diagnostic]) -> None:
    diagnostics = [*diagnostics]
    output.note(diagnostics)
    for warning in warnings_in(diagnostics):
        say(f"note: {warning}")


def metric_names(texts: Sequence[str]) -> list[str]:
    """Return the metrics given by `--metric`, each once."""
    if not texts:
        return []
    from yawbench.metrics.expressions import STANDARD, metric

    names = [name for text in texts for name in (STANDARD if text == "standard" else [metric(text).name])]
    return list(dict.fromkeys(names))


@contextlib.contextmanager
def _bar(title: str) -> Iterator[Callable[[int, int], None] | None]:
    """Show a progress bar on a terminal while the block runs, and nothing elsewhere.

    It redraws only when the run reports progress: a bar with a thread of its own would take the interpreter
    lock away from the FMUs.
    """
    if not shows_bars():
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

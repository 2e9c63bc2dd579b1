"""`yawbench run`: one run of a scenario."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from yawbench.commands import json_and_latex
from yawbench.foundation.errors import Diagnostic, ScenarioError, SimulationError, warnings_in
from yawbench.foundation.progress import bar

from .json_and_latex import tabular
from .options import CHANGES, MAKING, RunOptions, ScenarioFile, completing_names, plan_of_scenario, takes
from .output import print_tables
from .terminal_progress import say, shows_bars

if TYPE_CHECKING:
    from yawbench.orchestrator.master.log import Message
    from yawbench.orchestrator.master.simulate import Watch
    from yawbench.orchestrator.plan import Plan
    from yawbench.orchestrator.results.run_record import EventRecord


MetricsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--metric",
        metavar="NAME",
        autocompletion=completing_names("metrics"),
        help="Metric to print, such as 'peak(sideslip)' or 'peak(sideslip) from 1 s to 3 s'; "
        "'standard' prints the standard metrics. Repeatable.",
    ),
]

RunName = Annotated[
    str | None,
    typer.Option("--name", metavar="NAME", help="Name of the results folder, below results/."),
]

RecordOption = Annotated[
    list[str] | None,
    typer.Option(
        "--record",
        metavar="SIGNAL",
        help="Record only this of the scenario's signals: 'plant.yaw_rate', 'yaw_rate' or 'plant.*'. "
        "Repeatable.",
    ),
]
LiveOption = Annotated[
    bool,
    typer.Option("--live", help="Show curves on the terminal while it runs; without one, a line per second."),
]
PaceOption = Annotated[
    float | None,
    typer.Option(
        "--realtime", metavar="FACTOR", help="Simulated seconds per second: 1 is real time, 0.2 slow motion."
    ),
]
LogOption = Annotated[
    str | None,
    typer.Option(
        "--log",
        metavar="LEVEL[:CATEGORY]",
        help="Show the messages of the FMUs as they arrive: error, warning or info and worse, all or of "
        "categories ('info:logEvents,logStatusWarning'; `yawbench show` lists them).",
    ),
]

SHOWN = 5
"""Number of warnings shown; all are in run.json."""
THREADS = "OPENBLAS_NUM_THREADS"
"""Environment variable that the library of NumPy reads when it is loaded: its threads."""
FASTEST = 1e6
"""Largest pace [1]; chosen: no run is as fast."""


@tabular
@takes(*CHANGES, *MAKING, "format_", "no_validate")
def run(
    scenario: ScenarioFile,
    options: RunOptions,
    name: RunName = None,
    metric: MetricsOption = None,
    record: RecordOption = None,
    live: LiveOption = False,
    realtime: PaceOption = None,
    log: LogOption = None,
) -> None:
    """Run a scenario, or an FMU alone, and write results.csv and run.json.

    Without --out and --name, results go to results/<folder of the scenario>/<its name>, with the overrides
    appended to the name. They replace those of an earlier run, but a failed run never replaces a
    completed one: its results go to failed/ in that folder.
    """
    with _without_threads():
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
    if realtime is not None and not 0.0 < realtime < FASTEST:
        raise ScenarioError(
            f"--realtime: must be above 0 and below {FASTEST:g} (got {realtime:g})", code="option-invalid"
        )
    metrics = metric_names(metric or ())
    plan = plan_of_scenario(scenario, options, record or ())
    json_and_latex.note(plan.diagnostics)
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
        with (
            _seen(plan, live) as watch,
            _listening(log) as hear,
            bar(title, wanted=shows_bars() and not live, ticking=False) as shown,
            opener_of(plan, options.limit) as opener,
        ):
            info = simulate(
                plan,
                folder,
                progress=shown.update,
                opener=opener,
                watch=watch,
                format=options.format_,
                apart=True,
                pace=realtime,
                hear=hear,
            )
    except SimulationError as error:
        _say_warnings(error.warnings)
        raise
    for message in info.warnings[:SHOWN] if log is None else ():
        grade = "" if message.status == WARNING else f"{STATUS[message.status]}: "
        text = " ".join(message.text.split())
        say(f"warning: {message.instance} at t = {message.time:.9g} s: {grade}{text}")
    if log is None and len(info.warnings) > SHOWN:
        say(f"warning: {len(info.warnings) - SHOWN} more, see {folder / 'run.json'}")
    if info.ended:
        say(f"ended: {info.ended}")
    _say_warnings(info.diagnostics)
    _say_why(info.events)
    say(f"{folder}: {info.rows} rows of {info.columns} variables in {info.wall_time:.2f} s")
    json_and_latex.answer(
        folder=folder, rows=info.rows, columns=info.columns, wall_time=info.wall_time, ended=info.ended
    )
    if metrics:
        from yawbench.metrics.expressions import columns_for, evaluate_all
        from yawbench.orchestrator.results.reader import load_results
        from yawbench.studies.listings import metrics_of_run

        needed = load_results(folder, only=lambda recorded: columns_for(recorded, metrics))
        print_tables([metrics_of_run(needed, metrics)])
        numbers = evaluate_all(needed, metrics)
        json_and_latex.answer(
            metrics={name: {"value": value.number, "unit": value.unit} for name, value in numbers.items()}
        )


@contextlib.contextmanager
def _without_threads() -> Iterator[None]:
    """Have NumPy, if the block imports it, start no threads for products of large matrices.

    A run has none, and starting them takes a twentieth of the time of a short one. FMUs in Python share this
    NumPy, and whoever multiplies large matrices in one sets the variable, which is then left as it is.
    """
    if THREADS in os.environ:
        yield
        return
    os.environ[THREADS] = "1"
    try:
        yield
    finally:
        del os.environ[THREADS]


@contextlib.contextmanager
def _listening(wanted: str | None) -> Iterator[Callable[[Message], None] | None]:
    """Yield what prints the messages of the level and the categories of `--log`, None without it.

    Raises:
        ScenarioError: there is no such level.
    """
    from yawbench.orchestrator.master import log

    if wanted is None:
        yield None
        return
    levels = {"error": log.DISCARD, "warning": log.WARNING, "info": log.OK}
    level, _, names = wanted.partition(":")
    if level not in levels:
        raise ScenarioError(
            f"--log {wanted}: the level is error, warning or info, perhaps with categories: info:logEvents",
            code="option-invalid",
        )
    categories = {name.strip() for name in names.split(",") if name.strip()}

    def hear(message: Message) -> None:
        if message.status >= levels[level] and (not categories or message.category in categories):
            category = f" [{message.category}]" if message.category else ""
            where = f"{message.instance} at t = {message.time:.9g} s{category}"
            say(f"{log.STATUS[message.status]}: {where}: {' '.join(message.text.split())}")

    before = os.environ.get(log.EVERYTHING)
    os.environ[log.EVERYTHING] = level
    try:
        yield hear
    finally:
        os.environ.pop(log.EVERYTHING)
        os.environ |= {} if before is None else {log.EVERYTHING: before}


def _say_why(events: Sequence[EventRecord]) -> None:
    """Say why the car was lost, if it was; all events stand in run.json."""
    from yawbench.events.why import why

    reasons = why(events)
    told = [event.model_dump(exclude_unset=True) for event in events]
    json_and_latex.answer(events=told, why=[*map(str, reasons)])
    if reasons:
        say(f"lost: {'; '.join(map(str, reasons))}")


def _say_warnings(diagnostics: Iterable[Diagnostic]) -> None:
    diagnostics = [*diagnostics]
    json_and_latex.note(diagnostics)
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
def _seen(plan: Plan, live: bool) -> Iterator[Watch]:
    """Yield the observer of a run, which shows its curves if it is `live`."""
    from yawbench.events.kinds import RunWatch

    if not live:
        yield RunWatch(plan)
        return
    from .live import Live

    with Live(plan, terminal=shows_bars()) as shown:
        yield shown

"""`yawbench run`, `compare`, `converge` and `diff`: one run; other FMUs, smaller steps, two recorded runs."""

from __future__ import annotations

import contextlib
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from yawbench.commands import output
from yawbench.foundation.errors import Diagnostic, ScenarioError, SimulationError, warnings_in
from yawbench.foundation.messages import hint, listed, printable
from yawbench.orchestrator.coupling_algorithms import ALGORITHMS

from .experiments import chapter_of, command_of, conduct, data_of, say_page, write_page
from .options import CHANGES, MAKING, RunOptions, ScenarioFile, plan_of_scenario, pooled, takes
from .output import hold, print_tables, say, shows_bars, tabular
from .results import MeasuredFrom, MeasuredRuns, distinct, start_of, with_segments

if TYPE_CHECKING:
    from yawbench.figures.display import LabelledRun


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
    from yawbench.metrics.plausibility import PlausibilityWatch
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
    metrics = _metric_names(metric or ())
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
                watch=PlausibilityWatch(plan),
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


def _say_warnings(diagnostics: Iterable[Diagnostic]) -> None:

    diagnostics = [*diagnostics]
    output.note(diagnostics)
    for warning in warnings_in(diagnostics):
        say(f"note: {warning}")


def _metric_names(texts: Sequence[str]) -> list[str]:
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


Swaps = Annotated[
    list[str],
    typer.Option(
        "--swap",
        metavar="INSTANCE=FMU,FMU,...",
        help="FMUs to compare for an instance; a single FMU is compared with the scenario's. An FMU may "
        "bring parameters, FMU:PARAMETER=VALUE. Repeatable.",
    ),
]


@tabular
@takes("set_", "fault", *MAKING, "jobs", "format_", "fresh")
def compare(
    context: typer.Context,
    scenario: ScenarioFile,
    swap: Swaps,
    options: RunOptions,
    measured: MeasuredRuns = None,
    begin: MeasuredFrom = "0 s",
) -> None:
    """Compare runs of a scenario with different FMUs.

    Writes report.html: metrics side by side, the signals that differ most, when the runs diverge,
    overlays, and the system. Recordings of a car are shown beside them.

    Without --out, results go to results/<folder of the scenario>/<its name>-compare. A run that
    fails is reported; the other runs continue.
    """
    from dataclasses import replace

    from yawbench.orchestrator.results.folder_names import default_folder
    from yawbench.reports.comparison import comparison_view
    from yawbench.studies.comparison import comparison, comparison_table

    recordings = labelled_recordings(measured, begin)
    folder = options.out or default_folder(scenario, options.changes, suffix="-compare")
    hold(context, folder)
    each = pooled(context, options)
    findings = conduct(comparison(scenario, swap, options.changes), folder, options, each)
    print_tables([comparison_table(findings)])
    beside = {"measured": measured, "from": [begin]} if measured else {}
    command = command_of("compare", scenario, **options.changing | {"swap": swap} | beside)
    compared = comparison_view(findings)
    views = compared.views if compared else []
    chapter = chapter_of(findings, folder, command, views=views, measured=recordings)
    say_page(write_page(replace(chapter, comparison=compared), folder))
    output.answer(experiments=[data_of(findings, folder)])
    if findings.failed:
        raise typer.Exit(1)


def labelled_recordings(measured: Sequence[Path] | None, begin: str) -> list[LabelledRun]:
    """Return the segments of measurement files, as runs that begin at a time of theirs."""
    from yawbench.figures.display import LabelledRun
    from yawbench.orchestrator.results.measurement_results import load_run

    places, start = with_segments((), measured), start_of(begin)
    labels = distinct(places) if places else []
    return [
        LabelledRun(label, load_run(place, start=start)) for label, place in zip(labels, places, strict=True)
    ]


Halvings = Annotated[
    int,
    typer.Option("--halvings", metavar="N", min=2, max=10, help="Number of times the step size is halved."),
]
Signal = Annotated[str, typer.Option("--signal", metavar="INSTANCE.VARIABLE", help="Signal to compare.")]
Algorithms = Annotated[
    list[str] | None,
    typer.Option(
        "--algorithm",
        metavar="NAME",
        help=f"{listed(ALGORITHMS, last='or')}; repeatable: all are compared with the first. "
        "Default: the scenario's.",
    ),
]


@tabular
@takes(*CHANGES, *MAKING)
def converge(
    context: typer.Context,
    scenario: ScenarioFile,
    options: RunOptions,
    halvings: Halvings = 3,
    signal: Signal = "plant.yaw_rate",
    algorithm: Algorithms = None,
) -> None:
    """Halve the step size repeatedly; show error and order.

    Errors are relative to the finest run. Instances with their own step size keep it. Runs are made one
    after the other, so that their wall times can be compared. Without --out, results go to
    results/<folder of the scenario>/<its name>-converge.
    """
    from dataclasses import replace

    from yawbench.figures.style import save
    from yawbench.foundation.safe_files import write_whole
    from yawbench.orchestrator.results.folder_names import default_folder
    from yawbench.reports.page_parts import image_of
    from yawbench.studies.convergence import (
        columns_of,
        convergence_figure,
        convergence_table,
        measure,
        refinements,
    )
    from yawbench.studies.tables import to_csv
    from yawbench.vocabulary.motion import ANGLES, SPEED_SIGNALS

    for name in algorithm or ():
        if name not in ALGORITHMS:
            guess = hint(name, ALGORITHMS, lead="there are")
            raise ScenarioError(f"--algorithm {name}: unknown algorithm{guess}", code="algorithm-unknown")
    folder = options.out or default_folder(scenario, options.changes, suffix="-converge")
    hold(context, folder)
    options = replace(options, jobs=1, fresh=True)
    each = pooled(context, options)
    experiment = refinements(
        scenario,
        halvings=halvings,
        signal=signal,
        algorithms=algorithm or (),
        changes=options.changes,
    )
    moving = [f"{name}*" for name in SPEED_SIGNALS if signal.rpartition(".")[2] in ANGLES]
    findings = conduct(experiment, folder, options, each, record=(signal, *moving))
    rows = measure(findings, signal)
    table = convergence_table(rows, experiment.spec.title)
    write_whole(folder / "converge.csv", to_csv(columns_of(rows)))
    print_tables([table])
    command = command_of(
        "converge",
        scenario,
        halvings=[halvings],
        signal=[signal],
        algorithm=algorithm,
        **options.changing,
    )
    charts = []
    if any(row.error for row in rows):
        note = f"yawbench converge {scenario} · instances with their own step size keep it"
        figure = convergence_figure(rows, signal, experiment.spec.title, note)
        save(figure, folder / "converge")
        charts = [image_of(folder / "converge.svg", experiment.spec.title)]
    chapter = chapter_of(findings, folder, command)
    say_page(write_page(replace(chapter, results=[table], charts=charts), folder))
    if any(row.failed for row in rows):
        raise typer.Exit(1)


FirstRun = Annotated[Path, typer.Argument(help="Results folder, or measurement file.", metavar="RUN")]
SecondRun = Annotated[
    Path, typer.Argument(help="Results folder or measurement file to compare with.", metavar="RUN")
]


@tabular
def diff(first_run: FirstRun, second_run: SecondRun, begin: MeasuredFrom = "0 s") -> None:
    """Show the differences between two runs.

    First the inputs: scenario, parameters, FMUs, connections, program versions. Then the results, signal
    by signal: when they start to differ, when the difference becomes visible (1 % of the signal's
    largest value), and the largest difference. The filter of a measurement acts on the other run, too, which
    is interpolated to the times of the measurement. Exit status 1 if nothing could be compared.
    """
    from yawbench.reports.divergence import divergence, outcome_table
    from yawbench.reports.record_differences import differences, differences_table

    from .results import distinct, read_runs, start_of

    first, second = read_runs([first_run, second_run], start_of(begin))
    inputs, parted = differences(first.record, second.record), divergence(first, second)
    output.answer(
        identical=not (inputs or parted.partings or parted.notes or parted.compares_nothing),
        compared={"signals": parted.compared, "times": parted.times},
        inputs=[{"name": name, "first": ours, "second": theirs} for name, ours, theirs in inputs],
        signals=[
            {
                "signal": parting.signal,
                "unit": parting.unit,
                "from": parting.first,
                "visibly_from": parting.seen,
                "largest": parting.largest,
                "largest_at": parting.largest_at,
            }
            for parting in parted.partings
        ],
    )
    if inputs:
        print_tables([differences_table(inputs, *distinct([first_run, second_run]))])
    if parted.partings or parted.notes or parted.compares_nothing:
        print_tables([outcome_table(parted, first, second)])
    if parted.compares_nothing:
        say(f"{first_run}, {second_run}: nothing could be compared")
        raise typer.Exit(1)
    if not (inputs or parted.partings or parted.notes):
        say("The runs are identical: same inputs, same numbers.")

"""`yawbench compare`: runs of a scenario with different FMUs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from yawbench.commands import json_and_latex
from yawbench.commands.experiments import chapter_of, command_of, conduct, data_of, say_page, write_page
from yawbench.commands.json_and_latex import tabular
from yawbench.commands.options import (
    MAKING,
    RunOptions,
    ScenarioFile,
    pooled,
    takes,
)
from yawbench.commands.output import print_tables
from yawbench.commands.recorded_runs import (
    Labels,
    MeasuredFrom,
    MeasuredRuns,
    distinct,
    start_of,
    with_segments,
)
from yawbench.commands.run import MetricsOption, metric_names
from yawbench.commands.terminal_progress import hold

if TYPE_CHECKING:
    from yawbench.figures.display import LabelledRun


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
@takes("vehicle", "set_", "fault", *MAKING, "jobs", "format_", "fresh")
def compare(
    context: typer.Context,
    scenario: ScenarioFile,
    swap: Swaps,
    options: RunOptions,
    metric: MetricsOption = None,
    label: Labels = None,
    measured: MeasuredRuns = None,
    begin: MeasuredFrom = "0 s",
) -> None:
    """Compare runs of a scenario with different FMUs.

    Writes report.html: metrics side by side, the signals that differ most, when the runs diverge,
    overlays, and the system. Recordings of a car are shown beside them.

    Without --out, results go to results/<folder of the scenario>/<its name>-compare. A run that
    fails is reported; the other runs continue.
    """
    from yawbench.orchestrator.results.folder_names import default_folder
    from yawbench.reports.comparison_page import comparison_view
    from yawbench.studies.comparison import comparison, comparison_table

    recordings = labelled_recordings(measured, begin)
    folder = options.out or default_folder(scenario, options.changes, suffix="-compare")
    hold(context, folder)
    each = pooled(context, options)
    compared_runs = comparison(
        scenario, swap, options.changes, labels=label or (), metrics=metric_names(metric or ())
    )
    findings = conduct(compared_runs, folder, options, each)
    print_tables([comparison_table(findings)])
    beside: dict[str, Any] = {"metric": metric, "label": label}
    beside |= {"measured": measured, "from": [begin]} if measured else {}
    command = command_of("compare", scenario, **options.changing | {"swap": swap} | beside)
    compared = comparison_view(findings)
    views = compared.views if compared else []
    chapter = chapter_of(findings, folder, command, views=views, measured=recordings, comparison=compared)
    say_page(write_page(chapter, folder))
    json_and_latex.answer(experiments=[data_of(findings, folder)])
    if findings.failed:
        raise typer.Exit(1)


def labelled_recordings(measured: Sequence[Path] | None, begin: str) -> list[LabelledRun]:
    """Return the segments of measurement files, as runs that begin at a time of theirs."""
    from yawbench.figures.display import LabelledRun
    from yawbench.measurements.measured_results import load_run

    places, start = with_segments((), measured), start_of(begin)
    labels = distinct(places) if places else []
    return [
        LabelledRun(label, load_run(place, start=start)) for label, place in zip(labels, places, strict=True)
    ]

"""`yawbench converge`: error and order of a scenario as its step is halved."""

from __future__ import annotations

from typing import Annotated

import typer

from yawbench.commands.experiments import chapter_of, command_of, conduct, say_page, write_page
from yawbench.commands.json_and_latex import tabular
from yawbench.commands.options import (
    CHANGES,
    MAKING,
    RunOptions,
    ScenarioFile,
    pooled,
    takes,
)
from yawbench.commands.output import print_tables
from yawbench.commands.terminal_progress import hold
from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import hint, listed
from yawbench.orchestrator.coupling_algorithms import ALGORITHMS

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
    table = convergence_table(rows, experiment.title)
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
        figure = convergence_figure(rows, signal, experiment.title, note)
        save(figure, folder / "converge")
        charts = [image_of(folder / "converge.svg", experiment.title)]
    say_page(write_page(chapter_of(findings, folder, command, results=[table], charts=charts), folder))
    if any(row.failed for row in rows):
        raise typer.Exit(1)

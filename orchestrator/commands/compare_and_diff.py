"""`yawbench compare`, `converge` and `diff`: other FMUs, smaller steps, two recorded runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..coupling import ALGORITHMS
from ..messages import hint, listed
from .experiments import chapter_of, command_of, conduct, write_page
from .options import CHANGES, MAKING, RunOptions, ScenarioFile, takes
from .progress import hold, pooled, print_tables, say

Swaps = Annotated[
    list[str],
    typer.Option(
        "--swap",
        metavar="UNIT=FMU,FMU,...",
        help="FMUs to compare for a unit; a single FMU is compared with the scenario's. An FMU may bring "
        "parameters, FMU:PARAMETER=VALUE. Repeatable.",
    ),
]


@takes("set_", "fault", *MAKING, "jobs", "format_", "fresh")
def compare(context: typer.Context, scenario: ScenarioFile, swap: Swaps, options: RunOptions) -> None:
    """Run a scenario with several FMUs for a unit and compare.

    Writes report.html: metrics side by side, the signals that differ most, when the runs diverge,
    overlays, and the system.

    Without --out, results go to results/<folder of the scenario>/<its name>-compare. A run that
    fails is reported; the other runs continue.
    """
    from ..experiments.comparison import comparison, comparison_table
    from ..pages.comparison import comparison_facts
    from ..results.folder_and_lock import default_folder

    folder = options.out or default_folder(scenario, options.changes, suffix="-compare")
    hold(context, folder)
    each = pooled(context, options)
    findings = conduct(comparison(scenario, swap, options.changes), folder, options, each)
    print_tables([comparison_table(findings)])
    command = command_of("compare", scenario, **options.changing | {"swap": swap})
    facts = comparison_facts(findings)
    views = facts["views"] if facts else []
    chapter = chapter_of(findings, folder, command, shown_in=folder, views=views, comparison=facts)
    write_page([chapter], folder)
    if findings.failed:
        raise typer.Exit(1)


Halvings = Annotated[
    int,
    typer.Option("--halvings", metavar="N", min=2, max=10, help="Number of times the step size is halved."),
]
Signal = Annotated[str, typer.Option("--signal", metavar="UNIT.VARIABLE", help="Signal to compare.")]
Algorithms = Annotated[
    list[str] | None,
    typer.Option(
        "--algorithm",
        metavar="NAME",
        help=f"{listed(ALGORITHMS, last='or')}; repeatable: all are compared with the first. "
        "Default: the scenario's.",
    ),
]


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

    Errors are relative to the finest run. Units with their own step size keep it. Runs are made one
    after the other, so that their wall times can be compared. Without --out, results go to
    results/<folder of the scenario>/<its name>-converge.
    """
    from dataclasses import replace

    from ..errors import ScenarioError
    from ..experiments.comparison import (
        columns_of,
        convergence_figure,
        convergence_table,
        measure,
        refinements,
    )
    from ..experiments.tables import to_csv
    from ..figures.style import save
    from ..files import write_whole
    from ..pages.page_parts import image_of
    from ..results.folder_and_lock import default_folder

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
    findings = conduct(experiment, folder, options, each, record=(signal,))
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
        note = f"yawbench converge {scenario} · units with their own step size keep it"
        figure = convergence_figure(rows, signal, experiment.spec.title, note)
        save(figure, folder / "converge")
        charts = [image_of(folder / "converge.svg", experiment.spec.title)]
    facts: dict[str, Any] = {"results": [table], "charts": charts}
    write_page([chapter_of(findings, folder, command, shown_in=folder, **facts)], folder)
    if any(row.failed for row in rows):
        raise typer.Exit(1)


One = Annotated[Path, typer.Argument(help="Results folder.", metavar="RUN")]
Other = Annotated[Path, typer.Argument(help="Results folder to compare it with.", metavar="RUN")]


def diff(one: One, other: Other) -> None:
    """Show what differs between two runs.

    First the inputs: scenario, parameters, FMUs, connections, program versions. Then the results, signal
    by signal: when they start to differ, when the difference becomes visible (1 % of the signal's
    largest value), and the largest difference.
    """
    from ..pages.comparison import differences, differences_table, divergence, partings_table
    from ..results.read_and_salvage import load_results
    from .results import distinct

    first, second = load_results(one), load_results(other)
    found, parted = differences(first.record, second.record), divergence(first, second)
    if found:
        print_tables([differences_table(found, *distinct([one, other]))])
    if parted.partings or parted.notes:
        print_tables([partings_table(parted, first, second)])
    if not (found or parted.partings or parted.notes):
        say("The runs are identical: same inputs, same numbers.")

"""`yawbench compare`: one scenario with several FMUs for a unit."""

from __future__ import annotations

from typing import Annotated

import typer

from .batch import hold, pooled, print_tables
from .experiment import chapter_of, command_of, conduct, write_page
from .options import MAKING, ScenarioFile, Wishes, takes

Swaps = Annotated[
    list[str],
    typer.Option(
        "--swap",
        metavar="UNIT=FMU,FMU,...",
        help="FMUs to compare for a unit; one alone is compared with the scenario's own. An FMU may bring "
        "parameters, FMU:PARAMETER=VALUE. Repeatable.",
    ),
]


@takes("set_", "fault", *MAKING, "jobs", "format_", "fresh")
def compare(context: typer.Context, scenario: ScenarioFile, swap: Swaps, wishes: Wishes) -> None:
    """Run a scenario with several FMUs for a unit.

    report.html, which needs no server, begins with what the runs come to, side by side, and the signals
    that differ most; then where the runs part, overlays, the system.

    Without --out, results go to results/<folder of the scenario>/<its name>-compare. A run that
    fails is named and takes no other with it.
    """
    from ..experiments.compare import comparison, comparison_table
    from ..pages.comparison import comparison_facts
    from ..results.naming import default_folder

    folder = wishes.out or default_folder(scenario, wishes.changes, suffix="-compare")
    hold(context, folder)
    each = pooled(context, wishes)
    findings = conduct(comparison(scenario, swap, wishes.changes), folder, wishes, each)
    print_tables([comparison_table(findings)])
    command = command_of("compare", scenario, **wishes.changing | {"swap": swap})
    facts = {"comparison": comparison_facts(findings)}
    write_page([chapter_of(findings, folder, command, each, shown_in=folder, **facts)], folder)
    if findings.failed:
        raise typer.Exit(1)

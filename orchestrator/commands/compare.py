"""`yawbench compare`: one scenario with several FMUs for a unit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .batch import Jobs, hold, print_tables
from .experiment import Wishes, chapter_of, command_of, conduct, write_page
from .options import (
    CallLimit,
    Fault,
    Fmus,
    Format,
    Fresh,
    Isolate,
    NoBuild,
    Out,
    ScenarioFile,
    Set,
    isolation,
)

Swaps = Annotated[
    list[str],
    typer.Option(
        "--swap",
        metavar="UNIT=FMU,FMU,...",
        help="FMUs to compare for a unit; one alone is compared with the scenario's own. An FMU may bring "
        "parameters, FMU:PARAMETER=VALUE. Repeatable.",
    ),
]


def compare(
    context: typer.Context,
    scenario: ScenarioFile,
    swap: Swaps,
    set_: Set = None,
    fault: Fault = None,
    out: Out = None,
    fmus: Fmus = None,
    no_build: NoBuild = False,
    jobs: Jobs = None,
    format_: Format = "csv",
    fresh: Fresh = False,
    isolate: Isolate = False,
    call_limit: CallLimit = None,
) -> None:
    """Run a scenario with several FMUs for a unit.

    report.html, which needs no server, begins with what the runs come to, side by side, and the signals
    that differ most; then where the runs part, overlays, the system.

    Without --out, results go to results/<folder of the scenario>/<its name>-compare. A run that
    fails is named and takes no other with it.
    """
    from ..experiments.compare import comparison, comparison_table
    from ..pages.comparison import comparison_facts
    from ..results.formats import check_format
    from ..results.naming import default_folder
    from ..scenario.overrides import read_changes

    for_each = read_changes(settings=set_ or (), faults=fault or ())
    folder: Path = out or default_folder(scenario, for_each, suffix="-compare")
    check_format(format_)
    hold(context, folder)
    wishes = Wishes(fmus, not no_build, jobs, None, format_, isolation(isolate, call_limit), fresh=fresh)
    findings = conduct(comparison(scenario, swap, for_each), folder, wishes)
    print_tables([comparison_table(findings)])
    command = command_of("compare", scenario, swap=swap, set=set_, fault=fault)
    facts = {"comparison": comparison_facts(findings)}
    write_page([chapter_of(findings, folder, command, shown_in=folder, **facts)], folder)
    if findings.failed:
        raise typer.Exit(1)

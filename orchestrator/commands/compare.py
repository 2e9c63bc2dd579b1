"""`yawbench compare`: one scenario with several FMUs for a unit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .batch import Jobs
from .options import CallLimit, Fmus, Format, Isolate, NoBuild, Out, ScenarioFile, Set, isolation

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
    out: Out = None,
    fmus: Fmus = None,
    no_build: NoBuild = False,
    jobs: Jobs = None,
    format_: Format = "csv",
    isolate: Isolate = False,
    call_limit: CallLimit = None,
) -> None:
    """Run a scenario with several FMUs for a unit.

    Overlays, metrics side by side and where the runs part stand in one page, compare.html, that
    needs no server.

    Without --out, results go to results/<folder of the scenario>/<its name>-compare. A run that
    fails is named and takes no other with it.
    """
    import shlex
    from dataclasses import replace

    from ..pages.compare_page import write_page
    from ..results.formats import check_format
    from ..results.naming import default_folder
    from ..scenario.overrides import read_changes
    from ..studies.compare import judge_comparison, metric_table, variants, write_comparison
    from ..titles import changed, changes_in, changes_of_all
    from .batch import hold, print_tables, run_all, say

    for_each = read_changes(settings=set_ or ())
    folder: Path = out or default_folder(scenario, for_each, suffix="-compare")
    check_format(format_)
    hold(context, folder)
    limit = isolation(isolate, call_limit)
    made = variants(scenario, swap, for_each, folder, fmus)
    work = [replace(job, format=format_, call_limit=limit) for job in made]
    outcomes = run_all(work, folder, workers=jobs, build=not no_build)
    comparison = judge_comparison(outcomes)
    for_all = changes_of_all([changes_in(run.results.run) for run in comparison.runs])
    title = str(comparison.runs[0].results.run.get("title") or "") if comparison.runs else ""
    exchanged = " and ".join(dict.fromkeys(text.partition("=")[0].strip() for text in swap))
    said = changed(for_all)
    table = metric_table(comparison, f"{title or scenario.stem} ({exchanged} exchanged)", said)
    files = write_comparison(comparison, table, folder, said)
    print_tables([table])
    given = [
        part
        for option, values in (("--swap", swap), ("--set", set_ or ()))
        for v in values
        for part in (option, v)
    ]
    command = shlex.join(["yawbench", "compare", str(scenario), *given])
    page = write_page(comparison, work, folder, title=table.title, changed=said, command=command)
    say(f"{folder}: {', '.join(files)}")
    say(f"The page: {page}")
    if comparison.failed:
        raise typer.Exit(max(outcome.exit_status for outcome in outcomes) or 1)

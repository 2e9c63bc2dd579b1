"""`yawbench converge`: the same scenario at h, h/2, h/4, ..."""

from __future__ import annotations

from typing import Annotated

import typer

from ..plan import Algorithm
from .options import CallLimit, Fmus, Isolate, NoBuild, Out, ScenarioFile, Set, Swap, isolation

Halvings = Annotated[
    int, typer.Option("--halvings", metavar="N", min=2, max=10, help="How often the step is halved.")
]
Signal = Annotated[str, typer.Option("--signal", metavar="UNIT.VARIABLE", help="What is compared.")]
Algorithms = Annotated[
    list[str] | None,
    typer.Option(
        "--algorithm",
        metavar="NAME",
        help="jacobi, gauss_seidel or extrapolated; repeatable, all are compared with the first. "
        "Default: the scenario's.",
    ),
]


def converge(
    context: typer.Context,
    scenario: ScenarioFile,
    halvings: Halvings = 3,
    signal: Signal = "plant.yaw_rate",
    algorithm: Algorithms = None,
    swap: Swap = None,
    set_: Set = None,
    out: Out = None,
    fmus: Fmus = None,
    no_build: NoBuild = False,
    isolate: Isolate = False,
    call_limit: CallLimit = None,
) -> None:
    """Halve the step size again and again; show error and order.

    The error is that against the finest run. Units with a step size of their own keep it. Runs
    follow each other, so that their wall times can be compared. Without --out, results go to
    results/<folder of the scenario>/<its name>-converge.
    """
    from dataclasses import replace
    from typing import get_args

    from ..errors import ScenarioError
    from ..figures.style import save
    from ..results.naming import default_folder
    from ..scenario.overrides import read_changes
    from ..studies.converge import convergence_figure, convergence_table, measure, refinements, write_rows
    from ..studies.tables import for_markdown, harmless
    from ..titles import with_changes
    from ..wording import hint
    from ..writing import write_whole
    from .batch import hold, print_tables, run_all, say

    for name in algorithm or ():
        if name not in get_args(Algorithm):
            guess = hint(name, get_args(Algorithm), lead="there are")
            raise ScenarioError(f"--algorithm {name}: no such algorithm{guess}")
    limit = isolation(isolate, call_limit)
    given = read_changes(swap or (), set_ or ())
    folder = out or default_folder(scenario, given, suffix="-converge")
    hold(context, folder)
    work = refinements(
        scenario,
        halvings=halvings,
        signal=signal,
        algorithms=algorithm or (),  # type: ignore[arg-type]
        out=folder,
        changes=given,
        fmus=fmus,
    )
    isolated = [replace(job, call_limit=limit) for job in work]
    outcomes = run_all(isolated, folder, workers=1, build=not no_build)
    rows = measure(outcomes, signal)
    title = with_changes(f"Convergence of {signal}, {scenario.stem}", given)
    table = convergence_table(rows, title)
    write_rows(rows, folder / "converge.csv")
    write_whole(folder / "converge.md", harmless(for_markdown(table)))
    print_tables([table])
    files = ["converge.csv", "converge.md"]
    if any(row.error for row in rows):
        note = f"yawbench converge {scenario} · units with a step size of their own keep it"
        figure = convergence_figure(rows, signal, title, note)
        files += [path.name for path in save(figure, folder / "converge")]
    say(f"{folder}: {', '.join(files)}")
    if any(row.failed for row in rows):
        raise typer.Exit(1)

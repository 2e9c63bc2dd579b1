"""`yawbench diff`: the differences between two runs, or between two studies."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from yawbench.commands import json_and_latex
from yawbench.commands.json_and_latex import tabular
from yawbench.commands.output import print_tables
from yawbench.commands.recorded_runs import MeasuredFrom
from yawbench.commands.terminal_progress import say
from yawbench.foundation.messages import counted

FirstRun = Annotated[Path, typer.Argument(help="Results folder, or measurement file.", metavar="RUN")]
SecondRun = Annotated[
    Path, typer.Argument(help="Results folder or measurement file to compare with.", metavar="RUN")
]


@tabular
def diff(first_run: FirstRun, second_run: SecondRun, begin: MeasuredFrom = "0 s") -> None:
    """Show the differences between two runs, or between the results of two studies or sweeps.

    Of studies: claims whose verdict changed, runs that one alone has or that failed in one alone, numbers
    by how much, the largest first. Of runs, first the inputs: scenario, parameters, FMUs, connections,
    program versions. Then the results, signal by signal: when they start to differ, when the difference
    becomes visible (1 % of the signal's largest value), and the largest difference. The filter of a
    measurement acts on the other run, too, which is interpolated to the times of the measurement. Exit
    status 1 if nothing could be compared.
    """
    from yawbench.studies.differences import is_experiment

    if is_experiment(first_run) and is_experiment(second_run):
        _of_studies(first_run, second_run)
        return
    from yawbench.reports.divergence import divergence, outcome_table
    from yawbench.reports.record_differences import differences, differences_table

    from .recorded_runs import distinct, read_runs, start_of

    first, second = read_runs([first_run, second_run], start_of(begin))
    inputs, parted = differences(first.record, second.record), divergence(first, second)
    json_and_latex.answer(
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


def _of_studies(first: Path, second: Path) -> None:
    """Show what differs between the results of two studies or sweeps."""
    from yawbench.studies.differences import difference_tables, differences, recorded_in

    from .recorded_runs import distinct

    found = differences(recorded_in(first), recorded_in(second))
    json_and_latex.answer(**found.as_data())
    print_tables(difference_tables(found, *distinct([first, second])))
    if found.compares_nothing:
        say(f"{first}, {second}: nothing could be compared")
        raise typer.Exit(1)
    if found.none:
        say(
            f"The results are identical: {counted(found.judged, 'verdict')}, "
            f"{counted(found.compared, 'number')}."
        )
    elif not found.numbers:
        say(f"{counted(found.compared, 'number')}: all the same")

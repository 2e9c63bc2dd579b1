"""`yawbench diff`: the differences between two runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from yawbench.commands import output
from yawbench.commands.output import print_tables, say, tabular
from yawbench.commands.recorded_runs import MeasuredFrom

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

    from .recorded_runs import distinct, read_runs, start_of

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

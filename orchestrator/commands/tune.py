"""`yawbench tune`: the parameters of one or several laws, sought by one objective and one budget."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .batch import hold, pooled, print_tables
from .experiment import chapter_of, command_of, conduct, write_page
from .options import CHANGES, MAKING, Wishes, named, takes

if TYPE_CHECKING:
    from ..experiments.experiment import Experiment
    from ..experiments.findings import Findings

TuningFile = Annotated[
    Path, named("a tuning file", help="Tuning: YAML file, or a name in scenarios/.", metavar="TUNING")
]


@takes(*CHANGES, *MAKING, "jobs", "scheduler", "fresh")
def tune(context: typer.Context, file: TuningFile, wishes: Wishes) -> None:
    """Seek the parameters that minimize an objective.

    Every law of the file has the same objective, search (differential evolution) and budget. Without
    --out, results go to results/<folder of the tuning file>/<its name>: report.html; trials.csv, one row per
    trial; the history as a figure; where the file asks for it, entries.yaml for a ranking. An interrupted
    search goes on where it was; with the same seed, and whatever the number of workers, it finds the same.
    """
    from dataclasses import replace

    from ..experiments.experiment import load_experiment
    from ..experiments.table import to_csv
    from ..experiments.tuning import (
        ENTRIES,
        best_of,
        columns_of,
        entries_of,
        entries_text,
        history_figure,
        search,
        tuning_of,
        tuning_table,
    )
    from ..figures.style import save
    from ..pages.panel_images import image_of
    from ..results.naming import default_folder
    from ..writing import write_whole

    experiment = load_experiment(file, changes=wishes.changes)
    folder = wishes.out or default_folder(file, wishes.changes)
    hold(context, folder)
    each = pooled(context, wishes)

    def judged(trials: Experiment) -> Findings:
        nonlocal wishes
        findings = conduct(trials, folder, wishes, each)
        wishes = replace(wishes, fresh=False)
        return findings

    found = search(experiment, judged)
    findings = judged(best_of(experiment, found))
    table = tuning_table(experiment, found)
    write_whole(folder / "trials.csv", to_csv(columns_of(found)))
    print_tables([table])
    command = command_of("tune", file, **wishes.changing)
    if tuning_of(experiment).entries:
        write_whole(folder / ENTRIES, entries_text(entries_of(experiment, found), command))
    save(history_figure(experiment, found, command), folder / "history")
    charts = [image_of(folder / "history.svg", experiment.spec.title)]
    facts = {"results": [table], "charts": charts}
    write_page([chapter_of(findings, folder, command, each, shown_in=folder, **facts)], folder)

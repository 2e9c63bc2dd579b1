"""`yawbench tune`: parameters that minimize an objective."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from yawbench.commands import json_and_latex
from yawbench.commands.experiments import (
    chapter_of,
    command_of,
    concluded,
    data_of,
    print_forecasts,
    say_page,
    say_problems,
    write_page,
)
from yawbench.commands.json_and_latex import tabular
from yawbench.commands.options import CHANGES, MAKING, RunOptions, executor_of, named, pooled, takes
from yawbench.commands.output import print_tables
from yawbench.commands.terminal_progress import hold, stoppable
from yawbench.foundation import plugins

if TYPE_CHECKING:
    from yawbench.studies.experiment import LoadedExperiment
    from yawbench.studies.experiment_result import ExperimentResult

TuningFile = Annotated[
    Path, named("a tuning file", help="Tuning: YAML file, or a name in scenarios/.", metavar="TUNING")
]
TuningSeed = Annotated[
    int | None, typer.Option("--seed", min=0, help="Seed of the search, in place of the file's.", metavar="N")
]


@tabular
@takes(*CHANGES, *MAKING, "jobs", "scheduler", "fresh", "dry_run")
def tune(context: typer.Context, file: TuningFile, options: RunOptions, seed: TuningSeed = None) -> None:
    """Find the parameters that minimize an objective.

    All control laws of the file have the same objective, search (differential evolution) and budget. Without
    --out, results go to results/<folder of the tuning file>/<its name>: report.html; trials.csv, one row per
    trial; the history as a figure; if the file asks for it, entries.yaml for a ranking. An interrupted
    search is resumed; the same seed gives the same result with any number of workers. The results of --seed
    go to a folder of their own, seed_N.
    """
    from yawbench.figures.style import save
    from yawbench.foundation.safe_files import write_whole
    from yawbench.orchestrator.results.folder_names import default_folder
    from yawbench.reports.page_parts import image_of
    from yawbench.studies.load_experiment import load_experiment
    from yawbench.studies.tables import to_csv
    from yawbench.studies.tuning import (
        best_of,
        columns_of,
        history_figure,
        search,
        tuning_of,
        tuning_table,
        with_seed,
    )

    experiment = load_experiment(file, changes=options.changes)
    folder = options.out or default_folder(file, options.changes)
    if seed is not None:
        experiment = with_seed(experiment, seed)
        folder = options.out or folder / f"seed_{seed}"
    if options.dry_run:
        from yawbench.studies.dry_run import of_tuning

        execute = executor_of(folder, experiment.identity, options)
        print_forecasts(options, lambda pace: [of_tuning(experiment, execute, pace)])
        return
    hold(context, folder)
    each = pooled(context, options)

    with stoppable(folder), executor_of(folder, experiment.identity, options, each) as execute:

        def judged(trials: LoadedExperiment) -> ExperimentResult:
            findings = execute(trials, keep=options.keep)
            say_problems(findings)
            return findings

        tuned = search(experiment, judged)
        findings = concluded(best_of(experiment, tuned), execute, options)
    table = tuning_table(experiment, tuned)
    write_whole(folder / "trials.csv", to_csv(columns_of(tuned)))
    print_tables([table])
    command = command_of("tune", file, **options.changing, seed=None if seed is None else [seed])
    if tuning_of(experiment).entries:
        plugins.require("use of a tuning", "entries")(experiment, tuned, folder, command)
    save(history_figure(experiment, tuned, command), folder / "history")
    charts = [image_of(folder / "history.svg", experiment.spec.title)]
    say_page(write_page(chapter_of(findings, folder, command, results=[table], charts=charts), folder))
    json_and_latex.answer(experiments=[data_of(findings, folder)])

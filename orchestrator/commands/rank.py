"""`yawbench rank`: drive controllers through conditions and rank them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .experiments import command_of
from .options import MAKING, RunOptions, named, takes
from .progress import executor_of, hold, pooled, print_tables, say, stoppable

if TYPE_CHECKING:
    from ..experiments.outcome import Each
    from ..experiments.ranking import EntrySpec
    from ..experiments.ranking_scores import RankingResult

RankingFile = Annotated[
    Path, named("a ranking file", help="Ranking: YAML file, or a name in scenarios/.", metavar="RANKING")
]
Controller = Annotated[
    list[str] | None,
    typer.Option(
        "--controller",
        metavar="FMU",
        help="Another controller to rank: path of its FMU, optionally with parameters, "
        "my.fmu:gain=3. Repeatable.",
    ),
]
Only = Annotated[
    list[str] | None,
    typer.Option("--only", metavar="ENTRY", help="Run only this entry. Repeatable."),
]
ConditionOption = Annotated[
    list[str] | None,
    typer.Option("--condition", metavar="NAME", help="Run only this condition. Repeatable."),
]
Quick = Annotated[
    bool,
    typer.Option("--quick", help="Run only the last amplitude of a few conditions, as a trial (minutes)."),
]


@takes(*MAKING, "jobs", "scheduler", "fresh", "no_run")
def rank(
    context: typer.Context,
    options: RunOptions,
    file: RankingFile = Path("proving_ground/ranking"),
    controller: Controller = None,
    only: Only = None,
    condition: ConditionOption = None,
    quick: Quick = False,
) -> None:
    """Rank controllers by sine with dwell.

    Start reading at report.html. Without --out, results go to results/<folder of the ranking>/<its name>.
    Runs already made from the same scenario, FMUs and program version are not repeated, so an interrupted
    ranking is resumed. Entries with missing runs are not ranked.
    """
    from ..errors import ScenarioError
    from ..experiments.ranking import load_ranking
    from ..experiments.ranking_scores import run_ranking
    from ..experiments.ranking_tables import table_of
    from ..messages import hint
    from ..results.folder_and_lock import default_folder

    more = dict(map(_entry, controller or ()))
    ranking = load_ranking(file, more=more, quick=quick, chosen=condition or ())
    for name in only or ():
        if name not in ranking.entries:
            raise ScenarioError(
                f"--only {name}: unknown entry{hint(name, ranking.entries, lead='known')}",
                code="entry-unknown",
            )
    folder = options.out or default_folder(file)
    hold(context, folder)
    with stoppable(folder), executor_of(folder, ranking.identity, options, format="parquet") as execute:
        ranked = run_ranking(ranking, execute, only=only or ())
        command = command_of("rank", file, quick=quick, controller=controller, condition=condition)
        _write(ranked, folder, command, pooled(context, options))
    print_tables([table_of(ranked, "gains", "speed lost", "chatter")])
    if unranked := [score.entry for score in ranked.scores if score.missing]:
        say(f"not ranked (missing runs): {', '.join(unranked)}")


def _entry(text: str) -> tuple[str, EntrySpec]:
    """Return the name and the entry of a controller given on the command line."""
    from ..errors import ScenarioError
    from ..experiments.ranking import CONTROLLER, EntrySpec
    from ..fault_kinds import FaultList
    from ..scenario.overrides import is_path, swap_of

    fmu, *settings = swap_of(CONTROLLER, text, "--controller")
    name = Path(str(fmu.value)).stem
    if is_path(str(fmu.value)) and not Path(str(fmu.value)).is_file():
        raise ScenarioError(f"--controller {fmu.value}: there is no such file", code="file-missing")
    parameters = {
        change.target.variable: change.value for change in settings if not isinstance(change.value, FaultList)
    }
    words = ", ".join([name, *(f"{key} {value}" for key, value in parameters.items())])
    path = Path(str(fmu.value)).absolute() if is_path(str(fmu.value)) else fmu.value
    spec = EntrySpec(
        title=words, fmu=str(path), parameters=parameters, source="--controller", gains="authors"
    )
    return words.replace(", ", "-").replace(" ", "="), spec


def _write(ranked: RankingResult, folder: Path, command: str, each: Each) -> None:
    """Draw the figures, write tables, page and side files, and print where the page is."""
    from ..errors import ResultsError
    from ..experiments.experiment import FIGURES
    from ..experiments.ranking_tables import (
        columns_of_cells,
        columns_of_entries,
        columns_of_runs,
        draw_matrix,
        draw_pareto,
    )
    from ..experiments.tables import to_csv
    from ..figures.style import save
    from ..files import write_whole
    from ..pages.ranking_page import ranking_page
    from ..pages.report import PAGE

    for name, columns in (
        ("table", columns_of_entries),
        ("cells", columns_of_cells),
        ("runs", columns_of_runs),
    ):
        write_whole(folder / f"{name}.csv", to_csv(columns(ranked)))
    save(draw_matrix(ranked, command), folder / FIGURES / "matrix")
    try:
        save(draw_pareto(ranked, command), folder / FIGURES / "pareto")
    except ResultsError as error:
        say(f"{FIGURES}/pareto: {error}")
    page = folder / PAGE
    write_whole(page, ranking_page(ranked, folder, command, each))
    say(f"The page: {page} ({page.stat().st_size / 1e6:.1f} MB)")

"""`yawbench rank`: drive controllers through conditions and rank them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from yawbench.commands import json_and_latex
from yawbench.commands.experiments import command_of, print_forecasts, say_page
from yawbench.commands.json_and_latex import tabular
from yawbench.commands.options import MAKING, RunOptions, executor_of, named, pooled, takes
from yawbench.commands.output import print_tables
from yawbench.commands.strict_and_junit import broken_off, judged, judging
from yawbench.commands.terminal_progress import hold, say, stoppable
from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.foundation.messages import counted, hint
from yawbench.metrics.verdict import Status, Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from yawbench.studies.experiment_result import Each

    from .ranking import EntrySpec
    from .ranking_scores import EntryScore
    from .threats import LoadedThreats
    from .whole_ranking import WholeRanking

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
    typer.Option(
        "--condition",
        metavar="NAME",
        help="Run only this condition; of a threat file this setting or discipline. Repeatable.",
    ),
]
Quick = Annotated[
    bool,
    typer.Option("--quick", help="Run only the last amplitude of a few conditions, as a trial (seconds)."),
]


@tabular
@judging
@takes(*MAKING, "jobs", "scheduler", "fresh", "no_run", "dry_run")
def rank(
    context: typer.Context,
    options: RunOptions,
    file: RankingFile = Path("proving_ground/ranking"),
    controller: Controller = None,
    only: Only = None,
    condition: ConditionOption = None,
    quick: Quick = False,
) -> None:
    """Rank controllers by sine with dwell or by threats.

    A ranking file compares which conditions they pass; a threat file, such as proving_ground/threats, how far
    each threat can be turned up. There --quick searches the first setting alone, and what --only and
    --condition leave out counts with its published levels and quantities.

    Start reading at report.html. Without --out, results go to results/<folder of the ranking>/<its name>.
    Runs already made from the same scenario, FMUs and program version are not repeated, so an interrupted
    ranking is resumed. Entries with missing runs are not ranked.
    """
    from yawbench.orchestrator.results.folder_names import default_folder
    from yawbench.orchestrator.scenario import yaml_lines
    from yawbench.reports.page_parts import PAGE
    from yawbench.studies.tables import records_in

    from .ranking import load_ranking
    from .ranking_page import beside_matrix
    from .ranking_tables import columns_of_entries, lost_cells, table_of
    from .threats import load_threats
    from .whole_ranking import run_whole

    more = dict(map(_entry, controller or ()))
    command = command_of("rank", file, quick=quick, controller=controller, condition=condition)
    if "threats" in (yaml_lines.read(file, what="ranking file").data or {}):
        threats = load_threats(file, more=more, quick=quick)
        _rank_by_threats(context, options, threats, only or (), condition or (), command)
        return
    ranking = load_ranking(file, more=more, quick=quick, chosen=condition or ())
    _check("--only", "entry", only or (), ranking.entries)
    folder = options.out or default_folder(file)
    if options.dry_run:
        from .dry_run import of_ranking

        execute = executor_of(folder, ranking.identity, options, format="parquet")
        print_forecasts(options, lambda pace: [of_ranking(ranking, execute, pace, only=only or ())])
        return
    hold(context, folder)
    with stoppable(folder), executor_of(folder, ranking.identity, options, format="parquet") as execute:
        ranked = run_whole(ranking, execute, only=only or ())
        _write(ranked, folder, command, pooled(context, options))
    json_and_latex.answer(folder=folder, page=folder / PAGE, entries=records_in(columns_of_entries(ranked)))
    _pass_on(score for score in ranked.scores if not only or score.entry in only)
    asked = [score for score in ranked.scores if not (only and score.missing and score.entry not in only)]
    table = table_of(replace(ranked, scores=asked), "gains", "speed lost", "chatter")
    table.notes += lost_cells(ranked)
    if left_out := len(ranked.scores) - len(asked):
        table.notes.append(
            f"Left out: {counted(left_out, 'entry', 'entries')} without runs that --only does not name."
        )
    print_tables([table, *beside_matrix(ranked)])
    if unranked := [score.entry for score in asked if score.missing]:
        say(f"not ranked (missing runs): {', '.join(unranked)}")


def _pass_on(scores: Iterable[EntryScore]) -> None:
    """Pass on which conditions the entries pass."""
    for score in scores:
        for cell in score.cells.values():
            if cell.missing:
                broken_off(score.spec.title, [(cell.condition, counted(cell.missing, "missing run"))])
                continue
            status = Status.PASSED if cell.passed else Status.FAILED
            passed, number = cell.counts
            why = f"{passed} of {counted(number, 'run')} passed"
            if (slip := cell.worst["sideslip"]) is not None:
                why += f", the worst with {math.degrees(slip):.3g} degrees of sideslip"
            judged(score.spec.title, [(cell.condition, Verdict(status, why=why))])


def _check(option: str, what: str, names: Sequence[str], known: Mapping[str, Any]) -> None:
    for name in names:
        if name not in known:
            raise ScenarioError(
                f"{option} {name}: unknown {what}{hint(name, known, lead='known')}", code=f"{what}-unknown"
            )


def _rank_by_threats(
    context: typer.Context,
    options: RunOptions,
    threats: LoadedThreats,
    only: Sequence[str],
    chosen: Sequence[str],
    command: str,
) -> None:
    """Search the levels that entries survive; write tables and page."""
    from yawbench.foundation.safe_files import write_whole
    from yawbench.orchestrator.results.folder_names import default_folder
    from yawbench.reports.page_parts import PAGE
    from yawbench.studies.tables import records_in, to_csv

    from .threat_runs import run_threats, table_of_levels, table_of_quantities
    from .threat_scores import scored, table_of_scores
    from .threat_tables import main_table
    from .threats_page import threats_page

    _check("--only", "entry", only, threats.ranking.entries)
    _check("--condition", "condition", chosen, {**threats.spec.settings, **threats.spec.disciplines})
    folder = options.out or default_folder(threats.path)
    if options.dry_run:
        from .dry_run import of_threats

        execute = executor_of(folder, threats.identity, options)
        print_forecasts(options, lambda pace: [of_threats(threats, execute, pace, only=only, chosen=chosen)])
        return
    hold(context, folder)
    with stoppable(folder), executor_of(folder, threats.identity, options) as execute:
        result = run_threats(threats, execute, only=only, chosen=chosen)
    write_whole(folder / "levels.csv", to_csv(table_of_levels(result)))
    write_whole(folder / "quantities.csv", to_csv(table_of_quantities(result)))
    table = scored(result)
    write_whole(folder / "scores.csv", to_csv(table_of_scores(table)))
    page = folder / PAGE
    write_whole(page, threats_page(result, table, folder, command))
    say_page(page)
    json_and_latex.answer(folder=folder, page=page, entries=records_in(table_of_scores(table)))
    print_tables([main_table(result, table)])


def _entry(text: str) -> tuple[str, EntrySpec]:
    """Return the name and the entry of a controller given on the command line."""
    from yawbench.fmus.fmu import is_path
    from yawbench.orchestrator.fault_kinds import FaultList
    from yawbench.orchestrator.scenario.overrides import swap_of

    from .ranking import CONTROLLER, EntrySpec

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


def _write(ranked: WholeRanking, folder: Path, command: str, each: Each) -> None:
    """Draw the figures, write tables, page and side files, and print where the page is."""
    from yawbench.figures.style import save
    from yawbench.foundation.safe_files import write_whole
    from yawbench.reports.page_parts import PAGE
    from yawbench.studies.experiment import FIGURES
    from yawbench.studies.tables import to_csv

    from .nuisance import columns_of_nuisance
    from .ranking_figures import draw_matrix, draw_pareto
    from .ranking_page import ranking_page
    from .ranking_tables import columns_of_cells, columns_of_entries, columns_of_runs
    from .settings import columns_of_settings

    for name, columns in (
        ("table", columns_of_entries),
        ("cells", columns_of_cells),
        ("runs", columns_of_runs),
    ):
        write_whole(folder / f"{name}.csv", to_csv(columns(ranked)))
    if ranked.nuisance:
        write_whole(folder / "nuisance.csv", to_csv(columns_of_nuisance(ranked.nuisance)))
    if ranked.settings:
        write_whole(folder / "settings.csv", to_csv(columns_of_settings(ranked.settings)))
    save(draw_matrix(ranked, command), folder / FIGURES / "matrix")
    try:
        save(draw_pareto(ranked, command), folder / FIGURES / "pareto")
    except ResultsError as error:
        say(f"{FIGURES}/pareto: {error}")
    page = folder / PAGE
    write_whole(page, ranking_page(ranked, folder, command, each))
    say_page(page)

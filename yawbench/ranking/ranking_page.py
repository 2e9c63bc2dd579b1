"""The HTML page of a ranking: the matrix, and beside it the chosen cell with its worst run."""

from __future__ import annotations

import math
import shlex
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from markupsafe import Markup

from yawbench.figures.display import LabelledRun
from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.foundation.messages import counted, in_text, listed
from yawbench.metrics.verdict import NotJudged
from yawbench.orchestrator.results.reader import Results, load_results
from yawbench.orchestrator.scenario.overrides import changed
from yawbench.proving_ground.sine_with_dwell import RATIOS, SPUN, course_of
from yawbench.proving_ground.trace import trace_of
from yawbench.reports.page_parts import FigureImage, Page, Part, anchor, image_of, option_of, render
from yawbench.reports.viewer import DATA, LEAST, Settings, assets, carried, embedded, tidy_sides, write_side
from yawbench.reports.viewer_views import Bound, Mark, View
from yawbench.studies.experiment import FIGURES
from yawbench.studies.experiment_result import Each
from yawbench.studies.jobs import STEP_TIME
from yawbench.studies.tables import Table

from .choosing import choosing_table
from .nuisance import nuisance_sentence, nuisance_table
from .ranking import SERIES, EntrySpec, LoadedRanking
from .ranking_scores import (
    IDLE,
    Digits,
    EntryScore,
    RankedState,
    RankingCell,
    RankingResult,
    apart_by_conditions,
    best_beside,
    deciding_digits,
)
from .ranking_tables import (
    RULE,
    UNITS,
    apart_sentence,
    degrees,
    interval_words,
    place_words,
    row_of,
    run_label,
    runs_table,
    share_text,
    sign_of,
    spread,
    state_words,
    table_of,
    words_of,
)
from .settings import entries_table, settings_sentence, settings_table
from .threat_runs import ThreatResult, published_result
from .threat_scores import scored
from .threat_tables import told_apart
from .threats import load_threats
from .whole_ranking import WholeRanking

STATES = {
    RankedState.PASSED: "passed",
    RankedState.SPUN: "criteria met, but the car spun",
    RankedState.FAILED: "failed",
    RankedState.MISSING: "runs are missing in this build",
}
SHOWN = ("yaw_rate", "sideslip", "steering_wheel_angle", "yaw_moment", "acceleration_y")
"""Signals of a cell's worst run; chosen: what the test judges and what the controller does."""
OTHERS = ("speed_lost", "intervention", "chatter")
"""Numbers of a cell shown in addition to headroom and sideslip."""


class MatrixCell(NamedTuple):
    """A cell of the matrix: key of its side file, state and words."""

    id: str
    state: str
    words: str


@dataclass(frozen=True)
class MatrixRow:
    """A row of the matrix, in words; `together`: rows that share the place, 0 below the first of them."""

    place: str
    together: int
    title: str
    passed: str
    interval: str
    braking: str | None  # None: ordinary driving is not driven
    share: str
    cells: Sequence[MatrixCell]


@dataclass(frozen=True, kw_only=True)
class RankingPage(Page):
    """The page of a ranking.

    Attributes:
        source, notes, rule: of the ranking.
        first: headings before those of the conditions.
        described, entries: conditions, controllers.
        command, folder: that repeats it; of its results.
    """

    template = "ranking.html.j2"
    answer: str  # the result in sentences
    source: str
    notes: Sequence[str]
    rule: str = RULE
    quick: bool  # whether it is a quick look
    missing: Sequence[str]  # controllers without a place
    first: Sequence[str]
    beside: Sequence[Table]  # choosing a law, settings, nuisance
    conditions: Sequence[tuple[str, str]]  # short and whole title
    rows: Sequence[MatrixRow]  # of the matrix
    first_cell: str  # key of the cell that is shown first
    data_folder: str = DATA  # of the side files
    frame: Markup  # the viewer for a cell's worst run
    pareto: FigureImage | None  # figure of stability over intervention; None: nothing to draw
    table: Table  # all numbers
    described: Table
    entries: Table
    command: str
    folder: Path


@dataclass(frozen=True, kw_only=True)
class CellPart(Part):
    """What the page shows beside the matrix for a chosen cell.

    Attributes:
        title, state, says: of the cell.
        again, command: that repeat its runs, and the regulation's whole series of them.
    """

    template = "ranking_cell.html.j2"
    title: str
    state: str
    says: str
    sums: Sequence[tuple[str, str]]  # numbers over its runs
    repeats: int  # number of seeds
    table: Table  # of its runs
    again: str
    command: str
    worst: str  # which is its worst run


def ranking_page(ranked: WholeRanking, folder: Path, command: str, each: Each = map) -> str:
    """Return the page as HTML, and write a side file for every cell: its numbers and its worst run.

    Args:
        ranked: the result of the ranking.
        folder: its results folder, which also holds the page.
        command: command line that repeats it.
        each: `map`, or a parallel equivalent.
    """
    ranking = ranked.ranking
    digits = deciding_digits(ranked.scores)
    cells = [(score, cell) for score in ranked.scores for cell in score.cells.values()]
    wanted = [_side(ranked, score, cell, folder) for score, cell in cells]
    list(each(_write_side, *zip(*wanted, strict=True)))
    tidy_sides(folder, {_id(cell) for _, cell in cells})
    lost = next(
        (cell for _, cell in cells if cell.state in (RankedState.FAILED, RankedState.SPUN)), cells[0][1]
    )
    table, pareto = table_of(ranked), folder / FIGURES / "pareto.svg"
    view = RankingPage(
        title=ranking.spec.title,
        answer=answer(ranked),
        source=ranking.spec.source,
        notes=ranking.spec.notes,
        quick=ranking.quick,
        missing=[score.spec.title for score in ranked.scores if score.missing],
        conditions=[(condition.heading, condition.title) for condition in ranking.conditions.values()],
        first=["place", "controller", "passed", "95 %", *(["braking"] if ranked.nuisance else []), "runs"],
        beside=beside_matrix(ranked),
        rows=_rows(ranked, digits),
        first_cell=_id(lost),
        frame=embedded(None, "run"),
        pareto=image_of(pareto, "Stability over intervention") if pareto.is_file() else None,
        table=Table("", table.columns, table.rows),
        described=_conditions(ranked),
        entries=_entries(ranked),
        command=command,
        folder=folder,
        assets=assets("chooser.js", "ranking.js", "ranking.css", package=__package__),
    )
    return render(view)


def answer(ranked: WholeRanking) -> str:
    """Return the result in sentences: who can be told apart, and what the first and no control pass."""
    number = len(ranked.ranking.conditions)
    placed = [score for score in ranked.scores if score.place]
    if not placed:
        return f"No controller has all of its runs under {counted(number, 'condition')}."
    sharing = sum(score.place == 1 for score in placed)
    first = [score for score in placed if score.rank == 1]
    others = [score for score in placed if score.rank != 1][:1]
    others += [score for score in placed if score.spec.fmu == IDLE and score not in (*first, *others)]
    names = listed(in_text(score.spec.title) for score in first)
    rest = "".join(f", {in_text(score.spec.title)} {score.count(RankedState.PASSED)}" for score in others)
    best, whole = f"{first[0].count(RankedState.PASSED)} of {counted(number, 'condition')}", len(placed)
    if sharing > len(first):
        result = (
            f"By the conditions passed, {sharing} of {counted(whole, 'controller')} cannot be told apart and "
            f"share the first place. In the order, {names} "
            f"{'comes' if len(first) == 1 else 'come'} first with {best} passed{rest}."
        )
    else:
        is_best = "is best" if len(first) == 1 else "are best"
        result = f"Of {counted(whole, 'controller')}, {names} {is_best}: {best} passed{rest}."
    first_of_all = settings_sentence(ranked.settings)
    ordinary = nuisance_sentence(ranked.nuisance) if ranked.nuisance else ""
    surely = apart_sentence(apart_by_conditions(placed), [score.spec.fmu == IDLE for score in placed])
    threats = sentence_of_threats(ranked.ranking)
    return " ".join(filter(None, (first_of_all, result, surely, ordinary, threats)))


def beside_matrix(ranked: WholeRanking) -> list[Table]:
    """Return the tables beside the matrix: choosing a law, other settings, nuisance; none of a quick look."""
    tables = []
    if ranked.nuisance:
        published = None
        with suppress(ScenarioError):
            published = published_threats(ranked.ranking)
        tables.append(choosing_table(ranked, published))
    if ranked.settings:
        tables += [settings_table(ranked.settings), entries_table(ranked.settings)]
    if ranked.nuisance:
        tables.append(nuisance_table(ranked.nuisance))
    return tables


def published_threats(ranking: LoadedRanking) -> ThreatResult | None:
    """Return the published levels of the threat file that a ranking quotes; None if it quotes none.

    Raises:
        ScenarioError: a file is invalid.
    """
    file = ranking.path.parent / ranking.spec.threat_file
    return published_result(load_threats(file)) if file.is_file() else None


def sentence_of_threats(ranking: LoadedRanking) -> str:
    """Return how many the published levels of threats tell apart; "" without any."""
    try:
        result = published_threats(ranking)
    except ScenarioError as error:  # the runs are made: the page is written without them
        return f"How many are told apart by threats is not known: {error}."
    if result is None or not result.complete[result.threats.main]:
        return ""
    table = scored(result)
    sharing = sum(score.place == 1 for score in table.scores)
    return (
        f"By threats turned up until the car is lost (published levels) {counted(sharing, 'controller')} "
        f"{'is first' if sharing == 1 else 'share the first place'}. {told_apart(table)}"
    )


def _rows(ranked: WholeRanking, digits: Digits) -> list[MatrixRow]:
    """Return the rows of the matrix."""
    sharing = Counter(score.place for score in ranked.scores)
    rows = []
    for number, score in enumerate(ranked.scores):
        first = number == 0 or not score.place or ranked.scores[number - 1].place != score.place
        passed = f"{score.count(RankedState.PASSED)}/{len(score.cells)}"
        rows.append(
            MatrixRow(
                place=place_words(score),
                together=(sharing[score.place] if score.place else 1) if first else 0,
                title=score.spec.title,
                passed=passed if score.place else f"{score.missing} missing",
                interval=interval_words(score) or "–",
                braking=(share_text(score.braking) or "–") if ranked.nuisance else None,
                share=str(row_of(score, digits)["runs"]) if score.place else "–",
                cells=[
                    MatrixCell(_id(cell), cell.state.value, sign_of(cell)) for cell in score.cells.values()
                ],
            )
        )
    return rows


def _id(cell: RankingCell) -> str:
    return anchor(f"{cell.entry} in {cell.condition}")


def _side(
    ranked: RankingResult, score: EntryScore, cell: RankingCell, folder: Path
) -> tuple[str, Sequence[tuple[str, Path]], str, Path]:
    """Return the arguments of `_write_side` for a cell."""
    condition, worst = ranked.ranking.conditions[cell.condition], cell.worst
    sums = {
        "runs that pass": "{} of {}".format(*cell.counts),
        "headroom below the limits": spread(cell.headroom, lambda x: f"{x:.1f} points"),
        "peak sideslip": spread(cell.sideslip, lambda x: f"{math.degrees(x):.1f}°"),
        "displacement": _text(cell.displacement, "m"),
        **{key.replace("_", " "): _text(cell.number(key), UNITS[key]) for key in OTHERS},
        "time per step": _text(cell.number(STEP_TIME), "s"),
    }
    label = run_label(ranked, worst)
    runs = [(label, worst.results)] if worst.results is not None and worst.results.is_dir() else []
    best = best_beside(ranked.scores, cell)
    if runs and best and best.results is not None and best.results.is_dir():
        runs.append((run_label(ranked, best), best.results))
    details = CellPart(
        title=f"{score.spec.title}: {condition.title}",
        state=cell.state.value,
        says=STATES[cell.state],
        sums=[(name, text) for name, text in sums.items() if text is not None],
        repeats=len({run.repeat for run in cell.runs}),
        table=runs_table(cell),
        command=series_command(ranked, cell),
        again=again_command(ranked, cell, folder),
        worst=f"Its worst run: {label}, {state_words(worst)}." if runs else "Its runs kept no results.",
    )
    return _id(cell), runs, render(details), folder


def _write_side(key: str, runs: Sequence[tuple[str, Path]], html: str, folder: Path) -> None:
    """Write the side file of a cell; without results, or unreadable ones, it has no run."""
    content = None
    if runs:
        with suppress(ResultsError):
            loaded = [LabelledRun(label, load_results(results)) for label, results in runs]
            limits = [Bound("sideslip", side * SPUN, "20° of sideslip") for side in (1.0, -1.0)]
            marks = _instants(loaded[0].results)
            content = carried(
                loaded, Settings([View(panels=SHOWN)], marks=marks, limits=limits, largest=LEAST)
            )
    write_side(folder, key, content, html=html)


def _instants(run: Results) -> list[Mark]:
    """Return the instants of the test: completion of steer, and those at which the yaw rate is judged."""
    try:
        course = course_of(trace_of(run, SERIES))
    except (NotJudged, ResultsError):
        return []
    instants = [(0.0, "COS"), *((late, f"COS + {late:g} s") for late, _ in RATIOS)]
    return [Mark(course.end + late, text, 0) for late, text in instants]


def _text(number: float | None, unit: str) -> str | None:
    return None if number is None else Table("", [""], [[words_of(number, unit)]]).text()[0][0]


def again_command(ranked: RankingResult, cell: RankingCell, folder: Path) -> str:
    """Return the command that repeats the runs of a cell, in another folder."""
    chosen = ["--only", cell.entry, "--condition", cell.condition, "--out", str(folder / "again")]
    return shlex.join(["yawbench", "rank", str(ranked.ranking.path), *chosen])


def series_command(ranked: RankingResult, cell: RankingCell) -> str:
    """Return the command that drives the regulation's whole series for a cell, with a figure of every run."""
    ranking = ranked.ranking
    condition = ranking.spec.conditions[cell.condition]
    words = ["yawbench", "drive", "sine-with-dwell", "--figures"]
    words += ["--scenario", str(ranking.scenario(condition.scenario))]
    words += ["--angle", f"{math.degrees(ranked.angles[condition.car]):.1f} deg"]
    changes = {
        change.target: change
        for change in (*ranking.changes_of_condition(cell.condition), *ranking.changes_of_entry(cell.entry))
    }
    for change in changes.values():
        words += option_of(change)
    return shlex.join(words)


def _conditions(ranked: RankingResult) -> Table:
    """Return the table of conditions."""
    ranking = ranked.ranking
    headings = ["condition", "car", "A", "scenario", "changed", "runs of a controller", "responsiveness"]
    table = Table("", headings)
    for name, condition in ranking.conditions.items():
        runs = sum(run.condition == name for run in ranked.runs) // max(1, len(ranking.entries))
        own = ranking.changes_of_condition(name)
        changes = [
            change for change in own if str(change.target) not in ("vehicle", "step_size", "stop_time")
        ]
        table.rows.append([
            condition.title, ranking.spec.cars[condition.car].title, degrees(ranked.angles[condition.car]),
            condition.scenario, changed(changes) or None, str(runs),
            "judged" if condition.dry else "not judged: the road is not dry",
        ])  # fmt: skip
    return table


def _entries(ranked: RankingResult) -> Table:
    """Return the table of controllers."""
    table = Table("", ["controller", "name", "FMU", "parameters", "gains", "source"])
    for score in ranked.scores:
        spec: EntrySpec = score.spec
        parameters = ", ".join(f"{name} {number}" for name, number in spec.parameters.items())
        table.rows.append([spec.title, score.entry, spec.fmu, parameters or None, spec.gains, spec.source])
    return table

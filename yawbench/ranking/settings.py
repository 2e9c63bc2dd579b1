"""Settings: the same controllers with other brakes, tyres or axles, and what stays true of their order.

A setting overrides what all entries share. Some conditions are judged again under each, at the last
amplitude, which decides nearly all of them. Of two controllers the order is *kept* if one passes more
conditions under at least one setting and the other under none.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import combinations

from yawbench.foundation.messages import counted, in_text, listed
from yawbench.studies.executor import Executor
from yawbench.studies.tables import Cell, Table, count_column, number_column, text_column

from .ranking import LoadedRanking
from .ranking_scores import (
    IDLE,
    EntryScore,
    RankedState,
    RankingResult,
    apart_by_conditions,
    run_ranking,
    scores_of,
)

AS_IT_IS = "as it is"


@dataclass(frozen=True)
class SettingScores:
    """Scores of all entries under a setting, over the conditions that it judges."""

    name: str  # "": the ranking's own
    title: str
    ranking: LoadedRanking
    scores: list[EntryScore]  # best first

    @property
    def controllers(self) -> dict[str, EntryScore]:
        """Scores of entries with all runs, without that of no control."""
        return {score.entry: score for score in self.scores if score.place and score.spec.fmu != IDLE}


def run_settings(
    ranked: RankingResult, execute: Executor, *, only: Collection[str] = ()
) -> list[SettingScores]:
    """Execute the missing runs of all settings; the first one returned is the ranking's own.

    Raises:
        YawbenchError: a run cannot start.
    """
    ranking = ranked.ranking
    return [own_setting(ranked)] + [
        SettingScores(name, spec.title, under, run_ranking(under, execute, only=only, keep=False).scores)
        for name, spec in ranking.spec.settings.items()
        for under in [ranking.under(name)]
    ]


def own_setting(ranked: RankingResult) -> SettingScores:
    """Return the scores of a ranking over the runs that settings judge again."""
    own = ranked.ranking.under("")
    last: dict[str, float] = {}
    for run in ranked.runs:
        last[run.condition] = max(abs(run.amplitude), last.get(run.condition, 0.0))
    runs = [
        run
        for run in ranked.runs
        if run.condition in own.conditions and abs(run.amplitude) == last[run.condition]
    ]
    return SettingScores("", AS_IT_IS, own, scores_of(own, runs))


@dataclass(frozen=True)
class OrderKept:
    """What stays of the order of all pairs of controllers under the settings."""

    kept: list[tuple[str, str]]  # the first passes more under one setting, and fewer under none
    changed: int
    equal: int

    @property
    def pairs(self) -> int:
        """The number of pairs."""
        return len(self.kept) + self.changed + self.equal


def order_kept(settings: Sequence[SettingScores]) -> OrderKept:
    """Return what stays of the order of the controllers that all settings rank."""
    common = [name for name in settings[0].controllers if all(name in one.controllers for one in settings)]
    kept, changed, equal = [], 0, 0
    for first, second in combinations(common, 2):
        signs = {_sign(one, first, second) for one in settings} - {0}
        if not signs:
            equal += 1
        elif len(signs) > 1:
            changed += 1
        else:
            kept.append((first, second) if signs == {1} else (second, first))
    return OrderKept(kept, changed, equal)


def _sign(one: SettingScores, first: str, second: str) -> int:
    a, b = (one.controllers[name].count(RankedState.PASSED) for name in (first, second))
    return (a > b) - (a < b)


def settings_sentence(settings: Sequence[SettingScores]) -> str:
    """Return in sentences what stays true of the order under the settings."""
    if len(settings) < 2:
        return ""
    order = order_kept(settings)
    always = set.intersection(*map(_clear, settings))
    totals = {one.title: _passes(one) for one in settings}
    most, least = max(totals, key=lambda t: totals[t]), min(totals, key=lambda t: totals[t])
    firsts: dict[str, int] = {}
    alike = []
    for one in settings:
        if one.controllers:
            first, *others = one.controllers.values()
            firsts[first.spec.title] = firsts.get(first.spec.title, 0) + 1
            most_passed = first.count(RankedState.PASSED)
            alike.append(1 + sum(score.count(RankedState.PASSED) == most_passed for score in others))
    leaders = [
        f"{in_text(name)} under {number}" for name, number in sorted(firsts.items(), key=lambda x: -x[1])
    ]
    first_words = (
        f"First in the order is {listed(leaders)}, of {_span(alike)} that pass as many conditions: among "
        "these the peak sideslip decides. "
        if firsts
        else ""
    )
    conditions = len(settings[0].ranking.conditions)
    return (
        f"Under {counted(len(settings), 'setting')} of brakes, tyres and axles, with "
        f"{counted(conditions, 'condition')} each, {len(order.kept)} of {counted(order.pairs, 'pair')} of "
        "controllers never reverse their order by the conditions passed (one passes more under at least one "
        f"setting, the other under none), {order.changed} do and {order.equal} never differ; {len(always)} "
        f"are clearly different under all settings. {first_words}"
        f"Controllers pass {100 * totals[most]:.0f} % of the conditions with the setting '{most}', "
        f"{100 * totals[least]:.0f} % with '{least}'."
    )


def _span(numbers: Sequence[int]) -> str:
    """Return the range of numbers in words."""
    low, high = min(numbers), max(numbers)
    return f"{low} to {high}" if low < high else str(low)


def _passes(one: SettingScores) -> float:
    """Return the share of conditions passed, of all controllers."""
    scores = one.controllers.values()
    whole = sum(len(score.cells) for score in scores)
    return sum(score.count(RankedState.PASSED) for score in scores) / whole if whole else 0.0


def _clear(one: SettingScores) -> set[tuple[str, str]]:
    """Return the pairs of controllers told apart under a setting, the better first."""
    scores = [*one.controllers.values()]
    if len(scores) < 2:
        return set()
    pairs = zip(*apart_by_conditions(scores).better.nonzero(), strict=True)
    return {(scores[better].entry, scores[worse].entry) for better, worse in pairs}


def settings_table(settings: Sequence[SettingScores]) -> Table:
    """Return the table of settings: how many controllers pass each condition, and who is first."""
    conditions = settings[0].ranking.conditions
    headings = [
        "setting",
        *(spec.heading.rstrip(" *") for spec in conditions.values()),
        "of all",
        "first",
        "clear pairs",
    ]
    rows: list[list[Cell]] = []
    for one in settings:
        controllers = [*one.controllers.values()]
        passed = [
            f"{sum(score.cells[name].passed for score in controllers)} of {len(controllers)}"
            if name in one.ranking.conditions
            else None
            for name in conditions
        ]
        first = controllers[0].spec.title if controllers else None
        rows.append([one.title, *passed, f"{100 * _passes(one):.0f} %", first, str(len(_clear(one)))])
    notes = [
        "Controllers that pass each condition; of all: share of conditions passed; first: in the order; "
        "clear pairs: told apart by exact tests, corrected for their number."
    ]
    return Table("The order under other settings", headings, rows, notes, {*range(1, len(headings) - 2)})


def entries_table(settings: Sequence[SettingScores]) -> Table:
    """Return the table of controllers: conditions passed under each setting."""
    headings = ["controller", *(one.title for one in settings)]
    rows: list[list[Cell]] = []
    for score in settings[0].scores:
        own = [next((s for s in one.scores if s.entry == score.entry and s.place), None) for one in settings]
        if any(own):  # else it was not driven
            rows.append(
                [score.spec.title, *(None if s is None else str(s.count(RankedState.PASSED)) for s in own)]
            )
    return Table("Conditions passed under each setting", headings, rows, [], {*range(1, len(headings))})


def columns_of_settings(settings: Sequence[SettingScores]) -> Table:
    """Return columns with a row per setting, controller and condition, in SI units."""
    cells = [(one, cell) for one in settings for score in one.scores for cell in score.cells.values()]
    counts = [cell.counts for _, cell in cells]
    slips = [None if cell.missing else cell.number("sideslip") for _, cell in cells]
    return Table.of_columns(
        [
            text_column("setting", (one.name for one, _ in cells)),
            text_column("entry", (cell.entry for _, cell in cells)),
            text_column("condition", (cell.condition for _, cell in cells)),
            text_column("state", (cell.state.value for _, cell in cells)),
            count_column("runs", (number for _, number in counts)),
            count_column("passed", (passed for passed, _ in counts)),
            number_column("sideslip", "rad", slips),
        ]
    )

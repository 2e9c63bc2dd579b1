"""Tables of threats, and what they say in sentences: scores, levels, orders, settings beside the main one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from yawbench.foundation.messages import counted, in_text
from yawbench.studies.confidence import Bounds
from yawbench.studies.tables import Table

from .ranking_tables import apart_sentence
from .threat_runs import ThreatResult
from .threat_scores import Moves, ScoreTable, compared_setting, moves_between, scores_without
from .threats import LANE_CHANGE, REFERENCE, LoadedThreats, SearchPlace, ThreatSpec

RULE = (
    "Score: the geometric mean of the highest levels survived, over threats and cars, each threat's range "
    "taken as one unit; no control has 0, the best 100. Interval: 95 %, of the distance from the best, which "
    "faces the same threats and cars, with these as samples. Place: one more than the entries that are "
    "clearly better by such differences, corrected for the number of pairs, and never better than that of a "
    "higher score. Order by rank: by the mean rank."
)
FROM_BEST = "95 % interval, from the best"
"""Heading of the intervals of scores."""


def titles_of(result: ThreatResult) -> dict[str, str]:
    """Return entry -> title."""
    return {name: spec.title for name, (spec, _) in result.threats.ranking.entries.items()}


def interval_text(bounds: Bounds) -> str | None:
    """Return an interval of scores; None if a single level tells none."""
    return f"{bounds.low:.0f} to {bounds.high:.0f}" if math.isfinite(bounds.high) else None


def main_table(result: ThreatResult, table: ScoreTable) -> Table:
    """Return the table of scores, the best first; published entries are marked where others are not."""
    titles = titles_of(result)
    published = result.published if any(score.entry not in result.published for score in table.scores) else ()
    rows = [
        [
            str(score.place), titles[score.entry] + (" (published)" if score.entry in published else ""),
            f"{score.score:.1f}", interval_text(score.bounds), f"{score.mean_rank:.1f}", str(score.by_rank),
        ]
        for score in table.scores
    ]  # fmt: skip
    return Table(
        f"Scores: {result.threats.spec.settings[result.threats.main].title}",
        ["place", "controller", "score", FROM_BEST, "mean rank", "order by rank"],
        [*rows], [RULE, _other_order(titles, table), told_apart(table)], {0, 2, 4, 5},
    )  # fmt: skip


def _other_order(titles: Mapping[str, str], table: ScoreTable) -> str:
    """Describe how far the order by the mean rank differs from that by the score."""
    by_rank = {score.entry: -score.mean_rank for score in table.scores}
    moves = moves_between(table.by_entry(), by_rank, REFERENCE)
    return (
        f"The order by the mean rank differs for {counted(moves.moved, 'entry', 'entries')}"
        f"{f', most for {_moved(titles, moves)}' if moves.moved else ''} (Spearman's rank correlation "
        f"{moves.correlation:.2f})."
    )


def _moved(titles: Mapping[str, str], moves: Moves) -> str:
    return f"{in_text(titles[moves.farthest])}: {moves.before} to {moves.after}" if moves.moved else "none"


def answer(result: ThreatResult, table: ScoreTable) -> str:
    """Return the result in sentences: who shares the first place, and how far scores tell entries apart."""
    titles = titles_of(result)
    first = [score for score in table.scores if score.place == 1]
    if len(first) == 1:
        who = f"{in_text(titles[first[0].entry])} is first"
    else:
        best = in_text(titles[first[0].entry])
        who = (
            f"{len(first)} share the first place with scores from {first[-1].score:.0f} to "
            f"{first[0].score:.0f}, as no other is clearly better; {best} has the best score"
        )
    return f"Of {counted(len(table.scores), 'controller')}, {who}. {told_apart(table)}"


def told_apart(table: ScoreTable) -> str:
    """Return which entries can be told apart, in sentences."""
    return apart_sentence(table.apart, [entry == REFERENCE for entry in table.order()])


def level_text(spec: ThreatSpec, position: float, end: str = "") -> str:
    """Return a level with its unit; a range that ended is marked."""
    level = spec.level(position)
    mark = {"hard": "≥ " if spec.hard > spec.easy else "≤ ", "easy": "fails at "}.get(end, "")
    digits = 2 if abs(level) < 10 else 0
    return f"{mark}{level:.{digits}f}"


def levels_table(result: ThreatResult, entries: Sequence[str]) -> Table:
    """Return the table of levels survived, geometric means over cars, an entry per row."""
    threats, titles = result.threats, titles_of(result)
    specs = {name: threats.spec.threats[name] for name in threats.threats_in(threats.main)}
    headings = ["controller", *(_heading(spec) for spec in specs.values())]
    table = Table("", headings, numbers=range(1, len(headings)))
    for entry in entries:
        row = [titles[entry]]
        for name, spec in specs.items():
            levels = _of_threat(result, threats.main, name, entry)
            ends = {level.end for level in levels}
            mean = sum(level.position for level in levels) / len(levels)
            row.append(
                "fails" if ends == {"easy"} else level_text(spec, mean, "hard" if ends == {"hard"} else "")
            )
        table.rows.append(row)
    table.notes.append(
        "Geometric means over cars of the highest level survived. Fails: on every car at the easy end of the "
        "range, which then counts. ≥, ≤: survived to the hard end on every car."
    )
    return table


def _heading(spec: ThreatSpec) -> str:
    return (spec.short or spec.title) + (f" [{spec.unit}]" if spec.unit else "")


def _of_threat(result: ThreatResult, setting: str, threat: str, entry: str) -> list[Any]:
    cars = result.threats.cars_facing(setting, threat)
    places = (SearchPlace(setting, threat, car, entry) for car in cars)
    return [result.survived[place] for place in places if place in result.survived]


def levels_on_cars(result: ThreatResult, setting: str, threat: str, entry: str) -> list[str]:
    """Return the levels that an entry survives, a car each."""
    spec = result.threats.spec.threats[threat]
    levels = _of_threat(result, setting, threat, entry)
    return [level_text(spec, level.position, level.end) for level in levels]


def car_tables(result: ThreatResult, entries: Sequence[str]) -> list[Table]:
    """Return a table of levels per threat: an entry per row, a car per column."""
    threats, titles, tables = result.threats, titles_of(result), []
    for name in threats.threats_in(threats.main):
        spec = threats.spec.threats[name]
        cars = threats.cars_facing(threats.main, name)
        heading = f"{spec.title}{f' [{spec.unit}]' if spec.unit else ''}"
        table = Table(heading, ["controller", *cars], numbers=range(1, len(cars) + 1))
        for entry in entries:
            table.rows.append([titles[entry], *levels_on_cars(result, threats.main, name, entry)])
        tables.append(table)
    return tables


def threats_table(result: ThreatResult) -> Table:
    """Return the table of threats: range, cars, source."""
    table = Table("", ["threat", "from", "to", "cars", "scenario", "changes", "source of the range"])
    for spec in result.threats.spec.threats.values():
        unit = f" {spec.unit}" if spec.unit else ""
        changes = [*(f"{target} = {value}" for target, value in spec.set.items())]
        changes += [f"{target} × level" for target in spec.factor] + [
            f"{target} + level" for target in spec.add
        ]
        cars = "all" if not spec.cars else ", ".join(spec.cars)
        ends = f"{spec.easy:g}{unit}", f"{spec.hard:g}{unit}"
        table.rows.append([spec.title, *ends, cars, spec.scenario, "\n".join(changes), spec.source])
    return table


def orders_tables(result: ThreatResult, table: ScoreTable) -> tuple[Table, Table]:
    """Return how the order changes without each threat and car, and each entry's place in every order."""
    threats, titles, entries = result.threats, titles_of(result), result.complete[result.threats.main]
    names = {"threat": threats.threats_in(threats.main), "car": threats.cars_in(threats.main)}
    of_changes = ["without", "first", "rank correlation", "entries that move", "farthest move"]
    changes = Table("", of_changes, numbers={2, 3})
    without = scores_without(entries, result.positions(threats.main, entries), REFERENCE)
    for (word, k), scores in without.items():
        moves = moves_between(table.by_entry(), scores, REFERENCE)
        changes.rows.append([
            f"{word} {names[word][k]}", titles[next(iter(scores))], f"{moves.correlation:.2f}",
            str(moves.moved), _moved(titles, moves),
        ])  # fmt: skip
    orders = [table.order(), *([*scores] for scores in without.values())]
    headings = ["controller", "all", *(names[word][k] for word, k in without)]
    rows = [[titles[entry], *(str(order.index(entry) + 1) for order in orders)] for entry in table.order()]
    notes = ["Places by the score; every column but the first leaves out its threat or car."]
    return changes, Table("", headings, [*rows], notes, {*range(1, len(headings))})


def compared_settings(result: ThreatResult) -> list[str]:
    """Return the settings with all levels that are compared with main: no disciplines, no further seeds."""
    threats = result.threats
    return [
        name
        for name, spec in threats.spec.settings.items()
        if name != threats.main and result.complete[name] and not spec.seeds
        and not lane_changes_alone(threats, name)
    ]  # fmt: skip


def lane_changes_alone(threats: LoadedThreats, setting: str) -> bool:
    return all(threats.spec.threats[name].test == LANE_CHANGE for name in threats.threats_in(setting))


def settings_table(result: ThreatResult, settings: Sequence[str]) -> Table:
    """Return what each setting changes in levels and order against the main one."""
    threats, titles = result.threats, titles_of(result)
    headings = [
        "setting", "threats", "cars", "entries", "levels move [% of a range]", "rank correlation",
        "entries that move", "farthest move", "first", "first in main",
    ]  # fmt: skip
    table = Table("", headings, numbers={3, 4, 5, 6})
    for setting in settings:
        compared = compared_setting(result, setting)
        if compared.main is None:
            continue
        moved = round(100 * compared.moved, 1) + 0.0  # no -0.0
        before, after = compared.main.by_entry(), compared.table.by_entry()
        moves = moves_between(before, after, REFERENCE)
        table.rows.append([
            threats.spec.settings[setting].title, ", ".join(threats.threats_in(setting)),
            ", ".join(threats.cars_in(setting)), str(len(before)), f"{moved:+.1f}",
            f"{moves.correlation:.2f}", str(moves.moved), _moved(titles, moves),
            titles[next(iter(after))], titles[next(iter(before))],
        ])  # fmt: skip
    table.notes.append(
        "Each setting against the main one on the same threats, cars and entries. Levels move: mean "
        "difference; above 0, more is survived. Rank correlation: Spearman's, without no control; "
        "equal scores share a place."
    )
    return table


def setting_table(result: ThreatResult, setting: str) -> Table:
    """Return the scores of another setting, beside those of the main one on the same threats and cars."""
    threats, titles = result.threats, titles_of(result)
    compared = compared_setting(result, setting)
    of_main, order = {}, []
    if compared.main:
        of_main, order = {score.entry: score for score in compared.main.scores}, compared.main.order()
    rows = [
        [
            str(score.place), titles[score.entry], f"{score.score:.1f}", interval_text(score.bounds),
            f"{of_main[score.entry].score:.1f}" if score.entry in of_main else None,
            str(order.index(score.entry) + 1) if score.entry in of_main else None,
        ]
        for score in compared.table.scores
    ]  # fmt: skip
    about = (
        f"Threats: {', '.join(threats.threats_in(setting))}; cars: {', '.join(threats.cars_in(setting))}. "
        f"{told_apart(compared.table)}"
    )
    headings = ["place", "controller", "score", FROM_BEST, "main score, same threats", "main order"]
    return Table(threats.spec.settings[setting].title, headings, [*rows], [about], {0, 2, 4, 5})

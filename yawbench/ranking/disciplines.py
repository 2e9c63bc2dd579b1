"""Disciplines: entries scored in a lane change and in standard tests, and all of these beside each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from yawbench.figures.display import digits_of, shown_unit
from yawbench.studies.tables import Table

from .threat_runs import ThreatResult
from .threat_scores import ScoreTable, moves_between, score_table, scored
from .threat_tables import (
    FROM_BEST,
    interval_text,
    lane_changes_alone,
    levels_on_cars,
    titles_of,
    told_apart,
)
from .threats import REFERENCE


@dataclass(frozen=True)
class Discipline:
    """A discipline as driven, with columns of its own."""

    title: str
    scores: ScoreTable
    cells: dict[str, list[str]]  # entry -> texts of its own columns
    headings: list[str]  # of these columns
    about: str  # what is driven, and what the columns are


def disciplines(result: ThreatResult) -> list[Discipline]:
    """Return the disciplines: settings whose threats are all judged by a lane change, then standard tests."""
    threats = result.threats
    names = [name for name in threats.spec.settings if lane_changes_alone(threats, name)]
    of_changes = [_of_lane_change(result, name) for name in names if result.complete[name]]
    driven = {name for name, _, entry in result.quantities if entry == REFERENCE}
    return of_changes + [
        _of_standard_test(result, name) for name in threats.spec.disciplines if name in driven
    ]


def _of_lane_change(result: ThreatResult, setting: str) -> Discipline:
    threats = result.threats
    name, cars = threats.threats_in(setting)[0], threats.cars_in(setting)
    spec = threats.spec.threats[name]
    cells = {entry: levels_on_cars(result, setting, name, entry) for entry in result.complete[setting]}
    headings, title = [f"{car} [{spec.unit}]" for car in cars], threats.spec.settings[setting].title
    return Discipline(title, scored(result, setting), cells, headings, "More is better.")


def _of_standard_test(result: ThreatResult, name: str) -> Discipline:
    spec = result.threats.spec.disciplines[name]
    cars = spec.cars or result.threats.spec.cars
    entries = [
        entry
        for entry in result.threats.entries_in(result.threats.main)
        if all((name, car, entry) in result.quantities for car in cars)
    ]
    positions = np.array([
        [
            [quantity.position(result.quantities[name, car, entry].get(key)) for car in cars]
            for key, quantity in spec.quantities.items()
        ]
        for entry in entries
    ])  # fmt: skip
    cells = {
        entry: [
            _median_text(
                [result.quantities[name, car, entry].get(key) for car in cars],
                result.units.get((name, key), ""),
            )
            for key in spec.quantities
        ]
        for entry in entries
    }
    headings, ranges = [], []
    for key, quantity in spec.quantities.items():
        unit, scale = shown_unit(result.units.get((name, key), ""))
        headings.append(f"{quantity.title}{f' [{unit}]' if unit else ''}")
        ends = (f"{x * scale:.3g}" for x in (quantity.best, quantity.worst))
        ranges.append(f"{quantity.title} {' to '.join(ends)}{f' {unit}' if unit else ''}")
    about = (
        f"{spec.source}. Medians over {', '.join(cars)}; less is better. Each range counts as one unit: "
        f"{'; '.join(ranges)}."
    )
    return Discipline(spec.title, score_table(entries, positions, REFERENCE), cells, headings, about)


def _median_text(magnitudes: Sequence[float | None], unit: str) -> str:
    """Return the median over the cars that were not lost, in the unit shown."""
    known = [x for x in magnitudes if x is not None]
    if not known:
        return "lost"
    lost = f", lost on {len(magnitudes) - len(known)}" if len(known) < len(magnitudes) else ""
    return f"{digits_of(shown_unit(unit)[1] * float(np.median(known)), 3)}{lost}"


def discipline_table(result: ThreatResult, discipline: Discipline) -> Table:
    """Return the table of a discipline: scores with intervals, the best first, and its own columns."""
    titles = titles_of(result)
    rows = [
        [
            str(score.place), titles[score.entry], f"{score.score:.0f}", interval_text(score.bounds),
            *discipline.cells[score.entry],
        ]
        for score in discipline.scores.scores
    ]  # fmt: skip
    headings = ["place", "controller", "score", FROM_BEST, *discipline.headings]
    notes = [f"{discipline.about} {told_apart(discipline.scores)}"]
    return Table(discipline.title, headings, [*rows], notes, {0, 2, *range(4, len(headings))})


def overview(result: ThreatResult, table: ScoreTable) -> Table:
    """Return the table with all disciplines beside each other: the matrix, the threats, the other tests."""
    titles = titles_of(result)
    driven = disciplines(result)
    columns = [("threats", table), *((discipline.title, discipline.scores) for discipline in driven)]
    rows = []
    for score in table.scores:
        passed = result.passed.get(score.entry)
        cells = [f"{passed[0]} of {passed[1]}" if passed else None]
        for _, scores in columns:
            own = next((other for other in scores.scores if other.entry == score.entry), None)
            cells.append(f"{own.score:.0f} ({own.place})" if own else None)
        rows.append([titles[score.entry], *cells])
    notes = [
        "Conditions of the matrix passed, as published; then scores, in brackets places, shared by "
        "those that cannot be told apart. No control has 0, the best 100; below 0 is worse than no control."
    ]
    if driven:
        agreements = (
            f"{d.title} {moves_between(table.by_entry(), d.scores.by_entry(), REFERENCE).correlation:.2f}"
            for d in driven
        )
        notes.append(f"Rank correlation with the order by threats (Spearman): {', '.join(agreements)}.")
    headings = ["controller", "matrix", *(title for title, _ in columns)]
    return Table("", headings, [*rows], notes, {*range(1, len(headings))})

"""The HTML page of a threat file: scores first, then levels, orders, other settings and disciplines."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from yawbench.reports.page_parts import PAGE, RANKING, Page, render
from yawbench.studies.tables import Table

from .disciplines import discipline_table, disciplines, overview
from .gains_and_laws import compared_gains, gains_sentence, gains_table, seeds_table
from .threat_runs import ThreatResult
from .threat_scores import (
    ScoreTable,
)
from .threat_tables import (
    answer,
    car_tables,
    compared_settings,
    levels_table,
    main_table,
    orders_tables,
    setting_table,
    settings_table,
    threats_table,
    titles_of,
)


def _published(result: ThreatResult, order: Sequence[str]) -> str:
    """Return a sentence on the entries with published levels; "" without any."""
    titles = [titles_of(result)[entry] for entry in order if entry in result.published]
    if len(titles) == len(order):
        return "All levels of the main setting are the published ones; none was searched in these runs."
    return f"Published levels, not searched in these runs: {'; '.join(titles)}." if titles else ""


@dataclass(frozen=True, kw_only=True)
class ThreatsPage(Page):
    """The page of a threat file.

    Attributes:
        source, notes: of the file.
        orders, places: without each threat and car.
        gains, sentence: of gains and laws; empty without them.
        moves, settings: what other settings change, and their scores.
        command, folder: that repeats it; of its results.
    """

    template = "threats.html.j2"
    answer: str  # the result in sentences
    source: str
    notes: Sequence[str]
    matrix: str  # address of the ranking's page; "": there is none
    quick: bool  # whether it is a quick look
    published: str  # on entries with published levels
    main: Table  # scores of the main setting
    overview: Table  # all disciplines beside each other
    levels: Table  # highest levels survived; `cars`: of every threat by car
    cars: Sequence[Table]
    orders: Table
    places: Table
    gains: Sequence[Table]
    sentence: str
    moves: Table
    settings: Sequence[Table]
    disciplines: Sequence[Table]  # a table each
    described: Table  # range and source of every threat
    command: str
    folder: Path


def threats_page(result: ThreatResult, table: ScoreTable, folder: Path, command: str) -> str:
    """Return the page as HTML.

    Args:
        result: levels and quantities.
        table: scores of the main setting.
        folder: its results folder, which also holds the page.
        command: command line that repeats it.
    """
    threats = result.threats
    order = table.order()
    orders, places = orders_tables(result, table)
    gains = compared_gains(result)
    others = compared_settings(result)
    matrix = folder.parent / RANKING.parent.name / PAGE
    view = ThreatsPage(
        title=threats.spec.title,
        source=threats.spec.source,
        notes=threats.spec.notes,
        matrix=Path(os.path.relpath(matrix, folder)).as_posix() if matrix.is_file() else "",
        quick=threats.quick,
        answer=answer(result, table),
        published=_published(result, order),
        main=main_table(result, table),
        levels=levels_table(result, order),
        orders=orders,
        places=places,
        moves=settings_table(result, others),
        settings=[setting_table(result, name) for name in others],
        gains=[gains_table(result, gains), seeds_table(result, gains)] if gains else [],
        sentence=gains_sentence(result, gains) if gains else "",
        overview=overview(result, table),
        disciplines=[discipline_table(result, discipline) for discipline in disciplines(result)],
        cars=car_tables(result, order),
        described=threats_table(result),
        command=command,
        folder=folder,
    )
    return render(view)

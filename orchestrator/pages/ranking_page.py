"""The HTML page of a ranking: the overview first, every cell linked to its runs."""

from __future__ import annotations

import math
import os
import shlex
from pathlib import Path
from typing import Any

from markupsafe import Markup

from ..experiments.experiment import FIGURES
from ..experiments.jobs import STEP_TIME
from ..experiments.ranking import EntrySpec
from ..experiments.ranking_scores import Digits, EntryScore, RankingCell, RankingResult, deciding_digits
from ..experiments.ranking_tables import (
    RULE,
    RUN,
    UNITS,
    degrees,
    place_words,
    row_of,
    runs_table,
    sign_of,
    spread,
    table_of,
    words_of,
)
from ..experiments.tables import Table
from ..messages import changed
from .page_parts_and_provenance import FigureImage, anchor, image_of, made_by, option_of, render, style

STATES = {
    "passed": "passed",
    "spun": "criteria met, but the car spun",
    "failed": "failed",
    "missing": "runs are missing in this build",
}
OTHERS = ("speed_lost", "intervention", "chatter")
"""Numbers of a cell shown in addition to margin and sideslip."""


def ranking_page(ranked: RankingResult, folder: Path, command: str) -> str:
    """Return the page as HTML.

    Args:
        ranked: the result of the ranking.
        folder: its results folder, which also holds the page.
        command: command line that repeats it.
    """
    ranking = ranked.ranking
    digits = deciding_digits(ranked.scores)
    after = ["margin", "sideslip", "intervention", "time per step"]
    table = table_of(ranked)
    return render(
        "ranking.html.j2",
        title=ranking.spec.title,
        source=ranking.spec.source,
        rule=RULE,
        notes=[*ranking.spec.notes, *ranking.edited],
        quick=ranking.quick,
        missing=[one.spec.title for one in ranked.scores if one.missing],
        first=["place", "controller", "passed", "runs"],
        after=after,
        conditions=[
            {"name": name, "short": one.heading, "title": one.title}
            for name, one in ranking.conditions.items()
        ],
        rows=[_row(ranked, one, after, digits) for one in ranked.scores],
        states=STATES,
        pareto=_image(folder / FIGURES / "pareto.svg", "Stability over intervention"),
        table=Table("", table.columns, table.rows),
        described=_conditions(ranked),
        entries=_entries(ranked),
        cells=[_cell(ranked, one, cell, folder) for one in ranked.scores for cell in one.cells.values()],
        command=command,
        folder=str(folder),
        style=style(),
        assets=Markup(""),
        **made_by(),
    )


def _image(file: Path, title: str) -> FigureImage | None:
    return image_of(file, title) if file.is_file() else None


def _row(ranked: RankingResult, one: EntryScore, after: list[str], digits: Digits) -> dict[str, Any]:
    """Return the row of a controller in the first table."""
    row = row_of(one, digits)
    texts = Table("", after, [[row[heading] for heading in after]]).text()[0]
    return {
        "place": place_words(one),
        "title": one.spec.title,
        "tuned": one.spec.gains == "tuned",
        "passed": f"{one.count('passed')}/{len(one.cells)}" if one.place else f"{one.missing} missing",
        "share": row["runs"] if one.place else "–",
        "cells": [
            {
                "id": _id(cell),
                "state": cell.state,
                "words": sign_of(cell),
                "says": f"{one.spec.title}, {ranked.ranking.conditions[name].title}: {STATES[cell.state]}",
            }
            for name, cell in one.cells.items()
        ],
        "after": [text.replace("-", "–") if one.place else "–" for text in texts],
    }


def _id(cell: RankingCell) -> str:
    return anchor(f"{cell.entry} in {cell.condition}")


def _cell(ranked: RankingResult, one: EntryScore, cell: RankingCell, folder: Path) -> dict[str, Any]:
    """Return the details of a cell: its numbers, all its runs, its figure, its command."""
    condition = ranked.ranking.conditions[cell.condition]
    kept = next((run for run in cell.runs if run.results), None)
    picture = None
    if kept and kept.results and (kept.results / f"{RUN}.svg").is_file():
        picture = Path(os.path.relpath(kept.results / f"{RUN}.svg", folder)).as_posix()
    sums = {
        "runs that pass": f"{sum(run.passed for run in cell.runs)} of {len(cell.runs)}",
        "stability margin": spread(cell.margin, lambda x: f"{x:.1f} points"),
        "peak sideslip": spread(cell.sideslip, lambda x: f"{math.degrees(x):.1f}°"),
        "displacement": _text(cell.displacement, "m"),
        **{key.replace("_", " "): _text(cell.number(key), UNITS[key]) for key in OTHERS},
        "time per step": _text(cell.number(STEP_TIME), "s"),
    }
    return {
        "id": _id(cell),
        "title": f"{one.spec.title}: {condition.title}",
        "state": cell.state,
        "says": STATES[cell.state],
        "sums": [(name, text) for name, text in sums.items() if text is not None],
        "repeats": len({run.repeat for run in cell.runs}),
        "table": runs_table(cell),
        "picture": picture,
        "amplitude": degrees(kept.amplitude) if kept else "",
        "command": series_command(ranked, cell),
        "again": again_command(ranked, cell, folder),
    }  # fmt: skip


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
    words += ["--scenario", str(ranking.path.parent / condition.scenario)]
    words += ["--angle", f"{math.degrees(ranked.angles[condition.car]):.1f} deg"]
    changes = {
        one.target: one
        for one in (*ranking.changes_of_condition(cell.condition), *ranking.changes_of_entry(cell.entry))
    }
    for one in changes.values():
        words += option_of(one)
    return shlex.join(words)


def _conditions(ranked: RankingResult) -> Table:
    """Return the table of conditions."""
    ranking = ranked.ranking
    headings = ["condition", "car", "A", "scenario", "changed", "runs of a controller", "responsiveness"]
    table = Table("", headings)
    for name, one in ranking.conditions.items():
        runs = sum(run.condition == name for run in ranked.runs) // max(1, len(ranking.entries))
        own = ranking.changes_of_condition(name)
        told = [change for change in own if str(change.target) not in ("vehicle", "step_size", "stop_time")]
        table.rows.append([
            one.title, ranking.spec.cars[one.car].title, degrees(ranked.angles[one.car]), one.scenario,
            changed(told) or None, str(runs), "asked" if one.dry else "no dry road: not asked",
        ])  # fmt: skip
    return table


def _entries(ranked: RankingResult) -> Table:
    """Return the table of controllers."""
    table = Table("", ["controller", "name", "FMU", "parameters", "gains", "source"])
    for one in ranked.scores:
        spec: EntrySpec = one.spec
        given = ", ".join(f"{name} {number}" for name, number in spec.parameters.items())
        table.rows.append([spec.title, one.entry, spec.fmu, given or None, spec.gains, spec.source])
    return table

"""Tables of a ranking: controllers, conditions and runs, and the words in their cells."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from yawbench.figures.display import digits_of, shown
from yawbench.foundation.messages import counted
from yawbench.metrics.expressions import MetricValue
from yawbench.orchestrator.results.run_folder import load_record
from yawbench.orchestrator.results.run_record import RUN_FILE
from yawbench.proving_ground.sine_with_dwell import percent
from yawbench.studies.jobs import STEP_TIME
from yawbench.studies.run_remarks import lost_notes
from yawbench.studies.tables import Cell, Table, count_column, number_column, text_column

from .ranking_scores import (
    Digits,
    EntryScore,
    RankedRun,
    RankedState,
    RankingCell,
    best_beside,
    deciding_digits,
)

if TYPE_CHECKING:
    from yawbench.studies.confidence import ConfidenceInterval
    from yawbench.studies.pair_comparisons import ToldApart

    from .ranking_scores import RankingResult


def sign_of(cell: RankingCell) -> str:
    """Return the text of a cell: a check mark, a dash, or how many of its runs passed."""
    if cell.state is RankedState.MISSING:
        return "–"
    if cell.state is RankedState.PASSED:
        return "✓"
    passed, number = cell.counts
    return f"{passed}/{number}"


def state_words(run: RankedRun) -> str:
    """Return the state of a run as text, with the reason if it broke off."""
    broken = run.state is RankedState.BROKEN_OFF and run.record
    return f"{run.state.value}: {broken.reason}" if broken else run.state.value


def place_words(score: EntryScore) -> str:
    """Return the place of an entry as text, `–` if it is not ranked."""
    return str(score.place) if score.place else "–"


def interval_words(score: EntryScore) -> str | None:
    """Return the interval of the number of conditions passed; None if the entry is not ranked."""
    return None if score.bounds is None else f"{score.bounds.low:.0f} to {score.bounds.high:.0f}"


def apart_sentence(apart: ToldApart, idle: Sequence[bool]) -> str:
    """Return which entries can be told apart, in sentences; "" for a single one.

    Args:
        apart: the comparison of all pairs.
        idle: which entries are no control.
    """
    if len(idle) < 2:
        return ""
    controllers = [k for k, without in enumerate(idle) if not without]
    among = apart.of(controllers)
    better = apart.better[:, np.asarray(idle)].any(axis=1).sum()
    than_none = (
        f"{better} of {counted(len(controllers), 'controller')} are clearly better than no control. "
        if any(idle)
        else ""
    )
    if len(controllers) < 2:
        return than_none.strip()
    return (
        f"{than_none}Of two controllers one is clearly better in {among.better.sum()} of "
        f"{counted(math.comb(len(controllers), 2), 'pair')}, corrected for their number; each pair taken "
        f"alone, it would be in {among.alone.sum()}."
    )


def degrees(amplitude: float) -> str:
    """Return an amplitude in degrees, to a tenth."""
    return f"{math.degrees(abs(amplitude)):.1f}°"


def run_label(ranked: RankingResult, run: RankedRun) -> str:
    """Return the label of a run: its entry, side and amplitude."""
    title = ranked.ranking.entries[run.entry][0].title
    return f"{title}, {'right' if run.amplitude < 0 else 'left'} first, {degrees(run.amplitude)}"


MOST_NOTES = 4
"""Cells of which a note says why the car was lost. Chosen: a few lines each; the page has all."""


def lost_cells(ranked: RankingResult) -> list[str]:
    """Return why cars were lost in the worst runs of cells, beside the best run, as their records tell."""
    notes = []
    for cell in (cell for score in ranked.scores for cell in score.cells.values() if not cell.worst.passed):
        shown = [run for run in (cell.worst, best_beside(ranked.scores, cell)) if run]
        courses = [
            (run_label(ranked, run), load_record(run.results).events)
            for run in shown
            if run.results is not None and (run.results / RUN_FILE).is_file()
        ]
        if courses:
            title = ranked.ranking.conditions[cell.condition].title
            notes += [f"{title}: {note}" for note in lost_notes(courses) if note.startswith(courses[0][0])]
    return notes[:MOST_NOTES] + [f"{len(notes) - MOST_NOTES} more cells: see the page"] * (
        len(notes) > MOST_NOTES
    )


RULE = (
    "Order: the number of conditions passed, then the share of runs that pass, then the peak sideslip, the "
    "last two in the mean over conditions. Interval: 95 % of the number passed (Clopper and Pearson). Place: "
    "one more than the controllers that are clearly better, by exact tests corrected for their number, so "
    "those that cannot be told apart share it. A run passes if it meets the regulation's criteria with at "
    "most 20° of sideslip; a condition is passed if all of its runs pass."
)
UNITS = {
    "headroom": "points", "sideslip": "rad", "speed_lost": "m/s", "intervention": "N.m.s", "effort": "N.m.s",
    "chatter": "N.m/s",
}  # fmt: skip
"""Numbers of a cell -> unit; controllers have their means over conditions."""


def words_of(number: float | None, unit: str) -> Cell:
    """Return a number as a table cell; None if missing."""
    if number is None:
        return None
    if unit == "points":
        return digits_of(number, 2)
    return f"{digits_of(1e6 * number)} µs" if unit == "s" else MetricValue(number, unit)


def spread(confidence: ConfidenceInterval | None, words: Callable[[float], str]) -> str | None:
    """Return a mean over repeats with the half width of its confidence interval, if any."""
    if confidence is None:
        return None
    return (
        f"{words(confidence.mean)} ± {words(confidence.half)}" if confidence.half else words(confidence.mean)
    )


def share_text(share: float | None) -> str | None:
    """Return a share in per cent."""
    return None if share is None else f"{100.0 * share:.0f} %" if share >= 0.095 else f"{100.0 * share:.1f} %"


def row_of(score: EntryScore, digits: Digits) -> dict[str, Cell]:
    """Return the row of a controller: heading -> cell; `digits`: of the numbers that decide places."""
    slip = score.mean("sideslip")
    means = {
        key.replace("_", " "): words_of(score.mean(key), unit)
        for key, unit in UNITS.items()
        if key != "effort"
    }
    if slip is not None:
        means["sideslip"] = shown(slip, "rad", digits=digits.sideslip)
    row: dict[str, Cell] = {
        "place": place_words(score),
        "controller": score.spec.title,
        "gains": score.spec.gains,
        "passed": str(score.count(RankedState.PASSED)),
        "95 % interval": interval_words(score),
        "braking": share_text(score.braking),
        "spun": str(score.count(RankedState.SPUN)),
        "runs": shown(score.share, "%", digits=digits.share),
        **means,
        "time per step": words_of(score.step_time, "s"),
    }
    if score.place:
        return row
    kept = {"place", "controller", "gains"}
    lacking: dict[str, Cell] = {heading: row[heading] if heading in kept else None for heading in row}
    return {**lacking, "passed": f"{score.missing} missing"}


def table_of(ranked: RankingResult, *left_out: str) -> Table:
    """Return the table of controllers, best first; `left_out`: headings to omit."""
    digits = deciding_digits(ranked.scores)
    rows = [row_of(score, digits) for score in ranked.scores]
    kept = [heading for heading in rows[0] if heading not in left_out]
    if all(score.braking is None for score in ranked.scores):
        kept.remove("braking")
    texts = (
        "place",
        "passed",
        "95 % interval",
        "braking",
        "spun",
        "runs",
        "headroom",
        "sideslip",
        "time per step",
    )
    numbers = {kept.index(heading) for heading in texts if heading in kept}
    cells = [[row[heading] for heading in kept] for row in rows]
    return Table(ranked.ranking.spec.title, kept, [*cells], [RULE], numbers)


def runs_table(cell: RankingCell) -> Table:
    """Return the table of all runs of a cell."""
    repeated = len({run.repeat for run in cell.runs}) > 1
    mirrored = any(run.amplitude < 0 for run in cell.runs)
    units = {"displacement": "m", **{key: unit for key, unit in UNITS.items() if unit != "points"}}
    rows: list[dict[str, Cell]] = [
        {
            "amplitude": degrees(run.amplitude),
            "over A": f"{run.multiple:.2f}",
            **({"first to the": "left" if run.amplitude > 0 else "right"} if mirrored else {}),
            **({"seed": str(run.repeat)} if repeated else {}),
            "COS + 1 s": _ratio(run["ratio_1000"]),
            "COS + 1.75 s": _ratio(run["ratio_1750"]),
            **{k.replace("_", " "): words_of(run[k], unit) for k, unit in units.items() if k != "effort"},
            "verdict": state_words(run),
        }
        for run in cell.runs
    ]  # fmt: skip
    headings = list(rows[0])
    texts = ("amplitude", "over A", "COS + 1 s", "COS + 1.75 s")
    return Table("", headings, [[*row.values()] for row in rows], numbers=set(map(headings.index, texts)))


def _ratio(ratio: float | None) -> Cell:
    return None if ratio is None else percent(ratio)


def columns_of_entries(ranked: RankingResult) -> Table:
    """Return columns with a row per controller, in SI units."""
    rows = ranked.scores
    return Table.of_columns(
        [
            text_column("entry", (score.entry for score in rows)),
            text_column("title", (score.spec.title for score in rows)),
            text_column("gains", (score.spec.gains for score in rows)),
            count_column("place", (score.place for score in rows)),
            count_column("rank", (score.rank for score in rows)),
            count_column("conditions", (len(score.cells) for score in rows)),
            count_column("passed", (score.count(RankedState.PASSED) for score in rows)),
            number_column("passed_low", "1", (score.bounds and score.bounds.low for score in rows)),
            number_column("passed_high", "1", (score.bounds and score.bounds.high for score in rows)),
            number_column("braking", "1", (score.braking for score in rows)),
            count_column("spun", (score.count(RankedState.SPUN) for score in rows)),
            count_column("missing", (score.missing for score in rows)),
            number_column("share", "1", (None if score.missing else score.share for score in rows)),
            *(number_column(key, unit, [score.mean(key) for score in rows]) for key, unit in UNITS.items()),
            number_column("step_time", "s", (score.step_time for score in rows)),
        ]
    )


def columns_of_cells(ranked: RankingResult) -> Table:
    """Return columns with a row per controller and condition, in SI units."""
    cells = [cell for score in ranked.scores for cell in score.cells.values()]
    numbers = []
    for key, unit in {**UNITS, STEP_TIME: "s"}.items():
        own = (None if cell.missing else cell.number(key) for cell in cells)
        numbers.append(number_column(key, unit, own))
        if key in ("headroom", "sideslip"):
            over = (getattr(cell, key) for cell in cells)
            halves = (confidence and confidence.half for confidence in over)
            numbers.append(number_column(f"{key}_half_width", unit, halves))
        if key == "sideslip":
            least = (None if cell.missing else cell.displacement for cell in cells)
            numbers.append(number_column("displacement", "m", least))
    return Table.of_columns(
        [
            text_column("entry", (cell.entry for cell in cells)),
            text_column("condition", (cell.condition for cell in cells)),
            text_column("state", (cell.state.value for cell in cells)),
            count_column("runs", (cell.counts[1] for cell in cells)),
            count_column("passed", (cell.counts[0] for cell in cells)),
            *numbers,
        ]
    )


def columns_of_runs(ranked: RankingResult) -> Table:
    """Return columns with a row per run, in SI units."""
    runs = [run for score in ranked.scores for cell in score.cells.values() for run in cell.runs]
    units = {
        "ratio_1000": "1", "ratio_1750": "1", "displacement": "m", "sideslip": "rad", "speed": "m/s",
        "speed_end": "m/s", "intervention": "N.m.s", "effort": "N.m.s", "chatter": "N.m/s",
    }  # fmt: skip
    return Table.of_columns(
        [
            text_column("entry", (run.entry for run in runs)),
            text_column("condition", (run.condition for run in runs)),
            number_column("amplitude", "rad", (run.amplitude for run in runs)),
            text_column("repeat", (run.repeat for run in runs)),
            text_column("verdict", (state_words(run) for run in runs)),
            *(number_column(key, unit, [run[key] for run in runs]) for key, unit in units.items()),
            text_column("key", (run.job and run.job.key for run in runs)),
        ]
    )

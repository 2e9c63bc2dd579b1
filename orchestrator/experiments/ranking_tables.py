"""Tables of a ranking: controllers, cells and runs, for people and for programs."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from ..evaluation.dwell_run import percent
from ..figures.display import digits_of, shown
from ..metrics.run_metrics import Value
from .jobs import STEP_TIME
from .ranking_drawing import degrees, place_words
from .standings import Cell, Digits, Standing, deciding_digits
from .table import Column
from .tables import Cell as Words
from .tables import Table

if TYPE_CHECKING:
    from .confidence import Interval
    from .ranking_course import Ranked

RULE = (
    "Places: the number of conditions passed, then the share of runs that pass, then the peak sideslip, "
    "the last two in the mean over conditions. A run passes if it meets the regulation's criteria with at "
    "most 20° of sideslip; a condition is passed if all of its runs pass."
)
UNITS = {
    "margin": "points", "sideslip": "rad", "speed_lost": "m/s", "intervention": "N.m.s", "effort": "N.m.s",
    "chatter": "N.m/s",
}  # fmt: skip
"""Numbers of a cell, that are means over conditions for a controller -> unit."""


def words_of(number: float | None, unit: str) -> Words:
    """Return a number as tables show it; nothing for nothing."""
    if number is None:
        return None
    if unit == "points":
        return digits_of(number, 2)
    return f"{digits_of(1e6 * number)} µs" if unit == "s" else Value(number, unit)


def spread(one: Interval | None, words: Callable[[float], str]) -> str | None:
    """Return a mean over repeats with the half width of its confidence interval, if it has one."""
    if one is None:
        return None
    return f"{words(one.mean)} ± {words(one.half)}" if one.half else words(one.mean)


def row_of(one: Standing, digits: Digits) -> dict[str, Words]:
    """Return the row of a controller: heading -> cell; `digits`: of what decides places."""
    slip = one.mean("sideslip")
    means = {
        key.replace("_", " "): words_of(one.mean(key), unit) for key, unit in UNITS.items() if key != "effort"
    }
    if slip is not None:
        means["sideslip"] = shown(slip, "rad", digits=digits.sideslip)
    row: dict[str, Words] = {
        "place": place_words(one),
        "controller": one.spec.title,
        "gains": one.spec.gains,
        "passed": str(one.count("passed")),
        "spun": str(one.count("spun")),
        "runs": shown(one.share, "%", digits=digits.share),
        **means,
        "time per step": words_of(one.step_time, "s"),
    }
    if one.place:
        return row
    kept = {"place", "controller", "gains"}
    lacking: dict[str, Words] = {heading: row[heading] if heading in kept else None for heading in row}
    return {**lacking, "passed": f"{one.missing} missing"}


def table_of(ranked: Ranked, *left_out: str) -> Table:
    """Return the table of controllers, the first place first; `left_out`: headings."""
    digits = deciding_digits(ranked.standings)
    rows = [row_of(one, digits) for one in ranked.standings]
    kept = [heading for heading in rows[0] if heading not in left_out]
    texts = ("place", "passed", "spun", "runs", "margin", "sideslip", "time per step")
    numbers = {kept.index(heading) for heading in texts if heading in kept}
    cells = [[row[heading] for heading in kept] for row in rows]
    return Table(ranked.ranking.spec.title, kept, [*cells], [RULE], numbers)


def runs_table(cell: Cell) -> Table:
    """Return the table of all runs of a cell."""
    repeated = len({one.drive.repeat for one in cell.runs}) > 1
    mirrored = any(one.drive.amplitude < 0 for one in cell.runs)
    units = {"displacement": "m", **{key: unit for key, unit in UNITS.items() if unit != "points"}}
    rows: list[dict[str, Words]] = []
    for one in cell.runs:
        drive = one.drive
        rows.append({
            "amplitude": degrees(drive.amplitude),
            "over A": f"{drive.multiple:.2f}",
            **({"first to the": "left" if drive.amplitude > 0 else "right"} if mirrored else {}),
            **({"seed": str(drive.repeat)} if repeated else {}),
            "COS + 1 s": _ratio(one["ratio_1000"]),
            "COS + 1.75 s": _ratio(one["ratio_1750"]),
            **{k.replace("_", " "): words_of(one[k], unit) for k, unit in units.items() if k != "effort"},
            "verdict": one.verdict,
        })  # fmt: skip
    headings = list(rows[0])
    texts = ("amplitude", "over A", "COS + 1 s", "COS + 1.75 s")
    return Table("", headings, [[*row.values()] for row in rows], numbers=set(map(headings.index, texts)))


def _ratio(found: float | None) -> Words:
    return None if found is None else percent(found)


def _text(name: str, values: Iterable[object]) -> Column:
    return Column(name, "string", [None if value is None else str(value) for value in values])


def _counts(name: str, values: Iterable[int | None]) -> Column:
    return Column(name, "int64", list(values))


def _numbers(name: str, unit: str, values: Iterable[float | None]) -> Column:
    return Column(name, "float64", list(values), {"unit": unit})


def columns_of_entries(ranked: Ranked) -> list[Column]:
    """Return a row per controller, numbers in SI."""
    rows = ranked.standings
    return [
        _text("entry", (one.entry for one in rows)),
        _text("title", (one.spec.title for one in rows)),
        _text("gains", (one.spec.gains for one in rows)),
        _counts("place", (one.place for one in rows)),
        _counts("conditions", (len(one.cells) for one in rows)),
        _counts("passed", (one.count("passed") for one in rows)),
        _counts("spun", (one.count("spun") for one in rows)),
        _counts("missing", (one.missing for one in rows)),
        _numbers("share", "1", (None if one.missing else one.share for one in rows)),
        *(_numbers(key, unit, [one.mean(key) for one in rows]) for key, unit in UNITS.items()),
        _numbers("step_time", "s", (one.step_time for one in rows)),
    ]


def columns_of_cells(ranked: Ranked) -> list[Column]:
    """Return a row per controller and condition, numbers in SI."""
    cells = [cell for one in ranked.standings for cell in one.cells.values()]
    numbers = []
    for key, unit in {**UNITS, STEP_TIME: "s"}.items():
        numbers.append(_numbers(key, unit, [None if one.missing else one.number(key) for one in cells]))
        if key in ("margin", "sideslip"):
            over = [getattr(one, key) for one in cells]
            numbers.append(_numbers(f"{key}_half_width", unit, [one and one.half for one in over]))
    least = _numbers("displacement", "m", (None if one.missing else one.displacement for one in cells))
    return [
        _text("entry", (one.entry for one in cells)),
        _text("condition", (one.condition for one in cells)),
        _text("state", (one.state for one in cells)),
        _counts("runs", (len(one.runs) for one in cells)),
        _counts("passed", (sum(run.passed for run in one.runs) for one in cells)),
        *numbers[:4],
        least,
        *numbers[4:],
    ]


def columns_of_runs(ranked: Ranked) -> list[Column]:
    """Return a row per run, numbers in SI."""
    runs = [run for one in ranked.standings for cell in one.cells.values() for run in cell.runs]
    units = {
        "ratio_1000": "1", "ratio_1750": "1", "displacement": "m", "sideslip": "rad", "speed": "m/s",
        "speed_end": "m/s", "intervention": "N.m.s", "effort": "N.m.s", "chatter": "N.m/s",
    }  # fmt: skip
    return [
        _text("entry", (run.drive.entry for run in runs)),
        _text("condition", (run.drive.condition for run in runs)),
        _numbers("amplitude", "rad", (run.drive.amplitude for run in runs)),
        _text("repeat", (run.drive.repeat for run in runs)),
        _text("verdict", (run.verdict for run in runs)),
        *(_numbers(key, unit, [run[key] for run in runs]) for key, unit in units.items()),
        _text("key", (run.drive.key for run in runs)),
    ]

"""Tables of a ranking: controllers, cells and runs, for people and for programs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from ..evaluation.dwell_run import percent
from ..figures.display import digits_of
from ..metrics.run_metrics import Value
from .jobs import STEP_TIME
from .ranking_drawing import degrees, place_words
from .standings import Cell, Driven, Standing
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
HEADINGS = [
    "place", "controller", "gains", "passed", "spun", "runs", "margin", "sideslip", "speed lost",
    "intervention", "chatter", "time per step",
]  # fmt: skip


def value(number: float | None, unit: str) -> Words:
    """Return a number with its unit, nothing for nothing."""
    return None if number is None else Value(number, unit)


def points(number: float | None) -> Words:
    """Return a margin in points of per cent."""
    return None if number is None else digits_of(number, 2)


def step_time(seconds: float | None) -> str | None:
    """Return the processor time of a step in microseconds."""
    return None if seconds is None else f"{digits_of(1e6 * seconds)} µs"


def spread(one: Interval | None, words: Callable[[float], str]) -> str | None:
    """Return a mean over repeats with the half width of its confidence interval, if it has one."""
    if one is None:
        return None
    return f"{words(one.mean)} ± {words(one.half)}" if one.half else words(one.mean)


def table_of(ranked: Ranked, *left_out: str) -> Table:
    """Return the table of controllers, the first place first; `left_out`: headings."""
    kept = [k for k, heading in enumerate(HEADINGS) if heading not in left_out]
    title, numbers = ranked.ranking.spec.title, {kept.index(k) for k in (0, 3, 4, 6, 11) if k in kept}
    rows = [row_of(one) for one in ranked.standings]
    return Table(
        title, [HEADINGS[k] for k in kept], [[row[k] for k in kept] for row in rows], [RULE], numbers
    )


def row_of(one: Standing) -> list[Words]:
    """Return the row of a controller."""
    if not one.place:
        return ["–", one.spec.title, one.spec.gains, f"{one.missing} missing", *[None] * 8]
    return [
        place_words(one),
        one.spec.title,
        one.spec.gains,
        str(one.count("passed")),
        str(one.count("spun")),
        value(one.share, "%"),
        points(one.mean("margin")),
        value(one.mean("sideslip"), "rad"),
        value(one.mean("speed_lost"), "m/s"),
        value(one.mean("intervention"), "N.m.s"),
        value(one.mean("chatter"), "N.m/s"),
        step_time(one.step_time),
    ]


def runs_table(cell: Cell) -> Table:
    """Return the table of all runs of a cell."""
    repeated = len({one.drive.repeat for one in cell.runs}) > 1
    mirrored = any(one.drive.amplitude < 0 for one in cell.runs)
    headings = [
        "amplitude", "over A", *(["first to the"] if mirrored else []), *(["seed"] if repeated else []),
        "COS + 1 s", "COS + 1.75 s", "displacement", "sideslip", "speed lost", "intervention", "chatter",
        "verdict",
    ]  # fmt: skip
    table = Table("", headings, numbers={0, 1, headings.index("COS + 1 s"), headings.index("COS + 1.75 s")})
    for one in cell.runs:
        drive = one.drive
        table.rows.append(
            [
                degrees(drive.amplitude), f"{drive.multiple:.2f}",
                *([("left" if drive.amplitude > 0 else "right")] if mirrored else []),
                *([str(drive.repeat)] if repeated else []),
                *(_ratio(one, key) for key in ("ratio_1000", "ratio_1750")),
                value(one["displacement"], "m"), value(one["sideslip"], "rad"), value(one.speed_lost, "m/s"),
                value(one["intervention"], "N.m.s"), value(one["chatter"], "N.m/s"), one.verdict,
            ]
        )  # fmt: skip
    return table


def _ratio(run: Driven, key: str) -> Words:
    found = run[key]
    return None if found is None else percent(found)


def columns_of_entries(ranked: Ranked) -> list[Column]:
    """Return a row per controller, numbers in SI."""
    rows = ranked.standings

    def numbers(name: str, unit: str, key: str) -> Column:
        return Column(name, "float64", [one.mean(key) for one in rows], {"unit": unit})

    return [
        Column("entry", "string", [one.entry for one in rows]),
        Column("title", "string", [one.spec.title for one in rows]),
        Column("gains", "string", [one.spec.gains for one in rows]),
        Column("place", "int64", [one.place for one in rows]),
        Column("conditions", "int64", [len(one.cells) for one in rows]),
        Column("passed", "int64", [one.count("passed") for one in rows]),
        Column("spun", "int64", [one.count("spun") for one in rows]),
        Column("missing", "int64", [one.missing for one in rows]),
        Column("share", "float64", [None if one.missing else one.share for one in rows], {"unit": "1"}),
        numbers("margin", "points", "margin"),
        numbers("sideslip", "rad", "sideslip"),
        numbers("speed_lost", "m/s", "speed_lost"),
        numbers("intervention", "N.m.s", "intervention"),
        numbers("effort", "N.m.s", "effort"),
        numbers("chatter", "N.m/s", "chatter"),
        Column("step_time", "float64", [one.step_time for one in rows], {"unit": "s"}),
    ]


def columns_of_cells(ranked: Ranked) -> list[Column]:
    """Return a row per controller and condition, numbers in SI."""
    cells = [cell for one in ranked.standings for cell in one.cells.values()]

    def numbers(name: str, unit: str, number: Callable[[Cell], Any]) -> Column:
        return Column(
            name, "float64", [None if cell.missing else number(cell) for cell in cells], {"unit": unit}
        )

    def ends(name: str, unit: str, of: Callable[[Cell], Interval | None]) -> list[Column]:
        return [
            numbers(name, unit, lambda cell: one.mean if (one := of(cell)) else None),
            numbers(f"{name}_half_width", unit, lambda cell: one.half if (one := of(cell)) else None),
        ]

    def means(name: str, unit: str) -> Column:
        return numbers(name, unit, lambda cell: cell.mean(name))

    return [
        Column("entry", "string", [cell.entry for cell in cells]),
        Column("condition", "string", [cell.condition for cell in cells]),
        Column("state", "string", [cell.state for cell in cells]),
        Column("runs", "int64", [len(cell.runs) for cell in cells]),
        Column("passed", "int64", [sum(one.passed for one in cell.runs) for cell in cells]),
        *ends("margin", "points", lambda cell: cell.margin),
        *ends("sideslip", "rad", lambda cell: cell.sideslip),
        numbers("displacement", "m", lambda cell: cell.displacement),
        *(means(name, unit) for name, unit in (("speed_lost", "m/s"), ("intervention", "N.m.s"),
                                               ("effort", "N.m.s"), ("chatter", "N.m/s"), (STEP_TIME, "s"))),
    ]  # fmt: skip


def columns_of_runs(ranked: Ranked) -> list[Column]:
    """Return a row per run, numbers in SI."""
    runs: Sequence[Driven] = [
        run for one in ranked.standings for cell in one.cells.values() for run in cell.runs
    ]
    keys = (
        ("ratio_1000", "1"), ("ratio_1750", "1"), ("displacement", "m"), ("sideslip", "rad"),
        ("speed", "m/s"), ("speed_end", "m/s"), ("intervention", "N.m.s"), ("effort", "N.m.s"),
        ("chatter", "N.m/s"),
    )  # fmt: skip
    return [
        Column("entry", "string", [run.drive.entry for run in runs]),
        Column("condition", "string", [run.drive.condition for run in runs]),
        Column("amplitude", "float64", [run.drive.amplitude for run in runs], {"unit": "rad"}),
        Column("repeat", "string", [None if (r := run.drive.repeat) is None else str(r) for run in runs]),
        Column("verdict", "string", [run.verdict for run in runs]),
        *(Column(key, "float64", [run[key] for run in runs], {"unit": unit}) for key, unit in keys),
        Column("key", "string", [run.drive.key for run in runs]),
    ]

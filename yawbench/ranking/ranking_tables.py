"""Tables and figures of a ranking: controllers, conditions and runs; stability over intervention."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from yawbench.figures.display import digits_of, shown
from yawbench.figures.style import QUIET, frame, literal, new_figure
from yawbench.foundation.errors import ResultsError
from yawbench.foundation.messages import counted, in_text, listed
from yawbench.metrics.expressions import MetricValue
from yawbench.proving_ground.sine_with_dwell import percent
from yawbench.studies.jobs import STEP_TIME
from yawbench.studies.tables import Cell, Column, Table, column

from .ranking_scores import Digits, EntryScore, RankedRun, RankedState, RankingCell, deciding_digits
from .threat_scores import ComparedGains, GainsAndLaws, Spread

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from yawbench.studies.confidence import ConfidenceInterval, ToldApart

    from .ranking_scores import RankingResult
    from .threat_runs import ThreatResult


COLOURS = {
    RankedState.PASSED: "#BFE5D8",
    RankedState.SPUN: "#F7E3A1",
    RankedState.FAILED: "#F6CDB4",
    RankedState.MISSING: "#FFFFFF",
}
"""Colours of cells, which their text also tells apart."""
TUNED = {"authors": ("o", "#0072B2"), "tuned": ("D", "#D55E00")}
FIRST_SEED = "1"
"""Seed of the tuned entries of a ranking itself."""
ROW = 0.235
"""Height of a row of the matrix [inch]."""


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


def draw_matrix(ranked: RankingResult, note: str) -> Figure:
    """Draw which controller passes which condition: a row per controller, best at the top."""
    from matplotlib.patches import Patch, Rectangle

    rows = ranked.scores
    conditions = ranked.ranking.conditions
    wide = len(conditions)
    digits = deciding_digits(rows)
    beside = ((-5.1, "right", "place"), (wide + 0.15, "left", "passed"), (wide + 2.05, "right", "runs"))
    with new_figure() as figure:
        axes = figure.subplots()
        for i, score in enumerate(rows):
            for k, name in enumerate(conditions):
                cell = score.cells[name]
                colour = COLOURS[cell.state]
                axes.add_patch(Rectangle((k, i), 1, 1, facecolor=colour, edgecolor="white", linewidth=1.2))
                axes.text(k + 0.5, i + 0.52, sign_of(cell), ha="center", va="center", fontsize=7.5)
            axes.text(-0.15, i + 0.52, literal(score.spec.title), va="center", ha="right", fontsize=8.5)
            counted = (
                f"{score.count(RankedState.PASSED)} of {wide}" if score.place else f"{score.missing} missing"
            )
            share = shown(score.share, "%", digits=digits.share) if score.place else ""
            for (x, side, _), text in zip(beside, (place_words(score), counted, share), strict=True):
                weight = "bold" if x < 0 else "normal"
                axes.text(x, i + 0.52, text, va="center", ha=side, fontsize=8, weight=weight)
        for k, spec in enumerate(conditions.values()):
            axes.text(k + 0.35, -0.15, literal(spec.heading), rotation=40, va="bottom", fontsize=8)
        for x, side, text in beside:
            axes.text(x, -0.15, text, ha=side, va="bottom", fontsize=8, color=QUIET)
        axes.set(xlim=(-5.5, wide + 2.2), ylim=(len(rows) + 0.1, -4.2))
        axes.set_axis_off()
        handles = [
            Patch(facecolor=COLOURS[RankedState.PASSED], label="passed: all runs pass"),
            Patch(
                facecolor=COLOURS[RankedState.SPUN], label="spun: criteria met, but more than 20° of sideslip"
            ),
            Patch(facecolor=COLOURS[RankedState.FAILED], label="failed; runs that pass of all"),
        ]
        frame(figure, ROW * (len(rows) + 4.3), handles, ranked.ranking.spec.title, note)
    return figure


def draw_pareto(ranked: RankingResult, note: str) -> Figure:
    """Draw stability over intervention: a point per controller, the Pareto front as a line.

    Controllers that never act are listed in the note, since they lie far from all others.

    Raises:
        ResultsError: there is no controller to draw.
    """
    every = [
        (1e-3 * x, y, score)
        for score in ranked.scores
        if (x := score.mean("intervention")) is not None and (y := score.mean("headroom")) is not None
    ]
    points = [point for point in every if point[2].mean("effort")]
    left_out = [f"{score.spec.title}: {y:.0f} points" for _, y, score in every if not score.mean("effort")]
    if not points:
        raise ResultsError(
            "nothing to draw: no controller that acts has all of its runs.", code="nothing-to-draw"
        )
    front = [
        point
        for point in sorted(points, key=lambda point: point[:2])
        if not any(x <= point[0] and y >= point[1] and (x, y) != point[:2] for x, y, _ in points)
    ]
    with new_figure() as figure:
        axes = figure.subplots()
        for x, y, score in points[::-1]:
            marker, colour = TUNED[score.spec.gains]
            axes.plot(
                [x], [y], marker, color=colour, markersize=13, zorder=3, markeredgecolor="white",
                label=f"gains: {score.spec.gains}",
            )  # fmt: skip
            axes.text(
                x, y, str(score.rank), color="white", fontsize=7, weight="bold", ha="center", va="center",
                zorder=3,
            )  # fmt: skip
        best = [x for x, *_ in front], [y for _, y, _ in front]
        axes.plot(*best, color=QUIET, linewidth=1.0, zorder=1, label="none is better in both:")
        for _, _, score in front:
            axes.plot([], [], " ", label=f"{score.rank}  {score.spec.title}")
        axes.set_xlabel("Intervention: ∫|torque| dt of the wheel that gets most, once steered, mean [kN·m·s]")
        axes.set_title("Headroom: percentage points below the limits, least of each condition, mean")
        handles = {str(line.get_label()): line for line in axes.get_lines()}
        title = "Stability over intervention; numbers are ranks in the order"
        frame(figure, 4.9, list(handles.values()), title, " · ".join([*left_out, note]))
    return figure


def degrees(amplitude: float) -> str:
    """Return an amplitude in degrees, to a tenth."""
    return f"{math.degrees(abs(amplitude)):.1f}°"


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
    texts = ("place", "passed", "95 % interval", "spun", "runs", "headroom", "sideslip", "time per step")
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


def _text(name: str, values: Iterable[object]) -> tuple[Column, Sequence[Cell]]:
    return column(name, "string", [None if value is None else str(value) for value in values])


def _counts(name: str, values: Iterable[int | None]) -> tuple[Column, Sequence[Cell]]:
    return column(name, "int64", list(values))


def _numbers(name: str, unit: str, values: Iterable[float | None]) -> tuple[Column, Sequence[Cell]]:
    return column(name, "float64", list(values), {"unit": unit})


def columns_of_entries(ranked: RankingResult) -> Table:
    """Return columns with a row per controller, in SI units."""
    rows = ranked.scores
    return Table.of_columns(
        [
            _text("entry", (score.entry for score in rows)),
            _text("title", (score.spec.title for score in rows)),
            _text("gains", (score.spec.gains for score in rows)),
            _counts("place", (score.place for score in rows)),
            _counts("rank", (score.rank for score in rows)),
            _counts("conditions", (len(score.cells) for score in rows)),
            _counts("passed", (score.count(RankedState.PASSED) for score in rows)),
            _numbers("passed_low", "1", (score.bounds and score.bounds.low for score in rows)),
            _numbers("passed_high", "1", (score.bounds and score.bounds.high for score in rows)),
            _counts("spun", (score.count(RankedState.SPUN) for score in rows)),
            _counts("missing", (score.missing for score in rows)),
            _numbers("share", "1", (None if score.missing else score.share for score in rows)),
            *(_numbers(key, unit, [score.mean(key) for score in rows]) for key, unit in UNITS.items()),
            _numbers("step_time", "s", (score.step_time for score in rows)),
        ]
    )


def columns_of_cells(ranked: RankingResult) -> Table:
    """Return columns with a row per controller and condition, in SI units."""
    cells = [cell for score in ranked.scores for cell in score.cells.values()]
    numbers = []
    for key, unit in {**UNITS, STEP_TIME: "s"}.items():
        numbers.append(_numbers(key, unit, [None if cell.missing else cell.number(key) for cell in cells]))
        if key in ("headroom", "sideslip"):
            over = [getattr(cell, key) for cell in cells]
            numbers.append(
                _numbers(f"{key}_half_width", unit, [confidence and confidence.half for confidence in over])
            )
        if key == "sideslip":
            least = (None if cell.missing else cell.displacement for cell in cells)
            numbers.append(_numbers("displacement", "m", least))
    return Table.of_columns(
        [
            _text("entry", (cell.entry for cell in cells)),
            _text("condition", (cell.condition for cell in cells)),
            _text("state", (cell.state.value for cell in cells)),
            _counts("runs", (cell.counts[1] for cell in cells)),
            _counts("passed", (cell.counts[0] for cell in cells)),
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
            _text("entry", (run.entry for run in runs)),
            _text("condition", (run.condition for run in runs)),
            _numbers("amplitude", "rad", (run.amplitude for run in runs)),
            _text("repeat", (run.repeat for run in runs)),
            _text("verdict", (state_words(run) for run in runs)),
            *(_numbers(key, unit, [run[key] for run in runs]) for key, unit in units.items()),
            _text("key", (run.job and run.job.key for run in runs)),
        ]
    )


def gains_table(result: ThreatResult, compared: ComparedGains) -> Table:
    """Return the table of spreads, in per cent of a threat's range, a group of laws per pair of columns."""
    threats = result.threats
    groups = compared.groups.values()
    parts = {
        "between seeds of the search, within a law": [gains.seeds for gains in groups],
        "between the studies' and tuned gains, within a law": [gains.gains for gains in groups],
        "between laws, means of both gains": [gains.between for gains in groups],
        "the third less the fourth": [gains.difference for gains in groups],
    }

    def cells(spreads: Sequence[Spread], factor: float = 1.0) -> list[str | None]:
        """Return the value and the interval of each spread."""
        numbers = [[factor * x for x in (spread.value, *spread.bounds)] for spread in spreads]
        return [text for x, low, high in numbers for text in (f"{x:.1f}", f"{low:.1f} to {high:.1f}")]

    between = [cell for gains in groups for cell in (f"{100.0 * gains.laws:.1f}", None)]
    rows = [["between laws, tuned", *between]]
    rows += [[words, *cells(spreads, 100.0)] for words, spreads in parts.items()]
    rows.append(["ratio of the first to the second", *cells([gains.ratio for gains in groups])])
    headings = ["standard deviation of the mean level, % of a range"]
    for title in compared.groups:
        headings += [title, "95 % interval"]
    seeds = 1 + len(threats.spec.settings[compared.setting].seeds)
    searched = threats.threats_in(compared.setting), threats.cars_in(compared.setting), seeds
    notes = [
        f"Threats: {', '.join(searched[0])}; cars: {', '.join(searched[1])}; {searched[2]} seeds of the "
        "search. Intervals hold on these threats and cars: those of seeds and of the ratio are exact if laws "
        "and seeds are samples of normal distributions, the others of a jackknife over laws, which holds the "
        "truth in 80 to 97 % of samples of so few. The first two are components of variance."
    ]
    return Table("", headings, [*rows], notes, {*range(1, len(headings))})


def gains_sentence(result: ThreatResult, compared: ComparedGains) -> str:
    """Return whether gains matter more than laws, and laws more than the luck of their search."""
    titles = {name: spec.title for name, (spec, _) in result.threats.ranking.entries.items()}
    return " ".join(
        _gains_of_group(title, gains, [in_text(titles[compared.laws[title][k]]) for k in gains.resting])
        for title, gains in compared.groups.items()
    )


def _gains_of_group(title: str, gains: GainsAndLaws, resting: Sequence[str]) -> str:
    low, high = gains.difference.bounds
    if low > 0.0:
        verdict = "gains matter more than laws: the interval of the difference is above zero"
    elif high < 0.0:
        verdict = "laws matter more than gains: the interval of the difference is below zero"
    else:
        verdict = (
            "whether gains matter more than laws is undecided: the interval of the difference holds zero"
        )
    if resting:
        verdict += f", but it rests on the study gains of {listed(resting)}, without which it is not"
    ratio = gains.ratio
    luck = (
        "more than the luck of the search" if ratio.bounds.low > 0.0 else "no more than the search's luck may"
    )
    times = f"{ratio.value:.1f} times ({ratio.bounds.low:.1f} to {ratio.bounds.high:.1f})"
    by = f"F({gains.degrees[0]}, {gains.degrees[1]}) = {gains.f:.1f}"
    return f"Among {title}, {verdict}; tuned alike, laws vary {luck} ({by}), {times} as much as seeds of it."


def seeds_table(result: ThreatResult, compared: ComparedGains) -> Table:
    """Return the table of mean levels of each law with the gains of its study and of every seed."""
    threats = result.threats
    seeds = [FIRST_SEED, *threats.spec.settings[compared.setting].seeds]
    headings = ["mean level, % of a range", "study", *(f"seed {seed}" for seed in seeds)]
    rows = [
        [threats.ranking.entries[law][0].title, *(f"{100 * mean:.1f}" for mean in means)]
        for law, means in compared.means.items()
    ]
    return Table("", headings, [*rows], numbers={*range(1, len(headings))})

"""Claims, checks and limits judged by the metrics of runs, grids beside a paper's; verdicts over a region.

The verdict on a claim is that of the condition that decides it: all conditions must be true, so its margin is
the smallest of theirs. Where the bound is another run's metric, it is the value of that metric at the same
point; where a bound is 0, the margin is relative to the number at the chosen point (see `metrics.verdict`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

from yawbench.figures.display import DIGITS, digits_apart, digits_of, shown
from yawbench.foundation.errors import ScenarioError
from yawbench.metrics.expressions import MetricValue
from yawbench.metrics.verdict import Status, Verdict, compare, worst

from .claim_schema import Assertion, Claim, Condition, GridSpec, MetricReference, rank_correlation, si_number
from .confidence import Bounds, Decision, SequentialTest

ONE_IN = 10
"""A verdict is robust if it flips in less than one tenth of a region. Chosen: fewer are exceptions that can
be named."""
TIMES = "× as chosen"
"""Unit of an open value that is a factor, where the runs have different chosen values."""


@dataclass(frozen=True)
class LevelVerdict:
    """Verdict at a level of one open value, with all others as chosen."""

    words: str
    number: float | None  # in the unit of the scan; None: not numeric
    verdict: Verdict


@dataclass(frozen=True)
class Flip:
    """The level of one open value at which a verdict changes."""

    open_value: str
    says: str  # label of the open value
    words: str  # the level of the flip, with its unit
    number: float | None  # interpolated linearly by margins; None: not numeric
    distance: float  # from the chosen value, relative to the range
    chosen: str = ""  # the chosen value with its unit; "" if the runs differ in it


@dataclass(frozen=True)
class OpenValueScan:
    """Verdicts along one open value, from end to end of its range."""

    open_value: str
    says: str
    unit: str  # unit of the numbers; "" if they have none
    factor: float  # of a level's number to the displayed one
    chosen: LevelVerdict
    levels: tuple[LevelVerdict, ...]  # without the chosen one

    @property
    def margins(self) -> tuple[float, float] | None:
        """The smallest and the largest margin of the scan, including the chosen point."""
        every = [level.verdict.margin for level in (self.chosen, *self.levels)]
        known = [margin for margin in every if margin is not None]
        return (min(known), max(known)) if known else None

    @property
    def flip(self) -> Flip | None:
        """The flip nearest to the chosen value; levels without a result are ignored."""
        chosen = self.chosen.verdict.holds
        known = [level for level in self.levels if level.verdict.holds is not None]
        others = [level for level in known if level.verdict.holds != chosen]
        if not others or chosen is None:
            return None
        if self.chosen.number is None:
            return Flip(self.open_value, self.says, others[0].words, None, 1.0)
        start = self.chosen.number
        ascending = sorted((self.chosen, *known), key=lambda level: level.number or 0.0)
        flips = []
        for pair in itertools.pairwise(ascending):
            near, far = sorted(pair, key=lambda level: abs((level.number or 0.0) - start))
            if near.verdict.holds != far.verdict.holds:
                flips.append(_between(near, far))
        nearest = min(flips, key=lambda flip: abs(flip - start))
        numbers = [level.number or 0.0 for level in ascending]
        distance = abs(nearest - start) / (max(numbers) - min(numbers))
        words = "" if self.unit == TIMES else self.words(start)
        return Flip(self.open_value, self.says, self.words(nearest), nearest, distance, words)

    def words(self, number: float) -> str:
        """Return a number of the scan as text, in the display unit."""
        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        return f"{digits_of(number * self.factor)}{unit}"


def _between(a: LevelVerdict, b: LevelVerdict) -> float:
    """Return where the margin is zero between two levels, by linear interpolation."""
    assert a.number is not None
    assert b.number is not None
    first, last = a.verdict.margin, b.verdict.margin
    if first is None or last is None or not math.isfinite(first - last) or first == last:
        return b.number
    return a.number + (b.number - a.number) * min(max(first / (first - last), 0.0), 1.0)


@dataclass(frozen=True)
class Region:
    """Verdicts on one claim over a region of open values."""

    chosen: Verdict
    points: tuple[Verdict, ...]  # of a Latin hypercube over all open values together
    lines: tuple[OpenValueScan, ...]  # of one open value each
    test: SequentialTest  # of the share of points with another verdict

    @property
    def holding(self) -> int:
        """The number of points at which the claim holds."""
        return sum(point.holds is True for point in self.points)

    @property
    def without_result(self) -> int:
        """The number of points without a verdict because a run failed; they count as changed verdicts."""
        return sum(point.holds is None for point in self.points)

    @property
    def agreeing(self) -> float:
        """The share of points with the same verdict as the chosen point."""
        return 1.0 - self.flipping / len(self.points)

    @property
    def spread(self) -> float | None:
        """Decrease of the margin in the worst tenth of the points [1].

        The distance from the margin at the chosen point to the best one of that tenth: infinite if runs
        failed there, 0 if it is larger than at the chosen point.
        """
        if self.chosen.margin is None or self.chosen.holds is None:
            return None
        sign = 1.0 if self.chosen.holds else -1.0
        margins = sorted(-math.inf if at.margin is None else sign * at.margin for at in self.points)
        worst_tenth = margins[(len(margins) - 1) // ONE_IN]
        return max(sign * self.chosen.margin - worst_tenth, 0.0)

    @property
    def flipping(self) -> int:
        """The number of points with another verdict than the chosen point."""
        return sum(point.holds != self.chosen.holds for point in self.points)

    @property
    def flip_bounds(self) -> Bounds:
        """The confidence interval of the share of the region with another verdict."""
        return self.test.bounds(self.flipping, len(self.points))

    @property
    def robust(self) -> bool:
        """Whether it is known that less than one tenth of the region flips the verdict."""
        return self.decision is Decision.BELOW

    @property
    def decision(self) -> Decision:
        """Whether the share of the region that flips the verdict is known to be below or above a tenth."""
        return self.test.decision(self.flipping, len(self.points))

    @property
    def flip(self) -> Flip | None:
        """The flip nearest to the chosen point, by distance relative to each range."""
        flips = [flip for line in self.lines if (flip := line.flip)]
        return min(flips, key=lambda flip: flip.distance, default=None)


MetricTable = Mapping[tuple[str, str], MetricValue]
"""(run, metric key) -> value, where there is one."""


@dataclass(frozen=True)
class GridCell:
    """A cell of a grid: its run and metric, row and column, and the published number, if any."""

    run: str  # "" for a derived number
    metric: str  # or the key of a derived number
    row: str
    column: str
    published: float | None

    @property
    def key(self) -> tuple[str, str]:
        """Key of the cell's value in a `MetricTable`."""
        return self.run, self.metric


def cells(spec: GridSpec) -> list[GridCell]:
    """Return the cells row by row, then the runs outside the grid, whose column is empty."""
    ((row_key, rows),) = spec.rows.items()
    ((column_key, columns),) = spec.columns.items()
    in_grid = []
    for (i, row), (k, column) in itertools.product(enumerate(rows), enumerate(columns)):
        run, derived = (
            text.replace(f"{{{row_key}}}", row).replace(f"{{{column_key}}}", column)
            for text in (spec.run, spec.derived)
        )
        published = spec.published[i][k] if spec.published else None
        in_grid.append(GridCell(run, spec.metric or derived, rows[row], columns[column], published))
    return in_grid + [GridCell(cell.run, spec.metric, cell.says, "", cell.published) for cell in spec.beside]


def ranked(spec: GridSpec, only: Mapping[str, Collection[str]] | None = None) -> list[GridCell]:
    """Return the cells whose order is compared with the paper's: those with a published number.

    Args:
        spec: the grid.
        only: name of rows or columns -> values to include; excludes runs outside the grid.
    """
    among = [cell for cell in cells(spec) if cell.published is not None]
    if not only:
        return among
    ((row_key, rows),), ((column_key, columns),) = spec.rows.items(), spec.columns.items()
    kept = {words for value, words in rows.items() if value in only.get(row_key, rows)}
    in_columns = {words for value, words in columns.items() if value in only.get(column_key, columns)}
    return [cell for cell in among if cell.row in kept and cell.column in in_columns]


def correlation(
    spec: GridSpec, values: MetricTable, only: Mapping[str, Collection[str]] | None = None
) -> float | None:
    """Return Spearman's rank correlation with the published values; None if a run is missing.

    Args:
        spec: the grid.
        values: metrics of the runs.
        only: see `ranked`.
    """
    among = ranked(spec, only)
    pairs = [
        (value.number, cell.published)
        for cell in among
        if cell.published is not None and (value := values.get(cell.key)) is not None
    ]
    if len(pairs) < max(len(among), 2):
        return None
    measured, published = zip(*pairs, strict=True)
    return rank_correlation(measured, published)


@dataclass(frozen=True)
class Judgement:
    """An assertion compared with the metrics of runs."""

    verdict: Verdict
    parts: tuple[Verdict, ...] = ()  # one per condition and run
    measured: tuple[str, ...] = ()  # the numbers of each condition in words

    @property
    def certain(self) -> bool:
        """Whether the verdict is beyond chance: no deciding bound lies within a confidence interval."""
        if self.verdict.holds is False:
            return any(part.certain for part in self.parts if part.holds is False) or not self.parts
        return self.verdict.holds is None or all(part.certain for part in self.parts)

    def scaled(self, chosen: Judgement) -> Verdict:
        """Return the verdict with its margin relative to the numbers at the chosen point."""
        parts = zip(self.parts, chosen.parts, strict=True)
        return _all([part.scaled(at) for part, at in parts])


@dataclass(frozen=True, kw_only=True)
class ClaimResult(Judgement):
    """A claim or check with its verdict at the chosen point and over the region."""

    claim: Claim
    region: Region | None = None
    group: str = "claims"  # `claims` of a paper, or our own `checks`

    @property
    def status(self) -> Status:
        """Status of the verdict, as far as chance and the region of open values let it stand."""
        if self.verdict.holds is None:
            return self.verdict.status
        if not self.certain:
            return Status.UNDECIDED
        if self.region is None or self.region.robust:
            return self.verdict.status
        return Status.SENSITIVE if self.region.decision is Decision.ABOVE else Status.UNDECIDED


def judge(
    assertion: Assertion,
    values: MetricTable,
    runs: Mapping[str, str],
    derived: Mapping[str, MetricValue] | None = None,
) -> Judgement:
    """Judge a claim, check or limit by the metrics of runs.

    Args:
        assertion: all its conditions must be true for every run they name.
        values: metrics of the runs.
        runs: name -> label of all runs, including those without values.
        derived: key -> derived number, where there is one.

    Raises:
        ScenarioError: a bound has a unit that does not fit its metric.
    """
    compared = [_compare(condition, values, runs, derived or {}) for condition in assertion.holds_if]
    parts = [part for verdicts, _ in compared for part in verdicts]
    return Judgement(_all(parts), tuple(parts), tuple(dict.fromkeys(text for _, text in compared)))


def _all(parts: Sequence[Verdict]) -> Verdict:
    """Return the verdict on conditions that must all be true; not judged if a number is missing."""
    missing = next((part for part in parts if part.status is Status.NOT_JUDGED), None)
    margins = [part.margin for part in parts if part.margin is not None]
    deciding = missing or worst(parts) or Verdict(Status.PASSED)
    return replace(deciding, margin=None if missing else min(margins, default=None))


def _compare(
    condition: Condition, values: MetricTable, runs: Mapping[str, str], derived: Mapping[str, MetricValue]
) -> tuple[list[Verdict], str]:
    """Return the verdict for each run that a condition names, and all values as text."""
    bound = condition.bound
    if condition.derived:
        named, measured = [""], [("", derived.get(condition.derived))]
    else:
        named = [run for run in runs if fnmatchcase(run, condition.run or "*")]
        measured = [(runs[run], values.get((run, condition.metric))) for run in named]
    known = sorted(((v, run) for run, v in measured if v is not None), key=lambda pair: pair[0].number)
    unit = known[0][0].shown_in if known else ""
    limit: float | None
    if isinstance(bound, MetricReference):
        other = values.get((bound.run, bound.metric))
        limit = None if other is None else bound.times * other.number
        half = 0.0 if other is None else abs(bound.times) * other.half
    else:
        limit, half = _number(bound, unit) if known else None, 0.0
    near = [(value.number, limit) for value, _ in known] if limit is not None else []
    digits = digits_apart(near, unit) if known else DIGITS
    text = _range(known, len(known) < len(measured), digits)
    if isinstance(bound, MetricReference):
        times = f"{bound.times:g} × " if other and bound.times != 1.0 else ""
        text += (
            f" against {times}{_range([(other, runs[bound.run])] if other else [], other is None, digits)}"
        )
    itself = (bound.run, bound.metric) if isinstance(bound, MetricReference) else None
    verdicts = []
    for run, (_, value) in zip(named, measured, strict=True):
        number = None if value is None else value.number
        spread = half + (0.0 if value is None else value.half)
        verdict = compare(number, condition.relation, limit, unit, half=spread)
        if (run, condition.metric) == itself and verdict.holds is not None:
            verdict = Verdict(verdict.status)  # its distance to itself says nothing
        verdicts.append(verdict)
    if not verdicts and limit is None:
        verdicts = [Verdict(Status.NOT_JUDGED)]
    return verdicts, text


def _range(known: Sequence[tuple[MetricValue, str]], missing: bool, digits: int) -> str:
    """Return the value as text, or the smallest and largest with their runs where they read differently."""
    ends: dict[str, str] = {}
    for value, run in (*known[:1], *known[-1:]):
        ends.setdefault(
            shown(value.number, value.shown_in, digits=digits, half=value.half, between=value.between),
            run,
        )
    text = " to ".join(f"{number} ({run})" if run else number for number, run in ends.items())
    return " and ".join(filter(None, [text, "no result" if missing else ""]))


def _number(bound: float | str, unit: str) -> float:
    try:
        return si_number(bound, unit)
    except ValueError as error:
        raise ScenarioError(f"a condition's bound: {error}", code="unit-mismatch") from None

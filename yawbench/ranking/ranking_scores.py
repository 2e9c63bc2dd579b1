"""Scores of a ranking: judged runs, controllers under conditions, their order (tests: `studies.confidence`).

A run passes if the regulation's criteria are met and the sideslip stays below 20 degrees, beyond which a car
turns round though its yaw-rate ratio may meet them. A condition is passed if all of its runs pass.

Controllers are ordered by the number of conditions passed; ties by the share of runs that pass, then by the
peak sideslip, both averaged over conditions. A controller with missing runs is not ranked. The conditions are
a sample of those that a car meets: the interval of the number passed is Clopper and Pearson's. Two
controllers are told apart by an exact sign test over the conditions that one of them passes alone, corrected
for the number of pairs (Holm). A place is one more than the number of controllers that are clearly better,
and never better than that of a controller earlier in the order; so those that cannot be told apart share it.

`run_ranking` executes a ranking: first the runs for the angle A of every car, then all runs still missing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from yawbench.figures.display import digits_apart
from yawbench.fmus.fmu import Value
from yawbench.proving_ground.sine_with_dwell import FROM, RATIOS, SLIGHT, SPUN
from yawbench.studies.confidence import Bounds, ConfidenceInterval, interval, share_bounds
from yawbench.studies.executor import Executor
from yawbench.studies.experiment_result import ExperimentResult
from yawbench.studies.jobs import STEP_TIME, Job, MeasuredRun
from yawbench.studies.pair_comparisons import ToldApart, shared_places, sign_test, told_apart

from .ranked_runs import determine_angles, dwell_experiment
from .ranking import CONTROLLER, OF_EVENTS, RECORDED, EntrySpec, LoadedRanking

UNHELD = 1.0
"""Yaw-rate ratio without a second peak after the reversal: the car keeps turning as before."""
IDLE = "controller_off"
"""FMU of the car without control."""
WORST = -100.0
"""Lower bound of the headroom, in percentage points; chosen: such a car is lost."""


class RankedState(str, Enum):
    """State of a ranked run, or of all runs of a cell."""

    PASSED = "passed"
    SPUN = "spun"  # the regulation's criteria are met, beyond 20 degrees of sideslip
    FAILED = "failed"
    BROKEN_OFF = "broken off"  # of a run: an error ended it
    MISSING = "missing"


@dataclass(frozen=True)
class RankedRun:
    """A run of an entry under a condition at one amplitude."""

    entry: str
    condition: str
    amplitude: float  # [rad], positive: left first
    angle: float  # A of the car [rad]
    record: MeasuredRun | None  # None: missing
    repeat: Value | None = None
    dry: bool = True  # whether responsiveness counts
    job: Job | None = None

    @property
    def multiple(self) -> float:
        """The amplitude as a multiple of A."""
        return abs(self.amplitude) / self.angle

    @property
    def results(self) -> Path | None:
        """Folder of its results; None if it keeps none."""
        return self.job.out if self.job and self.job.keep else None

    def __getitem__(self, key: str) -> float | None:
        if key in ("headroom", "speed_lost"):
            value: float | None = getattr(self, key)
            return value
        measured = self.record.values.get(key) if self.record else None
        return measured[0] if measured else None

    @property
    def met(self) -> bool:
        """Whether the regulation's criteria are met."""
        if self["stability"] != 1.0:
            return False
        required = self.dry and self.responsiveness_asked
        return not required or self["responsiveness"] == 1.0

    @property
    def responsiveness_asked(self) -> bool:
        """Whether the regulation asks for responsiveness at this amplitude, on a dry road."""
        return self.multiple >= FROM * (1.0 - SLIGHT)

    @property
    def spun(self) -> bool:
        """Whether the sideslip exceeds what a driver could control."""
        slip = self["sideslip"]
        return slip is not None and slip > SPUN

    @property
    def passed(self) -> bool:
        """Whether the criteria are met without spinning."""
        return self.met and not self.spun

    @property
    def headroom(self) -> float | None:
        """Percentage points by which both ratios stay below their limits; None if the run is missing."""
        if self.record is None:
            return None
        ratios = ((self[f"ratio_{round(1000 * late)}"], most) for late, most in RATIOS)
        least = min(100.0 * (most - (UNHELD if ratio is None else ratio)) for ratio, most in ratios)
        return max(least, WORST)

    @property
    def speed_lost(self) -> float | None:
        """Loss of speed from beginning to completion of steer [m/s]."""
        first, last = self["speed"], self["speed_end"]
        return None if first is None or last is None else first - last

    @property
    def state(self) -> RankedState:
        """Whether it passed, and if not, why."""
        if self.record is None:
            return RankedState.MISSING
        if not self.record.ok:
            return RankedState.BROKEN_OFF
        return _state(self.passed, self.met)


@dataclass(frozen=True)
class RankingCell:
    """A controller under a condition: all its runs."""

    entry: str
    condition: str
    runs: list[RankedRun]

    @property
    def missing(self) -> int:
        """The number of missing runs."""
        return sum(run.record is None for run in self.runs)

    @property
    def passed(self) -> bool:
        """Whether all runs passed."""
        return all(run.passed for run in self.runs)

    @property
    def state(self) -> RankedState:
        """The state of all runs together; runs that broke off count as failed."""
        if self.missing:
            return RankedState.MISSING
        return _state(self.passed, all(run.met for run in self.runs))

    @property
    def worst(self) -> RankedRun:
        """The worst run of the cell: failed before passed, then the one with the least headroom."""

        def rank(run: RankedRun) -> tuple[bool, bool, float, float]:
            headroom, slip = run["headroom"], run["sideslip"]
            return (
                run.passed,
                run.met,
                WORST if headroom is None else headroom,
                -(math.pi if slip is None else slip),
            )

        return min(self.runs, key=rank)

    @property
    def counts(self) -> tuple[int, int]:
        """The number of runs that passed, and of all."""
        return sum(run.passed for run in self.runs), len(self.runs)

    @property
    def share(self) -> float:
        """Share of the runs that passed."""
        passed, number = self.counts
        return passed / number

    def _over_repeats(self, number: Callable[[list[RankedRun]], float]) -> ConfidenceInterval | None:
        """Average over repeats a number computed from the runs of each."""
        if self.missing:
            return None
        repeats = dict.fromkeys(run.repeat for run in self.runs)
        return interval([number([run for run in self.runs if run.repeat == r]) for r in repeats])

    @cached_property
    def headroom(self) -> ConfidenceInterval | None:
        """Smallest headroom of all runs, in percentage points; over repeats the mean."""
        return self._over_repeats(lambda runs: min(_known(runs, "headroom", WORST)))

    @cached_property
    def sideslip(self) -> ConfidenceInterval | None:
        """Largest sideslip of all runs [rad]; over repeats the mean."""
        return self._over_repeats(lambda runs: max(_known(runs, "sideslip", math.pi)))

    @cached_property
    def displacement(self) -> float | None:
        """Smallest displacement of the runs at amplitudes where responsiveness counts [m]."""
        required = [run for run in self.runs if run.responsiveness_asked]
        return min((x for run in required if (x := run["displacement"]) is not None), default=None)

    def number(self, key: str) -> float | None:
        """Return the headroom, the sideslip, or the mean of another metric over all runs that have it."""
        if key in ("headroom", "sideslip"):
            over: ConfidenceInterval | None = getattr(self, key)
            return over.mean if over else None
        known = [x for run in self.runs if (x := run[key]) is not None]
        return sum(known) / len(known) if known else None


def _state(passed: bool, met: bool) -> RankedState:
    return RankedState.PASSED if passed else RankedState.SPUN if met else RankedState.FAILED


def _known(runs: Sequence[RankedRun], key: str, lost: float) -> Iterator[float]:
    """Yield a number of all runs; `lost` replaces a missing one."""
    return (lost if (x := run[key]) is None else x for run in runs)


@dataclass(frozen=True)
class EntryScore:
    """Score of an entry over all conditions."""

    entry: str
    spec: EntrySpec
    cells: dict[str, RankingCell]  # condition -> cell
    place: int | None = None  # shared by those that cannot be told apart; None: not ranked, runs are missing
    rank: int | None = None  # in the order; equal ones share it
    bounds: Bounds | None = None  # of the number of conditions passed
    braking: float | None = None  # share of the time in ordinary driving [1]; None: not driven

    @property
    def missing(self) -> int:
        """The number of conditions with missing runs."""
        return sum(cell.state is RankedState.MISSING for cell in self.cells.values())

    def count(self, state: RankedState) -> int:
        """Return the number of conditions with a state."""
        return sum(cell.state is state for cell in self.cells.values())

    @property
    def share(self) -> float:
        """Share of runs that passed, averaged over conditions."""
        return sum(cell.share for cell in self.cells.values()) / len(self.cells)

    def mean(self, key: str) -> float | None:
        """Return the mean of a number over conditions; None if a condition lacks it."""
        numbers = [cell.number(key) for cell in self.cells.values()]
        known = [x for x in numbers if x is not None]
        return sum(known) / len(known) if known and len(known) == len(numbers) else None

    @property
    def step_time(self) -> float | None:
        """Processor time of a step of the controller [s]: the median over conditions."""
        times = sorted(x for cell in self.cells.values() if (x := cell.number(STEP_TIME)) is not None)
        return times[len(times) // 2] if times else None

    @property
    def order(self) -> tuple[float, float, float]:
        """Sort key of the ranking, best first."""
        slip = self.mean("sideslip")
        return (
            -self.count(RankedState.PASSED),
            -round(self.share, 9),
            math.inf if slip is None else round(slip, 9),
        )


def scores_of(ranking: LoadedRanking, runs: Iterable[RankedRun]) -> list[EntryScore]:
    """Return the scores of all entries, best first, those that are not ranked last.

    Args:
        ranking: with the conditions that count.
        runs: all runs.
    """
    cells: dict[tuple[str, str], list[RankedRun]] = {}
    for run in runs:
        cells.setdefault((run.entry, run.condition), []).append(run)
    return placed([
        EntryScore(
            name, spec, {key: RankingCell(name, key, cells[name, key]) for key in ranking.conditions}
        )
        for name, (spec, _) in ranking.entries.items()
    ])  # fmt: skip


class Digits(NamedTuple):
    """Significant digits at which numbers that decide the order can be told apart."""

    share: int
    sideslip: int


def deciding_digits(ranked: Sequence[EntryScore]) -> Digits:
    """Return the digits for shares and mean peak sideslips; `ranked`: best first."""
    share, slip = [], []
    for entry, next_ in pairwise(entry for entry in ranked if entry.place):
        if entry.order[0] != next_.order[0]:
            continue
        if entry.order[1] != next_.order[1]:
            share.append((entry.share, next_.share))
        elif entry.order[2] != next_.order[2]:
            slip.append((entry.order[2], next_.order[2]))
    return Digits(digits_apart(share, "%", 2), digits_apart(slip, "rad"))


def placed(every: Sequence[EntryScore]) -> list[EntryScore]:
    """Return the scores in order, with ranks, intervals and places."""
    whole = sorted((entry for entry in every if not entry.missing), key=lambda entry: entry.order)
    ordered: list[EntryScore] = []
    places = shared_places(apart_by_conditions(whole).better) if whole else []
    for number, (entry, place) in enumerate(zip(whole, places, strict=True), 1):
        before = ordered[-1] if ordered else None
        rank = before.rank if before and before.order == entry.order else number
        conditions = len(entry.cells)
        low, high = share_bounds(entry.count(RankedState.PASSED), conditions)
        ordered.append(
            replace(entry, rank=rank, place=place, bounds=Bounds(conditions * low, conditions * high))
        )
    return ordered + [entry for entry in every if entry.missing]


def apart_by_conditions(scores: Sequence[EntryScore]) -> ToldApart:
    """Compare ranked entries, by exact tests over the conditions that only one of two passes."""
    import numpy as np

    passed = np.array([[cell.passed for cell in score.cells.values()] for score in scores], dtype=bool)
    idle = next((k for k, score in enumerate(scores) if score.spec.fmu == IDLE), None)
    return told_apart(passed.sum(axis=1), lambda i, j: sign_test(passed[i], passed[j]), idle)


@dataclass(frozen=True)
class RankingResult:
    """Result of a ranking."""

    ranking: LoadedRanking
    angles: dict[str, float]  # car -> A [rad]
    runs: list[RankedRun]
    scores: list[EntryScore]  # best first


def run_ranking(
    ranking: LoadedRanking, execute: Executor, *, only: Collection[str] = (), keep: bool = True
) -> RankingResult:
    """Execute the missing runs of a ranking and return its scores.

    Args:
        ranking: as loaded.
        execute: executes experiments.
        only: entries whose runs are executed; empty: all. The others are scored by the runs in the journal.
        keep: keep the results of the worst run of every cell, which the page shows.

    Raises:
        YawbenchError: a run cannot start, or A cannot be determined.
    """
    angles = determine_angles(ranking, execute)
    dwell = dwell_experiment(ranking, angles, execute)
    result = execute(
        dwell,
        only=lambda case: not only or case.point[0].value in only,
        keep=keep and ranking.quick,  # one run a cell: which are worth keeping is known before
        record=RECORDED,
        timed=CONTROLLER,
    )
    runs = _ranked_runs(ranking, angles, result)
    scores = scores_of(ranking, runs)
    if keep:
        cells = [cell for score in scores for cell in score.cells.values()]
        shown = {id(run) for cell in cells for run in (cell.worst, best_beside(scores, cell))}
        kept = [number for number, run in enumerate(runs) if id(run) in shown and run.record is not None]
        runs = _ranked_runs(ranking, angles, execute.keeping(result, kept, OF_EVENTS))
        scores = scores_of(ranking, runs)
    return RankingResult(ranking, angles, runs, scores)


def best_beside(scores: Sequence[EntryScore], cell: RankingCell) -> RankedRun | None:
    """Return the run of the best entry that passes at the amplitude of a cell's worst run; None without one.

    None also where that run passes itself.
    """
    worst = cell.worst
    if worst.passed:
        return None
    others = (score.cells[cell.condition].runs for score in scores if cell.condition in score.cells)
    alike = (
        run
        for runs in others
        for run in runs
        if (run.amplitude, run.repeat) == (worst.amplitude, worst.repeat)
    )
    return next((run for run in alike if run.passed), None)


def _ranked_runs(
    ranking: LoadedRanking, angles: Mapping[str, float], result: ExperimentResult
) -> list[RankedRun]:
    assert result.planned is not None
    names = [*result.spec.axes]
    runs = []
    records = result.of_models().records
    for case, job, record in zip(result.experiment.cases, result.planned.jobs, records, strict=True):
        condition, at = ranking.spec.conditions[case.run.name], dict(zip(names, case.point, strict=True))
        repeat = next((at[place].value for place in condition.repeats), None)
        runs.append(
            RankedRun(
                str(at["entry"].value), case.run.name, float(at["amplitude"].value), angles[condition.car],
                record if record.made else None, repeat, condition.dry, replace(job, plan=None),
            )
        )  # fmt: skip
    return runs

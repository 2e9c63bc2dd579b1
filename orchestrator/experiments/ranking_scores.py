"""Where controllers of a ranking stand: runs judged, cells of a controller in a condition, places.

A run passes if the regulation's criteria are met and the sideslip stays below 20 degrees, beyond which a car
turns round though its yaw-rate ratio may meet them. A condition is passed if all of its runs pass.

Places: the more conditions a controller passes the better; of equally many, the larger its share of runs that
pass, in the mean over conditions; then the smaller its peak sideslip, in the mean over conditions. Who lacks
a run has no place.

The course of a ranking: A of every car, then all runs that are left, then where everybody stands.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

from ..errors import ResultsError
from ..evaluation.sine_with_dwell import FROM, RATIOS, SLIGHT, SPUN
from ..figures.style import digits_apart
from .jobs import STEP_TIME, Job, MeasuredRun, PlanningCache
from .journal import Journal
from .judging import ConfidenceInterval, interval
from .ranking import EntrySpec, LoadedRanking, RankingRun, angle_of, drives_of, jobs_for_angles, plan_drives

UNHELD = 1.0
"""Ratio of a car whose reversal produces no second peak of the yaw rate: it goes on turning as before."""
WORST = -100.0
"""Stability margin that stands for all that are worse, in points; chosen: such a car is lost."""


@dataclass(frozen=True)
class RankedRun:
    """One run and what it came to; None: it has not been made."""

    drive: RankingRun
    dry: bool  # responsiveness counts
    record: MeasuredRun | None

    def __getitem__(self, key: str) -> float | None:
        if key in ("margin", "speed_lost"):
            found: float | None = getattr(self, key)
            return found
        measured = self.record.values.get(key) if self.record else None
        return measured[0] if measured else None

    @property
    def met(self) -> bool:
        """Whether the regulation's criteria are met."""
        if self["stability"] != 1.0:
            return False
        asked = self.dry and self.drive.multiple >= FROM * (1.0 - SLIGHT)
        return not asked or self["responsiveness"] == 1.0

    @property
    def spun(self) -> bool:
        """Whether the sideslip goes beyond what a driver could hold."""
        slip = self["sideslip"]
        return slip is not None and slip > SPUN

    @property
    def passed(self) -> bool:
        """Whether the run counts."""
        return self.met and not self.spun

    @property
    def margin(self) -> float | None:
        """Points of per cent that both ratios stay below their limits by; None of a run not made."""
        if self.record is None:
            return None
        ratios = ((self[f"ratio_{round(1000 * late)}"], most) for late, most in RATIOS)
        least = min(100.0 * (most - (UNHELD if ratio is None else ratio)) for ratio, most in ratios)
        return max(least, WORST)

    @property
    def speed_lost(self) -> float | None:
        """From beginning to completion of steer [m/s]."""
        first, last = self["speed"], self["speed_end"]
        return None if first is None or last is None else first - last

    @property
    def verdict(self) -> str:
        """In a word or two."""
        if self.record is None:
            return "missing"
        if not self.record.ok:
            return f"broken off: {self.record.reason}"
        return "passed" if self.passed else "spun" if self.met else "failed"


@dataclass(frozen=True)
class RankingCell:
    """A controller in a condition."""

    entry: str
    condition: str
    runs: list[RankedRun]

    @property
    def missing(self) -> int:
        """Runs that have not been made."""
        return sum(one.record is None for one in self.runs)

    @property
    def passed(self) -> bool:
        """Whether all runs are."""
        return all(one.passed for one in self.runs)

    @property
    def state(self) -> str:
        """`passed`; `spun`: the criteria are met, beyond 20 degrees of sideslip; `failed`; `missing`."""
        if self.missing:
            return "missing"
        return "passed" if self.passed else "spun" if all(one.met for one in self.runs) else "failed"

    @property
    def share(self) -> float:
        """Share of the runs that pass."""
        return sum(one.passed for one in self.runs) / len(self.runs)

    def _over_repeats(self, number: Callable[[list[RankedRun]], float]) -> ConfidenceInterval | None:
        """Return the mean over repeats of a number of their runs."""
        if self.missing:
            return None
        repeats = dict.fromkeys(one.drive.repeat for one in self.runs)
        return interval([number([one for one in self.runs if one.drive.repeat == r]) for r in repeats])

    @cached_property
    def margin(self) -> ConfidenceInterval | None:
        """Least stability margin of all runs, in points; over repeats the mean."""
        return self._over_repeats(lambda runs: min(_known(runs, "margin", WORST)))

    @cached_property
    def sideslip(self) -> ConfidenceInterval | None:
        """Largest sideslip of all runs [rad]; over repeats the mean."""
        return self._over_repeats(lambda runs: max(_known(runs, "sideslip", math.pi)))

    @cached_property
    def displacement(self) -> float | None:
        """Least displacement of the runs that responsiveness is asked of [m]."""
        asked = [one for one in self.runs if one.drive.multiple >= FROM * (1.0 - SLIGHT)]
        return min((x for one in asked if (x := one["displacement"]) is not None), default=None)

    def number(self, key: str) -> float | None:
        """Return the margin, the sideslip, or the mean of another number over all runs that have it."""
        if key in ("margin", "sideslip"):
            over: ConfidenceInterval | None = getattr(self, key)
            return over.mean if over else None
        found = [x for one in self.runs if (x := one[key]) is not None]
        return sum(found) / len(found) if found else None


def _known(runs: Sequence[RankedRun], key: str, lost: float) -> Iterator[float]:
    """Yield a number of all runs; `lost` stands for that of one that failed."""
    return (lost if (x := one[key]) is None else x for one in runs)


@dataclass(frozen=True)
class EntryScore:
    """What an entry comes to over all conditions."""

    entry: str
    spec: EntrySpec
    cells: dict[str, RankingCell]  # condition -> cell
    place: int | None = None  # None: it lacks runs

    @property
    def missing(self) -> int:
        """Cells that lack runs."""
        return sum(cell.state == "missing" for cell in self.cells.values())

    def count(self, state: str) -> int:
        """Return the number of conditions of a state."""
        return sum(cell.state == state for cell in self.cells.values())

    @property
    def share(self) -> float:
        """Share of runs that pass, in the mean over conditions."""
        return sum(cell.share for cell in self.cells.values()) / len(self.cells)

    def mean(self, key: str) -> float | None:
        """Return the mean over conditions of a number of cells; None if one lacks it."""
        found = [cell.number(key) for cell in self.cells.values()]
        known = [x for x in found if x is not None]
        return sum(known) / len(known) if known and len(known) == len(found) else None

    @property
    def step_time(self) -> float | None:
        """Processor time of a step of the controller [s]: the middle of all cells'."""
        found = sorted(x for cell in self.cells.values() if (x := cell.number(STEP_TIME)) is not None)
        return found[len(found) // 2] if found else None

    @property
    def order(self) -> tuple[float, float, float]:
        """What places go by, the least first."""
        slip = self.mean("sideslip")
        return (-self.count("passed"), -round(self.share, 9), math.inf if slip is None else round(slip, 9))


def standings(
    ranking: LoadedRanking, drives: Sequence[RankingRun], records: Mapping[str, MeasuredRun]
) -> list[EntryScore]:
    """Return what all entries come to, the first place first, those without a place last.

    Args:
        ranking: with the conditions that count.
        drives: all runs.
        records: key -> what became of a run.
    """
    runs: dict[tuple[str, str], list[RankedRun]] = {}
    for drive in drives:
        dry = ranking.spec.conditions[drive.condition].dry
        driven = RankedRun(drive, dry, records.get(drive.key))
        runs.setdefault((drive.entry, drive.condition), []).append(driven)
    every = []
    for name, (spec, _) in ranking.entries.items():
        cells = {key: RankingCell(name, key, runs[name, key]) for key in ranking.conditions}
        every.append(EntryScore(name, spec, cells))
    return placed(every)


class Digits(NamedTuple):
    """Significant digits with which numbers that decide places read differently."""

    share: int
    sideslip: int


def deciding_digits(ranked: Sequence[EntryScore]) -> Digits:
    """Return the digits for shares and mean peak sideslips; `ranked`: in the order of their places."""
    share, slip = [], []
    for one, next_ in pairwise(one for one in ranked if one.place):
        if one.order[0] != next_.order[0]:
            continue
        if one.order[1] != next_.order[1]:
            share.append((one.share, next_.share))
        elif one.order[2] != next_.order[2]:
            slip.append((one.order[2], next_.order[2]))
    return Digits(digits_apart(share, "%", 2), digits_apart(slip, "rad"))


def placed(every: Sequence[EntryScore]) -> list[EntryScore]:
    """Return standings in their order, with places; equal ones share a place."""
    whole = sorted((one for one in every if not one.missing), key=lambda one: one.order)
    found: list[EntryScore] = []
    for number, one in enumerate(whole, start=1):
        same = found and found[-1].order == one.order
        found.append(replace(one, place=found[-1].place if same else number))
    return found + [one for one in every if one.missing]


RunJobs = Callable[[str, Sequence[Job]], object]
"""Makes those of some runs that are left, under a title, and notes them in the journal."""
Planning = Callable[[int], AbstractContextManager[Callable[[int], None]]]
"""Shows how many of so many runs are planned."""


@dataclass(frozen=True)
class RankingResult:
    """What a ranking comes to."""

    ranking: LoadedRanking
    angles: dict[str, float]  # car -> A [rad]
    drives: list[RankingRun]
    standings: list[EntryScore]


def drive_ranking(
    ranking: LoadedRanking,
    base: Job,
    journal: Journal,
    once: PlanningCache,
    make: RunJobs,
    *,
    only: Collection[str] = (),
    planning: Planning = lambda total: nullcontext(lambda done: None),
) -> RankingResult:
    """Make the runs that are left and return where everybody stands.

    Args:
        ranking: as loaded.
        base: what all jobs share; results go to its folder.
        journal: of finished runs.
        once: reads files and opens FMUs.
        make: makes runs.
        only: entries whose runs are made; none: of all. The others stand with what is there.
        planning: shows how many of so many runs are planned.

    Raises:
        YawbenchError: a run cannot start, or A cannot be found.
    """
    slow = jobs_for_angles(ranking, base, once)
    make("A, the angle at 0.3 g", [job for jobs in slow.values() for job in jobs])
    angles = {}
    for car, jobs in slow.items():
        if any(job.key not in journal.records for job in jobs):
            raise ResultsError(f"{base.out}: holds no A of {car!r} of this build; rank without --no-run")
        angles[car] = angle_of([journal.records[job.key] for job in jobs], car)
    drives = drives_of(ranking, angles)
    with planning(len(drives)) as progress:
        drives = plan_drives(ranking, drives, base, once, progress)
    wanted = [one.job for one in drives if one.job and (not only or one.entry in only)]
    make(ranking.spec.title, wanted)
    return RankingResult(ranking, angles, drives, standings(ranking, drives, journal.records))

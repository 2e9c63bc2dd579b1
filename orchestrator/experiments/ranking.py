"""A ranking: which controllers drive through which conditions of sine with dwell, as jobs.

Every run is one of the engine of all experiments: planned before the first starts, made in a process of its
own, noted in the journal as it ends, not made again by the same build. A is found once for each car, on a dry
road without control, so all controllers drive the same amplitudes. What the runs come to: `standings`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path

from .. import checksums
from ..errors import ResultsError, ScenarioError
from ..evaluation.dwell_series import amplitudes
from ..evaluation.judgement import Judgement, NotJudged
from ..evaluation.slow_steer import characteristic_angle
from ..files import reads
from ..plan import Change, Plan, Value
from ..scenario import overrides, yaml_lines
from ..scenario.strict import validate
from ..wording import hint
from .axis_schema import Changes
from .changes import changes_of_file
from .driven_series import AMPLITUDE, SIDES, slow_steer_jobs, steered
from .jobs import Job, Metrics, Once, Record, keyed, ready
from .ranking_schema import UNIT, ConditionSpec, EntriesSpec, EntrySpec, RankingSpec

RUNS = "runs"
"""Folder of the results that are kept: of every cell's last amplitude."""
SERIES, SLOW = "sine-with-dwell", "slowly-increasing-steer"
METRICS: Metrics = (
    ("effort", "effort(yaw_moment)", None),
    ("chatter", "total_variation_rate(yaw_moment)", None),
)
"""What is measured beside what the test gives, and the intervention."""
INTERVENTION = "effort(wheel_torque_*)"
"""Measured from the beginning of steer on: until the driver lets go of the accelerator, torque is his."""
STEERING_BEGINS = "start_time"
"""Parameter of the driver [s]."""
RECORDED = (
    "steering_wheel_angle", "yaw_rate", "sideslip", "acceleration_y", "velocity_x", "yaw_moment",
    "wheel_torque", "torque_request",
)  # fmt: skip
"""Beginnings of the names of what runs record; the rest would only take room."""


@dataclass(frozen=True)
class Ranking:
    """A ranking as its file has it, and which part of it is wanted."""

    path: Path
    spec: RankingSpec
    entries: dict[str, tuple[EntrySpec, Path]]  # name -> controller, and the folder its path is relative to
    quick: bool = False  # the last amplitudes of few conditions
    chosen: tuple[str, ...] = ()  # conditions; none: all
    edited: tuple[str, ...] = ()  # what is not as `yawbench tune` has written it

    @property
    def identity(self) -> str:
        """What tells rankings apart: the name of the file and of its folder."""
        return f"{self.path.absolute().parent.name}/{self.path.name}"

    @cached_property
    def conditions(self) -> dict[str, ConditionSpec]:
        """Those that are driven."""
        return {
            name: one
            for name, one in self.spec.conditions.items()
            if (name in self.chosen if self.chosen else one.quick or not self.quick)
        }

    @cached_property
    def cars(self) -> list[str]:
        """Names of the cars that they are of."""
        return list(dict.fromkeys(one.car for one in self.conditions.values()))

    def changes(self, *parts: Changes, stop: bool = True) -> tuple[Change, ...]:
        """Return the changes of the ranking itself and of parts of its file; the last of a place counts."""
        own = [
            Change(name, float(value), "ranking")
            for name, value in (("step_size", self.spec.step_size), ("stop_time", self.spec.stop_time))
            if value is not None and (stop or name != "stop_time")
        ]
        return (*own, *(one for part in parts for one in changes_of_file(part, self.path.parent, "ranking")))

    def changes_of_entry(self, name: str) -> list[Change]:
        """Return the changes that put an entry into a scenario."""
        spec, folder = self.entries[name]
        given = {f"{UNIT}.{parameter}": value for parameter, value in spec.parameters.items()}
        return overrides.changes_of({UNIT: spec.fmu}, given, folder, "ranking")

    def changes_of_condition(self, name: str) -> tuple[Change, ...]:
        """Return the changes that a condition makes in its scenario."""
        condition = self.spec.conditions[name]
        return self.changes(self.spec.cars[condition.car], condition)


@reads("ranking file", ScenarioError)
def load_ranking(
    path: Path | str,
    *,
    more: Mapping[str, EntrySpec] | None = None,
    quick: bool = False,
    chosen: Sequence[str] = (),
) -> Ranking:
    """Read a ranking.

    Args:
        path: of the file.
        more: entries from elsewhere; paths of their FMUs are relative to the working directory.
        quick: drive only the last amplitude of the conditions that are for this.
        chosen: conditions to drive in place of all.

    Raises:
        ScenarioError: with everything that is wrong with it.
    """
    path = Path(path)
    document = yaml_lines.read(path, what="ranking file")
    spec = validate(RankingSpec, document)
    if spec is None or document.problems:
        raise ScenarioError(document.sentences())
    entries = {name: (one, path.parent) for name, one in spec.entries.items()}
    edited: list[str] = []
    for name in spec.more_entries:
        file = path.parent / name
        listed = yaml_lines.read(file, what="file of entries")
        found = validate(EntriesSpec, listed)
        if found is None or listed.problems:
            raise ScenarioError(listed.sentences())
        if words := found.edited:
            edited.append(f"{file}: {words}")
            checksums.warn(edited[-1])
        for key, one in found.entries.items():
            if key in entries:
                raise ScenarioError(f"{file}: entries.{key}: there is already an entry {key!r}")
            entries[key] = (one, file.parent)
    for key, one in (more or {}).items():
        if key in entries:
            raise ScenarioError(f"there is already an entry {key!r}: give the controller another name")
        entries[key] = (one, Path())
    for name in chosen:
        if name not in spec.conditions:
            raise ScenarioError(
                f"{path}: there is no condition {name!r}{hint(name, spec.conditions, lead='known')}"
            )
    return Ranking(path, spec, entries, quick, tuple(chosen), tuple(edited))


def jobs_for_angles(ranking: Ranking, base: Job, once: Once) -> dict[str, list[Job]]:
    """Return car -> the runs of slowly increasing steer that A follows from; `base`: as in `plan_drives`.

    Raises:
        ScenarioError: they cannot start.
    """
    found = {}
    for name in ranking.cars:
        car = ranking.spec.cars[name]
        asis = replace(
            base, label=name, scenario=ranking.path.parent / car.slow_steer, test=(SLOW, None), keep=False,
            changes=ranking.changes(car, stop=False),
        )  # fmt: skip
        found[name] = slow_steer_jobs(asis, once)
    return found


def angle_of(records: Sequence[Record], car: str) -> float:
    """Return A of a car [rad] from its runs of slowly increasing steer.

    Raises:
        ResultsError: there is none.
    """
    judged = []
    for record in records:
        found = record.values.get("angle")
        one = Judgement(car)
        one.notes += [record.reason or "0.375 g is not reached"]
        one.add("angle", "", found[0] if found else None, "rad")
        judged.append(one)
    try:
        return characteristic_angle(judged)
    except NotJudged as why:
        raise ResultsError(str(why)) from None


@dataclass(frozen=True)
class Drive:
    """One run of a cell."""

    entry: str
    condition: str
    amplitude: float  # [rad], positive: left first
    angle: float  # A of the car [rad]
    repeat: Value | None = None
    last: bool = False  # the amplitude that the regulation ends with
    job: Job | None = None  # once it is planned

    @property
    def key(self) -> str:
        """Key of the run; "" of one that is not planned."""
        return self.job.key if self.job else ""

    @property
    def multiple(self) -> float:
        """The amplitude over A."""
        return abs(self.amplitude) / self.angle


def drives_of(ranking: Ranking, angles: Mapping[str, float]) -> list[Drive]:
    """Return all runs, condition by condition; `angles`: car -> A [rad]."""
    found = []
    for (name, condition), entry in product(ranking.conditions.items(), ranking.entries):
        angle = angles[condition.car]
        rungs = amplitudes(angle)[:: -(condition.every or ranking.spec.every)][::-1]
        if ranking.quick:
            rungs = rungs[-1:]
        sides = SIDES[:1] if condition.mirrored else SIDES
        repeats = next(iter(condition.repeats.values()), [None])
        found += [
            Drive(entry, name, sign * rung, angle, repeat, rung == rungs[-1])
            for (_, sign), repeat, rung in product(sides, repeats, rungs)
        ]
    return found


def plan_drives(
    ranking: Ranking,
    drives: Sequence[Drive],
    base: Job,
    once: Once,
    progress: Callable[[int], None] = lambda done: None,
) -> list[Drive]:
    """Return runs with their jobs; `base` holds what all jobs share, and the folder of all results.

    Raises:
        ScenarioError: with everything that is wrong with any of them, each problem once.
    """
    jobs = []
    for drive in drives:
        condition = ranking.spec.conditions[drive.condition]
        value = drive.repeat
        repeated = [Change(place, value, "ranking") for place in condition.repeats if value is not None]
        changes = (
            *ranking.changes_of_condition(drive.condition),
            *ranking.changes_of_entry(drive.entry),
            *repeated,
            steered(drive.amplitude, "ranking"),
        )
        first = drive.repeat is None or drive.repeat == next(iter(condition.repeats.values()))[0]
        jobs.append(replace(
            base, label=f"{drive.entry}, {drive.condition}, {math.degrees(drive.amplitude):.1f} deg",
            scenario=ranking.path.parent / condition.scenario, changes=changes,
            test=(SERIES, drive.angle), timed=UNIT,
            keep=base.keep and drive.last and first and drive.amplitude > 0,
        ))  # fmt: skip
    planned = ready(jobs, once=once, progress=progress)
    made = [keyed(replace(job, plan=_lean(job.plan)), _metrics(job.plan)) for job in planned]
    made = [replace(job, out=base.out / RUNS / job.key[:12]) for job in made]
    return [replace(drive, job=job) for drive, job in zip(drives, made, strict=True)]


def _metrics(plan: Plan | None) -> Metrics:
    assert plan is not None
    driver = AMPLITUDE.partition(".")[0]
    begins = next(unit.parameter(STEERING_BEGINS) for unit in plan.units if unit.name == driver)
    first, last = float(begins or 0.0), plan.time(plan.n_steps)
    return (("intervention", INTERVENTION, (first, last) if first < last else None), *METRICS)


def _lean(plan: Plan | None) -> Plan:
    assert plan is not None
    return replace(plan, record=tuple(one for one in plan.record if one[1].startswith(RECORDED)))

"""Ranking files: controllers compared under conditions of sine with dwell; schema, loading and runs.

    title: Where controllers stand
    step_size: 0.0025
    stop_time: 5.5
    every: 2                           # of the regulation's amplitudes, from the last one down
    cars:
      hard: {title: hard, vehicle: ../vehicles/hard.yaml, slow_steer: slowly_increasing_steer.yaml}
    conditions:
      hard: {title: "hard, dry", car: hard, scenario: sine_with_dwell.yaml}
      noise:
        {title: "hard, sensors", car: hard, scenario: sensors.yaml, repeats: {sensor.seed: [1, 2, 3]}}
    entries:
      pid: {title: PID, fmu: controller_pid, source: paper C}
    more_entries: [tuned.yaml]         # files of entries alone

A condition overrides its scenario like a run of a study. An entry swaps its FMU in for the instance
`controller` and sets its parameters, the same in all conditions.

The runs are jobs as in every experiment: planned before the first one starts, executed in separate
processes, added to the journal as they end, and not executed again by the same build. The steering angle A is
determined once for each car, on a dry road without control, so all controllers drive the same amplitudes.
`ranking_scores` computes their scores.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from .. import checksums
from ..errors import ResultsError, ScenarioError
from ..evaluation.judgement import Evaluation, NotJudged
from ..evaluation.sine_with_dwell import amplitudes
from ..evaluation.steering_tests import characteristic_angle
from ..files import reads
from ..messages import hint
from ..plan import Override, Plan, Value
from ..scenario import overrides, yaml_lines
from ..scenario.scenario_schema import Scalar
from ..scenario.validation import StrictModel, Time, validate
from .axes import OverrideSpec, changes_of_file
from .jobs import Job, MeasuredRun, MetricRequests, PlanningCache, keyed, ready
from .standard_test_runs import AMPLITUDE, SIDES, slow_steer_jobs, steered

UNIT = "controller"
"""The instance that all entries swap."""
NAME = r"^[\w.+-]+$"


class CarSpec(OverrideSpec):
    """A car, with the scenario that determines its characteristic angle A."""

    title: str = Field(min_length=1, description="Its words")
    slow_steer: str = Field(min_length=1, description="Scenario of slowly increasing steer, for A")


class ConditionSpec(OverrideSpec):
    """A condition for all controllers: a car, a scenario of sine with dwell, and overrides."""

    title: str = Field(min_length=1, description="Its words")
    short: str = Field("", description="Words for the head of a column; default: all of them")
    car: str = Field(min_length=1, description="Key of `cars`")
    scenario: str = Field(min_length=1, description="Scenario of one run, relative to this file")
    dry: bool = Field(True, description="Responsiveness counts, which the regulation asks of dry roads")
    mirrored: bool = Field(True, description="Left and right are alike: left first stands for both")
    every: int | None = Field(None, ge=1, description="In place of the ranking's")
    repeats: dict[str, list[Scalar]] = Field({}, description="unit.parameter -> values, such as seeds")
    seen: bool = Field(False, description="By the search that tuned gains")
    quick: bool = Field(False, description="Driven by --quick, with the last amplitude alone")

    @property
    def heading(self) -> str:
        """Heading of the condition's column."""
        return (self.short or self.title) + (" *" if self.seen else "")

    @field_validator("repeats")
    @classmethod
    def _one_place(cls, given: dict[str, list[Scalar]]) -> dict[str, list[Scalar]]:
        if len(given) > 1 or not all(given.values()):
            raise ValueError("repeats: one unit.parameter with its values")
        return given


class EntrySpec(StrictModel):
    """A controller to be ranked."""

    title: str = Field(min_length=1, description="What tables call it")
    fmu: str = Field(min_length=1, description="Name of its FMU, or a path relative to the file")
    parameters: dict[str, Scalar] = Field({}, description="Parameter -> value; default: as they are")
    source: str = Field(min_length=1, description="Where it is from, and its gains")
    gains: Literal["authors", "tuned"] = Field("authors", description="Whose gains they are")


class EntriesSpec(StrictModel):
    """A file of entries only: written by hand, or with checksums by `yawbench tune`."""

    entries: dict[str, EntrySpec] = Field(min_length=1, description="Name -> controller")
    checksums: dict[str, str] = Field({}, description="Of entries that `yawbench tune` has written")

    @property
    def content(self) -> dict[str, Any]:
        """The entries as plain data, which the checksums are of."""
        return {name: one.model_dump(exclude_defaults=True) for name, one in self.entries.items()}

    @property
    def edited(self) -> str:
        """Describes what was edited since `yawbench tune` wrote the file; "" if nothing was."""
        if self.checksums:
            words = checksums.what_changed(self.content, self.checksums)
            return f"{words} since `yawbench tune` wrote it" if words else ""
        if any(one.gains == "tuned" for one in self.entries.values()):
            return "has no checksums, so its tuned gains are taken as they are"
        return ""


class RankingSpec(StrictModel):
    """A ranking file."""

    title: str = Field(min_length=1)
    source: str = Field("", description="Of the test that everything is judged by")
    notes: list[str] = Field([], description="What a reader of its page has to know")
    step_size: Time | None = Field(None, description="In place of the scenarios'")
    stop_time: Time | None = Field(None, description="In place of the scenarios'")
    every: int = Field(1, ge=1, description="Every so many of the amplitudes, from the last one down")
    cars: dict[str, CarSpec] = Field(min_length=1, description="Name -> car")
    conditions: dict[str, ConditionSpec] = Field(min_length=1, description="Name -> condition")
    entries: dict[str, EntrySpec] = Field({}, description="Name -> controller")
    more_entries: list[str] = Field([], description="Files of entries, relative to this one")

    @model_validator(mode="after")
    def _consistent(self) -> RankingSpec:
        for name, condition in self.conditions.items():
            if condition.car not in self.cars:
                known = ", ".join(self.cars)
                raise ValueError(
                    f"conditions.{name}.car: there is no car {condition.car!r}; there are {known}"
                )
        if not self.entries and not self.more_entries:
            raise ValueError("has no entries")
        return self


RUNS = "runs"
"""Folder of the kept results: those of every cell's last amplitude."""
SERIES, SLOW = "sine-with-dwell", "slowly-increasing-steer"
METRICS: MetricRequests = (
    ("effort", "effort(yaw_moment)", None),
    ("chatter", "total_variation_rate(yaw_moment)", None),
)
"""Metrics besides those of the test and the intervention."""
INTERVENTION = "effort(wheel_torque_*)"
"""Measured from the beginning of steer: before it, wheel torque comes from the driver's accelerator."""
STEERING_BEGINS = "start_time"
"""Parameter of the driver: beginning of steer [s]."""
RECORDED = (
    "steering_wheel_angle", "yaw_rate", "sideslip", "acceleration_y", "velocity_x", "yaw_moment",
    "wheel_torque", "torque_request",
)  # fmt: skip
"""Prefixes of the recorded signals; the others would only take space."""


@dataclass(frozen=True)
class LoadedRanking:
    """A loaded ranking file, and the selected part of its conditions."""

    path: Path
    spec: RankingSpec
    entries: dict[str, tuple[EntrySpec, Path]]  # name -> controller, base folder of its path
    quick: bool = False  # only the last amplitude, and only quick conditions
    chosen: tuple[str, ...] = ()  # selected conditions; empty: all
    edited: tuple[str, ...] = ()  # files edited since `yawbench tune` wrote them

    @property
    def identity(self) -> str:
        """Identifies the ranking in its results folder: name of its file's folder and of the file."""
        return f"{self.path.absolute().parent.name}/{self.path.name}"

    @cached_property
    def conditions(self) -> dict[str, ConditionSpec]:
        """The selected conditions."""
        return {
            name: one
            for name, one in self.spec.conditions.items()
            if (name in self.chosen if self.chosen else one.quick or not self.quick)
        }

    @cached_property
    def cars(self) -> list[str]:
        """Names of the cars of the selected conditions."""
        return list(dict.fromkeys(one.car for one in self.conditions.values()))

    def changes(self, *parts: OverrideSpec, stop: bool = True) -> tuple[Override, ...]:
        """Return the overrides of the ranking and of parts of its file; the last one of a target counts."""
        own = [
            Override(name, float(value), "ranking")
            for name, value in (("step_size", self.spec.step_size), ("stop_time", self.spec.stop_time))
            if value is not None and (stop or name != "stop_time")
        ]
        return (*own, *(one for part in parts for one in changes_of_file(part, self.path.parent, "ranking")))

    def changes_of_entry(self, name: str) -> list[Override]:
        """Return the overrides that put an entry's controller into a scenario."""
        spec, folder = self.entries[name]
        given = {f"{UNIT}.{parameter}": value for parameter, value in spec.parameters.items()}
        return overrides.changes_of({UNIT: spec.fmu}, given, folder, "ranking")

    def changes_of_condition(self, name: str) -> tuple[Override, ...]:
        """Return the overrides that a condition makes in its scenario."""
        condition = self.spec.conditions[name]
        return self.changes(self.spec.cars[condition.car], condition)


@reads("ranking file", ScenarioError)
def load_ranking(
    path: Path | str,
    *,
    more: Mapping[str, EntrySpec] | None = None,
    quick: bool = False,
    chosen: Sequence[str] = (),
) -> LoadedRanking:
    """Load a ranking file.

    Args:
        path: the file.
        more: further entries; paths of their FMUs are relative to the working directory.
        quick: drive only the last amplitude of the conditions marked `quick`.
        chosen: conditions to drive; empty: all.

    Raises:
        ScenarioError: the file is invalid; lists all problems.
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
    return LoadedRanking(path, spec, entries, quick, tuple(chosen), tuple(edited))


def jobs_for_angles(ranking: LoadedRanking, base: Job, once: PlanningCache) -> dict[str, list[Job]]:
    """Return car -> runs of slowly increasing steer, which determine A; `base`: as in `plan_drives`.

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


def angle_of(records: Sequence[MeasuredRun], car: str) -> float:
    """Return the angle A of a car [rad] from its runs of slowly increasing steer.

    Raises:
        ResultsError: the runs do not yield it.
    """
    judged = []
    for record in records:
        found = record.values.get("angle")
        one = Evaluation(car)
        one.notes += [record.reason or "0.375 g is not reached"]
        one.add("angle", "", found[0] if found else None, "rad")
        judged.append(one)
    try:
        return characteristic_angle(judged)
    except NotJudged as why:
        raise ResultsError(str(why)) from None


@dataclass(frozen=True)
class RankingRun:
    """One run of a ranking: an entry under a condition at one amplitude."""

    entry: str
    condition: str
    amplitude: float  # [rad], positive: left first
    angle: float  # A of the car [rad]
    repeat: Value | None = None
    last: bool = False  # whether this is the regulation's last amplitude
    job: Job | None = None  # None until planned

    @property
    def key(self) -> str:
        """Key of the run's job; "" if not planned."""
        return self.job.key if self.job else ""

    @property
    def multiple(self) -> float:
        """The amplitude as a multiple of A."""
        return abs(self.amplitude) / self.angle


def drives_of(ranking: LoadedRanking, angles: Mapping[str, float]) -> list[RankingRun]:
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
            RankingRun(entry, name, sign * rung, angle, repeat, rung == rungs[-1])
            for (_, sign), repeat, rung in product(sides, repeats, rungs)
        ]
    return found


def plan_drives(
    ranking: LoadedRanking,
    drives: Sequence[RankingRun],
    base: Job,
    once: PlanningCache,
    progress: Callable[[int], None] = lambda done: None,
) -> list[RankingRun]:
    """Return the runs with planned jobs; `base`: common fields of all jobs, with the results folder.

    Raises:
        ScenarioError: some runs cannot start; lists each problem once.
    """
    jobs = []
    for drive in drives:
        condition = ranking.spec.conditions[drive.condition]
        value = drive.repeat
        repeated = [Override(place, value, "ranking") for place in condition.repeats if value is not None]
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


def _metrics(plan: Plan | None) -> MetricRequests:
    assert plan is not None
    driver = AMPLITUDE.partition(".")[0]
    begins = next(unit.parameter(STEERING_BEGINS) for unit in plan.instances if unit.name == driver)
    first, last = float(begins or 0.0), plan.time(plan.n_steps)
    return (("intervention", INTERVENTION, (first, last) if first < last else None), *METRICS)


def _lean(plan: Plan | None) -> Plan:
    assert plan is not None
    return replace(plan, record=tuple(one for one in plan.record if one[1].startswith(RECORDED)))

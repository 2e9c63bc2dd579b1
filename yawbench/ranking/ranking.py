"""Ranking files: controllers compared under conditions of sine with dwell; schema and loading.

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
`controller` and sets its parameters, the same in all conditions; `swap` swaps in what belongs to it beside
the controller, such as an allocator.

A ranking is two experiments (`ranked_runs`). The first determines the steering angle A of every car, on a
dry road without control, so that all controllers drive the same amplitudes. In the second, conditions are
named runs; entry, repeats and amplitude (positive: left first) are axes. `ranking_scores` computes scores
from its result.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

from pydantic import ConfigDict, Field, field_validator, model_validator

from yawbench.fmus.fmu import is_path
from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import hint
from yawbench.foundation.safe_files import reads
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.scenario import catalogue, yaml_lines
from yawbench.orchestrator.scenario.schema import Scalar
from yawbench.orchestrator.scenario.schema_validation import StrictModel, Time, validated
from yawbench.studies.axes import DesignAxisSpec, OverrideSpec, VariantSpec, changes_of_file
from yawbench.studies.experiment import LoadedFile

CONTROLLER = "controller"
"""The instance that all entries swap."""


class CarSpec(OverrideSpec):
    """A car, with the scenario that determines its characteristic angle A."""

    title: str = Field(min_length=1, description="Its words")
    slow_steer: str = Field(min_length=1, description="Scenario of slowly increasing steer, for A")


def _one_target(levels: dict[str, list[Scalar]]) -> dict[str, list[Scalar]]:
    if len(levels) > 1 or not all(levels.values()):
        raise ValueError("repeats: one instance.parameter with its values")
    return levels


class ConditionSpec(OverrideSpec):
    """A condition for all controllers: a car, a scenario of sine with dwell, and overrides."""

    title: str = Field(min_length=1, description="Its words")
    short: str = Field("", description="Words for the head of a column; default: all of them")
    car: str = Field(min_length=1, description="Key of `cars`")
    scenario: str = Field(min_length=1, description="Scenario of one run, relative to this file")
    dry: bool = Field(True, description="Responsiveness counts, which the regulation asks of dry roads")
    mirrored: bool = Field(True, description="Left and right are alike: left first stands for both")
    every: int | None = Field(None, ge=1, description="In place of the ranking's")
    repeats: dict[str, list[Scalar]] = Field({}, description="instance.parameter -> values, such as seeds")
    seen: bool = Field(False, description="By the search that tuned gains")
    quick: bool = Field(False, description="Driven by --quick, with the last amplitude alone")

    @property
    def heading(self) -> str:
        """Heading of the condition's column."""
        return (self.short or self.title) + (" *" if self.seen else "")

    one_target = field_validator("repeats")(_one_target)


class OrdinarySpec(OverrideSpec):
    """Ordinary driving, in which no controller should act: a scenario that some cars drive."""

    title: str = Field(min_length=1, description="Its words")
    short: str = Field("", description="Words for the head of a column; default: all of them")
    scenario: str = Field(min_length=1, description="Scenario of one run, relative to this file")
    cars: list[str] = Field([], description="Keys of `cars`; default: all")
    lateral: float | None = Field(
        None,
        gt=0.0,
        description="Lateral acceleration of the sine [m/s2]: its amplitude is in proportion to A",
    )
    repeats: dict[str, list[Scalar]] = Field({}, description="instance.parameter -> values, such as seeds")
    driver_brakes: bool = Field(False, description="Whether the driver brakes: then only the speed counts")

    @property
    def heading(self) -> str:
        """Heading of its column."""
        return self.short or self.title

    one_target = field_validator("repeats")(_one_target)


class SettingSpec(OverrideSpec):
    """A setting of what all controllers share, such as brakes, in which conditions are judged again."""

    title: str = Field(min_length=1, description="Its words")
    conditions: list[str] = Field([], description="Keys of `conditions`; default: `setting_conditions`")


class EntrySpec(StrictModel):
    """A controller to be ranked."""

    title: str = Field(min_length=1, description="Title in tables")
    fmu: str = Field(min_length=1, description="Name of the FMU, or a path relative to the file")
    parameters: dict[str, Scalar] = Field(
        {}, description="Parameter, or step_size, -> value; default: those of the FMU"
    )
    swap: dict[str, str] = Field(default={}, description="Other instance -> FMU that belongs to this entry")
    source: str = Field(min_length=1, description="Source of the controller and its gains")
    gains: Literal["authors", "tuned"] = Field("authors", description="Who chose the gains")

    @field_validator("swap")
    @classmethod
    def _beside_the_controller(cls, swap: dict[str, str]) -> dict[str, str]:
        if CONTROLLER in swap:
            raise ValueError(f"swap: give the FMU of {CONTROLLER!r} as fmu")
        return swap


class EntriesSpec(StrictModel):
    """A file of entries only: written by hand, or by `yawbench tune`."""

    entries: dict[str, EntrySpec] = Field(min_length=1, description="Name -> controller")


class RankingSpec(StrictModel):
    """A ranking file."""

    model_config = ConfigDict(
        json_schema_extra={"anyOf": [{"required": ["entries"]}, {"required": ["more_entries"]}]}
    )

    title: str = Field(min_length=1)
    source: str = Field("", description="Of the test that everything is judged by")
    notes: list[str] = Field([], description="Note for readers of the page")
    step_size: Time | None = Field(None, description="In place of the scenarios'")
    stop_time: Time | None = Field(None, description="In place of the scenarios'")
    every: int = Field(1, ge=1, description="Take every n-th amplitude, counted from the last")
    cars: dict[str, CarSpec] = Field(min_length=1, description="Name -> car")
    conditions: dict[str, ConditionSpec] = Field(min_length=1, description="Name -> condition")
    ordinary: dict[str, OrdinarySpec] = Field({}, description="Name -> ordinary driving")
    settings: dict[str, SettingSpec] = Field({}, description="Name -> setting of what all controllers share")
    setting_conditions: list[str] = Field(
        [], description="Conditions that settings judge again; default: all"
    )
    entries: dict[str, EntrySpec] = Field({}, description="Name -> controller")
    more_entries: list[str] = Field([], description="Files of entries, relative to this one")
    threat_file: str = Field(
        "", description="Threats whose published levels the page quotes, if the file is there"
    )

    @model_validator(mode="after")
    def _consistent(self) -> RankingSpec:
        for name, condition in self.conditions.items():
            if condition.car not in self.cars:
                known = ", ".join(self.cars)
                raise ValueError(
                    f"conditions.{name}.car: there is no car {condition.car!r}; there are {known}"
                )
        for place, names, there in self._named():
            for name in names:
                if name not in there:
                    raise ValueError(f"{place}: there is no {name!r}; there are {', '.join(there)}")
        if not self.entries and not self.more_entries:
            raise ValueError("has no entries")
        return self

    def _named(self) -> Iterator[tuple[str, list[str], Iterable[str]]]:
        """Yield place, names and those known, of lists of cars and conditions."""
        yield "setting_conditions", self.setting_conditions, self.conditions
        for key, setting in self.settings.items():
            yield f"settings.{key}.conditions", setting.conditions, self.conditions
        for key, ordinary in self.ordinary.items():
            yield f"ordinary.{key}.cars", ordinary.cars, self.cars


SERIES = "sine-with-dwell"
RECORDED = (
    "steering_wheel_angle*", "yaw_rate*", "sideslip*", "acceleration_y*", "velocity_x*", "velocity_y*",
    "yaw_moment*", "wheel_torque*", "torque_request*", "position_x*", "position_y*", "yaw_angle*",
    "steer_angle*",
)  # fmt: skip
"""The recorded signals: those of the test, the metrics and the car on the road; others would take space."""
OF_EVENTS = (
    "tyre_force_x*", "tyre_force_y*", "vertical_load*", "slip_ratio*", "friction*", "force_request*",
    "brake_pressure*", "wind_force_y*", "roll_angle*", "fault*",
)  # fmt: skip
"""Further signals, of the runs that the page shows: their events tell why a car was lost."""


@dataclass(frozen=True)
class LoadedRanking(LoadedFile):
    """A loaded ranking file, and the selected part of its conditions."""

    spec: RankingSpec
    entries: dict[str, tuple[EntrySpec, Path]]  # name -> controller, base folder of its path
    quick: bool = False  # only the last amplitude, and only quick conditions
    chosen: tuple[str, ...] = ()  # selected conditions; empty: all
    setting: str = ""  # key of the setting; "": as the file has it

    @cached_property
    def conditions(self) -> dict[str, ConditionSpec]:
        """The selected conditions."""
        return {
            name: condition
            for name, condition in self.spec.conditions.items()
            if (name in self.chosen if self.chosen else condition.quick or not self.quick)
        }

    @cached_property
    def cars(self) -> list[str]:
        """Names of the cars of the selected conditions."""
        return list(dict.fromkeys(condition.car for condition in self.conditions.values()))

    def changes(self, *parts: OverrideSpec, stop: bool = True) -> tuple[Override, ...]:
        """Return the overrides of the ranking and of parts of its file; the last one of a target counts."""
        own = [
            Override.of(name, float(value), "ranking")
            for name, value in (("step_size", self.spec.step_size), ("stop_time", self.spec.stop_time))
            if value is not None and (stop or name != "stop_time")
        ]
        return (
            *own,
            *(change for part in parts for change in changes_of_file(part, self.path.parent, "ranking")),
        )

    def scenario(self, name: str) -> Path:
        """Return the scenario that the file names."""
        return catalogue.placed(self.path.parent, name, "a scenario")

    def variant(self, name: str) -> VariantSpec:
        """Return an entry as a level of an axis: its controller is put into a scenario."""
        spec, folder = self.entries[name]
        swap = {
            instance: str((folder / fmu).absolute()) if is_path(fmu) and folder != self.path.parent else fmu
            for instance, fmu in {CONTROLLER: spec.fmu, **spec.swap}.items()
        }
        settings = {f"{CONTROLLER}.{parameter}": value for parameter, value in spec.parameters.items()}
        return VariantSpec.model_validate({"swap": swap, "set": settings})

    def axis_of(self, entries: Iterable[str]) -> DesignAxisSpec:
        """Return the axis of entries, one level each."""
        return DesignAxisSpec.model_construct(variants={name: self.variant(name) for name in entries})

    def changes_of_entry(self, name: str) -> list[Override]:
        """Return the overrides that put an entry's controller into a scenario."""
        return changes_of_file(self.variant(name), self.path.parent, "ranking")

    def changes_of_condition(self, name: str) -> tuple[Override, ...]:
        """Return the overrides that a condition makes in its scenario."""
        condition = self.spec.conditions[name]
        setting = [self.spec.settings[self.setting]] if self.setting else []
        return self.changes(self.spec.cars[condition.car], condition, *setting)

    @property
    def whole(self) -> bool:
        """Whether all is driven: no quick look, and no selected conditions."""
        return not self.quick and not self.chosen

    def under(self, setting: str) -> LoadedRanking:
        """Return the last amplitude of the conditions that a setting judges again, "": the ranking's own."""
        spec = self.spec
        own = spec.settings[setting].conditions if setting else []
        chosen = own or spec.setting_conditions or [*spec.conditions]
        return replace(self, setting=setting, chosen=tuple(chosen), quick=True)


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
        ScenarioError: the file is invalid; lists all errors.
    """
    path = Path(path)
    spec = validated(RankingSpec, yaml_lines.read(path, what="ranking file"))
    entries = {name: (entry, path.parent) for name, entry in spec.entries.items()}
    for name in spec.more_entries:
        file = path.parent / name
        listed = validated(EntriesSpec, yaml_lines.read(file, what="file of entries"))
        for key, entry in listed.entries.items():
            if key in entries:
                raise ScenarioError(
                    f"{file}: entries.{key}: there is already an entry {key!r}", code="name-duplicate"
                )
            entries[key] = (entry, file.parent)
    for key, entry in (more or {}).items():
        if key in entries:
            raise ScenarioError(
                f"there is already an entry {key!r}: give the controller another name", code="name-duplicate"
            )
        entries[key] = (entry, Path())
    for name in chosen:
        if name not in spec.conditions:
            raise ScenarioError(
                f"{path}: there is no condition {name!r}{hint(name, spec.conditions, lead='known')}",
                code="condition-unknown",
            )
    return LoadedRanking(path, spec, entries, quick, tuple(chosen))

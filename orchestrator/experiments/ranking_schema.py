"""The schema of a ranking: controllers and conditions as data, and the cars that the conditions are of.

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

A condition changes a scenario as an entry of a study does. An entry puts its FMU in the place of the unit
`controller` and gives it parameters, the same in all conditions.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from .. import checksums
from ..scenario.scenario_schema import Scalar
from ..scenario.strict import Strict, Time
from .axis_schema import Changes

UNIT = "controller"
"""The unit whose place all entries take."""
NAME = r"^[\w.+-]+$"


class CarSpec(Changes):
    """A car, and how its characteristic angle A is found."""

    title: str = Field(min_length=1, description="Its words")
    slow_steer: str = Field(min_length=1, description="Scenario of slowly increasing steer, for A")


class ConditionSpec(Changes):
    """What all controllers are put into: a car, a scenario of sine with dwell, what is changed in it."""

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
        """Its words at the head of a column."""
        return (self.short or self.title) + (" *" if self.seen else "")

    @field_validator("repeats")
    @classmethod
    def _one_place(cls, given: dict[str, list[Scalar]]) -> dict[str, list[Scalar]]:
        if len(given) > 1 or not all(given.values()):
            raise ValueError("repeats: one unit.parameter with its values")
        return given


class EntrySpec(Strict):
    """A controller."""

    title: str = Field(min_length=1, description="What tables call it")
    fmu: str = Field(min_length=1, description="Name of its FMU, or a path relative to the file")
    parameters: dict[str, Scalar] = Field({}, description="Parameter -> value; default: as they are")
    source: str = Field(min_length=1, description="Where it is from, and its gains")
    gains: Literal["authors", "tuned"] = Field("authors", description="Whose gains they are")


class EntriesSpec(Strict):
    """A file of entries alone: written by hand, or by `yawbench tune`, with checksums then."""

    entries: dict[str, EntrySpec] = Field(min_length=1, description="Name -> controller")
    checksums: dict[str, str] = Field({}, description="Of entries that `yawbench tune` has written")

    @property
    def content(self) -> dict[str, Any]:
        """What checksums are of: the entries as they stand."""
        return {name: one.model_dump(exclude_defaults=True) for name, one in self.entries.items()}

    @property
    def edited(self) -> str:
        """What is not as `yawbench tune` has written it, in words, "" if all is."""
        if self.checksums:
            words = checksums.what_changed(self.content, self.checksums)
            return f"{words} since `yawbench tune` wrote it" if words else ""
        if any(one.gains == "tuned" for one in self.entries.values()):
            return "has no checksums, so its tuned gains are taken as they are"
        return ""


class RankingSpec(Strict):
    """A file of a ranking."""

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

"""Threat files: how far a quantity can be turned up before a controller loses the car.

    title: How much controllers survive
    ranking: ranking.yaml              # its cars and entries
    cars: [saloon75, hard]
    threats:
      amplitude:
        {title: amplitude, unit: deg, easy: 45, hard: 720, scenario: sine_with_dwell.yaml,
         set: {driver.amplitude: "{level} deg"}, source: "the regulation ends at 270 to 300 degrees"}
      mass:
        {title: added mass, unit: kg, easy: 20, hard: 5000, scenario: sine_with_dwell.yaml,
         add: [plant.mass, plant.sprung_mass], source: chosen}
    settings:
      main: {title: one moment limit, limit: 10000}

A threat has levels from an easy to a hard end, spaced geometrically: level = easy (hard / easy)^x, where
the position x goes from 0 to 1. `{level}` in its overrides stands for the level; targets under `factor` are
multiplied by it and those under `add` get it added, from the car's value. In each setting (a moment limit, an
allocator, a bound on sideslip), for each car and entry, the highest level survived is searched from the easy
end up, in steps and halves, to 2 %. An entry that fails at the easy end counts with that end, and one that
passes at the hard end with that, said as ">=".

A run is survived if it meets the regulation's criteria and its sideslip stays below the bound, in a lane
change if no cone is touched. Unless the threat sets the amplitude, it is that of the regulation's last run.
Where left and right differ, both are driven; where noise acts, all seeds.

Disciplines are runs of other standard tests whose quantities are compared; less is better. A quantity has a
range, too, from a good to a bad end, on the same geometric scale.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Literal, NamedTuple

from pydantic import Field, model_validator

from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import hint
from yawbench.foundation.safe_files import reads
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.scenario import catalogue, yaml_lines
from yawbench.orchestrator.scenario.schema import Scalar
from yawbench.orchestrator.scenario.schema_validation import StrictModel, validated
from yawbench.orchestrator.signal_names import Target
from yawbench.proving_ground.sine_with_dwell import AMPLITUDE, SIDES, SPUN
from yawbench.studies.axes import OverrideSpec, TargetText
from yawbench.studies.experiment import LoadedFile

from .ranking import EntriesSpec, EntrySpec, LoadedRanking, load_ranking

REFERENCE = "none"
"""The entry without control, to which scores are relative."""
LANE_CHANGE = "lane-change"


class ThreatSpec(OverrideSpec):
    """A quantity that is turned up until the car is lost."""

    title: str = Field(min_length=1, description="Its words")
    short: str = Field("", description="Words for the head of a column; default: all of them")
    unit: str = Field("", description="Of its levels, in tables")
    easy: float = Field(gt=0.0, description="Level from which it is turned up")
    hard: float = Field(gt=0.0, description="Last level; below `easy` if less is harder")
    source: str = Field(min_length=1, description="Source of the range")
    scenario: str = Field(min_length=1, description="Scenario of one run, relative to this file")
    test: Literal["sine-with-dwell", "lane-change"] = Field("sine-with-dwell", description="Judges the run")
    factor: list[TargetText] = Field([], description="Parameters multiplied by the level, those that exist")
    add: list[TargetText] = Field([], description="Parameters to which the level is added, those that exist")
    distance: float | None = Field(
        None, gt=0.0, description="Driven in place of a stop time [m], at the speed set"
    )
    dry: bool = Field(True, description="Responsiveness counts, which the regulation asks of dry roads")
    mirrored: bool = Field(True, description="Left and right are alike: left first stands for both")
    repeats: dict[str, list[Scalar]] = Field(
        {}, description="instance.parameter -> values that all have to pass"
    )
    cars: list[str] = Field([], description="Cars that it applies to; default: all")

    @model_validator(mode="after")
    def _turned_up(self) -> ThreatSpec:
        if self.easy == self.hard:
            raise ValueError("easy and hard are the same level")
        texts = [str(value) for value in self.set.values()]
        if not (self.factor or self.add or any("{level}" in text for text in texts)):
            raise ValueError("changes nothing: use {level} in `set`, `factor` or `add`")
        if not self.mirrored and Target.parse(AMPLITUDE) in self.set:
            raise ValueError(f"mirrored: a threat that sets {AMPLITUDE} has one side")
        return self

    def level(self, position: float) -> float:
        """Return the level at a position, 0 (easy) to 1 (hard)."""
        return float(f"{self.easy * (self.hard / self.easy) ** position:.6g}")

    def filled(self, position: float) -> OverrideSpec:
        """Return its overrides at a position."""
        text = f"{self.level(position):.6g}"
        settings = {
            target: yaml_lines.scalar(value.replace("{level}", text)) if isinstance(value, str) else value
            for target, value in self.set.items()
        }
        return self.model_copy(update={"set": settings})


class ThreatSettingSpec(OverrideSpec):
    """Circumstances that are the same for all entries, in which all threats are searched.

    What an entry brings with it, such as an allocator of its own, a setting leaves as it is.
    """

    title: str = Field(min_length=1, description="Its words")
    limit: float | None = Field(None, gt=0.0, description="Moment limit of all [N.m]; default: each its own")
    bound: float = Field(
        round(math.degrees(SPUN), 9), gt=0.0, description="Sideslip that counts as lost [deg]"
    )
    gains: Literal["authors", "tuned"] | None = Field(
        None, description="Entries that it is for; default: all"
    )
    seeds: dict[str, str] = Field({}, description="Seed -> file with entries of the same laws, tuned again")
    groups: dict[str, list[str]] = Field(
        {},
        description="With `seeds`: title -> laws also compared alone, by their entries with authors' gains",
    )
    threats: list[str] = Field([], description="Default: all")
    cars: list[str] = Field([], description="Default: all")


class QuantitySpec(StrictModel):
    """A quantity of a discipline; less is better."""

    title: str = Field(min_length=1, description="Its words")
    best: float = Field(ge=0.0, description="Good end of its range, in SI units")
    worst: float = Field(gt=0.0, description="Bad end of its range, in SI units; with it counts a car lost")
    offset: float = Field(0.0, ge=0.0, description="Added before ratios are taken, in SI units")

    @model_validator(mode="after")
    def _has_a_range(self) -> QuantitySpec:
        if not 0.0 < self.best + self.offset < self.worst + self.offset:
            raise ValueError("best, with the offset, has to be above 0 and below worst")
        return self

    def position(self, magnitude: float | None) -> float:
        """Return where a magnitude lies in the range on a geometric scale: 0 bad end, 1 good end.

        Beyond an end it is that end; None, the car is lost, is the bad one.
        """
        if magnitude is None:
            return 0.0
        best, worst, value = (x + self.offset for x in (self.best, self.worst, magnitude))
        return 1.0 - min(1.0, math.log(max(value, best) / best) / math.log(worst / best))


class DisciplineSpec(OverrideSpec):
    """A standard test whose quantities are compared."""

    title: str = Field(min_length=1, description="Its words")
    source: str = Field("", description="Of what is not the standard's")
    scenario: str = Field(min_length=1, description="Scenario of one run, relative to this file")
    test: str = Field(min_length=1, description="Name of a standard test")
    quantities: dict[str, QuantitySpec] = Field(min_length=1, description="Key of the evaluation -> quantity")
    cars: list[str] = Field([], description="Default: all")


class PublishedSpec(StrictModel):
    """Tables of results found before, for entries that are not run."""

    levels: str = Field(min_length=1, description="Of levels survived, as levels.csv")
    quantities: str = Field("", description="Of the disciplines, as quantities.csv")
    matrix: str = Field("", description="Of the ranking, as its cells.csv")


class ThreatsSpec(StrictModel):
    """A threat file."""

    title: str = Field(min_length=1)
    source: str = Field("", description="Of the criteria")
    notes: list[str] = Field([], description="Note for readers of the page")
    ranking: str = Field(
        min_length=1, description="Ranking file with the cars and entries, relative to this file"
    )
    published: PublishedSpec | None = Field(None, description="Results found before")
    cars: list[str] = Field(min_length=1, description="Names of cars in the ranking file")
    scenarios: dict[str, dict[str, str]] = Field({}, description="Car -> scenario -> scenario in its place")
    threats: dict[str, ThreatSpec] = Field(min_length=1, description="Name -> threat")
    settings: dict[str, ThreatSettingSpec] = Field(
        min_length=1, description="Name -> setting; the first ranks"
    )
    disciplines: dict[str, DisciplineSpec] = Field(
        {}, description="Name -> test, compared in a table of its own"
    )

    @model_validator(mode="after")
    def _consistent(self) -> ThreatsSpec:
        for group in ("threats", "settings", "disciplines"):
            for name, spec in getattr(self, group).items():
                for key, known in (("cars", self.cars), ("threats", self.threats)):
                    for word in getattr(spec, key, ()):
                        if word not in known:
                            raise ValueError(
                                f"{group}.{name}.{key}: there is no {word!r}{hint(word, known, lead='known')}"
                            )
        return self


class SearchPlace(NamedTuple):
    """Key of a search: the setting, threat, car and entry that it is for."""

    setting: str
    threat: str
    car: str
    entry: str


@dataclass(frozen=True)
class LoadedThreats(LoadedFile):
    """A loaded threat file with the ranking whose entries it judges, those of further seeds among them."""

    spec: ThreatsSpec
    ranking: LoadedRanking
    seeds: dict[str, tuple[str, str]]  # entry of a further seed -> entry of the ranking, seed
    quick: bool = False  # only the first setting

    @property
    def main(self) -> str:
        """The setting that ranks."""
        return next(iter(self.spec.settings))

    def entries_in(self, setting: str) -> list[str]:
        """Return the entries that a setting is for; `none` always is."""
        spec = self.spec.settings[setting]
        return [
            name
            for name, (entry, _) in self.ranking.entries.items()
            if (name not in self.seeds or self.seeds[name][1] in spec.seeds)
            and (spec.gains in (None, entry.gains) or name == REFERENCE)
        ]

    def threats_in(self, setting: str) -> list[str]:
        """Return the threats of a setting."""
        return self.spec.settings[setting].threats or [*self.spec.threats]

    def cars_in(self, setting: str) -> list[str]:
        """Return the cars of a setting."""
        return self.spec.settings[setting].cars or self.spec.cars

    def cars_facing(self, setting: str, threat: str) -> list[str]:
        """Return the cars of a setting that a threat applies to."""
        applicable = self.spec.threats[threat].cars or self.spec.cars
        return [car for car in self.cars_in(setting) if car in applicable]

    def searches(self, only: Collection[str] = (), chosen: Collection[str] = ()) -> list[SearchPlace]:
        """Return what is searched; `only`: entries, `chosen`: settings (default: all)."""
        return [
            SearchPlace(name, threat, car, entry)
            for name in self.spec.settings
            if not chosen or name in chosen
            for threat in self.threats_in(name)
            for car in self.cars_facing(name, threat)
            for entry in self.entries_in(name)
            if not only or entry in only
        ]

    def scenario(self, car: str, name: str) -> Path:
        """Return a scenario, or that in its place for a car."""
        named = self.spec.scenarios.get(car, {}).get(name, name)
        return catalogue.placed(self.path.parent, named, "a scenario")

    def variants(self, threat: ThreatSpec) -> list[tuple[int, tuple[Override, ...]]]:
        """Return side (1: left first) and overrides of the repeats of all runs of a level."""
        sides = SIDES[:1] if threat.mirrored else SIDES
        repeats = product(*([(place, value) for value in values] for place, values in threat.repeats.items()))
        drawn = [
            tuple(Override.of(place, value, "ranking") for place, value in combination)
            for combination in repeats
        ]
        return [(round(sign), overrides) for overrides in drawn for _, sign in sides]


@reads("threat file", ScenarioError)
def load_threats(
    path: Path | str, *, more: Mapping[str, EntrySpec] | None = None, quick: bool = False
) -> LoadedThreats:
    """Load a threat file and its ranking file.

    Args:
        path: the file.
        more: further entries; paths of their FMUs are relative to the working directory.
        quick: only the first setting.

    Raises:
        ScenarioError: a file is invalid; lists all errors.
    """
    path = Path(path)
    spec = validated(ThreatsSpec, yaml_lines.read(path, what="threat file"))
    if quick:
        spec = spec.model_copy(update={"settings": dict([*spec.settings.items()][:1])})
    ranking = load_ranking(catalogue.placed(path.parent, spec.ranking, "a ranking file"), more=more)
    for name in spec.cars:
        if name not in ranking.spec.cars:
            raise ScenarioError(
                f"{path}: cars: {ranking.path.name} has no car {name!r}"
                f"{hint(name, ranking.spec.cars, lead='known')}",
                code="condition-unknown",
            )
    if REFERENCE not in ranking.entries:
        raise ScenarioError(
            f"{ranking.path}: has no entry {REFERENCE!r}, to which scores are relative", code="entry-unknown"
        )
    seeded: dict[str, tuple[EntrySpec, Path]] = {}
    seeds: dict[str, tuple[str, str]] = {}
    for seed, file in {
        seed: file for setting in spec.settings.values() for seed, file in setting.seeds.items()
    }.items():
        listed = validated(EntriesSpec, yaml_lines.read(path.parent / file, what="file of entries"))
        for name, entry in listed.entries.items():
            own = f"{name}_seed_{seed}"
            seeds[own] = name, seed
            title = f"{entry.title}, seed {seed}"
            seeded[own] = entry.model_copy(update={"title": title}), path.parent
    return LoadedThreats(path, spec, replace(ranking, entries={**ranking.entries, **seeded}), seeds, quick)

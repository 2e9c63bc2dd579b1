"""Runs of a threat file: the searches for the highest levels survived, side by side, and the disciplines."""

from __future__ import annotations

import csv
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.foundation.safe_files import reads
from yawbench.orchestrator.plan import Instance, Override
from yawbench.orchestrator.scenario.overrides import setting as setting_of
from yawbench.orchestrator.scenario.quantities import convert
from yawbench.orchestrator.signal_names import Target
from yawbench.proving_ground.sine_with_dwell import AMPLITUDE, amplitudes
from yawbench.studies.axes import Level, changes_of_file
from yawbench.studies.executor import Executor
from yawbench.studies.experiment import LoadedExperiment, NamedRun, experiment_of
from yawbench.studies.jobs import OF_MACHINE, MeasuredRun
from yawbench.studies.limit_search import Search, highest_passing, side_by_side
from yawbench.studies.tables import Table, column

from .ranked_runs import determine_angles
from .ranking import CONTROLLER, RECORDED, SERIES
from .ranking_scores import RankedRun, RankedState
from .threats import LANE_CHANGE, REFERENCE, LoadedThreats, SearchPlace, ThreatSpec

STEP = 0.125
"""First step of a search, as a position. Chosen: an eighth of the range, so that an early failure is
seen even if a higher level passes again."""
RESOLUTION = 0.02
"""Relative difference of the levels at the end of a search; chosen: below the scatter between cars."""
LIMIT = f"{CONTROLLER}.moment_limit"
NO_LOSS = OF_MACHINE | {"signal-unknown", "internal-error"}
"""Errors of a run that say nothing about the car; any other end of a run counts as lost."""
DRIVER = Target.parse(AMPLITUDE).instance
MOMENT = f"faults.{CONTROLLER}.yaw_moment"
"""Target of a moment limit for all, besides the parameter of controllers that have one."""
PATH = ("position_*", "yaw_angle*", "cone_overrun*")
"""Signals that lane changes need in addition to those of a ranking."""


class Attempt(NamedTuple):
    """A run of a search: the position of its level, and which of the runs of that level it is."""

    position: float
    variant: int


class Survived(NamedTuple):
    """Highest position survived; `end` says whether the range ended there."""

    position: float
    end: Literal["", "easy", "hard"]


def survivals(
    threats: LoadedThreats,
    angles: Mapping[str, float],
    execute: Executor,
    only: Collection[str] = (),
    chosen: Collection[str] = (),
) -> dict[SearchPlace, Survived]:
    """Search the highest levels survived, all side by side.

    Args:
        threats: as loaded.
        angles: car -> A [rad], of which the regulation's last amplitude follows.
        execute: executes the runs of each round.
        only: entries; empty: all.
        chosen: settings; empty: all.

    Raises:
        YawbenchError: a run cannot start.
    """
    maker = _RunMaker(threats, angles, execute)

    def passing(attempts: dict[SearchPlace, Attempt]) -> dict[SearchPlace, bool]:
        experiment = maker.experiment(attempts)
        result = execute(experiment, keep=False, record=(*RECORDED, *PATH))
        return {
            place: _survives(threats, angles, place, record)
            for place, record in zip(attempts, result.records, strict=True)
        }

    searches = {
        place: _search(spec, len(threats.variants(spec)))
        for place in threats.searches(only, chosen)
        for spec in (threats.spec.threats[place.threat],)
    }
    return side_by_side(searches, passing)


def _search(threat: ThreatSpec, variants: int) -> Search[Attempt, Survived]:
    """Search the highest position at which all runs of a level are survived, one after the other."""
    finest = RESOLUTION / abs(math.log(threat.hard / threat.easy))
    search = highest_passing(first=0.0, step=STEP, resolution=finest, least=0.0, most=1.0)
    answer: bool | None = None
    while True:
        try:
            position = search.send(answer)  # type: ignore[arg-type]  # None starts it
        except StopIteration as end:
            good, bad = end.value
            return Survived(good or 0.0, "easy" if good is None else "hard" if bad is None else "")
        for variant in range(variants):
            answer = yield Attempt(position, variant)
            if not answer:
                break


def _survives(
    threats: LoadedThreats, angles: Mapping[str, float], place: SearchPlace, record: MeasuredRun
) -> bool:
    """Return whether a run meets the criteria with its sideslip within the bound."""
    if not record.made:
        raise ResultsError(
            f"{place.entry}, {place.threat}: runs are missing; rank without --no-run", code="runs-missing"
        )
    if wrong := [diagnostic for diagnostic in record.diagnostics if diagnostic.code in NO_LOSS]:
        raise ScenarioError(wrong)
    spec, bound = threats.spec.threats[place.threat], math.radians(threats.spec.settings[place.setting].bound)
    amplitude = record.values.get("amplitude")
    run = RankedRun(place.entry, place.threat, amplitude[0] if amplitude else 0.0, angles[place.car], record)
    if spec.test == LANE_CHANGE:
        met = run["clean"] == 1.0
    else:  # by the ratios, which are not judged at other speeds than the regulation's
        responds = not spec.dry or not run.responsiveness_asked or run["responsiveness"] == 1.0
        met = responds and (run.headroom or 0.0) >= 0.0
    return met and (run["sideslip"] or 0.0) <= bound


@dataclass(frozen=True)
class _RunMaker:
    """Makes the runs of a round of searches."""

    threats: LoadedThreats
    angles: Mapping[str, float]
    execute: Executor
    instances: dict[tuple[str, Path, str], dict[str, Instance]] = field(default_factory=dict)
    """Car, scenario and entry -> instances by their names."""

    def experiment(self, attempts: Mapping[SearchPlace, Attempt]) -> LoadedExperiment:
        """Return the runs of a round, one for each search, in their order."""
        ranking = self.threats.ranking
        runs = [self._run(place, attempt) for place, attempt in attempts.items()]
        design = [(run.name, (Level(p.entry, p.entry),)) for run, p in zip(runs, attempts, strict=True)]
        axes = {"entry": ranking.axis_of(dict.fromkeys(place.entry for place in attempts))}
        title = f"{self.threats.spec.title}, {len({p.setting for p in attempts})} settings"
        return experiment_of(self.threats.path, runs, title=title, axes=axes, design=design, origin="ranking")

    def _run(self, place: SearchPlace, attempt: Attempt) -> NamedRun:
        threats, spec = self.threats, self.threats.spec.threats[place.threat]
        setting = threats.spec.settings[place.setting]
        side, repeat = threats.variants(spec)[attempt.variant]
        scenario = threats.scenario(place.car, spec.scenario)
        changes = _by_target(threats.ranking.changes(threats.ranking.spec.cars[place.car]))
        if spec.test == LANE_CHANGE:
            changes.pop(Target.parse("stop_time"), None)
        else:
            amplitude = side * amplitudes(self.angles[place.car])[-1]
            changes[Target.parse(AMPLITUDE)] = Override.of(AMPLITUDE, amplitude, "ranking")
        for part in (setting, spec.filled(attempt.position)):
            made = _by_target(changes_of_file(part, threats.path.parent, "ranking"))
            brought = threats.ranking.entries[place.entry][0].swap if part is setting else ()
            changes |= {target: one for target, one in made.items() if target.instance not in brought}
        changes |= _by_target(self._limited(place, scenario, changes))
        changes |= _by_target(self._scaled(place, scenario, spec, spec.level(attempt.position)))
        changes |= _by_target(repeat)
        if spec.distance is not None:
            speed = float(convert(str(changes[Target.parse("speed")].value), "m/s"))
            seconds = math.ceil(10.0 * spec.distance / speed) / 10.0
            changes[Target.parse("stop_time")] = Override.of("stop_time", seconds, "ranking")
        test = (LANE_CHANGE, None) if spec.test == LANE_CHANGE else (SERIES, self.angles[place.car])
        name = f"{'/'.join(place)}/{attempt.position:.6f}/{attempt.variant}"
        words = f"{spec.title}, {place.car}"
        return NamedRun(name, words, words, scenario, tuple(changes.values()), test)

    def _limited(
        self, place: SearchPlace, scenario: Path, changes: Mapping[Target, Override]
    ) -> Iterator[Override]:
        """Yield the overrides of a moment limit for all, before the faults of the threat."""
        limit = self.threats.spec.settings[place.setting].limit
        if limit is None:
            return
        own = changes.get(Target.parse(MOMENT))
        text = f"saturation {limit:.10g}" + (f"; {own.value}" if own else "")
        yield setting_of(Target.parse(MOMENT), text, "ranking")
        if self._nominal(place, scenario, Target.parse(LIMIT)) is not None:
            yield Override.of(LIMIT, limit, "ranking")

    def _scaled(
        self, place: SearchPlace, scenario: Path, spec: ThreatSpec, level: float
    ) -> Iterator[Override]:
        """Yield the overrides under `factor` and `add`.

        Raises:
            ScenarioError: none of the parameters exists.
        """
        known = [(target, self._nominal(place, scenario, target)) for target in (*spec.factor, *spec.add)]
        if known and all(value is None for _, value in known):
            raise ScenarioError(
                f"{self.threats.path}: threats.{place.threat}: {scenario.name} has no {known[0][0]}",
                code="parameter-unknown",
            )
        for target, value in known:
            if value is not None:
                number = value * level if target in spec.factor else value + level
                yield Override(target, float(f"{number:.9g}"), "ranking")

    def _nominal(self, place: SearchPlace, scenario: Path, target: Target) -> float | None:
        """Return the value of a parameter with a car and an entry; None if it does not exist."""
        key = place.car, scenario, place.entry
        if key not in self.instances:
            ranking = self.threats.ranking
            changes = *ranking.changes(ranking.spec.cars[place.car]), *ranking.changes_of_entry(place.entry)
            (plan,) = self.execute.plans([NamedRun("", "", "", scenario, changes)])
            self.instances[key] = {instance.name: instance for instance in plan.instances}
        instance = self.instances[key].get(target.instance)
        value = instance.parameter(target.variable) if instance else None
        return float(value) if isinstance(value, (int, float)) else None


def _by_target(changes: Iterable[Override]) -> dict[Target, Override]:
    """Return target -> its last override."""
    return {change.target: change for change in changes}


Quantities = dict[tuple[str, str, str], dict[str, float | None]]
"""(discipline, car, entry) -> key -> magnitude in SI units; None if the run does not yield it."""


def discipline_experiment(
    threats: LoadedThreats, only: Collection[str] = (), chosen: Collection[str] = ()
) -> LoadedExperiment | None:
    """Return the runs of disciplines in the main setting; None if there are none.

    Args:
        threats: as loaded.
        only: entries; empty: all.
        chosen: disciplines; empty: all.
    """
    ranking, runs, design = threats.ranking, [], []
    entries = [entry for entry in threats.entries_in(threats.main) if not only or entry in only]
    limit = threats.spec.settings[threats.main].limit
    for name, spec in threats.spec.disciplines.items():
        for car in (spec.cars or threats.spec.cars) if not chosen or name in chosen else ():
            own = ranking.changes(ranking.spec.cars[car], stop=False)
            changes = (
                *(change for change in own if change.target.instance != DRIVER),  # drives other scenarios
                *changes_of_file(spec, threats.path.parent, "ranking"),
                *([setting_of(Target.parse(MOMENT), f"saturation {limit:.10g}", "ranking")] if limit else []),
            )
            words = f"{spec.title}, {car}"
            scenario = threats.scenario(car, spec.scenario)
            runs.append(NamedRun(f"{name}/{car}", words, words, scenario, changes, (spec.test, None)))
            design += [(runs[-1].name, (Level(entry, entry),)) for entry in entries]
    if not runs:
        return None
    axes, title = {"entry": ranking.axis_of(entries)}, "other disciplines"
    return experiment_of(threats.path, runs, title=title, axes=axes, design=design, origin="ranking")


def table_of_quantities(result: ThreatResult) -> Table:
    """Return the table with a row per quantity of each discipline, car and entry, in SI units."""
    rows = [
        (*place, key, value) for place, values in result.quantities.items() for key, value in values.items()
    ]
    names = ("discipline", "car", "entry", "quantity")
    return Table.of_columns(
        [
            *(column(name, "string", [row[k] for row in rows]) for k, name in enumerate(names)),
            column("value", "float64", [row[4] for row in rows]),
            column("unit", "string", [result.units.get((row[0], row[3]), "") for row in rows]),
        ]
    )


@dataclass(frozen=True)
class ThreatResult:
    """Highest levels survived, and the quantities of the disciplines."""

    threats: LoadedThreats
    angles: dict[str, float]  # car -> A [rad]
    survived: dict[SearchPlace, Survived]
    quantities: Quantities
    units: dict[tuple[str, str], str] = field(default_factory=dict)  # (discipline, key) -> SI unit
    published: frozenset[str] = frozenset()  # entries whose levels in the main setting were found before
    passed: dict[str, tuple[int, int]] = field(default_factory=dict)
    """Entry -> conditions of the ranking's matrix that it passes, and all; as published."""

    @cached_property
    def complete(self) -> dict[str, list[str]]:
        """Setting -> entries with all of its levels."""
        lacking = {(p.setting, p.entry) for p in self.threats.searches() if p not in self.survived}
        return {
            name: [entry for entry in self.threats.entries_in(name) if (name, entry) not in lacking]
            for name in self.threats.spec.settings
        }

    def positions(self, setting: str, entries: Sequence[str], like: str = "") -> np.ndarray:
        """Return the array of entry, threat and car of a setting; NaN where a car does not drive a threat.

        Args:
            setting: name of the setting.
            entries: names of entries with all levels.
            like: take the threats and cars of this setting.
        """
        spec = self.threats.spec
        threats, cars = self.threats.threats_in(like or setting), self.threats.cars_in(like or setting)
        positions = np.full((len(entries), len(threats), len(cars)), np.nan)
        for i, entry in enumerate(entries):
            for k, threat in enumerate(threats):
                for n, car in enumerate(cars):
                    if car in (spec.threats[threat].cars or spec.cars):
                        positions[i, k, n] = self.survived[SearchPlace(setting, threat, car, entry)].position
        return positions


def table_of_levels(result: ThreatResult) -> Table:
    """Return the table with a row per search: its level in the unit of the file, position and end."""
    places = list(result.survived)
    searched = list(result.survived.values())
    specs = [result.threats.spec.threats[place.threat] for place in places]
    levels = [spec.level(survived.position) for spec, survived in zip(specs, searched, strict=True)]
    return Table.of_columns(
        [
            *(column(key, "string", [getattr(p, key) for p in places]) for key in SearchPlace._fields),
            column("level", "float64", levels),
            column("unit", "string", [spec.unit for spec in specs]),
            column("position", "float64", [survived.position for survived in searched]),
            column("end", "string", [survived.end for survived in searched]),
        ]
    )


def run_threats(
    threats: LoadedThreats, execute: Executor, *, only: Collection[str] = (), chosen: Collection[str] = ()
) -> ThreatResult:
    """Search all levels of a threat file and drive its disciplines.

    Args:
        threats: as loaded.
        execute: executes experiments.
        only: entries to run; the others count with the published levels. Empty: all.
        chosen: settings to search and disciplines to drive; the others count as published. Empty: all.

    Raises:
        YawbenchError: a run cannot start, or A cannot be determined.
    """
    angles = determine_angles(threats.ranking, execute, threats.spec.cars)
    before = published_result(threats)
    if not only and not chosen:  # everything is run, the matrix apart
        before = ThreatResult(threats, angles, {}, {}, passed=before.passed)
    if only and REFERENCE not in before.published:
        only = {*only, REFERENCE}
    survived = before.survived | survivals(threats, angles, execute, only, chosen)
    quantities, units = {**before.quantities}, {**before.units}
    experiment = discipline_experiment(threats, only, chosen)
    if experiment is not None:
        driven = execute(experiment, keep=False)
        for case, record in zip(driven.experiment.cases, driven.records, strict=True):
            discipline, car = case.run.name.split("/")
            values = {key: record.values.get(key) for key in threats.spec.disciplines[discipline].quantities}
            units |= {(discipline, key): value[1] for key, value in values.items() if value}
            if record.made:
                quantities[discipline, car, str(case.point[0].value)] = {
                    key: None if value is None else abs(value[0]) for key, value in values.items()
                }
    searched = {place.entry for place in threats.searches(only, chosen) if place.setting == threats.main}
    return ThreatResult(
        threats, angles, survived, quantities, units, before.published - searched, before.passed
    )


def published_result(threats: LoadedThreats) -> ThreatResult:
    """Return the published results of a threat file, without threats and disciplines it no longer has.

    Raises:
        ScenarioError: a table cannot be read.
    """
    published = threats.spec.published
    if published is None:
        return ThreatResult(threats, {}, {}, {})
    survived = _published_levels(threats.path.parent / published.levels, threats)
    quantities: Quantities = {}
    units: dict[tuple[str, str], str] = {}
    if published.quantities:
        quantities, units = _published_quantities(threats.path.parent / published.quantities, threats)
    passed = _published_matrix(threats.path.parent / published.matrix) if published.matrix else {}
    entries = frozenset(place.entry for place in survived if place.setting == threats.main)
    return ThreatResult(threats, {}, survived, quantities, units, entries, passed)


def _rows(path: Path | str) -> list[dict[str, str]]:
    with Path(path).open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


@reads("table of levels", ScenarioError)
def _published_levels(path: Path | str, threats: LoadedThreats) -> dict[SearchPlace, Survived]:
    wanted, levels = set(threats.searches()), {}
    for row in _rows(path):
        place = SearchPlace(*(row[key] for key in SearchPlace._fields))
        if place in wanted:
            levels[place] = Survived(float(row["position"]), row["end"])  # type: ignore[arg-type]
    return levels


@reads("table of quantities", ScenarioError)
def _published_quantities(
    path: Path | str, threats: LoadedThreats
) -> tuple[Quantities, dict[tuple[str, str], str]]:
    quantities: Quantities = {}
    units = {}
    for row in _rows(path):
        name, key = row["discipline"], row["quantity"]
        if name in threats.spec.disciplines:
            units[name, key] = row["unit"]
            value = float(row["value"]) if row["value"] else None
            quantities.setdefault((name, row["car"], row["entry"]), {})[key] = value
    return quantities, units


@reads("table of a ranking", ScenarioError)
def _published_matrix(path: Path | str) -> dict[str, tuple[int, int]]:
    cells: dict[str, list[str]] = {}
    for row in _rows(path):
        cells.setdefault(row["entry"], []).append(row["state"])
    passed = RankedState.PASSED.value
    return {entry: (states.count(passed), len(states)) for entry, states in cells.items()}

"""Nuisance: how much controllers brake in ordinary driving, in which none should act.

Every entry drives the situations of `ordinary:` with some cars. Counted are the share of the time in which
any wheel is braked, the highest pressure, and the speed lost against the car without control. Where the
driver brakes, only that speed counts: a controller that releases brakes leaves the car faster.

Two entries are told apart by the braked shares of all situations and cars, both taken as samples of ordinary
driving (`studies.confidence.crossed_probability`), corrected for the number of pairs (Holm).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import comb
from typing import Any

import numpy as np

from yawbench.figures.display import digits_of
from yawbench.foundation.messages import counted, in_text
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.scenario.schema_validation import made
from yawbench.proving_ground.sine_with_dwell import AMPLITUDE
from yawbench.studies.axes import Level
from yawbench.studies.claim_schema import MetricSpec
from yawbench.studies.confidence import crossed_probability
from yawbench.studies.executor import Executor
from yawbench.studies.experiment import LoadedExperiment, NamedRun, experiment_of
from yawbench.studies.jobs import MeasuredRun
from yawbench.studies.pair_comparisons import ToldApart, told_apart
from yawbench.studies.tables import Cell, Table, number_column, text_column

from .ranked_runs import axes_of_repeats, determine_angles, repeats_of
from .ranking import RECORDED, EntrySpec, LoadedRanking, OrdinarySpec
from .ranking_scores import IDLE
from .ranking_tables import share_text

AT_A = 0.3 * 9.80665
"""Lateral acceleration at the angle A [m/s2]."""
METRICS = {
    "braking": "braked_share(wheel_torque_fl)",
    "pressure": "peak(brake_pressure_*)",
    "speed_end": "final(velocity_x)",
}


@dataclass(frozen=True)
class OrdinaryRun:
    """A run of an entry in a situation with a car."""

    entry: str
    situation: str
    car: str
    repeat: Any
    record: MeasuredRun | None  # None: missing
    row: Mapping[str, float] = field(default_factory=dict)  # published numbers, in place of the record's

    def __getitem__(self, key: str) -> float | None:
        if key in self.row:
            return self.row[key]
        measured = self.record.values.get(key) if self.record else None
        return measured[0] if measured else None

    @property
    def identity(self) -> tuple[str, str, Any]:
        """What is driven."""
        return self.situation, self.car, self.repeat


@dataclass(frozen=True)
class NuisanceScore:
    """Nuisance of an entry: its runs, and those of the car without control that they are compared with."""

    entry: str
    spec: EntrySpec
    runs: Sequence[OrdinaryRun]
    without: Mapping[
        tuple[str, str, Any], float
    ]  # situation, car, repeat -> final speed without control [m/s]
    braked_by_driver: frozenset[str]  # situations

    @property
    def complete(self) -> bool:
        """Whether every run is there."""
        return all(run["braking"] is not None for run in self.runs)

    def _own(self, *, driver_brakes: bool = False, situation: str | None = None) -> list[OrdinaryRun]:
        return [
            run
            for run in self.runs
            if (run.situation in self.braked_by_driver) is driver_brakes
            and situation in (None, run.situation)
        ]

    def braking(self, situation: str | None = None) -> float | None:
        """Return the share of the time with brakes [1], of a situation or of all, mean over runs."""
        return _mean(run["braking"] for run in self._own(situation=situation))

    @cached_property
    def pressure(self) -> float | None:
        """The highest pressure [Pa] where the driver does not brake."""
        return max((x for run in self._own() if (x := run["pressure"]) is not None), default=None)

    @cached_property
    def speed_lost(self) -> float | None:
        """Speed lost against no control [m/s], mean of the runs in which the driver does not brake."""
        return self._slower(driver_brakes=False)

    @cached_property
    def speed_kept(self) -> float | None:
        """Speed left beyond that of the car without control [m/s], where the driver brakes."""
        slower = self._slower(driver_brakes=True)
        return None if slower is None else -slower

    def _slower(self, *, driver_brakes: bool) -> float | None:
        differences = []
        for run in self._own(driver_brakes=driver_brakes):
            own, without = run["speed_end"], self.without.get(run.identity)
            differences.append(None if own is None or without is None else without - own)
        return _mean(differences)

    def table(self, situations: Sequence[str], cars: Sequence[str]) -> np.ndarray:
        """Return the braked shares [1] by situation and car, means over repeats; NaN: not driven."""
        shares = [
            [_mean(run["braking"] for run in self._own(situation=name) if run.car == car) for car in cars]
            for name in situations
        ]
        return np.array(shares, dtype=float)  # None becomes NaN


@dataclass(frozen=True)
class Nuisance:
    """Nuisance of all entries, in the order of the ranking."""

    ordinary: Mapping[str, OrdinarySpec]
    scores: dict[str, NuisanceScore]

    @cached_property
    def situations(self) -> list[str]:
        """Situations in which the driver does not brake."""
        return [name for name, spec in self.ordinary.items() if not spec.driver_brakes]

    @cached_property
    def complete(self) -> list[NuisanceScore]:
        """Scores of entries with all runs, the least braking first."""
        scores = [score for score in self.scores.values() if score.complete]
        return sorted(scores, key=lambda score: score.braking() or 0.0)

    @cached_property
    def apart(self) -> ToldApart:
        """Compare all pairs of `complete`, less braking is better."""
        cars = list(dict.fromkeys(run.car for score in self.complete for run in score.runs))
        tables = [score.table(self.situations, cars) for score in self.complete]
        idle = next((k for k, score in enumerate(self.complete) if score.spec.fmu == IDLE), None)
        return told_apart(
            [-float(np.nanmean(table)) for table in tables],
            lambda i, j: crossed_probability(tables[i] - tables[j]),
            idle,
        )


def _mean(numbers: Any) -> float | None:
    known = list(numbers)
    if not known or any(x is None for x in known):
        return None
    return float(sum(known) / len(known))


def nuisance_experiment(
    ranking: LoadedRanking, angles: Mapping[str, float], execute: Executor
) -> tuple[LoadedExperiment, dict[str, tuple[str, str]]]:
    """Return the runs of ordinary driving, and name of the run -> situation and car.

    Args:
        ranking: as loaded.
        angles: car -> A [rad], of which the amplitudes of sines are shares.
        execute: makes plans.

    Raises:
        ScenarioError: a scenario is wrong.
    """
    runs, places, design = [], {}, []
    for name, spec in ranking.spec.ordinary.items():
        for car in spec.cars or ranking.spec.cars:
            key = f"{name}/{car}"
            changes = ranking.changes(ranking.spec.cars[car], spec, stop=False)
            if spec.lateral is not None:
                amplitude = angles[car] * spec.lateral / AT_A
                changes = (*changes, Override.of(AMPLITUDE, amplitude, "ranking"))
            places[key] = name, car
            title = f"{spec.title}, {car}"
            runs.append(NamedRun(key, title, title, ranking.scenario(spec.scenario), changes))
            design += [
                (key, (Level(entry, entry), *repeat))
                for entry in ranking.entries
                for repeat in repeats_of(ranking.spec.ordinary, spec)
            ]
    axes = axes_of_repeats(ranking, {key: ranking.spec.ordinary[name] for key, (name, _) in places.items()})
    experiment = experiment_of(
        ranking.path, runs, title=f"{ranking.spec.title}: ordinary driving", axes=axes, design=design,
        origin="ranking", metrics={key: made(MetricSpec, metric=name) for key, name in METRICS.items()},
    )  # fmt: skip
    return experiment, places


def run_nuisance(ranking: LoadedRanking, execute: Executor, *, only: Collection[str] = ()) -> Nuisance:
    """Execute the missing runs of ordinary driving and return what controllers do there.

    Raises:
        YawbenchError: a run cannot start.
    """
    specs = ranking.spec.ordinary.values()
    cars = list(dict.fromkeys(car for spec in specs for car in spec.cars or ranking.spec.cars))
    experiment, places = nuisance_experiment(ranking, determine_angles(ranking, execute, cars), execute)
    result = execute(
        experiment,
        only=lambda case: not only or case.point[0].value in only,
        keep=False,
        record=(*RECORDED, "brake_pressure*"),
    ).of_models()
    names = [*result.spec.axes]
    runs = []
    for case, record in zip(result.experiment.cases, result.records, strict=True):
        situation, car = places[case.run.name]
        at = dict(zip(names, case.point, strict=True))
        repeat = next((at[place].value for place in ranking.spec.ordinary[situation].repeats), None)
        runs.append(
            OrdinaryRun(str(at["entry"].value), situation, car, repeat, record if record.made else None)
        )
    return nuisance_of(ranking, runs)


def nuisance_of(ranking: LoadedRanking, runs: Sequence[OrdinaryRun]) -> Nuisance:
    """Return the nuisance of all entries from their runs."""
    ordinary = ranking.spec.ordinary
    specs = {name: spec for name, (spec, _) in ranking.entries.items()}
    idle = [name for name, spec in specs.items() if spec.fmu == IDLE]
    without = {run.identity: x for run in runs if run.entry in idle and (x := run["speed_end"]) is not None}
    brakes = frozenset(name for name, spec in ordinary.items() if spec.driver_brakes)
    scores = {
        name: NuisanceScore(name, spec, [run for run in runs if run.entry == name], without, brakes)
        for name, spec in specs.items()
    }
    return Nuisance(ordinary, scores)


RULE = (
    "Braking: share of the time in which any wheel is braked by more than 20 N.m, mean over situations and "
    "cars; then of each situation. Pressure: the highest. Speed lost: against no control, mean. Speed kept: "
    "beyond no control where the driver brakes."
)


def nuisance_table(nuisance: Nuisance) -> Table:
    """Return the table of nuisance, the least braking first."""
    headings = [
        "controller", "braking", *(nuisance.ordinary[name].heading for name in nuisance.situations),
        "highest pressure [MPa]", "speed lost [km/h]", "speed kept [km/h]",
    ]  # fmt: skip
    rows: list[list[Cell]] = []
    for score in nuisance.complete:
        each = [share_text(score.braking(name)) for name in nuisance.situations]
        speeds = (score.speed_lost, score.speed_kept)
        rows.append([
            score.spec.title, share_text(score.braking()), *each,
            None if score.pressure is None else digits_of(1e-6 * score.pressure, 2),
            *(None if x is None else f"{round(3.6 * x, 1) + 0.0:.1f}" for x in speeds),  # + 0.0: no -0.0
        ])  # fmt: skip
    return Table("Nuisance in ordinary driving", headings, rows, [RULE], {*range(1, len(headings))})


def columns_of_nuisance(nuisance: Nuisance) -> Table:
    """Return columns with a row per run, in SI units."""
    runs = [run for score in nuisance.scores.values() for run in score.runs]
    names = ("entry", "situation", "car", "repeat")
    texts = (text_column(name, [getattr(run, name) for run in runs]) for name in names)
    units = {"braking": "1", "pressure": "Pa", "speed_end": "m/s"}
    numbers = (number_column(key, unit, [run[key] for run in runs]) for key, unit in units.items())
    return Table.of_columns([*texts, *numbers])


def nuisance_sentence(nuisance: Nuisance) -> str:
    """Return who brakes least and most in ordinary driving, and how many can be told apart."""
    controllers = [score for score in nuisance.complete if score.spec.fmu != IDLE]
    if not controllers:
        return ""
    least, most = controllers[0], controllers[-1]
    own = [k for k, score in enumerate(nuisance.complete) if score.spec.fmu != IDLE]
    among = nuisance.apart.of(own)
    pairs = comb(len(own), 2)
    if len(own) < 2:
        return f"In ordinary driving {least.spec.title} brakes for {share_text(least.braking())} of the time."
    alike = sum(share_text(score.braking()) == share_text(least.braking()) for score in controllers)
    those = in_text(least.spec.title) if alike == 1 else counted(alike, "controller")
    return (
        f"In ordinary driving, where none should act, {those} {'brakes' if alike == 1 else 'brake'} for "
        f"{share_text(least.braking())} of the time, {in_text(most.spec.title)} for "
        f"{share_text(most.braking())}; of {pairs} pairs {among.better.sum()} are clearly different, "
        f"corrected for their number; each pair taken alone, {among.alone.sum()} would be."
    )

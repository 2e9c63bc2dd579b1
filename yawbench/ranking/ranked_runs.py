"""Runs of a ranking: two experiments, the steering angle A of every car, and sine with dwell."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

from yawbench.foundation.errors import ResultsError
from yawbench.metrics.expressions import TimeWindow
from yawbench.metrics.verdict import NotJudged
from yawbench.orchestrator.plan import Plan
from yawbench.orchestrator.scenario.schema_validation import made
from yawbench.orchestrator.signal_names import Target
from yawbench.proving_ground.sine_with_dwell import AMPLITUDE, SIDES, amplitudes
from yawbench.proving_ground.standard_tests import Evaluation
from yawbench.proving_ground.steady_state_steering import characteristic_angle, slow_steer_amplitude
from yawbench.studies.axes import DesignAxisSpec, Level, axis_of_levels
from yawbench.studies.claim_schema import MetricSpec, text_of
from yawbench.studies.executor import Executor
from yawbench.studies.experiment import LoadedExperiment, NamedRun, experiment_of
from yawbench.studies.experiment_result import ExperimentResult

from .ranking import SERIES, ConditionSpec, LoadedRanking, OrdinarySpec

SLOW = "slowly-increasing-steer"
METRICS = {
    "intervention": "effort(wheel_torque_*)",
    "effort": "effort(yaw_moment)",
    "chatter": "total_variation_rate(yaw_moment)",
}
"""Metrics besides the test's; the intervention begins with steering: before, wheel torque is the driver's."""
STEERING_BEGINS = "start_time"
"""Parameter of the driver: beginning of steer [s]."""
Repeated = Mapping[str, ConditionSpec | OrdinarySpec]
"""Name of a run -> what may repeat it."""


def angle_experiment(
    ranking: LoadedRanking, execute: Executor, cars: Sequence[str] | None = None
) -> LoadedExperiment:
    """Return the runs of slowly increasing steer to both sides that determine A, a named run per car.

    Args:
        ranking: as loaded.
        execute: makes plans.
        cars: names of cars; default: those of the conditions.

    Raises:
        ScenarioError: a scenario is wrong, or its driver has no amplitude.
    """
    runs = []
    for name in ranking.cars if cars is None else cars:
        car = ranking.spec.cars[name]
        scenario, changes = ranking.scenario(car.slow_steer), ranking.changes(car, stop=False)
        runs.append(NamedRun(name, car.title, car.title, scenario, changes, (SLOW, None)))
    steer_amplitudes = [
        slow_steer_amplitude(plan, run.scenario) for run, plan in zip(runs, execute.plans(runs), strict=True)
    ]
    design = [
        (run.name, (Level(side * amplitude, words),))
        for run, amplitude in zip(runs, steer_amplitudes, strict=True)
        for words, side in SIDES
    ]
    axes = {"side": axis_of_levels(AMPLITUDE, [level for _, (level,) in design])}
    title = "A, the angle at 0.3 g"
    return experiment_of(ranking.path, runs, title=title, axes=axes, design=design, origin="ranking")


def angles_of(
    ranking: LoadedRanking, result: ExperimentResult, cars: Sequence[str] | None = None
) -> dict[str, float]:
    """Return car -> angle A [rad], from the result of `angle_experiment` for the same cars.

    Raises:
        ResultsError: the runs do not yield it.
    """
    angles = {}
    for car in ranking.cars if cars is None else cars:
        judged = []
        for case, record in zip(result.experiment.cases, result.records, strict=True):
            if case.run.name == car:
                measured = record.values.get("angle")
                judged.append(Evaluation(car))
                judged[-1].report("test-not-judged", record.reason or "0.375 g is not reached")
                judged[-1].add("angle", "", measured[0] if measured else None, "rad")
        try:
            angles[car] = characteristic_angle(judged)
        except NotJudged as why:
            raise ResultsError(str(why), code="test-not-applicable") from None
    return angles


def determine_angles(
    ranking: LoadedRanking, execute: Executor, cars: Sequence[str] | None = None
) -> dict[str, float]:
    """Execute the missing runs that determine A, and return car -> A [rad]; arguments as above.

    Raises:
        YawbenchError: a run cannot start or was not made, or the runs do not yield A.
    """
    slow = execute(angle_experiment(ranking, execute, cars), keep=False).of_models()
    for case, record in zip(slow.experiment.cases, slow.records, strict=True):
        if not record.made:
            raise ResultsError(
                f"{execute.folder}: contains no A of {case.run.name!r} for these FMUs; rank without --no-run",
                code="runs-missing",
            )
    return angles_of(ranking, slow, cars)


def dwell_experiment(
    ranking: LoadedRanking, angles: Mapping[str, float], execute: Executor
) -> LoadedExperiment:
    """Return the runs of sine with dwell: a named run per condition; axes: entry, repeats, amplitude.

    Args:
        ranking: as loaded.
        angles: car -> A [rad], of which the amplitudes are multiples.
        execute: makes plans.

    Raises:
        ScenarioError: a scenario is wrong.
    """
    runs = []
    for name, condition in ranking.conditions.items():
        scenario, test = ranking.scenario(condition.scenario), (SERIES, angles[condition.car])
        changes = ranking.changes_of_condition(name)
        runs.append(NamedRun(name, condition.title, condition.title, scenario, changes, test))
    runs = [
        replace(run, windows={"intervention": window} if (window := _since_steering(plan)) else {})
        for run, plan in zip(runs, execute.plans(runs), strict=True)
    ]
    design = [
        (run.name, (Level(entry, entry), *repeat, amplitude))
        for run in runs
        for entry in ranking.entries
        for repeat, amplitude in _levels(ranking, run.name, angles)
    ]
    axes = axes_of_repeats(ranking, ranking.conditions)
    axes["amplitude"] = axis_of_levels(AMPLITUDE, [point[-1] for _, point in design])
    return experiment_of(
        ranking.path, runs, title=ranking.spec.title, axes=axes, design=design, origin="ranking",
        metrics={key: made(MetricSpec, metric=name) for key, name in METRICS.items()},
    )  # fmt: skip


def _repeated(runs: Repeated) -> dict[str, list[Level]]:
    """Return the levels of all repeats of runs: instance.parameter -> values."""
    levels: dict[str, dict[Any, Level]] = {}
    for spec in runs.values():
        for place, values in spec.repeats.items():
            levels.setdefault(place, {}).update((value, Level(value, text_of(value))) for value in values)
    return {place: [*known.values()] for place, known in levels.items()}


def repeats_of(runs: Repeated, spec: ConditionSpec | OrdinarySpec) -> list[tuple[Level, ...]]:
    """Return the points of one of the runs on the axes of all repeats."""
    return [*product(*(
        [level for level in levels if level.value in spec.repeats.get(place, [levels[0].value])]
        for place, levels in _repeated(runs).items()
    ))]  # fmt: skip


def axes_of_repeats(ranking: LoadedRanking, runs: Repeated) -> dict[str, DesignAxisSpec]:
    """Return the axes of runs that all entries drive: entries and repeats."""
    return {"entry": ranking.axis_of(ranking.entries)} | {
        place: axis_of_levels(
            place, levels, runs=[name for name, spec in runs.items() if place in spec.repeats],
            repeats=len(levels) > 1,
        )
        for place, levels in _repeated(runs).items()
    }  # fmt: skip


def _levels(
    ranking: LoadedRanking, name: str, angles: Mapping[str, float]
) -> Iterator[tuple[tuple[Level, ...], Level]]:
    """Yield the levels of repeats and amplitude of a condition."""
    condition = ranking.spec.conditions[name]
    rungs = amplitudes(angles[condition.car])[:: -(condition.every or ranking.spec.every)][::-1]
    sides = SIDES[:1] if condition.mirrored else SIDES
    for _, sign in sides:
        for repeat in repeats_of(ranking.conditions, condition):
            for rung in rungs[-1:] if ranking.quick else rungs:
                yield repeat, Level(sign * rung, f"{math.degrees(sign * rung):.1f} deg")


def _since_steering(plan: Plan) -> TimeWindow | None:
    """Return the time from the beginning of steer to the end of a run; None if there is none between."""
    driver = Target.parse(AMPLITUDE).instance
    begins = next(
        instance.parameter(STEERING_BEGINS) for instance in plan.instances if instance.name == driver
    )
    first, last = float(begins or 0.0), plan.time(plan.n_steps)
    return (first, last) if first < last else None

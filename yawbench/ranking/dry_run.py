"""Forecasts of rankings: the runs, time and disk space that they still need."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

from yawbench.figures.display import shown
from yawbench.studies.dry_run import LINE, Forecast, Pace, Span, add_jobs
from yawbench.studies.executor import Executor
from yawbench.studies.experiment_result import judge_records
from yawbench.studies.journal import records_in
from yawbench.studies.on_demand import OnDemand

from .ranked_runs import angle_experiment, angles_of, dwell_experiment
from .ranking import LoadedRanking
from .threat_runs import RESOLUTION, STEP
from .threats import LoadedThreats

ASSUMED = math.radians(40.0)
"""A [rad] where it has not been measured; chosen: the middle of the cars in scenarios/vehicles."""


def of_ranking(
    ranking: LoadedRanking, execute: Executor, pace: Pace, *, only: Collection[str] = ()
) -> Forecast:
    """Return the cost of a ranking; where A is not measured yet, the amplitudes are those of `ASSUMED`.

    Raises:
        YawbenchError: a run cannot start.
    """
    forecast = Forecast(ranking.spec.title)
    angles = _angles(forecast, ranking, execute, pace)
    dwell = dwell_experiment(ranking, angles, execute)
    planned = execute.planned(dwell, keep=False)
    chosen = [case.number for case in planned.experiment.cases if not only or case.point[0].value in only]
    jobs = OnDemand(chosen, planned.jobs.__getitem__)
    add_jobs(forecast, jobs, execute, pace, journaled=True)
    return forecast


def _angles(
    forecast: Forecast,
    ranking: LoadedRanking,
    execute: Executor,
    pace: Pace,
    cars: Sequence[str] | None = None,
) -> dict[str, float]:
    """Add the runs that determine A, and return car -> A [rad], as measured or assumed."""
    planned = execute.planned(angle_experiment(ranking, execute, cars), keep=False)
    add_jobs(forecast, planned.jobs, execute, pace, journaled=True)
    records = {} if execute.fresh else records_in(execute.folder)
    if all(key in records for key in planned.keys):
        return angles_of(ranking, judge_records(planned, records), cars)
    forecast.notes.append(f"A is assumed as {shown(ASSUMED, 'rad')}, which decides the number of amplitudes")
    return dict.fromkeys(ranking.cars if cars is None else cars, ASSUMED)


def of_threats(
    threats: LoadedThreats,
    execute: Executor,
    pace: Pace,
    *,
    only: Collection[str] = (),
    chosen: Collection[str] = (),
) -> Forecast:
    """Return the cost of a ranking by threats as bounds, since each search ends where the car is lost.

    Raises:
        YawbenchError: a run cannot start.
    """
    forecast = Forecast(threats.spec.title)
    _angles(forecast, threats.ranking, execute, pace, threats.spec.cars)
    runs = Span()
    for place in threats.searches(only, chosen):
        spec = threats.spec.threats[place.threat]
        halvings = math.ceil(math.log2(STEP * abs(math.log(spec.hard / spec.easy)) / RESOLUTION))
        levels = Span(1 + 0.0, 1 + round(1 / STEP) + max(0, halvings))
        runs = runs.plus(levels.least, levels.most * len(threats.variants(spec)))
    made = 0 if execute.fresh else len(records_in(execute.folder))
    forecast.finished += made
    plan = execute.planned(angle_experiment(threats.ranking, execute, threats.spec.cars)).jobs[0].plan
    assert plan is not None
    left = Span(max(0.0, runs.least - made), max(0.0, runs.most - made))
    forecast.add(left, pace.of_plan(plan), LINE)
    forecast.notes.append("a search ends where the car is lost; disciplines are not counted")
    return forecast

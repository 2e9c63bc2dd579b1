"""The series of runs that standard tests consist of: variations of one base job.

Results stay on disk, so an interrupted series resumes: runs of the same scenario, FMUs and program are not
executed again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from ..errors import ScenarioError
from ..evaluation.judgement import Evaluation, TestSeries
from ..evaluation.lane_change import evaluate_lane_change, highest_clean, is_clean, judge_entry_speeds
from ..evaluation.sine_with_dwell import amplitudes
from ..evaluation.trace import Trace, trace_of
from ..names import Target
from ..plan import Override, Plan
from ..results.read import load_results
from ..scenario.quantities import convert
from .jobs import Job, PlanningCache, keyed, planned, ready

AMPLITUDE = "driver.amplitude"
"""Target that sine with dwell varies: amplitude of the hand-wheel angle [rad], positive to the left."""
SIDES = (("left", 1.0), ("right", -1.0))
SPEED = "speed"
"""Target that lane changes vary: speed of the scenario [m/s]."""
KMH = 1.0 / 3.6
STEP, RESOLUTION = 10.0 * KMH, 0.5 * KMH
"""Step of the coarse search for the entry speed, and its final resolution [m/s]."""
LEAST, MOST = 10.0 * KMH, 250.0 * KMH
"""Bounds of the search for the entry speed [m/s]."""


def slow_steer_jobs(base: Job, once: PlanningCache) -> list[Job]:
    """Return jobs of slowly increasing steer to both sides, with the scenario's amplitude.

    Raises:
        ScenarioError: they cannot start, or the driver has no amplitude.
    """
    given = slow_steer_amplitude(planned(base, once)[1], base.scenario)
    sides = [_varied(base, name, steered(side * given, "slowly increasing steer")) for name, side in SIDES]
    return list(map(keyed, ready(sides, once=once)))


def dwell_jobs(base: Job, angle: float, once: PlanningCache) -> list[Job]:
    """Return jobs of sine with dwell for the angle A [rad], left first and right first.

    Raises:
        ScenarioError: they cannot start.
    """
    jobs = [
        _varied(
            base, f"{name}_first/{math.degrees(amplitude):.2f}", steered(side * amplitude, "sine with dwell")
        )
        for name, side in SIDES
        for amplitude in amplitudes(angle)
    ]
    return list(map(keyed, ready(jobs, once=once)))


def steered(amplitude: float, origin: str) -> Override:
    """Return the override that sets the driver's amplitude [rad]."""
    return Override.of(AMPLITUDE, amplitude, origin)


def entry_speeds(
    base: Job, once: PlanningCache, make: Callable[[Job], bool]
) -> tuple[list[Trace], TestSeries]:
    """Search for the highest clean entry speed; return the runs made and the series' verdict.

    Args:
        base: the job at the scenario's own speed, where the search starts.
        once: cache of files and FMUs.
        make: executes a run unless its results exist; returns whether there are results.

    Raises:
        ScenarioError: a run cannot start, or the scenario has no speed.
        ResultsError: a run did not record a signal that the test needs.
    """
    scenario, plan = planned(base, once)
    first = 0.0 if scenario.speed is None else float(convert(str(scenario.speed), "m/s"))
    if first <= 0.0:
        raise ScenarioError(
            f"{base.scenario}: tells no speed above 0, from which the series could begin",
            code="fmu-wrong-kind",
        )
    duration = float(plan.step * plan.n_steps)
    driven: list[Trace] = []
    judged: list[Evaluation] = []

    def clean(speed: float) -> bool:
        seconds = math.ceil(10.0 * duration * first / speed) / 10.0  # long enough for the same distance
        changes = Override.of(SPEED, speed, "entry speed"), Override.of("stop_time", seconds, "entry speed")
        (job,) = map(keyed, ready([_varied(base, f"{speed / KMH:.2f}", *changes)], once=once))
        if not make(job):
            return False
        driven.extend(traces([job]))
        driven[-1] = replace(driven[-1], label=f"{job.label} km/h")
        judged.append(evaluate_lane_change(driven[-1]))
        return is_clean(judged[-1])

    highest_clean(clean, first=first, step=STEP, resolution=RESOLUTION, least=LEAST, most=MOST)
    return driven, judge_entry_speeds(judged)


def traces(jobs: Sequence[Job]) -> list[Trace]:
    """Return the recorded signals of runs, labelled by their jobs.

    Raises:
        ResultsError: a run has no results.
    """
    return [replace(trace_of(load_results(job.out)), label=job.label) for job in jobs]


def _varied(base: Job, name: str, *changes: Override) -> Job:
    """Return a job of a series, with overrides and a subfolder."""
    label = f"{base.label}/{name}" if base.label else name
    return replace(base, label=label, out=base.out / name, changes=(*base.changes, *changes))


def slow_steer_amplitude(plan: Plan, scenario: Path) -> float:
    """Return the absolute amplitude of the driver in a plan of slowly increasing steer [rad].

    Raises:
        ScenarioError: the driver has none; names the scenario.
    """
    target = Target.parse(AMPLITUDE)
    for one in plan.instances:
        value = one.parameter(target.variable) if one.name == target.instance else None
        if isinstance(value, (int, float)) and value != 0:
            return abs(float(value))
    raise ScenarioError(
        f"{scenario}: {AMPLITUDE} is no amplitude of a hand wheel other than 0", code="fmu-wrong-kind"
    )

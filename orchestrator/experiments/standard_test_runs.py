"""The series of runs that standard tests consist of, as named runs of experiments."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from ..errors import ScenarioError
from ..evaluation.judgement import Evaluation, TestSeries
from ..evaluation.lane_change import evaluate_lane_change, is_clean, judge_entry_speeds
from ..evaluation.sine_with_dwell import amplitudes
from ..evaluation.trace import Trace, trace_of
from ..names import Target
from ..plan import Override, Plan
from ..results.read import load_results
from ..scenario.quantities import convert
from .execution import Executor, highest_passing, side_by_side
from .experiment import NamedRun
from .jobs import Job, planned

AMPLITUDE = "driver.amplitude"
"""Target that sine with dwell varies: amplitude of the hand-wheel angle [rad], positive to the left."""
SIDES = (("left", 1.0), ("right", -1.0))
SLOW_STEER = "slowly_increasing_steer"
"""Folder of the runs of slowly increasing steer."""
SPEED = "speed"
"""Target that lane changes vary: speed of the scenario [m/s]."""
KMH = 1.0 / 3.6
STEP, RESOLUTION = 10.0 * KMH, 0.5 * KMH
"""Step of the coarse search for the entry speed, and its final resolution [m/s]."""
LEAST, MOST = 10.0 * KMH, 250.0 * KMH
"""Bounds of the search for the entry speed [m/s]."""


def slow_steer_runs(scenario: Path, changes: Sequence[Override], execute: Executor) -> list[NamedRun]:
    """Return runs of slowly increasing steer to both sides, with the scenario's amplitude.

    Raises:
        ScenarioError: the scenario is wrong, or its driver has no amplitude.
    """
    (plan,) = execute.plans([NamedRun("", "", "", scenario, (*changes,))])
    given = slow_steer_amplitude(plan, scenario)
    return [
        _run(f"{SLOW_STEER}/{name}", scenario, changes, steered(side * given, "slowly increasing steer"))
        for name, side in SIDES
    ]


def dwell_runs(scenario: Path, changes: Sequence[Override], angle: float) -> list[NamedRun]:
    """Return runs of sine with dwell for the angle A [rad], left first and right first."""
    return [
        _run(
            f"{name}_first/{math.degrees(amplitude):.2f}", scenario, changes,
            steered(side * amplitude, "sine with dwell"),
        )
        for name, side in SIDES
        for amplitude in amplitudes(angle)
    ]  # fmt: skip


def steered(amplitude: float, origin: str) -> Override:
    """Return the override that sets the driver's amplitude [rad]."""
    return Override.of(AMPLITUDE, amplitude, origin)


def entry_speeds(
    scenario: Path, changes: Sequence[Override], execute: Executor, make: Callable[[NamedRun], Job | None]
) -> tuple[list[Trace], TestSeries]:
    """Search for the highest clean entry speed; return the runs made and the series' verdict.

    Args:
        scenario: of one run; the search starts at its own speed.
        changes: overrides of all runs.
        execute: makes plans.
        make: executes a run unless its results exist; returns its job, None if there are no results.

    Raises:
        ScenarioError: a run cannot start, or the scenario has no speed.
        ResultsError: a run did not record a signal that the test needs.
    """
    base = Job("", scenario, execute.folder, (*changes,), **execute.of_jobs)
    loaded, plan = planned(base, execute.planner)
    first = 0.0 if loaded.speed is None else float(convert(str(loaded.speed), "m/s"))
    if first <= 0.0:
        raise ScenarioError(
            f"{scenario}: tells no speed above 0, from which the series could begin",
            code="fmu-wrong-kind",
        )
    duration = float(plan.step * plan.n_steps)
    driven: list[Trace] = []
    judged: list[Evaluation] = []

    def clean(speed: float) -> bool:
        seconds = math.ceil(10.0 * duration * first / speed) / 10.0  # long enough for the same distance
        at = Override.of(SPEED, speed, "entry speed"), Override.of("stop_time", seconds, "entry speed")
        job = make(_run(f"{speed / KMH:.2f}", scenario, changes, *at))
        if job is None:
            return False
        driven.extend(traces([job]))
        driven[-1] = replace(driven[-1], label=f"{job.label} km/h")
        judged.append(evaluate_lane_change(driven[-1]))
        return is_clean(judged[-1])

    search = highest_passing(first=first, step=STEP, resolution=RESOLUTION, least=LEAST, most=MOST)
    side_by_side({"": search}, lambda speeds: {name: clean(speed) for name, speed in speeds.items()})
    return driven, judge_entry_speeds(judged)


def traces(jobs: Sequence[Job]) -> list[Trace]:
    """Return the recorded signals of runs, labelled by their jobs.

    Raises:
        ResultsError: a run has no results.
    """
    return [replace(trace_of(load_results(job.out)), label=job.label) for job in jobs]


def _run(name: str, scenario: Path, changes: Sequence[Override], *own: Override) -> NamedRun:
    """Return a named run of a series; `own`: its overrides in addition to those of all runs."""
    return NamedRun(name, name, name, scenario, (*changes, *own))


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

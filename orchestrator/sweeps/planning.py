"""All runs of a sweep planned before the first one starts, and what tells two runs apart.

A run's key is a hash of everything that its metrics follow from: the content of its FMUs, all
parameters and constants, wires, time grid, algorithm, metrics, this program's version and code. Runs of
one key are one run, whatever file, folder or axis they come from.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from ..errors import BuildError, ScenarioError, YawbenchError
from ..metrics.run_metrics import metric, results_to_be, unit_in
from ..plan import Fmu, Plan
from ..results.run_record import version_of
from ..scenario import quantities
from ..sources import OF_METRICS, sources_hash
from ..studies.jobs import Job, Once, plan_of
from ..studies.study_schema import si_number
from ..wiring.facts import FACTS
from .design import Level, Point
from .schema import AxisSpec
from .sweep_file import Sweep

MANY = 10
"""Problems shown; more are only counted."""


@dataclass(frozen=True)
class PlannedRun:
    """A run that can start."""

    number: int  # from 0, in the order of the design
    point: Point
    job: Job
    plan: Plan
    key: str


@dataclass(frozen=True)
class Planned:
    """A sweep whose runs can all start."""

    sweep: Sweep
    runs: list[PlannedRun]
    units: dict[str, str]  # axis of numbers -> measurement unit in tables, an SI unit; "" if it has none
    metric_units: dict[str, str]  # key of a metric -> its unit
    fmus: dict[str, Fmu]  # hash -> FMU, of all that any run uses

    def number(self, name: str, level: Level) -> float:
        """Return the value of an axis of numbers in the unit of `units`."""
        axis = self.sweep.spec.axes[name]
        if axis.unit is None:
            return float(level.value)
        return float(quantities.convert(f"{level.value!r} {axis.unit}", self.units[name]))


def plan_sweep(
    sweep: Sweep,
    out: Path,
    fmus: Path | None = None,
    *,
    call_limit: float | None = None,
    build: bool = False,
    progress: Callable[[int], None] = lambda done: None,
) -> Planned:
    """Plan all runs.

    Args:
        sweep: as loaded.
        out: folder of the results of runs that keep them.
        fmus: folder of FMUs given by name.
        call_limit: of a call of an FMU [s], in a process per unit; None: units share one.
        build: build first what is stale of the FMUs.
        progress: told how many runs are planned.

    Raises:
        BuildError: FMUs that are stale and cannot be built.
        ScenarioError: with everything that is wrong with any run, each problem once.
    """
    once = Once(build=build)
    metrics = [
        (key, spec.metric, list(spec.window) if spec.window else None)
        for key, spec in sweep.spec.metrics.items()
    ]
    runs: list[PlannedRun] = []
    problems: dict[str, str] = {}
    for number, point in enumerate(sweep.points):
        job = replace(sweep.job(number, out, fmus), call_limit=call_limit)
        try:
            plan = plan_of(job, once)
            key = run_key(plan, metrics)
            runs.append(PlannedRun(number, point, replace(job, out=out / key[:12]), plan, key))
        except BuildError:
            raise
        except YawbenchError as error:
            for problem in error.problems:
                problems.setdefault(*_of_axis(sweep, job, problem))
        progress(number + 1)
    if problems:
        raise ScenarioError(_first(problems.values()))
    used = {unit.fmu.sha256: unit.fmu for run in runs for unit in run.plan.units}
    return Planned(sweep, runs, _units(sweep, runs), _metric_units(sweep, runs), used)


def _of_axis(sweep: Sweep, job: Job, problem: str) -> tuple[str, str]:
    """Return a problem without the value of its axis, and the same with its place in the sweep file."""
    for name, axis in sweep.spec.axes.items():
        for change in job.changes:
            if change.place in axis.places and problem.startswith(f"{change}: "):
                sentence = problem.removeprefix(f"{change}: ").replace(str(change.value), "")
                return f"{name}{sentence}", f"{sweep.path}: axes.{name}: {problem}"
    return problem, problem


def _first(problems: Iterable[str]) -> list[str]:
    listed = list(problems)
    more = [f"and {len(listed) - MANY} more problems"] if len(listed) > MANY else []
    return listed[:MANY] + more


def run_key(plan: Plan, metrics: Any) -> str:
    """Return the hash of everything that a run's metrics follow from."""
    content = {
        "yawbench": [version_of("yawbench"), sources_hash(OF_METRICS)],
        "units": [[u.name, u.fmu.sha256, u.period, u.parameters, u.constants] for u in plan.units],
        "series": [
            [u.name, name, s.sha256, s.column, s.held] for u in plan.units for name, s in u.series.items()
        ],
        "wires": [[w.source, w.output, w.target, w.input] for w in plan.wires],
        "record": plan.record,
        "step": str(plan.step),
        "n_steps": plan.n_steps,
        "algorithm": plan.algorithm,
        "metrics": metrics,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]


def _metric_units(sweep: Sweep, runs: list[PlannedRun]) -> dict[str, str]:
    """Return the unit of every metric.

    Raises:
        ScenarioError: no run records a metric's signals, or a bound is in a unit that it does not have.
    """
    made_up = {tuple(run.plan.record): results_to_be(run.plan) for run in runs}.values()
    units: dict[str, str] = {}
    problems = []
    for key, spec in sweep.spec.metrics.items():
        found = (unit_in(results, metric(spec.metric)) for results in made_up)
        unit = next((unit for unit in found if unit is not None), None)
        if unit is None:
            problems.append(f"{sweep.path}: metrics.{key}: no run records the signals of {spec.metric}")
        else:
            units[key] = unit
    for place, key, bound in _bounds(sweep):
        try:
            si_number(bound, units.get(key, "1"))
        except ValueError as error:  # noqa: PERF203 - all problems are collected
            problems += [f"{sweep.path}: {place}: {error}"] if key in units else []
    if problems:
        raise ScenarioError(problems)
    return units


def _bounds(sweep: Sweep) -> list[tuple[str, str, float | str]]:
    """Return (place, metric, bound) of all bounds in the file."""
    limits = [
        (f"limits.{name}.holds_if[{i}]", condition.metric, condition.bound)
        for name, limit in sweep.spec.limits.items()
        for i, condition in enumerate(limit.holds_if)
    ]
    figures = [
        (f"figures[{i}].{name}", figure.metric, given)
        for i, figure in enumerate(sweep.spec.figures)
        for name in ("largest", "mark")
        if figure.metric and (given := getattr(figure, name)) is not None
    ]
    return limits + figures


def _units(sweep: Sweep, runs: list[PlannedRun]) -> dict[str, str]:
    """Return the measurement unit of every axis of numbers.

    Raises:
        ScenarioError: the unit that the file names does not fit; a run would have said so before.
    """
    plans = {tuple(unit.fmu.sha256 for unit in run.plan.units): run.plan for run in runs}.values()
    return {
        name: next((unit for plan in plans if (unit := _unit(axis, plan))), "")
        for name, axis in sweep.spec.axes.items()
        if axis.numeric
    }


def _unit(axis: AxisSpec, plan: Plan) -> str | None:
    """Return the measurement unit of what an axis varies, if the plan has it."""
    holder, _, name = axis.vary[0].partition(".")
    if (name or holder) in ("stop_time", "step_size"):
        return "s"
    if holder in FACTS:
        return FACTS[holder].unit
    for unit in plan.units:
        given = unit.constants if holder == "inputs" else unit.parameters
        if holder not in ("inputs", "vehicle", unit.name):
            continue
        for variable in given:
            if fnmatchcase(variable, name) or fnmatchcase(f"{unit.name}.{variable}", name):
                return unit.fmu.variables[variable].unit
    return None

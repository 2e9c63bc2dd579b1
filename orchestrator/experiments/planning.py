"""All cases of an experiment planned before the first one starts."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from ..errors import ScenarioError
from ..metrics.run_metrics import STANDARD, metric, results_to_be, unit_in
from ..plan import Fmu, Plan
from ..results.read import Results
from ..scenario import quantities
from ..scenario.yaml_lines import dotted
from ..wiring.context import FACTS
from .axes import AxisSpec, Level
from .experiment import RUNS, Case, LoadedExperiment
from .jobs import Job, MetricRequests, PlanningCache, keyed, ready
from .judged_schema import MetricReference, MetricSpec, si_number


@dataclass(frozen=True)
class PlannedExperiment:
    """An experiment whose cases can all start."""

    experiment: LoadedExperiment
    jobs: list[Job]  # of the cases, in their order
    units: dict[str, str]  # axis of numbers -> measurement unit in tables, an SI unit; "" if it has none
    metric_units: dict[str, str]  # key of a metric -> its unit
    fmus: dict[str, Fmu]  # hash -> FMU, of all that any run uses

    def number(self, name: str, level: Level) -> float:
        """Return the value of an axis of numbers in the unit of `units`."""
        return number_of(self.experiment.spec.axes[name], level, self.units[name])

    def axis_unit(self, name: str) -> str:
        """Return the unit of an axis as the file counts it, ` [km/h]`, or nothing."""
        unit = self.experiment.spec.axes[name].unit or self.units.get(name, "")
        return f" [{unit}]" if unit not in ("", "1") else ""

    def words(self, case: Case) -> str:
        """Return what a case is called: `friction 0.3, speed 25 m/s, no control`."""
        parts = [case.run.row] if case.run.row else []
        for (name, axis), level in zip(self.experiment.spec.axes.items(), case.point, strict=True):
            unit = self.axis_unit(name).replace("[", "").replace("]", "")
            parts.append(f"{name} {level.words}{unit}" if axis.numeric else level.words)
        return ", ".join(parts)


def number_of(axis: AxisSpec, level: Level, unit: str) -> float:
    """Return a level of an axis of numbers in a unit, an SI unit."""
    if axis.unit is None:
        return float(level.value)
    return float(quantities.convert(f"{level.value!r} {axis.unit}", unit))


def metrics_of(experiment: LoadedExperiment) -> MetricRequests:
    """Return the metrics of an experiment as jobs have them."""
    return tuple((key, spec.metric, spec.window) for key, spec in experiment.spec.metrics.items())


def jobs_of(experiment: LoadedExperiment, out: Path, *, keep: bool = True, **of_jobs: Any) -> list[Job]:
    """Return a job for every case; runs along axes hand back metrics, named runs keep their results.

    Args:
        experiment: as loaded.
        out: its folder of results.
        keep: whether runs along axes keep their results, too.
        of_jobs: other fields of all jobs.
    """
    axes = bool(experiment.spec.axes)
    return [
        Job(
            case.label, case.run.scenario, out / (RUNS if axes else case.run.name), case.changes,
            keep=keep or not axes, **of_jobs,
        )
        for case in experiment.cases
    ]  # fmt: skip


def plan_experiment(
    experiment: LoadedExperiment,
    out: Path,
    *,
    once: PlanningCache | None = None,
    progress: Callable[[int], None] = lambda done: None,
    **of_jobs: Any,
) -> PlannedExperiment:
    """Plan all cases (see `ready`); without metrics the experiment gets the standard ones that runs record.

    Args:
        experiment: as loaded.
        out: its folder of results.
        once: reads files and opens FMUs.
        progress: told how many cases are planned.
        of_jobs: see `jobs_of`.

    Raises:
        BuildError: FMUs that are stale and cannot be built.
        ScenarioError: with everything that is wrong with any run, each problem once.
    """

    def place(problem: str) -> tuple[Hashable, str]:
        """Tell a problem of an axis once, not once per value of it, with its place in the file."""
        axis = experiment.axis_of(getattr(problem, "place", ""))
        return (axis, f"{experiment.path}: axes.{axis[0]}: {problem}") if axis else (problem, problem)

    jobs = ready(jobs_of(experiment, out, **of_jobs), once=once, progress=progress, place=place)
    plans = [job.plan for job in jobs if job.plan]
    made_up = [*{tuple(plan.record): results_to_be(plan) for plan in plans}.values()]
    if not experiment.spec.metrics:
        found = {
            name: MetricSpec.model_validate({"metric": name})
            for name in STANDARD
            if any(unit_in(results, metric(name)) for results in made_up)
        }
        experiment = replace(experiment, spec=experiment.spec.model_copy(update={"metrics": found}))
    units, metric_units = _units(experiment, plans), _metric_units(experiment, made_up)
    if experiment.spec.axes:
        jobs = [keyed(job, metrics_of(experiment)) for job in jobs]
        jobs = [replace(job, out=job.out / job.key[:12]) for job in jobs]
    else:
        jobs = [keyed(job) for job in jobs]
    used = {unit.fmu.sha256: unit.fmu for plan in plans for unit in plan.instances}
    return PlannedExperiment(experiment, jobs, units, metric_units, used)


def _metric_units(experiment: LoadedExperiment, made_up: list[Results]) -> dict[str, str]:
    """Return the unit of every metric; `made_up`: results without rows.

    Raises:
        ScenarioError: no run records a metric's signals, or a bound is in a unit that it does not have.
    """
    units: dict[str, str] = {}
    problems = []
    for key, spec in experiment.spec.metrics.items():
        found = (unit_in(results, metric(spec.metric)) for results in made_up)
        unit = next((unit for unit in found if unit is not None), None)
        if unit is None:
            place = f"{experiment.path}: metrics.{key}"
            problems.append(f"{place}: no run records the signals of {spec.metric}")
        else:
            units[key] = unit
    for place, unit, bound in _bounds(experiment, units):
        try:
            si_number(bound, unit)
        except ValueError as error:  # noqa: PERF203 - all problems are collected
            problems.append(f"{experiment.path}: {place}: {error}")
    if problems:
        raise ScenarioError(problems)
    return units


def _bounds(experiment: LoadedExperiment, units: dict[str, str]) -> Iterable[tuple[str, str, float | str]]:
    """Yield (place, unit, bound) of all bounds in the file whose unit is known."""
    spec = experiment.spec
    for key, condition in spec.conditions():
        derived = spec.derived.get(condition.derived)
        unit = derived.unit if derived else units.get(condition.metric)
        if unit is not None and not isinstance(condition.bound, MetricReference):
            yield dotted(key), unit, condition.bound
    for i, figure in enumerate(spec.figures):
        for name in ("largest", "mark"):
            if figure.metric in units and (given := getattr(figure, name)) is not None:
                yield f"figures[{i}].{name}", units[figure.metric], given


def _units(experiment: LoadedExperiment, every: list[Plan]) -> dict[str, str]:
    """Return the measurement unit of every axis of numbers.

    Raises:
        ScenarioError: the unit that the file names does not fit; a run would have said so before.
    """
    plans = {tuple(unit.fmu.sha256 for unit in plan.instances): plan for plan in every}.values()
    return {
        name: next((unit for plan in plans if (unit := _unit(axis, plan))), "")
        for name, axis in experiment.spec.axes.items()
        if axis.numeric
    }


def _unit(axis: AxisSpec, plan: Plan) -> str | None:
    """Return the measurement unit of what an axis varies, if the plan has it."""
    holder, _, name = axis.vary[0].partition(".")
    if (name or holder) in ("stop_time", "step_size"):
        return "s"
    if holder in FACTS:
        return FACTS[holder].instance
    for unit in plan.instances:
        given = unit.constants if holder == "inputs" else unit.parameters
        if holder not in ("inputs", "vehicle", unit.name):
            continue
        for variable in given:
            if fnmatchcase(variable, name) or fnmatchcase(f"{unit.name}.{variable}", name):
                return unit.fmu.variables[variable].unit
    return None

"""Planning of an experiment: a job with a plan for every case, before the first one starts."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import Diagnostic, Location, ScenarioError
from ..metrics.expressions import STANDARD, metric, results_to_be, unit_in
from ..plan import DEFAULT, Fmu, Instance, Plan, Variable
from ..plan import Value as Given
from ..planner import Planner
from ..results.reader import Results
from ..scenario import quantities
from ..scenario.yaml_lines import dotted
from ..signal_names import OF_RUN, SignalName, Target
from ..wiring.context import FACTS
from .claim_schema import MetricReference, MetricSpec, si_number
from .experiment import RUNS, Case, LoadedExperiment, NamedRun
from .experiment_design import AxisSpec, Level
from .jobs import Job, MetricRequests, keyed, ready


@dataclass(frozen=True)
class PlannedExperiment:
    """An experiment with a plan for every case."""

    experiment: LoadedExperiment
    jobs: list[Job]  # of the cases, in their order
    units: dict[str, str]  # numeric axis -> SI unit in tables; "" if it has none
    metric_units: dict[str, str]  # key of a metric -> its unit
    fmus: dict[str, Fmu]  # SHA-256 -> FMU, of all runs

    def number(self, name: str, level: Level) -> float:
        """Return a level of a numeric axis in the unit of `units`."""
        return number_of(self.experiment.spec.axes[name], level, self.units[name])

    def axis_unit(self, name: str) -> str:
        """Return the unit of an axis in the file as a suffix, ` [km/h]`, or ""."""
        unit = self.experiment.spec.axes[name].unit or self.units.get(name, "")
        return f" [{unit}]" if unit not in ("", "1") else ""

    def words(self, case: Case) -> str:
        """Return the label of a case: `friction 0.3, speed 25 m/s, no control`."""
        parts = [case.run.row] if case.run.row else []
        for (name, axis), level in zip(self.experiment.spec.axes.items(), case.point, strict=True):
            unit = self.axis_unit(name).replace("[", "").replace("]", "")
            parts.append(f"{name} {level.words}{unit}" if axis.numeric else level.words)
        return ", ".join(parts)


def number_of(axis: AxisSpec, level: Level, unit: str) -> float:
    """Return a level of a numeric axis in an SI unit."""
    if axis.unit is None:
        return float(level.value)
    return float(quantities.convert(f"{level.value!r} {axis.unit}", unit))


def metrics_of(experiment: LoadedExperiment, run: NamedRun | None = None) -> MetricRequests:
    """Return the metrics of an experiment as requests for jobs; those of a run have its own windows."""
    windows = run.windows if run else {}
    return tuple(
        (key, spec.metric, windows.get(key, spec.window)) for key, spec in experiment.spec.metrics.items()
    )


def jobs_of(experiment: LoadedExperiment, out: Path, *, keep: bool = True, **of_jobs: Any) -> list[Job]:
    """Return a job for every case, not planned yet.

    Args:
        experiment: as loaded.
        out: its results folder.
        keep: whether runs along axes keep their results; named runs always do.
        of_jobs: other fields of all jobs.
    """
    axes = bool(experiment.spec.axes)
    return [
        Job(
            case.label, case.run.scenario, out / (RUNS if axes else case.run.name), case.changes,
            keep=keep or not axes, test=case.run.test, **of_jobs,
        )
        for case in experiment.cases
    ]  # fmt: skip


def plan_experiment(
    experiment: LoadedExperiment,
    out: Path,
    *,
    planner: Planner | None = None,
    progress: Callable[[int], None] = lambda done: None,
    **of_jobs: Any,
) -> PlannedExperiment:
    """Plan all cases (see `ready`); one without metrics or tests gets the standard metrics it can compute.

    Args:
        experiment: as loaded.
        out: its results folder.
        planner: makes the plans.
        progress: called with the number of cases planned so far.
        of_jobs: see `jobs_of`.

    Raises:
        BuildError: stale FMUs cannot be built.
        ScenarioError: some runs cannot start; lists each error once.
    """

    def about(error: Diagnostic) -> tuple[Hashable, Diagnostic]:
        """Report an error of an axis once instead of once per value, with its key in the file."""
        axis = experiment.axis_of(error.location.target)
        if not axis:
            return error, error
        where = Location(experiment.path, target=f"axes.{axis[0]}")
        return axis, Diagnostic(error.code, str(error), location=where)

    jobs = ready(jobs_of(experiment, out, **of_jobs), planner=planner, progress=progress, group=about)
    plans = [job.plan for job in jobs if job.plan]
    made_up = list(map(results_to_be, {tuple(plan.record): plan for plan in plans}.values()))
    if not experiment.spec.metrics and not any(job.test for job in jobs):
        standard = {
            name: MetricSpec.model_validate({"metric": name})
            for name in STANDARD
            if any(unit_in(results, metric(name)) for results in made_up)
        }
        experiment = replace(experiment, spec=experiment.spec.model_copy(update={"metrics": standard}))
    units, metric_units = _units(experiment, plans), _metric_units(experiment, made_up)
    if experiment.spec.axes:
        requests = {name: metrics_of(experiment, run) for name, run in experiment.runs.items()}
        jobs = [keyed(job, requests[case.run.name]) for job, case in zip(jobs, experiment.cases, strict=True)]
        jobs = [replace(job, out=job.out / job.key[:12]) for job in jobs]
    else:
        jobs = [keyed(job) for job in jobs]
    used = {instance.fmu.sha256: instance.fmu for plan in plans for instance in plan.instances}
    return PlannedExperiment(experiment, jobs, units, metric_units, used)


def _metric_units(experiment: LoadedExperiment, made_up: list[Results]) -> dict[str, str]:
    """Return metric key -> unit; `made_up`: results without rows.

    Raises:
        ScenarioError: no run records a metric's signals, or a bound has a unit that does not fit.
    """
    units: dict[str, str] = {}
    errors = []
    for key, spec in experiment.spec.metrics.items():
        units_of_metric = (unit_in(results, metric(spec.metric)) for results in made_up)
        unit = next((unit for unit in units_of_metric if unit is not None), None)
        if unit is None:
            location = f"{experiment.path}: metrics.{key}"
            errors.append(f"{location}: no run records the signals of {spec.metric}")
        else:
            units[key] = unit
    for location, unit, bound in _bounds(experiment, units):
        try:
            si_number(bound, unit)
        except ValueError as error:  # noqa: PERF203 - all errors are collected
            errors.append(f"{experiment.path}: {location}: {error}")
    if errors:
        raise ScenarioError(errors, code="metric-unavailable")
    return units


def _bounds(experiment: LoadedExperiment, units: dict[str, str]) -> Iterable[tuple[str, str, float | str]]:
    """Yield (key in the file, unit, bound) of all bounds whose unit is known."""
    spec = experiment.spec
    for key, condition in spec.conditions():
        derived = spec.derived.get(condition.derived)
        unit = derived.unit if derived else units.get(condition.metric)
        if unit is not None and not isinstance(condition.bound, MetricReference):
            yield dotted(key), unit, condition.bound
    for i, figure in enumerate(spec.figures):
        for name in ("largest", "mark"):
            if figure.metric in units and (bound := getattr(figure, name)) is not None:
                yield f"figures[{i}].{name}", units[figure.metric], bound


def _units(experiment: LoadedExperiment, every: list[Plan]) -> dict[str, str]:
    """Return numeric axis -> unit.

    Raises:
        ScenarioError: the unit in the file does not fit.
    """
    plans = {tuple(instance.fmu.sha256 for instance in plan.instances): plan for plan in every}.values()
    return {
        name: next((unit for plan in plans if (unit := _unit(axis, plan))), "")
        for name, axis in experiment.spec.axes.items()
        if axis.numeric
    }


def _unit(axis: AxisSpec, plan: Plan) -> str | None:
    """Return the unit of an axis's target, or None if the plan does not have the target."""
    target = axis.vary[0]
    if target.is_time:
        return "s"
    if target.kind == "fact":
        return FACTS[target.variable].unit
    return next((variable.unit for _, variable in reached(plan, target)), None)


def reached(plan: Plan, target: Target) -> Iterator[tuple[Instance, Variable]]:
    """Yield the parameters, or the constant inputs, that a target sets in a plan."""
    by_name = {instance.name: instance for instance in plan.instances}
    if target.kind == "input":
        pattern = SignalName.parse_input(target.variable, by_name)
        for instance in plan.instances:
            for name, variable in instance.fmu.variables.items():
                if name in instance.constants and pattern.matches(instance.name, name):
                    yield instance, variable
    elif target.kind == "fact":
        fact = FACTS[target.variable]
        for instance in plan.instances:
            for name, variable in instance.fmu.variables.items():
                if fact.counts(instance, name) or (name in fact.inputs and name in instance.constants):
                    yield instance, variable
    elif target.kind in ("parameter", "vehicle_parameter"):
        for instance in plan.instances:
            own = instance.fmu.variables.get(target.variable)
            if target.instance in ("", instance.name) and own and own.causality == "parameter":
                yield instance, own


def found_at(plan: Plan, target: Target) -> tuple[Given, str] | None:
    """Return the value and unit that an override target has in a plan; None if it has no such target."""
    instance = next((planned for planned in plan.instances if planned.name == target.instance), None)
    if target.kind == "fmu":
        return (instance.fmu.name, "") if instance else None
    if target.kind == "vehicle_file":
        return (str(plan.scenario["vehicle"]), "") if plan.scenario.get("vehicle") else None
    if target.kind == "tyres":
        files = {axle: str(file["file"]) for axle, file in plan.scenario.get("tyre_files", {}).items()}
        return (files[target.variable or "front"], "") if files else None
    if target.kind == "run":
        times = float(plan.start), plan.time(plan.n_steps), float(plan.step)
        values: dict[str, Given] = dict(zip(OF_RUN, (*times, plan.algorithm), strict=True))
        return values[target.variable], "s"
    if target.kind == "setting" and target.is_time and instance:
        return float(instance.period * plan.step), "s"
    for instance, variable in reached(plan, target):
        value = {**instance.parameters, **instance.constants}.get(variable.name, variable.start)
        of_vehicle = instance.origins.get(variable.name, DEFAULT).kind == "vehicle"
        if value is not None and (of_vehicle or target.kind != "vehicle_parameter"):
            return value, variable.unit or ""
    return None

"""Experiments: named runs, multiplied by axes into cases, and planned before the first of them starts."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import Any

from yawbench.fmus.fmu import Fmu
from yawbench.foundation.errors import Location, ScenarioError
from yawbench.metrics.expressions import STANDARD, TimeWindow, metric, results_to_be, unit_in
from yawbench.orchestrator.plan import Override, OverrideOrigin, Plan
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.scenario import quantities
from yawbench.orchestrator.scenario.overrides import with_changes
from yawbench.orchestrator.scenario.schema_validation import made
from yawbench.orchestrator.scenario.yaml_lines import dotted
from yawbench.orchestrator.signal_names import Target
from yawbench.orchestrator.wiring.context import reached
from yawbench.planner import Planner
from yawbench.vocabulary.facts import FACTS

from .axes import (
    AxisSpec,
    DesignAxisSpec,
    DesignPoint,
    Level,
    changes_at,
    crossed,
    grid,
    levels_of,
)
from .claim_schema import MetricReference, MetricSpec, si_number
from .jobs import Job, MetricRequests, TestRequest, key_of, plans_of
from .on_demand import OnDemand
from .problems import problems_of, refuse
from .sampling import positions
from .schema import ExperimentSpec, RunSpec
from .sections import sections

FIGURES = "figures"
"""Folder of the figures, next to the folders of named runs."""
RUNS = "runs"
"""Folder of the results of runs along axes."""
FEW = 3
"""Repeats of a quick look. Chosen: fewer give no useful confidence interval."""


@dataclass(frozen=True)
class NamedRun:
    """A run of an experiment, before the axes multiply it into cases."""

    name: str  # "" if there is only one
    label: str
    row: str
    scenario: Path
    changes: tuple[Override, ...]
    test: TestRequest | None = None  # the standard test that judges it
    windows: Mapping[str, TimeWindow] = field(default_factory=dict)
    """Key of a metric -> window [s] in place of the metric's."""

    def scenario_at(self, levels: Iterable[tuple[AxisSpec, Level]], folder: Path) -> Path:
        """Return its scenario at levels of axes of a file in `folder`; variants may replace it."""
        variants = (axis.variants[str(level.value)] for axis, level in levels if axis.variants)
        names = [variant.scenario for variant in variants if variant.scenario]
        return folder / names[-1].replace("{scenario}", self.scenario.stem) if names else self.scenario


@dataclass(frozen=True)
class Case:
    """A named run at a point of the axes."""

    number: int  # from 0, in the order of the design
    run: NamedRun
    point: DesignPoint
    experiment: LoadedExperiment = field(repr=False, compare=False)

    @property
    def changes(self) -> tuple[Override, ...]:
        """The overrides of its scenario."""
        return self.experiment.changes_of(self.run, self.point)

    @property
    def scenario(self) -> Path:
        """Its scenario: that of a variant, if one replaces the run's."""
        return self.experiment.scenario_of(self.run, self.point)

    @property
    def label(self) -> str:
        """The name of the case in messages."""
        return ", ".join([*filter(None, [self.run.name]), *(level.words for level in self.point)])


@dataclass(frozen=True)
class LoadedFile:
    """A loaded file of many runs."""

    path: Path

    @property
    def identity(self) -> str:
        """Identifies the file in its results folder: name of its folder and its own."""
        return f"{self.path.absolute().parent.name}/{self.path.name}"


@dataclass(frozen=True)
class LoadedExperiment(LoadedFile):
    """A validated experiment file, expanded; its scenarios have not been read yet."""

    spec: ExperimentSpec
    runs: dict[str, NamedRun]
    for_all: tuple[Override, ...] = ()  # by the file's own `swap`, `set`, ...
    by_options: tuple[Override, ...] = ()  # of all runs, on the command line
    design: tuple[tuple[str, DesignPoint], ...] = ()
    """Run and point of every case, where not all runs have the same points; empty: all runs at all points."""
    origin: OverrideOrigin = "sweep"
    """Origin of the overrides that the axes make."""
    all_repeats: int = 0
    """Number of repeats of the file if this is a quick look at a few of them, else 0."""

    @property
    def title(self) -> str:
        """The title of the file with the overrides on the command line: numbers in it may be replaced."""
        return with_changes(self.spec.title, self.by_options)

    @property
    def changed(self) -> tuple[Override, ...]:
        """The overrides of all runs."""
        return (*self.for_all, *self.by_options)

    @cached_property
    def points(self) -> Sequence[DesignPoint]:
        """All points of the design, one without axes; in a grid the last axis varies fastest.

        In a sample, the points drawn follow each other for every combination of the listed values.
        """
        if self.design:
            return list(dict.fromkeys(point for _, point in self.design))
        axes = list(self.spec.axes.values())
        if self.spec.sampled:
            assert self.spec.points is not None and self.spec.seed is not None
            drawn = sum(axis.drawn for axis in axes)
            return crossed(axes, positions(self.spec.design, drawn, self.spec.points, self.spec.seed))
        levels = [*map(levels_of, axes)]
        return grid(levels) if self.spec.design == "grid" else list(zip(*levels, strict=True))

    @property
    def cases(self) -> Sequence[Case]:
        """All runs at all points, ordered by run, or those of `design`."""
        number = len(self.design) or len(self.runs) * len(self.points)
        return OnDemand(range(number), self._case)

    @cached_property
    def _names(self) -> list[str]:
        return [*self.runs]

    def _case(self, number: int) -> Case:
        if self.design:
            name, point = self.design[number]
        else:
            run, at = divmod(number, len(self.points))
            name, point = self._names[run], self.points[at]
        return Case(number, self.runs[name], point, self)

    def changes_of(self, run: NamedRun, point: DesignPoint) -> tuple[Override, ...]:
        """Return the overrides of a run at a point."""
        return (*self.for_all, *run.changes, *self.by_options, *self._at(point, run))

    def scenario_of(self, run: NamedRun, point: DesignPoint) -> Path:
        """Return the scenario of a run at a point."""
        return run.scenario_at(self._levels(point, run), self.path.parent)

    def setting(self, point: DesignPoint) -> DesignPoint:
        """Return a point without the axes of repeats."""
        pairs = zip(self.spec.axes.values(), point, strict=True)
        return tuple(level for axis, level in pairs if not axis.repeats)

    @cached_property
    def settings(self) -> list[DesignPoint]:
        """All distinct points without the axes of repeats."""
        return list(dict.fromkeys(map(self.setting, self.points)))

    @property
    def short(self) -> LoadedExperiment:
        """The experiment with only the first few repeats."""
        axes = {
            name: axis.model_copy(update={"values": dict(itertools.islice((axis.values or {}).items(), FEW))})
            if axis.repeats
            else axis
            for name, axis in self.spec.axes.items()
        }
        shortened = replace(self, spec=self.spec.model_copy(update={"axes": axes}))
        return replace(shortened, all_repeats=self.repeats if shortened.repeats < self.repeats else 0)

    @property
    def repeats(self) -> int:
        """The number of repeats; 1 without axes of repeats."""
        return math.prod(self.spec.axes[name].length or 1 for name in self.spec.repeats)

    @property
    def quick(self) -> str:
        """Say that this is a quick look at a few repeats; "" if it is not."""
        return f"A quick look: {self.repeats} of {self.all_repeats} repeats." if self.all_repeats else ""

    @cached_property
    def first_cases(self) -> list[Case]:
        """All runs at all settings, only the first of their repeats."""
        first: dict[tuple[str, DesignPoint], Case] = {}
        for case in self.cases:
            first.setdefault((case.run.name, self.setting(case.point)), case)
        return list(first.values())

    def matching(self, patterns: Sequence[str]) -> list[NamedRun]:
        """Return the runs whose names match any pattern, in the order of the patterns."""
        names = [name for pattern in patterns for name in self.runs if fnmatchcase(name, pattern)]
        return [self.runs[name] for name in dict.fromkeys(names)]

    def axis_of(self, place: str) -> tuple[str, Target] | None:
        """Return the axis of the file, and the target on it, that a problem names; None if it names none."""
        if self.design:
            return None
        changes = itertools.chain.from_iterable(map(self._at, self.points))
        change = next((change for change in changes if str(change) == place), None)
        axes = self.spec.axes.items()
        target = change.target if change else None
        return next(((name, target) for name, axis in axes if target in axis.targets), None)

    @cached_property
    def loaded_sections(self) -> dict[str, Any]:
        """Key of a section that a part adds -> what it has loaded for the entries of the file."""
        entries = {name: getattr(self.spec, name, None) for name in sections()}
        return {
            name: sections()[name].load(given, self.path.parent) for name, given in entries.items() if given
        }

    def _levels(self, point: DesignPoint, run: NamedRun | None) -> list[tuple[DesignAxisSpec, Level]]:
        """Return the axes with their levels at a point; with `run`, only those that apply to it."""
        return [
            (axis, level)
            for axis, level in zip(self.spec.axes.values(), point, strict=True)
            if run is None or any(fnmatchcase(run.name, pattern) for pattern in axis.runs)
        ]

    def _at(self, point: DesignPoint, run: NamedRun | None = None) -> list[Override]:
        """Return the overrides at a point; with `run`, only those of axes that apply to it."""
        return [
            change
            for axis, level in self._levels(point, run)
            for change in changes_at(axis, level, self.path.parent, self.origin)
        ]


def experiment_of(
    path: Path,
    runs: Iterable[NamedRun],
    *,
    changes: Sequence[Override] = (),
    axes: Mapping[str, DesignAxisSpec] | None = None,
    design: Sequence[tuple[str, DesignPoint]] = (),
    drawing: Mapping[str, Any] | None = None,
    origin: OverrideOrigin = "sweep",
    **keys: Any,
) -> LoadedExperiment:
    """Return an experiment that is not read from an experiment file.

    Args:
        path: the file that it is made of; its folder and name identify it.
        runs: the named runs, or one without a name.
        changes: overrides of all runs.
        axes, design, origin: see `LoadedExperiment`.
        drawing: of a sample, `design`, `points` and `seed` of the schema.
        keys: of the schema: its title, metrics, figures, ... as specifications.

    Raises:
        ScenarioError: it is invalid; lists all errors.
    """
    named = {run.name: run for run in runs}
    if [*named] == [""]:
        keys["scenario"] = named[""].scenario.name
    else:
        keys["runs"] = [made(RunSpec, name=name, scenario=run.scenario.name) for name, run in named.items()]
    spec = made(ExperimentSpec, **keys, **(drawing or {}), axes={} if design else axes or {})
    if design:  # its points are not those of all axes
        spec = spec.model_copy(update={"axes": axes or {}})
    refuse(problems_of(spec, named))
    return LoadedExperiment(path, spec, named, (), tuple(changes), tuple(design), origin)


@dataclass(frozen=True)
class PlannedExperiment:
    """An experiment with a plan for every case."""

    experiment: LoadedExperiment
    jobs: Sequence[Job]  # of the cases, in their order
    keys: Sequence[str]  # of the jobs
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


def plan_experiment(
    experiment: LoadedExperiment,
    out: Path,
    *,
    planner: Planner | None = None,
    progress: Callable[[int], None] = lambda done: None,
    keep: bool = True,
    **of_jobs: Any,
) -> PlannedExperiment:
    """Plan all cases (see `plans_of`); one without metrics or tests gets the standard metrics it can compute.

    Args:
        experiment: as loaded.
        out: its results folder.
        planner: makes the plans.
        progress: called with the number of cases planned so far.
        keep: whether runs along axes keep their results; named runs always do.
        of_jobs: other fields of all jobs.

    Raises:
        BuildError: stale FMUs cannot be built.
        ScenarioError: some runs cannot start; lists each error once.
    """

    def cause(place: str) -> tuple[Hashable, Location] | None:
        """Have an error of an axis reported once instead of once per value, at its key in the file."""
        axis = experiment.axis_of(place)
        return axis and (axis, Location(experiment.path, target=f"axes.{axis[0]}"))

    axes, cases, runs = bool(experiment.spec.axes), experiment.cases, out / RUNS

    def job(case: Case, out: Path, **of_plan: Any) -> Job:
        return Job(
            case.label, case.scenario, out, case.changes, keep=keep or not axes, test=case.run.test,
            **of_plan, **of_jobs,
        )  # fmt: skip

    jobs = (job(case, out) for case in cases)
    plans = plans_of(jobs, planner=planner, progress=progress, cause=cause)
    made_up = [*map(results_to_be, plans.kinds)]
    if not experiment.spec.metrics and not any(case.run.test for case in cases):
        standard = {
            name: MetricSpec.model_validate({"metric": name})
            for name in STANDARD
            if any(unit_in(results, metric(name)) for results in made_up)
        }
        experiment = replace(experiment, spec=experiment.spec.model_copy(update={"metrics": standard}))
    units, metric_units = _units(experiment, plans.kinds), _metric_units(experiment, made_up)
    requests = {name: metrics_of(experiment, run) if axes else () for name, run in experiment.runs.items()}
    timed = of_jobs.get("timed", "")
    keys = [key_of(plans[case.number], requests[case.run.name], case.run.test, timed) for case in cases]

    def planned(number: int) -> Job:
        case, key = cases[number], keys[number]
        folder = runs / key[:12] if axes else out / case.run.name
        return job(case, folder, plan=plans[number], metrics=requests[case.run.name], key=key)

    used = {instance.fmu.sha256: instance.fmu for plan in plans.kinds for instance in plan.instances}
    every = OnDemand(range(len(cases)), planned)
    return PlannedExperiment(experiment, every, keys, units, metric_units, used)


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

"""Regions: claims judged again over the values that a paper leaves open, and the runs this needs.

The runs keep no results. At the chosen point the named runs themselves are used.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from ..errors import Diagnostic, Location, ScenarioError
from ..messages import hint, listed
from ..metrics.run_metrics import MetricValue
from ..metrics.verdict import Verdict
from ..names import OF_RUN, Target
from ..plan import DEFAULT, Override, Plan
from ..plan import Value as Given
from ..planner import Planner
from .axes import Level, OpenValueSpec, OpenVariantSpec, changes_at, latin_hypercube, levels_of
from .claims import TIMES, ClaimResult, LevelVerdict, OpenValueScan, Region, judge
from .experiment import RUNS, LoadedExperiment, NamedRun
from .grids import ranked
from .jobs import Job, MeasuredRun, keyed, ready
from .judged_schema import Claim, MetricReference
from .outcome import ExperimentResult, derive
from .planning import PlannedExperiment, metrics_of, number_of, reached

ORIGIN = "region"
"""Origin of overrides that open values make."""

RegionPoint = tuple[tuple[str, Level], ...]
"""Pairs of open value and level; the open values not listed are as chosen."""
RegionCell = tuple[str, RegionPoint]
"""A named run, and the open values that change it."""
RegionKey = tuple[str, int]
"""(`claims` or `checks`, index) of what is judged."""


def found_at(plan: Plan, target: Target) -> tuple[Given, str] | None:
    """Return the value and unit that an override target has in a plan; None if it has no such target."""
    instance = next((one for one in plan.instances if one.name == target.instance), None)
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
        given = {**instance.parameters, **instance.constants}.get(variable.name, variable.start)
        of_vehicle = instance.origins.get(variable.name, DEFAULT).kind == "vehicle"
        if given is not None and (of_vehicle or target.kind != "vehicle_parameter"):
            return given, variable.unit or ""
    return None


class RegionRuns:
    """The runs of an experiment at the points of its region.

    Args:
        planned: an experiment without axes, with a plan for every run.
    """

    def __init__(self, planned: PlannedExperiment) -> None:
        assert planned.experiment.spec.region is not None
        self.planned = planned
        self.experiment: LoadedExperiment = planned.experiment
        self.open_values = planned.experiment.spec.region.open_values
        self.plans = {job.label: job.plan for job in planned.jobs if job.plan is not None}
        self.jobs = {job.label: job for job in planned.jobs}
        self._cells: dict[RegionCell, RegionCell] = {}

    @cached_property
    def touched(self) -> dict[str, list[str]]:
        """Open value -> the runs it applies to.

        Raises:
            ScenarioError: it applies to none.
        """
        found = {
            name: [run for run in self.experiment.runs if self._touches(one, run)]
            for name, one in self.open_values.items()
        }
        problems = [self._touches_none(name) for name, runs in found.items() if not runs]
        if problems:
            raise ScenarioError(problems, code="override-without-effect")
        return found

    def own_value(self, run: str, target: Target) -> Given | None:
        """Return the value that a target has in a run; None if the run has no such target."""
        found = found_at(self.plans[run], target)
        return None if found is None else found[0]

    def _touches_none(self, name: str) -> str:
        targets = self.open_values[name].targets
        instances = dict.fromkeys(one.name for plan in self.plans.values() for one in plan.instances)
        missing = next((one.instance for one in targets if one.instance not in (*instances, "")), "")
        guess = hint(missing, instances, lead="units") if missing else ""
        return (
            f"{self.experiment.path}: region.open_values.{name}: touches no run: none has "
            f"{listed(targets, last='and')} without setting it itself{guess}"
        )

    def _touches(self, one: OpenValueSpec, name: str) -> bool:
        run = self.experiment.runs[name]
        if run not in self.experiment.matching(one.runs):
            return False
        if one.kind == "variant":
            scenarios = [self._scenario(variant, run) for variant in one.variants.values()]
            own = [variant for variant in one.variants.values() if not variant.scenario]
            targets = [target for variant in own for target in variant.targets]
            return all(path.is_file() for path in scenarios) and self._has(run, targets, one.times)
        return self._has(run, one.vary, one.times)

    def _has(self, run: NamedRun, targets: Iterable[Target], times: bool) -> bool:
        """Return whether a run has all targets without overriding them itself."""
        own = {change.target for change in (*run.changes, *self.experiment.by_options)}
        return all(
            self.own_value(run.name, target) is not None and (times or target not in own)
            for target in targets
        )

    def _scenario(self, variant: OpenVariantSpec, run: NamedRun) -> Path:
        """Return the scenario of a run at a variant."""
        named = variant.scenario.replace("{scenario}", run.scenario.stem)
        return self.experiment.path.parent / named if named else run.scenario

    def changes(self, name: str, place: RegionPoint) -> tuple[Path, list[Override]]:
        """Return the scenario of a run at a point, and the further overrides there."""
        run, changes = self.experiment.runs[name], []
        scenario = run.scenario
        for key, level in place:
            one = self.open_values[key]
            if one.times:
                for where in one.vary:
                    own = self.own_value(run.name, where)
                    changes.append(Override(where, float(own or 0.0) * float(level.value), ORIGIN))
                continue
            if one.kind == "variant" and one.variants[str(level.value)].scenario:
                scenario = self._scenario(one.variants[str(level.value)], run)
            changes += changes_at(one, level, self.experiment.path.parent, ORIGIN)
        return scenario, changes

    def cell(self, name: str, place: RegionPoint) -> RegionCell:
        """Return a run at a point, with only those open values that change it there."""
        if (name, place) not in self._cells:
            other = (one for one in place if name in self.touched[one[0]] and self._is_other(name, one))
            self._cells[name, place] = (name, tuple(other))
        return self._cells[name, place]

    def _is_other(self, name: str, at: tuple[str, Level]) -> bool:
        """Return whether a level differs from the one chosen in a run."""
        key, level = at
        one = self.open_values[key]
        scenario, changes = self.changes(name, (at,))
        if scenario != self.experiment.runs[name].scenario:
            return True
        if not one.numeric:
            return any(self.own_value(name, change.target) != change.value for change in changes)
        return not math.isclose(self.number(key, level), self.chosen_number(key, [name]), rel_tol=1e-9)

    def number(self, key: str, level: Level) -> float:
        """Return a level of a numeric open value: in SI units, or as a factor."""
        one = self.open_values[key]
        return float(level.value) if one.times else number_of(one, level, self.unit(key))

    def unit(self, key: str) -> str:
        """Return the unit of an open value in the runs that it applies to."""
        target = self.open_values[key].vary[0]
        found = (found_at(self.plans[name], target) for name in self.touched[key])
        return next((one[1] for one in found if one and one[1]), "")

    def own(self, key: str, names: Iterable[str]) -> set[float]:
        """Return the distinct numbers chosen in runs for a numeric open value."""
        target = self.open_values[key].vary[0]
        found = [self.own_value(name, target) for name in names if name in self.touched[key]]
        return {float(value) for value in found if value is not None}

    def chosen_number(self, key: str, names: Iterable[str]) -> float:
        """Return the number chosen in runs, in SI units; 1 for a factor.

        Raises:
            ScenarioError: the runs differ in it.
        """
        if self.open_values[key].times:
            return 1.0
        own = self.own(key, names)
        if len(own) > 1:
            raise ScenarioError(
                f"{self.experiment.path}: region.open_values.{key}: the runs of one claim have "
                f"{listed(f'{one:g}' for one in sorted(own))} there; give factors, with `times: true`, or "
                "name the `runs` it touches",
                code="region-invalid",
            )
        return own.pop()


@dataclass(frozen=True)
class RegionQuestion:
    """A claim or check, its runs, and the points at which to judge it."""

    claim: Claim
    runs: tuple[str, ...]
    points: list[RegionPoint]  # of the Latin hypercube
    lines: dict[str, list[Level]]  # open value it depends on -> levels


@dataclass(frozen=True)
class RegionPlan:
    """All planned runs of a region."""

    runs: RegionRuns
    asked: dict[RegionKey, RegionQuestion]
    jobs: dict[RegionCell, Job]

    def cells(self, asked: RegionQuestion) -> Iterator[RegionCell]:
        """Yield every run of a claim at every point it is judged at."""
        along = (((key, level),) for key, levels in asked.lines.items() for level in levels)
        for place in itertools.chain(asked.points, along):
            yield from (self.runs.cell(run, place) for run in asked.runs)


def plan_region(
    planned: PlannedExperiment,
    folder: Path,
    *,
    planner: Planner,
    progress: Callable[[int], None] = lambda done: None,
) -> RegionPlan:
    """Plan the runs for judging all claims over the region; checks only reuse these runs.

    Args:
        planned: the experiment, whose file has a region.
        folder: results folder of the experiment.
        planner: makes the plans.
        progress: called with the number of runs planned so far.

    Raises:
        ScenarioError: an open value applies to no run, or a run cannot take one of its levels.
    """
    runs = RegionRuns(planned)
    spec = runs.experiment.spec
    assert spec.region is not None
    continuous = [one.continuous for one in runs.open_values.values()]
    hypercube = latin_hypercube(continuous, spec.region.points, spec.region.seed)
    asked: dict[RegionKey, RegionQuestion] = {}
    for group, claims in (("claims", spec.claims), ("checks", spec.checks)):
        for number, claim in enumerate(claims):
            asked[group, number] = _asked(runs, claim, hypercube)
    plan = RegionPlan(runs, asked, {})
    wanted = dict.fromkeys(
        cell for (group, _), one in asked.items() if group == "claims" for cell in plan.cells(one) if cell[1]
    )
    jobs, open_value_of = [], dict[str, str]()  # override in words -> open value that makes it
    for name, place in wanted:
        scenario, own = runs.changes(name, place)
        for key, level in place:
            open_value_of |= {str(one): key for one in runs.changes(name, ((key, level),))[1]}
        label = ", ".join([name, *(f"{key} {level.words}" for key, level in place)])
        changes = (*runs.jobs[name].changes, *own)
        job = replace(runs.jobs[name], label=label, scenario=scenario, changes=changes, plan=None)
        jobs.append(replace(job, out=folder / RUNS, keep=False))

    def about(error: Diagnostic) -> tuple[Hashable, Diagnostic]:
        """Report an error of an open value once, with its key in the file."""
        key = open_value_of.get(error.location.target)
        if key is None:
            return error, error
        where = Location(runs.experiment.path, target=f"region.open_values.{key}")
        return key, Diagnostic(error.code, str(error), location=where)

    metrics = metrics_of(runs.experiment)
    made = [keyed(job, metrics) for job in ready(jobs, planner=planner, progress=progress, group=about)]
    known = {
        key: one
        for key, one in asked.items()
        if one.lines and all(cell in wanted for cell in plan.cells(one) if cell[1])
    }
    return RegionPlan(runs, known, dict(zip(wanted, made, strict=True)))


def _asked(runs: RegionRuns, claim: Claim, hypercube: list[tuple[Level, ...]]) -> RegionQuestion:
    names = runs_of(runs.experiment, claim)
    lines = {
        key: levels_of(one.stepped)
        for key, one in runs.open_values.items()
        if (claim.open_values is None or key in claim.open_values)
        and any(name in runs.touched[key] for name in names)
    }
    points = (zip(runs.open_values, point, strict=True) for point in hypercube)
    return RegionQuestion(
        claim, names, [tuple(one for one in point if one[0] in lines) for point in points], lines
    )


def runs_of(experiment: LoadedExperiment, claim: Claim) -> tuple[str, ...]:
    """Return the names of all runs that a claim depends on."""
    spec, found = experiment.spec, dict[str, None]()
    for condition in claim.holds_if:
        if condition.derived:
            one = spec.derived[condition.derived]
            found |= dict.fromkeys(source.run for source in one.of.values())
            if one.rank_correlation is not None:
                among = ranked(spec.grids[one.rank_correlation], one.only)
                found |= dict.fromkeys(cell.run for cell in among)
        else:
            found |= dict.fromkeys(run.name for run in experiment.matching([condition.run]))
        if isinstance(condition.bound, MetricReference):
            found[condition.bound.run] = None
    return tuple(found)


def judge_region(
    plan: RegionPlan, findings: ExperimentResult, records: Mapping[str, MeasuredRun]
) -> dict[RegionKey, Region]:
    """Judge all claims and checks over the region.

    Args:
        plan: of the region.
        findings: the result at the chosen point.
        records: job key -> record of the run.
    """
    chosen = {"claims": findings.claims, "checks": findings.checks}
    return {
        (group, number): _judged(plan, one, chosen[group][number], findings, records)
        for (group, number), one in plan.asked.items()
    }


def _judged(
    plan: RegionPlan,
    asked: RegionQuestion,
    chosen: ClaimResult,
    findings: ExperimentResult,
    records: Mapping[str, MeasuredRun],
) -> Region:
    runs = plan.runs
    words = {run.name: run.row for run in findings.experiment.runs.values()}

    def verdict_at(place: RegionPoint) -> Verdict:
        values = {}
        for name in asked.runs:
            cell = runs.cell(name, place)
            record = records[plan.jobs[cell].key] if cell[1] else None
            for key in findings.spec.metrics:
                measured = record and record.values.get(key)
                value = (
                    MetricValue(*measured)
                    if measured
                    else None
                    if record
                    else findings.values.get((name, key))
                )
                if value is not None:
                    values[name, key] = value
        return judge(asked.claim, values, words, derive(findings.spec, values)).scaled(chosen)

    lines = []
    for key, levels in asked.lines.items():
        one = runs.open_values[key]
        judged = []
        for level in levels:
            place = ((key, level),)
            if any(runs.cell(name, place)[1] for name in asked.runs):  # otherwise this is the chosen level
                number = runs.number(key, level) if one.numeric else None
                judged.append(LevelVerdict(level.words, number, verdict_at(place)))
        unit, factor = _shown(runs, key, asked.runs) if one.numeric else ("", 1.0)
        at = runs.chosen_number(key, asked.runs) if one.numeric else None
        lines.append(
            OpenValueScan(
                key,
                one.says or key,
                unit,
                factor,
                LevelVerdict("as chosen", at, chosen.verdict),
                tuple(judged),
            )
        )
    return Region(chosen.verdict, tuple(verdict_at(place) for place in asked.points), tuple(lines))


def _shown(runs: RegionRuns, key: str, names: Iterable[str]) -> tuple[str, float]:
    """Return the display unit of an open value, and the factor that converts its numbers to it.

    Factors are shown as numbers if all runs have the same chosen value, else as multiples of it.
    """
    one = runs.open_values[key]
    unit = runs.unit(key)
    if one.times:
        own = runs.own(key, names)
        return (unit, own.pop()) if len(own) == 1 else (TIMES, 1.0)
    if one.unit is None:
        return unit, 1.0
    return one.unit, 1.0 / number_of(one, Level(1.0, ""), unit)

"""Regions: claims judged again over open values, and the runs this needs (bounds of a verdict: `claims`).

The runs keep no results. At the chosen point the named runs themselves are used.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Final

from yawbench.fmus.fmu import Value as Given
from yawbench.foundation.errors import Location, ScenarioError
from yawbench.foundation.messages import hint, listed
from yawbench.metrics.expressions import MetricValue
from yawbench.metrics.verdict import Verdict
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.signal_names import Target
from yawbench.orchestrator.wiring.context import found_at
from yawbench.planner import Planner

from .axes import DesignPoint, Level, changes_at, levels_of, points_at
from .claim_schema import Claim, MetricReference
from .claims import ONE_IN, TIMES, LevelVerdict, OpenValueScan, Region, judge
from .derived import derive, ranked
from .experiment import RUNS, LoadedExperiment, NamedRun, PlannedExperiment, metrics_of, number_of
from .experiment_result import ExperimentResult
from .jobs import Job, MeasuredRun, keyed, ready
from .open_value_schema import OpenValueSpec
from .sampling import hypercube
from .sequential_test import Decision, SequentialTest

ORIGIN: Final = "region"
"""Origin of overrides that open values make."""

RegionPoint = tuple[tuple[str, Level], ...]
"""Pairs of open value and level; the open values not listed are as chosen."""
RegionCell = tuple[str, RegionPoint]
"""A named run, and the open values that change it."""
RegionKey = tuple[str, int]
"""(`claims` or `checks`, index) of a claim or check."""


class RegionRuns:
    """The runs of an experiment at the points of its region.

    Args:
        planned: an experiment without axes, with a plan for every run.
    """

    def __init__(self, planned: PlannedExperiment) -> None:
        assert planned.experiment.spec.region is not None
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
        touching = {
            name: [run for run in self.experiment.runs if self._touches(open_value, run)]
            for name, open_value in self.open_values.items()
        }
        problems = [self._touches_none(name) for name, runs in touching.items() if not runs]
        if problems:
            raise ScenarioError(problems, code="override-without-effect")
        return touching

    def own_value(self, run: str, target: Target) -> Given | None:
        """Return the value that a target has in a run; None if the run has no such target."""
        addressed = found_at(self.plans[run], target)
        return None if addressed is None else addressed[0]

    def _touches_none(self, name: str) -> str:
        targets = self.open_values[name].targets
        instances = dict.fromkeys(
            instance.name for plan in self.plans.values() for instance in plan.instances
        )
        missing = next((target.instance for target in targets if target.instance not in (*instances, "")), "")
        guess = hint(missing, instances, lead="units") if missing else ""
        return (
            f"{self.experiment.path}: region.open_values.{name}: touches no run: none has "
            f"{listed(targets, last='and')} without setting it itself{guess}"
        )

    def _touches(self, open_value: OpenValueSpec, name: str) -> bool:
        run = self.experiment.runs[name]
        if run not in self.experiment.matching(open_value.runs):
            return False
        if open_value.kind == "variant":
            folder, variants = self.experiment.path.parent, open_value.variants.values()
            scenarios = [run.scenario_at([(open_value, level)], folder) for level in levels_of(open_value)]
            targets = [target for variant in variants if not variant.scenario for target in variant.targets]
            return all(path.is_file() for path in scenarios) and self._has(run, targets, open_value.times)
        return self._has(run, open_value.vary, open_value.times)

    def _has(self, run: NamedRun, targets: Iterable[Target], times: bool) -> bool:
        """Return whether a run has all targets without overriding them itself."""
        own = {change.target for change in (*run.changes, *self.experiment.by_options)}
        return all(
            self.own_value(run.name, target) is not None and (times or target not in own)
            for target in targets
        )

    def changes(self, name: str, point: RegionPoint) -> tuple[Path, list[Override]]:
        """Return the scenario of a run at a point, and the further overrides there."""
        run, changes, folder = self.experiment.runs[name], [], self.experiment.path.parent
        levels = [(self.open_values[key], level) for key, level in point]
        for open_value, level in levels:
            if open_value.times:
                for where in open_value.vary:
                    own = self.own_value(run.name, where)
                    changes.append(Override(where, float(own or 0.0) * float(level.value), ORIGIN))
            else:
                changes += changes_at(open_value, level, folder, ORIGIN)
        return run.scenario_at(levels, folder), changes

    def cell(self, name: str, point: RegionPoint) -> RegionCell:
        """Return a run at a point, with only those open values that change it there."""
        if (name, point) not in self._cells:
            other = (part for part in point if name in self.touched[part[0]] and self._is_other(name, part))
            self._cells[name, point] = (name, tuple(other))
        return self._cells[name, point]

    def _is_other(self, name: str, at: tuple[str, Level]) -> bool:
        """Return whether a level differs from the one chosen in a run."""
        key, level = at
        open_value = self.open_values[key]
        scenario, changes = self.changes(name, (at,))
        if scenario != self.experiment.runs[name].scenario:
            return True
        if not open_value.numeric:
            return any(self.own_value(name, change.target) != change.value for change in changes)
        return not math.isclose(self.number(key, level), self.chosen_number(key, [name]), rel_tol=1e-9)

    def number(self, key: str, level: Level) -> float:
        """Return a level of a numeric open value: in SI units, or as a factor."""
        open_value = self.open_values[key]
        return float(level.value) if open_value.times else number_of(open_value, level, self.unit(key))

    def unit(self, key: str) -> str:
        """Return the unit of an open value in the runs that it applies to."""
        target = self.open_values[key].vary[0]
        addressed = (found_at(self.plans[name], target) for name in self.touched[key])
        return next((value[1] for value in addressed if value and value[1]), "")

    def own(self, key: str, names: Iterable[str]) -> set[float]:
        """Return the distinct numbers chosen in runs for a numeric open value."""
        target = self.open_values[key].vary[0]
        values = [self.own_value(name, target) for name in names if name in self.touched[key]]
        return {float(value) for value in values if value is not None}

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
                f"{listed(f'{number:g}' for number in sorted(own))} there; give factors, "
                "with `times: true`, or name the `runs` it touches",
                code="region-invalid",
            )
        return own.pop()


@dataclass(frozen=True)
class RegionQuestion:
    """A claim or check, its runs, and the points at which to judge it."""

    claim: Claim
    runs: tuple[str, ...]
    points: list[RegionPoint]  # of the Latin hypercube, as many as may be needed
    lines: dict[str, Sequence[Level]]  # open value it depends on -> levels


@dataclass
class RegionPlan:
    """The runs of a region planned so far, and the verdicts that follow from those made.

    Args:
        runs: of the region.
        folder: results folder of the experiment.
        planner: makes the plans.
        test: of the share of points that flip a verdict.
        questions: what is judged.
        jobs: runs of the region; `next_jobs` adds those of further points.
        verdicts: on each claim, point by point.
    """

    runs: RegionRuns
    folder: Path
    planner: Planner
    test: SequentialTest
    questions: dict[RegionKey, RegionQuestion]
    jobs: dict[RegionCell, Job] = field(default_factory=dict)
    verdicts: dict[RegionKey, list[Verdict]] = field(default_factory=dict)

    def cells(self, question: RegionQuestion, points: Iterable[RegionPoint]) -> list[RegionCell]:
        """Return the runs of a claim at points, without those that no open value changes there."""
        every = (self.runs.cell(run, point) for point in points for run in question.runs)
        return [cell for cell in every if cell[1]]

    def along(self, question: RegionQuestion) -> list[RegionCell]:
        """Return the runs of a claim along each open value."""
        points = [((key, level),) for key, levels in question.lines.items() for level in levels]
        return self.cells(question, points)


def plan_region(planned: PlannedExperiment, folder: Path, *, planner: Planner) -> RegionPlan:
    """Return the plan for judging all claims over the region, without runs yet; checks only reuse the runs.

    Args:
        planned: the experiment, whose file has a region.
        folder: results folder of the experiment.
        planner: makes the plans.

    Raises:
        ScenarioError: an open value applies to no run.
    """
    runs = RegionRuns(planned)
    spec = runs.experiment.spec
    region = spec.region
    assert region is not None
    continuous = [open_value.continuous for open_value in runs.open_values.values()]
    drawn = hypercube(len(continuous), region.points, max(region.points, region.most), region.seed)
    points = points_at(continuous, drawn)
    questions = {
        (group, number): _asked(runs, claim, points)
        for group, claims in (("claims", spec.claims), ("checks", spec.checks))
        for number, claim in enumerate(claims)
    }
    test = SequentialTest(region.looks, 1 / ONE_IN)
    return RegionPlan(
        runs, folder, planner, test, {key: question for key, question in questions.items() if question.lines}
    )


def next_jobs(
    plan: RegionPlan,
    findings: ExperimentResult,
    records: Mapping[str, MeasuredRun],
    *,
    progress: Callable[[int], None] = lambda done: None,
) -> list[Job]:
    """Plan the runs of the next points, for claims that are not decided yet; none if all are.

    Args:
        plan: of the region; the runs are added to it.
        findings: the result at the chosen point.
        records: job key -> record of the run, of all runs planned before.
        progress: called with the number of runs planned so far.

    Raises:
        ScenarioError: a run cannot take a level of an open value.
    """
    runs, wanted = plan.runs, dict[RegionCell, None]()
    for key, question in plan.questions.items():
        if key[0] == "claims":
            wanted |= dict.fromkeys(plan.along(question))
            wanted |= dict.fromkeys(plan.cells(question, _further_points(plan, key, findings, records)))
    jobs, causes = dict[RegionCell, Job](), dict[str, tuple[str, Location]]()
    for name, point in wanted:
        if (name, point) in plan.jobs:
            continue
        scenario, own = runs.changes(name, point)
        for key_, level in point:
            where = Location(runs.experiment.path, target=f"region.open_values.{key_}")
            causes |= {str(change): (key_, where) for change in runs.changes(name, ((key_, level),))[1]}
        label = ", ".join([name, *(f"{key_} {level.words}" for key_, level in point)])
        changes = (*runs.jobs[name].changes, *own)
        job = replace(runs.jobs[name], label=label, scenario=scenario, changes=changes, plan=None)
        jobs[name, point] = replace(job, out=plan.folder / RUNS, keep=False)

    metrics = metrics_of(runs.experiment)
    planned = ready([*jobs.values()], planner=plan.planner, progress=progress, cause=causes.get)
    made = [keyed(job, metrics) for job in planned]
    plan.jobs |= zip(jobs, made, strict=True)
    return made


def _at_chosen(findings: ExperimentResult, key: RegionKey) -> Verdict:
    """Return the verdict on a claim or check at the chosen point."""
    return (findings.claims if key[0] == "claims" else findings.checks)[key[1]].verdict


def _further_points(
    plan: RegionPlan, key: RegionKey, findings: ExperimentResult, records: Mapping[str, MeasuredRun]
) -> list[RegionPoint]:
    """Judge a claim at the points made, look by look; return those up to the next look, if there is one."""
    question, chosen = plan.questions[key], _at_chosen(findings, key)
    verdicts = plan.verdicts.setdefault(key, [])
    for look in plan.test.looks:
        flips = sum(verdict.holds != chosen.holds for verdict in verdicts)
        if plan.test.decision(flips, len(verdicts)) is not Decision.OPEN or chosen.holds is None:
            break
        points = question.points[len(verdicts) : look]
        if any(
            cell not in plan.jobs or plan.jobs[cell].key not in records
            for cell in plan.cells(question, points)
        ):
            return points
        verdicts += [_verdict_at(plan, question, chosen, findings, records, point) for point in points]
    return []


def _asked(runs: RegionRuns, claim: Claim, hypercube: Sequence[DesignPoint]) -> RegionQuestion:
    names = runs_of(runs.experiment, claim)
    lines = {
        key: levels_of(open_value.stepped)
        for key, open_value in runs.open_values.items()
        if (claim.open_values is None or key in claim.open_values)
        and any(name in runs.touched[key] for name in names)
    }
    points = (zip(runs.open_values, point, strict=True) for point in hypercube)
    return RegionQuestion(
        claim, names, [tuple(part for part in point if part[0] in lines) for point in points], lines
    )


def runs_of(experiment: LoadedExperiment, claim: Claim) -> tuple[str, ...]:
    """Return the names of all runs that a claim depends on."""
    spec, names = experiment.spec, dict[str, None]()
    for condition in claim.holds_if:
        if condition.derived:
            derived = spec.derived[condition.derived]
            names |= dict.fromkeys(source.run for source in derived.of.values())
            if derived.rank_correlation is not None:
                among = ranked(spec.grids[derived.rank_correlation], derived.only)
                names |= dict.fromkeys(cell.run for cell in among)
        else:
            names |= dict.fromkeys(run.name for run in experiment.matching([condition.run]))
        if isinstance(condition.bound, MetricReference):
            names[condition.bound.run] = None
    return tuple(names)


def judge_region(
    plan: RegionPlan, findings: ExperimentResult, records: Mapping[str, MeasuredRun]
) -> dict[RegionKey, Region]:
    """Judge all claims over the region, and the checks for which their runs suffice.

    Args:
        plan: of the region.
        findings: the result at the chosen point.
        records: job key -> record of the run.
    """
    judged = {}
    for key, question in plan.questions.items():
        if all(cell in plan.jobs for cell in plan.along(question)):
            _further_points(plan, key, findings, records)
            if plan.verdicts[key]:
                judged[key] = _judged(plan, key, findings, records)
    return judged


def _verdict_at(
    plan: RegionPlan,
    question: RegionQuestion,
    chosen: Verdict,
    findings: ExperimentResult,
    records: Mapping[str, MeasuredRun],
    point: RegionPoint,
) -> Verdict:
    """Return the verdict on a claim at a point."""
    values = {}
    for name in question.runs:
        cell = plan.runs.cell(name, point)
        record = records[plan.jobs[cell].key] if cell[1] else None
        for key in findings.spec.metrics:
            measured = record and record.values.get(key)
            value = (
                MetricValue(*measured) if measured else None if record else findings.values.get((name, key))
            )
            if value is not None:
                values[name, key] = value
    words = {run.name: run.row for run in findings.experiment.runs.values()}
    return judge(question.claim, values, words, derive(findings.spec, values)).scaled(chosen)


def _judged(
    plan: RegionPlan, key: RegionKey, findings: ExperimentResult, records: Mapping[str, MeasuredRun]
) -> Region:
    runs, question = plan.runs, plan.questions[key]
    chosen = _at_chosen(findings, key)
    lines = []
    for name, levels in question.lines.items():
        open_value = runs.open_values[name]
        judged = []
        for level in levels:
            point = ((name, level),)
            if plan.cells(question, [point]):  # otherwise this is the chosen level
                number = runs.number(name, level) if open_value.numeric else None
                verdict = _verdict_at(plan, question, chosen, findings, records, point)
                judged.append(LevelVerdict(level.words, number, verdict))
        unit, factor = _shown(runs, name, question.runs) if open_value.numeric else ("", 1.0)
        at = runs.chosen_number(name, question.runs) if open_value.numeric else None
        as_chosen = LevelVerdict("as chosen", at, chosen)
        lines.append(OpenValueScan(name, open_value.says or name, unit, factor, as_chosen, tuple(judged)))
    return Region(chosen, tuple(plan.verdicts[key]), tuple(lines), plan.test)


def _shown(runs: RegionRuns, key: str, names: Iterable[str]) -> tuple[str, float]:
    """Return the display unit of an open value, and the factor that converts its numbers to it.

    Factors are shown as numbers if all runs have the same chosen value, else as multiples of it.
    """
    open_value = runs.open_values[key]
    unit = runs.unit(key)
    if open_value.times:
        own = runs.own(key, names)
        return (unit, own.pop()) if len(own) == 1 else (TIMES, 1.0)
    if open_value.unit is None:
        return unit, 1.0
    return open_value.unit, 1.0 / number_of(open_value, Level(1.0, ""), unit)

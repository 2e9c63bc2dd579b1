"""What an experiment comes to: metrics of every case, numbers derived from several, claims and checks.

How far an axis may go until a condition fails: the largest value up to which all runs meet it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from ..figures.style import digits_of
from ..messages import counted
from ..metrics.run_metrics import MetricValue
from ..results.folder import RUN_FILE
from ..results.read import Results
from .axes import RUN, DesignPoint, Level
from .experiment import Case, LoadedExperiment, NamedRun
from .grids import correlation
from .jobs import NOT_MADE, MeasuredRun, Outcome, measured, read_back
from .judged_schema import Claim, LimitSpec, calculate
from .judging import ClaimResult, MetricTable, interval, judge
from .margins import Region
from .planning import PlannedExperiment, metrics_of
from .schema import ExperimentSpec
from .tables import Cell, Table

K = TypeVar("K")
Each = Callable[..., Iterable[Any]]
"""`map`, or the `map` of an executor."""


@dataclass(frozen=True)
class ExperimentResult:
    """What an experiment comes to."""

    experiment: LoadedExperiment
    records: list[MeasuredRun]  # of all cases, in their order
    results: dict[str, Results]  # of named runs that reached their end
    planned: PlannedExperiment | None = None  # None: judged by what stands on disk alone
    regions: Mapping[tuple[str, int], Region] = field(default_factory=dict)
    """`claims` or `checks`, and a number -> what becomes of that verdict over the region."""

    @property
    def spec(self) -> ExperimentSpec:
        """The file of the experiment."""
        return self.experiment.spec

    @property
    def failed(self) -> dict[str, str]:
        """Words for each case that failed -> why."""
        return {
            self.words(case): "; ".join(record.problems)
            for case, record in zip(self.experiment.cases, self.records, strict=True)
            if record.failed
        }

    @property
    def not_made(self) -> int:
        """How many cases have not been run."""
        return sum(not record.made for record in self.records)

    @property
    def fmus(self) -> list[tuple[str, str]]:
        """Name and SHA-256 of the FMUs that the runs are made of, as planned, else as recorded; sorted."""
        if self.planned:
            return sorted((fmu.name, digest) for digest, fmu in self.planned.fmus.items())
        recorded = (fmu for one in self.results.values() for fmu in one.run.get("fmus", {}).values())
        return sorted(
            {(str(fmu["name"]), str(fmu["sha256"])) for fmu in recorded if {"name", "sha256"} <= set(fmu)}
        )

    def words(self, case: Case) -> str:
        """Return what a case is called in messages."""
        return self.planned.words(case) if self.planned and case.point else case.label

    def record(self, case: Case) -> MeasuredRun:
        """Return what became of a case."""
        return self.records[case.number]

    def value(self, case: Case, key: str) -> MetricValue | None:
        """Return a metric of a case, None if it failed or gives none."""
        found = self.record(case).values.get(key)
        return None if found is None else MetricValue(*found)

    def unit(self, key: str) -> str:
        """Return the unit of a metric."""
        if self.planned:
            return self.planned.metric_units[key]
        found = (self.value(case, key) for case in self.experiment.cases)
        return next((value.unit for value in found if value), "1")

    @cached_property
    def at(self) -> dict[DesignPoint, dict[tuple[str, str], MetricValue]]:
        """Setting -> (run, metric) -> value, of those that exist; over repeats the mean."""
        return self._means(self._at_points)

    @cached_property
    def _at_points(self) -> dict[DesignPoint, dict[tuple[str, str], MetricValue]]:
        found: dict[DesignPoint, dict[tuple[str, str], MetricValue]] = {}
        for case in self.experiment.cases:
            here = found.setdefault(case.point, {})
            for key in self.spec.metrics:
                if (value := self.value(case, key)) is not None:
                    here[case.run.name, key] = value
        return found

    @property
    def values(self) -> MetricTable:
        """(run, metric) -> value, at the first setting of the axes, which is all there is without axes."""
        return next(iter(self.at.values()))

    @cached_property
    def derived_at(self) -> dict[DesignPoint, dict[str, MetricValue]]:
        """Setting -> numbers derived from several runs, those that exist; over repeats the mean."""
        return self._means({point: derive(self.spec, values) for point, values in self._at_points.items()})

    def mean(self, case: Case, key: str) -> MetricValue | None:
        """Return a metric of a case, over repeats of it the mean; None if one failed or gives none."""
        return self.at[self.experiment.setting(case.point)].get((case.run.name, key))

    def _means(
        self, found: Mapping[DesignPoint, Mapping[K, MetricValue]]
    ) -> dict[DesignPoint, dict[K, MetricValue]]:
        """Return setting -> what -> its mean over repeats, of what all of them have."""
        repeats: dict[DesignPoint, list[Mapping[K, MetricValue]]] = {}
        for point, values in found.items():
            repeats.setdefault(self.experiment.setting(point), []).append(values)
        means: dict[DesignPoint, dict[K, MetricValue]] = {}
        for setting, several in repeats.items():
            here = means[setting] = {}
            for key in several[0]:
                every = [values[key] for values in several if key in values]
                over = interval([value.number for value in every]) if len(every) == len(several) else None
                if over is not None:
                    here[key] = MetricValue(over.mean, every[0].unit, over.half)
        return means

    def cases_of(self, run: NamedRun, setting: DesignPoint) -> list[Case]:
        """Return a run at a setting: one case, or its repeats."""
        return self._cases[run.name, setting]

    @cached_property
    def _cases(self) -> dict[tuple[str, DesignPoint], list[Case]]:
        found: dict[tuple[str, DesignPoint], list[Case]] = {}
        for case in self.experiment.cases:
            found.setdefault((case.run.name, self.experiment.setting(case.point)), []).append(case)
        return found

    def failure(self, run: NamedRun, setting: DesignPoint) -> str:
        """Return why a run at a setting failed, or the first of its repeats that did; "" for none."""
        records = (self.record(case) for case in self.cases_of(run, setting))
        return next(("; ".join(record.problems) for record in records if record.failed), "")

    def made(self, run: NamedRun, setting: DesignPoint) -> bool:
        """Return whether a run at a setting has been made, with all its repeats."""
        return all(self.record(case).made for case in self.cases_of(run, setting))

    @property
    def derived(self) -> dict[str, MetricValue]:
        """Numbers derived from several runs, as `values`."""
        return next(iter(self.derived_at.values()))

    @property
    def values_of_grids(self) -> MetricTable:
        """What cells of grids may show: metrics of runs, and derived numbers as those of a run ""."""
        return {**self.values, **{("", key): value for key, value in self.derived.items()}}

    @cached_property
    def claims(self) -> list[ClaimResult]:
        """What the paper says, judged."""
        return self._all_judged("claims", self.spec.claims)

    @cached_property
    def checks(self) -> list[ClaimResult]:
        """What this project asks, judged."""
        return self._all_judged("checks", self.spec.checks)

    @property
    def judgements(self) -> list[ClaimResult]:
        """Claims and checks."""
        return [*self.claims, *self.checks]

    def _all_judged(self, group: str, said: Sequence[Claim]) -> list[ClaimResult]:
        return [
            replace(self.judged(one), region=self.regions.get((group, i)), group=group)
            for i, one in enumerate(said)
        ]

    def judged(self, claim: Claim) -> ClaimResult:
        """Return whether a claim holds; along axes, whether it does at every setting of them."""
        words = {run.name: run.row for run in self.experiment.runs.values()}
        every = [judge(claim, values, words, self.derived_at[at]) for at, values in self.at.items()]
        if len(every) == 1:
            return every[0]
        verdicts = [one.holds for one in every]
        holds = False if False in verdicts else None if None in verdicts else True
        text = f"holds at {verdicts.count(True)} of {counted(len(every), 'point')}"
        return ClaimResult(claim, holds, (text,))

    def light(self) -> ExperimentResult:
        """Return what figures over axes need, to be handed to other processes."""
        planned = self.planned and replace(self.planned, jobs=[], fmus={
            digest: replace(fmu, variables={}) for digest, fmu in self.planned.fmus.items()
        })  # fmt: skip
        recorded = {} if planned else {k: replace(one, columns={}) for k, one in self.results.items()}
        return ExperimentResult(self.experiment, self.records, recorded, planned)

    def remarkable(self) -> str:
        """Return in how many runs something was remarkable, `spin in 3 of 20 runs`; "" for none."""
        kinds = Counter(kind for record in self.records for kind in record.findings)
        total = counted(len(self.records) - self.not_made, "run")
        return ", ".join(f"{kind} in {count} of {total}" for kind, count in kinds.items())


def judge_records(planned: PlannedExperiment, records: Mapping[str, MeasuredRun]) -> ExperimentResult:
    """Return what an experiment along axes comes to; `records`: key -> what became of a run."""
    found = [records.get(job.key, NOT_MADE) for job in planned.jobs]
    return ExperimentResult(planned.experiment, found, {}, planned)


def judge_results(
    experiment: LoadedExperiment,
    out: Path,
    outcomes: Iterable[Outcome] = (),
    *,
    planned: PlannedExperiment | None = None,
    each: Each = map,
) -> ExperimentResult:
    """Read the results of all named runs below `out` and judge the experiment by them.

    Args:
        experiment: without axes.
        out: its folder of results.
        outcomes: of the runs that have just been made; they know best why one has no results.
        planned: the experiment with its plans, where they can be made.
        each: how to read the results of all runs.

    Raises:
        ScenarioError: a claim's bound is in a unit that its metric does not have.
    """
    made = {outcome.job.label: outcome for outcome in outcomes}
    results: dict[str, Results] = {}
    records: list[MeasuredRun] = []
    ids = [made[name].value.id if name in made and made[name].ok else None for name in experiment.runs]
    recorded = each(read_back, [out / name for name in experiment.runs], ids)
    for name, read in zip(experiment.runs, recorded, strict=True):
        found = (made[name].reason if name in made else "") or read
        if isinstance(found, str):
            begun = name in made or any((out / name).glob(f"{RUN_FILE}*"))  # a died run leaves a part of it
            records.append(MeasuredRun({}, (found,)) if begun else NOT_MADE)
        else:
            results[name] = found
            records.append(measured(found, metrics_of(experiment)))
    return ExperimentResult(experiment, records, results, planned)


def derive(spec: ExperimentSpec, values: MetricTable) -> dict[str, MetricValue]:
    """Return the numbers derived from several runs, without those that lack one."""
    found: dict[str, MetricValue] = {}
    for key, one in spec.derived.items():
        number = None
        if one.rank_correlation is not None:
            number = correlation(spec.grids[one.rank_correlation], values, one.only)
        elif one.expression is not None:
            known = {word: values.get((source.run, source.metric)) for word, source in one.of.items()}
            numbers = {word: value.number for word, value in known.items() if value is not None}
            number = calculate(one.expression, numbers) if len(numbers) == len(known) else None
        if number is not None:
            found[key] = MetricValue(number, one.unit)
    return found


@dataclass(frozen=True)
class Limit:
    """Where an axis ends for one run and setting of the other axes, in the numbers of the file."""

    others: dict[str, Level]  # axis -> its level; "run" -> the run, if runs have names
    largest: float | None  # that holds with all below it; None: not even the smallest
    beyond: float | None  # the next value, which does not hold; None: all hold
    lacks: str = ""  # why the run beyond gives no metric: "failed", "not made"


def limits_of(findings: ExperimentResult, spec: LimitSpec) -> list[Limit]:
    """Return the limit for every run and setting of the other axes, in the order of the design."""
    experiment = findings.experiment
    names = [name for name, axis in findings.spec.axes.items() if not axis.repeats]
    at = names.index(spec.of)
    lines: dict[tuple[str, tuple[Level, ...]], list[Case]] = {}
    for case in experiment.first_cases:
        setting = experiment.setting(case.point)
        lines.setdefault((case.run.name, setting[:at] + setting[at + 1 :]), []).append(case)
    found = []
    for (name, setting), cases in lines.items():
        others = {RUN: Level(name, cases[0].run.label)} if name else {}
        others |= zip((one for one in names if one != spec.of), setting, strict=True)
        found.append(_limit(findings, spec, others, cases, at))
    return found


def _limit(
    findings: ExperimentResult, spec: LimitSpec, others: dict[str, Level], cases: list[Case], at: int
) -> Limit:
    run, largest = cases[0].run, None
    settings = {findings.experiment.setting(case.point) for case in cases}
    for setting in sorted(settings, key=lambda setting: float(setting[at].value)):
        here = float(setting[at].value)
        if not judge(spec, findings.at[setting], {run.name: run.row}).holds:
            cases_here = (findings.record(case) for case in findings.cases_of(run, setting))
            lacks = next((record.status for record in cases_here if not record.ok), "")
            return Limit(others, largest, here, lacks)
        largest = here
    return Limit(others, largest, None)


def limit_table(findings: ExperimentResult, name: str) -> Table:
    """Return a limit for all settings of the other axes, one row each."""
    planned, spec = findings.planned, findings.spec.limits[name]
    assert planned is not None
    found = limits_of(findings, spec)
    others = [one if one == RUN else f"{one}{planned.axis_unit(one)}" for one in found[0].others]
    table = Table(f"{spec.says}{planned.axis_unit(spec.of)}", [*others, "up to", "not any more at"])
    for limit in found:
        words: list[Cell] = [level.words for level in limit.others.values()]
        up_to = "-" if limit.largest is None else digits_of(limit.largest)
        beyond = "-" if limit.beyond is None else digits_of(limit.beyond)
        lacks = {"": "", "failed": " (the run failed)"}.get(limit.lacks, f" ({limit.lacks})")
        table.rows.append([*words, up_to, f"{beyond}{lacks}"])
    table.numbers = {len(others), len(others) + 1}
    return table

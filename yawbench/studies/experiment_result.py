"""Result of an experiment: metrics of all cases, derived numbers, judged claims and checks."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from yawbench.foundation.errors import Diagnostic, ResultsError
from yawbench.foundation.messages import counted
from yawbench.metrics.expressions import MetricValue, metric
from yawbench.metrics.verdict import PERCENT, Judged
from yawbench.orchestrator.plan import Plan
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import RUN_FILE

from .axes import DesignPoint
from .claim_schema import Claim
from .claims import ClaimResult, Region, comparisons
from .confidence import interval, share_bounds
from .derived import MetricTable, derive
from .experiment import Case, LoadedExperiment, NamedRun, PlannedExperiment, metrics_of
from .jobs import NOT_MADE, MeasuredRun, Outcome, measured, read_back
from .schema import ExperimentSpec
from .sections import sections

Each = Callable[..., Iterable[Any]]
"""`map`, or a parallel equivalent such as `Pool.map`."""


def within(number: float, unit: str, low: float, high: float) -> MetricValue:
    """Return a number between two others: the bounds of its interval, or the ends of its range."""
    return MetricValue(number, unit, max(high - number, number - low), (low, high))


def _median(values: Sequence[MetricValue]) -> MetricValue:
    """Return the median of repeats with their range."""
    numbers = [value.number for value in values]
    median, low, high = statistics.median(numbers), min(numbers), max(numbers)
    unit = values[0].shown_in
    return within(median, unit, low, high) if low < high else MetricValue(median, unit)


def _share(values: Sequence[MetricValue]) -> MetricValue:
    """Return the share of repeats whose value is not 0, with the interval of Clopper and Pearson."""
    count, number = sum(value.number != 0.0 for value in values), len(values)
    return within(count / number, PERCENT, *share_bounds(count, number))


def _over_repeats(values: Sequence[MetricValue], number: int, kind: str = "mean") -> MetricValue | None:
    """Return the mean of repeats, or their share or median; None unless all have a value, of a median some.

    Args:
        values: of the repeats that have one.
        number: of all repeats.
        kind: statistic, as in a metric's `over_repeats`.
    """
    if number > 1 and kind == "median" and values:
        return _median(values)
    if len(values) < number:
        return None
    if number > 1 and kind == "share":
        return _share(values)
    over, whether = interval([value.number for value in values]), number == 1 and values[0].whether
    return over and MetricValue(over.mean, values[0].shown_in, over.half, whether=whether)


@dataclass(frozen=True)
class ExperimentResult:
    """Result of an experiment."""

    experiment: LoadedExperiment
    records: list[MeasuredRun]  # of all cases, in their order
    results: dict[str, Results]  # of completed named runs
    planned: PlannedExperiment | None = None  # None: judged by the results on disk alone
    regions: Mapping[tuple[str, int], Region] = field(default_factory=dict)
    """(`claims` or `checks`, index) -> verdicts on it over the region."""

    @property
    def spec(self) -> ExperimentSpec:
        """Content of the experiment file."""
        return self.experiment.spec

    @property
    def failed(self) -> dict[str, str]:
        """Label of each failed case -> reason."""
        return {
            self.words(case): record.reason or ""
            for case, record in zip(self.experiment.cases, self.records, strict=True)
            if record.failed
        }

    def of_models(self) -> ExperimentResult:
        """Return this result, if its failures are those of models.

        Raises:
            ResultsError: runs failed for a reason of the machine, from which nothing may be concluded.
        """
        lost = [number for number, record in enumerate(self.records) if record.of_machine]
        if lost:
            case = self.words(self.experiment.cases[lost[0]])
            raise ResultsError(
                f"{case}: {self.records[lost[0]].reason}; {counted(len(lost), 'run')} failed for a reason of "
                "this computer, not of the model: start it again to make them again",
                code="runs-missing",
            )
        return self

    @property
    def not_made(self) -> int:
        """The number of cases that have not been executed."""
        return sum(not record.made for record in self.records)

    @property
    def fmus(self) -> list[tuple[str, str]]:
        """Name and SHA-256 of the FMUs of all runs, from the plans or else from the run records; sorted."""
        if self.planned:
            return sorted((fmu.name, digest) for digest, fmu in self.planned.fmus.items())
        recorded = (fmu for results in self.results.values() for fmu in results.record.fmus.values())
        return sorted({(fmu.name, fmu.sha256) for fmu in recorded if fmu.name and fmu.sha256})

    @property
    def kinds_made(self) -> list[tuple[Plan, int]]:
        """Plans of executed cases, one for all with the same FMUs and time grid, each with their number."""
        kinds: dict[Hashable, Plan] = {}
        numbers: Counter[Hashable] = Counter()
        for job, record in zip(self.planned.jobs if self.planned else (), self.records, strict=True):
            if job.plan is not None and record.made:
                grid = job.plan.algorithm, job.plan.step, job.plan.start, job.plan.n_steps
                kind = (*((unit.name, unit.fmu.sha256) for unit in job.plan.instances), *grid)
                kinds.setdefault(kind, job.plan)
                numbers[kind] += 1
        return [(plan, numbers[kind]) for kind, plan in kinds.items()]

    def words(self, case: Case) -> str:
        """Return the name of a case in messages."""
        return self.planned.words(case) if self.planned and case.point else case.label

    def record(self, case: Case) -> MeasuredRun:
        """Return the record of a case."""
        return self.records[case.number]

    def value(self, case: Case, key: str) -> MetricValue | None:
        """Return a metric of a case; None if the case failed or yields none."""
        numbers = self.record(case).values.get(key)
        return None if numbers is None else MetricValue(*numbers, whether=key in self.whether)

    @cached_property
    def whether(self) -> frozenset[str]:
        """Keys of the metrics that are 0 or 1 in each run."""
        metrics = self.spec.metrics.items()
        return frozenset(key for key, spec in metrics if metric(spec.metric).measure.whether)

    def unit(self, key: str) -> str:
        """Return the unit of a metric."""
        if self.planned:
            return self.planned.metric_units[key]
        values = (self.value(case, key) for case in self.experiment.cases)
        return next((value.shown_in for value in values if value), "1")

    @cached_property
    def at(self) -> dict[DesignPoint, dict[tuple[str, str], MetricValue]]:
        """Setting -> (run, metric) -> value, where there is one; over repeats the mean, median or share."""
        at: dict[DesignPoint, dict[tuple[str, str], MetricValue]] = {}
        for (run, setting), cases in self._cases.items():
            here = at.setdefault(setting, {})
            for key, spec in self.spec.metrics.items():
                every = [value for case in cases if (value := self.value(case, key)) is not None]
                kind = spec.over_repeats if self.spec.repeats else "mean"
                if (value := _over_repeats(every, len(cases), kind)) is not None:
                    here[run, key] = value
        return at

    @property
    def values(self) -> MetricTable:
        """(run, metric) -> value, at the first setting of the axes: the only one without axes."""
        return next(iter(self.at.values()))

    @cached_property
    def derived_at(self) -> dict[DesignPoint, dict[str, MetricValue]]:
        """Setting -> key -> derived number, where there is one; over repeats the mean."""
        at_points: dict[DesignPoint, dict[tuple[str, str], MetricValue]] = {}
        for case in self.experiment.cases:
            here = at_points.setdefault(case.point, {})
            for key in self.spec.metrics:
                if (value := self.value(case, key)) is not None:
                    here[case.run.name, key] = value
        repeats: dict[DesignPoint, list[dict[str, MetricValue]]] = {}
        for point, values in at_points.items():
            repeats.setdefault(self.experiment.setting(point), []).append(derive(self.spec, values))
        means = {}
        for setting, several in repeats.items():
            every = {
                key: [numbers[key] for numbers in several if key in numbers] for key in self.spec.derived
            }
            over = {key: _over_repeats(numbers, len(several)) for key, numbers in every.items()}
            means[setting] = {key: mean for key, mean in over.items() if mean is not None}
        return means

    def mean(self, case: Case, key: str) -> MetricValue | None:
        """Return a metric of a case, averaged over its repeats; None if one of them failed or yields none."""
        return self.at[self.experiment.setting(case.point)].get((case.run.name, key))

    def cases_of(self, run: NamedRun, setting: DesignPoint) -> list[Case]:
        """Return the cases of a run at a setting: a single one, or its repeats."""
        return self._cases[run.name, setting]

    @cached_property
    def _cases(self) -> dict[tuple[str, DesignPoint], list[Case]]:
        cases: dict[tuple[str, DesignPoint], list[Case]] = {}
        for case in self.experiment.cases:
            cases.setdefault((case.run.name, self.experiment.setting(case.point)), []).append(case)
        return cases

    def failure(self, run: NamedRun, setting: DesignPoint) -> str:
        """Return why a run, or the first failed repeat of it, failed at a setting; "" if none did."""
        records = (self.record(case) for case in self.cases_of(run, setting))
        return next((record.reason or "" for record in records if record.failed), "")

    def made(self, run: NamedRun, setting: DesignPoint) -> bool:
        """Return whether a run at a setting has been executed, with all its repeats."""
        return all(self.record(case).made for case in self.cases_of(run, setting))

    @property
    def derived(self) -> dict[str, MetricValue]:
        """Key -> derived number, at the first setting of the axes."""
        return next(iter(self.derived_at.values()))

    @property
    def values_of_grids(self) -> MetricTable:
        """Values for the cells of grids: metrics of runs, and derived numbers under the run ""."""
        return {**self.values, **{("", key): value for key, value in self.derived.items()}}

    @cached_property
    def claims(self) -> list[ClaimResult]:
        """The judged claims of the paper."""
        return self._judged("claims", self.spec.claims)

    @cached_property
    def checks(self) -> list[ClaimResult]:
        """Our own checks, judged."""
        return self._judged("checks", self.spec.checks)

    @cached_property
    def sections(self) -> dict[str, list[Any]]:
        """Key of a section that a part adds -> its findings on the runs that have results."""
        loaded = self.experiment.loaded_sections
        return {
            name: section.compare(self.results, loaded[name]) if name in loaded else []
            for name, section in sections().items()
        }

    @property
    def judgements(self) -> list[ClaimResult]:
        """Claims and checks."""
        return [*self.claims, *self.checks]

    def _judged(self, group: Judged, claims: Sequence[Claim]) -> list[ClaimResult]:
        """Judge claims; with axes they must hold at every setting."""
        labels = {run.name: run.row for run in self.experiment.runs.values()}
        settings = [(values, labels, self.derived_at[at]) for at, values in self.at.items()]
        return [
            ClaimResult.of(
                claim, group, [comparisons(claim, *at) for at in settings], self.regions.get((group, i))
            )
            for i, claim in enumerate(claims)
        ]

    def light(self) -> ExperimentResult:
        """Return a reduced copy with what figures over axes need, cheap to send to other processes."""
        planned = self.planned and replace(self.planned, jobs=[], fmus={
            digest: replace(fmu, variables={}) for digest, fmu in self.planned.fmus.items()
        })  # fmt: skip
        recorded = {} if planned else {k: replace(results, columns={}) for k, results in self.results.items()}
        return ExperimentResult(self.experiment, self.records, recorded, planned)

    def remarkable(self) -> str:
        """Summarise the warnings of all runs, `car-spins in 3 of 20 runs`; "" if there are none."""
        codes = Counter(code for record in self.records for code in record.warning_codes)
        total = counted(len(self.records) - self.not_made, "run")
        return ", ".join(f"{code} in {count} of {total}" for code, count in codes.items())


def judge_records(planned: PlannedExperiment, records: Mapping[str, MeasuredRun]) -> ExperimentResult:
    """Return the result of an experiment with axes; `records`: job key -> record of the run."""
    recorded = [records.get(key, NOT_MADE) for key in planned.keys]
    return ExperimentResult(planned.experiment, recorded, {}, planned)


def judge_results(
    experiment: LoadedExperiment,
    out: Path,
    outcomes: Iterable[Outcome] = (),
    *,
    planned: PlannedExperiment | None = None,
    each: Each = map,
) -> ExperimentResult:
    """Judge an experiment by the results of its named runs below `out`.

    Args:
        experiment: without axes.
        out: its results folder.
        outcomes: of the runs just executed; they know best why a run has no results.
        planned: the experiment with its plans, if they are available.
        each: `map`, or a parallel equivalent, to read results with.

    Raises:
        ScenarioError: a bound has a unit that does not fit its metric.
    """
    made = {outcome.job.label: outcome for outcome in outcomes}
    results: dict[str, Results] = {}
    records: list[MeasuredRun] = []
    ids = [made[name].value.id if name in made and made[name].ok else None for name in experiment.runs]
    recorded = each(read_back, [out / name for name in experiment.runs], ids)
    for name, read in zip(experiment.runs, recorded, strict=True):
        failed = made[name].diagnostics if name in made else ()
        if isinstance(read, str) or failed:
            begun = name in made or any((out / name).glob(f"{RUN_FILE}*"))  # partial, if a run died
            missing = (Diagnostic("run-without-results", str(read)),)
            records.append(MeasuredRun({}, failed or missing) if begun else NOT_MADE)
        else:
            results[name] = read
            records.append(measured(read, metrics_of(experiment)))
    return ExperimentResult(experiment, records, results, planned)

"""Result of an experiment: metrics of all cases, derived numbers, judged claims and checks, limits."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from yawbench.figures.style import digits_of
from yawbench.foundation.errors import Diagnostic, ResultsError
from yawbench.foundation.messages import counted
from yawbench.metrics.expressions import MetricValue
from yawbench.metrics.verdict import PERCENT, Status, Verdict, not_judged, worst
from yawbench.orchestrator.plan import Plan
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import RUN_FILE

from .axes import RUN, DesignPoint, Level
from .claim_schema import Claim, LimitSpec, calculate
from .claims import ClaimResult, Judgement, MetricTable, Region, correlation, judge
from .confidence import interval, share_bounds
from .experiment import Case, LoadedExperiment, NamedRun, PlannedExperiment, metrics_of, validating
from .jobs import NOT_MADE, MeasuredRun, Outcome, measured, read_back
from .schema import ExperimentSpec
from .tables import Cell, Table

K = TypeVar("K")
Each = Callable[..., Iterable[Any]]
"""`map`, or a parallel equivalent such as `Pool.map`."""


def _median(values: Sequence[MetricValue]) -> MetricValue:
    """Return the median of repeats with their range."""
    numbers = [value.number for value in values]
    median, low, high = statistics.median(numbers), min(numbers), max(numbers)
    between = (low, high) if low < high else None
    return MetricValue(median, values[0].shown_in, max(high - median, median - low), between)


def _share(values: Sequence[MetricValue]) -> MetricValue:
    """Return the share of repeats whose value is not 0, with the interval of Clopper and Pearson."""
    count, number = sum(value.number != 0.0 for value in values), len(values)
    share, bounds = count / number, share_bounds(count, number)
    return MetricValue(
        share, PERCENT, max(bounds.high - share, share - bounds.low), (bounds.low, bounds.high)
    )


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
    over = interval([value.number for value in values])
    return over and MetricValue(over.mean, values[0].shown_in, over.half)


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
        return None if numbers is None else MetricValue(*numbers)

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
        at_points: dict[DesignPoint, dict[DesignPoint, dict[tuple[str, str], MetricValue]]] = {}
        for case in self.experiment.cases:
            here = at_points.setdefault(self.experiment.setting(case.point), {}).setdefault(case.point, {})
            for key in self.spec.metrics:
                if (value := self.value(case, key)) is not None:
                    here[case.run.name, key] = value
        means = {}
        for setting, values_at in at_points.items():
            several = [derive(self.spec, values) for values in values_at.values()]
            every = {
                key: [numbers[key] for numbers in several if key in numbers] for key in self.spec.derived
            }
            over = {key: _over_repeats(values, len(several)) for key, values in every.items()}
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
    def validations(self) -> list[Any]:
        """The comparisons with measured cars, of the runs that have results."""
        recordings = self.experiment.recordings
        return validating().compare(self.results, recordings) if recordings else []

    @property
    def judgements(self) -> list[ClaimResult]:
        """Claims and checks."""
        return [*self.claims, *self.checks]

    def _judged(self, group: str, claims: Sequence[Claim]) -> list[ClaimResult]:
        return [
            ClaimResult(
                **vars(self.judge(claim)), claim=claim, region=self.regions.get((group, i)), group=group
            )
            for i, claim in enumerate(claims)
        ]

    def judge(self, claim: Claim) -> Judgement:
        """Judge a claim; with axes it must hold at every setting."""
        words = {run.name: run.row for run in self.experiment.runs.values()}
        every = [judge(claim, values, words, self.derived_at[at]) for at, values in self.at.items()]
        if len(every) == 1:
            return every[0]
        verdicts = [judgement.verdict for judgement in every]
        holding = sum(verdict.holds is True for verdict in verdicts)
        verdict = worst(verdicts) or Verdict(Status.PASSED)
        text = f"holds at {holding} of {counted(len(every), 'point')}"
        return Judgement(replace(verdict, margin=None), measured=(text,))

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


def derive(spec: ExperimentSpec, values: MetricTable) -> dict[str, MetricValue]:
    """Compute the derived numbers, without those whose runs are missing."""
    derived: dict[str, MetricValue] = {}
    for key, entry in spec.derived.items():
        number = None
        if entry.rank_correlation is not None:
            number = correlation(spec.grids[entry.rank_correlation], values, entry.only)
        elif entry.expression is not None:
            known = {word: values.get((source.run, source.metric)) for word, source in entry.of.items()}
            numbers = {word: value.number for word, value in known.items() if value is not None}
            number = calculate(entry.expression, numbers) if len(numbers) == len(known) else None
        if number is not None:
            derived[key] = MetricValue(number, entry.unit)
    return derived


@dataclass(frozen=True)
class Limit:
    """Limit of an axis for a run and a setting of the other axes, in the unit of the file."""

    others: dict[str, Level]  # axis -> level; "run" -> the run, if named
    largest: float | None  # up to which all values hold; None: not even the first
    beyond: float | None  # the next value, which fails; None: all hold
    verdict: Verdict  # at that value, else at the largest; not judged: why the run has no metric
    cases: tuple[Case, ...] = ()  # the last that holds and the first that fails; of repeats the first

    @property
    def missing(self) -> bool:
        """Whether the run at the next value has not been made."""
        return self.verdict.why == NOT_MADE.reason


def limits_of(findings: ExperimentResult, spec: LimitSpec) -> list[Limit]:
    """Return the limit for every run and setting of the other axes, in the order of the design."""
    experiment = findings.experiment
    names = [name for name, axis in findings.spec.axes.items() if not axis.repeats]
    at = names.index(spec.of)
    lines: dict[tuple[str, tuple[Level, ...]], list[Case]] = {}
    for case in experiment.first_cases:
        setting = experiment.setting(case.point)
        lines.setdefault((case.run.name, setting[:at] + setting[at + 1 :]), []).append(case)
    limits = []
    for (name, setting), cases in lines.items():
        others = {RUN: Level(name, cases[0].run.label)} if name else {}
        others |= zip((axis for axis in names if axis != spec.of), setting, strict=True)
        limits.append(_limit(findings, spec, others, cases, at))
    return limits


def _limit(
    findings: ExperimentResult, spec: LimitSpec, others: dict[str, Level], cases: list[Case], at: int
) -> Limit:
    run, largest, last, verdict = cases[0].run, None, None, Verdict(Status.PASSED)
    by_setting = {findings.experiment.setting(case.point): case for case in reversed(cases)}
    for setting in sorted(by_setting, key=lambda setting: float(setting[at].value)):
        here, case = float(setting[at].value), by_setting[setting]
        verdict = judge(spec, findings.at[setting], {run.name: run.row}).verdict
        if not verdict.holds:
            records = (findings.record(case) for case in findings.cases_of(run, setting))
            if lost := next((record for record in records if not record.ok), None):
                verdict = not_judged("the run failed" if lost.made else lost.status)
            return Limit(others, largest, here, verdict, (last, case) if last else (case,))
        largest, last = here, case
    return Limit(others, largest, None, verdict, (last,) if last else ())


LOST = ("run-process-died", "internal-error")
"""Codes of failures that leave no results."""


def kept_cases(findings: ExperimentResult) -> frozenset[int]:
    """Return the numbers of the cases along axes whose results are to be kept; see `keep` in the schema."""
    spec, cases = findings.spec, findings.experiment.cases
    if spec.keep == "none" or not spec.axes:
        return frozenset()
    if spec.keep == "all":
        return frozenset(case.number for case in cases)
    limits = [limit for limit_spec in spec.limits.values() for limit in limits_of(findings, limit_spec)]
    beside = {case.number for limit in limits for case in limit.cases if findings.record(case).made}
    failed = {
        case.number
        for case in cases
        if (record := findings.record(case)).failed
        and not {diagnostic.code for diagnostic in record.diagnostics} & {*LOST}
    }
    return frozenset(beside | failed)


def limit_table(findings: ExperimentResult, name: str) -> Table:
    """Return the table of a limit, one row per run and setting of the other axes."""
    planned, spec = findings.planned, findings.spec.limits[name]
    assert planned is not None
    limits = limits_of(findings, spec)
    others = [axis if axis == RUN else f"{axis}{planned.axis_unit(axis)}" for axis in limits[0].others]
    title, headings = f"{spec.says}{planned.axis_unit(spec.of)}", [*others, "up to", "no longer at"]
    table = Table(title, headings, numbers={len(others), len(others) + 1})
    for limit in limits:
        words: list[Cell] = [level.words for level in limit.others.values()]
        up_to = "-" if limit.largest is None else digits_of(limit.largest)
        beyond = "-" if limit.beyond is None else digits_of(limit.beyond)
        if limit.missing:
            beyond = f"unknown ({beyond} not made)"
        elif why := limit.verdict.why:
            beyond = f"{beyond} ({why})"
        table.rows.append([*words, up_to, beyond])
    return table

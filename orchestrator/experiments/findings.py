"""What an experiment comes to: metrics of every case, numbers derived from several, claims and checks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from ..metrics.run_metrics import Value
from ..results.folder import RUN_FILE
from ..results.read import Results
from ..wording import counted
from .confidence import interval
from .derived import calculate
from .design import Point
from .expansion import NamedRun
from .experiment import Case, Experiment
from .grids import correlation
from .jobs import NOT_MADE, Outcome, Record, measured, read_back
from .judged_schema import Claim
from .judging import Judgement, Values, judge
from .margins import Region
from .planning import Planned, metrics_of
from .schema import ExperimentSpec

K = TypeVar("K")
Each = Callable[..., Iterable[Any]]
"""`map`, or the `map` of an executor."""


@dataclass(frozen=True)
class Findings:
    """What an experiment comes to."""

    experiment: Experiment
    records: list[Record]  # of all cases, in their order
    results: dict[str, Results]  # of named runs that reached their end
    planned: Planned | None = None  # None: judged by what stands on disk alone
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

    def record(self, case: Case) -> Record:
        """Return what became of a case."""
        return self.records[case.number]

    def value(self, case: Case, key: str) -> Value | None:
        """Return a metric of a case, None if it failed or gives none."""
        found = self.record(case).values.get(key)
        return None if found is None else Value(*found)

    def unit(self, key: str) -> str:
        """Return the unit of a metric."""
        if self.planned:
            return self.planned.metric_units[key]
        found = (self.value(case, key) for case in self.experiment.cases)
        return next((value.unit for value in found if value), "1")

    @cached_property
    def at(self) -> dict[Point, dict[tuple[str, str], Value]]:
        """Setting -> (run, metric) -> value, of those that exist; over repeats the mean."""
        return self._means(self._at_points)

    @cached_property
    def _at_points(self) -> dict[Point, dict[tuple[str, str], Value]]:
        found: dict[Point, dict[tuple[str, str], Value]] = {}
        for case in self.experiment.cases:
            here = found.setdefault(case.point, {})
            for key in self.spec.metrics:
                if (value := self.value(case, key)) is not None:
                    here[case.run.name, key] = value
        return found

    @property
    def values(self) -> Values:
        """(run, metric) -> value, at the first setting of the axes, which is all there is without axes."""
        return next(iter(self.at.values()))

    @cached_property
    def derived_at(self) -> dict[Point, dict[str, Value]]:
        """Setting -> numbers derived from several runs, those that exist; over repeats the mean."""
        return self._means({point: derive(self.spec, values) for point, values in self._at_points.items()})

    def mean(self, case: Case, key: str) -> Value | None:
        """Return a metric of a case, over repeats of it the mean; None if one failed or gives none."""
        return self.at[self.experiment.setting(case.point)].get((case.run.name, key))

    def _means(self, found: Mapping[Point, Mapping[K, Value]]) -> dict[Point, dict[K, Value]]:
        """Return setting -> what -> its mean over repeats, of what all of them have."""
        repeats: dict[Point, list[Mapping[K, Value]]] = {}
        for point, values in found.items():
            repeats.setdefault(self.experiment.setting(point), []).append(values)
        means: dict[Point, dict[K, Value]] = {}
        for setting, several in repeats.items():
            here = means[setting] = {}
            for key in several[0]:
                every = [values[key] for values in several if key in values]
                over = interval([value.number for value in every]) if len(every) == len(several) else None
                if over is not None:
                    here[key] = Value(over.mean, every[0].unit, over.half)
        return means

    def cases_of(self, run: NamedRun, setting: Point) -> list[Case]:
        """Return a run at a setting: one case, or its repeats."""
        return self._cases[run.name, setting]

    @cached_property
    def _cases(self) -> dict[tuple[str, Point], list[Case]]:
        found: dict[tuple[str, Point], list[Case]] = {}
        for case in self.experiment.cases:
            found.setdefault((case.run.name, self.experiment.setting(case.point)), []).append(case)
        return found

    def failure(self, run: NamedRun, setting: Point) -> str:
        """Return why a run at a setting failed, or the first of its repeats that did; "" for none."""
        records = (self.record(case) for case in self.cases_of(run, setting))
        return next(("; ".join(record.problems) for record in records if record.failed), "")

    def made(self, run: NamedRun, setting: Point) -> bool:
        """Return whether a run at a setting has been made, with all its repeats."""
        return all(self.record(case).made for case in self.cases_of(run, setting))

    @property
    def derived(self) -> dict[str, Value]:
        """Numbers derived from several runs, as `values`."""
        return next(iter(self.derived_at.values()))

    @property
    def values_of_grids(self) -> Values:
        """What cells of grids may show: metrics of runs, and derived numbers as those of a run ""."""
        return {**self.values, **{("", key): value for key, value in self.derived.items()}}

    @cached_property
    def claims(self) -> list[Judgement]:
        """What the paper says, judged."""
        return self._all_judged("claims", self.spec.claims)

    @cached_property
    def checks(self) -> list[Judgement]:
        """What this project asks, judged."""
        return self._all_judged("checks", self.spec.checks)

    @property
    def judgements(self) -> list[Judgement]:
        """Claims and checks."""
        return [*self.claims, *self.checks]

    def _all_judged(self, group: str, said: Sequence[Claim]) -> list[Judgement]:
        return [
            replace(self.judged(one), region=self.regions.get((group, i)), group=group)
            for i, one in enumerate(said)
        ]

    def judged(self, claim: Claim) -> Judgement:
        """Return whether a claim holds; along axes, whether it does at every setting of them."""
        words = {run.name: run.row for run in self.experiment.runs.values()}
        every = [judge(claim, values, words, self.derived_at[at]) for at, values in self.at.items()]
        if len(every) == 1:
            return every[0]
        verdicts = [one.holds for one in every]
        holds = False if False in verdicts else None if None in verdicts else True
        text = f"holds at {verdicts.count(True)} of {counted(len(every), 'point')}"
        return Judgement(claim, holds, (text,))

    def light(self) -> Findings:
        """Return what figures over axes need, to be handed to other processes."""
        planned = self.planned and replace(self.planned, jobs=[], fmus={
            digest: replace(fmu, variables={}) for digest, fmu in self.planned.fmus.items()
        })  # fmt: skip
        recorded = {} if planned else {k: replace(one, columns={}) for k, one in self.results.items()}
        return Findings(self.experiment, self.records, recorded, planned)

    def remarkable(self) -> str:
        """Return in how many runs something was remarkable, `spin in 3 of 20 runs`; "" for none."""
        kinds = Counter(kind for record in self.records for kind in record.findings)
        total = counted(len(self.records) - self.not_made, "run")
        return ", ".join(f"{kind} in {count} of {total}" for kind, count in kinds.items())


def judge_records(planned: Planned, records: Mapping[str, Record]) -> Findings:
    """Return what an experiment along axes comes to; `records`: key -> what became of a run."""
    found = [records.get(job.key, NOT_MADE) for job in planned.jobs]
    return Findings(planned.experiment, found, {}, planned)


def judge_results(
    experiment: Experiment,
    out: Path,
    outcomes: Iterable[Outcome] = (),
    *,
    planned: Planned | None = None,
    each: Each = map,
) -> Findings:
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
    records: list[Record] = []
    ids = [made[name].value.id if name in made and made[name].ok else None for name in experiment.runs]
    recorded = each(read_back, [out / name for name in experiment.runs], ids)
    for name, read in zip(experiment.runs, recorded, strict=True):
        found = (made[name].reason if name in made else "") or read
        if isinstance(found, str):
            begun = name in made or any((out / name).glob(f"{RUN_FILE}*"))  # a died run leaves a part of it
            records.append(Record({}, (found,)) if begun else NOT_MADE)
        else:
            results[name] = found
            records.append(measured(found, metrics_of(experiment)))
    return Findings(experiment, records, results, planned)


def derive(spec: ExperimentSpec, values: Values) -> dict[str, Value]:
    """Return the numbers derived from several runs, without those that lack one."""
    found: dict[str, Value] = {}
    for key, one in spec.derived.items():
        number = None
        if one.rank_correlation is not None:
            number = correlation(spec.grids[one.rank_correlation], values, one.only)
        elif one.expression is not None:
            known = {word: values.get((source.run, source.metric)) for word, source in one.of.items()}
            numbers = {word: value.number for word, value in known.items() if value is not None}
            number = calculate(one.expression, numbers) if len(numbers) == len(known) else None
        if number is not None:
            found[key] = Value(number, one.unit)
    return found

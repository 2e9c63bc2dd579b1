"""Judging a study by the results on disk: metrics of every run, claims, tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..metrics.run_metrics import Metric, Value, evaluate, metric
from ..results.read import Results
from .claims import Judgement, Values, judge
from .derived import calculate
from .grids import correlation, grid_table
from .jobs import Outcome, read_back
from .study_file import Study, StudyRun
from .study_schema import DerivedSpec, MetricSpec, Reference, StudySpec, TableSpec, si_number
from .tables import Cell, Table, marked, remarks

HOLDS, NOT_JUDGED = "holds", "not judged"
FAILS = {"claims": "does not reproduce", "checks": "does not hold"}


@dataclass(frozen=True)
class Findings:
    """What a study comes to, computed from results on disk."""

    study: Study
    results: dict[str, Results]  # of the runs that reached their end
    failed: dict[str, str]  # run -> why it did not
    values: dict[tuple[str, str], Value]  # (run, metric) -> value
    derived: dict[str, Value]  # of those that exist
    claims: list[Judgement]
    checks: list[Judgement]


Each = Callable[..., Iterable[Any]]
"""`map`, or the `map` of an executor."""


def judge_study(study: Study, out: Path, outcomes: Iterable[Outcome] = (), *, each: Each = map) -> Findings:
    """Read the results of all runs below `out` and judge the study by them.

    Args:
        study: the study.
        out: its folder of results.
        outcomes: of the runs if they have just been made; they know best why one has no results.
        each: how to read the results of all runs.

    Raises:
        ScenarioError: a claim's bound is in a unit that its metric does not have.
    """
    made = {outcome.job.label: outcome for outcome in outcomes}
    results: dict[str, Results] = {}
    failed: dict[str, str] = {}
    ids = [made[name].value if name in made else None for name in study.runs]
    recorded = each(read_back, [out / name for name in study.runs], ids)
    for name, read in zip(study.runs, recorded, strict=True):
        found = (made[name].reason if name in made else "") or read
        if isinstance(found, str):
            failed[name] = found
        else:
            results[name] = found
    values: dict[tuple[str, str], Value] = {}
    for key, spec in study.spec.metrics.items():
        chosen, window = metric(spec.metric), spec.window
        for name, run in results.items():
            value = evaluate(run, chosen, window)
            if value is not None and (window or not run.ended):  # of a shorter run it is another metric
                values[name, key] = value
    runs, derived = list(study.runs), derive(study.spec, values)
    claims = [judge(claim, values, runs, derived) for claim in study.spec.claims]
    checks = [judge(claim, values, runs, derived) for claim in study.spec.checks]
    return Findings(study, results, failed, values, derived, claims, checks)


def derive(spec: StudySpec, values: Values) -> dict[str, Value]:
    """Return the numbers derived from several runs, without those that lack one."""
    found: dict[str, Value] = {}
    for key, one in spec.derived.items():
        number = None
        if one.rank_correlation is not None:
            number = correlation(spec.grids[one.rank_correlation], values)
        elif one.expression is not None:
            known = {word: values.get((source.run, source.metric)) for word, source in one.of.items()}
            numbers = {word: value.number for word, value in known.items() if value is not None}
            number = calculate(one.expression, numbers) if len(numbers) == len(known) else None
        if number is not None:
            found[key] = Value(number, one.unit)
    return found


def derived_tables(findings: Findings) -> list[Table]:
    """Return the grids, and a table of the derived numbers if there are any."""
    spec = findings.study.spec
    tables = [grid_table(grid, findings.values) for grid in spec.grids.values()]
    if spec.derived:
        rows: list[list[Cell]] = [[one.says, findings.derived.get(key)] for key, one in spec.derived.items()]
        headings = ["what", "value"]
        if any(one.published is not None for one in spec.derived.values()):
            headings.append("the paper says")
            for row, one in zip(rows, spec.derived.values(), strict=True):
                row.append(_published(one))
        tables.append(Table("Computed from several runs", headings, [*rows]))
    return tables


def _published(spec: DerivedSpec) -> Value | None:
    return None if spec.published is None else Value(si_number(spec.published, spec.unit), spec.unit)


def heading(spec: MetricSpec) -> str:
    """Return the heading of a metric's column."""
    if spec.heading:
        return spec.heading
    return f"{_metric(spec).formula}{spec.during()}"


def _metric(spec: MetricSpec) -> Metric:
    return metric(spec.metric)


def verdict(judgement: Judgement, group: str) -> str:
    """Return the verdict in plain words; `group` is "claims" (a paper's) or "checks" (our own)."""
    if judgement.holds is None:
        return NOT_JUDGED
    return HOLDS if judgement.holds else FAILS[group]


def run_tables(findings: Findings) -> list[Table]:
    """Return the tables of metrics: one row per run, beside it what the paper says of that run alone."""
    return [_run_table(findings, table) for table in findings.study.spec.tables]


def _run_table(findings: Findings, spec: TableSpec) -> Table:
    study = findings.study
    runs = study.matching(spec.runs)
    said = {run.name: _said_of(findings, run, spec) for run in runs}
    columns = [study.spec.metrics[key] for key in spec.metrics]
    table = Table(spec.title, ["run", *map(heading, columns)])
    formulas: dict[str, list[str]] = {}
    for column in columns:
        if column.heading:
            formulas.setdefault(_metric(column).formula, []).append(column.heading)
    table.notes = [f"{', '.join(named)}: {formula}" for formula, named in formulas.items()]
    some = any(said.values())
    if some:  # beside the first metric, which the claims are about
        table.headings[2:2] = ["the paper says", "verdict"]
    for run in runs:
        if run.name in findings.failed:
            cells: list[Cell] = ["failed", *[None] * (len(table.headings) - 2)]
            table.notes.append(f"{run.row}: {findings.failed[run.name]}")
        else:
            cells = [findings.values.get((run.name, key)) for key in spec.metrics]
            if early := findings.results[run.name].ended:
                table.notes.append(f"{run.row}: {early}; what is of the whole run, or later, has no result")
            if some:
                judged = said[run.name]
                words = "; ".join(f"{j.claim.short} ({j.claim.source})" for j in judged)
                cells[1:1] = [words or None, "; ".join(verdict(j, "claims") for j in judged) or None]
                table.notes += [f"{run.row}: {j.claim.note}" for j in judged if j.claim.note]
        results = findings.results.get(run.name)
        table.rows.append([marked(run.row, results) if results else run.row, *cells])
        table.notes += remarks([(run.row, results)]) if results else []
    return table


def all_tables(findings: Findings) -> list[Table]:
    """Return all tables of a study, in the order in which they are read."""
    return [*run_tables(findings), *derived_tables(findings), *claim_tables(findings)]


def _said_of(findings: Findings, run: StudyRun, table: TableSpec) -> list[Judgement]:
    """Return the claims with a short form that speak of the table's first metric of this run alone."""
    return [
        judgement
        for judgement in findings.claims
        if judgement.claim.short
        and all(
            (condition.run, condition.metric) == (run.name, table.metrics[0])
            and not isinstance(condition.bound, Reference)
            for condition in judgement.claim.holds_if
        )
    ]


def claim_tables(findings: Findings) -> list[Table]:
    """Return the paper's claims that stand beside no run, and the project's own checks."""
    shown = {
        id(judgement)
        for table in findings.study.spec.tables
        for run in findings.study.matching(table.runs)
        for judgement in _said_of(findings, run, table)
    }
    tables = []
    for title, group, judged in (
        ("What the paper says beyond single runs", "claims", findings.claims),
        ("What this project asks of it", "checks", findings.checks),
    ):
        rows: list[list[Cell]] = []
        for one in judged:
            if id(one) not in shown:
                says = f"{one.claim.says} ({one.claim.source})" if one.claim.source else one.claim.says
                note = f"\n{one.claim.note}" if one.claim.note else ""
                rows.append([f"{says}{note}", "\n".join(one.measured), verdict(one, group)])
        if rows:
            tables.append(Table(title, ["claim", "measured", "verdict"], [*rows]))
    return tables

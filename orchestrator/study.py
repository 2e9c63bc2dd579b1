"""Judging a study by the results on disk: metrics of every run, claims, tables."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from .claims import Judgement, judge
from .jobs import Outcome, read_back
from .metrics import Metric, Value, evaluate, metric
from .results import Results
from .study_file import Study, StudyRun
from .study_schema import Claim, MetricSpec, TableSpec
from .tables import Cell, Table

HOLDS, NOT_JUDGED = "holds", "not judged"
FAILS = {"claims": "does not reproduce", "checks": "does not hold"}


@dataclass(frozen=True)
class Findings:
    """What a study comes to, computed from results on disk."""

    study: Study
    results: dict[str, Results]  # of the runs that reached their end
    failed: dict[str, str]  # run -> why it did not
    values: dict[tuple[str, str], Value]  # (run, metric) -> value
    claims: list[Judgement]
    checks: list[Judgement]


def judge_study(study: Study, out: Path, outcomes: Iterable[Outcome] = ()) -> Findings:
    """Read the results of all runs below `out` and judge the study by them.

    Args:
        study: the study.
        out: its folder of results.
        outcomes: of the runs if they have just been made; they know best why one has no results.

    Raises:
        ScenarioError: a claim's bound is in a unit that its metric does not have.
    """
    reasons = {outcome.job.label: outcome.reason for outcome in outcomes if not outcome.ok}
    results: dict[str, Results] = {}
    failed: dict[str, str] = {}
    for name in study.runs:
        found = reasons.get(name) or read_back(out / name)
        if isinstance(found, str):
            failed[name] = found
        else:
            results[name] = found
    values: dict[tuple[str, str], Value] = {}
    for key, spec in study.spec.metrics.items():
        chosen, window = metric(spec.metric), _window(spec)
        for name, recorded in results.items():
            value = evaluate(recorded, chosen, window)
            if value is not None:
                values[name, key] = value
    claims = [judge(claim, values) for claim in study.spec.claims]
    checks = [judge(claim, values) for claim in study.spec.checks]
    return Findings(study, results, failed, values, claims, checks)


def _window(spec: MetricSpec) -> tuple[float, float] | None:
    return (spec.window[0], spec.window[1]) if spec.window else None


def heading(spec: MetricSpec) -> str:
    """Return the heading of a metric's column."""
    if spec.heading:
        return spec.heading
    window = f", {spec.window[0]:g} to {spec.window[1]:g} s" if spec.window else ""
    return f"{_metric(spec).formula}{window}"


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
    some = any(said.values())
    headings = ["run", *(heading(study.spec.metrics[key]) for key in spec.metrics)]
    if some:  # beside the first metric, which the claims are about
        headings[2:2] = ["the paper says", "verdict"]
    table = Table(spec.title, headings)
    for run in runs:
        if run.name in findings.failed:
            cells: list[Cell] = [f"failed: {findings.failed[run.name]}", *[None] * (len(headings) - 2)]
        else:
            cells = [findings.values.get((run.name, key)) for key in spec.metrics]
            if some:
                judged = said[run.name]
                words = "; ".join(j.claim.short or j.claim.says for j in judged)
                cells[1:1] = [words or None, "; ".join(verdict(j, "claims") for j in judged) or None]
        table.rows.append([run.label, *cells])
    return table


def _said_of(findings: Findings, run: StudyRun, table: TableSpec) -> list[Judgement]:
    """Return the claims that speak of the table's first metric of this run alone."""

    def alone(claim: Claim) -> bool:
        return all(
            condition.run == run.name
            and condition.metric == table.metrics[0]
            and isinstance(condition.bound, (int, float, str))
            for condition in claim.holds_if
        )

    return [judgement for judgement in findings.claims if alone(judgement.claim)]


def claim_tables(findings: Findings) -> list[Table]:
    """Return one table of the paper's claims and one of the project's own checks."""
    tables = []
    for title, group, judged in (
        ("What the paper says", "claims", findings.claims),
        ("What this project asks of it", "checks", findings.checks),
    ):
        table = Table(title, ["claim", "where", "measured", "verdict"])
        for one in judged:
            note = f" ({one.claim.note})" if one.claim.note else ""
            table.rows.append(
                [one.claim.says, one.claim.source, one.measured, f"{verdict(one, group)}{note}"]
            )
        if judged:
            tables.append(table)
    return tables

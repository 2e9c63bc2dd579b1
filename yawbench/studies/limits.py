"""Limits of axes: up to which value all conditions hold; which runs `keep: limits` keeps."""

from __future__ import annotations

from dataclasses import dataclass

from yawbench.figures.display import digits_of
from yawbench.metrics.verdict import Status, Verdict, not_judged

from .axes import RUN, Level
from .claim_schema import LimitSpec
from .claims import judge
from .experiment import Case
from .experiment_result import ExperimentResult
from .jobs import NOT_MADE
from .tables import Cell, Table


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
        verdict = judge(spec, findings.at[setting], {run.name: run.row})
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

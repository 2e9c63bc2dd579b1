"""How far an axis may go until a condition fails: the largest value up to which all runs meet it."""

from __future__ import annotations

from dataclasses import dataclass

from ..figures.display import digits_of
from .design import RUN, Level
from .experiment import Case
from .findings import Findings
from .judged_schema import LimitSpec
from .judging import judge
from .tables import Cell, Table


@dataclass(frozen=True)
class Limit:
    """Where an axis ends for one run and setting of the other axes, in the numbers of the file."""

    others: dict[str, Level]  # axis -> its level; "run" -> the run, if runs have names
    largest: float | None  # that holds with all below it; None: not even the smallest
    beyond: float | None  # the next value, which does not hold; None: all hold
    lacks: str = ""  # why the run beyond gives no metric: "failed", "not made"


def limits_of(findings: Findings, spec: LimitSpec) -> list[Limit]:
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
    findings: Findings, spec: LimitSpec, others: dict[str, Level], cases: list[Case], at: int
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


def limit_table(findings: Findings, name: str) -> Table:
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

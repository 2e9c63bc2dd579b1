"""How far an axis may go until a condition fails: the largest value up to which all runs meet it."""

from __future__ import annotations

import operator
from dataclasses import dataclass

from ..figures.display import digits_of
from ..studies.tables import Cell, Table
from .design import Level
from .planning import PlannedRun
from .schema import Condition, LimitSpec
from .table import Swept, axis_unit

_COMPARE = {
    "above": operator.gt,
    "at_least": operator.ge,
    "below": operator.lt,
    "at_most": operator.le,
}


@dataclass(frozen=True)
class Limit:
    """Where an axis ends for one setting of the others, in the numbers of the file."""

    others: dict[str, Level]  # axis -> its level
    largest: float | None  # that holds with all below it; None: not even the smallest
    beyond: float | None  # the next value, which does not hold; None: all hold
    failed: bool = False  # the run beyond failed and gives no metric


def limits_of(swept: Swept, spec: LimitSpec) -> list[Limit]:
    """Return the limit for every setting of the other axes, in the order of the design."""
    names = list(swept.planned.sweep.spec.axes)
    at = names.index(spec.of)
    lines: dict[tuple[Level, ...], list[PlannedRun]] = {}
    for run in swept.planned.runs:
        lines.setdefault(run.point[:at] + run.point[at + 1 :], []).append(run)
    others = [name for name in names if name != spec.of]
    return [
        _limit(swept, spec, dict(zip(others, setting, strict=True)), runs, at)
        for setting, runs in lines.items()
    ]


def _limit(swept: Swept, spec: LimitSpec, others: dict[str, Level], runs: list[PlannedRun], at: int) -> Limit:
    largest = None
    for run in sorted(runs, key=lambda run: float(run.point[at].value)):
        here = float(run.point[at].value)
        if not all(holds(swept, run, condition) for condition in spec.holds_if):
            return Limit(others, largest, here, failed=not swept.record(run).ok)
        largest = here
    return Limit(others, largest, None)


def holds(swept: Swept, run: PlannedRun, condition: Condition) -> bool:
    """Return whether a run meets a condition; one that failed does not."""
    value = swept.value(run, condition.metric)
    limit = swept.bound(condition.metric, condition.bound)
    return value is not None and _COMPARE[condition.operator](value.number, limit)


def limit_table(swept: Swept, name: str) -> Table:
    """Return a limit for all settings of the other axes, one row each."""
    planned, spec = swept.planned, swept.planned.sweep.spec.limits[name]
    found = limits_of(swept, spec)
    others = [f"{other}{axis_unit(planned, other)}" for other in found[0].others]
    table = Table(f"{spec.says}{axis_unit(planned, spec.of)}", [*others, "up to", "not any more at"])
    for limit in found:
        words: list[Cell] = [level.words for level in limit.others.values()]
        up_to = "-" if limit.largest is None else digits_of(limit.largest)
        beyond = "-" if limit.beyond is None else digits_of(limit.beyond)
        table.rows.append([*words, up_to, f"{beyond} (the run failed)" if limit.failed else beyond])
    table.numbers = {len(others), len(others) + 1}
    return table

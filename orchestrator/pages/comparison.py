"""What a comparison's page begins with: metrics with their differences, the signals that differ most."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

from ..experiments.findings import Findings
from ..experiments.tables import Table, marked, remarks
from ..figures.display import Run, digits_of, shown, shown_unit
from ..metrics.run_metrics import Value, metric
from ..metrics.symbols import variable_of
from .divergence import SAME, SEEN, Divergence, Parting, divergence
from .facts import Figure, figure_of

MOST_DIFFERENT = 6
"""Signals drawn that differ most; chosen: three rows of two panels are one screen."""
AT_ONCE = 8
"""Partings that are shown; the others unfold. Chosen: more than the wires around one unit."""
RULE = (
    f"A difference counts from {SAME * 1e9:g} billionth of the signal's largest value; curves can be seen to "
    f"part from {100 * SEEN:g} %."
)
LESS_IS_BETTER = (
    "relative_peak_error", "mean_error", "rms_error", "stability_index", "overshoot", "settling_time",
    "slope_variation_rate", "effort", "total_variation_rate",
)  # fmt: skip
"""Measures of which the least is the best; of others, such as a path's displacement, that depends."""
OF_CONTROL = ("effort", "total_variation_rate")
"""Measures of what a controller does: of one that does nothing they are no merit."""


class MetricCell(NamedTuple):
    """A value and its difference from the first run's, as text, empty if there is none."""

    value: str
    difference: str
    best: bool


def comparison_facts(findings: Findings) -> dict[str, Any] | None:
    """Return what a page says that compares the runs with the first one; None if none has results."""
    runs = [
        Run(run.label, findings.results[name])
        for name, run in findings.experiment.runs.items()
        if name in findings.results
    ]
    if not runs:
        return None
    first, *others = runs
    found = [divergence(first.results, other.results) for other in others]
    return {
        "labels": [marked(*run) for run in runs],
        "rows": metric_rows(findings),
        "remarks": remarks(runs),
        "most": _most_different(runs, found),
        "partings": [_parted(run.label, first.label, one) for run, one in zip(others, found, strict=True)],
        "rule": RULE,
    }


def metric_rows(findings: Findings) -> list[dict[str, Any]]:
    """Return the metrics of all runs with results, each with its difference from the first."""
    rows = []
    idle = _idle(findings)
    for key, spec in findings.spec.metrics.items():
        chosen = metric(spec.metric)
        values = [findings.values.get((name, key)) for name in findings.results]
        measure = chosen.name.partition("(")[0]
        least = _best(values, idle if measure in OF_CONTROL else ()) if measure in LESS_IS_BETTER else None
        cells = [
            MetricCell(
                shown(value.number, value.unit) if value else "",
                difference(values[0], value) if k else "",
                k == least,
            )
            for k, value in enumerate(values)
        ]
        rows.append({"title": chosen.title, "formula": chosen.formula, "cells": cells})
    return rows


def _idle(findings: Findings) -> set[int]:
    """Return the numbers of runs in which nothing controls: some signal has no effort or chatter at all."""
    of_control = [
        key
        for key, spec in findings.spec.metrics.items()
        if metric(spec.metric).name.partition("(")[0] in OF_CONTROL
    ]
    found = [[findings.values.get((name, key)) for key in of_control] for name in findings.results]
    return {k for k, values in enumerate(found) if any(one is not None and one.number == 0 for one in values)}


def _best(values: Sequence[Value | None], apart: Collection[int]) -> int | None:
    """Return the number of the run whose value is the least, as it reads; None if no single one is.

    Args:
        values: of all runs.
        apart: numbers of runs that do not take part.
    """
    known = sorted((one.number, k) for k, one in enumerate(values) if one is not None and k not in apart)
    if len(known) < 2:
        return None
    (first, best), (second, _) = known[:2]
    unit = next(one.unit for one in values if one is not None)
    return None if shown(first, unit) == shown(second, unit) else best


def _most_different(runs: Sequence[Run], found: Sequence[Divergence]) -> Figure | None:
    """Return the signals in which any run differs most from the first, relative to their peaks."""
    apart: dict[str, float] = {}
    for parting in (parting for one in found for parting in one.partings):
        name = variable_of(parting.signal)
        if "*" not in name and not name.startswith("position_"):  # one line per run in each panel
            apart[name] = max(apart.get(name, 0.0), parting.relative)
    names = sorted(apart, key=lambda name: -apart[name])[:MOST_DIFFERENT]
    return figure_of(("most", "", runs, names, ()), whole=True)


def difference(first: Value | None, other: Value | None) -> str:
    """Return how a value differs from the first, with its sign; per cents differ by points."""
    if first is None or other is None:
        return ""
    apart = other.number - first.number
    if not math.isfinite(apart):
        return ""
    unit, factor = shown_unit(other.unit)
    if apart == 0:
        return "the same"
    size = digits_of(abs(apart) * factor)
    return f"{'+' if apart > 0 else '−'}{size} {'points' if unit == '%' else unit}".rstrip()


def _parted(label: str, first: str, found: Divergence) -> dict[str, Any]:
    return {
        "title": f"{label} against {first}",
        "summary": parting_summary(found),
        "table": parting_table(found.partings[:AT_ONCE]),
        "rest": parting_table(found.partings[AT_ONCE:]),
        "notes": found.notes,
    }


def parting_summary(found: Divergence) -> str:
    """Return in a sentence which signals part first."""
    if not found.compared:
        return "The runs have no signal in common."
    if not found.partings:
        which = (
            "The only signal they share is" if found.compared == 1 else f"All {found.compared} signals are"
        )
        return f"{which} the same throughout."
    first = found.partings[0]
    others = [one.signal for one in found.partings if one.first == first.first][1:]
    more = " and others" if len(others) > 3 else ""
    then = f", then {', '.join(others[:3])}{more} in the same step" if others else ""
    seen = [(one.seen, one.signal) for one in found.partings if one.seen is not None]
    told = "In no curve can it be seen."
    if seen:
        at, signal = min(seen, key=lambda one: one[0])
        told = f"Curves can be told apart from {at:g} s on, first {signal}."
    return f"The first to differ is {first.signal}, at {first.first:g} s{then}. {told}"


def parting_table(partings: Sequence[Parting]) -> Table:
    """Return a table of signals that differ, in the order in which they part."""
    headings = ["signal", "goes to", "differs from", "seen from", "largest difference", "at"]
    table = Table("", headings, numbers={2, 3, 4, 5} if partings else set())
    for one in partings:
        table.rows.append([
            one.signal,
            ", ".join(one.targets) or "recorded only",
            f"{one.first:g} s",
            None if one.seen is None else f"{one.seen:g} s",
            None if math.isnan(one.largest) else shown(one.largest, one.unit),
            f"{one.largest_at:g} s",
        ])  # fmt: skip
    return table

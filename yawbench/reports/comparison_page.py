"""What a page shows that compares runs with the first: metrics side by side, where the runs part."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from yawbench.figures.display import LabelledRun, digits_of, shown, shown_unit, shown_value
from yawbench.metrics.expressions import MetricValue, metric
from yawbench.metrics.measures import variable_of
from yawbench.studies.experiment_result import ExperimentResult
from yawbench.studies.run_remarks import marked, remarks
from yawbench.studies.tables import Table

from .divergence import SAME, SEEN, RunComparison, divergence, parting_summary, partings_table
from .viewer_views import View

MOST_DIFFERENT = 6
"""Number of most different signals drawn; chosen: three rows of two panels fill a screen."""
AT_ONCE = 8
"""Differences shown; the rest are collapsed. Chosen: more than the wires of one instance."""
RULE = (
    f"A difference counts from {SAME * 1e9:g} billionth of the signal's largest value; curves can be seen to "
    f"part from {100 * SEEN:g} %."
)
LESS_IS_BETTER = (
    "relative_peak_error", "mean_error", "rms_error", "stability_index", "overshoot", "settling_time",
    "slope_variation_rate", "effort", "total_variation_rate",
)  # fmt: skip
"""Measures that are better the smaller they are; for others, such as displacement, it depends."""
OF_CONTROL = ("effort", "total_variation_rate")
"""Measures of control activity: a controller that does nothing has small values, too."""


@dataclass(frozen=True)
class PartingView:
    """How a run differs from the first: a sentence, the first signals to differ, the rest, notes."""

    title: str
    summary: str
    table: Table
    rest: Table
    notes: Sequence[str]


@dataclass(frozen=True)
class ComparisonView:
    """What a page shows that compares runs with the first one."""

    table: Table  # metrics of all runs
    views: Sequence[View]  # of its viewer, with the signals that differ most
    partings: Sequence[PartingView]  # a run each
    rule: str = RULE  # from when on a difference counts


def comparison_view(findings: ExperimentResult) -> ComparisonView | None:
    """Return what a page shows that compares runs with the first one; None if none has results."""
    runs = [
        LabelledRun(run.label, findings.results[name])
        for name, run in findings.experiment.runs.items()
        if name in findings.results
    ]
    if not runs:
        return None
    first, *others = runs
    comparisons = [divergence(first.results, other.results) for other in others]
    partings = [
        PartingView(
            f"{run.label} against {first.label}",
            parting_summary(comparison),
            partings_table(comparison.partings[:AT_ONCE]),
            partings_table(comparison.partings[AT_ONCE:]),
            comparison.notes,
        )
        for run, comparison in zip(others, comparisons, strict=True)
    ]
    return ComparisonView(metric_table(findings, runs), _most_different(comparisons), partings)


BEST = "★"
"""Mark of the best value of a metric."""


def metric_table(findings: ExperimentResult, runs: Sequence[LabelledRun]) -> Table:
    """Return the metrics of all runs with results, each with its difference from the first below it."""
    headings = ["metric", "definition", *(marked(*run) for run in runs)]
    table = Table("", headings, notes=remarks(runs), numbers=range(2, len(headings)))
    if len(runs) > 1:
        table.notes.append(
            f"Below each value: the difference from {headings[2]}. {BEST}: the best value, for metrics where "
            "less is better."
        )
    idle = _idle(findings)
    for key, spec in findings.spec.metrics.items():
        chosen = metric(spec.metric)
        values = [findings.values.get((name, key)) for name in findings.results]
        measure = chosen.name.partition("(")[0]
        least = _best(values, idle if measure in OF_CONTROL else ()) if measure in LESS_IS_BETTER else None
        cells = [
            shown_value(value)
            + f" {BEST}" * (k == least)
            + (f"\n{apart}" if k and (apart := difference(values[0], value)) else "")
            if value
            else None
            for k, value in enumerate(values)
        ]
        table.rows.append([chosen.title, chosen.formula, *cells])
    return table


def _idle(findings: ExperimentResult) -> set[int]:
    """Return the indices of runs without control: the effort or chatter of some signal is zero."""
    of_control = [
        key
        for key, spec in findings.spec.metrics.items()
        if metric(spec.metric).name.partition("(")[0] in OF_CONTROL
    ]
    controls = [[findings.values.get((name, key)) for key in of_control] for name in findings.results]
    return {
        k
        for k, values in enumerate(controls)
        if any(value is not None and value.number == 0 for value in values)
    }


def _best(values: Sequence[MetricValue | None], apart: Collection[int]) -> int | None:
    """Return the index of the run whose displayed value is smallest; None if several share it.

    Args:
        values: of all runs.
        apart: indices of runs to leave out.
    """
    known = sorted(
        (value.number, k) for k, value in enumerate(values) if value is not None and k not in apart
    )
    if len(known) < 2:
        return None
    (first, best), (second, _) = known[:2]
    unit = next(value.shown_in for value in values if value is not None)
    return None if shown(first, unit) == shown(second, unit) else best


def _most_different(comparisons: Sequence[RunComparison]) -> list[View]:
    """Return the view of the signals that differ most from the first run, relative to their peaks."""
    apart: dict[str, float] = {}
    for parting in (parting for comparison in comparisons for parting in comparison.partings):
        name = variable_of(parting.signal)
        if "*" not in name and not name.startswith("position_"):  # one line per run in each panel
            apart[name] = max(apart.get(name, 0.0), parting.relative)
    names = sorted(apart, key=lambda name: -apart[name])[:MOST_DIFFERENT]
    return [View("The signals that differ most", names)] if names else []


def difference(first: MetricValue | None, other: MetricValue | None) -> str:
    """Return the signed difference of a value from the first; ratios in per cent differ by points."""
    if first is None or other is None:
        return ""
    apart = other.number - first.number
    if not math.isfinite(apart):
        return ""
    unit, factor = shown_unit(other.shown_in)
    if apart == 0:
        return "the same"
    if other.whether:
        return ""
    size = digits_of(abs(apart) * factor)
    return f"{'+' if apart > 0 else '−'}{size} {'points' if unit == '%' else unit}".rstrip()

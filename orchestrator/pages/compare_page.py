"""The page of a comparison: metrics and their differences, where runs part, overlays, how to repeat it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import titles
from ..figures.display import digits_of, shown, shown_unit
from ..figures.panels import shown_by
from ..metrics.run_metrics import STANDARD, Value, metric
from ..results.read import Results
from ..studies.compare import FIGURES, Comparison
from ..studies.jobs import Job, Once, planned
from ..studies.tables import Cell, Table, marked, remarks
from ..wording import counted
from ..writing import write_whole
from .animation import assets
from .diagram import diagrams
from .divergence import SAME, SEEN, Divergence, Parting, divergence
from .facts import animation_of, figure_of, fmus_of, made_by, programs_of
from .provenance import count_kinds, groups_of
from .rendering import render, style
from .system import system_of

PAGE = "compare.html"
"""Name of the page, beside the runs' folders."""
AT_ONCE_SEEN = 3
"""Runs seen from above; chosen: more cars in one place cover each other."""
AT_ONCE = 8
"""Partings that are shown; the others unfold. Chosen: more than the wires around one unit."""
RULE = (
    f"A difference counts from {SAME * 1e9:g} billionth of the signal's largest value; curves can be seen to "
    f"part from {100 * SEEN:g} %."
)


@dataclass(frozen=True)
class MetricCell:
    """A value and its difference from the first run's, as text; empty if there is none."""

    value: str
    difference: str


@dataclass(frozen=True)
class MetricRow:
    """A metric of all runs."""

    title: str
    formula: str
    cells: list[MetricCell]


def write_page(
    comparison: Comparison, jobs: Sequence[Job], out: Path, *, title: str, changed: str, command: str
) -> Path:
    """Write the page of a comparison into its folder.

    Args:
        comparison: the runs and what they come to.
        jobs: of all runs; every one can start.
        out: the folder of the comparison.
        title: of the page.
        changed: what was changed for all runs.
        command: the command line that made the comparison.
    """
    file = out / PAGE
    text = compare_page(comparison, jobs, title=title, changed=changed, command=command)
    write_whole(file, text)
    return file


def compare_page(
    comparison: Comparison, jobs: Sequence[Job], *, title: str, changed: str, command: str
) -> str:
    """Return the page of a comparison as HTML."""
    runs = comparison.runs
    recorded = [run.results for run in runs]
    once = Once()
    plans = [planned(job, once) for job in jobs]
    groups = groups_of(plans)
    figures = [
        figure_of((name, name.replace("_", " ").capitalize(), runs, panels, (f"{name}.svg", f"{name}.png")))
        for name, panels in FIGURES.items()
        if shown_by(runs, panels)
    ]
    shown_runs = [(run.label, run.results) for run in runs[:AT_ONCE_SEEN]]
    seen = animation_of(shown_runs, " and ".join(label for label, _ in shown_runs)) if runs else None
    return render(
        "compare.html.j2",
        title=title,
        changed=changed,
        style=style(),
        assets=assets(),
        source=str(recorded[0].run.get("scenario", {}).get("source") or "") if recorded else "",
        summary=_summary(comparison),
        remarks=remarks((run.label, run.results) for run in runs),
        failed=comparison.failed,
        table=metric_facts(comparison) if runs else None,
        partings=[_parted(run.label, runs[0].label, recorded[0], run.results) for run in runs[1:]],
        parting_rule=RULE,
        figures=[figure for figure in figures if figure],
        animation=seen,
        drawing=diagrams(system_of([plan for _, plan in plans]), "Units and wires"),
        groups=groups,
        kinds=count_kinds(groups),
        command=command,
        settings=settings_table([(run.label, run.results) for run in runs]),
        fmus=fmus_of(recorded),
        programs=programs_of(recorded),
        **made_by(),
    )


def _summary(comparison: Comparison) -> str:
    count = len(comparison.runs)
    labels = ", ".join(run.label for run in comparison.runs)
    return f"{counted(count, 'run')}: {labels}." if count else "No run reached its end."


def metric_facts(comparison: Comparison) -> dict[str, Any]:
    """Return the metrics of all runs, each with its difference from the first."""
    labels = list(comparison.values)
    rows = []
    for name in STANDARD:
        values = [comparison.values[label].get(name) for label in labels]
        if any(value is not None for value in values):
            cells = [MetricCell(shown(v.number, v.unit) if v else "", "") for v in values]
            for k, value in enumerate(values[1:], start=1):
                cells[k] = MetricCell(cells[k].value, difference(values[0], value))
            rows.append(MetricRow(metric(name).title, metric(name).formula, cells))
    return {"labels": [marked(run.label, run.results) for run in comparison.runs], "rows": rows}


def difference(first: Value | None, other: Value | None) -> str:
    """Return how a value differs from the first, with its sign; per cents differ by points."""
    if first is None or other is None:
        return ""
    apart = other.number - first.number
    if apart != apart or abs(apart) == float("inf"):
        return ""
    unit, factor = shown_unit(other.unit)
    if apart == 0:
        return "the same"
    size = digits_of(abs(apart) * factor)
    return f"{'+' if apart > 0 else '−'}{size} {'points' if unit == '%' else unit}".rstrip()


def _parted(label: str, first: str, one: Results, other: Results) -> dict[str, Any]:
    found = divergence(one, other)
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
    together = [one.signal for one in found.partings if one.first == first.first]
    others = f", then {', '.join(together[1:4])}{' and others' if len(together) > 4 else ''} in the same step"
    seen = [one for one in found.partings if one.seen is not None]
    visible = min(seen, key=lambda one: one.seen or 0.0, default=None)
    told = (
        f" Curves can be told apart from {visible.seen:g} s on, first {visible.signal}."
        if visible is not None
        else " In no curve can it be seen."
    )
    others = others if len(together) > 1 else ""
    return f"The first to differ is {first.signal}, at {first.first:g} s{others}.{told}"


def parting_table(partings: Sequence[Parting]) -> Table:
    """Return a table of signals that differ, in the order in which they part."""
    headings = ["signal", "goes to", "differs from", "seen from", "largest difference", "at"]
    rows: list[Sequence[Cell]] = [_parting_row(one) for one in partings]
    return Table("", headings, rows, numbers={2, 3, 4, 5} if rows else set())


def _parting_row(one: Parting) -> list[Cell]:
    return [
        one.signal,
        ", ".join(one.targets) or "recorded only",
        f"{one.first:g} s",
        None if one.seen is None else f"{one.seen:g} s",
        None if one.largest != one.largest else shown(one.largest, one.unit),
        f"{one.largest_at:g} s",
    ]


def settings_table(runs: Sequence[tuple[str, Results]]) -> Table:
    """Return how each run was made, as its record says."""
    rows: list[Sequence[Cell]] = []
    for label, results in runs:
        run = results.run
        rows.append(
            [
                label,
                titles.changed(titles.changes_in(run)) or None,
                str(run.get("scenario", {}).get("file", "")),
                str(run.get("algorithm", "")),
                f"{1000 * run['step_size']:g} ms" if "step_size" in run else None,
                f"{run['stop_time']:g} s" if "stop_time" in run else None,
                str(results.folder),
            ]
        )
    return Table("", ["run", "changed", "scenario", "algorithm", "step", "until", "results"], rows)

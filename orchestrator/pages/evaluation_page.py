"""Page of a standard test: the verdict on every criterion with its distance to the limit, and the runs.

The viewer shows at first the runs that decide, with the instants and limits of the test.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from vocabulary.signals import SIGNALS

from ..evaluation.standard_tests import Evaluation, Limit, StandardTest, TestSeries
from ..evaluation.trace import Trace
from ..experiments.verdict_tables import margin_words, run_table, runs_table
from ..figures.style import LabelledRun, digits_apart, shown
from ..messages import counted
from ..metrics.measures import words
from ..metrics.verdict import SYMBOLS, Verdict, worst
from ..results.reader import Results, load_results
from ..results.run_record import RunRecord
from .page_parts import render
from .viewer import MOST, Settings, View, assets, viewer

LARGEST = 2_000_000
"""Size of the samples in a page [bytes]; beyond it, the page carries the signals of the test alone. Chosen:
a series of sine with dwell opens in a second."""
PANELS = ("steering_wheel_angle", "yaw_rate", "sideslip", "acceleration_y")
"""Signals shown first; chosen: what most tests judge."""


@dataclass(frozen=True)
class CriterionRow:
    """A criterion: the verdict on it, and the run that decides with its numbers."""

    name: str
    verdict: Verdict
    run: str  # label, "" if there is only one
    why: str
    value: str
    limit: str

    @property
    def distance(self) -> str:
        """How far the value lies from its limit, in its unit and relative to it."""
        beyond, margin = self.verdict.beyond, margin_words(self.verdict)
        if beyond is None:
            return ""
        return (
            f"{shown(beyond, self.verdict.unit)} ({margin})" if margin else shown(beyond, self.verdict.unit)
        )


def criteria_of(judged: Sequence[Evaluation], series: TestSeries | None) -> list[CriterionRow]:
    """Return a row per criterion, with the verdict of the series, or that of the run that decides."""
    rows = []
    for name in dict.fromkeys(name for run in judged for name in run.criteria):
        own = {run.label: run.criteria[name] for run in judged if name in run.criteria}
        deciding = worst(own.values())
        assert deciding is not None
        label = next(label for label, verdict in own.items() if verdict is deciding)
        verdict = series.criteria.get(name, deciding) if series else deciding
        number = verdict if verdict.beyond is not None else replace(deciding, status=verdict.status)
        row = CriterionRow(name, number, label if len(judged) > 1 else "", verdict.why, *_numbers(number))
        rows.append(row)
    return rows


def _numbers(verdict: Verdict) -> tuple[str, str]:
    """Return value and limit of a verdict, with digits enough to tell them apart."""
    if verdict.value is None or verdict.bound is None:
        return "", ""
    digits = digits_apart([(verdict.value, verdict.bound)], verdict.unit)
    symbol = SYMBOLS[verdict.relation] if verdict.relation else ""
    value, bound = (shown(number, verdict.unit, digits=digits) for number in (verdict.value, verdict.bound))
    return value, f"{symbol} {bound}".strip()


def evaluation_page(
    test: StandardTest, traces: Sequence[Trace], judged: Sequence[Evaluation], series: TestSeries | None
) -> str:
    """Return the page of the evaluated runs of a test.

    Raises:
        ResultsError: results cannot be read.
    """
    rows = criteria_of(judged, series)
    labels = [trace.label for trace in traces]
    deciding = [labels.index(row.run) for row in rows if row.run] or [0]
    chosen = judged[deciding[0]]
    marks, limits = test.marks(chosen)
    shown_first = sorted(set(deciding))[:MOST]
    views = [View("the runs that decide", PANELS, shown_first)]
    if len(traces) > len(shown_first):
        views.append(View("all runs", PANELS))
    table = runs_table(series.runs if series else judged, test, series) if len(judged) > 1 else None
    runs = [LabelledRun(label, results_of(trace)) for label, trace in zip(labels, traces, strict=True)][:MOST]
    settings = Settings(views, marks=marks, limits=limits, largest=LARGEST)
    return render(
        "evaluation.html.j2",
        title=f"{test.name.replace('-', ' ').capitalize()}: {counted(len(judged), 'run')}",
        below=f"{test.says[:1].upper()}{test.says[1:]}.",
        sentence=series.summary if series else _sentence(rows, judged),
        rows=rows,
        marked=chosen.label,
        dashed=[*(f"{instant:.3f} s: {text}" for instant, text in marks), *map(_limit_words, limits)],
        viewer=viewer(runs, settings, name="test", alone=True),
        table=table,
        each=[run_table(run, test.says) for run in judged],
        assets=assets(),
    )


def _sentence(rows: Sequence[CriterionRow], judged: Sequence[Evaluation]) -> str:
    """Return the result in a sentence."""
    if not rows:
        missing = sum(run.judges_nothing for run in judged)
        return (
            "The test has no criteria." if not missing else f"{counted(missing, 'run')} could not be judged."
        )
    passed = sum(bool(row.verdict.holds) for row in rows)
    return f"{passed} of {counted(len(rows), 'criterion', 'criteria')} passed."


def _limit_words(limit: Limit) -> str:
    signal, bound, text = limit
    return f"{words(signal)} {shown(bound, SIGNALS[signal].unit)}: {text}"


def results_of(trace: Trace) -> Results:
    """Return the recorded results of a trace; those of a measurement have its signals alone."""
    if trace.folder is not None:
        return load_results(trace.folder)
    units = {name: SIGNALS[name].unit if name in SIGNALS else "" for name in trace.signals}
    return Results(Path(), trace.time, dict(trace.signals), {"time": "s", **units}, RunRecord())

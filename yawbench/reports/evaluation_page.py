"""Pages of evaluations: a standard test, a validation by measurements, a fit to measurements.

That of a test has the verdict on every criterion with its distance to the limit; the viewer shows at first
the runs that decide, with the instants and limits of the test. That of a validation has the verdict on every
signal; the viewer shows its cross plot with the band. That of a fit has parameters and differences; the
viewer shows time histories of car and models.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from yawbench.events.kinds import events_in
from yawbench.figures.display import LabelledRun, digits_apart, shown
from yawbench.foundation.messages import counted
from yawbench.metrics.measures import words
from yawbench.metrics.verdict import SYMBOLS, Status, Verdict, worded, worst
from yawbench.orchestrator.results.reader import Results, load_results
from yawbench.orchestrator.results.run_folder import load_record
from yawbench.orchestrator.results.run_record import EventRecord, RunRecord
from yawbench.proving_ground.standard_tests import Evaluation, Limit, StandardTest, TestSeries
from yawbench.proving_ground.trace import Trace
from yawbench.studies.driven_tests import run_table, runs_table
from yawbench.studies.result_tables import margin_words
from yawbench.studies.tables import Table
from yawbench.vocabulary.signals import SIGNALS

from .page_parts import ViewerPage, render
from .viewer import LARGEST, MOST, Settings, assets, viewer
from .viewer_views import Bound, Mark, View

PANELS = ("steering_wheel_angle", "yaw_rate", "sideslip", "acceleration_y", "cone_overrun")
"""Signals shown first, where they are recorded; chosen: what most tests judge."""


def criteria_table(judged: Sequence[Evaluation], series: TestSeries | None) -> tuple[Table, list[str]]:
    """Return a row per criterion, and the label of the run that decides it.

    A row has the verdict of the series, or of the run that decides, with its distance to the limit.
    """
    headings = ["criterion", "verdict", "value", "limit", "distance to the limit"]
    headings += ["decided by"] * (len(judged) > 1) + ["why"]
    table, labels = Table("", headings, numbers={2, 3, 4}), []
    for name in dict.fromkeys(name for run in judged for name in run.criteria):
        own = {run.label: run.criteria[name] for run in judged if name in run.criteria}
        deciding = worst(own.values())
        assert deciding is not None
        labels.append(next(label for label, verdict in own.items() if verdict is deciding))
        verdict = series.criteria.get(name, deciding) if series else deciding
        number = verdict if verdict.beyond is not None else replace(deciding, status=verdict.status)
        row = [name, worded(verdict.status), *_numbers(number), _distance(number)]
        row += labels[-1:] * (len(judged) > 1) + [verdict.why]
        table.rows.append([cell or None for cell in row])
    return table, labels


def _distance(verdict: Verdict) -> str:
    """Return how far the value lies from its limit, in its unit and relative to it."""
    beyond, margin = verdict.beyond, margin_words(verdict)
    if beyond is None:
        return ""
    return f"{shown(beyond, verdict.shown_in)} ({margin})" if margin else shown(beyond, verdict.shown_in)


def _numbers(verdict: Verdict) -> tuple[str, str]:
    """Return value and limit of a verdict, with digits enough to tell them apart."""
    if verdict.value is None or verdict.bound is None:
        return "", ""
    digits = digits_apart([(verdict.value, verdict.bound)], verdict.shown_in)
    symbol = SYMBOLS[verdict.relation] if verdict.relation else ""
    value, bound = (
        shown(number, verdict.shown_in, digits=digits) for number in (verdict.value, verdict.bound)
    )
    return value, f"{symbol} {bound}".strip()


def evaluation_page(
    test: StandardTest, traces: Sequence[Trace], judged: Sequence[Evaluation], series: TestSeries | None
) -> str:
    """Return the page of the evaluated runs of a test.

    Raises:
        ResultsError: results cannot be read.
    """
    criteria, decide = criteria_table(judged, series)
    labels = [trace.label for trace in traces]
    deciding = [labels.index(label) for label in decide] or [0]
    chosen = judged[deciding[0]]
    dashed = [test.marks(run) for run in judged[:MOST]]
    marks = [Mark(*mark, number) for number, (own, _) in enumerate(dashed) for mark in own]
    limits = [Bound(*limit, number) for number, (_, own) in enumerate(dashed) for limit in own]
    shown_first = sorted(set(deciding))[:MOST]
    views = [View("the runs that decide", PANELS, shown_first)]
    if len(traces) > len(shown_first):
        views.append(View("all runs", PANELS))
    every = [runs_table(series.runs if series else judged, test, series)] if len(judged) > 1 else []
    runs = [LabelledRun(label, results_of(trace)) for label, trace in zip(labels, traces, strict=True)][:MOST]
    settings = Settings(views, marks=marks, limits=limits, largest=LARGEST, comparable=series is None)
    instants, bounds = dashed[deciding[0]]
    told = [*(f"{instant:.3f} s: {text}" for instant, text in instants), *map(_limit_words, bounds)]
    view = ViewerPage(
        title=f"{test.name.replace('-', ' ').capitalize()}: {counted(len(judged), 'run')}",
        below=f"{test.says[:1].upper()}{test.says[1:]}.",
        sentence=series.summary if series else _sentence(criteria, judged),
        first=[criteria] if criteria.rows else [],
        viewer=viewer(runs, settings, name="test", alone=True),
        notes=[f"Dashed, of {chosen.label}: {'; '.join(told)}."] if told else [],
        sections=[
            *([("All runs", every)] if every else []),
            ("Quantities", [run_table(run, test.says) for run in judged]),
        ],
        assets=assets(),
    )
    return render(view)


def _sentence(criteria: Table, judged: Sequence[Evaluation]) -> str:
    """Return the result in a sentence."""
    if not criteria.rows:
        missing = sum(run.judges_nothing for run in judged)
        return (
            "The test has no criteria." if not missing else f"{counted(missing, 'run')} could not be judged."
        )
    passed = sum(row[1] == worded(Status.PASSED) for row in criteria.rows)
    return f"{passed} of {counted(len(criteria.rows), 'criterion', 'criteria')} passed."


def _limit_words(limit: Limit) -> str:
    signal, bound, text = limit
    return f"{words(signal)} {shown(bound, SIGNALS[signal].unit)}: {text}"


def results_of(trace: Trace) -> Results:
    """Return the recorded results of a trace; those of a measurement have its signals alone."""
    if trace.folder is not None:
        return load_results(trace.folder)
    return drawn(Results, trace.time, trace.signals)


def events_of_trace(trace: Trace) -> Sequence[EventRecord]:
    """Return the events of a trace: those of its record, for which no signals are read, else found."""
    if trace.folder is not None and "events" in (record := load_record(trace.folder)).model_fields_set:
        return record.events
    return events_in(results_of(trace))


def drawn(kind: type[Results], time: np.ndarray, columns: Mapping[str, np.ndarray]) -> Results:
    """Return results that have these columns alone, with the units that their names tell."""
    known = {name: SIGNALS.get(name.rpartition(".")[2]) for name in columns}
    units = {"time": "s"} | {name: signal.unit if signal else "" for name, signal in known.items()}
    return kind(Path(), time, dict(columns), units, RunRecord())

"""Pages of evaluations: a standard test, a validation by measurements, a fit to measurements.

That of a test has the verdict on every criterion with its distance to the limit; the viewer shows at first
the runs that decide, with the instants and limits of the test. That of a validation has the verdict on every
signal; the viewer shows its cross plot with the band. That of a fit has parameters and differences; the
viewer shows time histories of car and models.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from vocabulary.signals import SIGNALS

from ..evaluation.standard_tests import Evaluation, Limit, StandardTest, TestSeries
from ..evaluation.trace import Trace
from ..evaluation.validation import Validation
from ..experiments.fit_result import PARTS, FitResult, FittedModel
from ..experiments.result_tables import (
    conditions_table,
    margin_words,
    run_table,
    runs_table,
    validation_table,
)
from ..experiments.tables import Table
from ..figures.style import LabelledRun, digits_apart, shown, shown_unit
from ..measured.least_squares import LEAST_PIECES
from ..messages import counted, listed, span
from ..metrics.expressions import MetricValue
from ..metrics.measures import words
from ..metrics.verdict import SYMBOLS, Status, Verdict, apart, worst
from ..results.measurement_results import MeasuredResults
from ..results.reader import Results, load_results
from ..results.run_record import RunRecord
from .page_parts import document
from .viewer import LARGEST, MOST, Settings, View, assets, viewer

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
        row = [name, verdict.status.value, *_numbers(number), _distance(number)]
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
    marks, limits = test.marks(chosen)
    shown_first = sorted(set(deciding))[:MOST]
    views = [View("the runs that decide", PANELS, shown_first)]
    if len(traces) > len(shown_first):
        views.append(View("all runs", PANELS))
    every = [runs_table(series.runs if series else judged, test, series)] if len(judged) > 1 else []
    runs = [LabelledRun(label, results_of(trace)) for label, trace in zip(labels, traces, strict=True)][:MOST]
    settings = Settings(views, marks=marks, limits=limits, dashed_of=deciding[0], largest=LARGEST)
    dashed = [*(f"{instant:.3f} s: {text}" for instant, text in marks), *map(_limit_words, limits)]
    return document(
        f"{test.name.replace('-', ' ').capitalize()}: {counted(len(judged), 'run')}",
        below=f"{test.says[:1].upper()}{test.says[1:]}.",
        sentence=series.summary if series else _sentence(criteria, judged),
        first=[criteria] if criteria.rows else [],
        viewer=viewer(runs, settings, name="test", alone=True),
        notes=[f"Dashed, of {chosen.label}: {'; '.join(dashed)}."] if dashed else [],
        sections=[
            *([("All runs", every)] if every else []),
            ("Quantities", [run_table(run, test.says) for run in judged]),
        ],
        assets=assets(),
    )


def _sentence(criteria: Table, judged: Sequence[Evaluation]) -> str:
    """Return the result in a sentence."""
    if not criteria.rows:
        missing = sum(run.judges_nothing for run in judged)
        return (
            "The test has no criteria." if not missing else f"{counted(missing, 'run')} could not be judged."
        )
    passed = sum(row[1] == Status.PASSED.value for row in criteria.rows)
    return f"{passed} of {counted(len(criteria.rows), 'criterion', 'criteria')} passed."


def _limit_words(limit: Limit) -> str:
    signal, bound, text = limit
    return f"{words(signal)} {shown(bound, SIGNALS[signal].unit)}: {text}"


def results_of(trace: Trace) -> Results:
    """Return the recorded results of a trace; those of a measurement have its signals alone."""
    if trace.folder is not None:
        return load_results(trace.folder)
    return _drawn(Results, trace.time, trace.signals)


def validation_page(validation: Validation) -> str:
    """Return the page of a run compared with measurements."""
    facts = validation_facts(validation)
    return document(
        f"Validation: {validation.title}",
        sentence=facts["sentence"],
        warnings=facts["warnings"],
        below=facts["below"],
        first=[facts["verdicts"]],
        viewer=facts["viewer"],
        sections=[("", [facts["conditions"]])],
        assets=assets(),
    )


def validation_facts(validation: Validation, name: str = "validation") -> dict[str, Any]:
    """Return the template data of a validation; `name`: anchor of its viewer."""
    return {
        "title": f"{validation.title}, against {validation.measured}",
        "sentence": validation_sentence(validation),
        "warnings": [str(diagnostic) for diagnostic in validation.diagnostics],
        "below": " · ".join(filter(None, [validation.measured, validation.origin])),
        "verdicts": validation_table(validation),
        "conditions": conditions_table(validation),
        "viewer": viewer(*_cross_plots(validation), name=name) if validation.plots else Markup(""),
    }


def validation_sentence(validation: Validation) -> str:
    """Return the result of a validation in a sentence."""
    judged = [verdict for verdict in validation.verdicts.values() if verdict.holds is not None]
    if not judged:
        return "No signal could be judged."
    largest = max(float(verdict.value or 0.0) for verdict in judged)
    sides = {
        side: [words(name).lower() for name, verdict in validation.verdicts.items() if verdict.holds is holds]
        for side, holds in (("within", True), ("outside", False))
    }
    parts = [f"{side} the band: {listed(names, last='and')}" for side, names in sides.items() if names]
    furthest = f"The furthest point lies at {apart(largest, 1.0, decimals=2)} of the tolerance."
    text = f"{'; '.join(parts)}. {furthest}"
    return f"{text[:1].upper()}{text[1:]}"


DISTANCE = "distance"
"""Name of the signal that tells how far points lie from the run, over the tolerance."""


def _cross_plots(validation: Validation) -> tuple[list[LabelledRun], Settings]:
    """Return band, run and tests of all cross plots as runs of a viewer, with a view of each plot."""
    runs: list[LabelledRun] = []
    views, bands = [], []
    over = f"plant.{validation.horizontal}"
    for plot in validation.plots:
        signal, distance = f"plant.{plot.signal}", f"{plot.signal}.{DISTANCE}"
        first = len(runs)
        columns = {over: plot.over, signal: plot.values}
        runs.append(LabelledRun(validation.title, _drawn(Results, plot.time, columns)))
        for test in plot.tests:
            columns = {over: test.over, signal: test.values, distance: test.distance}
            runs.append(LabelledRun(test.name, _drawn(MeasuredResults, test.time, columns)))
        x, y = plot.outline
        band = {over: x, signal: y}
        bands.append(len(runs))
        times = np.linspace(plot.time[0], plot.time[-1], x.size)  # it has none: those of the run
        runs.append(LabelledRun("tolerance", _drawn(Results, times, band)))
        title = f"{words(plot.signal)} over {words(validation.horizontal).lower()}"
        views.append(View(title, [signal, distance], range(first, len(runs)), over))
        views.append(
            View(f"{words(plot.signal)} over time", [signal, over, distance], range(first, len(runs) - 1))
        )
    limits = [(f"{plot.signal}.{DISTANCE}", 1.0, "tolerance") for plot in validation.plots]
    return runs, Settings(views, metrics=(), limits=limits, bands=bands, largest=LARGEST)


def _drawn(kind: type[Results], time: np.ndarray, columns: Mapping[str, np.ndarray]) -> Results:
    """Return results that have these columns alone, with the units that their names tell."""
    known = {name: SIGNALS.get(name.rpartition(".")[2]) for name in columns}
    units = {"time": "s"} | {name: signal.unit if signal else "" for name, signal in known.items()}
    return kind(Path(), time, dict(columns), units, RunRecord())


BINS = 4
"""Number of ranges of acceleration and speed, equal in samples. Chosen: enough to see a trend."""
OVER = ("acceleration_y", "velocity_x")


def fit_page(result: FitResult) -> str:
    """Return the page of a fit as HTML."""
    measurement, names = result.fit.measurement, list(result.fit.errors)
    runs = [LabelledRun(measurement.car or "measured", _measured(result))]
    runs += [
        LabelledRun(model.title, _simulated(result, model))
        for model in result.models
        if all(signals is not None for part in PARTS for signals in model.simulated[part])
    ]
    views = [View("over time", names)]
    if "acceleration_y" in names and len(names) > 1:
        others = [name for name in names if name != "acceleration_y"]
        views.append(View("over lateral acceleration", others, x="plant.acceleration_y"))
    return document(
        result.fit.spec.title,
        sentence=f"{result.verdict[:1].upper()}{result.verdict[1:]}.",
        below=" · ".join(filter(None, (measurement.title, measurement.origin))),
        viewer=viewer(runs, Settings(views, metrics=(), largest=LARGEST), name="fit", alone=True),
        sections=[
            ("", [score_table(result)]),
            ("Parameters", [*map(parameter_table, result.models)]),
            ("Where the models differ from the car", residual_tables(result)),
        ],
        assets=assets(),
    )


def _measured(result: FitResult) -> Results:
    columns = [(w.window.times, w.window.measured) for part in PARTS for w in result.fit.parts[part]]
    time, signals = _joined(columns, list(result.fit.errors))
    return _drawn(MeasuredResults, time, signals)


def _simulated(result: FitResult, model: FittedModel) -> Results:
    columns = [
        (fit_window.window.times, signals)
        for part in PARTS
        for fit_window, signals in zip(result.fit.parts[part], model.simulated[part], strict=True)
        if signals is not None
    ]
    time, signals = _joined(columns, [name for name in result.fit.errors if name in columns[0][1]])
    return _drawn(Results, time, signals)


def _joined(
    windows: Sequence[tuple[np.ndarray, Mapping[str, np.ndarray]]], names: Sequence[str]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return times and signals of windows joined, without duplicate samples; names are those of a plant."""
    time, first = np.unique(np.concatenate([times for times, _ in windows]), return_index=True)
    joined = {name: np.concatenate([signals[name] for _, signals in windows])[first] for name in names}
    return time, {f"plant.{name}": values for name, values in joined.items()}


def parameter_table(model: FittedModel) -> Table:
    """Return the table of a model's parameters."""
    table = Table(model.title, ["parameter", "value", "95 % interval", "start", "bounds", "prior"])
    estimate = model.estimate
    intervals = estimate.intervals()
    for free in model.parameters:
        interval = intervals[free.name]
        words = None
        if free.name in estimate.at_bound:
            words = "at its bound"
        elif interval:
            words = span(*interval, digits=5)
        prior = free.prior and f"{free.prior[0]:.5g} ± {free.prior[1]:.3g}"
        unit = free.unit.replace(".", "·") if free.unit != "1" else ""
        value = f"{estimate.values[free.name]:.6g} {unit}".strip()
        table.rows.append(
            [free.name, value, words, f"{free.start:.5g}", span(free.low, free.high, digits=5), prior]
        )
    search = f"{estimate.sets} sets of values; {estimate.message}"
    table.notes.append(f"condition {estimate.identifiability.condition:.3g}; {search}")
    if estimate.covariance is None:
        pieces = counted(estimate.pieces, "piece")
        table.notes.append(f"no intervals: {pieces} of 5 s, fewer than {LEAST_PIECES}")
    for first, second, shared in estimate.correlated():
        table.notes.append(f"{first} and {second} are correlated: {shared:.2f}")
    return table


def score_table(result: FitResult) -> Table:
    """Return the table of scores, training and held-out side by side."""
    columns = [f"{what}, {words}" for words in PARTS.values() for what in ("rms", "largest", "fit")]
    headings = ["signal", "model", *columns]
    table = Table("Differences", headings, numbers=set(range(2, 8)))
    for name in result.fit.errors:
        for model in result.models:
            row: list[Any] = [name, model.title]
            for part in PARTS:
                score = result.scores.get((model.title, part, name))
                unit = SIGNALS[name].unit
                row += (
                    [MetricValue(score.rms, unit), MetricValue(score.largest, unit), f"{score.fit:.1f} %"]
                    if score
                    else [None, None, None]
                )
            table.rows.append(row)
    return table


def residual_tables(result: FitResult) -> list[Table]:
    """Return a table per signal of `OVER`: rms differences in its ranges, on the held-out windows."""
    part = result.fit.deciding
    return [table for name in OVER if (table := _residuals_over(result, part, name)) is not None]


def _residuals_over(result: FitResult, part: str, over: str) -> Table | None:
    """Return the table over a signal; None if it is not measured, or its ranges read alike."""
    windows = result.fit.parts[part]
    if any(over not in fit_window.filtered.signals for fit_window in windows):
        return None
    at = np.concatenate([
        np.abs(np.interp(w.window.times, w.filtered.time, w.filtered.signals[over])) for w in windows
    ])  # fmt: skip
    edges = np.quantile(at, np.linspace(0.0, 1.0, BINS + 1))
    unit, factor = shown_unit(SIGNALS[over].unit)
    ends = [f"{factor * edge:.3g}" for edge in edges]
    if len({*ends}) < len(ends):
        return None
    ranges = [f"{low} to {high} {unit}" for low, high in pairwise(ends)]
    title = f"Rms differences over |{over}|, {PARTS[part]} windows"
    table = Table(title, ["signal", "model", *ranges], numbers=range(2, 2 + BINS))
    inside = [(at >= low) & (at <= high) for low, high in pairwise(edges)]
    for name in result.fit.errors:
        for model in result.models:
            windows_of_model = model.simulated[part]
            if any(signals is None or name not in signals for signals in windows_of_model):
                continue
            difference = np.concatenate([
                signals[name] - w.window.measured[name]
                for w, signals in zip(windows, windows_of_model, strict=True)
                if signals is not None
            ])  # fmt: skip
            row: list[Any] = [name, model.title]
            row += [
                MetricValue(float(np.sqrt(np.mean(difference[rows] ** 2))), SIGNALS[name].unit)
                for rows in inside
            ]
            table.rows.append(row)
    return table

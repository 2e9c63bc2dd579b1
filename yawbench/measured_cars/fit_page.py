"""Page of a fit: parameters with intervals, differences, and time histories of car and models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from yawbench.figures.display import LabelledRun, shown_unit
from yawbench.foundation.messages import counted, span
from yawbench.measured_cars.fit_result import PARTS, FitResult, FittedModel
from yawbench.measured_cars.least_squares import LEAST_PIECES
from yawbench.measurements.measured_results import MeasuredResults
from yawbench.metrics.expressions import MetricValue
from yawbench.orchestrator.results.reader import Results
from yawbench.reports.evaluation_page import drawn
from yawbench.reports.page_parts import ViewerPage, render
from yawbench.reports.viewer import LARGEST, Settings, assets, viewer
from yawbench.reports.viewer_views import View
from yawbench.studies.tables import Table
from yawbench.vocabulary.signals import SIGNALS

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
    view = ViewerPage(
        title=result.fit.spec.title,
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
    return render(view)


def _measured(result: FitResult) -> Results:
    columns = [(w.window.times, w.window.measured) for part in PARTS for w in result.fit.parts[part]]
    time, signals = _joined(columns, list(result.fit.errors))
    return drawn(MeasuredResults, time, signals)


def _simulated(result: FitResult, model: FittedModel) -> Results:
    columns = [
        (fit_window.window.times, signals)
        for part in PARTS
        for fit_window, signals in zip(result.fit.parts[part], model.simulated[part], strict=True)
        if signals is not None
    ]
    time, signals = _joined(columns, [name for name in result.fit.errors if name in columns[0][1]])
    return drawn(Results, time, signals)


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

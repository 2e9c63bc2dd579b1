"""Tables and page of a fit: histories and cross plots of the car and the models, parameters, differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from vocabulary.signals import SIGNALS

from ..experiments.fit_result import PARTS, FitResult, FittedModel
from ..experiments.tables import Table
from ..figures.style import LabelledRun
from ..metrics.run_metrics import MetricValue
from ..results.measured import MeasuredResults
from ..results.reader import Results
from ..results.run_record import RunRecord
from .page_parts import render
from .viewer import Settings, View, assets, viewer

BINS = 4
"""Ranges of acceleration and speed, each with as many samples. Chosen: enough to see a trend."""
OVER = ("acceleration_y", "velocity_x")
LARGEST = 2_000_000
"""Size of the samples in the page [bytes]; chosen: as on evaluation pages."""


def fit_page(result: FitResult) -> str:
    """Return the page of a fit as HTML."""
    of, names = result.fit.measurement, list(result.fit.errors)
    runs = [LabelledRun(of.car or "measured", _measured(result))]
    runs += [
        LabelledRun(model.title, _simulated(result, model))
        for model in result.models
        if all(signals is not None for part in PARTS for signals in model.simulated[part])
    ]
    views = [View("over time", names)]
    if "acceleration_y" in names and len(names) > 1:
        others = [name for name in names if name != "acceleration_y"]
        views.append(View("over lateral acceleration", others, x="plant.acceleration_y"))
    return render(
        "fit.html.j2",
        title=result.fit.spec.title,
        sentence=f"{result.verdict[:1].upper()}{result.verdict[1:]}.",
        below=" · ".join(filter(None, (of.title, of.origin))),
        viewer=viewer(runs, Settings(views, metrics=(), largest=LARGEST), name="fit", alone=True),
        tables=[score_table(result), *map(parameter_table, result.models), *residual_tables(result)],
        assets=assets(),
    )


def _measured(result: FitResult) -> Results:
    columns = [(w.window.times, w.window.measured) for part in PARTS for w in result.windows(part)]
    time, signals = _joined(columns, list(result.fit.errors))
    return MeasuredResults(Path(), time, signals, _units(signals), RunRecord())


def _simulated(result: FitResult, model: FittedModel) -> Results:
    columns = [
        (fit_window.window.times, signals)
        for part in PARTS
        for fit_window, signals in zip(result.windows(part), model.simulated[part], strict=True)
        if signals is not None
    ]
    time, signals = _joined(columns, [name for name in result.fit.errors if name in columns[0][1]])
    return Results(Path(), time, signals, _units(signals), RunRecord())


def _joined(
    windows: Sequence[tuple[np.ndarray, Mapping[str, np.ndarray]]], names: Sequence[str]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return windows one after the other, each sample once, and their signals as those of a plant."""
    time, first = np.unique(np.concatenate([times for times, _ in windows]), return_index=True)
    joined = {name: np.concatenate([signals[name] for _, signals in windows])[first] for name in names}
    return time, {f"plant.{name}": values for name, values in joined.items()}


def _units(columns: Mapping[str, np.ndarray]) -> dict[str, str]:
    return {"time": "s"} | {name: SIGNALS[name.partition(".")[2]].unit for name in columns}


def parameter_table(model: FittedModel) -> Table:
    """Return the table of a model's parameters."""
    table = Table(model.title, ["parameter", "value", "95 % interval", "start", "bounds", "prior"])
    intervals = model.estimate.intervals()
    for one in model.parameters:
        interval = intervals[one.name]
        words = None
        if one.name in model.estimate.at_bound:
            words = "at its bound"
        elif interval:
            words = f"{interval[0]:.5g} to {interval[1]:.5g}"
        prior = one.prior and f"{one.prior[0]:.5g} ± {one.prior[1]:.3g}"
        value = f"{model.estimate.values[one.name]:.6g} {one.unit if one.unit != '1' else ''}".strip()
        table.rows.append(
            [one.name, value, words, f"{one.start:.5g}", f"{one.low:.5g} to {one.high:.5g}", prior]
        )
    found = model.estimate
    table.notes.append(
        f"condition {found.identifiability.condition:.3g}; {found.sets} sets of values; {found.message}"
    )
    if found.covariance is None:
        table.notes.append(f"no intervals: {found.pieces} pieces of 5 s are too few")
    for first, second, shared in found.correlated():
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
                one = result.scores.get((model.title, part, name))
                unit = SIGNALS[name].unit
                row += (
                    [MetricValue(one.rms, unit), MetricValue(one.largest, unit), f"{one.fit:.1f} %"]
                    if one
                    else [None, None, None]
                )
            table.rows.append(row)
    table.notes.append(result.verdict)
    return table


def residual_tables(result: FitResult) -> list[Table]:
    """Return a table per signal of `OVER`: rms of all differences in its ranges, of the held-out windows."""
    part = "held_out" if result.fit.held_out else "training"
    return [table for name in OVER if (table := _residuals_over(result, part, name)) is not None]


def _residuals_over(result: FitResult, part: str, over: str) -> Table | None:
    """Return the table over a signal; None if it is not measured."""
    windows = result.windows(part)
    if any(over not in fit_window.filtered.signals for fit_window in windows):
        return None
    places = np.concatenate([
        np.abs(np.interp(w.window.times, w.filtered.time, w.filtered.signals[over])) for w in windows
    ])  # fmt: skip
    edges = np.quantile(places, np.linspace(0.0, 1.0, BINS + 1))
    unit = SIGNALS[over].unit
    ranges = [f"{low:.3g} to {high:.3g} {unit}" for low, high in pairwise(edges)]
    title = f"Rms differences over |{over}|, {PARTS[part]} windows"
    table = Table(title, ["signal", "model", *ranges], numbers=range(2, 2 + BINS))
    inside = [(places >= low) & (places <= high) for low, high in pairwise(edges)]
    for name in result.fit.errors:
        for model in result.models:
            several = model.simulated[part]
            if any(signals is None or name not in signals for signals in several):
                continue
            difference = np.concatenate([
                signals[name] - w.window.measured[name]
                for w, signals in zip(windows, several, strict=True)
                if signals is not None
            ])  # fmt: skip
            row: list[Any] = [name, model.title]
            row += [
                MetricValue(float(np.sqrt(np.mean(difference[some] ** 2))), SIGNALS[name].unit)
                for some in inside
            ]
            table.rows.append(row)
    return table

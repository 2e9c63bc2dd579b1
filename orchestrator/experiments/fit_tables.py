"""Tables of fits: parameters of a model, scores of both, differences over acceleration and speed."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from vocabulary.signals import SIGNALS

from ..metrics.run_metrics import MetricValue
from .fit_result import PARTS, FitResult, FittedModel
from .tables import Table

BINS = 4
"""Ranges of acceleration and speed, each with as many samples. Chosen: enough to see a trend."""
OVER = ("acceleration_y", "velocity_x")


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
    ranges = [f"{low:.3g} to {high:.3g} {unit}" for low, high in itertools.pairwise(edges)]
    title = f"Rms differences over |{over}|, {PARTS[part]} windows"
    table = Table(title, ["signal", "model", *ranges], numbers=range(2, 2 + BINS))
    inside = [(places >= low) & (places <= high) for low, high in itertools.pairwise(edges)]
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

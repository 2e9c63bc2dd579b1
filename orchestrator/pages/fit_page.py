"""Page of a fit: histories and cross plots of the car and the models, parameters, differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from vocabulary.signals import SIGNALS

from ..experiments.fit_result import PARTS, FitResult, FittedModel
from ..experiments.fit_tables import parameter_table, residual_tables, score_table
from ..figures.style import LabelledRun
from ..results.measured import MeasuredResults
from ..results.reader import Results
from ..results.run_record import RunRecord
from .page_parts import render
from .viewer import Settings, View, assets, viewer

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

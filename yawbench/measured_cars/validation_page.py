"""Validations on pages and in tables: verdicts on signals, cross plots with the band that is judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from markupsafe import Markup

from yawbench.figures.display import LabelledRun, shown
from yawbench.foundation.messages import listed
from yawbench.measured_cars.validation import Validation
from yawbench.measurements.measured_results import MeasuredResults
from yawbench.metrics.measures import words
from yawbench.metrics.verdict import SYMBOLS, apart, worded
from yawbench.orchestrator.results.reader import Results
from yawbench.reports.evaluation_page import drawn
from yawbench.reports.page_parts import ViewerPage, render
from yawbench.reports.viewer import LARGEST, Settings, assets, viewer
from yawbench.reports.viewer_views import Bound, View
from yawbench.studies.tables import Table


def validation_table(validation: Validation) -> Table:
    """Return the table of a validation: a row per signal, then per condition of such a comparison."""
    title = f"{validation.title}, against {validation.measured}"
    table = Table(title, ["signal", "verdict", "largest distance"])
    for name, verdict in validation.verdicts.items():
        table.rows.append([name, worded(verdict.status), verdict.why])
    table.notes = [f"{validation.bands}: {validation.source}"]
    return table


def conditions_table(validation: Validation) -> Table:
    """Return the table of what a validation asks for."""
    table = Table("Conditions", ["condition", "verdict", "value", "asked"], numbers={2, 3})
    for name, verdict in validation.conditions.items():
        assert verdict.value is not None and verdict.bound is not None and verdict.relation
        ends = (verdict.value, verdict.bound)
        value, bound = (f"{x:g}" if verdict.shown_in == "1" else shown(x, verdict.shown_in) for x in ends)
        limit = f"{SYMBOLS[verdict.relation]} {bound}"
        table.rows.append([name, worded(verdict.status), value, limit])
    return table


def validation_page(validation: Validation) -> str:
    """Return the page of a run compared with measurements."""
    view = validation_view(validation)
    return render(replace(view, title=f"Validation: {validation.title}", assets=assets()))


def validation_view(validation: Validation, name: str = "validation") -> ViewerPage:
    """Return what a page shows of a validation; `name`: anchor of its viewer."""
    return ViewerPage(
        title=f"{validation.title}, against {validation.measured}",
        sentence=validation_sentence(validation),
        warnings=[str(diagnostic) for diagnostic in validation.diagnostics],
        below=" · ".join(filter(None, [validation.measured, validation.origin])),
        first=[validation_table(validation)],
        viewer=viewer(*_cross_plots(validation), name=name) if validation.plots else Markup(""),
        sections=[("", [conditions_table(validation)])],
    )


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
    views, bands, offsets = [], [], {}
    over = f"plant.{validation.horizontal}"
    for plot in validation.plots:
        signal, distance = f"plant.{plot.signal}", f"{plot.signal}.{DISTANCE}"
        first = len(runs)
        columns = {over: plot.over, signal: plot.values}
        runs.append(LabelledRun(validation.title, drawn(Results, plot.time, columns)))
        begin, end = plot.time[0], plot.time[-1]
        for test in plot.tests:
            if test.time[0] > end or test.time[-1] < begin:  # the cursor would never be in both
                offsets[len(runs)] = round(float(begin - test.time[0]), 3)
            columns = {over: test.over, signal: test.values, distance: test.distance}
            runs.append(LabelledRun(test.name, drawn(MeasuredResults, test.time, columns)))
        x, y = plot.outline
        band = {over: x, signal: y}
        bands.append(len(runs))
        times = np.linspace(begin, end, x.size)  # it has none: those of the run
        runs.append(LabelledRun("tolerance", drawn(Results, times, band)))
        title = f"{words(plot.signal)} over {words(validation.horizontal).lower()}"
        views.append(View(title, [signal, distance], range(first, len(runs)), over))
        views.append(
            View(f"{words(plot.signal)} over time", [signal, over, distance], range(first, len(runs) - 1))
        )
    limits = [Bound(f"{plot.signal}.{DISTANCE}", 1.0, "tolerance") for plot in validation.plots]
    return runs, Settings(views, metrics=(), limits=limits, bands=bands, offsets=offsets, largest=LARGEST)

"""Tables of standard tests: all quantities of one run, or a row per run."""

from __future__ import annotations

from collections.abc import Sequence

from yawbench.foundation.errors import text_of
from yawbench.metrics.expressions import MetricValue
from yawbench.metrics.verdict import worded
from yawbench.proving_ground.standard_tests import Evaluation, StandardTest, TestQuantity, TestSeries

from .tables import Cell, Table


def _cell(quantity: TestQuantity | None) -> Cell:
    if quantity is None or quantity.value is None:
        return None
    return MetricValue(quantity.value, quantity.shown_in)


def run_table(judged: Evaluation, title: str) -> Table:
    """Return the table of a standard test's run: a row per quantity with its reading, verdicts as notes."""
    rows: list[Sequence[Cell]] = [
        [quantity.name, _cell(quantity), quantity.reading] for quantity in judged.quantities.values()
    ]
    notes = [f"{name}: {result}" for name, result in judged.criteria.items()]
    return Table(
        f"{judged.label}: {title}",
        ["quantity", "value", "reading"],
        rows,
        [*notes, *map(str, judged.diagnostics)],
    )


def runs_table(runs: Sequence[Evaluation], test: StandardTest, series: TestSeries | None) -> Table:
    """Return the table of a standard test's runs, in the given order, with the series' verdict as notes."""
    keys = [key for key in test.columns if any(key in run.quantities for run in runs)]
    names = {key: run.quantities[key].name for run in reversed(runs) for key in keys if key in run.quantities}
    criteria = list(dict.fromkeys(name for run in runs for name in run.criteria))
    rows: list[Sequence[Cell]] = []
    for run in runs:
        words = [worded(run.criteria[name].status) if name in run.criteria else "-" for name in criteria]
        rows.append([run.label, *(_cell(run.quantities.get(key)) for key in keys), *words])
    notes = []
    if series:
        notes += [f"{name}: {result}" for name, result in series.criteria.items()]
        notes.append(series.summary)
    notes += [f"{run.label}: {text_of(run.diagnostics)}" for run in runs if run.diagnostics]
    return Table(test.says, ["run", *(names[key] for key in keys), *criteria], rows, notes)

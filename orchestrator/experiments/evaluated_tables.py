"""Tables of what standard tests come to: one run with every quantity, or a row per run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..evaluation.judgement import Judgement, Quantity, Series
from ..metrics.run_metrics import Value
from .tables import Cell, Table

if TYPE_CHECKING:
    from ..evaluation.standard_tests import StandardTest


def _cell(quantity: Quantity | None) -> Cell:
    if quantity is None or quantity.value is None:
        return None
    return Value(quantity.value, quantity.unit)


def run_table(judged: Judgement, title: str) -> Table:
    """Return a table of one run: a row per quantity and how the standard was read, its verdicts below."""
    rows: list[Sequence[Cell]] = [[one.name, _cell(one), one.reading] for one in judged.quantities.values()]
    notes = [f"{name}: {one}" for name, one in judged.rulings.items()]
    return Table(f"{judged.label}: {title}", ["quantity", "value", "reading"], rows, notes + judged.notes)


def runs_table(runs: Sequence[Judgement], test: StandardTest, series: Series | None) -> Table:
    """Return a table of many runs, a row each, in the order given; the verdict of the series below."""
    keys = [key for key in test.columns if any(key in run.quantities for run in runs)]
    names = {key: run.quantities[key].name for run in reversed(runs) for key in keys if key in run.quantities}
    criteria = list(dict.fromkeys(name for run in runs for name in run.rulings))
    rows: list[Sequence[Cell]] = []
    for run in runs:
        words = [run.rulings[name].verdict.value if name in run.rulings else "-" for name in criteria]
        rows.append([run.label, *(_cell(run.quantities.get(key)) for key in keys), *words])
    notes = []
    if series:
        notes += [f"{name}: {one}" for name, one in series.rulings.items()]
        notes.append(series.summary)
    notes += [f"{run.label}: {'; '.join(run.notes)}" for run in runs if run.notes]
    return Table(test.says, ["run", *(names[key] for key in keys), *criteria], rows, notes)

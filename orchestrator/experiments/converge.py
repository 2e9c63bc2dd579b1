"""How the result of a scenario depends on the communication step: error, observed order, cost.

Each algorithm runs at h, h/2, h/4, ...; units with a step size of their own keep it. The error of
a run is the largest difference from the finest run of the first algorithm, over the communication
points of the coarsest run, relative to the signal's peak. The observed order at h is
log2(|x_h - x_h/2| / |x_h/2 - x_h/4|) with the same norm: it needs no exact solution, and compares
an algorithm only with itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ResultsError, ScenarioError
from ..figures.style import QUIET, frame, line_style, new_figure
from ..metrics.run_metrics import Value
from ..metrics.symbols import words
from ..plan import Algorithm, Change
from ..plan import Value as Plain
from ..results.read import Results
from ..scenario.load import load_scenario
from ..titles import with_changes
from .compare import of_runs
from .expansion import NamedRun
from .experiment import Experiment
from .findings import Findings
from .table import Column
from .tables import Cell, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


ROUNDING = 1e-13
"""Relative difference that a different order of additions can make."""


@dataclass(frozen=True)
class Row:
    """One run: its algorithm and step [s], and what it came to; None where it cannot be known."""

    algorithm: str
    step: float
    error: float | None  # relative to the signal's peak
    order: float | None
    wall_time: float | None  # [s]
    failed: str = ""
    finest: bool = False  # the run that all others are compared with


def refinements(
    scenario: Path,
    *,
    halvings: int,
    signal: str,
    algorithms: Sequence[Algorithm],
    changes: Sequence[Change] = (),
) -> Experiment:
    """Return the runs of a convergence study: all steps of the first algorithm, then the next.

    Raises:
        ScenarioError: the scenario or an option is wrong.
    """
    loaded = load_scenario(scenario, changes=changes)
    if signal.count(".") != 1:
        raise ScenarioError(f"--signal {signal}: write UNIT.VARIABLE, for example plant.yaw_rate")
    runs = []
    for algorithm in algorithms or [loaded.algorithm]:
        for k in range(halvings + 1):
            step: Fraction = loaded.step_size / 2**k
            refined = (
                Change("algorithm", algorithm, "converge"),
                Change("step_size", float(step), "converge"),
            )
            name = f"{algorithm}/{_milliseconds(float(step)).replace(' ', '')}"
            label = f"{algorithm}, {_milliseconds(float(step))}"
            runs.append(NamedRun(name, label, label, scenario, refined))
    title = with_changes(f"Convergence of {signal}, {scenario.stem}", changes)
    return of_runs(runs, title, scenario, changes, {})


def _milliseconds(step: float) -> str:
    return f"{1000 * step:.10g} ms"


def measure(findings: Findings, signal: str) -> list[Row]:
    """Return a row for every run, computed from its results.

    Raises:
        ResultsError: the signal is zero throughout.
    """
    by_algorithm: dict[str, list[NamedRun]] = {}
    for run in findings.experiment.runs.values():
        by_algorithm.setdefault(str(_given(run, "algorithm")), []).append(run)
    finest = next(iter(by_algorithm.values()))[-1]
    failed = {case.run.name: findings.record(case).problems for case in findings.experiment.cases}
    samples = {
        run.name: _samples(findings.results.get(run.name), signal, "; ".join(failed[run.name]))
        for run in findings.experiment.runs.values()
    }
    reference = samples[finest.name][0]
    peak = math.nan if reference is None else float(np.max(np.abs(reference)))
    if peak == 0:
        raise ResultsError(f"{signal} is zero throughout: choose another --signal.")
    rows = []
    for algorithm, runs in by_algorithm.items():
        coarse = [_common(samples[run.name][0], k) for k, run in enumerate(runs)]
        target = _common(reference, len(runs) - 1)
        steps = [_distance(a, b) for a, b in zip(coarse, [*coarse[1:], None], strict=True)]
        for k, run in enumerate(runs):
            after = steps[k + 1] if k + 1 < len(steps) else None
            order = math.log2(first / after) if (first := steps[k]) and after else None
            distance = None if run is finest else _distance(coarse[k], target)
            _, wall_time, why = samples[run.name]
            error = None if distance is None else distance / peak
            step = float(_given(run, "step_size"))
            rows.append(Row(algorithm, step, error, order, wall_time, why, run is finest))
    return rows


def _given(run: NamedRun, place: str) -> Plain:
    """Return what a run gives at a place."""
    return next(change.plain for change in reversed(run.changes) if change.place == place)


def _samples(found: Results | None, signal: str, why: str) -> tuple[np.ndarray | None, float | None, str]:
    """Return the signal, the wall time [s] and why there is neither."""
    if found is None:
        return None, None, why
    if not np.issubdtype(found[signal].dtype, np.number):
        return None, None, f"{signal} is no number"
    return found[signal], found.record.wall_time, ""


def _common(x: np.ndarray | None, k: int) -> np.ndarray | None:
    """Return the samples of a run with step h / 2^k at the communication points of that with h."""
    return None if x is None else x[:: 2**k]


def _distance(a: np.ndarray | None, b: np.ndarray | None) -> float | None:
    """Return the largest difference; 0 if it is no more than rounding."""
    if a is None or b is None:
        return None
    distance = float(np.max(np.abs(a - b)))
    return distance if distance > ROUNDING * float(np.max(np.abs(b))) else 0.0


def convergence_table(rows: Sequence[Row], title: str) -> Table:
    """Return the table of all runs."""
    table = Table(title, ["algorithm", "step", "error", "observed order", "wall time"])
    for row in rows:
        error: Cell = None if row.error is None else Value(row.error, "1")
        if row.failed or row.finest:
            error = f"failed: {row.failed}" if row.failed else "the finest"
        order = Value(row.order, "1") if row.order is not None else None
        cost = Value(row.wall_time, "s") if row.wall_time is not None else None
        table.rows.append([row.algorithm, _milliseconds(row.step), error, order, cost])
    return table


def columns_of(rows: Sequence[Row]) -> list[Column]:
    """Return all runs as columns, in SI."""
    numbers = (("step_size", "s", "step"), ("error", "1", "error"), ("order", "1", "order"),
               ("wall_time", "s", "wall_time"))  # fmt: skip
    return [
        Column("algorithm", "string", [row.algorithm for row in rows]),
        *(Column(n, "float64", [getattr(row, part) for row in rows], {"unit": u}) for n, u, part in numbers),
        Column("failed", "string", [row.failed for row in rows]),
    ]


def convergence_figure(rows: Sequence[Row], signal: str, title: str, note: str) -> Figure:
    """Return error over step and error over cost, both axes logarithmic, with slopes 1 and 2 to compare.

    Raises:
        ResultsError: no run has an error above zero.
    """
    from matplotlib.lines import Line2D
    from matplotlib.ticker import LogLocator

    drawn = [row for row in rows if row.error and row.wall_time]
    if not drawn:
        raise ResultsError("nothing to draw: no two runs differ.")
    names = list(dict.fromkeys(row.algorithm for row in drawn))
    styles = {
        name: {**line_style(k), "marker": "os^"[k % 3], "markersize": 5} for k, name in enumerate(names)
    }
    with new_figure() as figure:
        by_step, by_cost = figure.subplots(1, 2, sharey=True)
        for name in names:
            mine = [row for row in drawn if row.algorithm == name]
            errors = [row.error for row in mine]
            by_step.plot([1000 * row.step for row in mine], errors, **styles[name])
            by_cost.plot([row.wall_time for row in mine], errors, **styles[name])
        _slopes(by_step, drawn)
        for axes, heading, below in (
            (by_step, f"{words(signal)}: largest error, relative to its peak", "communication step in ms"),
            (by_cost, "the same over the wall time of the run", "wall time in s"),
        ):
            axes.set(xscale="log", yscale="log", xlabel=below)
            axes.set_title(heading)
        steps = sorted({1000 * row.step for row in drawn})
        by_step.set_xticks(steps, [f"{step:g}" for step in steps])
        by_step.minorticks_off()
        by_cost.xaxis.set_major_locator(LogLocator(subs=(1, 2, 3, 5, 7)))
        by_cost.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        by_cost.xaxis.set_minor_formatter("")
        handles = [Line2D([], [], label=name, **styles[name]) for name in names]
        frame(figure, 3.6, handles, title, note)
    return figure


def _slopes(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw lines of order 1 and 2 above the data, from the coarsest step down."""
    steps = [1000 * row.step for row in rows]
    coarse, fine = max(steps), min(steps)
    top = 3 * max(row.error or 0.0 for row in rows)
    for order in (1, 2):
        end, middle = (top * (step / coarse) ** order for step in (fine, math.sqrt(coarse * fine)))
        axes.plot([coarse, fine], [top, end], color=QUIET, linewidth=0.8, linestyle=":")
        axes.annotate(
            f"order {order}", (math.sqrt(coarse * fine), middle), (-4, 3), ha="right",
            textcoords="offset points", fontsize=7.5, color=QUIET,
        )  # fmt: skip

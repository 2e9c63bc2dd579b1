"""Convergence of a scenario over the communication step, for each coupling algorithm.

Each algorithm runs at h, h/2, h/4, ...; instances with their own step size keep it. The error of a run is the
largest difference from the finest run of the first algorithm, over the communication points of the coarsest
run, relative to the signal's peak. The observed order at h is log2(|x_h - x_h/2| / |x_h/2 - x_h/4|) with the
same norm: it needs no exact solution, and compares an algorithm only with itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from yawbench.figures.style import QUIET, frame, line_style, new_figure
from yawbench.fmus.fmu import Value as Plain
from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.metrics.expressions import MetricValue, while_moving
from yawbench.metrics.measures import variable_of, words
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.signal_names import SignalName
from yawbench.planner import Planner
from yawbench.vehicles.motion import largest

from .experiment import LoadedExperiment, NamedRun, experiment_of
from .experiment_result import ExperimentResult
from .tables import Cell, Table, number_column, text_column

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


ROUNDING = 1e-13
"""Relative difference that a different order of summation can cause."""


@dataclass(frozen=True)
class ConvergenceRow:
    """One run of a convergence study: algorithm, step [s], error, order and cost; None where undefined."""

    algorithm: str
    step: float
    error: float | None  # relative to the signal's peak
    order: float | None
    wall_time: float | None  # [s]
    failed: str = ""
    finest: bool = False  # the reference of all others


def refinements(
    scenario: Path,
    *,
    halvings: int,
    signal: str,
    algorithms: Sequence[str],
    changes: Sequence[Override] = (),
) -> LoadedExperiment:
    """Return the runs of a convergence study: all steps of the first algorithm, then the next.

    Raises:
        ScenarioError: the scenario or an option is wrong.
    """
    loaded = Planner().load(scenario, changes)
    if not all(SignalName.parse(signal)):
        raise ScenarioError(
            f"--signal {signal}: write INSTANCE.VARIABLE, for example plant.yaw_rate", code="option-invalid"
        )
    runs = []
    for algorithm in algorithms or [loaded.algorithm]:
        for k in range(halvings + 1):
            step = float(loaded.step_size / 2**k)
            values: dict[str, Plain] = {"algorithm": algorithm, "step_size": step}
            refined = tuple(Override.of(target, value, "converge") for target, value in values.items())
            name = f"{algorithm}/{_milliseconds(step).replace(' ', '')}"
            label = f"{algorithm}, {_milliseconds(step)}"
            runs.append(NamedRun(name, label, label, scenario, refined))
    return experiment_of(scenario, runs, changes=changes, title=f"Convergence of {signal}, {scenario.stem}")


def _milliseconds(step: float) -> str:
    return f"{1000 * step:.10g} ms"


def measure(findings: ExperimentResult, signal: str) -> list[ConvergenceRow]:
    """Compute error, observed order and cost of every run from its results.

    Raises:
        ResultsError: the signal is zero throughout.
    """
    by_algorithm: dict[str, list[NamedRun]] = {}
    for run in findings.experiment.runs.values():
        by_algorithm.setdefault(str(_given(run, "algorithm")), []).append(run)
    finest = next(iter(by_algorithm.values()))[-1]
    failed = {case.run.name: findings.record(case).reason or "" for case in findings.experiment.cases}
    samples: dict[str, np.ndarray] = {}
    for name, results in findings.results.items():
        number = np.issubdtype(results[signal].dtype, np.number)
        failed[name] = "" if number else f"{signal} is not a number"
        if number:
            samples[name] = while_moving(results)[signal]
    reference = samples.get(finest.name)
    peak = math.nan if reference is None else largest(reference) or 0.0
    if peak == 0:
        raise ResultsError(f"{signal} is zero throughout: choose another --signal.", code="signal-zero")
    rows = []
    for algorithm, runs in by_algorithm.items():
        coarse = [_common(samples.get(run.name), k) for k, run in enumerate(runs)]
        target = _common(reference, len(runs) - 1)
        steps = [_distance(a, b) for a, b in zip(coarse, [*coarse[1:], None], strict=True)]
        for k, (run, first, after) in enumerate(zip(runs, steps, [*steps[1:], None], strict=True)):
            order = math.log2(first / after) if first and after else None
            distance = None if run is finest else _distance(coarse[k], target)
            error = None if distance is None else distance / peak
            step = float(_given(run, "step_size"))
            cost = findings.results[run.name].record.wall_time if run.name in samples else None
            rows.append(ConvergenceRow(algorithm, step, error, order, cost, failed[run.name], run is finest))
    return rows


def _given(run: NamedRun, setting: str) -> Plain:
    """Return the value that a run's last override of `algorithm` or `step_size` sets."""
    return next(change.plain for change in reversed(run.changes) if str(change.target) == setting)


def _common(x: np.ndarray | None, k: int) -> np.ndarray | None:
    """Return the samples of a run with step h / 2^k at the communication points of the run with h."""
    return None if x is None else x[:: 2**k]


def _distance(a: np.ndarray | None, b: np.ndarray | None) -> float | None:
    """Return the largest difference; 0 if it is within rounding."""
    if a is None or b is None:
        return None
    distance = largest(a - b) or 0.0
    return distance if distance > ROUNDING * (largest(b) or 0.0) else 0.0


def convergence_table(rows: Sequence[ConvergenceRow], title: str) -> Table:
    """Return the table of a convergence study, one row per run."""
    table = Table(title, ["algorithm", "step", "error", "observed order", "wall time"])
    for row in rows:
        error: Cell = None if row.error is None else MetricValue(row.error, "1")
        if row.failed or row.finest:
            error = f"failed: {row.failed}" if row.failed else "the finest"
        order = MetricValue(row.order, "1") if row.order is not None else None
        cost = MetricValue(row.wall_time, "s") if row.wall_time is not None else None
        table.rows.append([row.algorithm, _milliseconds(row.step), error, order, cost])
    return table


def columns_of(rows: Sequence[ConvergenceRow]) -> Table:
    """Return the rows as columns, in SI units."""
    return Table.of_columns(
        [
            text_column("algorithm", (row.algorithm for row in rows)),
            number_column("step_size", "s", (row.step for row in rows)),
            number_column("error", "1", (row.error for row in rows)),
            number_column("order", "1", (row.order for row in rows)),
            number_column("wall_time", "s", (row.wall_time for row in rows)),
            text_column("failed", (row.failed for row in rows)),
        ]
    )


def convergence_figure(rows: Sequence[ConvergenceRow], signal: str, title: str, note: str) -> Figure:
    """Draw error over step and error over cost, on logarithmic axes, with reference slopes 1 and 2.

    Raises:
        ResultsError: no run has an error above zero.
    """
    from matplotlib.lines import Line2D
    from matplotlib.ticker import LogLocator

    drawn = [row for row in rows if row.error and row.wall_time]
    if not drawn:
        raise ResultsError("nothing to draw: no two runs differ.", code="nothing-to-draw")
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
        name = words(variable_of(signal))
        for axes, heading, below in (
            (by_step, f"{name}: largest error, relative to its peak", "communication step in ms"),
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


def _slopes(axes: Axes, rows: Sequence[ConvergenceRow]) -> None:
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

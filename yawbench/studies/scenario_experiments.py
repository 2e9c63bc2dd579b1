"""Experiments made of one scenario: comparisons of FMUs, convergence over the step, series of standard tests.

A comparison has one named run for every combination of the swapped FMUs.

A convergence study runs each coupling algorithm at h, h/2, h/4, ...; instances with their own step size
keep it. The error of a run is the largest difference from the finest run of the first algorithm, over
the communication points of the coarsest run, relative to the signal's peak. The observed order at h is
log2(|x_h - x_h/2| / |x_h/2 - x_h/4|) with the same norm: it needs no exact solution, and compares an
algorithm only with itself.

A standard test decides from run to run what its series needs; a `TestDriver` makes the runs.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from yawbench.figures.style import QUIET, frame, line_style, new_figure
from yawbench.fmus.fmu import Value as Plain
from yawbench.fmus.fmu import is_path
from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.metrics.expressions import MetricValue, metric, while_moving
from yawbench.metrics.measures import variable_of, words
from yawbench.orchestrator.plan import Override, Plan
from yawbench.orchestrator.results.reader import load_results
from yawbench.orchestrator.scenario.loader import LoadedScenario
from yawbench.orchestrator.scenario.overrides import changed, swap_of, with_changes
from yawbench.orchestrator.scenario.quantities import convert
from yawbench.orchestrator.signal_names import SignalName
from yawbench.planner import Planner
from yawbench.proving_ground.sine_with_dwell import AMPLITUDE, SIDES
from yawbench.proving_ground.standard_tests import Evaluation, SeriesRun, StandardTest
from yawbench.proving_ground.steering_tests import SLOW_STEER, slow_steer_amplitude
from yawbench.proving_ground.trace import Trace, trace_of
from yawbench.vehicles.motion import largest

from .claim_schema import text_of
from .executor import Executor, highest_passing, side_by_side
from .experiment import LoadedExperiment, NamedRun, experiment_of
from .experiment_result import ExperimentResult
from .jobs import Job, planned
from .tables import Cell, Table, column, marked, remarks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FIGURES = {
    "overview":
        ("steer_angle", "sideslip", "sideslip_error", "yaw_rate", "acceleration_y", "yaw_moment", "path"),
    "wheel_torques": ("wheel_torque_*",),
}  # fmt: skip
"""Figure name -> panels."""
FIGURE_SPECS = [
    {"name": name, "title": name.replace("_", " ").capitalize(), "runs": ["*"], "panels": [*panels]}
    for name, panels in FIGURES.items()
]
"""Figures, as in an experiment file."""


def comparison(scenario: Path, swaps: Sequence[str], changes: Sequence[Override]) -> LoadedExperiment:
    """Return the experiment that compares a scenario's variants (see `variants`)."""
    runs = variants(scenario, swaps, changes)
    title = Planner().load(scenario, changes).title or scenario.stem
    exchanged = " and ".join(dict.fromkeys(text.partition("=")[0].strip() for text in swaps))
    title = f"{title} ({exchanged} exchanged)"
    return experiment_of(scenario, runs, changes=changes, title=title, figures=FIGURE_SPECS)


def variants(scenario: Path, swaps: Sequence[str], changes: Sequence[Override]) -> list[NamedRun]:
    """Return one run for every combination of the FMUs in `swaps`.

    Args:
        scenario: the scenario file.
        swaps: `instance=fmu,fmu,...`; an instance may be named more than once. An FMU may bring
            parameters, `fmu:parameter=value:parameter=value`, so that it can be compared with itself.
            If every instance has a single FMU, the unchanged scenario is the other variant.
        changes: overrides of all runs.

    Raises:
        ScenarioError: the scenario or an option is wrong, or there is nothing to compare.
    """
    choices = _choices(swaps)
    if all(len(names) == 1 for names in choices.values()):
        swapped = [swap_of(instance, names[0], "--swap")[0] for instance, names in choices.items()]
        own = Planner().load(scenario, [*swapped, *changes]).replaced
        for instance, names in choices.items():
            fmu = str(scenario.absolute().parent / own[instance]) if is_path(own[instance]) else own[instance]
            names[:0] = [fmu] if fmu not in names else []
    named = [instance for instance, names in choices.items() if len(names) > 1]
    if not named:
        raise ScenarioError(
            "nothing to compare: name several FMUs, for example --swap controller=a,b", code="option-invalid"
        )
    runs: list[NamedRun] = []
    for combination in itertools.product(*choices.values()):
        chosen = dict(zip(choices, combination, strict=True))
        label = " + ".join(_label(chosen[instance], choices[instance]) for instance in named)
        repeated = sum(run.label.partition(" (")[0] == label for run in runs)
        label += f" ({repeated + 1})" if repeated else ""
        name = re.sub(r"[^\w.+=-]+", "_", label.replace(" + ", "+")).strip("_")
        if any(run.name == name for run in runs):
            name = f"{name}_{len(runs) + 1}"
        swapped_in = [swap for instance, text in chosen.items() for swap in swap_of(instance, text, "--swap")]
        runs.append(NamedRun(name, label, label, scenario, tuple(swapped_in)))
    return runs


def _choices(swaps: Sequence[str]) -> dict[str, list[str]]:
    """Return instance -> its FMUs, without repetition, in the order of the options."""
    choices: dict[str, list[str]] = {}
    for text in swaps:
        instance, equals, fmus = text.partition("=")
        names = [fmus] if Path(fmus).is_file() else [name.strip() for name in fmus.split(",")]
        if not (instance.strip() and equals and all(names)):
            raise ScenarioError(
                f"--swap {text}: write --swap INSTANCE=FMU or --swap INSTANCE=FMU,FMU,...",
                code="option-invalid",
            )
        known = choices.get(instance.strip(), [])
        choices[instance.strip()] = list(dict.fromkeys([*known, *names]))
    return choices


def _label(text: str, choices: Sequence[str]) -> str:
    """Return the label of a choice: its FMU, unless all share it, and the parameters that differ."""
    fmu, *brought = swap_of("", text, "--swap")
    others = [swap_of("", other, "--swap") for other in choices]
    name = str(fmu.value)
    shared = [change for change in brought if all(change in other for other in others)]
    values = [
        f"{change.target.variable}={text_of(change.value)}" for change in brought if change not in shared
    ]
    one_fmu = all(other[0] == fmu for other in others)
    return " ".join([*([] if one_fmu and values else [Path(name).stem if is_path(name) else name]), *values])


def comparison_table(findings: ExperimentResult) -> Table:
    """Return a table with one row per metric and one column per run."""
    results, runs = findings.results, findings.experiment.runs.values()
    failed = [run.label for run in runs if run.name not in results]
    shown = [run for run in runs if run.name in results]
    words = changed(findings.experiment.by_options)
    notes = [f"changed: {words}"] if words else []
    notes += remarks((run.label, results[run.name]) for run in shown)
    labels = [*(marked(run.label, results[run.name]) for run in shown), *failed]
    table = Table(findings.spec.title, ["metric", "", *labels], notes=notes)
    for key, spec in findings.spec.metrics.items():
        cells: list[Cell] = [findings.values.get((run.name, key)) for run in shown]
        chosen = metric(spec.metric)
        table.rows.append([chosen.title, chosen.formula, *cells, *("failed" for _ in failed)])
    table.notes += [f"{r.label}: {results[r.name].ended}" for r in shown if results[r.name].ended]
    return table


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
    title = with_changes(f"Convergence of {signal}, {scenario.stem}", changes)
    return experiment_of(scenario, runs, changes=changes, title=title)


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
            column("algorithm", "string", [row.algorithm for row in rows]),
            column("step_size", "float64", [row.step for row in rows], {"unit": "s"}),
            column("error", "float64", [row.error for row in rows], {"unit": "1"}),
            column("order", "float64", [row.order for row in rows], {"unit": "1"}),
            column("wall_time", "float64", [row.wall_time for row in rows], {"unit": "s"}),
            column("failed", "string", [row.failed for row in rows]),
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


ORIGIN: Final = "standard test"
"""Origin of the overrides by which a test varies its scenario."""


@dataclass
class TestDriver:
    """Drives the series of a standard test as named runs (see `evaluation.standard_tests.SeriesDriver`).

    Args:
        test: evaluates the runs.
        scenario: of all runs.
        changes: overrides of all runs.
        execute: makes the runs.
        angle: A [rad], of tests that need it.

    Attributes:
        traces, judged: of all runs so far that can be judged.
        status: the largest exit status so far, 0 unless a run failed.
    """

    __test__ = False  # not a pytest class

    test: StandardTest
    scenario: Path
    changes: Sequence[Override]
    execute: Executor
    angle: float | None = None
    traces: list[Trace] = field(default_factory=list)
    judged: list[Evaluation] = field(default_factory=list)
    status: int = 0

    @cached_property
    def _planned(self) -> tuple[LoadedScenario, Plan]:
        base = Job("", self.scenario, self.execute.folder, (*self.changes,), **self.execute.of_jobs)
        return planned(base, self.execute.planner)

    @cached_property
    def speed(self) -> float:
        """Speed of the scenario [m/s].

        Raises:
            ScenarioError: it has none above 0.
        """
        initial = self._planned[0].speed
        speed = 0.0 if initial is None else float(convert(str(initial), "m/s"))
        if speed <= 0.0:
            raise ScenarioError(
                f"{self.scenario}: has no speed above 0, from which the series could start",
                code="fmu-wrong-kind",
            )
        return speed

    @property
    def duration(self) -> float:
        """Duration of the scenario [s]."""
        plan = self._planned[1]
        return float(plan.step * plan.n_steps)

    def make(self, runs: Sequence[SeriesRun]) -> list[Evaluation]:
        """Make runs that have no results yet; return the evaluations of those that can be judged.

        Raises:
            ScenarioError: a run cannot start.
            ResultsError: a run did not record a signal that the test needs.
        """
        named = []
        for run in runs:
            own = (Override.of(target, value, ORIGIN) for target, value in run.values.items())
            named.append(NamedRun(run.folder, run.folder, run.folder, self.scenario, (*self.changes, *own)))
        title = runs[0].label if len(runs) == 1 else self.test.name.replace("-", " ")
        jobs = self.execute.planned(experiment_of(self.scenario, named, title=title)).jobs
        outcomes = self.execute.run(title, jobs, journaled=False)
        failed = [outcome.exit_status for outcome in outcomes if not outcome.ok]
        self.status = max([self.status, *failed])
        made = [(run, job) for run, job in zip(runs, jobs, strict=True) if run.partly or not failed]
        traces = [trace_of(load_results(job.out), run.label) for run, job in made]
        judged = [self.test.evaluate(trace, self.angle) for trace in traces]
        self.traces += traces
        self.judged += judged
        return judged

    def search_highest(self, passes: Callable[[float], bool], **bounds: float) -> None:
        """Search the highest value that passes; `bounds`: see `highest_passing`."""
        search = highest_passing(**bounds)
        side_by_side({"": search}, lambda values: {name: passes(value) for name, value in values.items()})


def slow_steer_runs(scenario: Path, changes: Sequence[Override], execute: Executor) -> list[SeriesRun]:
    """Return runs of slowly increasing steer to both sides, with the scenario's amplitude.

    Raises:
        ScenarioError: the scenario is wrong, or its driver has no amplitude.
    """
    (plan,) = execute.plans([NamedRun("", "", "", scenario, (*changes,))])
    amplitude = slow_steer_amplitude(plan, scenario)
    folders = {f"{SLOW_STEER}/{name}": side for name, side in SIDES}
    return [
        SeriesRun(folder, folder, {AMPLITUDE: side * amplitude}, partly=False)
        for folder, side in folders.items()
    ]

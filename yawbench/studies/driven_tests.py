"""Standard tests: driven, as a test decides from run to run what it needs; and the tables of their runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Final

from yawbench.foundation.errors import ScenarioError, text_of
from yawbench.metrics.expressions import MetricValue
from yawbench.metrics.verdict import worded
from yawbench.orchestrator.plan import Override, Plan
from yawbench.orchestrator.results.reader import load_results
from yawbench.orchestrator.scenario.loader import LoadedScenario
from yawbench.orchestrator.scenario.quantities import convert
from yawbench.proving_ground.sine_with_dwell import AMPLITUDE, SIDES
from yawbench.proving_ground.standard_tests import (
    Evaluation,
    SeriesRun,
    StandardTest,
    TestQuantity,
    TestSeries,
)
from yawbench.proving_ground.steady_state_steering import SLOW_STEER, slow_steer_amplitude
from yawbench.proving_ground.trace import Trace, trace_of

from .executor import Executor
from .experiment import NamedRun, experiment_of
from .jobs import Job, planned
from .limit_search import highest_passing, side_by_side
from .tables import Cell, Table

ORIGIN: Final = "standard test"
"""Origin of the overrides by which a test varies its scenario."""


@dataclass
class TestDriver:
    """Drives the series of a standard test as named runs (see `proving_ground.standard_tests.SeriesDriver`).

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
        speed = 0.0 if initial is None else float(convert(str(initial.value), "m/s"))
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

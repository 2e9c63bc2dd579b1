"""The series of runs that standard tests consist of, as named runs of experiments."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Final

from ..errors import ScenarioError
from ..evaluation.sine_with_dwell import AMPLITUDE, SIDES
from ..evaluation.standard_tests import Evaluation, SeriesRun, StandardTest
from ..evaluation.trace import Trace, trace_of
from ..plan import Override, Plan
from ..results.reader import load_results
from ..scenario.loader import LoadedScenario
from ..scenario.quantities import convert
from ..signal_names import Target
from .executor import Executor, highest_passing, side_by_side
from .experiment import NamedRun
from .jobs import Job, planned

SLOW_STEER = "slowly_increasing_steer"
"""Folder of the runs of slowly increasing steer."""
ORIGIN: Final = "standard test"
"""Origin of the overrides by which a test varies its scenario."""


@dataclass
class TestDriver:
    """Drives the series of a standard test as named runs (see `evaluation.standard_tests.SeriesDriver`).

    Args:
        test: evaluates the runs.
        scenario: of all runs.
        changes: overrides of all runs.
        execute: makes plans.
        make_runs: called with a title and runs; executes those without results; returns their jobs and the
            exit status, not 0 if one of them failed.
        angle: A [rad], of tests that need it.

    Attributes:
        traces, judged: of all runs so far that can be judged.
        status: the largest exit status so far.
    """

    __test__ = False  # not a pytest class

    test: StandardTest
    scenario: Path
    changes: Sequence[Override]
    execute: Executor
    make_runs: Callable[[str, Sequence[NamedRun]], tuple[list[Job], int]]
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
            named.append(_run(run.folder, self.scenario, self.changes, *own))
        title = runs[0].label if len(runs) == 1 else self.test.name.replace("-", " ")
        jobs, status = self.make_runs(title, named)
        self.status = max(self.status, status)
        made = [(run, job) for run, job in zip(runs, jobs, strict=True) if run.partly or not status]
        new = [replace(traces([job])[0], label=run.label) for run, job in made]
        judged = [self.test.evaluate(trace, self.angle) for trace in new]
        self.traces += new
        self.judged += judged
        return judged

    def search_highest(self, passes: Callable[[float], bool], **bounds: float) -> None:
        """Search the highest value that passes; `bounds`: see `highest_passing`."""
        search = highest_passing(**bounds)
        side_by_side({"": search}, lambda values: {name: passes(value) for name, value in values.items()})


def slow_steer_runs(scenario: Path, changes: Sequence[Override], execute: Executor) -> list[NamedRun]:
    """Return runs of slowly increasing steer to both sides, with the scenario's amplitude.

    Raises:
        ScenarioError: the scenario is wrong, or its driver has no amplitude.
    """
    (plan,) = execute.plans([NamedRun("", "", "", scenario, (*changes,))])
    amplitude = slow_steer_amplitude(plan, scenario)
    return [
        _run(f"{SLOW_STEER}/{name}", scenario, changes, Override.of(AMPLITUDE, side * amplitude, ORIGIN))
        for name, side in SIDES
    ]


def traces(jobs: Sequence[Job]) -> list[Trace]:
    """Return the recorded signals of runs, labelled by their jobs.

    Raises:
        ResultsError: a run has no results.
    """
    return [replace(trace_of(load_results(job.out)), label=job.label) for job in jobs]


def _run(name: str, scenario: Path, changes: Sequence[Override], *own: Override) -> NamedRun:
    """Return a named run of a series; `own`: its overrides in addition to those of all runs."""
    return NamedRun(name, name, name, scenario, (*changes, *own))


def slow_steer_amplitude(plan: Plan, scenario: Path) -> float:
    """Return the absolute amplitude of the driver in a plan of slowly increasing steer [rad].

    Raises:
        ScenarioError: the driver has none; names the scenario.
    """
    target = Target.parse(AMPLITUDE)
    for instance in plan.instances:
        value = instance.parameter(target.variable) if instance.name == target.instance else None
        if isinstance(value, (int, float)) and value != 0:
            return abs(float(value))
    raise ScenarioError(
        f"{scenario}: {AMPLITUDE} must be a non-zero hand-wheel amplitude", code="fmu-wrong-kind"
    )

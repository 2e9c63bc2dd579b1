"""The highest clean entry speed of a lane change as one experiment: a run per speed, each from the last ones.

Results stay on disk, so a series that was stopped goes on where it was (`dwell_experiment`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import ScenarioError
from ..evaluation.judgement import Judgement, Verdict
from ..evaluation.lane_change_run import evaluate_lane_change
from ..evaluation.lane_change_series import CLEAN, EntrySpeedSeries, highest_clean, judge_entry_speeds
from ..evaluation.trace import Trace, trace_of
from ..plan import Change
from ..results.read import load_results
from ..scenario.quantities import convert
from .dwell_experiment import planned_alike
from .jobs import Job, Once, planned

KMH = 1.0 / 3.6
STEP, RESOLUTION = 10.0 * KMH, 0.5 * KMH
"""Steps to the first speeds, and difference of speeds that is left in the end [m/s]."""
LEAST, MOST = 10.0 * KMH, 250.0 * KMH
"""Speeds between which is sought [m/s]."""
PLACE = "speed"
"""What is varied: the speed of the scenario [m/s]."""


Make = Callable[[Job], bool]
"""Makes a run unless it has been made already; returns whether there are results of it."""


@dataclass(frozen=True)
class EntrySpeedExperiment:
    """Which scenario is driven at many speeds, and what is changed in all of its runs."""

    scenario: Path
    folder: Path  # of all results
    changes: tuple[Change, ...] = ()
    fmus: Path | None = None
    format: str = "parquet"
    call_limit: float | None = None

    def __post_init__(self) -> None:
        if any(change.place in (PLACE, "stop_time") for change in self.changes):
            raise ScenarioError(f"{PLACE} and stop_time: the series itself says at what speeds is driven")

    def _job(self, name: str, *more: Change) -> Job:
        return Job(
            name, self.scenario, self.folder / name, (*self.changes, *more), self.fmus,
            format=self.format, call_limit=self.call_limit,
        )  # fmt: skip

    def at(self, speed: float, once: Once) -> Job:
        """Return the run at a speed [m/s], long enough for it.

        Raises:
            ScenarioError: it cannot start, or the scenario tells no speed.
        """
        first, seconds = self.first(once)
        more = (
            Change(PLACE, speed, "entry speed"),
            Change("stop_time", math.ceil(10.0 * seconds * first / speed) / 10.0, "entry speed"),
        )
        return planned_alike([self._job(f"{speed / KMH:.2f}", *more)], once)[0]

    def first(self, once: Once) -> tuple[float, float]:
        """Return the scenario's own speed [m/s] and duration [s].

        Raises:
            ScenarioError: it cannot start, or tells no speed.
        """
        scenario, plan = planned(self._job("as_given"), once)
        speed = 0.0 if scenario.speed is None else float(convert(str(scenario.speed), "m/s"))
        if speed <= 0.0:
            raise ScenarioError(f"{self.scenario}: tells no speed above 0, from which the series could begin")
        return speed, float(plan.step * plan.n_steps)

    def driven(self, once: Once, make: Make) -> tuple[list[Trace], EntrySpeedSeries]:
        """Make the runs that lead to the highest clean entry speed; return them and what they come to.

        Raises:
            ScenarioError: they cannot start.
            ResultsError: a run has not recorded what it needs.
        """
        traces: list[Trace] = []
        judged: list[Judgement] = []

        def clean(speed: float) -> bool:
            job = self.at(speed, once)
            if not make(job):
                return False
            traces.append(replace(trace_of(load_results(job.out)), label=f"{job.label} km/h"))
            judged.append(evaluate_lane_change(traces[-1]))
            return judged[-1].rulings[CLEAN].verdict is Verdict.PASSED

        first, _ = self.first(once)
        highest_clean(clean, first=first, step=STEP, resolution=RESOLUTION, least=LEAST, most=MOST)
        return traces, judge_entry_speeds(judged)

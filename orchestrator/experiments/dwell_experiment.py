"""The whole series of sine with dwell as one experiment: slowly increasing steer, A, the amplitudes.

Results stay on disk, so a series that was stopped goes on where it was: what has been made already, of the
same scenario, FMUs and program, is not made again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import ScenarioError
from ..evaluation.dwell_series import amplitudes
from ..evaluation.judgement import Judgement
from ..evaluation.slow_steer import evaluate_slow_steer
from ..evaluation.trace import Trace, trace_of
from ..plan import Change
from ..results.read import load_results
from .jobs import Job, Once, keyed, ready

PLACE = "driver.amplitude"
"""What is varied: the amplitude of the hand wheel [rad], positive to the left."""
SIDES = (("left", 1.0), ("right", -1.0))


@dataclass(frozen=True)
class DwellExperiment:
    """Which scenarios make up a series, and what is changed in all of their runs."""

    scenario: Path  # sine with dwell
    slow_steer: Path
    folder: Path  # of all results
    changes: tuple[Change, ...] = ()
    fmus: Path | None = None
    format: str = "parquet"
    call_limit: float | None = None

    def __post_init__(self) -> None:
        if any(change.place == PLACE for change in self.changes):
            raise ScenarioError(f"{PLACE}: the series itself says which amplitudes are driven")

    def _job(self, scenario: Path, name: str, *more: Change) -> Job:
        return Job(
            name, scenario, self.folder / name, (*self.changes, *more), self.fmus,
            format=self.format, call_limit=self.call_limit,
        )  # fmt: skip

    def slow_steer_jobs(self, once: Once) -> list[Job]:
        """Return the runs of slowly increasing steer, as the scenario has it and to the other side.

        Raises:
            ScenarioError: they cannot start, or the driver has no amplitude.
        """
        first = planned_alike([self._job(self.slow_steer, "slowly_increasing_steer/as_given")], once)[0]
        given = amplitude_of(first)
        jobs = [
            self._job(
                self.slow_steer,
                f"slowly_increasing_steer/{name}",
                Change(PLACE, side * abs(given), "slowly increasing steer"),
            )
            for name, side in SIDES
        ]
        return planned_alike(jobs, once)

    def ladder(self, angle: float, once: Once) -> list[Job]:
        """Return the runs of sine with dwell for A [rad], left first and right first.

        Raises:
            ScenarioError: they cannot start.
        """
        jobs = [
            self._job(
                self.scenario,
                f"{name}_first/{math.degrees(amplitude):.2f}",
                Change(PLACE, side * amplitude, "sine with dwell"),
            )
            for name, side in SIDES
            for amplitude in amplitudes(angle)
        ]
        return planned_alike(jobs, once)


def planned_alike(jobs: Sequence[Job], once: Once) -> list[Job]:
    """Return jobs with plans and keys; a problem that all have is told once."""
    return [keyed(job) for job in ready(jobs, once=once, place=lambda problem: (str(problem), problem))]


def amplitude_of(job: Job) -> float:
    """Return the amplitude that a job's driver is given [rad].

    Raises:
        ScenarioError: it has none.
    """
    assert job.plan is not None
    unit, _, name = PLACE.partition(".")
    for one in job.plan.units:
        if one.name == unit and name in one.fmu.variables:
            value = one.parameters.get(name, one.fmu.variables[name].start)
            if isinstance(value, (int, float)) and value != 0:
                return float(value)
    raise ScenarioError(f"{job.scenario}: {PLACE} is no amplitude of a hand wheel other than 0")


def traces(jobs: Sequence[Job]) -> list[Trace]:
    """Return what runs have recorded, each called by its folder.

    Raises:
        ResultsError: a run has left none.
    """
    return [replace(trace_of(load_results(job.out)), label=job.label) for job in jobs]


def slow_steer_of(jobs: Sequence[Job]) -> list[Judgement]:
    """Return what runs of slowly increasing steer come to."""
    return [evaluate_slow_steer(trace) for trace in traces(jobs)]

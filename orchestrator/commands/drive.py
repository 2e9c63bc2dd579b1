"""`yawbench drive`: all runs that a standard test asks for, made and evaluated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .batch import Jobs
from .options import CallLimit, Fault, Fmus, Fresh, Isolate, NoBuild, Out, Set, Swap, isolation

if TYPE_CHECKING:
    from ..experiments.dwell_experiment import DwellExperiment
    from ..experiments.entry_speed_experiment import EntrySpeedExperiment
    from ..experiments.jobs import Job, Once
    from ..plan import Change

    Make = Callable[[str, Sequence[Job]], int]
    """Makes runs that have not been made, under a title; returns the exit status."""

GROUND = "proving_ground"
"""Folder of the scenarios of standard tests."""


class Driven(str, Enum):
    """Tests of many runs."""

    sine_with_dwell = "sine-with-dwell"
    iso_3888_1 = "iso-3888-1"
    iso_3888_2 = "iso-3888-2"


Which = Annotated[Driven, typer.Argument(help="The test.", metavar="TEST")]
Scenario = Annotated[
    str | None,
    typer.Option(
        "--scenario", metavar="SCENARIO", help="Scenario of one run; default: the test's in proving_ground."
    ),
]
Slow = Annotated[
    str | None,
    typer.Option(
        "--slow-steer",
        metavar="SCENARIO",
        help="Scenario of slowly increasing steer, for A; default: proving_ground/slowly_increasing_steer.",
    ),
]
Vehicle = Annotated[
    str | None,
    typer.Option("--vehicle", metavar="FILE", help="Vehicle file, or the name of one as in list."),
]
Angle = Annotated[
    str | None,
    typer.Option("--angle", metavar="ANGLE", help="A in place of runs that find it, such as '35.8 deg'."),
]
Figures = Annotated[bool, typer.Option("--figures", help="Draw every run, not the series alone.")]


def drive(
    context: typer.Context,
    test: Which,
    swap: Swap = None,
    set_: Set = None,
    fault: Fault = None,
    vehicle: Vehicle = None,
    scenario: Scenario = None,
    slow_steer: Slow = None,
    angle: Angle = None,
    out: Out = None,
    fmus: Fmus = None,
    no_build: NoBuild = False,
    jobs: Jobs = None,
    figures: Figures = False,
    fresh: Fresh = False,
    isolate: Isolate = False,
    call_limit: CallLimit = None,
) -> None:
    """Drive a standard test with all its runs and evaluate it.

    Sine with dwell: slowly increasing steer to both sides gives A, from which the amplitudes follow, left
    first and right first. Without --out, results go to results/<folder of the scenario>/<its name>_series.
    An interrupted series goes on where it was; nothing that is finished is run again. Of a car that rolls
    over, what it has recorded until then is judged, as far as it goes.

    Lane changes of ISO 3888: the highest speed at the first cones at which no cone is touched, to half a
    kilometre per hour, from the scenario's own speed in steps and halves.
    """
    from ..errors import ScenarioError
    from ..experiments.dwell_experiment import DwellExperiment
    from ..experiments.entry_speed_experiment import EntrySpeedExperiment
    from ..experiments.jobs import Once
    from ..results.naming import default_folder
    from ..scenario import catalogue
    from ..scenario.overrides import read_changes
    from .batch import hold

    changes = (*_vehicle(vehicle), *read_changes(swap or (), set_ or (), fault or ()))
    one_run = catalogue.find(scenario or f"{GROUND}/{test.name}", "a scenario")
    folder = out or default_folder(one_run, changes, suffix="_series")
    limit = isolation(isolate, call_limit)
    if test is not Driven.sine_with_dwell and (angle or slow_steer):
        raise ScenarioError(f"{test.value} needs no A: leave --angle and --slow-steer away")

    def make(title: str, runs: Sequence[Job]) -> int:
        return _make(title, runs, folder, jobs, fresh=fresh)

    once = Once(build=not no_build)
    if test is Driven.sine_with_dwell:
        slow = catalogue.find(slow_steer or f"{GROUND}/slowly_increasing_steer", "a scenario")
        dwell = DwellExperiment(one_run, slow, folder, changes, fmus, call_limit=limit)
        hold(context, folder)
        status = _drive_dwell(dwell, once, angle, make, figures=figures)
    else:
        speeds = EntrySpeedExperiment(one_run, folder, changes, fmus, call_limit=limit)
        hold(context, folder)
        status = _drive_lane_change(speeds, once, make, figures=figures)
    if status:
        raise typer.Exit(status)


def _drive_dwell(
    experiment: DwellExperiment, once: Once, angle: str | None, make: Make, *, figures: bool
) -> int:
    """Make and evaluate the series of sine with dwell; return the exit status.

    Raises:
        ResultsError: A is not known.
        typer.Exit: slowly increasing steer has failed.
    """
    import math

    from ..errors import ResultsError
    from ..evaluation.dwell_series import judge_series
    from ..evaluation.judgement import NotJudged
    from ..evaluation.slow_steer import characteristic_angle
    from ..evaluation.standard_tests import TESTS
    from ..experiments.dwell_experiment import slow_steer_of, traces
    from .batch import say
    from .evaluate import angle_of, conclude

    chosen = TESTS[Driven.sine_with_dwell.value]
    known = angle_of(angle)
    if known is None:
        found = experiment.slow_steer_jobs(once)
        if status := make("slowly increasing steer", found):
            raise typer.Exit(status)
        try:
            known = characteristic_angle(slow_steer_of(found))
        except NotJudged as why:
            raise ResultsError(str(why)) from None
    ladder = experiment.ladder(known, once)
    say(f"A = {math.degrees(known):.1f} degrees: {len(ladder)} runs")
    status = make("sine with dwell", ladder)
    evaluated = [chosen.evaluate(trace, known) for trace in traces(ladder)]
    series = judge_series([one.judged for one in evaluated], known)
    conclude(chosen, evaluated, series, known, experiment.folder, each=figures)
    return status


def _drive_lane_change(experiment: EntrySpeedExperiment, once: Once, make: Make, *, figures: bool) -> int:
    """Make and evaluate the runs to the highest clean entry speed; return the exit status."""
    from ..evaluation.standard_tests import TESTS
    from .evaluate import conclude

    chosen = TESTS["lane-change"]
    failed: list[int] = []

    def made(job: Job) -> bool:
        status = make(f"{job.label} km/h", [job])
        failed.extend([status] if status else [])
        return not status

    traces, series = experiment.driven(once, made)
    evaluated = [chosen.evaluate(trace, None) for trace in traces]
    conclude(chosen, evaluated, series, None, experiment.folder, each=figures)
    return max(failed, default=0)


def _vehicle(given: str | None) -> tuple[Change, ...]:
    """Return the change of the vehicle file.

    Raises:
        ScenarioError: there is no such file.
    """
    from ..plan import Change
    from ..scenario import catalogue

    if given is None:
        return ()
    return (Change("vehicle", str(catalogue.find(given, "a vehicle file").resolve()), "--vehicle"),)


def _make(title: str, jobs: Sequence[Job], folder: Path, workers: int | None, *, fresh: bool) -> int:
    """Make the runs that are left; return the exit status, not 0 if one of them failed.

    Raises:
        typer.Exit: Ctrl-C.
    """
    from ..experiments.execution import left_to_do
    from ..experiments.workers import execute
    from .batch import reported, say, stoppable

    left = jobs if fresh else left_to_do(jobs, {})
    if done := len(jobs) - len(left):
        say(f"{title}: {done} of {len(jobs)} runs finished before")
    with stoppable(folder), reported(title, len(left)) as told:
        outcomes = execute(left, workers=workers, done=told)
    return max((one.exit_status for one in outcomes if not one.ok), default=0)

"""`yawbench drive`: all runs that a standard test asks for, made and evaluated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from .batch import hold, make, say, stoppable
from .options import CHANGES, MAKING, Wishes, takes

if TYPE_CHECKING:
    from ..experiments.jobs import Job, Once
    from ..plan import Change

GROUND = "proving_ground"
"""Folder of the scenarios of standard tests."""

Which = Annotated[
    Literal["sine-with-dwell", "iso-3888-1", "iso-3888-2"], typer.Argument(help="The test.", metavar="TEST")
]
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


@takes(*CHANGES, *MAKING, "jobs", "fresh")
def drive(
    context: typer.Context,
    test: Which,
    wishes: Wishes,
    vehicle: Vehicle = None,
    scenario: Scenario = None,
    slow_steer: Slow = None,
    angle: Angle = None,
    figures: Figures = False,
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
    from ..experiments.driven_series import AMPLITUDE, SPEED
    from ..experiments.jobs import Job, Once
    from ..results.naming import default_folder
    from ..scenario import catalogue

    changes = (*_vehicle(vehicle), *wishes.changes)
    one_run = catalogue.find(scenario or f"{GROUND}/{test.replace('-', '_')}", "a scenario")
    folder = wishes.out or default_folder(one_run, changes, suffix="_series")
    base = Job("", one_run, folder, changes, **wishes.of_jobs | {"format": "parquet"})
    once = Once(build=wishes.build)
    given = {change.place for change in changes}
    if test == "sine-with-dwell":
        if AMPLITUDE in given:
            raise ScenarioError(f"{AMPLITUDE}: the series itself says which amplitudes are driven")
        slow = catalogue.find(slow_steer or f"{GROUND}/slowly_increasing_steer", "a scenario")
        hold(context, folder)
        status = _drive_dwell(base, slow, once, angle, wishes, figures=figures)
    else:
        if angle or slow_steer:
            raise ScenarioError(f"{test} needs no A: leave --angle and --slow-steer away")
        if given & {SPEED, "stop_time"}:
            raise ScenarioError(f"{SPEED} and stop_time: the series itself says at what speeds is driven")
        hold(context, folder)
        status = _drive_lane_change(base, once, wishes, figures=figures)
    if status:
        raise typer.Exit(status)


def _drive_dwell(
    base: Job, slow: Path, once: Once, angle: str | None, wishes: Wishes, *, figures: bool
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
    from ..evaluation.slow_steer import characteristic_angle, evaluate_slow_steer
    from ..evaluation.standard_tests import TESTS
    from ..experiments.driven_series import dwell_jobs, slow_steer_jobs, traces
    from .evaluate import Evaluation, angle_of

    chosen = TESTS["sine-with-dwell"]
    known = angle_of(angle)
    if known is None:
        name = "slowly_increasing_steer"
        found = slow_steer_jobs(replace(base, label=name, scenario=slow, out=base.out / name), once)
        if status := _make("slowly increasing steer", found, base, wishes):
            raise typer.Exit(status)
        try:
            known = characteristic_angle([evaluate_slow_steer(trace) for trace in traces(found)])
        except NotJudged as why:
            raise ResultsError(str(why)) from None
    say(f"A = {math.degrees(known):.1f} degrees")
    ladder = dwell_jobs(base, known, once)
    status = _make("sine with dwell", ladder, base, wishes)
    recorded = traces(ladder)
    judged = [chosen.evaluate(trace, known) for trace in recorded]
    series = judge_series(judged, known)
    Evaluation(chosen, recorded, judged, series, known, base.out).conclude(each=figures)
    return status


def _drive_lane_change(base: Job, once: Once, wishes: Wishes, *, figures: bool) -> int:
    """Make and evaluate the runs to the highest clean entry speed; return the exit status."""
    from ..evaluation.standard_tests import TESTS
    from ..experiments.driven_series import entry_speeds
    from .evaluate import Evaluation

    chosen = TESTS["lane-change"]
    failed: list[int] = []

    def made(job: Job) -> bool:
        status = _make(f"{job.label} km/h", [job], base, wishes)
        failed.extend([status] if status else [])
        return not status

    traces, series = entry_speeds(base, once, made)
    judged = [chosen.evaluate(trace) for trace in traces]
    Evaluation(chosen, traces, judged, series, None, base.out).conclude(each=figures)
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


def _make(title: str, jobs: Sequence[Job], base: Job, wishes: Wishes) -> int:
    """Make the runs that are left; return the exit status, not 0 if one of them failed.

    Raises:
        typer.Exit: Ctrl-C.
    """
    with stoppable(base.out):
        outcomes = make(title, jobs, wishes)
    return max((one.exit_status for one in outcomes if not one.ok), default=0)

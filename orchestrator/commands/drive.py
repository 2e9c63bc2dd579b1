"""`yawbench drive`: all runs that a standard test asks for, made and evaluated."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .batch import Jobs
from .options import CallLimit, Fault, Fmus, Fresh, Isolate, NoBuild, Out, Set, Swap, isolation

if TYPE_CHECKING:
    from ..experiments.jobs import Job
    from ..plan import Change


class Driven(str, Enum):
    """Tests of many runs."""

    sine_with_dwell = "sine-with-dwell"


Which = Annotated[Driven, typer.Argument(help="The test.", metavar="TEST")]
Scenario = Annotated[
    str,
    typer.Option("--scenario", metavar="SCENARIO", help="Scenario of one run of the test."),
]
Slow = Annotated[
    str,
    typer.Option("--slow-steer", metavar="SCENARIO", help="Scenario of slowly increasing steer, for A."),
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
    scenario: Scenario = "proving_ground/sine_with_dwell",
    slow_steer: Slow = "proving_ground/slowly_increasing_steer",
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
    """
    import math

    from ..errors import ResultsError
    from ..evaluation.dwell_series import judge_series
    from ..evaluation.judgement import NotJudged
    from ..evaluation.slow_steer import characteristic_angle
    from ..evaluation.standard_tests import TESTS
    from ..experiments.dwell_experiment import DwellExperiment, slow_steer_of, traces
    from ..experiments.jobs import Once
    from ..results.naming import default_folder
    from ..scenario import catalogue
    from ..scenario.overrides import read_changes
    from .batch import hold, say
    from .evaluate import angle_of, conclude

    changes = (*_vehicle(vehicle), *read_changes(swap or (), set_ or (), fault or ()))
    one_run = catalogue.find(scenario, "a scenario")
    folder = out or default_folder(one_run, changes, suffix="_series")
    limit = isolation(isolate, call_limit)
    experiment = DwellExperiment(
        one_run, catalogue.find(slow_steer, "a scenario"), folder, changes, fmus, call_limit=limit
    )
    hold(context, folder)
    once = Once(build=not no_build)
    chosen = TESTS[test.value]
    known = angle_of(angle)
    if known is None:
        found = experiment.slow_steer_jobs(once)
        if status := _make("slowly increasing steer", found, folder, jobs, fresh=fresh):
            raise typer.Exit(status)
        try:
            known = characteristic_angle(slow_steer_of(found))
        except NotJudged as why:
            raise ResultsError(str(why)) from None
    ladder = experiment.ladder(known, once)
    say(f"A = {math.degrees(known):.1f} degrees: {len(ladder)} runs")
    status = _make("sine with dwell", ladder, folder, jobs, fresh=fresh)
    evaluated = [chosen.evaluate(trace, known) for trace in traces(ladder)]
    series = judge_series([one.judged for one in evaluated], known)
    conclude(chosen, evaluated, series, known, folder, each=figures)
    if status:
        raise typer.Exit(status)


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

"""`yawbench drive`: make all runs of a standard test and evaluate them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from yawbench.commands.evaluate import DRIVE, EvaluatedRuns, angle_of
from yawbench.commands.json_and_latex import tabular
from yawbench.commands.options import CHANGES, MAKING, RunOptions, executor_of, takes
from yawbench.commands.strict_and_junit import judging
from yawbench.commands.terminal_progress import hold, say, stoppable
from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.metrics.verdict import NotJudged
from yawbench.proving_ground.standard_tests import DRIVEN, TESTS

if TYPE_CHECKING:
    from yawbench.orchestrator.plan import Override
    from yawbench.studies.executor import Executor

GROUND = "proving_ground"
"""Folder of the standard tests' scenarios."""
DrivenName = Literal[tuple(DRIVEN)]  # type: ignore[valid-type]
TestToDrive = Annotated[DrivenName, typer.Argument(help="The test.", metavar="TEST")]  # type: ignore[valid-type]
ScenarioOption = Annotated[
    str | None,
    typer.Option(
        "--scenario",
        metavar="SCENARIO",
        help="Scenario of a single run. Default: that of the test in proving_ground.",
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
StartAngle = Annotated[
    str | None,
    typer.Option(
        "--angle",
        metavar="ANGLE",
        help="A (hand-wheel angle at 0.3 g), such as '35.8 deg'; default: measured by runs.",
    ),
]
DriveFigures = Annotated[bool, typer.Option("--figures", help="Also draw every run.")]


@tabular
@judging
@takes(*CHANGES, *MAKING, "jobs", "fresh")
def drive(
    context: typer.Context,
    test: TestToDrive,
    options: RunOptions,
    scenario: ScenarioOption = None,
    slow_steer: Slow = None,
    angle: StartAngle = None,
    figures: DriveFigures = False,
) -> None:
    """Make all runs of a standard test and evaluate them.

    Sine with dwell: slowly increasing steer to both sides gives the angle A, which determines the
    amplitudes, driven left first and right first. If the car rolls over, the run is judged up to then.

    Lane changes of ISO 3888: finds the highest entry speed without touching a cone, to half a kilometre
    per hour, starting at the scenario's speed.

    Without --out, results go to results/<folder of the scenario>/<its name>_series. An interrupted series
    is resumed; finished runs are not repeated.
    """
    from yawbench.orchestrator.results.folder_names import default_folder
    from yawbench.orchestrator.scenario import catalogue
    from yawbench.studies.driven_tests import TestDriver

    chosen = DRIVEN[test]
    changes = options.changes
    one_run = catalogue.find(scenario or f"{GROUND}/{str(test).replace('-', '_')}", "a scenario")
    folder = options.out or default_folder(one_run, changes, suffix="_series")
    execute = context.with_resource(executor_of(folder, str(one_run), options, format="parquet"))
    if (angle or slow_steer) and not chosen.needs_angle:
        raise ScenarioError(f"{test} takes no A: omit --angle and --slow-steer", code="option-invalid")
    for change in changes:
        if str(change.target) in chosen.varies:
            why = "set by the series itself"
            raise ScenarioError(f"{change.target}: {why}", code="option-invalid")
    steer = f"{GROUND}/slowly_increasing_steer"
    slow = catalogue.find(slow_steer or steer, "a scenario") if chosen.needs_angle else None
    hold(context, folder)
    known = None
    if slow:
        known = angle_of(angle) or _angle_driven(slow, changes, execute)
        say(f"A = {math.degrees(known):.1f} degrees")
    driver = TestDriver(chosen, one_run, changes, execute, known)
    with stoppable(folder):
        series = chosen.drive(driver)
    EvaluatedRuns(DRIVE, chosen, driver.traces, driver.judged, series, known, folder).conclude(each=figures)
    if driver.status:
        raise typer.Exit(driver.status)


def _angle_driven(scenario: Path, changes: Sequence[Override], execute: Executor) -> float:
    """Return A [rad] from runs of slowly increasing steer.

    Raises:
        ResultsError: the runs do not determine it.
        typer.Exit: a run failed.
    """
    from yawbench.proving_ground.steady_state_steering import characteristic_angle
    from yawbench.studies.driven_tests import TestDriver, slow_steer_runs

    driver = TestDriver(TESTS["slowly-increasing-steer"], scenario, changes, execute)
    with stoppable(execute.folder):
        judged = driver.make(slow_steer_runs(scenario, changes, execute))
    if driver.status:
        raise typer.Exit(driver.status)
    try:
        return characteristic_angle(judged)
    except NotJudged as why:
        raise ResultsError(str(why), code="test-not-applicable") from None

"""`yawbench evaluate`: evaluate recorded or measured runs of a standard test."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from yawbench.commands import json_and_latex
from yawbench.commands.json_and_latex import tabular
from yawbench.commands.output import print_tables
from yawbench.commands.strict_and_junit import judged as pass_on
from yawbench.commands.strict_and_junit import judging
from yawbench.commands.terminal_progress import say
from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.foundation.messages import counted, listed
from yawbench.metrics.verdict import NotJudged, Status, Verdict
from yawbench.orchestrator.results.run_record import RUN_FILE
from yawbench.proving_ground.standard_tests import TESTS, Evaluation, StandardTest, TestSeries

if TYPE_CHECKING:
    from yawbench.proving_ground.trace import Trace


TestName = Literal[tuple(TESTS)]  # type: ignore[valid-type]
TestToEvaluate = Annotated[TestName, typer.Argument(help="The test.", metavar="TEST")]  # type: ignore[valid-type]
EvaluatedSources = Annotated[
    list[Path],
    typer.Argument(
        help="Results folders, searched with their subfolders, or measurement files.",
        metavar="RESULTS...",
    ),
]
SlowSteer = Annotated[
    list[Path] | None,
    typer.Option(
        "--slow-steer", metavar="RESULTS", help="Runs of slowly increasing steer, for A. Repeatable."
    ),
]
CharacteristicAngle = Annotated[
    str | None,
    typer.Option("--angle", metavar="ANGLE", help="A, the hand-wheel angle at 0.3 g, such as '35.8 deg'."),
]
EvaluationFigures = Annotated[bool, typer.Option("--figures/--no-figures", help="Draw every run.")]
OutFile = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="DIR",
        help="Folder for evaluation.json, evaluation.html and figures. Default: that of the runs.",
    ),
]
FILE, PAGE = "evaluation.json", "evaluation.html"
DRIVE, EVALUATE = "drive", "evaluate"
"""Commands that write evaluations; neither replaces those of the other."""
MOST_NOTES = 4
"""Runs below a table of which it is said why they were lost. Chosen: a few lines each; the page has all."""
BESIDE = "evaluated"
"""Folder of an evaluation below a folder that has one of another command already."""


@tabular
@judging
def evaluate(
    test: TestToEvaluate,
    sources: EvaluatedSources,
    slow_steer: SlowSteer = None,
    angle: CharacteristicAngle = None,
    figures: EvaluationFigures = True,
    out: OutFile = None,
) -> None:
    """Evaluate recorded or measured runs of a standard test.

    Prints all quantities and a verdict with its reason per criterion; draws a figure per run. For sine
    with dwell, give A with --slow-steer or --angle; several runs are judged as a series. In the folder of
    `yawbench drive`, its runs and its A are taken, and its evaluation is kept: this one goes to a folder
    evaluated in it. Exit status 1 if nothing could be judged.
    """
    from yawbench.measurements.measured_results import load_run
    from yawbench.orchestrator.results.folder_names import below_results
    from yawbench.proving_ground.trace import trace_of

    from .recorded_runs import distinct, folder_of_all

    chosen = TESTS[test]
    known = _angle(angle, slow_steer, chosen)
    driven = {source: found for source in sources if (found := _driven(source, chosen)) is not None}
    places = [
        place for source in sources for place in (driven[source][0] if source in driven else _runs(source))
    ]
    if chosen.needs_angle:
        places, slow = _apart(places)
        known = known or _angle_beside(driven, slow, chosen)
    labels = distinct(places) if len(places) > 1 else [str(places[0])]
    recorded_here = all(place.is_dir() for place in places)
    folder = out or (folder_of_all(places) if recorded_here else below_results("evaluation"))
    if _command_of(folder) not in (None, EVALUATE):
        if out is not None:
            taken = f"has the evaluation of another command in {FILE}, which is kept: name another folder"
            raise ScenarioError(f"--out {out}: {taken}", code="option-invalid")
        folder = folder / BESIDE
    traces = [trace_of(load_run(place), label) for place, label in zip(places, labels, strict=True)]
    judged = [chosen.evaluate(trace, known) for trace in traces]
    series = chosen.judge_together(judged, known)
    EvaluatedRuns(EVALUATE, chosen, traces, judged, series, known, folder).conclude(
        each=figures, together=out is not None
    )
    if all(evaluation.judges_nothing for evaluation in judged):
        say(f"{chosen.name}: nothing could be judged, see above")
        raise typer.Exit(1)


@dataclass(frozen=True)
class EvaluatedRuns:
    """The evaluations of the runs of a test, and of their series."""

    command: str
    test: StandardTest
    traces: list[Trace]
    judged: list[Evaluation]
    series: TestSeries | None
    angle: float | None  # A [rad]
    folder: Path  # for evaluation.json and the figure of the series

    def conclude(self, *, each: bool, together: bool = False) -> None:
        """Draw, write and print the evaluations; write their page.

        Args:
            each: draw every run, too.
            together: write figures into the folder instead of next to the results.
        """
        from yawbench.foundation.safe_files import write_whole
        from yawbench.reports.evaluation_page import evaluation_page, events_of_trace
        from yawbench.studies.driven_tests import run_table, runs_table
        from yawbench.studies.run_remarks import lost_notes

        drawn = self._draw(each=each, together=together)
        data = {
            "command": self.command,
            "test": self.test.name,
            "A": self.angle,
            "runs": [run.as_data() for run in self.judged],
            "series": self.series.data if self.series else None,
        }
        write_whole(self.folder / FILE, json.dumps(data, indent=1))
        json_and_latex.answer(folder=self.folder, page=self.folder / PAGE, evaluation=data)
        if len(self.judged) == 1:
            table = run_table(self.judged[0], self.test.says)
        else:
            table = runs_table(self.series.runs if self.series else self.judged, self.test, self.series)
        courses = [(trace.label, events_of_trace(trace)) for trace in self.traces]
        table.notes += lost_notes(courses, MOST_NOTES, comparable=self.series is None)
        print_tables([table])
        self._pass_on()
        page = evaluation_page(self.test, self.traces, self.judged, self.series)
        write_whole(self.folder / PAGE, page)
        also = f", {counted(drawn, 'figure')}" if drawn else ""
        say(f"{self.folder / FILE}, {PAGE}{also}")

    def _pass_on(self) -> None:
        """Pass on the verdicts: of the series, and of every run unless the series is a search among them."""
        title, series = f"{self.test.name}: {self.folder}", self.series
        if series and not series.criteria:
            clean = any(run.verdict is not None and run.verdict.holds for run in self.judged)
            status = Status.PASSED if clean else Status.FAILED
            pass_on(title, [("series", Verdict(status, why=series.summary))])
            return
        pass_on(
            title, [(f"series: {name}", one) for name, one in (series.criteria if series else {}).items()]
        )
        for run in self.judged:
            pass_on(title, [(f"{run.label}: {name}", one) for name, one in run.criteria.items()])

    def _draw(self, *, each: bool, together: bool) -> int:
        """Draw the runs, next to their results or together, and the series; return the number of figures."""
        from yawbench.figures.style import save

        stem = self.test.name.replace("-", "_")
        count = 0
        for number, (trace, judged) in enumerate(zip(self.traces, self.judged, strict=True), start=1):
            figure = self.test.draw(trace, judged) if each else None
            if figure is None:
                continue
            beside = None if together else trace.folder
            name = stem if beside or len(self.traces) == 1 else f"{stem}_{number}"
            save(figure, (beside or self.folder) / name)
            count += 1
        if self.series and self.test.drawing:
            save(self.test.draw_series(self.series, str(self.folder)), self.folder / f"{stem}_series")
            count += 1
        return count


def _runs(source: Path) -> list[Path]:
    """Return the folders of the runs in and below a folder, or the segments of a measurement file."""
    from yawbench.measurements.measured_results import segments_of
    from yawbench.orchestrator.results.reader import found_runs
    from yawbench.orchestrator.results.run_record import RunStatus

    if not source.is_dir():
        return segments_of(source)
    runs = found_runs(source)
    completed = [run.folder for run in runs if run.status is RunStatus.COMPLETED]
    unreadable = [run.problem for run in runs if run.status is RunStatus.UNREADABLE]
    if not completed:
        raise ResultsError(unreadable or f"{source}: contains no completed run", code="runs-missing")
    for problem in unreadable:
        say(f"note: skipped: {problem}")
    return completed


def _written(folder: Path) -> dict[str, Any] | None:
    """Return the evaluation in a folder; None if there is none, or it cannot be read."""
    try:
        data = json.loads((folder / FILE).read_bytes())
    except (OSError, ValueError):
        return None
    return data if isinstance(data, dict) else None


def _command_of(folder: Path) -> str | None:
    """Return the command whose evaluation is in a folder, "" if unknown; None if there is none."""
    if not (folder / FILE).exists():
        return None
    return str((_written(folder) or {}).get("command", ""))


def _driven(source: Path, test: StandardTest) -> tuple[list[Path], float | None] | None:
    """Return the runs that `yawbench drive` has judged in a folder, and A [rad].

    None if it has not driven this test there, or the runs are not there any more.
    """
    data = _written(source) or {}
    angle, runs = data.get("A"), data.get("runs")
    if data.get("command") != DRIVE or data.get("test") != test.name or not isinstance(runs, list):
        return None
    places = [source / str(run.get("label")) for run in runs if isinstance(run, dict)]
    if not places or not all((place / RUN_FILE).is_file() for place in places):
        return None
    return places, float(angle) if isinstance(angle, (int, float)) else None


def _apart(places: list[Path]) -> tuple[list[Path], list[Path]]:
    """Return the runs to judge, and those of slowly increasing steer beside them, which give A."""
    from yawbench.proving_ground.steady_state_steering import SLOW_STEER

    slow = [place for place in places if SLOW_STEER in place.parts]
    others = [place for place in places if place not in slow]
    return (others, slow) if others else (places, [])


def _angle_beside(
    driven: Mapping[Path, tuple[list[Path], float | None]], slow: list[Path], test: StandardTest
) -> float | None:
    """Return A [rad] of driven series, else of runs of slowly increasing steer; None without either.

    Raises:
        ScenarioError: series have different A.
    """
    known = {angle for _, angle in driven.values() if angle is not None}
    if not known:
        return _angle(None, slow, test) if slow else None
    if len(known) > 1:
        several = listed(f"{math.degrees(angle):.1f} degrees" for angle in sorted(known))
        raise ScenarioError(
            f"A differs between the series, {several}: evaluate one at a time, or give --angle",
            code="option-invalid",
        )
    (angle,) = known
    say(f"A = {math.degrees(angle):.1f} degrees, of the driven series")
    return angle


def angle_of(text: str | None) -> float | None:
    """Return A [rad] as given by `--angle`; None without it.

    Raises:
        ScenarioError: the text is not an angle between 0 and 360 degrees.
    """
    from yawbench.orchestrator.scenario.quantities import convert

    if text is None:
        return None
    try:
        angle = float(convert(text, "rad"))
    except ValueError as error:
        raise ScenarioError(f"--angle: {error}", code="fmu-wrong-kind") from None
    if not 0 < angle < 2 * math.pi:
        raise ScenarioError(f"--angle: must be between 0 and 360 degrees (got {text})", code="fmu-wrong-kind")
    return angle


def _angle(text: str | None, slow_steer: list[Path] | None, test: StandardTest) -> float | None:
    """Return A [rad], None if it is neither given nor needed."""
    from yawbench.measurements.measured_results import load_run
    from yawbench.proving_ground.steady_state_steering import characteristic_angle, evaluate_slow_steer
    from yawbench.proving_ground.trace import trace_of

    if text and slow_steer:
        raise ScenarioError("--angle and --slow-steer are mutually exclusive", code="option-invalid")
    if (text or slow_steer) and not test.needs_angle:
        raise ScenarioError(f"{test.name} takes no A: omit --angle and --slow-steer", code="option-invalid")
    if not slow_steer:
        return angle_of(text)
    places = [place for source in slow_steer for place in _runs(source)]
    try:
        angle = characteristic_angle([evaluate_slow_steer(trace_of(load_run(p))) for p in places])
    except NotJudged as why:
        raise ResultsError(str(why), code="test-not-applicable") from None
    runs = counted(len(places), "run")
    say(f"A = {math.degrees(angle):.1f} degrees, from {runs} of slowly increasing steer")
    return angle

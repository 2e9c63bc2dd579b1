"""`yawbench evaluate`: what a standard test makes of recorded or measured runs."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ..evaluation.standard_tests import TESTS

if TYPE_CHECKING:
    from ..evaluation.judgement import Judgement, Series
    from ..evaluation.standard_tests import StandardTest
    from ..evaluation.trace import MappingSpec, Trace

Test = Literal[tuple(TESTS)]  # type: ignore[valid-type]
Which = Annotated[Test, typer.Argument(help="The test.", metavar="TEST")]  # type: ignore[valid-type]
Sources = Annotated[
    list[Path],
    typer.Argument(
        help="Folders of results, also with runs in folders below; or with --signals files of columns.",
        metavar="RESULTS...",
    ),
]
Signals = Annotated[
    Path | None,
    typer.Option("--signals", metavar="FILE", help="Mapping: which columns of measured files are what."),
]
SlowSteer = Annotated[
    list[Path] | None,
    typer.Option(
        "--slow-steer", metavar="RESULTS", help="Runs of slowly increasing steer, for A. Repeatable."
    ),
]
Angle = Annotated[
    str | None,
    typer.Option("--angle", metavar="ANGLE", help="A, the hand-wheel angle at 0.3 g, such as '35.8 deg'."),
]
Figures = Annotated[bool, typer.Option("--figures/--no-figures", help="Draw every run.")]
OutFile = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="DIR", help="Folder for evaluation.json and figures; default: that of the run(s)."
    ),
]

FILE = "evaluation.json"


def evaluate(
    test: Which,
    sources: Sources,
    slow_steer: SlowSteer = None,
    angle: Angle = None,
    signals: Signals = None,
    figures: Figures = True,
    out: OutFile = None,
) -> None:
    """Evaluate runs as a standard test says.

    Every quantity, a verdict per criterion with its reason, a figure per run; also of measured data.
    Of sine with dwell, A comes from runs of slowly increasing steer (--slow-steer) or is given
    (--angle); several runs are judged as a series. Exit status 1 if nothing could be judged.
    """
    from ..evaluation.dwell_series import is_series, judge_series
    from ..evaluation.trace import load_mapping, load_trace
    from ..results.naming import below_results
    from .batch import say
    from .recorded import distinct, folder_of_all

    chosen = TESTS[test]
    mapping = load_mapping(signals) if signals else None
    places = [place for source in sources for place in _runs(source, mapping)]
    labels = distinct(places) if len(places) > 1 else [str(places[0])]
    known = _angle(angle, slow_steer, mapping, chosen)
    traces = [load_trace(place, mapping, label) for place, label in zip(places, labels, strict=True)]
    judged = [chosen.evaluate(trace, known) for trace in traces]
    series = judge_series(judged, known) if known and is_series(judged) else None
    recorded_here = all(place.is_dir() for place in places)
    folder = out or (folder_of_all(places) if recorded_here else below_results("evaluation"))
    Evaluation(chosen, traces, judged, series, known, folder).conclude(each=figures, together=out is not None)
    if all(one.judges_nothing for one in judged):
        say(f"{chosen.name}: nothing could be judged, see above")
        raise typer.Exit(1)


@dataclass(frozen=True)
class Evaluation:
    """What the runs of a test come to, one by one and together."""

    test: StandardTest
    traces: list[Trace]
    judged: list[Judgement]
    series: Series | None
    angle: float | None  # A [rad]
    folder: Path  # of evaluation.json and of the figure of the series

    def conclude(self, *, each: bool, together: bool = False) -> None:
        """Draw, write and print it.

        Args:
            each: draw every run, too.
            together: into the folder, not beside its results.
        """
        from ..experiments.evaluated_tables import run_table, runs_table
        from ..wording import counted
        from ..writing import write_whole
        from .batch import print_tables, say

        drawn = self._draw(each=each, together=together)
        data = {
            "test": self.test.name,
            "A": self.angle,
            "runs": [one.as_data() for one in self.judged],
            "series": self.series.found if self.series else None,
        }
        write_whole(self.folder / FILE, json.dumps(data, indent=1))
        if len(self.judged) == 1:
            table = run_table(self.judged[0], self.test.says)
        else:
            table = runs_table(self.series.runs if self.series else self.judged, self.test, self.series)
        print_tables([table])
        also = f", {counted(drawn, 'figure')}" if drawn else ""
        say(f"{self.folder / FILE}{also}")

    def _draw(self, *, each: bool, together: bool) -> int:
        """Draw runs, beside their results or together, and the series; return how many figures."""
        from ..figures.style import save

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


def _runs(source: Path, mapping: MappingSpec | None) -> list[Path]:
    """Return the folders of the runs in and below a folder, or the file itself."""
    from ..errors import ResultsError
    from ..results.folder import COMPLETED
    from ..results.runs import UNREADABLE, found_runs
    from .batch import say

    if not source.is_dir():
        if not source.exists():
            raise ResultsError(f"{source}: there is no such folder or file")
        return [source]
    runs = found_runs(source)
    found = [run.folder for run in runs if run.status == COMPLETED]
    unreadable = [run.problem for run in runs if run.status == UNREADABLE]
    if not found:
        raise ResultsError(unreadable or f"{source}: holds no run that was completed")
    for problem in unreadable:
        say(f"note: left out: {problem}")
    return found


def angle_of(given: str | None) -> float | None:
    """Return A [rad] as an option gives it, None if it does not.

    Raises:
        ScenarioError: it is no such angle.
    """
    from ..errors import ScenarioError
    from ..scenario.quantities import convert

    if given is None:
        return None
    try:
        angle = float(convert(given, "rad"))
    except ValueError as error:
        raise ScenarioError(f"--angle: {error}") from None
    if not 0 < angle < 2 * math.pi:
        raise ScenarioError(f"--angle: must be between 0 and 360 degrees (got {given})")
    return angle


def _angle(
    given: str | None, slow_steer: list[Path] | None, mapping: MappingSpec | None, test: StandardTest
) -> float | None:
    """Return A [rad], None if it is neither given nor needed."""
    from ..errors import ResultsError, ScenarioError
    from ..evaluation.judgement import NotJudged
    from ..evaluation.slow_steer import characteristic_angle, evaluate_slow_steer
    from ..evaluation.trace import load_trace
    from .batch import say

    if given and slow_steer:
        raise ScenarioError("--angle and --slow-steer both say what A is: give one of them")
    if (given or slow_steer) and not test.needs_angle:
        raise ScenarioError(f"{test.name} needs no A: leave --angle and --slow-steer away")
    if not slow_steer:
        return angle_of(given)
    places = [place for source in slow_steer for place in _runs(source, mapping)]
    try:
        angle = characteristic_angle([evaluate_slow_steer(load_trace(p, mapping)) for p in places])
    except NotJudged as why:
        raise ResultsError(str(why)) from None
    say(f"A = {math.degrees(angle):.1f} degrees, from {len(places)} of slowly increasing steer")
    return angle

"""Results of a run as arrays, metrics, figures and files."""

from __future__ import annotations

import functools
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from yawbench.foundation.errors import Diagnostic, ResultsError, ScenarioError, warnings_in
from yawbench.foundation.messages import hint, short
from yawbench.measurements.measured_results import filtered_alike, measured_results
from yawbench.metrics.expressions import STANDARD, MetricValue, evaluate, evaluate_all, metric, why_none
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.scenario.overrides import with_changes
from yawbench.proving_ground.standard_tests import TESTS, Evaluation, TestName
from yawbench.proving_ground.trace import trace_of

from . import arguments

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure

    from yawbench.scene.scene import Scene
    from yawbench.studies.tables import Table


def measured(file: str | Path, segment: int | None = None, *, start: float = 0.0) -> Run:
    """Return a recording of a car as a run, for `metric`, `plot`, `evaluate` and `view`.

        >>> laps = yb.measured("measured.yaml", segment=2)  # doctest: +SKIP

    Args:
        file: the measurement file.
        segment: its number, counted from 1, if the file has several.
        start: time of the recording [s] that becomes 0, to align it with a run that begins there.

    Raises:
        ScenarioError: the file, or a recording that it names, cannot be used.
        ResultsError: the segment does not exist.
    """
    path = arguments.path(file, "file")
    number = None if segment is None else arguments.count(segment, "segment", least=1, most=10**6)
    begin = arguments.number(start, "start")
    return Run(measured_results(path if number is None else Path(f"{path}#{number}"), begin))


class Run:
    """Run with its results.

    >>> run = yb.load("fnn_sideslip/25mps").run()
    >>> len(run), "plant.yaw_rate" in run, sorted(run)[:2]
    (8001, True, ['allocator.force_request_fl', 'allocator.force_request_fr'])
    >>> run["plant.yaw_rate"].shape
    (8001,)
    >>> print(run["yaw_rate"].max().round(3), run.time[-1])
    0.19 8.0
    >>> run.unit_of("plant.yaw_rate")
    'rad/s'
    """

    def __init__(self, results: Results) -> None:
        self.results = results

    @property
    def time(self) -> np.ndarray:
        """Communication points [s], shape (rows,)."""
        return self.results.time

    @property
    def title(self) -> str:
        """The scenario's title."""
        return self.results.record.title or ""

    @property
    def record(self) -> dict[str, Any]:
        """Run record: everything needed to repeat the run, as in run.json."""
        return self.results.record.content()

    @property
    def diagnostics(self) -> tuple[Diagnostic, ...]:
        """Assumptions and omissions (severity "info"), and warnings about values and behaviour.

        >>> warned = base.set({"speed": 300}).run().diagnostics[0]
        >>> warned.code, warned.location.signal, warned.value
        ('value-implausible', 'driver.target_speed', 300.0)
        """
        return self.results.record.all_diagnostics

    @property
    def events(self) -> Table:
        """What began and ended when in the run: a table with a row per event, in the order of their begin.

        >>> run.events.headings
        ['time', 'until', 'event', 'where', 'value', 'limit', 'unit', 'signal']
        >>> "intervention" in [event for _, _, event, *_ in run.events.rows]
        True
        """
        from yawbench.studies.listings import events_table

        return events_table(self.results)

    def why(self, best: Run | None = None) -> list[str]:
        """Return at most three sentences on why the car was lost, the cause first; empty if it was not.

            >>> run.why()
            []

        Args:
            best: a run under the same conditions that did better, to compare with.
        """
        from yawbench.events.kinds import events_in
        from yawbench.events.why import why

        if best is not None and not isinstance(best, Run):
            raise TypeError(f"best: must be a Run (got {short(best)})")
        beside = None if best is None else events_in(best.results)
        return [str(reason) for reason in why(events_in(self.results), beside)]

    def scene(self) -> Scene:
        """Return the run in space: car, body, wheels, forces, lanes, ground, events; axes of ISO 8855.

            >>> scene = run.scene()
            >>> scene.position.shape, scene.force.shape  # x and y of the car; four wheels, x, y and z
            ((8001, 2), (8001, 4, 3))

        Raises:
            ResultsError: position or yaw angle were not recorded.
        """
        from yawbench.events.kinds import events_in
        from yawbench.scene.scene import scene_of

        return scene_of(self.results, events_in(self.results))

    @property
    def changes(self) -> tuple[Override, ...]:
        """The overrides of the scenario file."""
        return self.results.record.overrides

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a column, shape (rows,), by `instance.variable` or by a unique variable name."""
        return self.results.columns[self.results.column(arguments.text(name, "name of a column"))]

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and arguments.plain(name) in self.results.columns

    def __iter__(self) -> Iterator[str]:
        return iter(self.results.columns)

    def __len__(self) -> int:
        return self.time.size

    def unit_of(self, name: str) -> str:
        """Return the measurement unit of a column, "" if it has none."""
        return self.results.units[self.results.column(arguments.text(name, "name of a column"))]

    def to_pandas(self) -> pd.DataFrame:
        """Return all columns over time; `attrs["units"]` holds their units.

        >>> frame = run.to_pandas()
        >>> frame.index.name, frame["plant.sideslip"].size, frame.attrs["units"]["plant.sideslip"]
        ('time', 8001, 'rad')
        """
        import pandas as pd

        frame = pd.DataFrame(self.results.columns, index=pd.Index(self.time, name="time"))
        frame.attrs = {"title": self.title, "units": dict(self.results.units)}
        return frame

    def to_xarray(self) -> xr.Dataset:
        """Return all columns over time; each variable has its unit in `attrs["units"]`.

        >>> run.to_xarray()["plant.sideslip"].attrs["units"]
        'rad'
        """
        import xarray as xr

        units = self.results.units
        variables = {
            name: ("time", values, {"units": units[name]} if units[name] else {})
            for name, values in self.results.columns.items()
        }
        return xr.Dataset(variables, {"time": ("time", self.time, {"units": "s"})}, {"title": self.title})

    def metric(self, name: str, window: tuple[float, float] | None = None) -> float:
        """Return a metric in SI units; ratios are plain numbers.

            >>> round(run.metric("peak(sideslip)"), 4)
            0.0198
            >>> run.metric("peak(yaw_rate)", window=(0, 1)) < 1e-9  # before the driver steers
            True

        Args:
            name: `measure(signal)`; the documentation lists all measures.
            window: start and end [s]; default: the whole run.

        Raises:
            ScenarioError: the measure is unknown.
            ResultsError: a signal was not recorded, or the run does not cover the window.
        """
        chosen = metric(arguments.text(name, "name of a metric"))
        window = None if window is None else arguments.span(window, "window")
        value = evaluate(self.results, chosen, window)
        if value is None:
            why = why_none(self.results, chosen, window or chosen.window, self.time[-1])
            raise ResultsError(why or f"{name}: has no value for this run", code="signal-unknown")
        return value.number

    def metrics(self) -> dict[str, MetricValue]:
        """Return the standard metrics for which the run has the signals: name -> number and unit.

        >>> run.metrics()["peak(sideslip)"].unit
        'rad'
        """
        return evaluate_all(self.results, STANDARD)

    def evaluate(self, test: TestName, *, angle: float | None = None) -> Evaluation:
        """Evaluate the run by a standard test: quantities in SI, verdicts with their reasons.

            >>> [str(why) for why in run.evaluate("step-steer").diagnostics]  # a sine ends where it began
            ['the hand wheel is not turned']

        Args:
            test: its name, as for `yawbench evaluate`.
            angle: the hand-wheel angle at 0.3 g [rad], which sine with dwell needs for responsiveness.

        Raises:
            ScenarioError: the test is unknown, or the angle invalid.
            ResultsError: a signal was not recorded.
        """
        name = arguments.text(test, "test")
        if name not in TESTS:
            raise ScenarioError(
                f"there is no test {name!r}{hint(name, TESTS, lead='known')}", code="test-unknown"
            )
        if angle is not None and not TESTS[name].needs_angle:
            raise ScenarioError(f"{name} takes no angle: omit it", code="option-invalid")
        if angle is not None:
            with arguments.as_scenario_errors():
                amplitude = arguments.number(angle, "angle")
            if not 0.0 < amplitude < 2.0 * math.pi:
                raise ScenarioError(
                    f"angle: must be a number between 0 and 2 pi rad (got {short(angle)})",
                    code="argument-invalid",
                )
        return TESTS[name].evaluate(trace_of(self.results, self.title), angle)

    def plot(self, *panels: str, title: str | None = None) -> Figure:
        """Return a figure, as `yawbench plot` draws it.

            >>> run.plot("sideslip", "yaw_rate(sideslip)", "path").savefig("run.svg")

        Args:
            panels: a signal, its error (`sideslip_error`), one over another (`yaw_rate(sideslip)`) or `path`;
                default: those of the papers.
            title: default: the run's.

        Raises:
            ScenarioError: a signal was not recorded.
            ResultsError: no recorded signal can be drawn.
        """
        return drawn({self.title: self.results}, panels, title)

    def save(self, folder: str | Path, *, format: str = "csv") -> Path:
        """Write results and run.json, as `yawbench run` does, and return the folder.

            >>> sorted(file.name for file in run.save("results/mine").iterdir())
            ['results.csv', 'run.json']

        Raises:
            ResultsError: they cannot be written.
        """
        from yawbench.orchestrator.results.recorder import write_results

        path = arguments.path(folder, "folder")
        write_results(self.results, path, format=arguments.text(format, "format"))
        return path

    @property
    def _full_title(self) -> str:
        """The title with the overrides: numbers in it may be those of the file."""
        return with_changes(self.title, self.results.record.overrides)

    def __repr__(self) -> str:
        noted = "".join(f"; {text}" for text in warnings_in(self.diagnostics))
        return f"<Run {self._full_title!r}: {len(self)} rows of {len(self.results.columns)} variables{noted}>"

    def _repr_html_(self) -> str:
        from yawbench.figures.display import shown_value

        changed = "".join(
            f"<br>{escape(str(change.target))} = {escape(str(change.plain))}" for change in self.changes
        )
        cells = [(metric(name).title, shown_value(x)) for name, x in self.metrics().items()]
        rows = "".join(f"<tr><td>{escape(title)}</td><td>{escape(value)}</td></tr>" for title, value in cells)
        noted = "".join(f"<br>⚠ {escape(str(warning))}" for warning in warnings_in(self.diagnostics))
        return f"<b>{escape(self.title)}</b>{changed}{noted}<table>{rows}</table>"


def drawn(runs: Mapping[str, Results], panels: Sequence[str], title: str | None) -> Figure:
    """Return a figure of runs by their labels, see `Run.plot`."""
    from yawbench.figures.display import LabelledRun
    from yawbench.figures.plots import draw, overview_of

    from .figures.panels import check_panels

    wanted = arguments.texts(panels, "panels")
    title = None if title is None else arguments.text(title, "title")
    labelled = [*map(LabelledRun, runs, filtered_alike([*runs.values()]))]
    check_panels(labelled, wanted, option="panel ")
    return shown_in_notebooks(draw(labelled, wanted or overview_of(labelled), title=title))


def shown_in_notebooks(figure: Figure) -> Figure:
    """Make a notebook show the figure as an image, with or without pyplot; return the figure."""
    figure._repr_png_ = functools.partial(_png, figure)  # type: ignore[attr-defined]
    return figure


def _png(figure: Figure) -> bytes:
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=110)
    return picture.getvalue()

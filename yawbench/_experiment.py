"""Experiments from Python: every combination of levels as a run, one table, curves and maps."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from orchestrator.errors import Diagnostic, Location, ScenarioError
from orchestrator.experiments.experiment import LoadedExperiment as Design
from orchestrator.experiments.experiment import NamedRun
from orchestrator.experiments.figures import draw_over_axes
from orchestrator.experiments.jobs import Job, Outcome, measured
from orchestrator.experiments.judged_schema import si_number, text_of
from orchestrator.experiments.outcome import ExperimentResult
from orchestrator.experiments.planning import metrics_of, plan_experiment
from orchestrator.experiments.record import columns_of, to_pandas
from orchestrator.experiments.schema import ExperimentSpec, FigureSpec
from orchestrator.master.fmi import open_unit
from orchestrator.master.run_loop import OpenInstance
from orchestrator.master.simulate import simulate_in_memory
from orchestrator.messages import hint, listed, printable, short
from orchestrator.plan import Value
from orchestrator.results.read import Results
from orchestrator.scenario.quantities import number_and_unit
from orchestrator.scenario.validation import Model, validate
from orchestrator.scenario.yaml_lines import Document, scalar

from . import arguments
from ._calls import make_all
from ._controller import ControllerLike
from ._run import Run, shown_in_notebooks
from ._scenario import Scenario, warn

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


FAR = 1e100
"""Bound on the scale of a figure. Chosen: drawing multiplies, and 1e308 would become infinite."""


def experiment(
    base: Scenario,
    axes: Mapping[str, Iterable[Value | ControllerLike]],
    *,
    metrics: str | Iterable[str] = (),
) -> Experiment:
    """Return the runs of a scenario at every combination of levels, to be made by `run`.

        >>> axes = {"controller": ["controller_off", "controller_fnn"], "plant.initial_speed": [20, 30]}
        >>> yb.experiment(base, axes, metrics=["peak(sideslip)"])
        <Experiment 'Sideslip tracking at 25 m/s, mu 0.65': 4 runs over controller and plant.initial_speed>

    Args:
        base: the scenario.
        axes: a unit -> FMUs by name or path, or plain Python, as `Scenario.swap` takes them; what
            `Scenario.set` changes -> values, numbers in SI or all with one unit ("80 km/h").
        metrics: columns of the table, such as "peak(sideslip)"; default: the usual ones.

    Raises:
        ScenarioError: an axis, a level or a metric is wrong.
    """
    base = arguments.instance(base, "base", Scenario, "yawbench.load")
    axes = arguments.mapping(axes, "axes", "a mapping of what varies to levels, {'plant.mass': [900, 1000]}")
    given: dict[str, Any] = {}
    changed = base._unswapped(axes)
    for name, levels in axes.items():
        with arguments.as_scenario_errors():
            levels = arguments.items(levels, name, "a list of levels")
        if name in base.loaded.units:
            variants = {}
            for level in levels:
                swapped = changed.swap(**{name: level})
                swap, *brought = swapped.changes[len(changed.changes) :]
                words = level if isinstance(level, str) else Path(str(swap.value)).stem
                if words in variants:
                    raise ScenarioError(f"{name}: two levels are called {words}", code="name-duplicate")
                settings = {str(one.target): one.value for one in brought}
                variants[words] = {"swap": {name: str(swap.value)}, "set": settings}
                changed = replace(changed, programs=swapped.programs)
            given[name] = {"variants": variants}
        else:
            given[name] = {"vary": name, **_values(name, levels)}
    wanted = arguments.texts(metrics, "metrics")
    spec = {"scenario": base.path.name, "axes": given, "metrics": {one: {"metric": one} for one in wanted}}
    made = _checked(ExperimentSpec, {"title": base.title or base.path.stem, **spec})
    run = NamedRun("", "", "", base.path, ())
    return Experiment(changed, Design(base.path, made, {"": run}, (), changed.changes))


def _checked(model: type[Model], given: dict[str, Any]) -> Model:
    """Validate data against a schema; all errors are raised together."""
    document = Document(Path(), given)
    made = validate(model, document)
    if made is None:
        raise ScenarioError([
            replace(one, location=Location(target=one.location.target)) for one in document.errors
        ], code="argument-invalid")  # fmt: skip
    return made


def _values(name: str, given: Iterable[Any]) -> dict[str, Any]:
    """Return levels as an axis stores them: numbers, and the unit that they share."""
    with arguments.as_scenario_errors():
        levels = [arguments.scalar(level, f"{name}[{k}]") for k, level in enumerate(given)]
    split = [number_and_unit(level) if isinstance(level, str) else None for level in levels]
    units = {one[1] for one in split if one}
    if as_text := next((x for x in levels if isinstance(x, str) and not isinstance(scalar(x), str)), None):
        raise ScenarioError(
            f"{name}: give numbers, True or False as such, not as text (got {as_text!r})",
            code="argument-invalid",
        )
    if not units:
        return {"values": levels}
    if len(units) > 1 or not all(split):
        raise ScenarioError(f"{name}: give all levels in one unit, or none", code="argument-invalid")
    return {"values": [float(one[0]) for one in split if one], "unit": units.pop()}


@dataclass(frozen=True)
class Experiment:
    """A design, not yet run; made by `experiment`.

    >>> made = yb.experiment(base, {"driver.amplitude": [0.02, 0.03]}, metrics=["peak(sideslip)"]).run()
    >>> made.table[["driver.amplitude", "status"]]
       driver.amplitude     status
    0              0.02  completed
    1              0.03  completed
    """

    __module__ = "yawbench"

    base: Scenario
    design: Design

    def __post_init__(self) -> None:
        arguments.instance(self.base, "base", Scenario, "yawbench.load")
        arguments.instance(self.design, "design", Design, "yawbench._experiment")

    def __len__(self) -> int:
        return len(self.design.cases)

    def __repr__(self) -> str:
        over = " and ".join(self.design.spec.axes)
        return f"<Experiment {self.design.spec.title!r}: {len(self)} runs over {over}>"

    def run(self, *, workers: int | None = None, keep: bool = True, progress: bool = False) -> Runs:
        """Make all runs and return what they come to; nothing is written.

        Runs are made by worker processes, but for those of plain Python, which follow each other in this one.
        A run that fails is a row of the table with its reason. Remarks on the runs, if any, are one
        `YawbenchWarning`.

        Args:
            workers: processes at a time; default: one per core.
            keep: keep the results of all runs in memory, for `Runs.runs`.
            progress: show a bar.

        Raises:
            YawbenchError: a run cannot start; none has been made.
        """
        workers = None if workers is None else arguments.count(workers, "workers")
        keep, progress = arguments.flag(keep, "keep"), arguments.flag(progress, "progress")
        planner = self.base._planner()
        planned = plan_experiment(self.design, self.base.path.parent, planner=planner)
        metrics = metrics_of(planned.experiment)
        with _bar(self.design.spec.title, len(self), shown=progress) as told:
            outcomes = make_all(planned.jobs, self.base.programs, workers=workers, done=told, run=_in_memory)
        records = [measured(one.value, metrics) if one.ok else one.record for one in outcomes]
        runs = [Run(one.value) if one.ok else None for one in outcomes] if keep else None
        findings = ExperimentResult(planned.experiment, records, {}, planned)
        given = [one for job in planned.jobs if job.plan for one in job.plan.diagnostics]
        if found := findings.remarkable():
            given.append(Diagnostic("runs-with-warnings", found, "warning"))
        warn(self.design.spec.title, given)
        return Runs(findings, runs)


def _in_memory(job: Job, opener: OpenInstance = open_unit) -> Results:
    assert job.plan is not None
    return simulate_in_memory(job.plan, opener=opener)


@dataclass(frozen=True)
class Runs:
    """What the runs of an experiment come to.

        >>> made = yb.experiment(base, {"driver.amplitude": [0.02, 0.03]}).run()
        >>> made.runs[0].metric("peak(sideslip)") < made.runs[1].metric("peak(sideslip)")
        True

    Attributes:
        findings: metrics and reasons, as studies and sweeps have them.
        runs: every run with its results, None for one that failed; None if they were not kept.
    """

    __module__ = "yawbench"

    findings: ExperimentResult
    runs: list[Run | None] | None = None

    def __post_init__(self) -> None:
        arguments.instance(self.findings, "findings", ExperimentResult, "Experiment.run")
        if self.runs is not None and not (
            type(self.runs) is list and all(one is None or arguments.is_a(one, Run) for one in self.runs)
        ):
            arguments.refuse("runs", "a list of runs", self.runs)

    @cached_property
    def table(self) -> pd.DataFrame:
        """One row per run: axes, status, reason, metrics, key; `attrs["units"]` holds the units."""
        return to_pandas(columns_of(self.findings))

    def plot(
        self,
        metric: str,
        *,
        x: str,
        y: str = "",
        lines: str = "",
        panels: str = "",
        title: str = "",
        scale: Literal["linear", "log"] = "linear",
        largest: float | str | None = None,
        mark: float | str | None = None,
        only: Mapping[str, Iterable[Value]] | None = None,
    ) -> Figure:
        """Return a figure of a metric over an axis, or as a map over two.

            >>> made = yb.experiment(base, {"driver.amplitude": [0.02, 0.03]}).run()
            >>> made.plot("peak(sideslip)", x="driver.amplitude").savefig("curve.svg")

        Args:
            metric: a column of the table.
            x: axis to the right.
            y: axis upwards, of a map.
            lines, panels: axes with a line or a panel per level.
            title: default: none.
            scale: of the metric.
            largest: where the metric's scale ends, in SI or with a unit; default: at the largest value.
            mark: a value of the metric to draw a line at, in SI or with a unit.
            only: axis -> those of its levels that are drawn; default: all.

        Raises:
            ScenarioError: there is no such axis or metric, or an axis has no place.
            ResultsError: no run gives a number.
        """
        spec = self.findings.spec
        metric, x = arguments.text(metric, "metric"), arguments.text(x, "x")
        y, lines, panels = (
            arguments.text(axis, name, empty=True)
            for name, axis in (("y", y), ("lines", lines), ("panels", panels))
        )
        for name in filter(None, (x, y, lines, panels)):
            if name not in spec.axes:
                raise ScenarioError(
                    f"there is no axis {name!r}{hint(name, spec.axes, lead='axes')}", code="axis-unknown"
                )
        if metric not in spec.metrics:
            raise ScenarioError(
                f"there is no metric {metric!r}{hint(metric, spec.metrics, lead='metrics')}",
                code="metric-unknown",
            )
        if left := [name for name in spec.axes if name not in (x, y, lines, panels, *_axes_of(only))]:
            raise ScenarioError(
                f"the axis {left[0]!r} has no place in this figure: give lines or panels",
                code="argument-invalid",
            )
        chosen = {
            "title": arguments.text(title, "title", empty=True),
            "scale": arguments.text(scale, "scale"),
            "largest": self._limit("largest", largest, metric),
            "mark": self._limit("mark", mark, metric),
            "only": {axis: self._levels_of(axis, levels) for axis, levels in _axes_of(only).items()},
        }
        places = {key: value for key, value in (("y", y), ("lines", lines), ("panels", panels)) if value}
        given = {
            "name": "figure",
            "kind": "map" if y else "curve",
            "metric": metric,
            "x": x,
            **places,
            **chosen,
        }
        return shown_in_notebooks(draw_over_axes(self.findings, _checked(FigureSpec, given)))

    def _limit(self, name: str, value: float | str | None, metric: str) -> Value | None:
        """Return a value on the metric's scale as plain Python."""
        if value is None:
            return None
        given = arguments.scalar(value, name)
        with arguments.as_scenario_errors(f"{name}:"):
            if not abs(si_number(given, self.table.attrs["units"].get(metric, ""))) < FAR:
                raise ValueError(f"must be between {-FAR:g} and {FAR:g} (got {short(given)})")
        return given

    def _levels_of(self, axis: str, levels: Any) -> list[Any]:
        """Return levels of an axis that a figure shows alone."""
        spec, name = self.findings.spec, f"only[{axis!r}]"
        if axis not in spec.axes:
            raise ScenarioError(
                f"only: there is no axis {axis!r}{hint(axis, spec.axes, lead='axes')}", code="axis-unknown"
            )
        given = _values(name, arguments.items(levels, name, "a list of levels"))["values"]
        known = [text_of(one) for one in spec.axes[axis].variants or spec.axes[axis].values or ()]
        unknown = [text_of(one) for one in given if text_of(one) not in known]
        if unknown or not given:
            wrong = f"there is no level {unknown[0]!r}" if unknown else "names no level"
            raise ScenarioError(f"{name}: {wrong}; levels: {listed(known)}", code="axis-unknown")
        return list(given)

    def __repr__(self) -> str:
        all_, found = self.findings, self.findings.remarkable()
        noted = f"; {found}" if found else ""
        return f"<Runs {all_.spec.title!r}: {len(all_.records)} runs, {len(all_.failed)} failed{noted}>"

    def _repr_html_(self) -> str:
        return str(self.table.drop(columns="key").to_html(index=False, na_rep=""))


def _axes_of(only: Any) -> dict[str, Any]:
    return {} if only is None else arguments.mapping(only, "only", "a mapping of axes to lists of levels")


@contextlib.contextmanager
def _bar(title: str, total: int, *, shown: bool) -> Iterator[Callable[[Outcome], None]]:
    """Show a progress bar that advances with every outcome, if `shown`."""
    if not shown:
        yield lambda outcome: None
        return
    from rich.progress import Progress

    with Progress() as bar:
        task = bar.add_task(printable(title).replace("[", r"\["), total=total)
        yield lambda outcome: bar.advance(task)

"""Experiments from Python: a run for every combination of levels, with table, curves and maps."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from yawbench.events.kinds import WarningWatch
from yawbench.fmus.fmu import Value
from yawbench.foundation.errors import Diagnostic, ResultsError, ScenarioError
from yawbench.foundation.messages import hint, listed, short
from yawbench.foundation.progress import bar
from yawbench.orchestrator.master.fmi import open_instance
from yawbench.orchestrator.master.run_lifecycle import OpenInstance
from yawbench.orchestrator.master.simulate import simulate_in_memory
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.scenario.quantities import number_and_unit
from yawbench.orchestrator.scenario.schema_validation import made
from yawbench.orchestrator.scenario.yaml_lines import scalar
from yawbench.studies.axes import SCENARIO, DesignAxisSpec, VariantSpec
from yawbench.studies.claim_schema import Assertion, MetricSpec, si_number
from yawbench.studies.experiment import LoadedExperiment as Design
from yawbench.studies.experiment import NamedRun, experiment_of, metrics_of, plan_experiment
from yawbench.studies.experiment_result import ExperimentResult
from yawbench.studies.jobs import Job, Outcome, measured
from yawbench.studies.problems import problems_of_figure, refuse
from yawbench.studies.result_figures import draw_over_axes
from yawbench.studies.result_files import columns_of
from yawbench.studies.schema import FigureSpec
from yawbench.studies.tables import Table, to_latex, to_pandas
from yawbench.studies.uncertainty import SAMPLE_TABLES, groups_of, sample_columns, sample_tables

from . import arguments
from ._controller import PythonComponent
from ._dataset import dataset
from ._distributions import Drawn
from ._run import Run, shown_in_notebooks
from ._run_many import make_all, planner_of
from ._scenario import Scenario, load, warn

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure


FAR = 1e100
"""Bound on the scale of a figure. Chosen: drawing multiplies, and 1e308 would become infinite."""


def experiment(
    base: Scenario,
    axes: Mapping[str, Iterable[object] | Mapping[str, object] | Drawn],
    *,
    metrics: str | Iterable[str] = (),
    points: int | None = None,
    seed: int = 1,
    design: Literal["sobol", "latin_hypercube", "random", "saltelli"] = "sobol",
) -> Experiment:
    """Return an experiment: runs of a scenario at every combination of levels, or over a sample.

        >>> axes = {"controller": ["controller_off", "controller_fnn"], "plant.initial_speed": [20, 30]}
        >>> yb.experiment(base, axes, metrics=["peak(sideslip)"])
        <Experiment 'Sideslip tracking at 25 m/s, mu 0.65': 4 runs over controller and plant.initial_speed>
        >>> uncertain = {"friction": yb.uniform(0.4, 0.9), "vehicle.mass": yb.normal(1100, 50)}
        >>> made = yb.experiment(base, uncertain, metrics="peak(sideslip)", points=8).run()
        >>> made.probability("peak(sideslip)", below="10 deg")[["runs", "meeting"]].values.tolist()
        [[8, 8]]

    Args:
        base: the scenario.
        axes: an instance -> FMUs by name or path, or plain Python, as in `Scenario.swap`, or a mapping of
            labels to these, to distinguish objects of a class; a target of `Scenario.set` -> values,
            numbers in SI or all with the same unit ("80 km/h"), or what they are drawn from (`uniform`,
            `normal`, `tabulated`); "scenario" -> names or paths of scenarios, in place of the base's. Every
            combination of levels has the same points drawn.
        points: number of points drawn, if any axis is drawn; a power of two for "sobol" and "saltelli".
        seed: of the points.
        design: "sobol", "latin_hypercube", "random", or "saltelli", from which Sobol indices follow.
        metrics: columns of the table, such as "peak(sideslip)"; default: the standard metrics.

    Raises:
        ScenarioError: an axis, a level or a metric is invalid.
    """
    base = arguments.instance(base, "base", Scenario, "yawbench.load")
    axes = arguments.mapping(axes, "axes", "a mapping of axes to levels, {'plant.mass': [900, 1000]}")
    specs: dict[str, DesignAxisSpec] = {}
    drawing: dict[str, Any] = {}
    if any(isinstance(levels, Drawn) for levels in axes.values()):
        drawing = {"design": arguments.text(design, "design"), "seed": arguments.count(seed, "seed", least=0)}
        if points is None:
            raise ScenarioError("points: how many are drawn must be given", code="argument-invalid")
        drawing["points"] = arguments.count(points, "points")
    elif points is not None:
        raise ScenarioError(
            "points: nothing is drawn; give an axis what it is drawn from, such as uniform(0.3, 1)",
            code="argument-invalid",
        )
    changed = base._unswapped(axes)
    for name, levels in axes.items():
        if isinstance(levels, Drawn):
            specs[name] = made(DesignAxisSpec, f"axes.{name}", vary=name, **levels.keys)
            continue
        with arguments.as_scenario_errors():
            labelled = isinstance(levels, Mapping)
            if labelled and name not in (*base._loaded.units, SCENARIO):
                raise TypeError(
                    f"{name}: must be a list of values; only instances and scenarios have labelled levels"
                )
            pairs = (
                list(arguments.mapping(levels, name, "a mapping of labels to levels").items())
                if labelled
                else [("", level) for level in arguments.items(levels, name, "a list of levels")]
            )
        if name == SCENARIO and name not in base._loaded.units:
            files = {label or str(level): _scenario_file(level) for label, level in pairs}
            variants_of = {words: {"scenario": str(file)} for words, file in files.items()}
            specs[name] = made(DesignAxisSpec, f"axes.{name}", variants=variants_of)
        elif name in base._loaded.units:
            variants: dict[str, VariantSpec] = {}
            for label, level in pairs:
                swapped = changed._swapped({name: level}, label)
                swap, *others = swapped.changes[len(changed.changes) :]
                words = label or (level if isinstance(level, str) else Path(str(swap.value)).stem)
                if words in variants:
                    raise ScenarioError(f"{name}: two levels have the name {words!r}", code="name-duplicate")
                settings = {change.target: change.value for change in others}
                variants[words] = made(VariantSpec, swap={name: str(swap.value)}, set=settings)
                changed = replace(changed, _programs=swapped._programs)
            specs[name] = made(DesignAxisSpec, f"axes.{name}", variants=variants)
        else:
            numbers = numbers_of(name, [level for _, level in pairs])
            specs[name] = made(DesignAxisSpec, f"axes.{name}", vary=name, **numbers)
    wanted = arguments.texts(metrics, "metrics")
    expanded = experiment_of(
        base.path,
        [NamedRun("", "", "", base.path, ())],
        changes=changed.changes,
        axes=specs,
        drawing=drawing,
        title=base.title or base.path.stem,
        metrics={name: made(MetricSpec, f"metrics.{name}", metric=name) for name in wanted},
    )
    return Experiment(changed, expanded)


def _scenario_file(level: object) -> Path:
    """Return the file of a level of the axis of scenarios."""
    if isinstance(level, Scenario):
        if level.changes:
            raise ScenarioError(
                "scenario: give scenarios without changes of their own, which all runs would share",
                code="argument-invalid",
            )
        return level.path
    return load(arguments.path(level, SCENARIO)).path


def numbers_of(name: str, items: Iterable[Any]) -> dict[str, Any]:
    """Return the levels of an axis as numbers in a common unit."""
    with arguments.as_scenario_errors():
        levels = [arguments.scalar(level, f"{name}[{k}]") for k, level in enumerate(items)]
    split = [number_and_unit(level) if isinstance(level, str) else None for level in levels]
    units = {pair[1] for pair in split if pair}
    if as_text := next((x for x in levels if isinstance(x, str) and not isinstance(scalar(x), str)), None):
        raise ScenarioError(
            f"{name}: give numbers, True or False as such, not as text (got {as_text!r})",
            code="argument-invalid",
        )
    if not units:
        return {"values": levels}
    if len(units) > 1 or not all(split):
        raise ScenarioError(
            f"{name}: give all levels in the same unit, or all without", code="argument-invalid"
        )
    return {"values": [float(Fraction(pair[0])) for pair in split if pair], "unit": units.pop()}


@dataclass(frozen=True)
class Experiment:
    """Experiment that is not yet run; created by `experiment`.

    >>> made = yb.experiment(base, {"driver.amplitude": [0.02, 0.03]}, metrics=["peak(sideslip)"]).run()
    >>> made.table[["driver.amplitude", "status"]]
       driver.amplitude     status
    0              0.02  completed
    1              0.03  completed
    """

    base: Scenario
    _design: Design

    def __len__(self) -> int:
        return len(self._design.cases)

    def __repr__(self) -> str:
        over = " and ".join(self._design.spec.axes)
        return f"<Experiment {self._design.spec.title!r}: {len(self)} runs over {over}>"

    def run(self, *, workers: int | None = None, keep: bool = True, progress: bool | None = None) -> Runs:
        """Make all runs and return their results; nothing is written.

        Runs are made by worker processes, those with plain Python that is not native in this process,
        serially. A failed run has a row with its reason in the table. All warnings are issued as one
        `YawbenchWarning`.

        Args:
            workers: number of processes; default: the number of cores.
            keep: keep the results of all runs in memory, for `Runs.runs`.
            progress: show a bar; default: in a terminal or a notebook, after two seconds.

        Raises:
            YawbenchError: a run cannot start; none has been made.
        """
        workers = None if workers is None else arguments.count(workers, "workers")
        keep = arguments.flag(keep, "keep")
        progress = None if progress is None else arguments.flag(progress, "progress")
        with bar(self._design.spec.title, len(self), wanted=progress) as shown:
            findings, outcomes = executed(
                self._design, self.base._programs, workers=workers, done=lambda outcome: shown.advance()
            )
        runs = [Run(outcome.value) if outcome.ok else None for outcome in outcomes] if keep else None
        planned = findings.planned
        assert planned is not None
        diagnostics = [entry for job in planned.jobs if job.plan for entry in job.plan.diagnostics]
        if warning := findings.remarkable():
            diagnostics.append(Diagnostic("runs-with-warnings", warning, "warning"))
        warn(self._design.spec.title, diagnostics)
        return Runs(findings, runs)


def executed(
    design: Design,
    programs: Mapping[Path, PythonComponent],
    *,
    workers: int | None,
    done: Callable[[Outcome], None],
) -> tuple[ExperimentResult, list[Outcome]]:
    """Plan all runs of an experiment and make them in memory; return its result, and every outcome.

    Args:
        design: the experiment.
        programs: Python components by their virtual paths.
        workers, done: see `make_all`.

    Raises:
        YawbenchError: a run cannot start; none has been made.
    """
    planned = plan_experiment(design, design.path.parent, planner=planner_of(programs))
    metrics = metrics_of(planned.experiment)
    outcomes = make_all(planned.jobs, programs, workers=workers, done=done, run=_in_memory)
    records = [measured(outcome.value, metrics) if outcome.ok else outcome.record for outcome in outcomes]
    return ExperimentResult(planned.experiment, records, {}, planned), outcomes


def _in_memory(job: Job, opener: OpenInstance = open_instance) -> Results:
    assert job.plan is not None
    return simulate_in_memory(job.plan, opener=opener, watch=WarningWatch(job.plan))


def _known(argument: str, names: Iterable[str], among: Collection[str]) -> None:
    """Check that there is what an argument names."""
    for name in names:
        if name not in among:
            guess = hint(name, among, lead="there are")
            raise ScenarioError(f"{argument}: there is no {short(name)}{guess}", code="argument-invalid")


@dataclass(frozen=True)
class Runs:
    """Results of an experiment.

        >>> made = yb.experiment(base, {"driver.amplitude": [0.02, 0.03]}).run()
        >>> made.runs[0].metric("peak(sideslip)") < made.runs[1].metric("peak(sideslip)")
        True

    Attributes:
        runs: every run, None for a failed run; None if results were not kept.
    """

    _findings: ExperimentResult
    runs: list[Run | None] | None = None

    @cached_property
    def table(self) -> pd.DataFrame:
        """Table with a row per run: axes, status, reason, metrics, key; `attrs["units"]` has the units."""
        return to_pandas(columns_of(self._findings))

    @property
    def statistics(self) -> pd.DataFrame:
        """Mean, deviation and percentiles of each metric over what is drawn, with their intervals."""
        return self._of_sample("statistics")

    @property
    def differences(self) -> pd.DataFrame:
        """Differences of each metric from the first level of each listed axis, at the same points drawn."""
        return self._of_sample("differences")

    @property
    def sensitivity(self) -> pd.DataFrame:
        """Rank correlations of each metric with what is drawn; of the design "saltelli" Sobol indices."""
        return self._of_sample("sensitivity")

    def probability(
        self,
        metric: str,
        *,
        below: float | str | None = None,
        at_most: float | str | None = None,
        above: float | str | None = None,
        at_least: float | str | None = None,
    ) -> pd.DataFrame:
        """Return the probability that a metric is within a bound, with its interval (Clopper and Pearson).

            >>> uncertain = {"friction": yb.uniform(0.4, 0.9)}
            >>> made = yb.experiment(base, uncertain, metrics="spins(sideslip)", points=8).run()
            >>> made.probability("spins(sideslip)")[["runs", "meeting"]].values.tolist()
            [[8, 0]]

        Args:
            metric: a column of the table.
            below, at_most, above, at_least: the bound, in SI or with a unit; exactly one. None for a metric
                that is 1 where something happens, else 0: the probability that it happens.

        A run without a number, because it failed say, is not within a bound; whether something happens in it
        is unknown, and it does not count.

        Raises:
            ScenarioError: the metric is unknown, or not exactly one bound is given.
            ResultsError: nothing was drawn.
        """
        key = arguments.text(metric, "metric")
        bounds = {"below": below, "at_most": at_most, "above": above, "at_least": at_least}
        given = {name: arguments.scalar(x, name) for name, x in bounds.items() if x is not None}
        _known("metric", [key], self._findings.spec.metrics)
        for name, bound in given.items():
            with arguments.as_scenario_errors(f"{name}:"):
                si_number(bound, self._findings.unit(key))
        spec, name, asked = self._findings.spec, key, {}
        whether = key in self._findings.whether
        if len(given) > 1 or not (given or whether):
            which = listed(bounds, last="or")
            raise ScenarioError(
                f"give exactly one of {which}, since {key} is a number", code="argument-invalid"
            )
        if given:
            assertion = made(Assertion, says=key, holds_if=[{"metric": key, **given}])
            name = str(assertion.holds_if[0])
            asked = {name: assertion}
        experiment = replace(self._findings.experiment, spec=spec.model_copy(update={"probabilities": asked}))
        found = replace(self, _findings=replace(self._findings, experiment=experiment))
        every = found._of_sample("probabilities")
        return every[every["probability of"] == name].reset_index(drop=True)

    def _of_sample(self, name: str) -> pd.DataFrame:
        if name not in (tables := sample_columns(self._findings, [name])):
            raise self._lacking(name)
        return to_pandas(tables[name])

    def _lacking(self, name: str) -> ResultsError:
        """Return the error that says why a table of a sample has no rows."""
        if not groups_of(self._findings):
            return ResultsError("nothing was drawn: give an axis a distribution", code="results-missing")
        why = f"there are no {name}: no listed axis has two levels, or no run has a number"
        if name == "probabilities":
            why = f"there are no {name}: no run has a number that is 1 where something happens, else 0"
        return ResultsError(why, code="results-missing")

    def to_latex(
        self,
        columns: Iterable[str] | Mapping[str, str] = (),
        *,
        of: Literal["runs", "statistics", "probabilities", "differences", "sensitivity"] = "runs",
        caption: str | None = None,
        label: str = "",
    ) -> str:
        """Return a table for LaTeX, in displayed units; it needs the package booktabs.

            >>> axes = {"driver.amplitude": [0.02, 0.03]}
            >>> made = yb.experiment(base, axes, metrics=["peak(sideslip)"]).run()
            >>> text = made.to_latex({"driver.amplitude": "amplitude", "peak(sideslip)": "sideslip"})
            >>> print(text.splitlines()[5])
            amplitude & sideslip \\\\

        Args:
            columns: columns of the table, or a mapping of them to headings; default: axes and metrics.
                Where a run failed, the status is added. Of a sample's tables: metrics, or a mapping of them
                to captions.
            of: what there are rows of: the runs, or what a sample comes to, with intervals, in a table for
                each metric.
            caption: above it; default: the title. Of a sample's tables for one metric alone.
            label: for `\\ref`, such as "tab:runs"; default: none. Likewise for one metric.

        Raises:
            ScenarioError: there is no such column.
            ResultsError: nothing was drawn.
        """
        given = (
            arguments.mapping(columns, "columns", "a mapping of columns to headings")
            if isinstance(columns, Mapping)
            else {name: name for name in arguments.texts(columns, "columns")}
        )
        named = {name: arguments.text(words, "columns") for name, words in given.items()}
        title = None if caption is None else arguments.text(caption, "caption", empty=True)
        for_ref = arguments.text(label, "label", empty=True)
        _known("of", [arguments.text(of, "of")], ("runs", *SAMPLE_TABLES))
        if of == "runs":
            return to_latex(self._table_of_runs(named, title), label=for_ref)
        metrics = self._findings.spec.metrics
        _known("columns", named, metrics)
        tables = {
            key: table for key in named or metrics for table in sample_tables(self._findings, [of], [key])
        }
        if not tables:
            raise self._lacking(of)
        captions = named if isinstance(columns, Mapping) else {}
        if len(tables) > 1 and (title is not None or for_ref):
            which = f"of one metric: name one of {listed(tables)} in columns"
            raise ScenarioError(f"caption and label are {which}", code="argument-invalid")
        for key, table in tables.items():
            table.title = title if title is not None else captions.get(key, table.title)
        return "\n".join(to_latex(table, label=for_ref) for table in tables.values())

    def _table_of_runs(self, named: Mapping[str, str], title: str | None) -> Table:
        """Return the table of the runs with the columns of these headings."""
        whole, spec = columns_of(self._findings), self._findings.spec
        headings = dict(named or {name: name for name in (*spec.axes, *spec.metrics)})
        if self._findings.failed:
            headings.setdefault("status", "status")
        _known("columns", headings, whole.headings)
        chosen = [whole.headings.index(name) for name in headings]
        return Table(
            spec.title if title is None else title,
            [replace(whole.columns[k], heading=headings[whole.headings[k]]) for k in chosen],
            [[row[k] for k in chosen] for row in whole.rows],
        )

    def to_xarray(self) -> xr.Dataset:
        """Return all columns of all runs over the axes and time; `attrs["units"]` of each has its unit.

        Failed runs, and columns that a run did not record, are NaN.

        Raises:
            ResultsError: results were not kept, or the runs have different times.
        """
        return dataset(self._findings.spec.title, self.table, list(self._findings.spec.axes), self.runs or ())

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
            x: horizontal axis.
            y: vertical axis of a map.
            lines, panels: axes with a line or a panel for each level.
            title: default: none.
            scale: of the metric.
            largest: upper end of the metric's scale, in SI or with a unit; default: at the largest value.
            mark: a value of the metric to draw a line at, in SI or with a unit.
            only: axis -> those of its levels that are drawn; default: all.

        Raises:
            ScenarioError: an axis or metric is unknown, or an axis is not used.
            ResultsError: no run has a value.
        """
        metric, x = arguments.text(metric, "metric"), arguments.text(x, "x")
        given = (("y", y), ("lines", lines), ("panels", panels))
        others = {key: text for key, axis in given if (text := arguments.text(axis, key, empty=True))}
        levels = (
            {} if only is None else arguments.mapping(only, "only", "a mapping of axes to lists of levels")
        )
        spec = made(
            FigureSpec,
            name="figure",
            kind="map" if "y" in others else "curve",
            metric=metric,
            x=x,
            **others,
            title=arguments.text(title, "title", empty=True),
            scale=arguments.text(scale, "scale"),
            largest=self._limit("largest", largest, metric),
            mark=self._limit("mark", mark, metric),
            only={axis: _levels_of(axis, chosen) for axis, chosen in levels.items()},
        )
        experiment = self._findings.experiment
        refuse(problems_of_figure(experiment.spec, experiment.runs, spec))
        return shown_in_notebooks(draw_over_axes(self._findings, spec))

    def _limit(self, name: str, value: float | str | None, metric: str) -> Value | None:
        """Return a value on the metric's scale as plain Python."""
        if value is None:
            return None
        converted = arguments.scalar(value, name)
        with arguments.as_scenario_errors(f"{name}:"):
            if not abs(si_number(converted, self.table.attrs["units"].get(metric, ""))) < FAR:
                raise ValueError(f"must be between {-FAR:g} and {FAR:g} (got {short(converted)})")
        return converted

    def __repr__(self) -> str:
        result, warning = self._findings, self._findings.remarkable()
        noted = f"; {warning}" if warning else ""
        title, ran = result.experiment.title, len(result.records)
        return f"<Runs {title!r}: {ran} runs, {len(result.failed)} failed{noted}>"

    def _repr_html_(self) -> str:
        return str(self.table.drop(columns="key").to_html(index=False, na_rep=""))


def _levels_of(axis: str, levels: Any) -> list[Any]:
    """Return the levels of an axis that a figure is restricted to."""
    name = f"only[{axis!r}]"
    return list(numbers_of(name, arguments.items(levels, name, "a list of levels"))["values"])

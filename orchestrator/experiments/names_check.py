"""Checks that the runs, metrics, axes, numbers and grids an experiment file refers to exist."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from ..messages import hint
from ..scenario.yaml_lines import Document, KeyPath
from ..signal_names import Target
from .claim_schema import MetricReference, text_of
from .experiment_design import RUN, levels_of, names_of
from .published_tables import cells
from .schema import ExperimentSpec, FigureSpec

if TYPE_CHECKING:
    from .experiment import LoadedExperiment

COLUMNS = (RUN, "status", "reason", "warnings", "key")
"""Columns of the table besides axes and metrics."""


def check_axes(spec: ExperimentSpec, document: Document) -> None:
    """Report targets that two axes, or an axis and `set` or `swap`, override."""
    seen: dict[Target, str] = dict.fromkeys(spec.targets, "set and swap")
    for name, axis in spec.axes.items():
        for target in axis.targets:
            if target in seen:
                also = f"axis {seen[target]!r}" if seen[target] in spec.axes else "set or swap"
                document.report(("axes", name), f"{target} is given by {also} already", "name-duplicate")
            seen[target] = name
    for group, names in (("axes", spec.axes), ("metrics", spec.metrics)):
        for name in names:
            if name in COLUMNS or (group == "axes" and name in spec.metrics):
                document.report(
                    (group, name), f"{name!r} is the name of another column of the table", "name-duplicate"
                )


def check_names(experiment: LoadedExperiment, document: Document) -> None:
    """Report every reference to a run, metric, axis or number that does not exist."""
    spec, runs = experiment.spec, experiment.runs
    known: dict[str, tuple[Mapping[str, object], str]] = {
        "run": (runs, "runs"),
        "metric": (spec.metrics, "metrics"),
        "axis": (spec.axes, "axes"),
        "derived number": (spec.derived, "there are"),
        "grid": (spec.grids, "grids"),
        "limit": (spec.limits, "limits"),
        "open value": (spec.region.open_values if spec.region else {}, "open values"),
    }
    for what, name, key in itertools.chain(_names(spec), _names_of_conditions(experiment, document)):
        names, lead = known[what]
        if name not in names:
            document.report(key, f"there is no {what} {name!r}{hint(name, names, lead=lead)}", "name-unknown")
    for patterns, key in _patterns(spec):
        for k, pattern in enumerate(patterns):
            if not experiment.matching([pattern]):
                sentence = f"no run is named {pattern!r}{hint(pattern, runs, lead='runs')}"
                document.report((*key, "runs", k), sentence, "name-unknown")
    _check_correlations(spec, document)
    _check_limits(spec, document)
    for i, figure in enumerate(spec.figures):
        if figure.name in [other.name for other in spec.figures[:i]]:
            document.report(
                ("figures", i, "name"), f"there is already a figure {figure.name!r}", "name-duplicate"
            )
        if figure.what.shows == "runs" and spec.axes:
            document.report(
                ("figures", i, "kind"), "runs along axes are drawn as curve, map or limit", "figure-invalid"
            )
        _check_levels(spec, document, i, figure)
        if figure.what.over_axes:
            _check_places(spec, document, i, figure)


def _names(spec: ExperimentSpec) -> Iterator[tuple[str, str, KeyPath]]:
    """Yield (kind, name, key) of all references except patterns of runs."""
    for i, table in enumerate(spec.tables):
        for k, name in enumerate(table.metrics):
            yield "metric", name, ("tables", i, "metrics", k)
    for name, grid in spec.grids.items():
        for cell in cells(grid):
            what, named = ("derived number", cell.metric) if grid.derived else ("run", cell.run)
            yield what, named, ("grids", name)
        if grid.metric:
            yield "metric", grid.metric, ("grids", name, "metric")
    for name, number in spec.derived.items():
        for word, source in number.of.items():
            yield "run", source.run, ("derived", name, "of", word, "run")
            yield "metric", source.metric, ("derived", name, "of", word, "metric")
        if number.rank_correlation is not None:
            yield "grid", number.rank_correlation, ("derived", name, "rank_correlation")
    for group, i, claim in spec.assertions():
        for k, name in enumerate(claim.open_values or ()):
            yield "open value", name, (group, i, "open_values", k)
    if spec.tuning:
        yield "derived number", spec.tuning.objective, ("tuning", "objective")
    for i, validation in enumerate(spec.validations):
        yield "run", validation.run, ("validations", i, "run")
    for name, limit in spec.limits.items():
        yield "axis", limit.of, ("limits", name, "of")
    for i, figure in enumerate(spec.figures):
        for name, axis in figure.axes.items():
            if axis != RUN or not spec.runs:
                yield "axis", axis, ("figures", i, name)
        for axis in figure.only:
            yield "axis", axis, ("figures", i, "only", axis)
        for what in ("metric", "limit", "grid"):
            if name := getattr(figure, what):
                yield what, name, ("figures", i, what)


def _names_of_conditions(
    experiment: LoadedExperiment, document: Document
) -> Iterator[tuple[str, str, KeyPath]]:
    """Yield the references in conditions likewise; report conditions without a run."""
    for key, condition in experiment.spec.conditions():
        if condition.derived:
            yield "derived number", condition.derived, (*key, "derived")
            continue
        if not condition.run and experiment.spec.runs and key[0] != "limits":
            document.report(key, "needs run and metric, or derived in place of both", "figure-invalid")
            continue
        if condition.run and not experiment.matching([condition.run]):
            yield "run", condition.run, (*key, "run")
        yield "metric", condition.metric, (*key, "metric")
        if isinstance(condition.bound, MetricReference):
            yield "run", condition.bound.run, (*key, condition.relation, "run")
            yield "metric", condition.bound.metric, (*key, condition.relation, "metric")


def _patterns(spec: ExperimentSpec) -> Iterator[tuple[Sequence[str], KeyPath]]:
    """Yield (patterns of runs, key of the part that has them)."""
    for name, axis in spec.axes.items():
        yield axis.runs, ("axes", name)
    for i, table in enumerate(spec.tables):
        yield table.runs, ("tables", i)
    for name, open_value in spec.region.open_values.items() if spec.region else ():
        yield open_value.runs, ("region", "open_values", name)
    if spec.tuning:
        yield spec.tuning.runs, ("tuning",)
    for i, figure in enumerate(spec.figures):
        yield figure.runs, ("figures", i)


def _check_correlations(spec: ExperimentSpec, document: Document) -> None:
    """Report rank correlations over rows, columns or published numbers that the grid lacks."""
    for name, number in spec.derived.items():
        grid = spec.grids.get(number.rank_correlation or "")
        if grid is None:
            continue
        axes = {**grid.rows, **grid.columns}
        for axis, counted in number.only.items():
            where: KeyPath = ("derived", name, "only", axis)
            if axis not in axes:
                document.report(
                    where, f"there is no axis {axis!r}{hint(axis, axes, lead='the grid has')}", "axis-unknown"
                )
                continue
            for part in (part for part in counted if part not in axes[axis]):
                guess = hint(part, axes[axis], lead=f"{axis} has")
                document.report(where, f"there is no value {part!r}{guess}", "name-unknown")
        if all(cell.published is None for cell in cells(grid)):
            sentence = f"grid {number.rank_correlation!r} has no published numbers to compare with"
            document.report(("derived", name, "rank_correlation"), sentence, "figure-invalid")


def _check_limits(spec: ExperimentSpec, document: Document) -> None:
    """Report limits of axes that cannot have one."""
    for name, limit in spec.limits.items():
        if limit.of in spec.axes and not spec.axes[limit.of].numeric:
            document.report(
                ("limits", name, "of"), f"the values of {limit.of!r} must be numbers", "figure-invalid"
            )
        if limit.of in spec.repeats:
            document.report(("limits", name, "of"), f"numbers are means over {limit.of!r}", "figure-invalid")
        if spec.design != "grid":
            document.report(("limits", name), "limits need a grid", "figure-invalid")


def _check_levels(spec: ExperimentSpec, document: Document, i: int, figure: FigureSpec) -> None:
    """Report values in a figure's `only` that the axis does not have."""
    for axis, chosen in figure.only.items():
        if axis not in spec.axes or (spec.design == "latin_hypercube" and spec.axes[axis].numeric):
            continue
        known = [text_of(level.value) for level in levels_of(spec.axes[axis])]
        names = {name for level in levels_of(spec.axes[axis]) for name in names_of(spec.axes[axis], level)}
        for value in (value for value in chosen if text_of(value) not in names):
            sentence = f"{axis} has no value {value!r}{hint(text_of(value), known, lead='it has')}"
            document.report(("figures", i, "only", axis), sentence, "figure-invalid")


def _check_places(spec: ExperimentSpec, document: Document, i: int, figure: FigureSpec) -> None:
    """Report axes of a grid that a figure does not show, or shows twice."""
    used = {*figure.axes.values()}
    for name, axis in figure.axes.items():
        if axis in spec.repeats:
            document.report(("figures", i, name), f"numbers are means over {axis!r}", "figure-invalid")
        if name in "xy" and axis in spec.axes and figure.what.upwards and not spec.axes[axis].numeric:
            document.report(("figures", i), f"the values of {axis!r} must be numbers", "figure-invalid")
    if figure.limit in spec.limits:
        of = spec.limits[figure.limit].of
        if of in used:
            document.report(
                ("figures", i), f"{of!r} is the axis of the limit {figure.limit!r}", "figure-invalid"
            )
        used.add(of)
    left = [
        name for name in (*spec.axes, *([RUN] if spec.runs else [])) if name not in used | {*spec.repeats}
    ]
    if spec.design == "grid" and left and not document.errors:
        sentence = f"the axis {left[0]!r} is not used in this figure: assign it to lines or panels"
        document.report(("figures", i), sentence, "figure-invalid")

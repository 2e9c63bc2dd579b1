"""What can be wrong with an experiment as a whole: names that nothing has, figures that leave an axis out.

A problem has its key in an experiment file, to which the reader of files adds the line; the arguments of the
library are called alike.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from yawbench.foundation.errors import Diagnostic, Location, ScenarioError
from yawbench.foundation.messages import hint
from yawbench.orchestrator.scenario.yaml_lines import KeyPath, dotted
from yawbench.orchestrator.signal_names import Target

from .axes import RUN, levels_of, names_of
from .claim_schema import Condition, MetricReference, text_of
from .derived import cells
from .schema import ExperimentSpec, FigureSpec
from .sections import sections

if TYPE_CHECKING:
    from .experiment import LoadedExperiment


class Problem(NamedTuple):
    """A mistake in an experiment."""

    key: KeyPath  # in its file
    sentence: str
    code: str = ScenarioError.default_code


def refuse(problems: Sequence[Problem]) -> None:
    """Raise the mistakes of an experiment made in Python, if there are any, as ScenarioError."""
    if problems:
        raise ScenarioError([
            Diagnostic(problem.code, problem.sentence, location=Location(target=dotted(problem.key)))
            for problem in problems
        ])  # fmt: skip


COLUMNS = (RUN, "status", "reason", "warnings", "key")
"""Columns of the table besides axes and metrics."""


def problems_of(experiment: LoadedExperiment) -> list[Problem]:
    """Return all mistakes; that a figure leaves an axis out only if there is no other."""
    spec = experiment.spec
    found = [
        *_in_axes(spec), *_in_names(experiment), *_in_correlations(spec), *_in_limits(spec),
        *_in_sections(spec),
    ]  # fmt: skip
    for i, figure in enumerate(spec.figures):
        problems = problems_of_figure(experiment, figure)
        if figure.name in [other.name for other in spec.figures[:i]]:
            already = f"there is already a figure {figure.name!r}"
            problems.insert(0, Problem(("name",), already, "name-duplicate"))
        found += [problem._replace(key=("figures", i, *problem.key)) for problem in problems]
    return found


def problems_of_figure(experiment: LoadedExperiment, figure: FigureSpec) -> list[Problem]:
    """Return the mistakes of a figure, with keys in it; that it leaves an axis out if there is no other."""
    spec = experiment.spec
    names: list[tuple[str, str, KeyPath]] = [
        ("axis", axis, (key,)) for key, axis in figure.axes.items() if axis != RUN or not spec.runs
    ]
    names += [("axis", axis, ("only", axis)) for axis in figure.only]
    names += [
        (what, name, (what,)) for what in ("metric", "limit", "grid") if (name := getattr(figure, what))
    ]
    return [*_unknown(experiment, names), *_in_figure(spec, figure)] or [*_left_out(spec, figure)]


def _unknown(
    experiment: LoadedExperiment, references: Iterable[tuple[str, str, KeyPath]]
) -> Iterator[Problem]:
    """Yield the references, (kind, name, key), to what does not exist."""
    spec = experiment.spec
    known: dict[str, tuple[Mapping[str, object], str]] = {
        "run": (experiment.runs, "runs"),
        "metric": (spec.metrics, "metrics"),
        "axis": (spec.axes, "axes"),
        "derived number": (spec.derived, "there are"),
        "grid": (spec.grids, "grids"),
        "limit": (spec.limits, "limits"),
        "open value": (spec.region.open_values if spec.region else {}, "open values"),
    }
    for what, name, key in references:
        names, lead = known[what]
        if name not in names:
            yield Problem(key, f"there is no {what} {name!r}{hint(name, names, lead=lead)}", "name-unknown")


def _in_axes(spec: ExperimentSpec) -> Iterator[Problem]:
    """Yield targets that two axes, or an axis and `set` or `swap`, override, and names of other columns."""
    seen: dict[Target, str] = dict.fromkeys(spec.targets, "set and swap")
    for name, axis in spec.axes.items():
        for target in axis.targets:
            if target in seen:
                also = f"axis {seen[target]!r}" if seen[target] in spec.axes else "set or swap"
                yield Problem(("axes", name), f"{target} is given by {also} already", "name-duplicate")
            seen[target] = name
    for group, names in (("axes", spec.axes), ("metrics", spec.metrics)):
        for name in names:
            if name in COLUMNS or (group == "axes" and name in spec.metrics):
                taken = f"{name!r} is the name of another column of the table"
                yield Problem((group, name), taken, "name-duplicate")


def _in_sections(spec: ExperimentSpec) -> Iterator[Problem]:
    for section in sections():
        if spec.axes and getattr(spec, section, None):
            yield Problem((section,), "is about named runs, not about runs along axes")


def _in_names(experiment: LoadedExperiment) -> Iterator[Problem]:
    """Yield references to runs, metrics, axes or numbers that do not exist."""
    yield from _unknown(experiment, _names(experiment.spec))
    for key, condition in experiment.spec.conditions():
        if not (condition.derived or condition.run) and experiment.spec.runs and key[0] != "limits":
            yield Problem(key, "needs run and metric, or derived in place of both", "figure-invalid")
        else:
            yield from _unknown(experiment, _names_in(experiment, key, condition))
    for patterns, key in _patterns(experiment.spec):
        for k, pattern in enumerate(patterns):
            if not experiment.matching([pattern]):
                guess = hint(pattern, experiment.runs, lead="runs")
                yield Problem((*key, "runs", k), f"no run is named {pattern!r}{guess}", "name-unknown")


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
    for section in sections():
        for i, entry in enumerate(getattr(spec, section, ())):
            yield "run", entry.run, (section, i, "run")
    for name, limit in spec.limits.items():
        yield "axis", limit.of, ("limits", name, "of")


def _names_in(
    experiment: LoadedExperiment, key: KeyPath, condition: Condition
) -> Iterator[tuple[str, str, KeyPath]]:
    """Yield the references in a condition likewise; a run may be a pattern."""
    if condition.derived:
        yield "derived number", condition.derived, (*key, "derived")
        return
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


def _in_correlations(spec: ExperimentSpec) -> Iterator[Problem]:
    """Yield rank correlations over rows, columns or published numbers that the grid lacks."""
    for name, number in spec.derived.items():
        grid = spec.grids.get(number.rank_correlation or "")
        if grid is None:
            continue
        axes = {**grid.rows, **grid.columns}
        for axis, counted in number.only.items():
            where: KeyPath = ("derived", name, "only", axis)
            if axis not in axes:
                guess = hint(axis, axes, lead="the grid has")
                yield Problem(where, f"there is no axis {axis!r}{guess}", "axis-unknown")
                continue
            for part in (part for part in counted if part not in axes[axis]):
                guess = hint(part, axes[axis], lead=f"{axis} has")
                yield Problem(where, f"there is no value {part!r}{guess}", "name-unknown")
        if all(cell.published is None for cell in cells(grid)):
            sentence = f"grid {number.rank_correlation!r} has no published numbers to compare with"
            yield Problem(("derived", name, "rank_correlation"), sentence, "figure-invalid")


def _in_limits(spec: ExperimentSpec) -> Iterator[Problem]:
    """Yield limits of axes that cannot have one."""
    for name, limit in spec.limits.items():
        where: KeyPath = ("limits", name, "of")
        if limit.of in spec.axes and not spec.axes[limit.of].numeric:
            yield Problem(where, f"the values of {limit.of!r} must be numbers", "figure-invalid")
        if limit.of in spec.repeats:
            yield Problem(where, f"numbers are means over {limit.of!r}", "figure-invalid")
        if spec.design != "grid":
            yield Problem(where[:2], "limits need a grid", "figure-invalid")


def _in_figure(spec: ExperimentSpec, figure: FigureSpec) -> Iterator[Problem]:
    """Yield unknown values in `only`, and axes that cannot be shown as the figure does."""
    if figure.what.shows == "runs" and spec.axes:
        yield Problem(("kind",), "runs along axes are drawn as curve, map or limit", "figure-invalid")
    for name, chosen in figure.only.items():
        axis = spec.axes.get(name)
        if axis is None or (spec.design == "latin_hypercube" and axis.numeric):
            continue
        levels = levels_of(axis)
        names = {text for level in levels for text in names_of(axis, level)}
        for value in (value for value in chosen if text_of(value) not in names):
            guess = hint(text_of(value), [text_of(level.value) for level in levels], lead="it has")
            yield Problem(("only", name), f"{name} has no value {value!r}{guess}", "figure-invalid")
    for key, name in figure.axes.items() if figure.what.over_axes else ():
        if name in spec.repeats:
            yield Problem((key,), f"numbers are means over {name!r}", "figure-invalid")
        if key in "xy" and name in spec.axes and figure.what.upwards and not spec.axes[name].numeric:
            yield Problem((), f"the values of {name!r} must be numbers", "figure-invalid")
    if figure.limit in spec.limits and (of := spec.limits[figure.limit].of) in figure.axes.values():
        yield Problem((), f"{of!r} is the axis of the limit {figure.limit!r}", "figure-invalid")


def _left_out(spec: ExperimentSpec, figure: FigureSpec) -> Iterator[Problem]:
    """Yield the first axis of a grid that a figure over axes does not show."""
    shown = {*figure.axes.values(), *figure.only, *spec.repeats}
    if figure.limit in spec.limits:
        shown.add(spec.limits[figure.limit].of)
    left = [name for name in (*spec.axes, *([RUN] if spec.runs else [])) if name not in shown]
    if figure.what.over_axes and spec.design == "grid" and left:
        sentence = f"the axis {left[0]!r} is not used in this figure: assign it to lines or panels"
        yield Problem((), sentence, "figure-invalid")

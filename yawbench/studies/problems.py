"""What can be wrong with an experiment as a whole: names that nothing has, figures that leave an axis out.

A problem has its key in an experiment file, to which the reader of files adds the line; the arguments of the
library are called alike.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from fnmatch import fnmatchcase
from typing import Any, NamedTuple

from pydantic import BaseModel

from yawbench.foundation.errors import Diagnostic, Location, ScenarioError
from yawbench.foundation.messages import hint
from yawbench.orchestrator.scenario.yaml_lines import KeyPath, dotted
from yawbench.orchestrator.signal_names import Target

from .axes import RUN, levels_of, names_of
from .claim_schema import NameOf, text_of
from .derived import cells
from .schema import ExperimentSpec, FigureSpec
from .sections import sections

Reference = tuple[str, str, KeyPath]
"""What is named (`NameOf.kind`), its name, and the key of that."""


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


def problems_of(
    spec: ExperimentSpec, runs: Collection[str], overridden: Iterable[Target] = ()
) -> list[Problem]:
    """Return all mistakes in an experiment with these named runs; `overridden`: targets that options set."""
    found = [*_in_axes(spec, overridden), *_in_names(spec, runs), *_in_correlations(spec), *_in_limits(spec)]
    for i, figure in enumerate(spec.figures):
        problems = problems_of_figure(spec, runs, figure)
        if figure.name in [other.name for other in spec.figures[:i]]:
            already = f"there is already a figure {figure.name!r}"
            problems.insert(0, Problem(("name",), already, "name-duplicate"))
        found += [problem._replace(key=("figures", i, *problem.key)) for problem in problems]
    return found


def problems_of_figure(spec: ExperimentSpec, runs: Collection[str], figure: FigureSpec) -> list[Problem]:
    """Return the mistakes of a figure, with keys in it; that it leaves an axis out if there is no other."""
    names = [*named_in(figure)]
    if figure.panel_axis:
        names.append(("axis or run", figure.panel_axis, ("panels",)))
    return [*_unknown(spec, runs, names), *_in_figure(spec, figure)] or [*_left_out(spec, figure)]


def named_in(part: Any, key: KeyPath = ()) -> Iterator[Reference]:
    """Yield what the fields of a part of an experiment name, as their schema marks it (`NameOf`)."""
    if not isinstance(part, BaseModel):
        for k, inner in part.items() if isinstance(part, dict) else enumerate(part):
            if isinstance(inner, (BaseModel, dict, list)):
                yield from named_in(inner, (*key, k))
        return
    for field, about in type(part).model_fields.items():
        given, where = getattr(part, field), (*key, about.alias or field)
        kind = next((mark.kind for mark in about.metadata if isinstance(mark, NameOf)), "")
        if kind and isinstance(given, str):
            yield from [(kind, given, where)] if given else ()
        elif kind:
            pairs = zip(given, given, strict=True) if isinstance(given, dict) else enumerate(given or ())
            yield from ((kind, name, (*where, k)) for k, name in pairs)
        elif isinstance(given, (BaseModel, dict, list)):
            yield from named_in(given, where)


def _unknown(
    spec: ExperimentSpec, runs: Collection[str], references: Iterable[Reference]
) -> Iterator[Problem]:
    """Yield the references to what does not exist."""
    known: dict[str, tuple[Collection[str], str]] = {
        "run": (runs, "runs"),
        "metric": (spec.metrics, "metrics"),
        "axis": (spec.axes, "axes"),
        "axis or run": ([*spec.axes, *([RUN] if spec.runs else [])], "axes"),
        "derived number": (spec.derived, "there are"),
        "grid": (spec.grids, "grids"),
        "limit": (spec.limits, "limits"),
        "open value": (spec.region.open_values if spec.region else {}, "open values"),
    }
    for what, name, key in references:
        if what == "runs":
            if not any(fnmatchcase(run, name) for run in runs):
                guess = hint(name, runs, lead="runs")
                yield Problem(key, f"no run is named {name!r}{guess}", "name-unknown")
            continue
        names, lead = known[what]
        if name not in names:
            guess = hint(name, names, lead=lead)
            yield Problem(key, f"there is no {what.removesuffix(' or run')} {name!r}{guess}", "name-unknown")


def _in_axes(spec: ExperimentSpec, overridden: Iterable[Target]) -> Iterator[Problem]:
    """Yield targets of two axes, or of an axis and `set` or `swap`; sections; names of other columns."""
    seen: dict[Target, str] = dict.fromkeys([*spec.targets, *overridden], "set and swap")
    for name, axis in spec.axes.items():
        for target in axis.targets:
            if target in seen:
                also = f"axis {seen[target]!r}" if seen[target] in spec.axes else "set or swap"
                yield Problem(("axes", name), f"{target} is given by {also} already", "name-duplicate")
            seen[target] = name
    for section in sections() if spec.axes else ():
        if getattr(spec, section, None):
            yield Problem((section,), "is about named runs, not about runs along axes")
    for group, names in (("axes", spec.axes), ("metrics", spec.metrics)):
        for name in names:
            if name in COLUMNS or (group == "axes" and name in spec.metrics):
                taken = f"{name!r} is the name of another column of the table"
                yield Problem((group, name), taken, "name-duplicate")


def _in_names(spec: ExperimentSpec, runs: Collection[str]) -> Iterator[Problem]:
    """Yield references to runs, metrics, axes or numbers that do not exist, but for those of figures."""
    for field in type(spec).model_fields:
        if field not in ("figures", "claims", "checks"):
            yield from _unknown(spec, runs, named_in({field: getattr(spec, field)}))
    for group, number, claim in spec.assertions():
        yield from _unknown(spec, runs, named_in(claim, (group, number)))
    for key, condition in spec.conditions():
        if (
            not (condition.derived or condition.run)
            and spec.runs
            and key[0] not in ("limits", "probabilities")
        ):
            yield Problem(key, "needs run and metric, or derived in place of both", "figure-invalid")
    for name, grid in spec.grids.items():
        what = "derived number" if grid.derived else "run"
        cell_names = (cell.metric if grid.derived else cell.run for cell in cells(grid))
        yield from _unknown(spec, runs, ((what, one, ("grids", name)) for one in cell_names))


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
        if axis is None or (spec.sampled and axis.drawn):
            continue
        levels = levels_of(axis)
        names = {text for level in levels for text in names_of(axis, level)}
        for value in (value for value in chosen if text_of(value) not in names):
            guess = hint(text_of(value), [text_of(level.value) for level in levels], lead="it has")
            yield Problem(("only", name), f"{name} has no value {value!r}{guess}", "figure-invalid")
    for key, name in figure.axes.items() if figure.what.over_axes else ():
        if name in spec.repeats:
            yield Problem((key,), f"numbers are means over {name!r}", "figure-invalid")
        if figure.what.of_sample and name in spec.drawn:
            yield Problem(
                (key,), f"the values of {name!r} are drawn: nothing is said of each", "figure-invalid"
            )
        if key in "xy" and name in spec.axes and figure.what.upwards and not spec.axes[name].numeric:
            yield Problem((), f"the values of {name!r} must be numbers", "figure-invalid")
    if figure.what.of_sample and not spec.sampled:
        yield Problem(("kind",), f"a {figure.kind} needs a design that draws", "figure-invalid")
    if figure.against:
        known = {text for level in _levels_in(spec, figure.lines) for text in level}
        if figure.against not in known:
            guess = hint(figure.against, known, lead="lines has") if known else ": give lines, which has it"
            yield Problem(("against",), f"there is no value {figure.against!r}{guess}", "figure-invalid")
    if figure.limit in spec.limits and (of := spec.limits[figure.limit].of) in figure.axes.values():
        yield Problem((), f"{of!r} is the axis of the limit {figure.limit!r}", "figure-invalid")


def _levels_in(spec: ExperimentSpec, axis: str) -> list[tuple[str, ...]]:
    """Return the names of each listed value of an axis."""
    if axis not in spec.axes or axis in spec.drawn:
        return []
    return [names_of(spec.axes[axis], level) for level in levels_of(spec.axes[axis])]


def _left_out(spec: ExperimentSpec, figure: FigureSpec) -> Iterator[Problem]:
    """Yield the first axis of a grid that a figure over axes does not show."""
    shown = {*figure.axes.values(), *figure.only, *spec.repeats, *spec.drawn}
    if figure.limit in spec.limits:
        shown.add(spec.limits[figure.limit].of)
    left = [name for name in (*spec.axes, *([RUN] if spec.runs else [])) if name not in shown]
    if figure.what.over_axes and (spec.design == "grid" or spec.sampled) and left:
        sentence = f"the axis {left[0]!r} is not used in this figure: assign it to lines or panels"
        yield Problem((), sentence, "figure-invalid")

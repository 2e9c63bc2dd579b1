"""Reading a sweep file: every name resolved, every problem reported in one go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from ..errors import ScenarioError
from ..files import reads
from ..plan import Change, Value
from ..scenario import yaml_lines
from ..scenario.overrides import apply_to_all_runs, changes_of, changes_of_run
from ..scenario.strict import validate
from ..scenario.yaml_lines import Document
from ..studies.jobs import Job
from ..studies.study_schema import text_of
from ..wording import hint
from .design import Level, Point, levels_of, points
from .schema import AxisSpec, FigureSpec, SweepSpec

COLUMNS = ("run", "status", "reason", "findings", "key")
"""Columns of the table beside the axes and the metrics."""


@dataclass(frozen=True)
class Sweep:
    """A sweep file that is right in itself."""

    path: Path
    spec: SweepSpec
    for_all: tuple[Change, ...] = ()  # in all runs

    @property
    def by_options(self) -> list[Change]:
        """What is changed in all runs against the file."""
        return [change for change in self.for_all if change.origin != "sweep"]

    @property
    def identity(self) -> str:
        """What tells sweeps apart: the name of the file and of its folder."""
        return f"{self.path.absolute().parent.name}/{self.path.name}"

    @cached_property
    def points(self) -> list[Point]:
        """All points, one per run."""
        return points(self.spec)

    def job(self, number: int, out: Path, fmus: Path | None) -> Job:
        """Return the job of a point's run; if it keeps its results, they go below `out`."""
        spec, folder = self.spec, self.path.parent
        changes = [*self.for_all]
        for axis, level in zip(spec.axes.values(), self.points[number], strict=True):
            if axis.kind == "vehicle":
                changes.append(Change("vehicle", str(folder / str(level.value)), "sweep"))
            elif axis.kind == "variant":
                variant = axis.variants[str(level.value)]
                if variant.vehicle:
                    changes.append(Change("vehicle", str(folder / variant.vehicle), "sweep"))
                changes += changes_of(variant.swap, variant.set, folder, "sweep")
            elif axis.kind == "fmu":
                changes += changes_of({axis.vary[0]: str(level.value)}, {}, folder, "sweep")
            else:
                changes += [Change(place, _given(axis, level), "sweep") for place in axis.vary]
        width = len(str(len(self.points)))
        name = f"{number + 1:0{width}}"
        return Job(name, folder / spec.scenario, out / name, tuple(changes), fmus)


def _given(axis: AxisSpec, level: Level) -> Value:
    """Return a level with the unit that the axis counts in."""
    if axis.unit:
        return f"{text_of(level.value)} {axis.unit}"
    return yaml_lines.scalar(level.value) if isinstance(level.value, str) else level.value


@reads("sweep file", ScenarioError)
def load_sweep(path: Path | str, *, changes: Sequence[Change] = ()) -> Sweep:
    """Read a sweep file.

    Args:
        path: of the file.
        changes: for all runs; the path of an FMU is relative to the working directory.

    Raises:
        ScenarioError: with everything that is wrong with it.
    """
    document = yaml_lines.read(Path(path), what="sweep file")
    apply_to_all_runs(document, changes)
    spec = validate(SweepSpec, document)
    if spec is None or document.problems:
        raise ScenarioError(document.sentences())
    own = changes_of_run(spec, "sweep") + changes_of(spec.swap, spec.set, Path(path).parent, "sweep")
    given = {change.place: change for change in changes}
    sweep = Sweep(Path(path), spec, (*(one for one in own if one.place not in given), *given.values()))
    _check_axes(spec, document)
    _check_names(spec, document)
    if document.problems:
        raise ScenarioError(document.sentences())
    return sweep


def _check_axes(spec: SweepSpec, document: Document) -> None:
    """Report a place that two axes, or an axis and `set` or `swap`, would both give a value."""
    seen: dict[str, str] = dict.fromkeys([*spec.set, *spec.swap], "set and swap")
    for name, axis in spec.axes.items():
        for place in axis.places:
            if place in seen:
                also = f"axis {seen[place]!r}" if seen[place] in spec.axes else "set or swap"
                document.report(("axes", name), f"{place} is given by {also} already")
            seen[place] = name
        if name in COLUMNS or name in spec.metrics:
            document.report(("axes", name), f"{name!r} is the name of another column of the table")
    for name in spec.metrics:
        if name in COLUMNS:
            document.report(("metrics", name), f"{name!r} is the name of another column of the table")


def _check_names(spec: SweepSpec, document: Document) -> None:
    """Report every axis, metric and limit that is named but does not exist."""
    for name, limit in spec.limits.items():
        _known(document, ("limits", name, "of"), limit.of, spec.axes, "axis", "axes")
        if limit.of in spec.axes and not spec.axes[limit.of].numeric:
            document.report(("limits", name, "of"), f"the values of {limit.of!r} are no numbers")
        for i, condition in enumerate(limit.holds_if):
            place = ("limits", name, "holds_if", i, "metric")
            _known(document, place, condition.metric, spec.metrics, "metric", "metrics")
        if spec.design != "grid":
            document.report(("limits", name), "limits need a grid")
    for i, figure in enumerate(spec.figures):
        if figure.name in [one.name for one in spec.figures[:i]]:
            document.report(("figures", i, "name"), f"there is already a figure {figure.name!r}")
        for group in ("x", "y", "lines", "panels"):
            if axis := getattr(figure, group):
                _known(document, ("figures", i, group), axis, spec.axes, "axis", "axes")
        if figure.metric:
            _known(document, ("figures", i, "metric"), figure.metric, spec.metrics, "metric", "metrics")
        if figure.limit:
            _known(document, ("figures", i, "limit"), figure.limit, spec.limits, "limit", "limits")
        _check_places(spec, document, i, figure)
        for axis, chosen in figure.only.items():
            _known(document, ("figures", i, "only", axis), axis, spec.axes, "axis", "axes")
            if axis not in spec.axes or (spec.design == "latin_hypercube" and spec.axes[axis].numeric):
                continue
            words = {text_of(level.value): level for level in levels_of(spec.axes[axis])}
            for value in chosen:
                if text_of(value) not in words:
                    sentence = f"{axis} has no value {value!r}" + hint(text_of(value), words, lead="it has")
                    document.report(("figures", i, "only", axis), sentence)


def _check_places(spec: SweepSpec, document: Document, i: int, figure: FigureSpec) -> None:
    """Report an axis of a grid that has no place in a figure, or two places."""
    used = {figure.x, figure.y, figure.lines, figure.panels}
    if figure.limit in spec.limits:
        of = spec.limits[figure.limit].of
        if of in used:
            document.report(("figures", i), f"{of!r} is what the limit {figure.limit!r} is of")
        used.add(of)
    for axis in (figure.x, figure.y):
        if axis in spec.axes and figure.kind == "map" and not spec.axes[axis].numeric:
            document.report(("figures", i), f"the values of {axis!r} are no numbers")
    left = [name for name in spec.axes if name not in used]
    if spec.design == "grid" and left and not document.problems:
        sentence = f"the axis {left[0]!r} has no place in this figure: make it lines or panels"
        document.report(("figures", i), sentence)


def _known(
    document: Document, key: tuple[str | int, ...], name: str, known: object, what: str, many: str
) -> None:
    names = list(known)  # type: ignore[call-overload]
    if name not in names:
        document.report(key, f"there is no {what} {name!r}" + hint(name, names, lead=many))

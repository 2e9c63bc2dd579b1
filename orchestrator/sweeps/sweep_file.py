"""Reading a sweep file: every name resolved, every problem reported in one go."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from ..errors import ScenarioError
from ..plan import Value
from ..scenario import overrides, yaml_lines
from ..scenario.strict import validate
from ..scenario.yaml_lines import Document
from ..studies.compare import fmu_and_settings
from ..studies.jobs import Job
from ..studies.study_schema import text_of
from ..wording import hint
from .design import Level, Point, levels_of, points
from .schema import AxisSpec, FigureSpec, SweepSpec

COLUMNS = ("run", "status", "reason", "key")
"""Columns of the table beside the axes and the metrics."""
MOST = 100_000
"""Runs of a sweep; chosen: more is a slip of the pen, and would be planned for an hour."""


@dataclass(frozen=True)
class Sweep:
    """A sweep file that is right in itself."""

    path: Path
    spec: SweepSpec

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
        swaps, settings = _changes(spec.swap, spec.set, folder)
        vehicle = None
        for axis, level in zip(spec.axes.values(), self.points[number], strict=True):
            if axis.kind == "vehicle":
                vehicle = folder / str(level.value)
            elif axis.kind == "variant":
                variant = axis.variants[str(level.value)]
                vehicle = folder / variant.vehicle if variant.vehicle else vehicle
                more = _changes(variant.swap, variant.set, folder)
                swaps, settings = swaps + more[0], settings + more[1]
            elif axis.kind == "fmu":
                more = _changes({axis.vary[0]: str(level.value)}, {}, folder)
                swaps, settings = swaps + more[0], settings + more[1]
            else:
                settings += [f"{place}={_given(axis, level)}" for place in axis.vary]
        width = len(str(len(self.points)))
        name = f"{number + 1:0{width}}"
        return Job(
            name, folder / spec.scenario, out / name, tuple(swaps), tuple(settings), spec.stop_time,
            spec.step_size, spec.algorithm, fmus, vehicle=vehicle,
        )  # fmt: skip


def _changes(swap: Mapping[str, str], set_: Mapping[str, Value], folder: Path) -> tuple[list[str], list[str]]:
    """Return swaps and settings as the command line takes them; an FMU may bring settings along."""
    swaps, settings = [], [f"{place}={text_of(value)}" for place, value in set_.items()]
    for unit, text in swap.items():
        fmu, brought = fmu_and_settings(text)
        swaps.append(f"{unit}={folder / fmu if overrides.is_path(fmu) else fmu}")
        settings += [f"{unit}.{one}" for one in brought]
    return swaps, settings


def _given(axis: AxisSpec, level: Level) -> str:
    """Return a level as `--set` takes it."""
    return f"{text_of(level.value)} {axis.unit}" if axis.unit else text_of(level.value)


def load_sweep(path: Path | str, *, swaps: Iterable[str] = (), settings: Iterable[str] = ()) -> Sweep:
    """Read a sweep file.

    Args:
        path: of the file.
        swaps: `unit=fmu` for all runs, as given to --swap; a path is relative to the working directory.
        settings: `unit.parameter=value` for all runs, as given to --set.

    Raises:
        ScenarioError: with everything that is wrong with it.
    """
    document = yaml_lines.read(Path(path), what="sweep file")
    overrides.apply_to_all_runs(document, swaps, settings)
    spec = validate(SweepSpec, document)
    if spec is None or document.problems:
        raise ScenarioError(document.sentences())
    sweep = Sweep(Path(path), spec)
    _check_axes(spec, document)
    _check_names(spec, document)
    if not document.problems and len(sweep.points) > MOST:
        document.report(("axes",), f"{len(sweep.points)} runs; at most {MOST} are taken")
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
